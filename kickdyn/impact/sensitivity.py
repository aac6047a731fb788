"""How a strike answers to small changes: its derivatives, by implicit differentiation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.contact_problem import ball_delassus
from kickdyn.impact.leg_derivatives import inertia_slopes, leg_slopes, per_mass, response
from kickdyn.impact.uncertainty_sources import LINK_INERTIA, OF_LEG, UNITS, columns

if TYPE_CHECKING:
    from kickdyn.impact.impact_result import Impact

AT_BOUNDARY = 1e-9
"""Share of the friction cone, or of the approach, below which stick and slip meet."""

Jacobians = Mapping[str, Array]


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(ReprMixin):
    """Derivatives of a strike's results, one Jacobian per source.

    Each attribute of type `Jacobians` maps the name of a source to an array of shape `(k, n)`: k is
    the size of the result, n that of the source. `kickdyn.impact.uncertainty_sources` says what
    each source is; q counts in the tangent space, like v.

    Attributes:
        impulse: of the impulse on the ball, k = 3 [N s per unit of the source, world frame].
        velocity: of the ball's velocity just after, k = 3 [m/s per unit].
        spin: of the ball's spin just after, k = 3 [rad/s per unit].
        v_after: of the joint velocity just after, k = nv [rad/s per unit].
        branch: `frictionless`, `stick` or `slip`.
        margin: distance to the other branch: in stick, the friction still to spare [N s]; in slip,
            the speed of sliding that is left [m/s]; inf without friction.
        margin_slope: of the margin, k = 1.
        at_boundary: whether the margin is gone to rounding. Stick and slip have different
            derivatives; these then hold to one side only.
    """

    impulse: Jacobians
    velocity: Jacobians
    spin: Jacobians
    v_after: Jacobians
    branch: str
    margin: float
    margin_slope: Jacobians
    at_boundary: bool

    def _rows(self) -> Iterable[Row]:
        yield "branch", self.branch, "at its end" if self.at_boundary else ""
        yield "margin", self.margin, {"stick": "N s", "slip": "m/s"}.get(self.branch, "")
        for source, rows in self.impulse.items():
            if source == "link_inertia":
                for name, (unit, which) in LINK_INERTIA.items():
                    each = rows.reshape(3, -1, 10)[:, :, which].reshape(3, -1)
                    gain = float(np.linalg.norm(each, 2))
                    yield f"impulse by {source}, {name}", gain, _per(unit)
            else:
                gain = float(np.linalg.norm(rows, 2))
                yield f"impulse by {source}, at most", gain, _per(UNITS[source])


def _per(unit: str) -> str:
    return f"N s per ({unit})" if set("/ ") & set(unit) else f"N s per {unit}"


def sensitivity(hit: Impact, *, of_leg: bool = True) -> Sensitivity:
    """Differentiate a strike by law `newton`, analytically.

    The impulse p solves R(p, x) = 0: restitution and no sliding, or restitution and Coulomb's cone
    against the sliding; so dp = -R_p^-1 R_x dx. What x does to the leg comes from Pinocchio's
    derivatives of Newton-Euler and of kinematics, and from its regressor; supports and loops bound
    it (`kickdyn.impact.leg_derivatives`).

    Args:
        hit: from `strike` or `strike_at`.
        of_leg: whether those by `sources.OF_LEG` are among them.

    Raises:
        InvalidInput: another law, a support that moves, after `unilateral_strike`, or a joint
            whose axes depend on its own angles (universal, composite, Euler angles).
    """
    if hit.law != "newton":
        raise InvalidInput(f"impact law {hit.law!r} has no sensitivities: choose newton")
    _check_stays(hit)
    names = UNITS if of_leg else [name for name in UNITS if name not in OF_LEG]
    at = columns(hit.posture.leg, names)
    answer = _at_fixed_impulse(hit, at)
    residual_p, residual_x, tangent = _residual(hit, answer, at)
    impulse = np.asarray(-np.linalg.solve(residual_p, residual_x), dtype=np.float64)
    smooth = hit.contact.friction == 0.0
    if smooth:  # how it turns does not matter: what stands here is rounding
        impulse[:, at["ball_radius"]] = impulse[:, at["ball_spin"]] = 0.0

    ball, posture = hit.ball, hit.posture
    velocity = answer.velocity + impulse / ball.mass
    spin = answer.spin - ball.radius / ball.inertia * pin.skew(hit.contact.normal) @ impulse
    if smooth:  # it goes on turning as it did; only friction that sets in would turn it
        setting_in = spin[:, at["friction"]].copy()
        spin[:] = 0.0
        spin[:, at["ball_spin"]], spin[:, at["friction"]] = np.eye(3), setting_in
    v_after = answer.v_after - response(posture) @ posture.jacobian.T @ impulse
    sliding = answer.after + _give(hit) @ impulse
    branch, margin, slope, scale = _margin(hit, answer, impulse, sliding, tangent, at)

    def named(rows: Array) -> Jacobians:
        rows.setflags(write=False)
        return {name: rows[:, place] for name, place in at.items()}

    return Sensitivity(
        impulse=named(impulse),
        velocity=named(velocity),
        spin=named(spin),
        v_after=named(v_after),
        branch=branch,
        margin=margin,
        margin_slope=named(slope.reshape(1, -1)),
        at_boundary=margin <= AT_BOUNDARY * scale,
    )


def _check_stays(hit: Impact) -> None:
    """Raise `InvalidInput` if what the supports hold moves after the impact."""
    hold = hit.posture.constraint_projector
    if hold is not None and hold.find_violation(hit.v_after) is not None:
        raise InvalidInput(
            f"a support moves at {hit.support_residual:.3g} after the impact (footing "
            f"{hit.footing}): sensitivities are for supports that hold"
        )


@dataclass(frozen=True)
class _Answer:
    """Derivatives while the impulse is held, one column per component of every source.

    Attributes:
        velocity, spin, v_after: of the results.
        before, after: of the contact points' relative velocity.
        normal: of the normal, which stays a unit vector.
        u_before, u_after: those velocities [m/s].
    """

    velocity: Array
    spin: Array
    v_after: Array
    before: Array
    after: Array
    normal: Array
    u_before: Array
    u_after: Array


def _at_fixed_impulse(hit: Impact, at: Mapping[str, slice]) -> _Answer:
    posture, ball, n, p = hit.posture, hit.ball, hit.contact.normal, hit.impulse
    kic, turned = posture.jacobian, pin.skew(n)
    r, gain = ball.radius, ball.radius / ball.inertia  # of a shell, 3 / (2 m r)
    width = max(place.stop for place in at.values())
    across = np.eye(3) - np.outer(n, n)

    velocity, spin, before = np.zeros((3, width)), np.zeros((3, width)), np.zeros((3, width))
    v_after, normal = np.zeros((posture.leg.nv, width)), np.zeros((3, width))
    normal[:, at["normal"]] = across

    velocity[:, at["ball_velocity"]] = np.eye(3)
    velocity[:, at["ball_mass"]] = -p[:, None] / ball.mass**2
    moment = gain * (turned @ p)[:, None]
    spin[:, at["ball_spin"]] = np.eye(3)
    spin[:, at["ball_mass"]] = moment / ball.mass
    spin[:, at["ball_radius"]] = moment / r
    spin[:, at["normal"]] = gain * pin.skew(p) @ across

    omega, omega_after = hit.ball_before.spin, hit.ball_after.spin
    before[:, at["ball_velocity"]] = np.eye(3)
    before[:, at["ball_spin"]] = r * turned
    before[:, at["ball_radius"]] = (turned @ omega)[:, None]
    before[:, at["normal"]] = -r * pin.skew(omega) @ across

    after = velocity + r * turned @ spin
    if "q" in at:
        leg = leg_slopes(posture, hit.v_before, hit.v_after, p, hit.constraint_impulses)
        by_inertia = inertia_slopes(posture, hit.v_after - hit.v_before)
        v_after[:, at["v"]] = leg.let
        v_after[:, at["q"]] = leg.v_after_q
        v_after[:, at["link_inertia"]] = by_inertia
        v_after[:, at["link_mass"]] = by_inertia @ per_mass(posture)
        before[:, at["v"]] = -kic @ leg.let
        before[:, at["q"]] = -leg.foot_q
        after -= kic @ v_after
        after[:, at["q"]] -= leg.foot_q_after
    after[:, at["ball_radius"]] = before[:, at["ball_radius"]]  # what the impulse adds has no r
    after[:, at["normal"]] -= r * pin.skew(omega_after) @ across

    u_before = hit.ball_before.velocity - kic @ hit.v_before + r * turned @ omega
    u_after = hit.ball_after.velocity - kic @ hit.v_after + r * turned @ omega_after
    return _Answer(velocity, spin, v_after, before, after, normal, u_before, u_after)


def _residual(hit: Impact, answer: _Answer, at: Mapping[str, slice]) -> tuple[Array, Array, Array]:
    """Return R_p, R_x and the direction of the sliding after, 0 where there is none."""
    n, p, e, mu = hit.contact.normal, hit.impulse, hit.contact.restitution, hit.contact.friction
    u_before, u_after, give = answer.u_before, answer.u_after, _give(hit)
    if hit.sticking:  # R = u+ + e n (n . u-)
        by_x = answer.after + e * np.outer(n, n @ answer.before + u_before @ answer.normal)
        by_x += e * float(n @ u_before) * answer.normal
        by_x[:, at["restitution"]] += (n * float(n @ u_before))[:, None]
        return give, by_x, np.zeros(3)

    # R = (p across n) + mu (n . p) t + n mass n . (u+ + e u-), t along the sliding
    across = np.eye(3) - np.outer(n, n)
    pressing, mass = float(n @ p), 1.0 / float(n @ give @ n)
    tangent, speed = _slide(n, p, across @ u_after, mu, math.hypot(*u_before))
    aside = pin.skew(n) @ tangent
    # The row along `aside`, times speed / (speed + mu p / mass): finite where the sliding dies out.
    firm = speed + mu * pressing / mass
    bend = mu * pressing / firm * np.outer(aside, aside) if mu else np.zeros((3, 3))
    keep = np.eye(3) - mu * pressing / mass / firm * np.outer(aside, aside) if mu else np.eye(3)

    slide_x = across @ answer.after - float(n @ u_after) * answer.normal
    along_n = n @ (answer.after + e * answer.before) + (u_after + e * u_before) @ answer.normal
    tilt = np.outer(mu * tangent - n, p) - mu * pressing * np.outer(n, tangent)
    tilt -= pressing * np.eye(3)
    by_x = keep @ (tilt @ answer.normal) + bend @ slide_x + mass * np.outer(n, along_n)
    by_x[:, at["friction"]] += (pressing * tangent)[:, None]
    by_x[:, at["restitution"]] += (mass * float(n @ u_before) * n)[:, None]
    by_p = keep @ across + mu * np.outer(tangent, n) + bend @ across @ give
    by_p += mass * np.outer(n, n @ give)
    return by_p, by_x, tangent


def _slide(n: Array, p: Array, slide: Array, mu: float, scale: float) -> tuple[Array, float]:
    """Return direction and speed of the sliding; friction, where there is any, knows it better."""
    if mu > 0.0:
        rubbing = float(n @ p) * n - p
        tangent = rubbing / math.hypot(*rubbing)
        return tangent, float(tangent @ slide)
    speed = math.hypot(*slide)
    return (slide / speed, speed) if speed > AT_BOUNDARY * scale else (np.zeros(3), 0.0)


def _margin(
    hit: Impact,
    answer: _Answer,
    impulse: Array,
    sliding: Array,
    tangent: Array,
    at: Mapping[str, slice],
) -> tuple[str, float, Array, float]:
    """Return the branch, its margin, the margin's derivative, and what the margin is small to."""
    n, p, mu = hit.contact.normal, hit.impulse, hit.contact.friction
    if mu == 0.0:
        return "frictionless", math.inf, np.zeros(impulse.shape[1]), 1.0
    pressing = float(n @ p)
    if not hit.sticking:
        speed = float(tangent @ answer.u_after)
        slope = tangent @ sliding - float(n @ answer.u_after) * (tangent @ answer.normal)
        return "slip", speed, slope, math.hypot(*answer.u_before)
    rubbing = p - pressing * n
    size = math.hypot(*rubbing)
    along = rubbing / size if size else rubbing
    pressing_x = n @ impulse + p @ answer.normal
    slope = mu * pressing_x - along @ (impulse - pressing * answer.normal)
    slope[at["friction"]] += pressing
    return "stick", mu * pressing - size, slope, mu * pressing


def _give(hit: Impact) -> Array:
    """Return the Delassus matrix of leg and ball, shape `(3, 3)` [1/kg]."""
    return hit.posture.delassus() + ball_delassus(hit.ball, hit.contact.normal)
