"""Launches over ranges: the largest in each direction, and motions for all of them.

The commands are `kickdyn reach` and `kickdyn kick-library`.
"""

import math
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from multiprocessing import get_context
from time import perf_counter
from typing import Any

import click

from kickdyn.cli.commands import busy
from kickdyn.cli.leg_options import LegOptions
from kickdyn.cli.option_groups import (
    DEFAULT_BALL,
    AirOptions,
    BallOptions,
    PlotOptions,
    PointOptions,
    command,
    option,
)
from kickdyn.cli.plan_command import height_of_ball
from kickdyn.errors import InvalidInput
from kickdyn.motion.motion_file import check_motion_name
from kickdyn.planning.kick_library import LibraryKick
from kickdyn.planning.kick_library import kick_library as make_library
from kickdyn.planning.kick_reader import AXES
from kickdyn.planning.reach import ELEVATIONS
from kickdyn.planning.reach import reach as find_reach


@dataclass(frozen=True)
class ReachOptions(PlotOptions):
    """The directions, the limits that count, and where the table is kept."""

    azimuths: tuple[float, ...] = option(
        "--azimuth", multiple=True, type=float,
        help="Direction to the left of x [deg]; repeat it for several.  [default: 0]",
    )  # fmt: skip
    elevations: tuple[float, ...] = option(
        "--elevation", multiple=True, type=float,
        help="Direction above the horizontal [deg]; repeat it for several.  "
        f"[default: {', '.join(f'{angle:g}' for angle in ELEVATIONS)}]",
    )  # fmt: skip
    motion: bool = option(
        "--motion", help="Plan whole motions, within all of their limits: minutes for each "
        "direction of a robot. By default, only the limits at the impact apply.",
    )  # fmt: skip
    tolerance: float = option(
        "--tolerance", type=float, default=0.05, help="Relative accuracy of the speed."
    )
    out: str | None = option(
        "--out", metavar="FILE.csv", help="Keep the table in a file: each row is written when it "
        "is computed, and the same command continues after an interruption.",
    )  # fmt: skip


@command("reach")
def reach(
    leg: LegOptions,
    contact: PointOptions,
    air: AirOptions,
    ball: BallOptions,
    output: ReachOptions,
) -> None:
    """Find the largest launch in each direction, and how far it goes on carpet and turf.

    Example: kickdyn reach --leg g1 --support left_ankle_roll_link:0.7 --out g1.csv
    """
    output.check(inputs=[leg.leg_name])
    robot, struck = leg.load(), ball.load()
    with busy("planning kicks") as show:
        table = find_reach(
            robot, struck, air.load(), azimuths=output.azimuths or (0.0,),
            elevations=output.elevations or ELEVATIONS, contact=contact.contact(),
            ball_position=height_of_ball(robot, struck, contact.offset), motion=output.motion,
            tolerance=output.tolerance, file=output.out, progress=show,
        )  # fmt: skip
    output.write_json(table.to_json())
    output.print_rows(table)
    output.save_plot(table.plot)
    output.name_written(output.plot, output.out)


FORM = "LOW,HIGH, LOW,HIGH,STEP or a value, such as 7.2,8.2"


@dataclass(frozen=True)
class RangeOptions:
    """The ranges of a library; angles in degrees."""

    speed: str | None = option(
        "--speed", metavar="LOW,HIGH[,STEP]|VALUE", help="Speeds [m/s]; without, read FILE."
    )
    elevation: str = option(
        "--elevation", metavar="LOW,HIGH[,STEP]|VALUE", default="0", help="Elevations [deg]."
    )
    azimuth: str = option(
        "--azimuth", metavar="LOW,HIGH[,STEP]|VALUE", default="0",
        help="Directions of the launch to the left of x [deg].",
    )  # fmt: skip
    x: str | None = option(
        "--ball-x", metavar="LOW,HIGH[,STEP]|VALUE", help="Places of the ball's centre ahead of "
        "the origin [m].  [default: the place that suits the middle of the ranges best]",
    )  # fmt: skip
    y: str | None = option(
        "--ball-y", metavar="LOW,HIGH[,STEP]|VALUE", help="Likewise, to the left of the origin [m]."
    )
    height: float | None = option(
        "--ball-height", help="Height of the ball's centre, which a leg on a fixed base needs [m]."
    )
    correct: bool = option(
        "--correct", help="Carry the motions out in MuJoCo, once, so that kicks are corrected."
    )
    workers: int = option(
        "--workers", type=click.IntRange(1), default=1, help="Processes that plan motions."
    )

    def ranges(self) -> dict[str, Any]:
        """Return the ranges in SI units."""
        ranges = dict[str, Any]()
        for name in AXES:
            if (text := getattr(self, name)) is not None:
                values = _numbers(name, text, (1, 2, 3), FORM)
                scale = math.radians(1.0) if name in ("elevation", "azimuth") else 1.0
                ranges[name] = [scale * value for value in values]
        return ranges

    def executor(self) -> AbstractContextManager[Executor | None]:
        """Return the processes that plan motions; None with a single one."""
        if self.workers == 1:
            return nullcontext(None)
        return ProcessPoolExecutor(self.workers, get_context("spawn"))


