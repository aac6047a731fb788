"""A planned motion carried out in MuJoCo: floor and sole, drives with limits, and the ball."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import sliding_window_view

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.files import attributes
from kickdyn.core.representation import ReprMixin, Row, freeze_arrays, warned
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import Course, follow
from kickdyn.identification.track import Track
from kickdyn.impact.force_model import CONTACT_TIME
from kickdyn.plane import Plane
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.robot.collisions import FootKind
from kickdyn.robot.mjcf_file import quiet_mujoco
from kickdyn.robot.standing import StandingRobot, is_floating, sole_edges
from kickdyn.simulators.mujoco_field import KickNoise, MujocoField, draw
from kickdyn.simulators.mujoco_kick import load_mujoco
from kickdyn.simulators.striking_foot import find_foot, plate
from kickdyn.simulators.tune_mujoco import MujocoTuning, tune_mujoco

LATEST_IMPACT = 0.1
"""Time after the planned impact at which the foot counts as having missed the ball [s]."""

RECOVERY, REST = 1.0, 0.2
"""Least times from when the ball has left, and from the end of the motion, to the end of the
simulation [s]."""

TRACKED = 20
"""Number of positions of a track."""

LEAST_LOAD = 0.05
"""Share of the robot's weight on the sole from which on its margins count."""

ROUNDING = 1e-12
"""Distance from the edge of the sole that is rounding [m]."""

AVERAGED = 0.02
"""Time over which forces on the sole are averaged for its margins [s]: with steps of 2 ms, stiff
contacts of sole and floor rattle between none and several times the weight."""


class Controller(StrEnum):
    """How joints follow the motion: by its torques and a PD controller, or by the latter alone."""

    TORQUE_PD = "torque+pd"
    PD = "pd"


@dataclass(frozen=True, eq=False, repr=False)
class MujocoRun(ReprMixin):
    """A planned motion as MuJoCo carries it out.

    Attributes:
        plan: that is carried out.
        tuning: contact of the ball with the foot.
        t: times, shape `(k,)` [s, planned impact at 0].
        q: configurations of the robot, shape `(k, nq)`, in its own coordinates.
        torque: of the joints, shape `(k, nv)` [N m; N].
        ball_position: centre of the ball, shape `(k, 3)` [m, world frame]; after `ball_after` the
            ball falls without air and ground there, and `path` is its motion with them.
        ball_after: the ball when it has left the foot for the last time; at rest where the foot
            misses it.
        delay: time of the first contact after the planned one [s]; NaN where there is none.
        path: flight or course of the ball from `ball_after` to the plane of the target, or to the
            ground before it; None if the foot misses it.
        upright: whether the robot still stands 1 s after the ball has left, or 0.2 s after the end
            of a motion that takes longer; true for a leg on a fixed base.
        margins: least distance from each limit over the run: `torque`, `speed` and `friction` as
            a share of the limit, `centre of pressure` from the edge of the sole [m]. The last two
            are of forces averaged over 20 ms. With 0 as the last one, the sole rests on an edge
            or a corner for that time: it tips, and may come down again.
        seed: of the differences from the plan; None if there are none.
        foot: what struck the ball, `shapes` or `plate`.
        doubts: a line for everything about the foot that is not as it was asked for.
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
    seed: int | None = None
    foot: str = FootKind.PLATE.value
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        freeze_arrays(vars(self))

    @property
    def contact_time(self) -> float:
        """Duration of the contact of foot and ball [s], whole time steps; NaN for a miss."""
        return float(self.ball_after.time) - self.delay

    @property
    def track(self) -> Track:
        """Positions of the ball in flight from where it lay [m], for `Learner.observe`.

        Times are since the middle of the contact [s].

        Raises:
            InvalidInput: the foot misses the ball.
        """
        if self.path is None:
            raise InvalidInput("the foot misses the ball: there is no track of it")
        times = np.linspace(0.0, self.path.duration, TRACKED)
        start = self.plan.impact.ball_before.position
        positions = self.path.sample(times).position - start
        return Track(times + 0.5 * self.contact_time, positions)

    @property
    def speed_error(self) -> float:
        """Speed of the ball over the launch speed that meets the goal, less 1."""
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
        return float(np.linalg.norm(end.position - self.plan.target_position))

    @property
    def summary(self) -> str:
        """The errors of the ball, and whether the robot stands, as a sentence."""
        stands = "stands 1 s later" if self.upright else "falls"
        if self.path is None:
            return f"In MuJoCo, the foot misses the ball, and the robot {stands}."
        return (
            f"In MuJoCo, the launch differs from the required one by {self.speed_error:+.1%} in "
            f"speed and {math.degrees(self.direction_error):.1f} deg in direction, and the ball "
            f"misses the target by {self.miss:.2g} m; the robot {stands}."
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines about a missed ball, a fall, the foot, and a contact that could not be tuned."""
        lines = [] if self.path is not None else ["the foot does not reach the ball"]
        if not self.upright:
            lines.append(f"the robot does not stand {RECOVERY:g} s after the kick")
        return (*lines, *self.doubts, *self.tuning.warnings)

    def to_json(self) -> dict[str, object]:
        """Return the numbers, for JSON."""
        of_ball = {
            "ball_velocity": self.ball_after.velocity.tolist(),
            "ball_spin": self.ball_after.spin.tolist(),
            **attributes(self, "speed_error direction_error miss delay"),
        }
        if self.path is None:
            of_ball = dict.fromkeys(of_ball)
        return of_ball | attributes(self, "upright foot seed margins warnings")

    def _rows(self) -> Iterable[Row]:
        yield "foot", self.foot, ""
        if self.path is not None:
            yield "launch", self.ball_after.velocity, "m/s"
            yield "speed error", f"{self.speed_error:+.1%}", ""
            yield "direction error", math.degrees(self.direction_error), "deg"
            yield "miss of the target", self.miss, "m"
            yield "delay of the contact", 1e3 * self.delay, "ms"
        yield "upright", self.upright, ""
        for name, margin in self.margins.items():
            on_edge = name == "centre of pressure" and margin == 0.0
            value = "0 m: the sole tips about an edge or a corner" if on_edge else margin
            unit = "m" if name == "centre of pressure" and not on_edge else ""
            yield f"margin, {name}", value, unit
        yield from warned(self.warnings)


