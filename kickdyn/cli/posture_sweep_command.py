"""Analyse the kicking postures of a leg: `python -m kickdyn.posture_sweep`."""

import logging
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import xarray as xr

from kickdyn.cli.commands import warn
from kickdyn.cli.leg_options import SHIPPED, LegOptions
from kickdyn.cli.option_groups import (
    AirOptions,
    BallOptions,
    ContactOptions,
    FootOptions,
    OutputOptions,
    command,
    option,
)
from kickdyn.core import compilation
from kickdyn.errors import InvalidInput
from kickdyn.flight.fly import fly
from kickdyn.impact.laws import LAWS, names_of_laws
from kickdyn.restitution import range_warnings, read_restitution
from kickdyn.sweeps.chunk_solver import ChunkSolver
from kickdyn.sweeps.dataset import VARIABLES, select_variables
from kickdyn.sweeps.grid import GIGABYTES, Grid, read_postures
from kickdyn.sweeps.queries import NEEDED, Summary, blocks
from kickdyn.sweeps.store import check_netcdf_name, save_netcdf
from kickdyn.sweeps.sweep import CARRY_TOLERANCE, Progress, sweep, sweep_chunks
from kickdyn.sweeps.sweep_kick import Kick
from kickdyn.sweeps.sweep_report import (
    ReportLine,
    as_json,
    extreme_lines,
    page_lines,
    paper_lines,
    show,
)


@dataclass(frozen=True)
class SweepOptions:
    """The grid, the impact law, and the postures that are shown."""

    joints: tuple[str, ...] = option(
        "--joint", multiple=True, metavar="NAME=LOW:HIGH:STEP", help="Range of a joint [deg; m for "
        "prismatic joints], or NAME=VALUE for a constant value; repeatable. By default, human and "
        "testbed have a range of hip, knee and ankle, in steps of 5 deg.",
    )  # fmt: skip
    law: str = option(
        "--law", default="newton", type=click.Choice([*LAWS]),
        help=f"Impact law. A compiled kernel exists for {names_of_laws('has_kernel')}; with the "
        "others a sweep is about a thousand times slower.",
    )  # fmt: skip
    where: str | None = option(
        "--where", metavar="CONDITION", help="Condition on the postures of table, plot and page, "
        "with joints [deg] and variables, such as 'knee < 30 and worst_joint_impulse <= 2'.",
    )  # fmt: skip