@dataclass(frozen=True)
class LibraryKickOptions(PlotOptions):
    """The figure of the library, a single kick of it, and the file of its motion."""

    kick: str | None = option(
        "--kick", metavar="SPEED,ELEVATION[,X,Y]", help="Print the kick with a launch [m/s, deg] "
        "and a place of the ball [m], by default the middle of the ranges.",
    )  # fmt: skip
    out: str | None = option(
        "--out", metavar="FILE",
        help="Write its motion, 100 times a second: .csv, .npz, .yaml (ROS 2) or .xml (MuJoCo).",
    )  # fmt: skip


@command("kick-library")
@click.argument("file", metavar="FILE.npz", type=click.Path())
def kick_library(
    file: str,
    leg: LegOptions,
    ranges: RangeOptions,
    contact: PointOptions,
    ball: BallOptions,
    output: LibraryKickOptions,
) -> None:
    """Plan the motions of a robot for a range of launches, from which any kick follows at once.

    A library that was interrupted is continued by the same command; one that is finished is read.

    Example: kickdyn kick-library g1.npz --leg g1 --support left_ankle_roll_link:0.7 --speed 7.2,8.2
    --elevation 10,18 --workers 2
    """
    output.check(output.out, inputs=[leg.leg_name])
    if output.out is not None:
        check_motion_name(output.out)
        if output.kick is None:
            raise InvalidInput("--out writes the motion of a kick: name it with --kick")
    reads = ranges.speed is None and ball.ball == DEFAULT_BALL
    struck = None if reads else ball.load()  # a library that is read has its ball
    with busy("planning motions") as show, ranges.executor() as executor:
        begun: dict[str, tuple[float, int]] = {}

        def progress(what: str, count: int, total: int) -> None:
            start, former = begun.setdefault(what, (perf_counter(), count))
            rate = (perf_counter() - start) / max(count - former, 1)
            remaining = f", about {rate * (total - count) / 60:.0f} min" if count > former else ""
            show(f"{count} of {total} {what}{remaining}")

        library = make_library(
            leg.load(), file, struck, **ranges.ranges(), height=ranges.height,
            contact=contact.contact(), executor=executor, progress=progress,
        )  # fmt: skip
        if ranges.correct:
            from kickdyn.simulators.library_runs import correct_library

            library = correct_library(library, executor=executor, progress=progress)
    chosen: LibraryKick | None = None
    if output.kick is not None:
        form = "SPEED,ELEVATION or SPEED,ELEVATION,X,Y"
        speed, elevation, *place = _numbers("--kick", output.kick, (2, 4), form)
        point = 0.5 * (library.reader.lower + library.reader.upper)
        point[:2] = speed, math.radians(elevation)
        point[len(AXES) - len(place) :] = place
        chosen = library.kick_for(point)
    output.write_json((library if chosen is None else chosen).to_json())
    if chosen is not None and not chosen.met:
        raise InvalidInput(f"there is no kick: {chosen.reason}")
    output.print_rows(*filter(None, (library, chosen)))
    if output.out is not None and chosen is not None and chosen.motion is not None:
        chosen.motion.save(output.out)
        if output.prints:
            click.echo(f"the impact is {-chosen.motion.begin:.4g} s after the beginning")
    output.save_plot(library.plot)
    output.name_written(output.plot, output.out)


def _numbers(name: str, text: str, counts: tuple[int, ...], form: str) -> list[float]:
    values = list[float]()
    with suppress(ValueError):
        values = [float(word) for word in text.split(",")]
    if len(values) not in counts:
        raise InvalidInput(f"{name} is {text!r}: it must be {form}")
    return values
