"""What a robot can do: the largest launch in each direction that is planned within all limits."""

import csv
import io
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.files import (
    FileName,
    attributes,
    check_writable,
    checked_ending,
    read_text,
    replacing,
)
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.plot_style import styled
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import ArrayLike
from kickdyn.errors import FaultyFile, InvalidInput
from kickdyn.flight.follow import follow
from kickdyn.ground import Ground
from kickdyn.planning.goal import Goal, PlanStatus
from kickdyn.planning.kick import plan_kick, replan_motion
from kickdyn.planning.kick_library import KickLibrary
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_reader import checksum, launch_velocity
from kickdyn.robot.leg import Leg

ELEVATIONS = (0.0, 10.0, 20.0, 30.0, 45.0)
"""Elevations of launches by default [deg]."""

FIRST_SPEED, LARGEST_SPEED, MOST_TRIES = 10.0, 80.0, 14
"""Launch speed that is tried first, the largest one [m/s], and number of plans of a direction."""

GROWTHS = {False: 2.0, True: 1.25}
"""Factor of the speed after a plan that is met, by whether motions are planned: a motion far beyond
the limits takes minutes to be given up."""

DESCRIBING_TIME = 0.1
"""Time of the short flight in a vacuum that describes a launch to the planner [s]."""

LARGEST_FILE = 10_000_000
"""Size of a table that is read [bytes]."""

SURFACES = ("carpet", "turf")
"""Surfaces for which distances are given; names of `kickdyn.ground.SURFACES`."""


Direction = tuple[float, float]
"""Azimuth and elevation of a launch [deg]."""


@dataclass(frozen=True)
class ReachRow:
    """The largest launch in a direction.

    Attributes:
        azimuth: direction to the left of x [deg].
        elevation: direction above the horizontal [deg].
        speed: largest launch speed of which the plan is `met` [m/s]; 0 where none is.
        beyond: least larger speed of which it is not [m/s]; None if all that were tried are.
        reason: why that one is not, or that no larger one is tried.
        carpet, turf: horizontal distance from the ball to where it comes to rest, on a level ground
            that it touches at its launch [m].
    """

    azimuth: float
    elevation: float
    speed: float
    beyond: float | None
    reason: str
    carpet: float
    turf: float


