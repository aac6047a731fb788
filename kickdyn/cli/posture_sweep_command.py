"""Analyse the kicking postures of a leg: `python -m kickdyn.posture_sweep`."""

from __future__ import annotations

import math
import shlex
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import xarray as xr
from click.core import ParameterSource

from kickdyn.air import AIRS
from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.core.files import check_outputs, write_json
from kickdyn.errors import InvalidInput, Unfinished
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.impact.impact_result import Impact
from kickdyn.robot.catalog import SHIPPED, load_leg
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.block import Space
from kickdyn.sweeps.expression import Expression
from kickdyn.sweeps.grid import MAX_POSTURES, MOST_POSTURES, Grid, grid
from kickdyn.sweeps.kick import CARRY_ERROR, Kick
from kickdyn.sweeps.netcdf_file import check_name, save
from kickdyn.sweeps.opened import Sweep, open_sweep
from kickdyn.sweeps.progress import progress
from kickdyn.sweeps.run import sweep
from kickdyn.sweeps.summary import (
    Line,
    best_and_worst,
    counts,
    extremes,
    paper_lines,
    worst_residual,
)
from kickdyn.sweeps.sweep_report import as_json, show

if TYPE_CHECKING:
    from kickdyn.sweeps.survey import Survey

KICKING = ("hip=-10:40:5", "knee=0:60:5", "ankle=-20:50:5")
"""Default grid of our legs: about to meet a ball on the ground before them."""


class _Typed(click.Command):
    """A command that knows what was typed, to say how to go on."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the arguments beside reading them."""
        ctx.meta["typed"] = list(args)
        return super().parse_args(ctx, args)


@click.command("posture-sweep", _Typed, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--leg", "leg_name", default="human", metavar="human|testbed|FILE|ROBOT",
              show_default=True,
              help="The leg: one of ours, a URDF file, or the leg of a robot of kickdyn[robots] on "
              "its fixed base (g1, talos, ...).")  # fmt: skip
@click.option("--frame", help="Link or joint whose origin strikes the ball.  [default: toe; of a "
              "robot, its right foot]")  # fmt: skip
@click.option("--joint", "joints", multiple=True, metavar="NAME=LOW:HIGH:STEP",
              help="Joint to sweep [deg], or to hold: NAME=VALUE; repeatable. "
              "Default: a kick's range of hip, knee and ankle, each 5 deg; of another leg of up "
              "to three joints, every joint's range, each 10 deg.")  # fmt: skip
@click.option("--speed", default=1.0, show_default=True, help="Foot speed [m/s].")
@click.option("--attack", default=30.0, show_default=True,
              help="Direction of the foot and of the contact normal above the horizontal "
              "[deg].")  # fmt: skip
@click.option("--restitution", default=0.8, show_default=True, help="Coefficient e, 0 to 1.")
@click.option("--friction", default=0.4, show_default=True, help="Coulomb's coefficient.")
@click.option("--air", default="standard", show_default=True, type=click.Choice(list(AIRS)),
              help="For the flight: 20 degC at sea level, the paper's, or none.")  # fmt: skip
@click.option("--out", metavar="FILE.nc|DIR.zarr",
              help="Write the dataset: netCDF 4 up to a million postures; Zarr chunk by chunk, any "
              "number, to be gone on with if it is stopped. Without it, of more than a million the "
              "best, the front, marginals and a sample are kept, for --json.")  # fmt: skip
@click.option("--resume", is_flag=True, help="Go on with what is in DIR.zarr.")
@click.option("--threads", type=click.IntRange(1, 1024),
              help="Threads that fill DIR.zarr, or take more than a million postures.  [default: "
              "one per core]")  # fmt: skip
@click.option("--workers", type=click.IntRange(1, 1024), metavar="N",
              help="Processes that do, instead of threads (kickdyn[cluster]).")  # fmt: skip
@click.option("--cluster", metavar="tcp://HOST:PORT",
              help="Scheduler of dask.distributed whose workers do.")  # fmt: skip
@click.option("--carry-error", default=CARRY_ERROR, show_default=True,
              help="In DIR.zarr, or of more than a million postures, how far off a carry may be "
              "that is read off polynomials, not flown [m]; 0 flies every ball.")  # fmt: skip
