"""One kick, drawn and moving: leg, ball, flight, ground, and impulses as arrows to one scale."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import pinocchio as pin
from meshcat.animation import Animation

from kickdyn.ball import BallState
from kickdyn.core.validation import Array
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.motion.motion import Motion
from kickdyn.planning.meeting import Arrival
from kickdyn.robot.ground_clearance import find_depths, shape_of
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.standing import hold_support
from kickdyn.view import marks
from kickdyn.view.document import draw_label
from kickdyn.view.leg_figure import (
    CURVE_POINTS,
    BallPath,
    DrawnRun,
    SimulatedRun,
    curve_of,
    draw_leg,
    draw_run,
    joint_poses,
    move_leg,
)
from kickdyn.view.wall_and_goal import Box, draw_box

LEAST_TEE_HEIGHT = 5e-3
"""Height above the ground from which on a resting ball is drawn on a tee [m]."""

JOINT_ARROW = 0xF28C00
"""Colour of the arrows of joint impulses."""

LEAST_JOINT_IMPULSE = 0.05
"""Least impulse of a joint that gets an arrow, over the largest impulse of the kick."""

LABELLED_JOINTS = 3
"""Number of joints, those with the largest impulses, whose arrows have a label at all times."""

RATE = 60
"""Pictures per second; what spins faster than half a turn in one cannot be shown anyway."""

FOLLOW_TIME, FLIGHT_TIME, REST_TIME = 0.7, 2.1, 0.8
"""How long an animation shows the follow-through, in the strike's pace; the flight; the end [s]."""

SWING_LENGTH = 0.6
"""How far the fastest joint swings, before and after the impact each [rad; m if prismatic]."""


class Arrow(NamedTuple):
    """An impulse that is drawn: its node in the viewer, `(3,)` [m] and [N s], and 0xRRGGBB.

    `name` is plain text: the joint that transmits it, or `ball`; `joint` is the number of the
    joint in the model, and 0 for the ball.
    """

    node: str
    start: Array
    impulse: Array
    colour: int
    name: str
    joint: int = 0

    @property
    def size(self) -> float:
        """Norm of the impulse [N s]."""
        return float(np.linalg.norm(self.impulse))


class Pace(NamedTuple):
    """Which time of the kick each picture shows.

    `times` belong to the pictures, 0 at the impact, shape `(n,)` [s], and `impact` is the index
    of the picture of the impact. Leg and ball rest from the last of `times` to the picture `end`.
    """

    times: Array
    impact: int
    end: int

    @property
    def knots(self) -> Array:
        """Times of the animation and of the kick at them, linear in between, shape `(4, 2)` [s]."""
        last = len(self.times) - 1
        follow = min(self.impact + round(FOLLOW_TIME * RATE), last)
        numbers = np.unique([0, self.impact, follow, last])
        return np.column_stack([numbers / RATE, self.times[numbers]])


