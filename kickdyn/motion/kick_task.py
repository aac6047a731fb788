r"""The kick that a motion is planned for, the limits of the motion, and the rows of its impact.

The unknowns of the impact are q, v before, the jump of v, the share s of the launch, and the jump w
that the whole launch takes, of all joints: joints at rest give way in the impact. With the impulse
:math:`s\,p` on the ball, they keep

.. math::
    M w + J^T p = 0, \quad \Delta v = s\, w, \quad
    n \cdot (s\,u_b - J v^+) = e\, n \cdot J v^-, \quad x + r n = x_{ball}

and no sliding, with the velocity :math:`u_b` of the ball's contact point. The ground's impulse is
limited for the whole launch: then its limits depend on the posture alone, not on the share.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.motion.limits import (
    FRICTION,
    INSIDE,
    LEAST_IMPULSE,
    LEAST_PRESSURE,
    Apart,
    Clearance,
    Impulse,
    Limit,
    MuscleTorqueLimit,
    Pressure,
    PressureCentre,
    RangeLimit,
    RestingTorqueLimit,
    Sample,
    SpeedLimit,
    Tilt,
    TorqueLimit,
    ground_limits,
)
from kickdyn.motion.motion_program import Rows, SymbolicTree, make_rows
from kickdyn.restitution import rows_of
from kickdyn.robot.ground_clearance import Spheres, extreme_spheres
from kickdyn.robot.leg import Leg
from kickdyn.robot.names import MAX_FAULTY, listed
from kickdyn.robot.standing import (
    UNLIMITED,
    Foot,
    StandingRobot,
    assumed_speed_limit,
    joint_spheres,
    sole_edges,
)

UNDER, BESIDE = (14, 0.4), (6, 0.6)
"""Numbers of spheres that span the kicking foot downwards and towards the other foot, each of which
has rows at every point, and the cosine of the largest angle to that direction."""

LARGEST_TURN = 1.5
"""Largest angular velocity of a standing robot's foot across the normal, before the impact [rad/s]:
during the contact, a foot that turns faster sends the ball aside."""

TURN_SCALE = 10.0
"""Scale of that angular velocity [rad/s]."""


@dataclass(frozen=True, eq=False)
class KickTask:
    """The kick that a motion is planned for."""

    robot: Leg  # that kicks, in its own coordinates; on its support, if its base floats
    leg: Leg  # the joints that move, on a fixed base: the supporting foot of a standing robot
    target: ImpactTarget  # impulse and contact
    foot_directions: Array  # in which the foot can move at all, orthonormal rows, shape `(k, 3)`
    ball_rows: Array  # orthonormal directions in which the ball's position is given, shape `(k, 3)`
    ball_centre: Array  # that position, shape `(3,)` [m, world frame]
    # rows a of the cone of normals with which the foot can meet a ball, shape `(k, 3)` [frame of
    # the contact joint]
    facing: Array
    standing: StandingRobot | None  # the robot on its foot; None on a fixed base
    muscles: bool = False  # whether the torque limits fall with speed, as those of muscles
    other: Foot | None = None  # the kicking foot, where the motion starts and ends on both feet
    # angles of joints of `robot` that are not in `leg`, other than at rest
    aside: Mapping[str, float] = field(default_factory=dict)

    @property
    def speed_limit(self) -> Array:
        """Limits of the joints' speeds, see `limited_speed`."""
        return limited_speed(self.leg)

    @property
    def whole(self) -> Leg:
        """The leg with the joints at rest too, which give way in the impact."""
        return self.leg if self.standing is None else self.standing.leg

    @property
    def resting(self) -> tuple[str, ...]:
        """Names of the joints at rest."""
        return tuple(name for name in self.whole.joint_names if name not in self.leg.joint_names)


def limited_speed(leg: Leg) -> Array:
    """Return limits of the joints' speeds, `UNLIMITED` where none has one, `(n,)` [rad/s; m/s]."""
    limit = assumed_speed_limit(leg)
    return np.where(np.isfinite(limit), limit, UNLIMITED)