@click.option("--where", metavar="CONDITION",
              help="Best, worst, plot and page are of postures that fulfil it, such as "
              "'knee < 30 and worst_joint_impulse <= 2': joints [deg] and results.")  # fmt: skip
@click.option("--json", "json_file", metavar="FILE", help="Write the table; - is stdout.")
@click.option("--plot", metavar="FILE.png", help="Draw the sweep (.png, .svg, .pdf).")
@click.option("--view", metavar="FILE.html", help="Write a 3-D page of the best kick.")
@click.option("--live", is_flag=True, help="Serve that page on this machine until Ctrl-C.")
def posture_sweep(
    leg_name: str,
    frame: str | None,
    joints: tuple[str, ...],
    speed: float,
    attack: float,
    restitution: float,
    friction: float,
    air: str,
    out: str | None,
    resume: bool,
    threads: int | None,
    workers: int | None,
    cluster: str | None,
    carry_error: float,
    where: str | None,
    json_file: str | None,
    plot: str | None,
    view: str | None,
    live: bool,
) -> None:
    """Kick from every posture of a grid and say which is best, and why.

    Example: kickdyn posture-sweep --joint hip=-10:60:5 --joint knee=0:90:5
    --joint ankle=0 --speed 2 --out sweep.nc --view kick.html
    """
    leg = load_leg(leg_name, frame)
    validation.number("attack", attack, at_least=-90, at_most=90, unit="deg")
    kick = Kick(
        speed=speed,
        attack=math.radians(attack),
        restitution=restitution,
        friction=friction,
        air=AIRS[air],
    )
    streams = out is not None and Path(out).suffix == ".zarr"
    most = MOST_POSTURES if streams or out is None else MAX_POSTURES
    postures = grid(leg, joints or (KICKING if leg_name in SHIPPED else ()), most)
    space = Space.of_grid(leg, postures)
    if where is not None:
        Expression(where, space.units)
    if resume and not streams:
        raise InvalidInput("--resume goes on with a Zarr store: name it with --out DIR.zarr")
    if (workers or cluster) and not streams:
        raise InvalidInput("--workers and --cluster fill a Zarr store: name it with --out DIR.zarr")
    if sum(each is not None for each in (threads, workers, cluster)) > 1:
        raise InvalidInput("--threads, --workers and --cluster exclude each other: choose one")
    _check_effect(leg, kick, threads, chunked=streams or postures.size > MAX_POSTURES)
    if resume and not Path(str(out)).exists():
        click.echo(f"{out} is not there: nothing to resume, a new sweep begins", err=True)
    _check_outputs(None if streams else out, json_file, plot, view)

    data = survey = found = chosen = None
    if out is not None and streams:
        told = _streamed(
            out, leg, postures, kick, resume=resume, threads=threads, workers=workers or 0,
            cluster=cluster, carry_error=carry_error,
        )  # fmt: skip
        counted, residual = told["counts"], told["residual"]
        numbers = [told[name][1] for name in ("best", "worst") if told[name]]
        lines = extremes(leg, postures, kick, numbers)
    elif postures.size > MAX_POSTURES:
        from kickdyn.sweeps.survey import Survey

        survey = Survey(leg, postures, kick, where, draws=plot is not None)
        with progress(space) as done:
            survey.run(threads=threads, carry_error=carry_error, progress=done)
        counted, residual, lines = survey.counts, survey.residual, survey.lines()
        chosen = None if where is None else (where, survey.chosen)
    else:
        with progress(space) as done:
            data = sweep(leg, postures, kick, done)
        counted, residual = counts(data), worst_residual(data)
    with _complete(out if streams else None):
        if survey is None and (data is not None or where is not None or plot is not None):
            found = open_sweep(str(out)) if data is None else Sweep(data)
            found = found if where is None else found.where(where)
        if found is not None and (data is not None or where is not None):
            lines = best_and_worst(leg, found, kick)
            chosen = None if where is None else (where, found.count())
        shown = _shown(lines, kick) if live or view is not None else None
        if leg_name == "human":
            lines = [*paper_lines(leg, kick), *lines]
        writers = _writers(
            data, survey or found, lines, shown, None if streams else out, plot, view
        )  # all made before any is written
    for write in writers:
        write()
    files = [file for file in (out, plot, view) if file is not None]
    if json_file is not None:
        kept = {} if survey is None else {"kept": survey.as_json()}
        write_json(json_file, {**as_json(leg, kick, counted, lines, chosen), **kept})
        files += [json_file]
    if json_file != "-":
        show(leg, kick, counted, residual, lines, chosen)
        if survey is not None:
            click.echo("No posture is kept; --json writes the best, the front and a sample.")
        for file in files:
            click.echo(f"wrote {file}")
    if live and shown:
        _serve(shown)


