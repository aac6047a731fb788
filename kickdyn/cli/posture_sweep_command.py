"""Analyse the kicking postures of a leg: `python -m kickdyn.posture_sweep`."""

import logging
import math
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np
import xarray as xr

from kickdyn.air import AIRS
from kickdyn.ball import Ball
from kickdyn.cli.air_options import air_option, drag_option, with_drag
from kickdyn.cli.ball_option import ball_option
from kickdyn.cli.command import Command, check_files, check_page_name, offers, repeated, warn
from kickdyn.cli.leg_options import LegOptions, joints_to_set, leg_options
from kickdyn.cli.named_legs import SHIPPED
from kickdyn.cli.number_options import foot_options
from kickdyn.cli.restitution_option import restitution_option
from kickdyn.core import compilation
from kickdyn.core.files import write_json
from kickdyn.errors import InvalidInput, Unfinished
from kickdyn.flight.fly import fly
from kickdyn.impact.laws import LAWS
from kickdyn.restitution import Restitution, range_warnings
from kickdyn.sweeps.dataset import VARIABLES, describe, select_variables
from kickdyn.sweeps.grid import Grid, read_postures
from kickdyn.sweeps.queries import blocks
from kickdyn.sweeps.store import check_netcdf_name, check_store, save_netcdf
from kickdyn.sweeps.summary import NEEDED, Summary
from kickdyn.sweeps.sweep import CARRY_TOLERANCE, TO_RESUME, Progress, sweep, sweep_chunks
from kickdyn.sweeps.sweep_kick import Kick
from kickdyn.sweeps.sweep_report import (
    ReportLine,
    as_json,
    extreme_lines,
    page_lines,
    paper_lines,
    show,
)

if TYPE_CHECKING:
    from kickdyn.view.page import Page

KICKING = ("hip=-10:40:5", "knee=0:60:5", "ankle=-20:50:5")
"""Default grid of our legs: about to meet a ball on the ground before them."""


@click.command("posture-sweep", Command)
@leg_options
@click.option("--joint", "joints", multiple=True, metavar="NAME=LOW:HIGH:STEP",
              shell_complete=offers(joints_to_set),
              help="Range of a joint [deg; m for prismatic joints], or NAME=VALUE for a constant "
              "value; repeatable. By default, human and testbed have a range of hip, knee and "
              "ankle, in steps of 5 deg.")  # fmt: skip
@foot_options(speed=1.0, attack=30.0)
@restitution_option
@click.option("--friction", default=0.4, show_default=True, help="Coulomb's coefficient.")
@air_option
@drag_option
@ball_option
@click.option("--law", default="newton", show_default=True,
              type=click.Choice([*LAWS]),
              help="Impact law. Only newton has compiled kernels; with the others a sweep is about "
              "a thousand times slower.")  # fmt: skip
@click.option("--out", metavar="FILE.nc|DIR.zarr",
              help="Write the dataset, as netCDF 4 (up to a million postures) or Zarr (any number, "
              "can be resumed). Without it, only the best postures and the Pareto front are kept, "
              "for --json.")  # fmt: skip
@click.option("--variables", metavar="NAME,...", shell_complete=offers(lambda _: VARIABLES),
              help=f"Variables to write to --out, besides status and those of the table "
              f"({', '.join(NEEDED)}).  [default: all, {', '.join(VARIABLES)}]")  # fmt: skip
@click.option("--resume", is_flag=True,
              help="Compute only what is missing in DIR.zarr, after an interruption.")  # fmt: skip
@click.option("--threads", type=click.IntRange(1, 1024), metavar="N",
              help="Number of threads, 1 to 1024.  [default: one per core]")  # fmt: skip
@click.option("--workers", type=click.IntRange(1, 1024), metavar="N",
              help="Number of processes that write DIR.zarr, 1 to 1024, in place of "
              "threads.")  # fmt: skip
