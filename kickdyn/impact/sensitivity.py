"""Derivatives of an impact by everything it depends on, by implicit differentiation."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import pinocchio as pin

from kickdyn.ball import BallState
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.approach import Approach
from kickdyn.impact.contact_problem import Solution
from kickdyn.impact.leg_derivatives import (
    LegDerivatives,
    ResponseSlopes,
    constrained_inverse_inertia,
    joint_impulse_derivatives,
    leg_derivatives,
    mass_derivatives,
)
from kickdyn.impact.leg_response import LegResponse
from kickdyn.restitution import ball_slopes, restitution_slope
from kickdyn.robot.leg import Leg

AT_BOUNDARY = 1e-9
"""Margin, relative to the friction cone or to the approach speed, at which stick and slip meet."""

UNITS = {
    "q": "rad",
    "v": "rad/s",
    "restitution": "1",
    "friction": "1",
    "normal": "rad",
    "ball_mass": "kg",
    "ball_radius": "m",
    "ball_velocity": "m/s",
    "ball_spin": "rad/s",
    "link_mass": "kg",
}
"""Every source, what an impact depends on, and its unit; of prismatic joints, q is in m and v m/s.

Of a leg with supports or loops, v and q count as far as these allow: v without what would move
them, q without what would open a loop, whereas supports are fixed wherever q puts them.
`restitution` adds to e, at every speed where it is a table.
`normal` is the direction of the contact normal as a unit vector: its component along the normal has
no effect. `ball_mass` scales the ball's inertia, too. `link_mass` scales a link as a whole: centre
of mass and radii of gyration stay; massless links do not count.
Links count as in `leg.joint_names`; all else is in the world frame.
"""

OF_LEG = ("q", "v", "link_mass")
"""Sources that change the leg; the others cost a fraction."""

Jacobians = Mapping[str, Array]


class Branch(StrEnum):
    """Which equations hold at the contact: without friction, sticking, or slipping."""

    FRICTIONLESS = "frictionless"
    STICK = "stick"
    SLIP = "slip"


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(ReprMixin):
    """Derivatives of an impact's results, one Jacobian per source.

    `kickdyn.impact.sensitivity.UNITS` has the names of the sources and their units. Each attribute
    of type `Jacobians` maps the name of a source to an array of shape `(k, n)`, with the k
    components of the result and the n of the source; q has nv, of its tangent space.

    Attributes:
        impulse: derivatives of the impulse on the ball, k = 3
            [N s per unit of the source, world frame].
        velocity: derivatives of the velocity of the ball after the impact, k = 3
            [m/s per unit of the source, world frame].
        spin: derivatives of the spin of the ball after the impact, k = 3
            [rad/s per unit of the source, world frame].
        v_after: derivatives of the joint velocity after the impact, k = nv
            [rad/s per unit of the source].
        joint_impulses: derivatives of the impulses in the joints, as `Impact.joint_impulses`, of
            shape `(njoints, 6, n)` [N s, N m s per unit of the source]; empty without `of_leg`.
        branch: `frictionless`, `stick` or `slip`.
        margin: distance to the other branch: in `stick`, the friction impulse that is left until
            the contact slips [N s]; in `slip`, the speed of sliding that remains [m/s]; inf without
            friction.
        margin_slope: derivatives of the margin, k = 1.
        at_boundary: whether the margin is 0 but for rounding: derivatives are then valid to one
            side only.
    """

    impulse: Jacobians
    velocity: Jacobians
    spin: Jacobians
    v_after: Jacobians
    joint_impulses: Jacobians
    branch: Branch
    margin: float
    margin_slope: Jacobians
    at_boundary: bool

    def _rows(self) -> Iterable[Row]:
        yield "branch", self.branch.value, "at its end" if self.at_boundary else ""
        yield "margin", self.margin, {"stick": "N s", "slip": "m/s"}.get(self.branch, "")
        for source, rows in self.impulse.items():
            per = f"({UNITS[source]})" if "/" in UNITS[source] else UNITS[source]
            yield f"impulse by {source}, at most", float(np.linalg.norm(rows, 2)), f"N s per {per}"
        for source, joints in self.joint_impulses.items():
            per = f"({UNITS[source]})" if "/" in UNITS[source] else UNITS[source]
            most = float(np.linalg.norm(joints[:, :3], 2, axis=(1, 2)).max())
            yield f"joint impulse by {source}, at most", most, f"N s per {per}"


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # refused at the end
def sensitivity(
    approach: Approach,
    solution: Solution,
    ball_after: BallState,
    response: LegResponse,
    *,
    of_leg: bool = True,
) -> Sensitivity:
    r"""Differentiate an impact by law `newton`, analytically.

    At an impulse that is fixed in the contact axes, a change of x leaves a velocity :math:`r_x`
    over after the impact that the law does not allow; with C of `impulse_by_velocity`,

    .. math:: \frac{dp}{dx} = \left.\frac{\partial p}{\partial x}\right|_\mathrm{axes} - C r_x .

    Where the restitution depends on the speed of approach u, e changes by :math:`(de/du)\, du/dx`,
    and where it depends on the ball, with mass and radius, too.
    What x does to the leg is in `kickdyn.impact.leg_derivatives`. A support that moves, or a joint
    whose axes depend on its own angles, raises `InvalidInput`; a derivative that leaves double
    precision raises `KickdynError`.
    """
    _check_supports(approach, response)
    names = UNITS if of_leg else [name for name in UNITS if name not in OF_LEG]
    columns = _columns(approach.posture.leg, names)
    ball, posture, n = approach.ball, approach.posture, approach.contact.normal
    problem = approach.contact_problem()
    (axes,), _ = problem.in_contact_axes()
    in_axes = problem.delassus(axes[None])
    delassus = axes @ in_axes @ axes.T
    fixed = _at_fixed_impulse(approach, solution, ball_after, response, columns)
    p, sticking = solution.impulses[0], solution.sticking[0]
    tangential = axes[:, :2].T @ solution.tangential_impulses[0]
    p_in_axes = np.append(tangential, n @ p)
    sliding_after = None if sticking else axes[:, :2].T @ fixed.u_after
    answer = impulse_by_velocity(approach.contact.friction, in_axes, sliding_after, p_in_axes)
    tangent = _sliding_direction(approach, solution, fixed)

    # The contact axes turn with the normal, and at first the impulse with them.
    turn = pin.skew(n) @ fixed.normal
    at_contact = -pin.skew(p) @ turn
    at_contact[:, columns["friction"]] -= (n @ p * tangent)[:, None]
    closing = -(n @ fixed.before + fixed.u_before @ fixed.normal)
    restitution = restitution_slope(approach.contact.restitution, approach.speed) * closing
    restitution[columns["restitution"]] += 1.0
    by_mass, by_radius = ball_slopes(approach.contact.restitution, ball, approach.speed)
    restitution[columns["ball_mass"]] += by_mass
    restitution[columns["ball_radius"]] += by_radius
    separation = approach.restitution * closing + approach.speed * restitution
    left_over = fixed.after + delassus @ at_contact + pin.skew(fixed.u_after) @ turn
    left_over -= np.outer(n, separation)
    impulse = at_contact - axes @ answer @ axes.T @ left_over
    frictionless = approach.contact.friction == 0.0
    if frictionless:  # the ball's rotation has no effect: these columns are rounding
        impulse[:, columns["ball_spin"]] = 0.0
        if by_radius == 0.0:
            impulse[:, columns["ball_radius"]] = 0.0

    velocity = fixed.velocity + impulse / ball.mass
    spin = fixed.spin - ball.radius / ball.inertia * pin.skew(n) @ impulse
    if frictionless:  # the spin stays; only friction, were there any, would change it
        by_friction = spin[:, columns["friction"]].copy()
        spin[:] = 0.0
        spin[:, columns["ball_spin"]], spin[:, columns["friction"]] = np.eye(3), by_friction
    v_after = fixed.v_after - constrained_inverse_inertia(posture) @ posture.jacobian.T @ impulse
    sliding = fixed.after + delassus @ impulse
    branch, margin, slope, scale = _margin(
        approach, solution, fixed, impulse, sliding, tangent, columns
    )
    joints = np.zeros((0, 6, impulse.shape[1]))
    if fixed.leg is not None:
        leg_slopes = _response_slopes(fixed.leg, v_after, impulse, columns)
        jump = response.v_after - approach.v
        joints = joint_impulse_derivatives(posture, p, response, jump, leg_slopes)
    results = (impulse, velocity, spin, v_after, slope, joints)
    if not all(np.isfinite(rows).all() for rows in results):
        raise KickdynError(
            "derivatives of this impact exceed double precision: the impact is too fast"
        )

    def named(rows: Array) -> Jacobians:
        rows.setflags(write=False)
        return {name: rows[..., place] for name, place in columns.items()}

    return Sensitivity(
        named(impulse), named(velocity), named(spin), named(v_after),
        named(joints) if fixed.leg is not None else {},
        branch, margin, named(slope.reshape(1, -1)), at_boundary=margin <= AT_BOUNDARY * scale,
    )  # fmt: skip


def _check_supports(approach: Approach, response: LegResponse) -> None:
    """Raise `InvalidInput` for a support that moves after the impact."""
    projector = approach.posture.without_stiff_joints.constraint_projector
    violation = None if projector is None else projector.find_violation(response.v_after)
    if violation is not None:
        name, speed, unit = violation
        raise InvalidInput(
            f"a support moves at {speed:.3g} {unit} after the impact ({name}): sensitivities are "
            "for supports that stay at rest"
        )


def _response_slopes(
    leg: LegDerivatives, v_after: Array, impulse: Array, columns: Mapping[str, slice]
) -> ResponseSlopes:
    """Return the derivatives of the leg's velocity jump, of the impulse, of q and of masses."""
    nv, width = v_after.shape
    jump, q, masses = v_after.copy(), np.zeros((nv, width)), columns["link_mass"]
    jump[:, columns["v"]] -= leg.admissible
    jump[:, columns["q"]] -= leg.v_before_q
    q[:, columns["q"]] = leg.closed
    mass = np.zeros((masses.stop - masses.start, width))
    mass[:, masses] = np.eye(len(mass))
    return ResponseSlopes(jump, impulse, q, mass)


