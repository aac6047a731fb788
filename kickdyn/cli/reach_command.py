"""What a robot can do, direction by direction (`kickdyn reach`)."""

from dataclasses import dataclass

import click

from kickdyn.cli.command import Command, busy, print_wrapped, warn
from kickdyn.cli.leg_options import LegOptions
from kickdyn.cli.option_groups import (
    AirOptions,
    BallOptions,
    PlotOptions,
    PointOptions,
    option,
    takes,
)
from kickdyn.cli.plan_command import height_of_ball
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
        "--motion", is_flag=True,
        help="Plan whole motions, within all of their limits: minutes for each direction of a "
        "robot. By default, only the limits at the impact apply.",
    )  # fmt: skip
    tolerance: float = option(
        "--tolerance", type=float, default=0.05, show_default=True,
        help="Relative accuracy of the speed.",
    )  # fmt: skip
    out: str | None = option(
        "--out", metavar="FILE.csv",
        help="Keep the table in a file: each row is written when it is computed, and the same "
        "command continues after an interruption.",
    )  # fmt: skip


@click.command("reach", Command)
@takes(leg=LegOptions, contact=PointOptions, air=AirOptions, ball=BallOptions, output=ReachOptions)
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
    warn(table.warnings)
    output.write_json(table.to_json())
    if output.prints:
        limits = "whole motions" if table.motion else "the impact alone: upper bounds"
        print_wrapped("\n".join([f"{table.robot}, limits of {limits}", *table.table()]))
    output.save_plot(table.plot)
    output.name_written(output.plot, output.out)
