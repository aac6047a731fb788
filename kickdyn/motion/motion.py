"""The motion of a kick: joints, torques and the ground's wrench from rest to rest, over time."""

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.files import FileName
from kickdyn.core.plot_style import styled
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.motion.motion_file import MotionSamples, write_motion
from kickdyn.motion.weight_shift import WeightShift
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.standing import is_floating, place_base, rest_configuration
from kickdyn.robot.surgery import coordinate_indices

if TYPE_CHECKING:
    from scipy.interpolate import BSpline  # takes long to import

DRAWN_TIMES = 400
"""Number of times before the impact, and as many after it, that are drawn."""

SETTLING = 0.6
"""Time after the impact in which joints that gave way return to rest [s]."""


class Phase(NamedTuple):
    """A part of a motion: its name and when it begins and ends [s, impact at 0]."""

    name: str
    begin: float
    end: float


class MotionState(NamedTuple):
    """Configuration, velocity, torques and wrench of the ground, as the methods of `Motion`."""

    q: Array
    v: Array
    torque: Array
    ground_wrench: Array


def settling(t: Array) -> Array:
    r"""Return q, v and a after the impact of a joint that was at rest, over its velocity after it.

    With :math:`x = t/T` up to the time T, `SETTLING`, it is :math:`q = T (x - 6x^3 + 8x^4 - 3x^5)`,
    without acceleration at both ends. The shape is `(3, k)` for k times.
    """
    x = np.minimum(t / SETTLING, 1.0)
    return np.array([
        SETTLING * (x - 6 * x**3 + 8 * x**4 - 3 * x**5),
        1 - 18 * x**2 + 32 * x**3 - 15 * x**4,
        (-36 * x + 96 * x**2 - 60 * x**3) / SETTLING,
    ])  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Motion(ReprMixin):
    r"""The motion of a robot from rest through the impact to rest.

    Joints follow a spline before the impact and one after it; at the impact positions are equal and
    velocities jump. Joints that have no spline stay where `aside` or `rest_configuration` has them,
    but give way in the impact, and return within `SETTLING`. A robot on a floating base stands on
    its first support, which does not move. Before `begin` and after `end` the robot is at rest.

    Attributes:
        robot: that moves, in its own coordinates.
        joints: names of the joints that move, each of one degree of freedom, `(n,)`.
        before: their positions from `begin` to 0, of shape `(n,)` at a time [rad; m for prismatic
            joints].
        after: likewise from 0 to `end`.
        placement: `pin.SE3` of the supporting frame in the world; None on a fixed base.
        limits: what it keeps, for `margins`, as `Margins`; None if there is nothing to keep.
        warnings: a line for each limit that the motion does not keep.
        solution: from which the planner of nearly the same motion starts, if any.
        shift: of the weight from both feet onto the supporting one, before the backswing; in
            reverse, it is also what follows the recovery. None if the robot starts on one foot.
        aside: values of joints that have no spline, other than at rest [rad; m if prismatic].
        pushed: velocities just after the impact of joints that have no spline [rad/s; m/s].
    """

    robot: Leg
    joints: tuple[str, ...]
    before: "BSpline"
    after: "BSpline"
    placement: Any = None
    limits: Any = None
    warnings: tuple[str, ...] = ()
    solution: Any = None
    aside: Mapping[str, float] = field(default_factory=dict)
    shift: WeightShift | None = None
    pushed: Mapping[str, float] = field(default_factory=dict)

    def _rows(self) -> Iterable[Row]:
        yield "joints", ", ".join(self.joints), ""
        yield "begin", self.begin, "s"
        yield "end", self.end, "s"
        yield from warned(self.warnings)

    @property
    def begin(self) -> float:
        """When the robot begins to move [s]; the impact is at 0."""
        return float(self.before.t[0]) - self._shifting

    @property
    def end(self) -> float:
        """When the robot is at rest again [s]."""
        return float(self.after.t[-1]) + self._shifting

    @property
    def _shifting(self) -> float:
        """Duration of the shift of the weight [s]."""
        return 0.0 if self.shift is None else self.shift.duration

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The backswing and the recovery; the weight is shifted before and after these."""
        begin, end = float(self.before.t[0]), float(self.after.t[-1])
        kick = Phase("backswing", begin, 0.0), Phase("recovery", 0.0, end)
        if self.shift is None:
            return kick
        return (
            Phase("shift onto one foot", self.begin, begin),
            *kick,
            Phase("shift onto both feet", end, self.end),
        )

    def q(self, t: float) -> Array:
        """Return the configuration of the robot at a time [s], shape `(nq,)`."""
        return self._state(t)[0]

    def v(self, t: float) -> Array:
        """Return its velocity at a time [s], shape `(nv,)`; at 0, just before the impact."""
        return self._state(t)[1]

    def a(self, t: float) -> Array:
        """Return its acceleration at a time [s], shape `(nv,)`; at 0, just before the impact."""
        return self._state(t)[2]

    @property
    def v_after(self) -> Array:
        """The velocity of the robot just after the impact, shape `(nv,)`."""
        at_rest = self._every_state(0.0)[0][len(self.joints) :]
        v = np.append(self.after(0.0, 1), [*self.pushed.values()])
        return self._on_robot(np.append(self.after(0.0), at_rest), v, np.zeros_like(v))[1]

    def torque(self, t: float) -> Array:
        r"""Return the torques of the joints at a time [s], shape `(nv,)` [N m; N].

        They are :math:`M(q) \dot v + c(q, v) + g(q) - J^T w`, rotors included, with the wrench w of
        the ground on the supporting foot; 0 for a floating base. At 0 they are those just before
        the impact.
        """
        return self.state(t).torque

    def ground_wrench(self, t: float) -> Array:
        """Return the wrench of the ground on the robot at a time, `(6,)` [N, N m, world frame].

        It is the force, then its moment about the world's origin; of a leg on a fixed base, 0. On
        both feet, it is the sum of the `foot_wrenches`.
        """
        return self.state(t).ground_wrench

    def foot_wrenches(self, t: float) -> tuple[Array, Array]:
        """Return the wrenches on the supporting and on the kicking foot, as `ground_wrench`."""
        wrench = self.ground_wrench(t)
        shift = self._shift_at(t)
        return (wrench, np.zeros(6)) if shift is None else shift.wrenches(wrench, self.placement)

    def _shift_at(self, t: float) -> WeightShift | None:
        """Return the shift of the weight, if the robot stands on both feet at a time [s]."""
        time = validation.number("t", t, unit="s")
        return None if self.before.t[0] <= time <= self.after.t[-1] else self.shift

    def joint_state(self, t: float) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration of `joints` at a time [s], `(n,)` each."""
        time = validation.number("t", t, unit="s")
        if shift := self._shift_at(time):  # reversed after the impact
            begun = time - self.begin if time < 0.0 else self.end - time
            q, v, a = shift.joint_state(max(begun, 0.0))
            return q, v if time < 0.0 else -v, a
        spline = self.before if time <= 0.0 else self.after
        q = spline(min(max(time, self.begin), self.end))
        if not self.begin <= time <= self.end:
            return q, np.zeros_like(q), np.zeros_like(q)
        return q, spline(time, 1), spline(time, 2)

    def _every_state(self, t: float) -> tuple[Array, Array, Array]:
        """Return q, v and a of `joints` and of those that the impact pushes, `(n + k,)` each."""
        state, velocity = self.joint_state(t), np.array([*self.pushed.values()])
        pushed = np.multiply.outer(settling(np.array([t]))[:, 0] * (t > 0.0), velocity)
        pushed[0] += self._pushed_rest
        q, v, a = map(np.append, state, pushed)
        return q, v, a

    def margins(self, t: float) -> Mapping[str, float]:
        """Return the distance from each limit by its name at a time [s]; below 0 it is broken.

        Names that end in `[m]` or `[rad]` have that unit; others are shares of the limit.
        """
        if shift := self._shift_at(t):
            return shift.margins(*self.joint_state(t))
        if self.limits is None:
            return {}
        order = [(*self.joints, *self.pushed).index(name) for name in self.limits.joints]
        q, v, a = (values[order] for values in self._every_state(t))
        margins: Mapping[str, float] = self.limits.margins(q, v, a)
        return margins

    @styled()
    def plot(self) -> Any:
        """Return a figure of matplotlib: torques and speeds over their limits, and margins [m].

        The impact is at 0, where speeds and torques jump.
        """
        from matplotlib.figure import Figure

        robot = self.robot
        columns = [robot.velocity_index(name) for name in self.joints]
        torque_limit, speed_limit = robot.effort_limit[columns], robot.velocity_limit[columns]
        before = np.linspace(self.begin, 0.0, DRAWN_TIMES)
        after = np.linspace(1e-9, self.end, DRAWN_TIMES)
        times = np.concatenate([before, after])
        torque = np.array([self.torque(t)[columns] for t in times]) / torque_limit
        speed = np.array([self.v(t)[columns] for t in times]) / speed_limit
        every = [self.margins(t) for t in times]
        lengths = [name for name in every[0] if name.endswith(" [m]")]
        figure = Figure(figsize=(9.0, 8.0))
        rows = figure.subplots(3 if lengths else 2, 1, sharex=True)
        for axes, label, values in (
            (rows[0], "torque, % of its limit", torque),
            (rows[1], "speed, % of its limit", speed),
        ):
            axes.plot(before, 100 * values[:DRAWN_TIMES])
            axes.set_prop_cycle(None)
            axes.plot(after, 100 * values[DRAWN_TIMES:])
            axes.set_ylabel(label)
            axes.set_ylim(-105, 105)
        for line, name in zip(rows[0].lines, self.joints, strict=False):
            line.set_label(name.replace("$", r"\$"))  # matplotlib reads formulas between dollars
        figure.legend(handles=rows[0].lines[: len(columns)], loc="outside lower center", ncols=4)
        if lengths:
            for name in lengths:
                margin = [1e3 * margins[name] for margins in every]
                rows[2].plot(times, margin, label=name.removesuffix(" [m]"))
            rows[2].set_ylabel("margin [mm]")
            rows[2].set_ylim(0, 200)
            rows[2].legend()
        for axes in rows:
            axes.axvline(0.0, color="0.6", linewidth=1, linestyle=":")
        rows[-1].set_xlabel("time from the impact [s]")
        figure.suptitle((robot.name or "leg").replace("$", r"\$"))
        return figure

    def samples(self, rate: float = 100.0) -> MotionSamples:
        """Return the motion at a constant rate, 50 to 500 Hz, from rest to rest."""
        rate = validation.number("rate", rate, at_least=50, at_most=500, unit="Hz")
        t = np.arange(math.floor(rate * self.begin), math.ceil(rate * self.end) + 1) / rate
        states = (np.array(rows) for rows in zip(*map(self.state, t), strict=True))
        return MotionSamples(self.robot, rate, t, *states)

    def save(self, file: FileName, rate: float = 100.0) -> None:
        """Write the motion for other programs, in the format of the file's ending.

        Rows of `.csv` (without a header) are the position of a floating base [m, world frame], its
        quaternion xyzw and the joints in the order of the model; `.npz` has named arrays, `.yaml`
        a `trajectory_msgs/JointTrajectory` of ROS 2 and `.xml` keyframes of MuJoCo, for an
        `<include>` in the robot's file. The rate of the samples is 50 to 500 Hz.

        Raises:
            InvalidInput: another ending, or a file that cannot be written.
        """
        validation.check_type(str, os.PathLike, file=file)
        write_motion(self.samples(rate), file)

    def _state(self, t: float) -> tuple[Array, Array, Array]:
        return self._on_robot(*self._every_state(t))

    def state(self, t: float) -> MotionState:
        """Return configuration, velocity, torques and wrench of the ground at a time [s]."""
        q, v, a = self._state(t)
        model, data = self._model
        torque = pin.rnea(model, data, q, v, a).copy()
        if not self._floats:
            return MotionState(q, v, torque, np.zeros(6))
        wrench = data.liMi[1].act(pin.Force(torque[:6])).vector
        # the ground acts on the supporting foot, and so on the joints between it and the base
        if shift := self._shift_at(t):
            other = shift.wrenches(np.asarray(wrench), self.placement)[1]
            joint = self.robot.contact_joint
            pin.computeJointJacobians(model, data, q)  # and the places of all joints
            foot = pin.getJointJacobian(model, data, joint, pin.LOCAL)
            torque -= foot.T @ data.oMi[joint].actInv(pin.Force(other)).vector
        rows = pin.computeFrameJacobian(model, data, q, self._support_frame, pin.LOCAL)
        torque -= rows.T @ np.linalg.solve(rows[:, :6].T, torque[:6])
        torque[:6] = 0.0
        return MotionState(q, v, torque, np.asarray(wrench))

    def _on_robot(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return q, v and a of the robot from those of the joints that move or are pushed."""
        robot, (qs, vs) = self.robot, self._indices
        model, data = robot.workspace.model, robot.workspace.data
        configuration = self._rest.copy()
        velocity, acceleration = np.zeros(robot.nv), np.zeros(robot.nv)
        configuration[qs], velocity[vs], acceleration[vs] = q, v, a
        if not self._floats:
            return configuration, velocity, acceleration
        frame = self._support_frame
        configuration = place_base(robot, configuration, frame, self.placement)
        rows = pin.computeFrameJacobian(model, data, configuration, frame, pin.LOCAL)
        base, joints = rows[:, :6], rows[:, 6:]
        velocity[:6] = np.linalg.solve(base, -joints @ velocity[6:])
        pin.forwardKinematics(model, data, configuration, velocity, acceleration)
        drift = pin.getFrameAcceleration(model, data, frame, pin.LOCAL).vector
        acceleration[:6] = np.linalg.solve(base, -drift)
        return configuration, velocity, acceleration

    @cached_property
    def _rest(self) -> Array:
        """Configuration of the robot with all joints where they stay if they have no spline."""
        return rest_configuration(self.robot, self.aside)

    @cached_property
    def _pushed_rest(self) -> list[float]:
        """Values at rest of the joints that the impact pushes."""
        rest = self.robot.joint_values(self._rest)
        return [rest[name] for name in self.pushed]

    @cached_property
    def _indices(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Indices of `joints` and of those that the impact pushes, in q and in v of the robot."""
        model, names = self.robot.workspace.model, (*self.joints, *self.pushed)
        return coordinate_indices(model, [int(model.getJointId(name)) for name in names])

    @cached_property
    def _model(self) -> tuple[Any, Any]:
        """The model with gravity, which the workspace of a leg is without, and its data."""
        return self.robot.model, self.robot.model.createData()

    @cached_property
    def _floats(self) -> bool:
        return is_floating(self.robot)

    @cached_property
    def _support_frame(self) -> int:
        return frame_id(self.robot.workspace.model, self.robot.supports[0].frame)