@validation.check_arguments
def run_in_mujoco(
    plan: KickPlan,
    *,
    timestep: float = 0.002,
    controller: str = Controller.TORQUE_PD,
    contact_time: float = CONTACT_TIME,
    tuning: MujocoTuning | None = None,
    seed: int | None = None,
    noise: KickNoise | None = None,
    foot: str = FootKind.SHAPES,
    ball_displacement: ArrayLike = (0.0, 0.0),
) -> MujocoRun:
    r"""Carry out the motion of a plan in MuJoCo: drives, floor, and a contact that takes time.

    Needs MuJoCo: `pip install "kickdyn[mjcf]"`. A drive's torque is

    .. math:: \tau = \tau_r + k\,(q_r - q) + d\,(\dot q_r - \dot q) , \qquad |\tau| \le \tau_{max} ,

    of the motion's torque, position and velocity at its time, with :math:`k = 8\, \tau_{max}` per
    rad or m and a damping ratio of 0.3. The motion's time stops just before the impact until the
    ball has left the foot. A switch at the planned time would brake the foot before it hits.

    The shapes that the robot's file has for contacts strike the ball, of all bodies that are fixed
    to the joint of the contact frame, meshes by their convex hulls; the contact is that which
    `tune_mujoco` computes for a plane. What the file draws does so where it has no shapes for
    contacts, or only ones more than 1 cm from the ball at the planned impact, like points under a
    sole; a plate does where it draws nothing, or where a shape is more than 5 mm in the ball at
    first. The run's warnings say so. They also name meshes that cannot be read, and shapes whose
    place or normal at the planned impact is off by more than 5 mm or 5 degrees.

    The robot stands on the corners of its sole, its kicking foot may step on the floor, unless it
    begins more than 5 mm under the ground, and nothing else collides. The ball is fixed where it
    lies until the foot touches it. From where it has left the foot, `fly`, or `follow`, computes
    its path with air, bounces and rolling. This model of MuJoCo has no air, and its ball does not
    touch the floor, which hardly counts during the contact.

    With a seed, the robot is not the one of the plan: masses of its bodies, friction of ground and
    ball, and the place of the ball differ at random, and commands reach the drives late.

    Args:
        plan: with a `motion`.
        timestep: time step of the simulation [s], as for `tune_mujoco`.
        controller: `torque+pd`, or `pd` for a controller without the motion's torques.
        contact_time: of foot and ball [s], as for `tune_mujoco`.
        tuning: contact of an earlier run with the same ball, such as `run.tuning`, in place of
            `timestep` and `contact_time`; it saves most of the time, and compares plans in the
            same contact.
        seed: of the differences from the plan; None is a robot that is as planned.
        noise: how large they are; None is `KickNoise()`.
        foot: `shapes`, or `plate` for a square of 10 cm at the contact point, across the normal,
            which can touch the ball from 0.1 s before the impact on.
        ball_displacement: along x and y from where the plan has the ball, which the robot does not
            know, shape `(2,)` [m, world frame].

    Raises:
        InvalidInput: a plan without a motion, a joint without a torque limit, a tuning for another
            ball, MuJoCo missing.

    Example:
        >>> import kickdyn as kd
        >>> goal, ball, air = kd.Goal(20, time=1.2), kd.Ball(), kd.Air()
        >>> plan = kd.plan_kick(kd.Leg.human(), goal, ball, air, motion=True)
        >>> first = kd.run_in_mujoco(plan)
        >>> runs = [kd.run_in_mujoco(plan, tuning=first.tuning, seed=n) for n in range(3)]
        >>> all(abs(run.speed_error) < 0.06 for run in [first, *runs])
        True
    """
    if plan.motion is None:
        raise InvalidInput("the plan has no motion: plan it with plan_kick(..., motion=True)")
    chosen = validation.choice("controller", controller, Controller)
    kind = validation.choice("foot", foot, FootKind)
    displacement = validation.vector("ball_displacement", ball_displacement, 2, unit="m")
    if seed is not None:
        validation.check_type(int, seed=seed)
        validation.number("seed", seed, at_least=0)
    elif noise is not None:
        raise InvalidInput("noise is given without a seed: give both")
    load_mujoco()
    motion, impact = plan.motion, plan.impact
    if tuning is not None and tuning.ball != impact.ball:
        raise InvalidInput("tuning is for another ball than the plan's")
    standing = StandingRobot(motion.robot) if is_floating(motion.robot) else None
    rooted = motion.robot if standing is None else standing.leg
    posture = rooted.posture(rooted.configuration(motion.robot.joint_values(motion.q(0.0))))
    posture = posture.with_contact_offset(impact.contact.offset)
    if tuning is None:
        v = np.zeros(rooted.nv)
        for name in motion.joints:
            v[rooted.velocity_index(name)] = motion.v(0.0)[motion.robot.velocity_index(name)]
        before = impact.ball_before
        tuning = tune_mujoco(
            posture, v, impact.ball, impact.contact, timestep=timestep, contact_time=contact_time,
            ball_velocity=before.velocity, ball_spin=before.spin,
        )  # fmt: skip
    bodies = motion.robot.model.njoints - 1
    drawn = KickNoise(0, 0, 0, 0) if seed is None else noise or KickNoise()
    differs = draw(drawn, seed or 0, bodies)
    differs = differs._replace(place=differs.place + displacement)
    strikes = plate(impact) if kind is FootKind.PLATE else find_foot(motion, impact, differs.place)
    field = MujocoField(motion, impact, standing, tuning, differs, strikes)
    field.set_gains(rooted, posture.q)
    samples = _simulate(field, feed_forward=chosen is Controller.TORQUE_PD)
    return replace(_result(plan, tuning, field, samples), seed=seed)