def _columns(leg: Leg, names: Iterable[str]) -> dict[str, slice]:
    """Return the columns of each source when the sources are written side by side."""
    sizes = {"q": leg.nv, "v": leg.nv, "normal": 3, "ball_velocity": 3, "ball_spin": 3}
    sizes["link_mass"] = len(leg.joint_names)
    columns, start = {}, 0
    for name in names:
        stop = start + sizes.get(name, 1)
        columns[name] = slice(start, stop)
        start = stop
    return columns


@dataclass(frozen=True)
class _FixedImpulse:
    """Derivatives at a fixed impulse, one column per component of every source."""

    velocity: Array
    spin: Array
    v_after: Array
    before: Array  # of the contact points' relative velocity
    after: Array
    normal: Array  # it stays a unit vector
    u_before: Array  # the relative velocities themselves [m/s]
    u_after: Array
    leg: LegDerivatives | None  # without q, v and link_mass


def _at_fixed_impulse(
    approach: Approach,
    solution: Solution,
    ball_after: BallState,
    response: LegResponse,
    columns: Mapping[str, slice],
) -> _FixedImpulse:
    posture, ball, ball_before = approach.posture, approach.ball, approach.ball_before
    n, p = approach.contact.normal, solution.impulses[0]
    jacobian, v_before = posture.jacobian, approach.v
    cross_n, projector = pin.skew(n), np.eye(3) - np.outer(n, n)
    r, gain = ball.radius, ball.radius / ball.inertia  # of a shell, 3 / (2 m r)
    width = max(place.stop for place in columns.values())

    velocity, spin, before = np.zeros((3, width)), np.zeros((3, width)), np.zeros((3, width))
    v_after, normal = np.zeros((posture.leg.nv, width)), np.zeros((3, width))
    normal[:, columns["normal"]] = projector

    velocity[:, columns["ball_velocity"]] = np.eye(3)
    velocity[:, columns["ball_mass"]] = -p[:, None] / ball.mass / ball.mass
    moment = gain * (cross_n @ p)[:, None]
    spin[:, columns["ball_spin"]] = np.eye(3)
    spin[:, columns["ball_mass"]] = moment / ball.mass
    spin[:, columns["ball_radius"]] = moment / r
    spin[:, columns["normal"]] = gain * pin.skew(p) @ projector

    before[:, columns["ball_velocity"]] = np.eye(3)
    before[:, columns["ball_spin"]] = r * cross_n
    before[:, columns["ball_radius"]] = (cross_n @ ball_before.spin)[:, None]
    before[:, columns["normal"]] = -r * pin.skew(ball_before.spin) @ projector

    after, leg = velocity + r * cross_n @ spin, None
    if "q" in columns:
        leg = leg_derivatives(posture, v_before, response.v_after, p, response.constraint_impulses)
        v_after[:, columns["v"]] = leg.admissible
        v_after[:, columns["q"]] = leg.v_after_q
        v_after[:, columns["link_mass"]] = mass_derivatives(posture, response.v_after - v_before)
        before[:, columns["v"]] = -jacobian @ leg.admissible
        before[:, columns["q"]] = -leg.foot_q
        after -= jacobian @ v_after
        after[:, columns["q"]] -= leg.foot_q_after
    by_radius = columns["ball_radius"]
    after[:, by_radius] = before[:, by_radius]  # what the impulse adds has no r
    after[:, columns["normal"]] -= r * pin.skew(ball_after.spin) @ projector

    u_before = ball_before.velocity - approach.foot_velocity + r * cross_n @ ball_before.spin
    foot_after = posture.point_velocity(response.v_after)
    u_after = ball_after.velocity - foot_after + r * cross_n @ ball_after.spin
    return _FixedImpulse(velocity, spin, v_after, before, after, normal, u_before, u_after, leg)