def limits_of(task: KickTask) -> tuple[list[Limit], list[Impulse]]:
    """Return the limits of a motion and of the ground's impulse."""
    leg, model = task.leg, task.leg.model
    names = leg.joint_names
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    limits: list[Limit] = [
        (
            MuscleTorqueLimit(names, model.effortLimit, task.speed_limit)
            if task.muscles
            else TorqueLimit(names, model.effortLimit)
        ),
        SpeedLimit(names, task.speed_limit),
        RangeLimit(names, lower, upper),
    ]
    standing = task.standing
    if standing is None:
        return limits, []
    friction = _friction(standing)
    limits += [Pressure(LEAST_PRESSURE), *ground_limits(standing, friction, INSIDE)]
    in_impact = [Pressure(LEAST_IMPULSE), *ground_limits(standing, friction)]
    foot, posture = leg.contact_joint, leg.posture(leg.configuration())
    side = 1.0 if posture.contact_point[1] > standing.sole[:, 1].mean() else -1.0
    edge = float(side * (side * standing.sole[:, 1]).max())
    down, sideways = np.array([[0.0, 0.0, -1.0], [0.0, -side, 0.0]]) @ posture.rotation_world_joint
    under = _foot_spheres(standing, down, *UNDER)
    if task.other is not None:  # a foot that stands touches the ground, and is not in it
        rotation, origin = task.other.pose.rotation, task.other.pose.translation
        heights = (under.centres @ rotation.T + origin)[:, 2] - under.radii
        under = Spheres(under.centres, under.radii + np.minimum(heights - 1e-9, 0.0))
    limits.append(Clearance(foot, under))
    beside = _foot_spheres(standing, sideways, *BESIDE)
    limits.append(Apart(foot, beside, edge, side))
    if trunk := _trunk_carrier(standing, leg):
        pin.forwardKinematics(leg.workspace.model, leg.workspace.data, leg.configuration())
        limits.append(Tilt(trunk, leg.workspace.data.oMi[trunk].rotation[2].copy()))
    if task.resting:
        limits.append(resting_limit(task, task.resting))
    return limits, [Impulse(limit) for limit in in_impact]


def resting_limit(task: KickTask, names: Sequence[str]) -> RestingTorqueLimit:
    """Return the limit of the torques of some of the joints at rest."""
    limit = task.whole.model.effortLimit[[task.whole.velocity_index(name) for name in names]]
    return RestingTorqueLimit(names, limit, [task.resting.index(name) for name in names])


def _trunk_carrier(standing: StandingRobot, leg: Leg) -> int:
    """Return the joint of a leg that carries the trunk, next to it; 0 if none does."""
    if not standing.trunk_joint:
        return 0
    whole, model = standing.leg.workspace.model, leg.workspace.model
    path = list(whole.supports[whole.getJointId(standing.trunk_joint)])[:0:-1]
    names = (whole.names[joint] for joint in path)
    return next((int(model.getJointId(n)) for n in names if model.existJointName(n)), 0)


def _foot_spheres(standing: StandingRobot, towards: Array, count: int, cosine: float) -> Spheres:
    """Return spheres that span the kicking foot in a direction, in its joint's axes."""
    body = joint_spheres(standing.robot, standing.robot.contact_joint)
    extremes, beyond = extreme_spheres(body, count, towards, cosine)
    return Spheres(body.centres[extremes], body.radii[extremes] + beyond)


def check_limits(leg: Leg) -> None:
    """Raise `InvalidInput` for joints without a limit of torque, or with one of 0."""
    for what, limits, most in (
        ("speed", leg.velocity_limit, math.inf),
        ("torque", leg.effort_limit, 1e6),
    ):
        faulty = (limits <= 0.0) | (limits > most)
        if faulty.any():
            names = listed(np.array(leg.joint_names)[faulty].tolist(), MAX_FAULTY)
            raise InvalidInput(
                f"{what} limit of {names} is {limits[faulty][0]:g}: a motion needs "
                "one, above 0 (Leg.with_drives, --drives FILE)"
            )


def check_sole(standing: StandingRobot) -> None:
    """Raise `InvalidInput` for a sole that has no room for the centre of pressure."""
    normals, offsets = sole_edges(standing)
    inner = linprog(  # the circle with the largest radius in the sole: its centre, and the radius
        [0.0, 0.0, -1.0],
        np.column_stack([normals, np.ones(len(normals))]),
        offsets,
        bounds=(None, None),
    )
    width, least = 2e3 * inner.x[2], 2e3 * (INSIDE + PressureCentre.reserve)
    if not width > least:
        frame = standing.support.frame
        raise InvalidInput(
            f"the sole of {frame} is {width:.3g} mm wide: the centre of pressure of a motion stays "
            f"inside it, so it must be wider than {least:g} mm: name its corners, "
            f"Support({frame!r}, sole=...), --support {frame}:FRICTION:CORNERS"
        )


def limits_on_both(task: KickTask) -> tuple[list[Limit], list[Limit]]:
    """Return the limits of a robot that stands on both feet: with the wrench on each of them."""
    standing, other = task.standing, task.other
    assert standing is not None
    assert other is not None
    limits, _ = limits_of(task)
    of_support = [x for x in limits if not isinstance(x, Clearance | Apart | Pressure)]
    return of_support, ground_limits(other, _friction(standing), INSIDE)


def _friction(standing: StandingRobot) -> float:
    return FRICTION if standing.support.friction is None else standing.support.friction


