"""A strike from ground that can push but not pull: feet may lift off, slip or tip."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.approach import AT_REST, Approach, find_approach
from kickdyn.impact.cone_solver import solve_cones
from kickdyn.impact.constraint_impulses import Footing, is_level
from kickdyn.impact.contact_problem import Solution
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.laws import find_law, names_of_laws
from kickdyn.impact.leg_response import as_response, joint_impulses
from kickdyn.impact.newton_law import NEWTON
from kickdyn.impact.rounding import Rounding
from kickdyn.impact.strike import ball_after, check_energy
from kickdyn.robot.constraints import Support
from kickdyn.robot.leg import Leg, Posture

MAX_RESIDUAL = 1e-9

AT_REST_SPEED = 1e-9
"""Share of the approach speed below which a point of the sole counts as at rest."""


@dataclass(frozen=True, eq=False, repr=False)
class UnilateralImpact(Impact):
    """An `Impact` in which supports rest on points that can push and have friction, but not pull.

    `support_impulses` are the sums over the points of a support, `support_residual` is the velocity
    at which the foot moves after the impact, and `effective_mass` is that of the leg without
    supports.

    Attributes:
        point_impulses: impulses of the ground on the robot by the name of the support, at each
            corner of the sole or at the point foot, shape `(k, 3)` [N s, world axes]. With more
            than three corners of a rigid sole, their sum and moment are unique but not their
            distribution, of which this is one.
        point_velocities: velocities of the same points just after the impact, shape `(k, 3)`
            [m/s, world axes].
        cone_residual: residual of the contact laws, relative to the largest impulse or velocity.
    """

    point_impulses: dict[str, Array]
    point_velocities: dict[str, Array]
    cone_residual: float

    @cached_property
    def effective_mass(self) -> float:
        """Effective mass along the normal of the leg without its supports [kg]."""
        return _without_supports(self.approach).effective_mass(self.contact.normal)

    @cached_property
    def rounding(self) -> Rounding:
        """Shares of the impulses that may be rounding, plus the residual of the contact laws."""
        found, left = super().rounding, self.cone_residual
        return Rounding(found.impulse + left, found.joints + left)

    @property
    def footing(self) -> dict[str, Footing]:
        """Motion of each support in the impact: it stands, slips, tips on an edge, or lifts off."""
        threshold = AT_REST_SPEED * self.approach_speed
        return {
            name: _footing(velocities, threshold)
            for name, velocities in self.point_velocities.items()
        }


def _footing(velocities: Array, threshold: float) -> Footing:
    """Return what a support does, from the velocities of its points, shape `(k, 3)` [m/s]."""
    up = velocities[:, 2] > threshold
    if up.any():
        return Footing.LIFTS_OFF if up.all() else Footing.TIPS
    slides = np.hypot(velocities[:, 0], velocities[:, 1]) > threshold
    return Footing.SLIPS if slides.any() else Footing.STANDS


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
    """Strike a ball with a robot whose feet stand on the ground, but can slip, tip and lift off.

    The restitution is Newton's at the ball and 0 at the points of the soles, which are at rest
    before the impact, with Coulomb's friction at every point. This is one nonlinear complementarity
    problem, which `kickdyn.impact.cone_solver.solve_cones` solves.

    Args:
        posture: posture of a leg with supports, each with its friction and a flat one with its
            `sole`; its contact frame touches the ball.
        v: joint velocity just before, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: the ball; its centre is at `contact point + radius * normal`.
        contact: normal, restitution, friction and offset of the contact with the ball.
        law: `newton`. The law `paper` needs the effective mass of the leg along the attack
            direction, which feet that may lift off leave undefined; `stronge` follows the impulse
            as it grows at one point, and how fast each of several grows depends on their stiffness,
            which is unknown.
        ball_velocity: velocity of its centre just before, shape `(3,)` [m/s, world frame].
        ball_spin: angular velocity just before, shape `(3,)` [rad/s, world frame].
        strict: whether to refuse a result that creates energy.

    Raises:
        NoImpact: as for `strike`.
        EnergyCreated: `strict` is true and Newton's law creates energy.
        InvalidInput: as for `strike`; another law, a leg without supports, a support without
            friction, a flat one without sole, or a sole that is not level.
        KickdynError: no solution was found; the message has the residual of the best.
    """
    impact_law = find_law(law)
    if not impact_law.several_contacts:
        raise InvalidInput(
            f"impact law is {law!r}, which is for one contact: feet that may lift off are several, "
            f"and need {names_of_laws('several_contacts')}"
        )
    validation.flag("strict", strict)
    approach = find_approach(posture, v, ball, contact, ball_velocity, ball_spin)
    supports = _checked_supports(approach.posture.leg)
    feet = _feet(approach.posture, supports)
    contacts = _contacts(approach, feet, supports)
    free = contacts.before.copy()
    free[2] *= 1.0 + approach.restitution
    impulses, residual = solve_cones(contacts.delassus, free, contacts.frictions)
    if not residual <= MAX_RESIDUAL:
        raise KickdynError(
            f"no impulses found for the supports: the best have a residual of {residual:.1g} "
            f"(friction up to {contacts.frictions.max():g}) in {approach.posture!r}"
        )
    impact = _result(approach, supports, feet, contacts, impulses, residual)
    check_energy(impact, strict)
    return impact


class _Foot(NamedTuple):
    """Points of a support: from its frame to each, shape `(k, 3)` [m], and their rows of J."""

    levers: Array
    rows: Array


class _Contacts(NamedTuple):
    """The contact problem, three rows for the ball first, then for each point of the feet."""

    axes: Array  # contact axes of the ball, the normal last
    free: Posture  # the leg without its supports
    jacobian: Array  # shape `(3 k, nv)`; tangential axes first and normal last
    delassus: Array  # of leg and ball, shape `(3 k, 3 k)` [1/kg]
    before: Array  # velocities, shape `(3 k,)` [m/s]
    frictions: Array  # shape `(k,)`


def _checked_supports(leg: Leg) -> tuple[Support, ...]:
    """Return the supports of a leg, or raise `InvalidInput` where they do not suffice."""
    supports = leg.constraints.supports if leg.constraints else ()
    if not supports:
        raise InvalidInput(f"{leg.name} has no supports: Leg.with_supports adds them")
    for support in supports:
        if support.friction is None:
            raise InvalidInput(f"support {support.frame} has no friction: give its coefficient")
        if support.sole is None and not support.point:
            raise InvalidInput(f"support {support.frame} has no sole: give its corners")
    return supports


def _feet(posture: Posture, supports: tuple[Support, ...]) -> list[_Foot]:
    """Return the points on which each support stands; raise `InvalidInput` for a tilted sole."""
    feet, projector = [], posture.constraint_projector
    assert projector is not None
    for support, block in zip(supports, projector.blocks, strict=False):
        rows = projector.rows[block.rows]
        if support.sole is None:
            feet.append(_Foot(np.zeros((1, 3)), rows))
            continue
        levers = support.sole @ block.rotation_world_frame.T
        if not is_level(levers):
            raise InvalidInput(
                f"the sole of {support.frame} is tilted in {posture!r}: corners' heights "
                f"differ by {np.ptp(levers[:, 2]):.3g} m, but the ground is level"
            )
        at_points = [rows[:3] - pin.skew(lever) @ rows[3:] for lever in levers]
        feet.append(_Foot(levers, np.vstack(at_points)))
    return feet


def _without_supports(approach: Approach) -> Posture:
    """Return the posture of the same leg without supports."""
    leg, q = approach.posture.leg.with_supports(), approach.posture.q
    return leg.posture(q).with_contact_offset(approach.contact.offset)


def _contacts(approach: Approach, feet: list[_Foot], supports: tuple[Support, ...]) -> _Contacts:
    """Return the contact problem of ball and feet."""
    normal = approach.contact.normal
    axes = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
    free = _without_supports(approach)
    jacobian = np.vstack([-axes.T @ free.jacobian, *(foot.rows for foot in feet)])
    delassus = jacobian @ np.column_stack([free.solve(row) for row in jacobian])
    ball_only = approach.contact_problem()._replace(delassus_factor=np.zeros((3, 0)))
    delassus[:3, :3] += ball_only.delassus_in(axes)
    before = np.concatenate([axes.T @ ball_only.velocity, np.zeros(len(jacobian) - 3)])
    before[2] = -ball_only.approach_speed  # a fast spin would cost its digits
    frictions = [approach.contact.friction]
    for support, foot in zip(supports, feet, strict=True):
        frictions += [support.friction or 0.0] * len(foot.levers)
    symmetric = (delassus + delassus.T) / 2
    return _Contacts(axes, free, jacobian, symmetric, before, np.array(frictions))


def _result(
    approach: Approach,
    supports: tuple[Support, ...],
    feet: list[_Foot],
    contacts: _Contacts,
    impulses: Array,
    residual: float,
) -> UnilateralImpact:
    """Return the impact with these impulses."""
    axes, after = contacts.axes, contacts.before + contacts.delassus @ impulses
    solution = Solution(
        axes @ impulses[:3],
        bool(np.hypot(after[0], after[1]) <= AT_REST_SPEED * approach.speed),
        -0.5 * float(impulses @ (contacts.before + after)),
        axes[:, :2] @ impulses[:2],
    )
    ends = np.cumsum([3, *(len(foot.rows) for foot in feet)])[:-1]
    shares = [part.reshape(-1, 3) for part in np.split(impulses, ends)[1:]]
    velocities = [part.reshape(-1, 3) for part in np.split(after, ends)[1:]]
    wrenches = [
        np.concatenate([share.sum(axis=0), np.cross(foot.levers, share).sum(axis=0)])[: s.size]
        for s, foot, share in zip(supports, feet, shares, strict=True)
    ]
    jump, loops = contacts.free.respond(contacts.jacobian.T @ impulses)
    stacked = np.concatenate([*wrenches, loops])
    posture, impulse = approach.posture, solution.impulse
    transmitted, unbalanced = joint_impulses(posture, jump, -impulse, stacked)
    for array in (impulse, solution.tangential_impulse, *shares, *velocities):
        array.setflags(write=False)
    names = [support.frame for support in supports]
    return UnilateralImpact(
        approach=approach,
        law=NEWTON.name,
        solution=solution,
        ball_after=ball_after(approach, solution),
        response=as_response(posture, impulse, approach.v + jump, transmitted, stacked, unbalanced),
        point_impulses=dict(zip(names, shares, strict=True)),
        point_velocities=dict(zip(names, velocities, strict=True)),
        cone_residual=residual,
    )