def impulse_by_velocity(friction: float, delassus: Array, sliding: Array | None, p: Array) -> Array:
    r"""Return C: a change r of the velocity after the impact changes the impulse p by -C r.

    All are in contact axes. Without friction C is the effective mass along the normal, and where
    the contact sticks :math:`G^{-1}`. Where it slides, p lies on the cone along :math:`d = (\mu c,
    \mu s, 1)` and can change along d and along :math:`t = (-s, c, 0)`. With N these two directions
    as columns, and the normal velocity and that along t to be restored, :math:`C = N (R G N +
    D)^{-1} R` with :math:`R = (e_z, t)^T` and :math:`D = \operatorname{diag}(0, |u_t^+| / |p_t|)`.
    The sliding after the impact, `(2,)` [m/s], is None if the contact sticks.
    """
    if friction == 0.0:
        return np.diag([0.0, 0.0, 1.0 / delassus[2, 2]])
    if sliding is None:  # the pseudo-inverse, for a planar leg at an obstacle
        return np.asarray(np.linalg.pinv(delassus))
    size = math.hypot(p[0], p[1])
    x, y = (p[:2] / size).tolist() if size else (1.0, 0.0)
    rows = np.array([[0.0, 0.0, 1.0], [-y, x, 0.0]])
    directions = np.column_stack([[friction * x, friction * y, 1.0], rows[1]])
    system = rows @ delassus @ directions
    system[1, 1] += min(math.hypot(*sliding) / size, 1e300) if size else 1e300
    return np.asarray(directions @ np.linalg.solve(system, rows))