class ImpactRows(NamedTuple):
    """Rows of the impact."""

    every: Rows  # of q, v before, the jump of v, s, and w; all but w are of the joints that move
    posture: Rows  # of q alone
    margins: Any  # CasADi's function of q and w: margins of the ground's limits
    jump: Any  # likewise of q: matrix and right side of the equations for w
    ball_centre: Any  # likewise of q: the centre of the ball that the foot touches


def impact_rows(task: KickTask, tree: SymbolicTree, rest: Any, limits: list[Impulse]) -> ImpactRows:
    """Return the rows of the impact, with `limits` of the ground's impulse.

    `rest` is q of all joints, in which those that move have the symbols of the `tree`.
    """
    target, leg, model = task.target, task.leg, task.whole.model
    ball, normal, impulse = target.ball, target.contact.normal, target.impulse
    q, v, jump = tree.q, tree.v, ca.SX.sym("jump", tree.model.nv)
    of_whole = ca.SX.sym("of_whole", model.nv)
    share, none = ca.SX.sym("share"), ca.SX(0, 1)
    every = SymbolicTree(model, (rest, ca.SX(model.nv, 1), of_whole))
    needed, reaction = every.inverse_dynamics(gravity=False)
    moving = [task.whole.velocity_index(name) for name in leg.joint_names]
    lever = leg.posture(leg.configuration()).with_contact_offset(target.contact.offset)
    point = tree.point(leg.contact_joint, lever.contact_lever)
    jacobian = ca.jacobian(point, q)
    inertia = np.diag(pin.crba(model, model.createData(), pin.neutral(model)))
    momentum = 0.3 * np.maximum(inertia, 0.02) * limited_speed(task.whole)
    force = ca.SX(model.nv, 1)  # of the ball on the joints, for its impulse
    force[moving] = -jacobian.T @ ca.DM(impulse)
    tangential = impulse - (normal @ impulse) * normal
    ball_point = impulse / ball.mass + ball.turning * tangential
    speed = float(np.linalg.norm(ball_point))
    apart = share * ca.DM(ball_point) - jacobian @ (v + jump)
    approach = ca.dot(ca.DM(normal), jacobian @ v)
    rebound = ca.dot(ca.DM(normal), apart) - _restitution(target, approach) * approach
    directions = task.foot_directions
    _, gains, across = np.linalg.svd(directions - np.outer(directions @ normal, normal))
    slip = ca.DM(across[: len(gains)][gains > 1e-6])
    posture_rows = [
        (ca.DM(task.ball_rows) @ (point + ca.DM(ball.radius * normal - task.ball_centre))
         / ball.radius, 0.0, 0.0),
        (ca.DM(task.facing) @ (tree.rotation(leg.contact_joint).T @ ca.DM(normal)),
         0.0, np.inf),
    ]  # fmt: skip
    rows = [
        ((needed - force) / ca.DM(momentum), 0.0, 0.0),
        ((jump - share * of_whole[moving]) / ca.DM(0.3 * task.speed_limit), 0.0, 0.0),
        (rebound / speed, 0.0, 0.0),
        *posture_rows,
    ]
    if target.contact.friction > 0.0 and slip.numel():
        rows.append((slip @ apart / speed, 0.0, 0.0))
    if task.standing is not None:
        most = LARGEST_TURN / TURN_SCALE
        turning = slip @ tree.angular_velocity(leg.contact_joint) / TURN_SCALE
        rows.append((turning, -most, most))
    moment = ca.cross(point, ca.DM(impulse))
    wrench = reaction + ca.vertcat(ca.DM(impulse), moment)
    sample = Sample(tree, torque=None, wrench=wrench, size=float(np.linalg.norm(impulse)))
    rows += [limit.rows(sample) for limit in limits]
    z = ca.vertcat(q, v, jump, share, of_whole)
    margins = [limit.margins(sample) for limit in limits]
    function = ca.Function("impulse_margins", [q, of_whole], [ca.vertcat(none, *margins)])
    of_jump = ca.Function("jump", [q], [ca.jacobian(needed, of_whole), force])
    centre = ca.Function("ball", [q], [point + ca.DM(ball.radius * normal)])
    posture = make_rows(q, none, posture_rows, ca.SX(0.0))
    return ImpactRows(make_rows(z, none, rows, ca.SX(0.0)), posture, function, of_jump, centre)


def _restitution(target: ImpactTarget, approach: Any) -> Any:
    """Return e for a speed of approach: a number, or a piecewise linear expression."""
    restitution = target.contact.restitution
    if isinstance(restitution, float):
        return restitution
    rows = rows_of(restitution)
    e = rows[0][1]
    for (low, before), (high, after) in pairwise(rows):
        slope = (after - before) / (high - low)
        e += slope * (ca.fmin(ca.fmax(approach, low), high) - low)
    return e