def _check_effect(leg: Leg, kick: Kick, threads: int | None, *, chunked: bool) -> None:
    """Refuse what is asked of a sweep chunk by chunk where it would do nothing."""
    named = click.get_current_context().get_parameter_source("carry_error")
    if threads is not None and not chunked:
        raise InvalidInput(
            "--threads is for more than a million postures or a Zarr store: name it with "
            "--out DIR.zarr"
        )
    if named != ParameterSource.COMMANDLINE:
        return
    if not chunked:
        raise InvalidInput(
            "--carry-error is for more than a million postures or a Zarr store: here every ball "
            "is flown"
        )
    from kickdyn.sweeps.outcomes import interpolated, kernel_scene

    if kick.air is None:
        raise InvalidInput("--carry-error is for carries in air: without, they are exact")
    if not interpolated(kernel_scene(leg, kick), kick, 1.0):
        raise InvalidInput(
            f"--carry-error is for legs that move in the plane of the kick: of {leg.name} every "
            "ball is flown"
        )


def _check_outputs(
    out: str | None, json_file: str | None, plot: str | None, view: str | None
) -> None:
    if out is not None:
        check_name(out)
    if plot is not None:
        from kickdyn.sweeps.sweep_plot import check_name as check_plot

        check_plot(plot)
    check_outputs(out, plot, view, json_file=json_file)


def _streamed(out: str, leg: Leg, postures: Grid, kick: Kick, **how: Any) -> dict[str, Any]:
    from kickdyn.sweeps.stream import stream

    try:
        with progress(Space.of_grid(leg, postures), Path(out)) as done:
            return stream(out, leg, postures, kick, progress=done, **how)
    except Unfinished as error:
        raise Unfinished(f"{error}: {_command('--resume')}") from None


@contextmanager
def _complete(store: str | None) -> Iterator[None]:
    """Say of a store, if Ctrl-C ends its reading, that it is complete."""
    try:
        yield
    except KeyboardInterrupt:
        if store is None:
            raise
        raise Unfinished(
            f"interrupted: the sweep in {store} is complete, --resume asks it again: "
            f"{_command('--resume')}"
        ) from None


def _command(more: str) -> str:
    """Return what was typed, and more."""
    context = click.get_current_context()
    typed = [each for each in context.meta["typed"] if each != more]
    return f"{context.command_path} {shlex.join([*typed, more])}"


def _writers(
    data: xr.Dataset | None,
    found: Sweep | Survey | None,
    lines: Sequence[Line],
    shown: Shown | None,
    out: str | None,
    plot: str | None,
    view: str | None,
) -> list[Callable[[], None]]:
    writers: list[Callable[[], None]] = []
    if view is not None and shown:
        from kickdyn.view.kick_page import kick_page, write_page

        writers.append(partial(write_page, view, kick_page(*shown)))
    if found is not None and plot is not None:
        from kickdyn.sweeps.sweep_plot import save_figure

        writers.append(partial(save_figure, found.plot(lines=lines), plot))
    if data is not None and out is not None:
        writers.append(partial(save, data, out))
    return writers


Shown = tuple[Impact, Ball, Flight]


def _shown(lines: Sequence[Line], kick: Kick) -> Shown:
    """Return the best kick, to be looked at."""
    for line in lines:
        hit = line.outcome.hit
        if hit is not None:
            return hit, kick.ball, fly(hit.ball_after, kick.ball, kick.air, orientation=True)
    raise InvalidInput("no posture of the grid can kick so: there is nothing to view")


def _serve(shown: Shown) -> None:
    from kickdyn.view.live import serve

    with serve(*shown) as server:
        click.echo(f"showing the kick at {server.url} (this machine only) until Ctrl-C", err=True)
        with suppress(KeyboardInterrupt):
            threading.Event().wait()