def _sliding_direction(approach: Approach, solution: Solution, fixed: _FixedImpulse) -> Array:
    """Return the direction of the sliding after the impact, 0 where there is none.

    Friction, if any, has more digits of it than the velocity.
    """
    if solution.sticking[0]:
        return np.zeros(3)
    if approach.contact.friction > 0.0:
        against = -solution.tangential_impulses[0]
        return np.asarray(against / math.hypot(*against))
    n = approach.contact.normal
    sliding = fixed.u_after - float(n @ fixed.u_after) * n
    speed = math.hypot(*sliding)
    resting = speed <= AT_BOUNDARY * math.hypot(*fixed.u_before)
    return np.zeros(3) if resting else sliding / speed


def _margin(
    approach: Approach,
    solution: Solution,
    fixed: _FixedImpulse,
    impulse_x: Array,
    sliding_x: Array,
    tangent: Array,
    columns: Mapping[str, slice],
) -> tuple[Branch, float, Array, float]:
    """Return the branch, its margin, the margin's derivative, and the margin's scale."""
    n, p, mu = approach.contact.normal, solution.impulses[0], approach.contact.friction
    if mu == 0.0:
        return Branch.FRICTIONLESS, math.inf, np.zeros(impulse_x.shape[1]), 1.0
    normal_impulse = float(n @ p)
    if not solution.sticking[0]:
        slope = tangent @ sliding_x - float(n @ fixed.u_after) * (tangent @ fixed.normal)
        return Branch.SLIP, float(tangent @ fixed.u_after), slope, math.hypot(*fixed.u_before)
    tangential = p - normal_impulse * n
    size = math.hypot(*tangential)
    along = tangential / size if size else tangential
    slope = mu * (n @ impulse_x + p @ fixed.normal)
    slope -= along @ (impulse_x - normal_impulse * fixed.normal)
    slope[columns["friction"]] += normal_impulse
    return Branch.STICK, mu * normal_impulse - size, slope, mu * normal_impulse
