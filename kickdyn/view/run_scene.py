"""A kick as a simulator carried it out, beside the planned one."""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import pinocchio as pin

from kickdyn.ball import BallState
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.view import marks
from kickdyn.view.camera import UP_AXIS
from kickdyn.view.document import draw_label
from kickdyn.view.leg_figure import draw_leg, joint_poses

CURVE = 0xF28C00
"""Colour of the flight of a simulated ball."""

CURVE_POINTS = 150
"""Points of its curve."""

SEPARATION = 1.2
"""Distance of the two robots over the width of one, across the kick."""


@runtime_checkable
class SimulatedRun(Protocol):
    """A planned motion that a simulator carried out, as `MujocoRun` describes it."""

    @property
    def plan(self) -> KickPlan:
        """The plan."""

    @property
    def t(self) -> Array:
        """Times, shape `(k,)` [s, planned impact at 0]."""

    @property
    def q(self) -> Array:
        """Configurations of the robot, shape `(k, nq)`."""

    @property
    def ball_position(self) -> Array:
        """Centre of the ball, shape `(k, 3)` [m, world frame]."""

    @property
    def ball_after(self) -> BallState:
        """The ball when it has left the foot."""

    @property
    def path(self) -> Flight | Course | None:
        """Path of the ball from then on; None if the foot misses it."""

    @property
    def summary(self) -> str:
        """What came of the kick, as a sentence."""


class DrawnRun(NamedTuple):
    """A simulated robot and its ball under a node of the viewer.

    Attributes:
        node: name of the node.
        run: that is drawn.
        offset: of the node, shape `(3,)` [m].
        corners: of boxes around the robot's shapes, shape `(n, 3)` [m, world frame].
        curve: points of the ball's path, shape `(n, 3)` [m, world frame]; none for a missed ball.
    """

    node: str
    run: SimulatedRun
    offset: Array
    corners: Array
    curve: Array

    def configuration(self, time: float) -> Array:
        """Return q of the robot at a time [s], shape `(nq,)`; before and after the run it rests."""
        times = self.run.t
        return np.asarray(self.run.q[np.clip(np.searchsorted(times, time), 0, len(times) - 1)])

    def ball_pose(self, time: float) -> Array:
        """Return the ball's pose at a time [s], shape `(4, 4)` [m, world frame]."""
        run, released = self.run, float(self.run.ball_after.time)
        if run.path is None or time < released:
            columns = run.ball_position.T
            position = np.array([np.interp(time, run.t, column) for column in columns])
        else:
            position = run.path.sample(min(time - released, run.path.duration)).position
        return np.asarray(pin.SE3(np.eye(3), position).homogeneous)


def draw_run(viewer: Any, run: SimulatedRun, forward: Array, planned: Array) -> DrawnRun:
    """Draw robot and ball of a run to the right of the planned robot, and both of their names.

    Args:
        viewer: of the scene.
        run: the run.
        forward: horizontal direction of the kick, shape `(3,)`.
        planned: corners of boxes around the planned robot, shape `(n, 3)` [m].
    """
    right, impact = np.cross(forward, UP_AXIS), run.plan.impact
    offset = max(SEPARATION * float(np.ptp(planned @ right)), 8 * impact.ball.radius) * right
    node, leg = viewer["run"], impact.posture.leg
    node.set_transform(pin.SE3(np.eye(3), offset).homogeneous)
    corners = draw_leg(node["leg"], leg, run.q[0])
    marks.draw_ball(node["ball"], impact.ball.radius, run.ball_position[0])
    for parent, name, boxes, colour in (
        (node, "simulated", corners, CURVE),
        (viewer["planned"], "planned", planned, marks.CURVE),
    ):
        height = boxes[:, 2].max() + 0.08 * np.ptp(boxes[:, 2])
        draw_label(
            parent["name"], name, np.array([*boxes[:, :2].mean(axis=0), height]), f"#{colour:06x}"
        )
    curve = np.zeros((0, 3))
    if run.path is not None:
        curve = run.path.sample(np.linspace(0.0, run.path.duration, CURVE_POINTS)).position
    return DrawnRun("run", run, offset, corners + offset, curve + offset)


def draw_run_curve(viewer: Any, drawn: DrawnRun, width: Array, right: Array) -> None:
    """Draw the path of the simulated ball, with half widths of its points, `(n,)` [m]."""
    if len(drawn.curve):
        curve = drawn.curve - drawn.offset
        marks.draw_curve(viewer[drawn.node]["curve"], curve, width, right, CURVE)


def move_run(drawn: DrawnRun, frame: Any, time: float) -> None:
    """Put a drawn run where it is at a time [s], in a frame of an animation."""
    frame[f"{drawn.node}/ball"].set_transform(drawn.ball_pose(time))
    poses = joint_poses(drawn.run.plan.impact.posture.leg, drawn.configuration(time))
    for joint, pose in list(enumerate(poses))[1:]:
        frame[f"{drawn.node}/leg/{joint}"].set_transform(pose)
