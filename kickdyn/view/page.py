"""`page`: a kick, several kicks or flights, as a 3-D page that opens in any browser."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple
from html import escape
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from meshcat.animation import Animation

from kickdyn.air import Air
from kickdyn.core import validation
from kickdyn.core.files import FileName, checked_ending, replacing
from kickdyn.core.representation import Row, distance_in_words
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import Course
from kickdyn.identification.identification_result import Identification
from kickdyn.impact.impact_result import Impact
from kickdyn.motion.check_motion import MotionCheck
from kickdyn.motion.motion import Motion
from kickdyn.motion.motion_record import RecordedMotion
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.launch import Launch
from kickdyn.planning.meeting import Arrival, arrival_of
from kickdyn.planning.passes import Pass
from kickdyn.robot.leg import Leg, Posture
from kickdyn.scene.scene import Scene
from kickdyn.scene.simulate import Simulation, simulate_as_instant
from kickdyn.view import marks
from kickdyn.view.caption import draw_flights, html_rows, kick_panel, panel_of
from kickdyn.view.document import DrawnScene, html_document, recording_viewer, save_picture, to_glb
from kickdyn.view.kick_scene import RATE, Pace, draw_kick
from kickdyn.view.leg_figure import BallPath, SimulatedRun, draw_leg, joint_poses, move_leg
from kickdyn.view.wall_and_goal import Box, plane_boxes, wall_boxes

FRAME_HEIGHT = 600
"""Height of a page in a notebook [px]."""

_Comparable = Impact | Flight | Course | Launch | Pass | Identification
_MovingSubject = Impact | KickPlan | Scene | Simulation | SimulatedRun
_LegAlone = Leg | Posture | Motion | RecordedMotion | MotionCheck


class Page:
    """A 3-D page, as `page` returns it; in Jupyter it is shown as the result of its cell.

    In a notebook it runs in a frame that can reach neither the notebook nor the network.

    Attributes:
        viewer: the `meshcat.Visualizer` into which the scene is drawn.
        title: of the page, plain text.
        panel: HTML laid over the scene.
        pace: of the animation; None if nothing moves.
        warnings: a line for each robot with visuals that are not drawn, because a mesh is missing,
            say; the panel shows them too.
        pages: this page and others by the names of buttons, which show them; empty for one page.
    """

    def __init__(self, viewer: Any, title: str, panel: str, pace: Pace | None = None) -> None:
        self.viewer, self.title, self.panel, self.pace = viewer, title, panel, pace
        self.warnings: tuple[str, ...] = tuple(viewer.window.warnings)
        self.pages: dict[str, Page] = {}

    @property
    def html(self) -> str:
        """The page as one file that needs no network."""
        return html_document(self.title, self.scenes, list(self.pages))

    @property
    def scenes(self) -> list[DrawnScene]:
        """What it shows, one for each of its buttons."""
        return [
            (page.viewer.window, page.panel, page.pace and page.pace.knots)
            for page in self.pages.values() or [self]
        ]

    def save(self, file: FileName, at: float = 0.0) -> None:
        """Write the page, a picture of it (`.png`), or its scene as binary glTF (`.glb`).

        A glTF file is for slides, Blender and viewers of 3-D models. It has the meshes of the first
        scene in metres, y up as glTF has it, without labels, and its animation, which is as slow as
        on the page.

        Args:
            file: it is replaced as a whole, or not at all.
            at: time since the impact that a picture of a kick shows [s]; otherwise 0.

        Raises:
            InvalidInput: another ending, a file that cannot be written, no Chromium for a picture,
                or a time that is not shown.
            KickdynError: Chromium failed.
        """
        validation.check_type(str, PathLike, file=file)
        ending = checked_ending(file, (".html", ".htm", ".png", ".glb"), "a page is written as")
        is_picture = ending == ".png"
        last = float(self.pace.times[-1]) if is_picture and self.pace else 0.0
        at = validation.number("at", at, at_least=0, at_most=last, unit="s")
        if is_picture:
            save_picture(self.html, file, at)
            return
        content = to_glb(self.viewer.window) if ending == ".glb" else self.html.encode()
        with replacing(file) as draft:
            draft.write_bytes(content)

    def __repr__(self) -> str:
        """Return the title, for where HTML cannot be shown."""
        return f"<Page {self.title!r}: save it as .html, .png or .glb>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self.html)}" sandbox="allow-scripts" '
            f'style="width: 100%; height: {FRAME_HEIGHT}px; border: 0"></iframe>'
        )


@validation.check_arguments
def page(
    subject: (
        _MovingSubject | _LegAlone | _Comparable | Iterable[_Comparable] | Mapping[str, _Comparable]
    ),
    path: BallPath | None = None,
    *,
    caption: str = "",
    scenery: Sequence[Box] = (),
) -> Page:
    """Return a 3-D page of a kick, or of several impacts or flights to compare.

    A kick moves: an `Impact` with the ball's path, a `KickPlan` (with its `motion` if it has
    one), a `MujocoRun` beside its plan, a `Scene` or the `Simulation` of one. A scene is shown with
    its wall or goal, and its contact as instantaneous. A `Leg` (with all joints at 0), a `Posture`
    and a `Motion`, or one of `read_motion`, are shown without a ball, a `MotionCheck` with the
    ball of its best frame.
    A `Flight`, `Course`, `Launch` or `Pass`, and up to 8 of them, are curves over one lawn; the
    flight of an `Identification` is a curve with the measured positions as dots. Of several
    impacts, buttons choose the one that is shown.

    A robot is drawn with the visuals of its file, bodies without any as sticks from joint to joint.
    A visual that cannot be drawn, as one whose mesh is missing or lies outside the robot's package,
    is left out, and a line of `Page.warnings` names it.

    The ball of a plan, a scene or a course lies on the ground, or flies above it. A single impact
    does not say where the ground is: it is drawn where the robot stands, or as low as ball and leg
    come, and the ball is on a tee.

    Args:
        subject: one of these; or several flights or impacts, in a list or by their names.
        path: path of the ball after an `Impact`; with None the ball flies through `Air()`.
        caption: line of plain text above the numbers.
        scenery: boxes that are shown beside a kick, as `wall_boxes` and `goal_boxes` return them.

    Raises:
        InvalidInput: there is nothing of that to show, or too much.
    """
    for box in scenery:
        validation.check_type(Box, scenery=box)
    if path is not None and not isinstance(subject, Impact):
        raise InvalidInput(f"path is given with a {type(subject).__name__}: it is for an Impact")
    if isinstance(subject, _LegAlone):
        viewer = recording_viewer()
        if isinstance(subject, Motion | RecordedMotion | MotionCheck):
            motion = subject.motion if isinstance(subject, MotionCheck) else subject
            robot = motion.robot if isinstance(motion, Motion) else motion.leg
            panel, pace = draw_motion(viewer, subject, caption)
            return Page(viewer, f"{robot.name or 'leg'}: motion", panel, pace)
        posture = (
            subject if isinstance(subject, Posture) else subject.posture(subject.configuration())
        )
        return Page(viewer, posture.leg.name or "leg", draw_posture(viewer, posture, caption))
    if not isinstance(subject, _MovingSubject):
        return _comparison(subject, caption)
    kick = _kick_of(subject, path, caption)
    impact, viewer = kick.impact, recording_viewer()
    boxes = [*scenery, *kick.scenery]
    run = subject if isinstance(subject, SimulatedRun) else None
    pace, ground = draw_kick(
        viewer, impact, kick.path, boxes, kick.motion, arrival=kick.arrival, lies=kick.lies, run=run
    )
    text = kick.caption
    if ground:
        text = ". ".join(filter(None, [text.removesuffix("."), ground]))
    brief = [line.partition("; ")[0] for line in kick.warnings]
    warnings = list(dict.fromkeys([*viewer.window.warnings, *brief]))
    panel = kick_panel(impact, kick.path, text, warnings, kick.rows)
    name = impact.posture.leg.name or "leg"
    title = f"{name}: ball at {float(impact.ball_after.speed):.4g} m/s"
    return Page(viewer, title, panel, pace)


class _Kick(NamedTuple):
    """What a page shows of a kick; `lies` if its ball is on no tee; `rows` are further ones."""

    impact: Impact
    path: BallPath
    caption: str
    motion: Motion | None = None
    scenery: Sequence[Box] = ()
    warnings: Sequence[str] = ()
    lies: bool = True
    arrival: Arrival | None = None
    rows: Sequence[Row] = ()


def _kick_of(subject: _MovingSubject, path: BallPath | None, caption: str) -> _Kick:
    match subject:
        case Impact():
            flown = fly(subject.ball_after, subject.ball, Air()) if path is None else path
            warnings = [*subject.warnings, *flown.warnings]
            return _Kick(subject, flown, caption, warnings=warnings, lies=isinstance(path, Course))
        case KickPlan():
            impact, meeting, moved = subject.impact, subject.meeting, subject.sensitivity_to_ball
            arrival = None if meeting is None else arrival_of(meeting, impact.ball)
            return _Kick(
                impact, subject.path, caption, subject.motion, warnings=subject.warnings,
                arrival=arrival, rows=moved.rows if moved else (),
            )  # fmt: skip
        case Simulation():
            return _kick_of_simulation(subject, caption)
        case SimulatedRun():
            plan = subject.plan
            text = ". ".join(filter(None, [caption, subject.summary]))
            return _Kick(plan.impact, plan.path, text, plan.motion, warnings=plan.warnings)
        case Scene():
            return _kick_of_simulation(simulate_as_instant(subject), caption)


def _kick_of_simulation(simulation: Simulation, caption: str) -> _Kick:
    impact, path, scene = simulation.impact, simulation.path, simulation.scene
    if not isinstance(impact, Impact):
        raise InvalidInput(
            "the impact of this Simulation has a contact of finite time, which a page cannot show: "
            "show its Scene instead"
        )
    caption = caption or scene.name[:1].upper() + scene.name[1:]
    if simulation.neglected:
        error = simulation.model_error
        distance = distance_in_words(error) if math.isfinite(error) else "an unknown distance"
        caption += f", contact shown as instantaneous; this moves the end of the path by {distance}"
    text = ". ".join(filter(None, [caption, simulation.pitch_text]))
    kick = _Kick(impact, path, text, warnings=simulation.warnings)
    if scene.plane is None:
        return kick
    start, end = impact.ball_after.position, simulation.end.position
    boxes = plane_boxes(scene.plane, end, min(start[2], end[2]) - scene.ball.radius)
    if scene.wall is not None:
        foot = start - np.array([0.0, 0.0, simulation.start_height + scene.ball.radius])
        boxes += wall_boxes(foot, scene.ahead, *astuple(scene.wall))
    ahead = (np.mean([box.centre for box in boxes], axis=0) - start)[:2]
    length = (end - start)[:2]
    # A plane that the ball does not reach is drawn up to ten times the length of the path ahead.
    is_near = 0.0 < float(ahead @ length) < 10.0 * float(length @ length)
    if is_near or simulation.status == "at-plane":
        return kick._replace(scenery=boxes)
    return kick._replace(caption=f"{kick.caption}, its plane out of the picture")


def page_of_pages(pages: Mapping[str, Page]) -> Page:
    """Return the first of some pages, with buttons for each of them by its name."""
    initial = next(iter(pages.values()))
    shown = Page(initial.viewer, initial.title, initial.panel, initial.pace)
    shown.pages = dict(pages)
    shown.warnings = tuple(dict.fromkeys(line for page in pages.values() for line in page.warnings))
    return shown


def _comparison(
    subject: _Comparable | Iterable[_Comparable] | Mapping[str, _Comparable],
    caption: str,
) -> Page:
    if isinstance(subject, Flight | Course | Launch | Pass | Identification):
        subject = {type(subject).__name__.lower(): subject}
    elif not isinstance(subject, Mapping):
        if not isinstance(subject, Iterable) or isinstance(subject, str):
            raise InvalidInput(f"a page cannot show a {type(subject).__name__}")
        subject = {str(number): item for number, item in enumerate(subject, start=1)}
    measured, impacts, paths = dict[str, Array](), dict[str, Impact](), dict[str, BallPath]()
    for name, item in subject.items():
        match item:
            case Impact():
                impacts[name] = item
            case Launch(flight=path) | Pass(course=path):
                paths[name] = path
            case Identification():
                paths[name], measured[name] = item.flight, item.track.positions
            case Flight() | Course():
                paths[name] = item
            case _:
                raise InvalidInput(f"a page cannot show a {type(item).__name__}")
    if impacts and paths:
        raise InvalidInput("a page compares flights or impacts, not both")
    if impacts:
        return page_of_pages({name: page(hit, caption=caption) for name, hit in impacts.items()})
    name = ("Fitted flight" if measured else "Flight") + "s" * (len(paths) > 1)
    viewer, title = recording_viewer(), caption or name
    return Page(viewer, title, draw_flights(viewer, paths, title, measured))


MOTION_TIME, MOST_JOINTS = 5.0, 12
"""How long a motion is shown [s], and number of joints up to which those at 0 are named too."""


def draw_posture(viewer: Any, posture: Posture, text: str) -> str:
    """Draw a leg at a posture, and return its numbers as HTML."""
    leg = posture.leg
    _draw(viewer, leg, [posture.q])
    values = leg.display_values(posture.q)
    rows = [
        (escape(name), f"{value:.4g} m" if unit == "m" else f"{value:.4g}°")
        for name, (value, unit) in values.items()
        if value or len(values) <= MOST_JOINTS
    ]
    x, y, z = posture.contact_point.tolist()
    rows.append((escape(leg.frame), f"{x:.3f}, {y:.3f}, {z:.3f} m"))
    return panel_of(leg.name or "leg", rows, text, warnings=posture.warnings)


def draw_motion(
    viewer: Any, subject: Motion | RecordedMotion | MotionCheck, text: str
) -> tuple[str, Pace]:
    """Draw a robot in its motion, as fast as recorded; return its numbers as HTML, and the pace."""
    check = subject if isinstance(subject, MotionCheck) else None
    motion = subject.motion if isinstance(subject, MotionCheck) else subject
    is_recorded, warnings = isinstance(motion, RecordedMotion), list(motion.warnings)
    begin, end = motion.begin, motion.end
    count = round(RATE * (end - begin if is_recorded else MOTION_TIME))
    times = np.linspace(begin, end, count + 1)
    if isinstance(motion, RecordedMotion):
        leg, hit = motion.leg, 0 if motion.contact is None else motion.contact
        postures = [motion.q[motion.frame_at(time)] for time in times.tolist()]
        rows = [("motion", f"{begin:.4g} to {end:.4g} s, {motion.rate:.4g} frames per second")]
        if check is not None:
            sentences, found = ("broken", "warning"), list(check._rows())
            rows += html_rows(
                (name.removesuffix(", time").removeprefix("best frame, "), value, unit)
                for name, value, unit in found
                if name not in sentences
            )
            warnings = [f"{name}: {line}" for name, line, _ in found if name in sentences]
            if check.best is not None:
                best = check.launches.isel(frame=check.best)
                hit = float(best.time)
                marks.draw_ball(viewer["ball"], check.ball.radius, best.ball_position.values)
    else:
        leg, hit = motion.robot, 0.0
        postures = [motion.q(time) for time in times.tolist()]
        rows = [
            (phase.name, f"{phase.begin:.4g} to {phase.end:.4g} s from the impact")
            for phase in motion.phases
        ]
    pace = Pace(times - hit, int(np.abs(times - hit).argmin()), count)
    _draw(viewer, leg, postures)
    animation = Animation(default_framerate=RATE)
    for number, q in enumerate(postures):
        with animation.at_frame(viewer, number) as frame:
            move_leg(frame, "leg", leg, q)
    viewer.set_animation(animation, repetitions=math.inf)
    return panel_of(leg.name or "leg", rows, text, warnings=warnings), pace


def _draw(viewer: Any, leg: Leg, configurations: Sequence[Array]) -> None:
    corners = draw_leg(viewer["leg"], leg, configurations[0])
    joints = np.vstack([
        [pose[:3, 3] for pose in joint_poses(leg, q)[1:]] for q in configurations[::8]
    ])  # fmt: skip
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    points = np.vstack([corners, marks.box_corners(joints, 0.05 * size)])
    forward = np.array([1.0, 0.0, 0.0])
    marks.set_stage(viewer, marks.camera_for(points, points, forward), points)
    lowest = min(leg.posture(q).contact_point[2] for q in configurations[::8])
    foot = np.array([*points.mean(axis=0)[:2], min(corners[:, 2].min(), lowest)])
    stripe = marks.stripe_width(size)
    marks.draw_ground(viewer["ground"], foot, forward, stripe, 6 * size)
    marks.draw_axes(viewer["axes"], foot + 0.5 * size * np.array([-1.0, -1.0, 0.0]), stripe)