@click.option("--tolerance", default=CARRY_TOLERANCE, show_default=True,
              help="Largest error of a carry distance [m]. Carries of planar legs are interpolated "
              "between computed flights; with 0, every flight is computed.")  # fmt: skip
@click.option("--where", metavar="CONDITION",
              help="Condition on the postures of table, plot and page, with joints [deg] and "
              "variables, such as 'knee < 30 and worst_joint_impulse <= 2'.")  # fmt: skip
@click.option("--json", "json_file", metavar="FILE", help="Write the table as JSON; - is stdout.")
@click.option("--plot", metavar="FILE.png", help="Plot the sweep: .png, .svg or .pdf.")
@click.option("--view", metavar="FILE.html|.png",
              help="Write a 3-D page of the best kick, with buttons for the others in the table, "
              "or a picture of the page.")  # fmt: skip
@click.option("--live", is_flag=True, help="Serve the 3-D page on this computer until Ctrl-C.")
def posture_sweep(
    leg_options: LegOptions,
    joints: tuple[str, ...],
    speed: float,
    attack: float,
    restitution: Restitution,
    friction: float,
    air: str,
    drag: str | float | None,
    ball: Ball,
    law: str,
    out: str | None,
    variables: str | None,
    resume: bool,
    threads: int | None,
    workers: int | None,
    tolerance: float,
    where: str | None,
    json_file: str | None,
    plot: str | None,
    view: str | None,
    live: bool,
) -> None:
    """Kick from every posture of a grid, and explain the best and the worst.

    Example: kickdyn posture-sweep --joint hip=-10:60:5 --joint knee=0:90:5
    --joint ankle=0 --speed 2 --out sweep.nc --view kick.html
    """
    store = out if out is not None and Path(out).suffix == ".zarr" else None
    file = out if store is None else None
    if file is not None:
        check_netcdf_name(file)
    if store is not None:
        check_store(store, resume=resume)
    elif resume or workers is not None:
        raise InvalidInput("--resume and --workers are for a Zarr store: name it, --out DIR.zarr")
    if threads is not None and workers is not None:
        raise InvalidInput("--threads and --workers are both given: give one of them")
    if out is None and variables is not None:
        raise InvalidInput(
            "--variables is for what --out keeps: name it, --out FILE.nc or DIR.zarr"
        )
    if plot is not None:
        from kickdyn.core.plot_style import check_name, save_figure
        from kickdyn.sweeps.sweep_plot import sweep_figure

        check_name(plot)
    if view is not None:
        check_page_name(view)
    check_files(file, plot, view, json_file=json_file, inputs=[leg_options.leg_name])
    leg = leg_options.load()
    angle = math.radians(attack)
    kick = Kick(
        speed=speed, attack=angle, restitution=restitution, friction=friction, law=law,
        ball=ball, air=with_drag(AIRS[air], drag),
    )  # fmt: skip
    warn(range_warnings(kick.contact.restitution, speed))
    kicking = [axis for axis in KICKING if axis.partition("=")[0] in leg.joint_names]
    postures = read_postures(leg, joints or (kicking if leg_options.leg_name in SHIPPED else ()))
    grid = Grid.of(leg, postures)
    named = None if variables is None else [name.strip() for name in variables.split(",")]
    kept = select_variables(None if named is None else [*named, *NEEDED])
    summary = Summary(describe(leg, grid, kick, tolerance), where, kept)

    data: xr.Dataset | None = None
    found: Iterator[xr.Dataset]
    with _resumable(store), _progress_bar(grid.size, store if resume else None) as progress:
        if out is not None:
            data = sweep(
                leg, postures, kick, store=store, variables=kept, resume=resume,
                tolerance=tolerance, threads=threads, workers=workers, progress=progress,
            )  # fmt: skip
            found = (block for _, block in blocks(data))
        else:
            found = sweep_chunks(
                leg, postures, kick, tolerance=tolerance, threads=threads, progress=progress
            )
        for block in found:
            summary.add(block)

    best = extreme_lines(leg, grid, kick, summary)
    whole = leg_options.leg_name == "human" and not leg_options.locked
    lines = [*paper_lines(leg, kick), *best] if whole else best
    if file is not None and data is not None:
        save_netcdf(data, file)
    if json_file is not None:
        write_json(json_file, as_json(leg, kick, summary, lines))
    if json_file != "-":
        show(leg, kick, summary, lines)
    if plot is not None:  # the results are written: a picture that fails costs none of them
        save_figure(sweep_figure(summary, lines), plot)
    made_page = None
    if live or view is not None:
        made_page = _page(page_lines(leg, grid, kick, summary, lines), kick)
    if made_page is None and (live or view is not None):
        reason = "" if where is None else f" where {where}"
        click.echo(f"no posture is ok{reason}: there is nothing to view", err=True)
        view = None
    elif made_page is not None:
        if view is not None:
            made_page.save(view)
        warn(made_page.warnings)
    if json_file != "-":
        for name in (out, plot, view, json_file):
            if name is not None:
                click.echo(f"wrote {name}")
    if live and made_page is not None:
        with made_page.serve() as server:
            url = server.url
            click.echo(f"showing the kick at {url} (this machine only) until Ctrl-C", err=True)
            with suppress(KeyboardInterrupt):
                threading.Event().wait()