class _Samples(NamedTuple):
    """What a simulation leaves: a row for each step, and the ball when it has left the foot."""

    rows: Sequence[tuple[Array, Array, Array]]  # qpos, qvel, torque of the drives, before each step
    ground: Sequence[Array]  # results of `MujocoField.sole_load`
    touched: int | None  # step of the first contact
    ball: BallState | None


@quiet_mujoco()
def _simulate(field: MujocoField, *, feed_forward: bool) -> _Samples:
    """Carry out the motion; MuJoCo writes no warnings."""
    motion, data, step = field.motion, field.data, field.timestep
    rows: list[tuple[Array, Array, Array]] = []
    ground: list[Array] = []
    touched, pushing, left = None, False, math.inf
    ball: BallState | None = None
    start = math.floor(motion.begin / step)
    at_impact = field.reference(0.0, feed_forward=feed_forward)
    field.place()
    number, last = start, math.ceil(LATEST_IMPACT / step)
    while number < last:
        sent = number * step - field.disturbance.delay  # when the commands of this step were
        if sent > left - 0.5 * step:
            control = field.reference(sent - left + step, feed_forward=feed_forward)
        elif sent < 0.0:
            control = field.reference(sent, feed_forward=feed_forward)
        else:
            control = at_impact
        place = None if touched is not None else field.set_ball(number * step)
        data.ctrl[:] = control
        before = data.qpos.copy(), data.qvel.copy()
        if place is not None:
            before[0][-7:-4] = place
        field.mujoco.mj_step(field.model, data)
        rows.append((*before, data.actuator_force.copy()))
        ground.append(field.sole_load())
        number += 1
        if field.pushes():
            touched, pushing = number - 1 if touched is None else touched, True
        elif pushing:
            pushing = False
            if ball is None:
                left = max(number * step, 0.0)
                last = number + math.ceil(max(RECOVERY, motion.end + REST) / step)
            ball = field.ball(number * step)
    return _Samples(rows, ground, touched, ball)


