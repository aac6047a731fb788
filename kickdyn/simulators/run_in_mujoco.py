"""A planned motion carried out in MuJoCo: floor and sole, drives with limits, and the ball."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import sliding_window_view

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, freeze_arrays, warned
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import Course, follow
from kickdyn.impact.collide import CONTACT_TIME
from kickdyn.impact.impact_result import Impact
from kickdyn.motion.motion import Motion
from kickdyn.plane import Plane
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.robot.ground_clearance import Spheres, extreme_spheres
from kickdyn.robot.leg import Leg
from kickdyn.robot.mjcf_file import quiet_mujoco
from kickdyn.robot.mjcf_model import mujoco_state
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.standing import StandingRobot, is_floating, joint_spheres, sole_edges
from kickdyn.simulators.mujoco_kick import (
    COMPILER,
    ball_spin,
    load_mujoco,
    pair,
    quaternion,
    row,
    write_bodies,
)
from kickdyn.simulators.tune_mujoco import MujocoTuning, tune_mujoco

POSITION_GAIN = 8.0
"""Stiffness of the controller over a joint's torque limit [1/rad; 1/m]."""

DAMPING_RATIO = 0.3
"""Of a joint with this stiffness and its inertia in the planned posture of the impact. With 1 the
controller pushes the foot on while the ball brakes it, and the ball gets up to 8 % more speed."""

LATEST = 0.1
"""Time after the planned impact at which the foot counts as having missed the ball [s]."""

RECOVERY = 1.0
"""Time after the ball has left at which the simulation ends [s]."""

LARGEST_TILT, LEAST_HEIGHT = math.radians(45.0), 0.7
"""Tilt of the trunk [rad], and height of the base over its planned one, of an upright robot."""

PLATE = 0.05
"""Half the width of the plate at the contact point, which strikes the ball [m]."""

LEAST_LOAD = 0.05
"""Share of the robot's weight on the sole from which on its margins count."""

AVERAGED = 0.02
"""Time over which forces on the sole are averaged for its margins [s]: with steps of 2 ms, stiff
contacts of sole and floor rattle between none and several times the weight."""

CORNER_RADIUS = 5e-3
"""Radius of the spheres at the corners of the sole [m]."""

LEAST_RADIUS = 1e-4
"""Radius of the spheres that stand for corners of the kicking foot [m]."""

FLOOR = 'solref="0.005 1" solimp="0.99 0.999 0.001 0.5 2"'
"""Contact of floor and feet: stiff and without rebound, as MuJoCo's attributes."""


class Controller(StrEnum):
    """How joints follow the motion: by its torques and a PD controller, or by the latter alone."""

    TORQUE_PD = "torque+pd"
    PD = "pd"