def draw_kick(
    viewer: Any,
    impact: Impact,
    path: BallPath,
    scenery: Sequence[Box] = (),
    motion: Motion | None = None,
    *,
    arrival: Arrival | None = None,
    lies: bool = True,
    run: SimulatedRun | None = None,
) -> tuple[Pace, str]:
    """Draw a kick, from the swing to the landing, over and over; return its pace and a sentence.

    Without a motion through this impact, the joints move as `leg_configuration` says. The
    `arrival` is the ball's path before the impact; a simulated `run` is drawn at the right.
    Where the ball need not lie on the ground (`lies`), the ground is where a robot stands, or
    as low as ball and leg come: the sentence is about that.
    """
    leg, ball, before = impact.posture.leg, impact.ball, impact.ball_before
    duration = path.duration
    if run is not None and run.path is not None:
        duration = max(duration, float(run.ball_after.time) + run.path.duration)
    pace = kick_pace(impact, duration, None if motion is None else -motion.begin)
    configuration = partial(leg_configuration, impact) if motion is None else motion.q
    postures = [configuration(time) for time in pace.times]
    curve = curve_of(path)
    incoming = np.zeros((0, 3))
    if arrival is not None:
        incoming = arrival.sample(np.linspace(-arrival.wait, 0.0, CURVE_POINTS)).position
    forward = marks.level_direction(curve[-1] - curve[0])
    right = np.cross(forward, marks.UP_AXIS)
    bottom = float(min(before.position[2], curve[-1, 2])) - ball.radius
    floor = bottom if lies else _ground_height(impact, postures, bottom)
    foot = np.array([*before.position[:2], floor])

    foreground = corners_around(impact)
    size, most = float(np.linalg.norm(np.ptp(foreground, axis=0))), largest_impulse(impact)
    scale = max(3.2 * ball.radius, 0.45 * size) / most if most > 0 else 0.0
    arrows = impulse_arrows(impact, LEAST_JOINT_IMPULSE * most)
    # The world's axes stand at the right of the flight, behind the ball.
    axis = marks.stripe_width(1.8 * size)
    origin = foot + axis * (2.8 * right - 1.8 * forward)
    figure = draw_leg(viewer["leg"], leg, impact.posture.q)
    far = [
        figure,
        *(arrow.start + scale * arrow.impulse[None] for arrow in arrows),
        origin + axis * np.vstack([np.zeros(3), np.eye(3)]),
        marks.box_corners(np.vstack([curve, incoming]), ball.radius),
        foot[None],
        *(box.corners() for box in scenery),
    ]
    if motion is not None:
        passed = [pose[:3, 3] for q in postures[::8] for pose in joint_poses(leg, q)[1:]]
        passed += [leg.posture(q).contact_point for q in postures[::8]]
        far.append(marks.box_corners(np.array(passed), ball.radius))
    drawn = None
    if run is not None:
        drawn = draw_run(viewer, run, forward, figure)
        foreground = np.vstack([foreground, figure, drawn.corners])
        far += [drawn.corners, drawn.curve]
    points = np.vstack(far)
    camera = marks.camera_for(foreground, points, forward, behind=bool(scenery) or run is not None)
    marks.set_stage(viewer, camera, np.vstack([foreground, points]))

    marks.draw_ball(viewer["ball"], ball.radius, before.position)
    text = _draw_tee(viewer, impact, foot, lies=lies)
    width = camera.curve_width
    marks.draw_curve(viewer["curve"], curve, width(curve), right)
    if drawn is not None:
        drawn.draw_curve(viewer, width(drawn.curve), right)
    if arrival is not None:
        _draw_arrival(viewer, incoming, width(incoming), arrival.wait)
    draw_impulses(viewer, arrows, scale)
    for number, box in enumerate(scenery):
        draw_box(viewer[f"scenery/{number}"], box)
    length = float(np.hypot(*(curve[-1] - foot)[:2]))
    stripe = marks.stripe_width(length + size)
    reach = float(np.linalg.norm(curve[-1] - foot)) + 8 * size
    marks.draw_ground(viewer["ground"], foot, forward, stripe, reach)
    marks.draw_axes(viewer["axes"], origin, axis)
    marks.draw_distances(viewer["distances"], foot, forward, stripe, length)
    label_end(viewer, path, curve)
    balls = ball_poses(before, path, pace.times, arrival)
    animation = _animation(viewer, balls, impact, pace, postures, arrows, drawn)
    viewer.set_animation(animation, repetitions=math.inf)
    return pace, text


def _draw_arrival(viewer: Any, curve: Array, width: Any, wait: float) -> None:
    sideways = np.cross(marks.level_direction(curve[-1] - curve[0]), marks.UP_AXIS)
    marks.draw_curve(viewer["arrival"], curve, width, sideways, marks.ARRIVAL)
    draw_label(viewer["meeting"], f"met after {wait:.3g} s", curve[-1], f"#{marks.ARRIVAL:06x}")


def corners_around(impact: Impact) -> Array:
    """Return corners of boxes around joints and ball, shape `(n, 3)` [m, world frame]."""
    posture = impact.posture
    joints = np.array([pose[:3, 3] for pose in joint_poses(posture.leg, posture.q)[1:]])
    return marks.box_corners(np.vstack([joints, impact.ball_after.position]), impact.ball.radius)


def largest_impulse(impact: Impact) -> float:
    """Return the largest impulse that has an arrow, of the ball or of a joint [N s]."""
    return max(float(np.linalg.norm(impact.impulse)), impact.worst_joint[1])


def label_end(viewer: Any, path: BallPath, curve: Array) -> None:
    """Label the end of a path with its distance."""
    distance = path.distance if isinstance(path, Course) else path.range
    draw_label(viewer["end"], f"{distance:.3g} m", curve[-1], f"#{marks.CURVE:06x}")