@contextmanager
def _resumable(store: str | None) -> Iterator[None]:
    """Say how to continue where a sweep that fills a store is stopped."""
    try:
        yield
    except (KeyboardInterrupt, Unfinished) as error:
        if store is None or not Path(store).is_dir():
            raise
        reason = str(error).removesuffix(TO_RESUME) or "interrupted"
        raise Unfinished(f"{reason}. To continue, run: {repeated('--resume')}") from None


@contextmanager
def _progress_bar(size: int, resumed: str | None) -> Iterator[Progress | None]:
    """Show a bar with time left and best ball speed while stderr is a terminal.

    Say first how much of a store that is resumed is there.
    """
    best, announced = 0.0, resumed is None

    def kept(count: int) -> None:
        """Write how many postures a store has, the first time."""
        nonlocal announced
        if not announced:
            rest = "the others are computed" if count < size else "none is missing"
            line = f"{resumed} has {count:,} of {size:,} postures: {rest}"
            click.echo(f"\r{line:79}" if sys.stderr.isatty() else line, err=True)
        announced = True

    if not sys.stderr.isatty():
        yield None if announced else lambda count, _: kept(count)
        return

    def text(speed: float | None) -> str | None:
        """Return what stands beside the progress bar."""
        return f"best {speed:.4g} m/s" if speed else None

    notice = logging.Handler(logging.INFO)
    notice.emit = lambda record: click.echo(  # type: ignore[method-assign]
        f"\r{record.getMessage() + '; later runs read it from disk':79}", err=True
    )
    level = compilation.log.level
    compilation.log.addHandler(notice)
    compilation.log.setLevel(logging.INFO)
    with click.progressbar(
        length=size, label="postures", file=sys.stderr, item_show_func=text
    ) as bar:

        def progress(count: int, speed: float) -> None:
            """Move the bar on by a number of postures, and keep the best speed [m/s]."""
            nonlocal best
            kept(count)
            best = float(np.fmax(best, speed))
            bar.update(count, best)

        try:
            yield progress
        finally:
            compilation.log.removeHandler(notice)
            compilation.log.setLevel(level)


def _page(lines: Sequence[ReportLine], kick: Kick) -> "Page | None":
    """Return a page that shows the kick of each line, the first of them first; None without any."""
    from kickdyn.view.page import page, page_of_pages

    pages = {
        line.label: page(
            impact, fly(impact.ball_after, kick.ball, kick.air), caption=line.explanation
        )
        for line in lines
        if (impact := line.outcome.impact) is not None
    }
    return page_of_pages(pages) if pages else None