@dataclass(frozen=True, eq=False, repr=False)
class MujocoRun(ReprMixin):
    """A planned motion as MuJoCo carries it out.

    Attributes:
        plan: that is carried out.
        tuning: contact of the ball with the striking plate.
        t: times, shape `(k,)` [s, planned impact at 0].
        q: configurations of the robot, shape `(k, nq)`, in its own coordinates.
        torque: of the joints, shape `(k, nv)` [N m; N].
        ball_position: centre of the ball, shape `(k, 3)` [m, world frame].
        ball_after: the ball when it has left the foot; at rest where the foot misses it.
        delay: time of the first contact after the planned one [s]; NaN where there is none.
        path: flight or course of the ball from `ball_after` to the plane of the target, or to the
            ground before it; None where the foot misses it.
        upright: whether the robot still stands 1 s after the ball has left; true for a leg on a
            fixed base.
        margins: least distance from each limit over the run: `torque`, `speed` and `friction` as
            a share of the limit, `centre of pressure` from the edge of the sole, where the sole is
            in the simulation [m]. The last two are of forces averaged over 20 ms.
    """

    plan: KickPlan
    tuning: MujocoTuning
    t: Array
    q: Array
    torque: Array
    ball_position: Array
    ball_after: BallState
    delay: float
    path: Flight | Course | None
    upright: bool
    margins: Mapping[str, float]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        freeze_arrays(vars(self))

    @property
    def speed_error(self) -> float:
        """Speed of the ball over that of the launch which meets the goal, less 1."""
        return float(self.ball_after.speed / np.linalg.norm(self.plan.launch.velocity)) - 1.0

    @property
    def direction_error(self) -> float:
        """Angle between the ball's velocity and that launch [rad]; NaN for a missed ball."""
        if self.path is None:
            return math.nan
        velocity, wish = self.ball_after.velocity, self.plan.launch.velocity
        sine = float(np.linalg.norm(np.cross(velocity, wish)))
        return math.atan2(sine, float(velocity @ wish))

    @property
    def miss(self) -> float:
        """Distance of the path's end from the target [m]; infinite for a missed ball."""
        if self.path is None:
            return math.inf
        end = self.path.landing if isinstance(self.path, Flight) else self.path.rest
        target = self.plan.impact.ball_before.position + self.plan.aim.target
        return float(np.linalg.norm(end.position - target))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines about a missed ball, a fall, and a contact that could not be tuned."""
        lines = [] if self.path is not None else ["the foot does not reach the ball"]
        if not self.upright:
            lines.append(f"the robot does not stand {RECOVERY:g} s after the kick")
        return (*lines, *self.tuning.warnings)

    def to_json(self) -> dict[str, object]:
        """Return the numbers, for JSON."""
        hit = self.path is not None
        return {
            "ball_velocity": self.ball_after.velocity.tolist() if hit else None,
            "ball_spin": self.ball_after.spin.tolist() if hit else None,
            "speed_error": self.speed_error if hit else None,
            "direction_error": self.direction_error if hit else None,
            "miss": self.miss if hit else None,
            "delay": self.delay if hit else None,
            "upright": self.upright,
            "margins": dict(self.margins),
            "warnings": list(self.warnings),
        }

    def _rows(self) -> Iterable[Row]:
        if self.path is not None:
            yield "launch", self.ball_after.velocity, "m/s"
            yield "speed error", f"{self.speed_error:+.1%}", ""
            yield "direction error", math.degrees(self.direction_error), "deg"
            yield "miss of the target", self.miss, "m"
            yield "delay of the contact", 1e3 * self.delay, "ms"
        yield "upright", self.upright, ""
        for name, margin in self.margins.items():
            yield f"margin, {name}", margin, "m" if name == "centre of pressure" else ""
        yield from warned(self.warnings)


@validation.check_arguments
def run_in_mujoco(
    plan: KickPlan,
    *,
    timestep: float = 0.002,
    controller: str = Controller.TORQUE_PD,
    contact_time: float = CONTACT_TIME,
) -> MujocoRun:
    r"""Carry out the motion of a plan in MuJoCo: drives, floor, and a contact that takes time.

    Needs MuJoCo: `pip install "kickdyn[mjcf]"`. A drive's torque is

    .. math:: \tau = \tau_r + k\,(q_r - q) + d\,(\dot q_r - \dot q) , \qquad |\tau| \le \tau_{max} ,

    of the motion's torque, position and velocity at its time, with :math:`k = 8\, \tau_{max}` per
    rad or m and a damping ratio of 0.3. The motion's time stops just before the impact until the
    ball has left the foot. A switch at the planned time would brake the foot before it hits.

    The foot strikes with a plate at the contact point, whose contact `tune_mujoco` computes. The
    robot stands on the corners of its sole, its kicking foot may step on the floor, and nothing
    else collides. The ball is held where it lies until the foot touches it, and afterwards flies
    by `fly`, or `follow`.

    Args:
        plan: with a `motion`.
        timestep: time step of the simulation [s], as for `tune_mujoco`.
        controller: `torque+pd`, or `pd` for a controller without the motion's torques.
        contact_time: of foot and ball [s], as for `tune_mujoco`.

    Raises:
        InvalidInput: a plan without a motion, a joint without a torque limit, MuJoCo missing.
    """
    if plan.motion is None:
        raise InvalidInput("the plan has no motion: plan it with plan_kick(..., motion=True)")
    chosen = validation.choice("controller", controller, Controller)
    load_mujoco()
    motion, impact = plan.motion, plan.impact
    standing = StandingRobot(motion.robot) if is_floating(motion.robot) else None
    rooted = motion.robot if standing is None else standing.leg
    posture = rooted.posture(rooted.configuration(motion.robot.joint_values(motion.q(0.0))))
    posture = posture.with_contact_offset(impact.contact.offset)
    v = np.zeros(rooted.nv)
    for name in motion.joints:
        v[rooted.velocity_index(name)] = motion.v(0.0)[motion.robot.velocity_index(name)]
    before = impact.ball_before
    tuning = tune_mujoco(
        posture, v, impact.ball, impact.contact, timestep=timestep, contact_time=contact_time,
        ball_velocity=before.velocity, ball_spin=before.spin,
    )  # fmt: skip
    field = _Field(motion, impact, standing, tuning)
    field.set_gains(rooted, posture.q)
    samples = _simulate(field, feed_forward=chosen is Controller.TORQUE_PD)
    return _result(plan, tuning, field, samples)


class _Samples(NamedTuple):
    """What a simulation leaves: a row for each step, and the ball when it has left the foot."""

    rows: Sequence[tuple[Array, Array, Array]]  # qpos, qvel, torque of the drives, before each step
    ground: Sequence[Array]  # what `_Field.sole_load` returns, in each step
    touched: int | None  # step of the first contact
    ball: BallState | None


class _Field:
    """The compiled model of floor, robot and ball, and the motion as its drives' references."""

    def __init__(
        self, motion: Motion, impact: Impact, standing: StandingRobot | None, tuning: MujocoTuning
    ) -> None:
        self.mujoco, self.motion, self.impact = load_mujoco(), motion, impact
        self.standing, self.timestep = standing, tuning.timestep
        robot = motion.robot
        self.joints = robot.single_joints
        self.columns = [robot.velocity_index(name) for name in self.joints]
        self.limits = robot.effort_limit[self.columns]
        for name, limit in zip(self.joints, self.limits, strict=True):
            if not 0.0 < limit < math.inf:
                raise InvalidInput(
                    f"joint {name!r} has the torque limit {limit:g}: a controller in MuJoCo needs "
                    "one above 0, as <limit effort=...> of a URDF"
                )
        with quiet_mujoco():
            self.model = self.mujoco.MjModel.from_xml_string(self._text(tuning))
        self.data = self.mujoco.MjData(self.model)
        self.addresses = [int(self.model.joint(name).qposadr[0]) for name in self.joints]
        self.rates = [int(self.model.joint(name).dofadr[0]) for name in self.joints]
        self.plate, self.sole = self.model.geom("plate").id, range(0)
        if standing is not None:
            first = self.model.geom("sole 0").id
            self.sole = range(first, first + len(self.corners))

    def set_gains(self, rooted: Leg, q: Array) -> None:
        """Set stiffness and damping of the drives by the inertias of joints in a posture.

        The inertias are of the robot on its supporting foot.
        """
        inertia = np.diag(pin.crba(rooted.model, rooted.model.createData(), q))
        inertia = inertia[[rooted.velocity_index(name) for name in self.joints]]
        self.stiffness = POSITION_GAIN * self.limits
        self.damping = 2.0 * DAMPING_RATIO * np.sqrt(self.stiffness * inertia)
        self.model.actuator_biasprm[:, 1] = -self.stiffness
        self.model.actuator_biasprm[:, 2] = -self.damping

    def _text(self, tuning: MujocoTuning) -> str:
        """Return the model in MJCF."""
        robot, ball, contact = self.motion.robot, self.impact.ball, tuning.contact
        model, posture = robot.model, self.impact.posture
        normal = posture.rotation_world_joint.T @ self.impact.contact.normal
        face = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
        geoms = {
            robot.contact_joint: f'<geom name="plate" type="box" size="{PLATE} {PLATE} 0.005" '
            f'quat="{quaternion(face)}" pos="{row(posture.contact_lever - 0.005 * normal)}"/>'
        }
        pairs, floor = pair(contact, "plate"), ""
        if self.standing is not None:
            floor = '<geom name="floor" type="plane" size="9 9 1"/>'
            support, level = self.standing.support, self.standing.placement.rotation[2]
            frame = model.frames[frame_id(model, support.frame)]
            corners = [frame.placement.act(c + CORNER_RADIUS * level) for c in self.corners]
            radii = np.full(len(corners), CORNER_RADIUS)
            foot = joint_spheres(robot, robot.contact_joint)
            extremes, _ = extreme_spheres(foot)
            mu = self.friction
            for name, joint, body in (
                ("sole", int(frame.parentJoint), Spheres(np.array(corners), radii)),
                (
                    "foot",
                    robot.contact_joint,
                    Spheres(foot.centres[extremes], foot.radii[extremes]),
                ),
            ):
                for number, centre in enumerate(body.centres):
                    radius = max(float(body.radii[number]), LEAST_RADIUS)
                    geoms[joint] = geoms.get(joint, "") + (
                        f'<geom name="{name} {number}" type="sphere" size="{radius!r}" '
                        f'pos="{row(centre)}"/>'
                    )
                    pairs += (
                        f'<pair geom1="floor" geom2="{name} {number}" condim="3" {FLOOR} '
                        f'friction="{mu!r} {mu!r} 0 0 0"/>'
                    )
        motors = "".join(
            f'<general joint={quoteattr(name)} gainprm="1" biastype="affine" biasprm="0 0 0" '
            f'forcelimited="true" forcerange="{-limit!r} {limit!r}"/>'
            for name, limit in zip(self.joints, self.limits.tolist(), strict=True)
        )
        return f"""<mujoco>
  {COMPILER}
  <default><geom contype="0" conaffinity="0"/></default>
  <option gravity="{row(model.gravity.linear)}" timestep="{self.timestep!r}" \
integrator="{tuning.integrator}" cone="elliptic" impratio="100" tolerance="1e-10"/>
  <worldbody>
    {floor}{write_bodies(model, geoms, limits=True)}<body name="ball"><freejoint/>
      <inertial pos="0 0 0" mass="{ball.mass!r}" diaginertia="{row([ball.inertia] * 3)}"/>
      <geom name="ball" type="sphere" size="{ball.radius - contact.margin!r}"/>
    </body>
  </worldbody>
  <contact>{pairs}</contact>
  <actuator>{motors}</actuator>
</mujoco>"""

    @property
    def corners(self) -> Array:
        """Corners of the sole, shape `(k, 3)` [m, support frame]; none on a fixed base."""
        sole = None if self.standing is None else self.standing.support.sole
        return np.zeros((0, 3)) if sole is None else sole

    @property
    def friction(self) -> float:
        """Coefficient of friction of floor and sole; 1 where the support has none."""
        friction = None if self.standing is None else self.standing.support.friction
        return 1.0 if friction is None else friction

    def reference(self, t: float, *, feed_forward: bool) -> Array:
        """Return the drives' controls for the motion at a time [s]; late ones for one at 0."""
        motion, robot = self.motion, self.motion.robot
        values = robot.joint_values(motion.q(t))
        position = np.array([values[name] for name in self.joints])
        control = self.stiffness * position + self.damping * motion.v(t)[self.columns]
        if feed_forward:
            control += motion.torque(t)[self.columns]
        return np.asarray(control)

    def place(self) -> None:
        """Set the state in which the motion begins, and the ball where it lies."""
        motion, data = self.motion, self.data
        q = motion.q(motion.begin)
        self.mujoco.mj_resetData(self.model, data)
        data.qpos[:-7] = mujoco_state(motion.robot.model, q, np.zeros(motion.robot.nv))[0]

    def set_ball(self, t: float) -> None:
        """Put the ball where it is at a time [s] before the contact."""
        before, data = self.impact.ball_before, self.data
        data.qpos[-7:] = [*before.position + t * before.velocity, 1.0, 0.0, 0.0, 0.0]
        data.qvel[-6:] = [*before.velocity, *before.spin]

    def ball(self, t: float) -> BallState:
        """Return the ball at a time [s]."""
        data = self.data
        return BallState(data.qpos[-7:-4].copy(), data.qvel[-6:-3].copy(), ball_spin(data), t)

    def pushes(self) -> bool:
        """Return whether the plate pushed the ball in the last step."""
        contacts = self.data.contact
        first = contacts.efc_address[np.any(contacts.geom == self.plate, axis=1)]
        return bool((first >= 0).any() and (self.data.efc_force[first] > 0.0).any())

    def sole_load(self) -> Array:
        """Return the force of the floor on the sole, and the moment of its normal force, `(5,)`.

        The force is along the normal, then across it [N]. The moment is the normal force times x
        and y [N m] of its points, seen from the sole and with the sole at its planned place.
        """
        model, load, force = self.motion.robot.model, np.zeros(5), np.zeros(6)
        if self.standing is None:
            return load
        frame = model.frames[frame_id(model, self.standing.support.frame)]
        body = self.data.body(str(model.names[frame.parentJoint]))
        place = pin.SE3(body.xmat.reshape(3, 3), body.xpos) * frame.placement
        to_planned = self.standing.placement * place.inverse()
        contacts = self.data.contact
        for number in np.flatnonzero(np.isin(contacts.geom, self.sole).any(axis=1)):
            self.mujoco.mj_contactForce(self.model, self.data, int(number), force)
            load[:3] += force[:3]
            load[3:] += force[0] * to_planned.act(contacts.pos[number])[:2]
        return load

    def is_upright(self, planned: Array) -> bool:
        """Return whether the base is as high and upright as that of a planned configuration."""
        if self.standing is None:
            return True
        model = self.motion.robot.model
        data = model.createData()
        pin.forwardKinematics(model, data, planned)
        body, pose = self.data.body(str(model.names[1])), data.oMi[1]
        cosine = float(body.xmat.reshape(3, 3)[2] @ pose.rotation[2])  # of the two vertical axes
        height = float(body.xpos[2] / pose.translation[2])
        return cosine > math.cos(LARGEST_TILT) and height > LEAST_HEIGHT