def _result(plan: KickPlan, tuning: MujocoTuning, field: MujocoField, run: _Samples) -> MujocoRun:
    """Return the result that a simulation shows."""
    motion, robot, step = field.motion, field.motion.robot, field.timestep
    qpos, qvel, forces = (np.array(rows) for rows in zip(*run.rows, strict=True))
    start = math.floor(motion.begin / step)
    t = np.asarray(step * (start + np.arange(len(qpos))))
    torque = np.zeros((len(t), robot.nv))
    torque[:, field.columns] = forces
    q = np.array([_configuration(field, row) for row in qpos])
    speed = np.abs(qvel[:, field.rates]) / robot.velocity_limit[field.columns]
    margins = {
        "torque": 1.0 - float((np.abs(forces) / field.limits).max()),
        "speed": 1.0 - float(speed.max()),
        **_ground_margins(field, run),
    }
    touched, ball = run.touched, run.ball
    return MujocoRun(
        plan=plan, tuning=tuning, t=t, q=q, torque=torque, ball_position=qpos[:, -7:-4],
        ball_after=field.impact.ball_before if ball is None else ball,
        delay=math.nan if touched is None else step * touched,
        path=None if ball is None else _fly(plan, ball),
        upright=field.is_upright(motion.q(motion.end)),
        margins=margins, foot=field.foot.kind.value, doubts=(*field.foot.warnings, *field.warnings),
    )  # fmt: skip


def _configuration(field: MujocoField, qpos: Array) -> Array:
    """Return the configuration of the robot, shape `(nq,)`, from MuJoCo's `qpos`."""
    robot = field.motion.robot
    q = robot.configuration(dict(zip(field.joints, qpos[field.addresses], strict=True)))
    if field.standing is not None:
        base = pin.XYZQUATToSE3(qpos[[0, 1, 2, 4, 5, 6, 3]])
        q[:7] = pin.SE3ToXYZQUAT(robot.model.jointPlacements[1].inverse() * base)
    return q


def _ground_margins(field: MujocoField, samples: _Samples) -> dict[str, float]:
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
    tangential = np.linalg.norm(loads[:, 1:3], axis=1)
    centres = loads[:, 3:] / normal[:, None]
    inside = float((offsets - centres @ normals.T).min())
    return {
        "friction": float((1.0 - tangential / (field.friction * normal)).min()),
        "centre of pressure": 0.0 if abs(inside) < ROUNDING else inside,
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
