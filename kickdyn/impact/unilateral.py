"""A strike on ground that only pushes: feet may lift off, slip or tip."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.core.vectors import cross
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.approach import AT_REST
from kickdyn.impact.cone_solver import solve_cones
from kickdyn.impact.footing import LIFTS, SLIPS, STANDS, TIPS, level
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.joint_impulses import joint_impulses
from kickdyn.impact.laws import ContactProblem
from kickdyn.impact.strike import check_energy, strike
from kickdyn.robot.constraints import Support
from kickdyn.robot.leg import Leg, Posture

MAX_RESIDUAL = 1e-9
WHY_NOT = {
    "paper": "it needs one effective mass of the leg",
    "stronge": "it follows one impulse as it grows, and here several grow at once",
}
"""What keeps the other laws from many contacts."""

STILL = 1e-9
"""Share of the approach speed below which a point of the sole counts as at rest."""


@dataclass(frozen=True, eq=False, repr=False)
class UnilateralImpact(Impact):
    """An `Impact` in which supports rest on points that can push and rub, but not pull.

    `support_impulses` are the points' together, `support_residual` is how fast the foot leaves, and
    `effective_mass` is the leg's with no support held.

    Attributes:
        point_impulses: by support, on the robot at each corner of the sole, or at the point foot,
            shape `(k, 3)` [N s, world axes]. More than three corners of a stiff sole leave their
            split open: sum and moment are certain, and the split is one of many.
        point_velocities: of the same points just after, shape `(k, 3)` [m/s, world axes].
        cone_residual: how far the contact laws are missed, relative to the largest impulse or
            velocity.
    """

    point_impulses: dict[str, Array]
    point_velocities: dict[str, Array]
    cone_residual: float

    @property
    def footing(self) -> dict[str, str]:
        """What each support does: `stands`, `slips`, `tips` on an edge, or `lifts off`."""
        still = STILL * self.approach_speed
        found = {}
        for name, velocities in self.point_velocities.items():
            up = velocities[:, 2] > still
            slides = np.hypot(velocities[:, 0], velocities[:, 1])[~up] > still
            found[name] = LIFTS if up.all() else TIPS if up.any() else SLIPS
            if not up.any() and not slides.any():
                found[name] = STANDS
        return found


class _Foot(NamedTuple):
    """Points of a support: from its frame to each, shape `(k, 3)`, and their rows of J."""

    levers: Array
    rows: Array


def unilateral_strike(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    law: str = "newton",
    *,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
    strict: bool = False,
) -> UnilateralImpact:
    """Strike a ball from supports that are not held, but stand on points of the ground.

    Newton's restitution at the ball, none at the ground, where all is at rest, and Coulomb's cone
    at every point: one nonlinear complementarity problem. Law `newton` is the only one: law `paper`
    finds the impulse along the attack direction from the leg's effective mass there, and feet that
    may let go leave the leg none; law `stronge` follows the impulse as it grows at one point, but
    of several that press at once, nobody knows which grows how fast unless their stiffness is
    named. Arguments and errors as for `strike`, and

    Raises:
        EnergyCreated: `strict`, and Newton's law gains energy here.
        InvalidInput: another law, the leg has no supports, one lacks its friction, a flat one its
            sole, or a sole is not level.
        KickdynError: no solution was found; the message says how far the best misses the laws.
    """
    if isinstance(law, str) and law in WHY_NOT:
        raise InvalidInput(
            f"impact law {law!r} is no law for feet that may let go: {WHY_NOT[law]}; choose newton"
        )
    if law != "newton":
        raise InvalidInput(f"impact law {law!r} is unknown: choose newton")
    validation.flag("strict", strict)
    held = strike(posture, v, ball, contact, ball_velocity=ball_velocity, ball_spin=ball_spin)
    leg = posture.leg
    supports = _checked(leg)
    free = leg.with_supports().posture(held.posture.q).with_contact_offset(contact.offset)
    feet = _feet(held, supports)
    contacts = _contacts(held, free, feet)
    bounced = contacts.before.copy()
    bounced[2] *= 1.0 + contact.restitution
    frictions = [contact.friction]
    for support, foot in zip(supports, feet, strict=True):
        frictions += [support.friction or 0.0] * len(foot.levers)
    impulses, residual = solve_cones(contacts.delassus, bounced, np.array(frictions))
    if not residual <= MAX_RESIDUAL:
        raise KickdynError(
            f"no impulses found for the supports: the best miss the contact laws by {residual:.1g} "
            f"(at most {MAX_RESIDUAL:g}; friction up to {max(frictions):g}) in {held.posture!r}"
        )
    hit = _outcome(held, ball, free, supports, feet, contacts, impulses, residual)
    if strict:
        check_energy(hit)
    return hit


class _Contacts(NamedTuple):
    """Ball first, then the points of the feet.

    `axes` has the ball's normal for its third column; `jacobian`, `delassus` and the velocities
    `before` are those of the contact problem, three rows each, normal last.
    """

    axes: Array
    jacobian: Array
    delassus: Array
    before: Array


def _contacts(held: Impact, free: Posture, feet: list[_Foot]) -> _Contacts:
    axes = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), held.contact.normal).matrix()
    jacobian = np.vstack([-axes.T @ free.jacobian, *(foot.rows for foot in feet)])
    delassus = jacobian @ np.column_stack([free.solve(row) for row in jacobian])
    alone = ContactProblem.of(held)._replace(leg_rows=np.zeros((3, 0)))
    delassus[:3, :3] += alone.delassus_in(axes)
    before = np.concatenate([axes.T @ alone.velocity, np.zeros(len(jacobian) - 3)])
    before[2] = -alone.along_normal()[0]  # a fast spin would cost its digits
    return _Contacts(axes, jacobian, (delassus + delassus.T) / 2, before)


def _outcome(
    held: Impact,
    ball: Ball,
    free: Posture,
    supports: tuple[Support, ...],
    feet: list[_Foot],
    contacts: _Contacts,
    impulses: Array,
    residual: float,
) -> UnilateralImpact:
    impulse, before, normal = contacts.axes @ impulses[:3], held.ball_before, held.contact.normal
    jump, loops = free.respond(contacts.jacobian.T @ impulses)
    after = contacts.before + contacts.delassus @ impulses
    ends = np.cumsum([3, *(len(foot.rows) for foot in feet)])[:-1]
    shares = [part.reshape(-1, 3) for part in np.split(impulses, ends)[1:]]
    velocities = [part.reshape(-1, 3) for part in np.split(after, ends)[1:]]
    wrenches = [
        np.concatenate([share.sum(axis=0), np.cross(foot.levers, share).sum(axis=0)])[: s.size]
        for s, foot, share in zip(supports, feet, shares, strict=True)
    ]
    stacked, v_after = np.concatenate([*wrenches, loops]), held.v_before + jump
    transmitted, left_over = joint_impulses(held.posture, jump, -impulse, stacked)
    for array in (impulse, v_after, transmitted, stacked, *shares, *velocities):
        array.setflags(write=False)
    names = [support.frame for support in supports]
    lever = float(np.linalg.norm(free.jacobian) * np.linalg.norm(impulse))
    tangential_impulse = contacts.axes[:, :2] @ impulses[:2]
    spin = before.spin - cross(normal, tangential_impulse) * (ball.radius / ball.inertia)
    same = {field.name: getattr(held, field.name) for field in dataclasses.fields(Impact)}
    changed = {
        "impulse": impulse,
        "effective_mass": free.effective_mass(normal),
        "ball_after": BallState(before.position, before.velocity + impulse / ball.mass, spin),
        "v_after": v_after,
        "joint_impulses": transmitted,
        "constraint_impulses": stacked,
        "energy_lost": -0.5 * float(impulses @ (contacts.before + after)),
        "sticking": bool(np.hypot(after[0], after[1]) <= STILL * held.approach_speed),
        "restitution_residual": abs(
            float(after[2]) / held.approach_speed - held.contact.restitution
        ),
        "momentum_residual": float(np.abs(left_over).max()) / lever,
        "point_impulses": dict(zip(names, shares, strict=True)),
        "point_velocities": dict(zip(names, velocities, strict=True)),
        "cone_residual": residual,
    }
    return UnilateralImpact(**(same | changed))


def _checked(leg: Leg) -> tuple[Support, ...]:
    supports = leg.constraints.supports if leg.constraints else ()
    if not supports:
        raise InvalidInput(f"{leg.name} has no supports: Leg.standing_on names them")
    for support in supports:
        if support.friction is None:
            raise InvalidInput(f"support {support.frame} has no friction: name its coefficient")
        if support.sole is None and not support.point:
            raise InvalidInput(f"support {support.frame} has no sole: name its corners")
    return supports


def _feet(held: Impact, supports: tuple[Support, ...]) -> list[_Foot]:
    feet, hold = [], held.posture.constraint_projector
    for support, block in zip(supports, hold.blocks if hold else (), strict=False):
        rows = hold.rows[block.at] if hold else np.zeros((0, 0))
        if support.sole is None:
            feet.append(_Foot(np.zeros((1, 3)), rows))
            continue
        levers = support.sole @ block.frame.T
        if not level(levers):
            raise InvalidInput(
                f"the sole of {support.frame} is tilted in {held.posture!r}: corners' heights "
                f"differ by {np.ptp(levers[:, 2]):.3g} m, but the ground is level"
            )
        at_points = [rows[:3] - pin.skew(lever) @ rows[3:] for lever in levers]
        feet.append(_Foot(levers, np.vstack(at_points)))
    return feet