@quiet_mujoco()
def _simulate(field: _Field, *, feed_forward: bool) -> _Samples:
    """Carry out the motion; MuJoCo writes no warnings."""
    motion, data, step = field.motion, field.data, field.timestep
    rows: list[tuple[Array, Array, Array]] = []
    ground: list[Array] = []
    touched: int | None = None
    ball: BallState | None = None
    first = math.floor(motion.begin / step)
    at_impact = field.reference(0.0, feed_forward=feed_forward)
    field.place()
    number, last = first, math.ceil(LATEST / step)
    while number < last:
        t = number * step
        if ball is not None:
            control = field.reference(t - float(ball.time) + step, feed_forward=feed_forward)
        elif t < 0.0:
            control = field.reference(t, feed_forward=feed_forward)
        else:
            control = at_impact
        if touched is None:
            field.set_ball(t)
        data.ctrl[:] = control
        before = data.qpos.copy(), data.qvel.copy()
        field.mujoco.mj_step(field.model, data)
        rows.append((*before, data.actuator_force.copy()))
        ground.append(field.sole_load())
        number += 1
        if field.pushes():
            touched = number - 1 if touched is None else touched
        elif touched is not None and ball is None:
            ball = field.ball(number * step)
            last = number + math.ceil(RECOVERY / step)
    return _Samples(rows, ground, touched, ball)