@dataclass(frozen=True, eq=False, repr=False)
class ReachTable(ReprMixin):
    """The largest launches of a robot, as `reach` returns them.

    Attributes:
        robot: its name.
        motion: whether the limits are those of the motion, or of the impact only.
        rows: by azimuth, then by elevation.
        warnings: lines about the ball.
    """

    robot: str
    motion: bool
    rows: tuple[ReachRow, ...]
    warnings: tuple[str, ...] = ()

    def _rows(self) -> Iterable[Row]:
        yield "robot", self.robot, ""
        limits = "of the motion" if self.motion else "of the impact alone: upper bounds"
        yield "limits", limits, ""
        for row in self.rows:
            text = f"{row.speed:.4g} m/s, {row.carpet:.3g} m on carpet, {row.turf:.3g} m on turf"
            text += f"; limit: {row.reason}" if row.reason else ""
            yield f"azimuth {row.azimuth:g}, elevation {row.elevation:g} deg", text, ""
        yield from warned(self.warnings)

    def to_json(self) -> dict[str, object]:
        """Return the numbers, for JSON."""
        return attributes(self, "robot motion rows warnings")

    @styled()
    def plot(self) -> Any:
        """Return a figure of matplotlib: speeds, and distances on carpet and turf, by elevation."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.5, 6.5))
        speeds, distances = figure.subplots(2, 1, sharex=True)
        for number, side in enumerate(dict.fromkeys(row.azimuth for row in self.rows)):
            rows = [row for row in self.rows if row.azimuth == side]
            rows.sort(key=lambda row: row.elevation)
            angles, colour = [row.elevation for row in rows], f"C{number}"
            largest, label = [row.speed for row in rows], f"azimuth {side:g} deg"
            speeds.plot(angles, largest, "o-", color=colour, label=label)
            for name, line in (("carpet", "o-"), ("turf", "s--")):
                lengths = [getattr(row, name) for row in rows]
                label = "" if number else name
                distances.plot(angles, lengths, line, color=colour, label=label)
        speeds.set(ylabel="largest launch speed [m/s]")
        distances.set(xlabel="elevation [deg]", ylabel="distance until the ball rests [m]")
        for axes in (speeds, distances):
            axes.set_ylim(bottom=0.0)
            axes.legend()
        limits = "within the limits of the motion" if self.motion else "within those of the impact"
        figure.suptitle(f"{self.robot}: {limits}".replace("$", r"\$"))
        return figure


@validation.check_arguments
def reach(
    robot: Leg | KickLibrary,
    ball: Ball,
    air: Air | None = None,
    *,
    azimuths: ArrayLike = (0.0,),
    elevations: ArrayLike = ELEVATIONS,
    contact: Contact | None = None,
    ball_position: ArrayLike | None = None,
    motion: bool = False,
    tolerance: float = 0.05,
    file: FileName | None = None,
    progress: Callable[[str], None] | None = None,
) -> ReachTable:
    """Find the largest launch of a robot in each direction, by plans that are `met`.

    In each direction, speeds are planned by `plan_kick` from 10 m/s on and doubled (with a motion,
    a quarter is added, near the last motion) until a plan is not `met`; then the largest one that
    is met is sought between the two, by the share of the launch that the planner reaches, and by
    bisection. It is a speed that was planned, not a proof that no larger one is possible: planners
    find the best plan near their starts.

    Without `motion`, the limits are those of the impact: speeds of the joints, torques that keep
    them, and balance. They do not ask how the foot gets this fast, so that the speeds are upper
    bounds of what the robot does, often far above. With it, they are those of the whole motion,
    which takes minutes for each direction of a robot.

    For a library of kicks, it is the largest one that the library has, by `strike`, at once.

    Args:
        robot: the leg or robot that kicks, as for `plan_kick`, or a library of its kicks.
        ball: the ball.
        air: in which it flies; None is the vacuum.
        azimuths: directions to the left of x, shape `(m,)` [deg].
        elevations: directions above the horizontal, from 0 to 80, shape `(n,)` [deg].
        contact: of foot and ball, as for `plan_kick`.
        ball_position: height or position of the ball, as for `plan_kick`; for a library, x and y as
            for its kicks.
        motion: whether limits are those of the whole motion.
        tolerance: relative distance of the speed from one that is not met, 0.001 to 0.5.
        file: a `.csv` file to which each row is written as soon as it is found. Rows that it has
            from an earlier call with the same settings are read from it.
        progress: called with a line of text before each direction and each plan.

    Raises:
        InvalidInput: as for `plan_kick`; a file of another robot or of other settings.

    Example:
        >>> import kickdyn as kd
        >>> table = kd.reach(kd.Leg.human(), kd.Ball(), kd.Air(), elevations=(10, 30))
        >>> [round(row.speed) for row in table.rows]
        [26, 26]
    """
    ball.check_movable("a launch")
    tolerance = validation.number("tolerance", tolerance, at_least=1e-3, at_most=0.5)
    sides, heights = _angles("azimuths", azimuths, 180.0), _angles("elevations", elevations, 80.0)
    validation.number("elevations", min(heights), at_least=0, unit="deg")
    if file is not None:
        checked_ending(file, (".csv",), "a table of launches is written as")
    library = robot if isinstance(robot, KickLibrary) else None
    leg = robot.robot if isinstance(robot, KickLibrary) else robot
    if library is not None:
        library.check_settings({}, ball, contact, None)
        ball_position, motion = library.place(ball_position), True
    options: Any = {"contact": contact, "ball_position": ball_position, "motion": motion}
    settings = {
        "robot": leg.name,
        "joints": list(leg.joint_names),
        "supports": [support.frame for support in leg.supports],
        "mass": round(sum(float(body.mass) for body in leg.model.inertias), 6),
        **({} if library is None else {"library": checksum(library.reader.arrays)}),
        "options": {name: repr(value) for name, value in options.items()},
        "ball": repr(ball),
        "air": repr(air),
        "tolerance": tolerance,
    }

    def plan(place: Direction, where: str, speed: float, near: KickPlan | None) -> KickPlan:
        if progress is not None:
            progress(f"{where}: {speed:.3g} m/s")
        velocity = launch_velocity(np.array([speed, *np.radians(place[::-1])]))
        if near is not None and near.motion is not None:
            return replan_motion(near, velocity)
        # the target in the vacuum to which this launch leads, however low it is
        fall = 0.5 * GRAVITY * DESCRIBING_TIME * DESCRIBING_TIME
        target = DESCRIBING_TIME * velocity - [0.0, 0.0, fall]
        return plan_kick(leg, Goal(target, time=DESCRIBING_TIME), ball, None, **options)

    rows: dict[Direction, ReachRow] = {}
    if file is not None:
        check_writable(file)
        rows = _read(file, settings)
    wanted = [(side, height) for side in sides for height in heights]
    for number, place in enumerate(wanted, start=1):
        if place in rows:
            continue
        where = f"{number} of {len(wanted)}, {place[0]:g} and {place[1]:g} deg"
        if library is not None:
            azimuth, elevation = np.radians(place).tolist()
            speed, reason = library.largest(elevation, azimuth, library.place(ball_position))
            row = ReachRow(*place, speed, None, reason, 0.0, 0.0)
        else:
            row = _largest(partial(plan, place, where), place, GROWTHS[motion], tolerance)
        if row.speed > 0.0:
            velocity = launch_velocity(np.array([row.speed, *np.radians(place[::-1])]))
            start = BallState((0.0, 0.0, ball.radius), velocity)
            paths = [follow(start, ball, air, Ground(0.0, name)) for name in SURFACES]
            row = replace(row, carpet=paths[0].distance, turf=paths[1].distance)
        rows[place] = row
        if file is not None:
            _write(file, settings, rows.values())
    found = tuple(rows[place] for place in wanted)
    return ReachTable(leg.name or "leg", motion, found, ball.warnings)


def _angles(name: str, values: ArrayLike, most: float) -> list[float]:
    angles = np.atleast_1d(validation.floats(name, values, unit="deg"))
    if angles.ndim != 1 or not angles.size or not (np.abs(angles) <= most).all():
        raise InvalidInput(f"{name} are {angles.tolist()}: they must be numbers up to {most:g} deg")
    return [float(angle) for angle in dict.fromkeys(angles.tolist())]


def _largest(
    plan: Callable[[float, KickPlan | None], KickPlan],
    place: Direction,
    growth: float,
    tolerance: float,
) -> ReachRow:
    """Return the row of a direction, without distances.

    `plan` returns the plan of a speed, near another one that is met.
    """
    start: KickPlan | None = None
    met, beyond, reason, speed = 0.0, None, "", FIRST_SPEED
    for _ in range(MOST_TRIES):
        share, failed = 1.0, ""
        try:
            planned = plan(speed, start)
        except InvalidInput as error:
            if not met and speed < 0.1 * FIRST_SPEED:
                raise
            failed = str(error)
        else:
            if planned.status == PlanStatus.BEYOND_LIMITS and planned.binding:
                failed = planned.binding[0]
            elif planned.status != PlanStatus.MET:
                failed = (*planned.warnings, str(planned.status))[0].partition(";")[0]
            share = planned.share
        if not failed:
            if start is None and planned.motion is not None:
                beyond, reason = None, ""  # what failed from rest may be met from this motion
            met, start = speed, planned
            if met >= LARGEST_SPEED:
                reason = "the largest speed that is tried"
                break
        else:
            beyond, reason = speed, failed
        if beyond is None:
            speed = min(growth * met, LARGEST_SPEED)
            continue
        if beyond <= (1.0 + tolerance) * met or beyond < 0.05 * FIRST_SPEED:
            break
        hint = share * (1.0 - 0.3 * tolerance) * speed
        middle = 0.5 * (met + beyond)
        speed = hint if failed and (1.0 + tolerance) * met < hint < 0.98 * beyond else middle
    return ReachRow(*place, met, beyond, reason, 0.0, 0.0)


def _write(file: FileName, settings: Any, rows: Iterable[ReachRow]) -> None:
    text = io.StringIO()
    text.write(f"# {json.dumps(settings)}\n")
    writer = csv.DictWriter(text, list(ReachRow.__dataclass_fields__), lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    with replacing(file) as draft:
        draft.write_text(text.getvalue(), encoding="utf-8")


def _read(file: FileName, settings: Mapping[str, Any]) -> dict[Direction, ReachRow]:
    """Return the rows of a file by azimuth and elevation; none where there is no file."""
    source = str(file)
    if not Path(file).exists():
        return {}
    header, _, table = read_text(file, source, LARGEST_FILE, FaultyFile).partition("\n")
    rows: dict[Direction, ReachRow] = {}
    try:
        written = json.loads(header.removeprefix("# "))
        for entry in csv.DictReader(io.StringIO(table)):
            reason, beyond = entry.pop("reason"), entry.pop("beyond")
            numbers = {name: float(value) for name, value in entry.items()}
            row = ReachRow(**numbers, reason=reason, beyond=float(beyond) if beyond else None)
            rows[row.azimuth, row.elevation] = row
    except (ValueError, KeyError, TypeError, RecursionError, csv.Error) as error:
        raise FaultyFile(source, [f"is not a table of kickdyn reach ({error})"]) from None
    if written != settings:
        stored = written if isinstance(written, dict) else {}
        names = sorted(name for name in settings if stored.get(name) != settings[name])
        raise InvalidInput(
            f"{source} contains the table of another {' and '.join(names)}: name another file, or "
            "delete this one"
        )
    return rows
