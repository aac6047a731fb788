"""The kick that a motion is planned for, and the limits that the motion must keep."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

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
    Friction,
    Impulse,
    Limit,
    MuscleTorqueLimit,
    Pressure,
    PressureCentre,
    RangeLimit,
    RestingTorqueLimit,
    SpeedLimit,
    Tilt,
    TorqueLimit,
    Twist,
)
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


@dataclass(frozen=True, eq=False)
class KickTask:
    """The kick that a motion is planned for.

    Attributes:
        robot: that kicks, in its own coordinates; on its support, if its base floats.
        leg: the joints that move, on a fixed base: the supporting foot of a standing robot.
        target: impulse and contact.
        foot_directions: in which the foot can move at all, orthonormal rows, shape `(k, 3)`.
        ball_rows: orthonormal directions in which the ball's position is given, shape `(k, 3)`.
        ball_centre: that position, shape `(3,)` [m, world frame].
        facing: rows a of the cone of normals with which the foot can meet a ball, shape `(k, 3)`
            [frame of the contact joint].
        standing: the robot on its foot; None on a fixed base.
        muscles: whether the torque limits fall with speed, as those of muscles.
        other: the kicking foot, where the motion starts and ends on both feet.
        aside: angles of joints of `robot` that are not in `leg`, other than at rest.
    """

    robot: Leg
    leg: Leg
    target: ImpactTarget
    foot_directions: Array
    ball_rows: Array
    ball_centre: Array
    facing: Array
    standing: StandingRobot | None
    muscles: bool = False
    other: Foot | None = None
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
    slip, twist = Friction(friction), Twist(standing, friction)
    limits += [Pressure(LEAST_PRESSURE), slip, PressureCentre(standing, INSIDE), twist]
    in_impact = [Pressure(LEAST_IMPULSE), slip, PressureCentre(standing), twist]
    foot, posture = leg.contact_joint, leg.posture(leg.configuration())
    side = 1.0 if posture.contact_point[1] > standing.sole[:, 1].mean() else -1.0
    edge = float(side * (side * standing.sole[:, 1]).max())
    down, sideways = np.array([[0.0, 0.0, -1.0], [0.0, -side, 0.0]]) @ posture.rotation_world_joint
    under = _foot_spheres(standing, down, *UNDER)
    if task.other is not None:  # a foot that stands touches the ground, and is not in it
        rotation, origin = task.other.pose.rotation, task.other.pose.translation
        heights = (under.centres @ rotation.T + origin)[:, 2] - under.radii
        under = Spheres(under.centres, under.radii + np.minimum(heights - 1e-9, 0.0))
    limits.append(Clearance("the kicking foot", foot, under))
    beside = _foot_spheres(standing, sideways, *BESIDE)
    limits.append(Apart("the kicking foot", foot, beside, edge, side))
    if carriers := _trunk_carriers(standing, leg):
        pin.forwardKinematics(leg.workspace.model, leg.workspace.data, leg.configuration())
        limits.append(Tilt(carriers[-1], leg.workspace.data.oMi[carriers[-1]].rotation[2].copy()))
    if task.resting:
        limits.append(resting_limit(task, task.resting))
    return limits, [Impulse(limit) for limit in in_impact]


def resting_limit(task: KickTask, names: Sequence[str]) -> RestingTorqueLimit:
    """Return the limit of the torques of some of the joints at rest."""
    limit = task.whole.model.effortLimit[[task.whole.velocity_index(name) for name in names]]
    return RestingTorqueLimit(names, limit, [task.resting.index(name) for name in names])


def _trunk_carriers(standing: StandingRobot, leg: Leg) -> list[int]:
    """Return the joints of a leg that carry the trunk, the last one next to it."""
    if not standing.trunk_joint:
        return []
    whole, model = standing.leg.workspace.model, leg.workspace.model
    names = [whole.names[joint] for joint in whole.supports[whole.getJointId(standing.trunk_joint)]]
    return [int(model.getJointId(name)) for name in names[1:] if model.existJointName(name)]


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
    friction = _friction(standing)
    of_support = [
        limit for limit in limits_of(task)[0] if not isinstance(limit, Clearance | Apart | Pressure)
    ]
    return of_support, [Friction(friction), PressureCentre(other, INSIDE), Twist(other, friction)]


def _friction(standing: StandingRobot) -> float:
    return FRICTION if standing.support.friction is None else standing.support.friction