def _draw_tee(viewer: Any, impact: Impact, foot: Array, *, lies: bool) -> str:
    """Draw a tee under a ball that rests above the ground; return a sentence about the ground."""
    before, radius = impact.ball_before, impact.ball.radius
    lift = float(before.position[2]) - radius - float(foot[2])
    if lift > LEAST_TEE_HEIGHT and not lies and not before.velocity.any():
        stand = shapes.Cylinder(lift, radiusTop=0.45 * radius, radiusBottom=0.3 * radius)
        viewer["tee"].set_object(stand, shapes.MeshLambertMaterial(color=0xF2C230))
        middle = tf.translation_matrix(foot + lift / 2 * marks.UP_AXIS)
        viewer["tee"].set_transform(middle @ marks.UPRIGHT)
        return f"The ball is on a tee, {lift:.2g} m above the ground."
    if lift < -LEAST_TEE_HEIGHT:
        return f"The ball is {-lift:.2g} m in the ground on which the robot stands."
    return ""


def joint_impulses_in_world(impact: Impact) -> list[tuple[str, Array, Array]]:
    """Return name, origin [m] and impulse [N s] of each joint, by parent on child, world frame."""
    leg = impact.posture.leg
    poses = joint_poses(leg, impact.posture.q)[1:]
    return [
        (name, pose[:3, 3], pose[:3, :3] @ impulse[:3])
        for name, pose, impulse in zip(leg.joint_names, poses, impact.joint_impulses, strict=True)
    ]


def impulse_arrows(impact: Impact, least: float) -> list[Arrow]:
    """Return the ball's arrow, then the arrows of joints above `least` [N s], largest first."""
    ball = Arrow("arrow", impact.posture.contact_point, impact.impulse, marks.ARROW, "ball")
    joints = [
        Arrow(f"joint_arrows/{number}", start, impulse, JOINT_ARROW, name, number)
        for number, (name, start, impulse) in enumerate(joint_impulses_in_world(impact), start=1)
    ]
    joints = [arrow for arrow in joints if arrow.size > least]
    joints.sort(key=lambda arrow: -round(arrow.size, 9))
    return [ball, *joints] if ball.size > 0.0 else joints


def draw_impulses(viewer: Any, arrows: Sequence[Arrow], scale: float) -> None:
    """Draw impulses as `impulse_arrows` returns them, to a scale [m/(N s)].

    The ball's and the largest of the joints are labelled, the others under the pointer.
    """
    shown = sum(arrow.colour == marks.ARROW for arrow in arrows) + LABELLED_JOINTS
    for number, arrow in enumerate(arrows):
        node, tip, is_shown = viewer[arrow.node], scale * arrow.impulse, number < shown
        marks.draw_arrow(node, tip, arrow.colour)
        node.set_transform(tf.translation_matrix(arrow.start))
        text = f"{arrow.size:.3g} N s" if is_shown else f"{arrow.name} {arrow.size:.3g} N s"
        colour = f"#{arrow.colour:06x}"
        draw_label(node["label"], text, tip, colour, under_pointer=not is_shown)


def kick_pace(impact: Impact, duration: float, backswing: float | None = None) -> Pace:
    """Return the pace that shows strike and flight, of this duration [s], in about four seconds.

    A hard strike takes a hundredth of the flight's time, so it is shown slower; where the flight
    is no longer than the strike, both have one pace. A planned motion takes `backswing` [s] from
    rest to the impact.
    """
    before = 1.2 if backswing is None else 3.0  # shown before the impact [s]
    strike = math.inf if backswing is None else backswing / before
    if backswing is None:
        fastest = float(max(np.abs(impact.v_before).max(), np.abs(impact.v_after).max()))
        if fastest > 0.0:
            strike = SWING_LENGTH / fastest / before
        if duration > 0.0:
            strike = min(strike, duration / (FOLLOW_TIME + FLIGHT_TIME))
    strike = strike if math.isfinite(strike) else 1.0
    after = max(duration, strike * (FOLLOW_TIME + FLIGHT_TIME))
    flight = (after - strike * FOLLOW_TIME) / FLIGHT_TIME
    moments = np.arange(round((before + FOLLOW_TIME + FLIGHT_TIME) * RATE) + 1) / RATE - before
    times = strike * moments + (flight - strike) * np.maximum(moments - FOLLOW_TIME, 0.0)
    end = len(times) - 1 + round(REST_TIME * RATE)
    return Pace(times, round(before * RATE), end)


