"""A strike from ground that can push but not pull: feet may lift off, slip or tip."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core.validation import Array, ArrayLike, read_only
from kickdyn.errors import InvalidInput
from kickdyn.impact.approach import AT_REST, Approach, find_approach
from kickdyn.impact.contact_problem import BallBody, Body, ContactPoint, ContactProblem, LegBody
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.laws import find_law, solve_contacts
from kickdyn.impact.leg_response import Footing, is_level, response_to_jump
from kickdyn.impact.newton_law import AT_REST_SPEED
from kickdyn.impact.uncertainty import Rounding
from kickdyn.robot.leg import Posture

UP = np.array([0.0, 0.0, 1.0])
"""Normal of the ground, which is the first body of its contacts."""


@dataclass(frozen=True, eq=False, repr=False)
class UnilateralImpact(Impact):
    """An `Impact` in which supports rest on points that can push and have friction, but not pull.

    `support_impulses` are the sums over the points of a support, and `effective_mass` is the one of
    the leg without supports. With more than three corners of a rigid sole, the distribution of the
    impulses over the corners is one of many; where the sole slips, the other distributions have
    slightly different sums and moments, and so has the impulse on the ball, by some 1e-6 of it.

    Attributes:
        point_velocities: velocities just after the impact by the name of the support, of each
            corner of the sole or of the point foot, shape `(k, 3)` [m/s, world axes].
    """

    point_velocities: dict[str, Array]

    @property
    def cone_residual(self) -> float:
        """Residual of the contact laws, relative to the largest impulse or velocity."""
        return self.solution.residual

    @cached_property
    def effective_mass(self) -> float:
        """Effective mass along the normal of the leg without its supports [kg]."""
        return _without_supports(self.approach).effective_mass(self.contact.normal)

    @cached_property
    def rounding(self) -> Rounding:
        """Shares of the impulses that may be rounding, plus the residual of the contact laws."""
        rounding, residual = super().rounding, self.cone_residual
        return Rounding(rounding.impulse + residual, rounding.joints + residual)

    @property
    def footing(self) -> dict[str, Footing]:
        """Motion of each support in the impact: it stands, slips, tips on an edge, or lifts off."""
        threshold = AT_REST_SPEED * self.approach_speed
        footing = {}
        for name, velocities in self.point_velocities.items():
            rises = velocities[:, 2] > threshold
            slides = np.hypot(velocities[:, 0], velocities[:, 1]) > threshold
            footing[name] = Footing.SLIPS if slides.any() else Footing.STANDS
            if rises.any():
                footing[name] = Footing.LIFTS_OFF if rises.all() else Footing.TIPS
        return footing


def unilateral_strike(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    law: str = "newton",
    *,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
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
        contact: normal, restitution, friction and offset of the contact.
        law: `newton`. The law `paper` needs the effective mass of the leg along the attack
            direction, which feet that may lift off leave undefined; `stronge` follows the impulse
            as it grows at one point, and how fast each of several grows depends on their stiffness,
            which is unknown.
        ball_velocity: velocity of its centre just before, shape `(3,)` [m/s, world frame].
        ball_spin: angular velocity just before, shape `(3,)` [rad/s, world frame].

    Raises:
        NoImpact: as for `strike`.
        InvalidInput: as for `strike`; another law, a leg without supports, a support without
            friction, a flat one without sole, or a sole that is not level.
        KickdynError: no solution was found; the message has the residual of the best.
    """
    impact_law = find_law(law)
    approach = find_approach(posture, v, ball, contact, ball_velocity, ball_spin)
    feet = _find_feet(approach.posture)
    contacts = [approach.contact_point()]
    for foot in feet:  # at rest
        contacts += [ContactPoint(UP, 0.0, foot.friction)] * (len(foot.jacobian) // 3)
    on_ground = len(contacts) - 1
    sides = (-1.0, *[1.0] * on_ground)
    free = _without_supports(approach)
    jacobian = np.vstack([free.jacobian, *(foot.jacobian for foot in feet)])
    factor = free.whiten(np.repeat(sides, 3)[:, None] * jacobian).T
    robot = LegBody(free, jacobian, factor, sides)
    normals = tuple(contact.normal for contact in contacts)
    ball_body = BallBody(ball, normals, (1.0, *[0.0] * on_ground))
    problem = ContactProblem(tuple(contacts), (robot, ball_body, Body()))
    solution = solve_contacts(problem, impact_law)

    jump, loop_impulses = robot.jump(solution.impulses)
    ends = np.cumsum([len(foot.jacobian) for foot in feet])[:-1]
    by_foot = np.split(solution.impulses[1:].ravel(), ends)
    reactions = [foot.transfer.T @ impulses for foot, impulses in zip(feet, by_foot, strict=True)]
    constraint_impulses = np.concatenate([*reactions, loop_impulses])
    response = response_to_jump(
        approach.posture, approach.v, jump, solution.impulses[0], constraint_impulses
    )
    return UnilateralImpact(
        approach,
        impact_law.name,
        solution,
        {foot.name: read_only((foot.jacobian @ jump).reshape(-1, 3)) for foot in feet},
        response=response,
    )


class _Foot(NamedTuple):
    """A support and its k points on the ground."""

    name: str
    friction: float
    transfer: Array  # from the velocity of the support's frame to the points'
    jacobian: Array  # of the points, shape `(3 k, nv)`


def _find_feet(posture: Posture) -> list[_Foot]:
    """Return the feet on which a robot stands, or raise `InvalidInput` for what is not known."""
    leg, projector = posture.leg, posture.constraint_projector
    supports = leg.constraints.supports if leg.constraints else ()
    if projector is None or not supports:
        raise InvalidInput(f"{leg.name} has no supports: Leg.with_supports adds them")
    feet = []
    for support, block in zip(supports, projector.blocks, strict=False):
        if support.friction is None:
            raise InvalidInput(f"support {support.frame} has no friction: give its coefficient")
        if support.sole is None and not support.point:
            raise InvalidInput(f"support {support.frame} has no sole: give its corners")
        sole = np.zeros((1, 3)) if support.sole is None else support.sole
        levers = sole @ block.rotation_world_frame.T
        if not is_level(levers):
            raise InvalidInput(
                f"the sole of {support.frame} is tilted in {posture!r}: corners' heights "
                f"differ by {np.ptp(levers[:, 2]):.3g} m, but the ground is level"
            )
        moving = [np.hstack([np.eye(3), -pin.skew(lever)]) for lever in levers]
        transfer = np.vstack(moving)[:, : support.size]
        jacobian = transfer @ projector.rows[block.rows]
        feet.append(_Foot(support.frame, support.friction, transfer, jacobian))
    return feet


def _without_supports(approach: Approach) -> Posture:
    leg, q = approach.posture.leg.with_supports(), approach.posture.q
    return leg.posture(q).with_contact_offset(approach.contact.offset)