def _result(plan: KickPlan, tuning: MujocoTuning, field: _Field, samples: _Samples) -> MujocoRun:
    """Return the run that a simulation shows."""
    motion, robot, step = field.motion, field.motion.robot, field.timestep
    qpos, qvel, forces = (np.array(rows) for rows in zip(*samples.rows, strict=True))
    first = math.floor(motion.begin / step)
    t = np.asarray(step * (first + np.arange(len(qpos))))
    torque = np.zeros((len(t), robot.nv))
    torque[:, field.columns] = forces
    q = np.array([_configuration(field, row) for row in qpos])
    speed = np.abs(qvel[:, field.rates]) / robot.velocity_limit[field.columns]
    margins = {
        "torque": 1.0 - float((np.abs(forces) / field.limits).max()),
        "speed": 1.0 - float(speed.max()),
        **_ground_margins(field, samples),
    }
    touched, ball = samples.touched, samples.ball
    return MujocoRun(
        plan=plan, tuning=tuning, t=t, q=q, torque=torque, ball_position=qpos[:, -7:-4],
        ball_after=field.impact.ball_before if ball is None else ball,
        delay=math.nan if touched is None else step * touched,
        path=None if ball is None else _fly(plan, ball),
        upright=field.is_upright(motion.q(motion.end)),
        margins=margins,
    )  # fmt: skip