def leg_configuration(impact: Impact, time: float) -> Array:
    """Return q at a time from the impact [s]: swinging, then coming to rest, on its support."""
    leg, q = impact.posture.leg, impact.posture.q
    model = leg.workspace.model
    fastest = float(np.abs(impact.v_after).max())
    if time > 0 and fastest > 0:
        stop = SWING_LENGTH / fastest
        displaced = pin.integrate(model, q, -stop * math.expm1(-time / stop) * impact.v_after)
    else:
        displaced = pin.integrate(model, q, min(time, 0.0) * impact.v_before)
    # Only a joint of one number has a range; and a posture outside it must not jump back.
    single = np.zeros(model.nq, dtype=bool)
    for joint in model.joints[1:]:
        single[joint.idx_q] = joint.nq == 1
    within = np.clip(displaced, np.fmin(leg.lower, q), np.fmax(leg.upper, q))
    return hold_support(impact.posture, np.where(single, within, displaced))


def ball_poses(
    before: BallState, path: BallPath, times: Array, arrival: Arrival | None = None
) -> Array:
    """Return the ball's poses at times from the impact [s], shape `(n, 4, 4)` [m, world frame].

    Without its path before the impact, the `arrival`, it then moves straight on.
    """
    from scipy.spatial.transform import Rotation  # takes 0.1 s

    is_early = times < 0.0
    early, late = times[is_early], np.minimum(times[~is_early], path.duration)
    poses = np.tile(np.eye(4), (len(times), 1, 1))
    straight = before.position + np.outer(early, before.velocity)
    poses[is_early, :3, 3] = straight if arrival is None else arrival.sample(early).position
    poses[~is_early, :3, 3] = path.sample(late).position
    poses[is_early, :3, :3] = Rotation.from_rotvec(np.outer(early, before.spin)).as_matrix()
    if isinstance(path, Course):  # as if the ball turned about one axis
        nodes = np.outer(late, np.linspace(0.0, 1.0, 65))
        spin = path.sample(nodes.ravel()).spin.reshape(*nodes.shape, 3)
        rotation = Rotation.from_rotvec(np.trapezoid(spin, nodes[..., None], axis=1))
    else:
        rotation = path.orientation(late)
    poses[~is_early, :3, :3] = rotation.as_matrix()
    return poses


def _ground_height(impact: Impact, moved: Sequence[Array], bottom: float) -> float:
    """Return the height of the ground [m]: of the support, else of the lowest point."""
    posture = impact.posture
    leg = posture.leg
    if leg.constraints is not None and leg.constraints.supports:
        name = leg.constraints.supports[0].frame
        model, data = leg.workspace.model, leg.workspace.data
        pin.forwardKinematics(model, data, posture.q)
        placement = pin.updateFramePlacement(model, data, frame_id(model, name))
        return float(shape_of(leg, name).moved(placement.homogeneous).lowest)
    depths = [depth for q in moved for depth in find_depths(leg, q, bottom).values()]
    return bottom - max(depths, default=0.0)


def _animation(
    viewer: Any,
    balls: Array,
    impact: Impact,
    pace: Pace,
    moved: Sequence[Array],
    arrows: Sequence[Arrow],
    run: DrawnRun | None,
) -> Animation:
    """Return the motion of leg, ball and arrows, which appear at the impact with their joints."""
    animation = Animation(default_framerate=RATE)
    # All tracks end together, so that they stay together when they repeat.
    numbers, times = [*range(len(moved)), pace.end], [*pace.times, pace.times[-1]]
    poses_of_ball, configurations = [*balls, balls[-1]], [*moved, moved[-1]]
    for number, time, ball, q in zip(numbers, times, poses_of_ball, configurations, strict=True):
        with animation.at_frame(viewer, number) as frame:
            frame["ball"].set_transform(ball)
            poses = move_leg(frame, "leg", impact.posture.leg, q)
            for arrow in arrows:
                if arrow.joint:
                    start = poses[arrow.joint][:3, 3].tolist()
                    frame[arrow.node].set_property("position", "vector3", start)
            if run is not None:
                run.move(frame, float(time))
    hit = pace.impact
    for number, scale in ((0, 1e-3), (hit - 1, 1e-3), (hit, 1.0), (pace.end, 1.0)):
        with animation.at_frame(viewer, number) as frame:
            for arrow in arrows:
                frame[arrow.node].set_property("scale", "vector3", [scale] * 3)
    return animation