@dataclass(frozen=True)
class StoreOptions:
    """Where the dataset is written, and how it is computed."""

    out: str | None = option(
        "--out", metavar="FILE.nc|DIR.zarr", type=click.Path(), help="Write the dataset, as netCDF "
        "4 (up to a million postures) or Zarr (any number, can be resumed). Without it, only the "
        "best postures and the Pareto front are kept, for --json.",
    )  # fmt: skip
    variables: str | None = option(
        "--variables", metavar="NAME,...",
        help="Variables to write to --out, with status and the variables of the table "
        f"({', '.join(NEEDED)}).  [default: all, {', '.join(VARIABLES)}]",
    )  # fmt: skip
    resume: bool = option(
        "--resume", help="Compute only what is missing in DIR.zarr, after an interruption."
    )
    threads: int | None = option(
        "--threads", type=click.IntRange(1, 1024), metavar="N",
        help="Number of threads, 1 to 1024.  [default: one per core]",
    )  # fmt: skip
    tolerance: float = option(
        "--tolerance", default=CARRY_TOLERANCE,
        help="Largest error of a carry distance [m]. Carries of planar legs are interpolated "
        "between computed flights; with 0, every flight is computed.",
    )  # fmt: skip

    @property
    def store(self) -> str | None:
        """The Zarr store that is written, if any."""
        return self.out if self.out is not None and Path(self.out).suffix == ".zarr" else None

    @property
    def file(self) -> str | None:
        """The netCDF file that is written, if any."""
        return self.out if self.store is None else None

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of the variables that are computed."""
        if self.variables is None:
            return select_variables(None)
        return select_variables([*(name.strip() for name in self.variables.split(",")), *NEEDED])

    def check(self) -> None:
        """Raise `InvalidInput` for options that need --out, or a wrong name."""
        if self.file is not None:
            check_netcdf_name(self.file)
        if self.store is None and self.resume:
            raise InvalidInput("--resume needs a Zarr store: add --out DIR.zarr")
        if self.out is None and self.variables is not None:
            raise InvalidInput("--variables is for --out: add --out FILE.nc or DIR.zarr")


@command("posture-sweep")
def posture_sweep(
    leg: LegOptions,
    chosen: SweepOptions,
    foot: FootOptions,
    contact: ContactOptions,
    air: AirOptions,
    ball: BallOptions,
    storing: StoreOptions,
    output: OutputOptions,
) -> None:
    """Kick from every posture of a grid, and explain the best and the worst.

    The 3-D page shows the best kick, and has buttons for the others in the table.

    Example: kickdyn posture-sweep --joint hip=-10:60:5 --joint knee=0:90:5
    --joint ankle=0 --speed 2 --out sweep.nc --view kick.html
    """
    storing.check()
    joints, where = chosen.joints, chosen.where
    output.check(storing.file, inputs=[leg.leg_name])
    kick = Kick(
        speed=foot.speed, attack=foot.angle, restitution=read_restitution(contact.restitution),
        friction=contact.friction, law=chosen.law, ball=ball.load(), air=air.load(),
    )  # fmt: skip
    warn((*kick.ball.warnings, *range_warnings(kick.contact.restitution, kick.speed)))
    robot = leg.load()
    if not joints and leg.leg_name in SHIPPED:
        # default grid of our legs: about to meet a ball on the ground before them
        joints = tuple(
            axis
            for axis in ("hip=-10:40:5", "knee=0:60:5", "ankle=-20:50:5")
            if axis.partition("=")[0] in robot.joint_names
        )
    grid = Grid.of(robot, read_postures(robot, joints))
    solver = ChunkSolver(robot, grid, kick, storing.tolerance)
    summary = Summary(solver.describe(), where, storing.kept)
    # processor time of a sweep from which on it is announced [s]
    if solver.seconds > 120.0:
        size = GIGABYTES * grid.size * len(storing.kept) / len(VARIABLES)
        stored = f" and {size:,.2g} GB in {storing.store}" if storing.store else ""
        click.echo(
            f"{grid.size:,} postures take about {solver.seconds / 60.0:,.0f} minutes of processor "
            f"time{stored}", err=True,
        )  # fmt: skip
    how: dict[str, Any] = {"tolerance": storing.tolerance, "threads": storing.threads}
    data: xr.Dataset | None = None
    with _progress_bar(grid.size) as progress:
        if storing.out is None:
            computed = sweep_chunks(robot, grid.axes, kick, progress=progress, **how)
        else:
            data = sweep(
                robot, grid.axes, kick, store=storing.store, variables=storing.kept,
                resume=storing.resume, progress=progress, **how,
            )  # fmt: skip
            computed = (block for _, block in blocks(data))
        for block in computed:
            summary.add(block)

    lines = extreme_lines(robot, grid, kick, summary)
    if leg.leg_name == "human" and not leg.locked:
        lines = [*paper_lines(robot, kick), *lines]
    if storing.file is not None and data is not None:
        save_netcdf(data, storing.file)
    output.write_json(as_json(robot, kick, summary, lines))
    if output.prints:
        show(robot, kick, summary, lines)
    if output.plot is not None:  # the results are written: a picture that fails costs none of them
        from kickdyn.sweeps.sweep_report import sweep_figure

        output.save_plot(partial(sweep_figure, summary, lines))
    page = None
    if output.view is not None:
        page = _save_page(output.view, kick, page_lines(robot, grid, kick, summary, lines))
        if page is None:
            reason = "" if where is None else f" where {where}"
            click.echo(f"no posture is ok{reason}: there is nothing to view", err=True)
    output.name_written(storing.out, output.plot, page)


def _save_page(file: str, kick: Kick, lines: Iterable[ReportLine]) -> str | None:
    from kickdyn.view.page import page, page_of_pages  # imports meshcat

    pages = {
        line.label: page(
            impact, fly(impact.ball_after, kick.ball, kick.air), caption=line.explanation
        )
        for line in lines
        if (impact := line.outcome.impact) is not None
    }
    if not pages:
        return None
    made_page = page_of_pages(pages)
    made_page.save(file)
    warn(made_page.warnings)
    return file


@contextmanager
def _progress_bar(size: int) -> Iterator[Progress | None]:
    if not sys.stderr.isatty():
        yield None
        return
    notice = logging.StreamHandler(sys.stderr)
    notice.setFormatter(logging.Formatter("\r%(message)s; later runs read it from disk"))
    level = compilation.log.level
    compilation.log.addHandler(notice)
    compilation.log.setLevel(logging.INFO)

    with click.progressbar(length=size, label="postures", file=sys.stderr) as bar:
        try:
            yield bar.update
        finally:
            compilation.log.removeHandler(notice)
            compilation.log.setLevel(level)