def _configuration(field: _Field, qpos: Array) -> Array:
    """Return the configuration of the robot, shape `(nq,)`, from MuJoCo's `qpos`."""
    robot = field.motion.robot
    q = robot.configuration(dict(zip(field.joints, qpos[field.addresses], strict=True)))
    if field.standing is not None:
        base = pin.XYZQUATToSE3(qpos[[0, 1, 2, 4, 5, 6, 3]])
        q[:7] = pin.SE3ToXYZQUAT(robot.model.jointPlacements[1].inverse() * base)
    return q


def _ground_margins(field: _Field, samples: _Samples) -> dict[str, float]:
    """Return the margins of the sole, from the times at which the ground carries some weight."""
    if field.standing is None:
        return {}
    normals, offsets = sole_edges(field.standing)
    weight = 9.81 * pin.computeTotalMass(field.motion.robot.model)
    steps = max(round(AVERAGED / field.timestep), 1)
    loads = sliding_window_view(np.array(samples.ground), steps, axis=0).mean(axis=-1)
    loads = loads[loads[:, 0] >= LEAST_LOAD * weight]
    if not len(loads):  # the sole never carried weight
        return {"friction": -math.inf, "centre of pressure": -math.inf}
    normal = loads[:, 0]
    across = np.linalg.norm(loads[:, 1:3], axis=1)
    centres = loads[:, 3:] / normal[:, None]
    return {
        "friction": float((1.0 - across / (field.friction * normal)).min()),
        "centre of pressure": float((offsets - centres @ normals.T).min()),
    }


def _fly(plan: KickPlan, ball: BallState) -> Flight | Course:
    """Return the path of the ball to the plane of the plan's target, or to the ground before it."""
    start, goal = plan.impact.ball_before.position, plan.aim
    plane = Plane(start + goal.target, -goal.ahead, "centre")
    planned = plan.path if isinstance(plan.path, Flight) else plan.path.flights[0]
    ground = planned.ground
    position = ball.position.copy()
    if ground is not None:  # MuJoCo's ball may have been pressed into the lawn
        position[2] = max(position[2], ground.height + planned.ball.radius)
    state = BallState(position, ball.velocity, ball.spin)
    if isinstance(plan.path, Flight):
        return fly(state, planned.ball, planned.air, ground, plane=plane)
    return follow(state, planned.ball, planned.air, ground, plane=plane)
