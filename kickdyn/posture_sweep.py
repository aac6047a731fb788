"""The main job: analyse the kicking postures of a leg (`python -m kickdyn.posture_sweep`)."""

from __future__ import annotations

import json
import math
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from textwrap import fill

import click
import xarray as xr
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.progress import MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from kickdyn import checks
from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.door import run
from kickdyn.errors import InvalidInput
from kickdyn.files import check_writable, replacing
from kickdyn.flight.fly import Flight, fly
from kickdyn.impact.strike import Impact
from kickdyn.leg import Leg, shipped_urdf
from kickdyn.sweep.grid import Grid, grid
from kickdyn.sweep.kick import Kick
from kickdyn.sweep.run import provenance, sweep
from kickdyn.sweep.store import check_name, save
from kickdyn.sweep.summary import Line, best_and_worst, counts, paper_lines

SHIPPED = {"human": "leg_human.urdf", "testbed": "leg_testbed.urdf"}
AIRS: dict[str, Callable[[], Air | None]] = {
    "standard": Air,
    "paper": Air.paper,
    "none": lambda: None,
}

KICKING = ("hip=-10:40:5", "knee=0:60:5", "ankle=-20:50:5")
"""Default grid of our legs: about to meet a ball on the ground before them."""


@click.command("posture-sweep", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--leg", "leg_name", default="human", metavar="human|testbed|FILE", show_default=True,
              help="The leg: one of ours, or a URDF file.")  # fmt: skip
@click.option("--frame", default="toe", show_default=True,
              help="Link or joint whose origin strikes the ball.")  # fmt: skip
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
@click.option("--out", metavar="FILE.nc", help="Write the dataset (netCDF 4).")
@click.option("--json", "json_file", metavar="FILE", help="Write the table; - is stdout.")
@click.option("--plot", metavar="FILE.png", help="Draw the sweep (.png, .svg, .pdf).")
@click.option("--view", metavar="FILE.html", help="Write a 3-D page of the best kick.")
@click.option("--live", is_flag=True, help="Serve that page on this machine until Ctrl-C.")
def posture_sweep(
    leg_name: str,
    frame: str,
    joints: tuple[str, ...],
    speed: float,
    attack: float,
    restitution: float,
    friction: float,
    air: str,
    out: str | None,
    json_file: str | None,
    plot: str | None,
    view: str | None,
    live: bool,
) -> None:
    """Kick from every posture of a grid and say which is best, and why.

    Example: python -m kickdyn.posture_sweep --joint hip=-10:60:5 --joint knee=0:90:5
    --joint ankle=0 --speed 2 --out sweep.nc --view kick.html
    """
    leg = load_leg(leg_name, frame)
    checks.number("attack", attack, at_least=-90, at_most=90, unit="deg")
    kick = Kick(
        speed=speed,
        attack=math.radians(attack),
        restitution=restitution,
        friction=friction,
        air=AIRS[air](),
    )
    postures = grid(leg, joints or (KICKING if leg_name in SHIPPED else ()))
    _check_outputs(out, json_file, plot, view)

    data = _swept(leg, postures, kick)
    ends = best_and_worst(leg, data, kick)
    lines = [*(paper_lines(leg, kick) if leg_name == "human" else []), *ends]
    _write(data, lines, leg, kick, out, plot, view)
    if json_file:
        _write_json(json_file, _report(leg, kick, data, lines))
    if json_file != "-":
        _print(leg, kick, data, lines, [f for f in (out, json_file, plot, view) if f])
    if live:
        _serve(lines, kick)


def load_leg(name: str, frame: str) -> Leg:
    """Return one of the shipped legs, or that of a URDF file; raise `InvalidInput`."""
    if name in SHIPPED:
        return Leg.from_urdf(shipped_urdf(SHIPPED[name]), frame)
    if not Path(name).exists() and not Path(name).suffix:
        raise InvalidInput(f"leg {name!r} is neither {', '.join(SHIPPED)} nor a file")
    return Leg.from_urdf(name, frame)


def _check_outputs(
    out: str | None, json_file: str | None, plot: str | None, view: str | None
) -> None:
    if out:
        check_name(out)
    if plot:
        from kickdyn.view.sweep_plot import check_name as check_plot

        check_plot(plot)
    for file in (out, None if json_file == "-" else json_file, plot, view):
        if file:
            check_writable(file)


def _swept(leg: Leg, postures: Grid, kick: Kick) -> xr.Dataset:
    console = Console(stderr=True)
    columns = (TextColumn("postures"), *Progress.get_default_columns()[1:3], MofNCompleteColumn())
    with Progress(
        *columns,
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task("sweep", total=postures.size)
        return sweep(leg, postures, kick, lambda: bar.advance(task))


def _write(
    data: xr.Dataset,
    lines: Sequence[Line],
    leg: Leg,
    kick: Kick,
    out: str | None,
    plot: str | None,
    view: str | None,
) -> None:
    if out:
        save(data, out)
    if plot:
        from kickdyn.view.sweep_plot import save_figure, sweep_figure

        save_figure(sweep_figure(data, lines), plot)
    if view:
        from kickdyn.view.page import kick_page, write_page

        write_page(view, kick_page(*_shown(lines, kick)))


def _report(leg: Leg, kick: Kick, data: xr.Dataset, lines: Sequence[Line]) -> dict[str, object]:
    return {
        **provenance(leg, kick),
        "postures": data.status.size,
        "status": counts(data),
        "lines": [line.as_json() for line in lines],
    }


def _write_json(file: str, report: dict[str, object]) -> None:
    text = json.dumps(report, indent=2, allow_nan=False) + "\n"
    if file == "-":
        sys.stdout.write(text)
        return
    with replacing(file) as draft:
        draft.write_text(text, encoding="utf-8")


def _print(
    leg: Leg, kick: Kick, data: xr.Dataset, lines: Sequence[Line], files: Sequence[str]
) -> None:
    Console(highlight=False, width=200).print(_table(leg, kick, lines))  # never cuts a number off
    for line in lines:
        if line.why:
            angles = ", ".join(f"{name} {value:.4g}" for name, value in line.angles.items())
            click.echo(fill(f"{line.label} ({angles} deg): {line.why}.", 100))
    said = ", ".join(f"{number} {name}" for name, number in counts(data).items() if number)
    click.echo(f"{data.status.size} postures: {said}.")
    for file in files:
        click.echo(f"wrote {file}")


def _table(leg: Leg, kick: Kick, lines: Sequence[Line]) -> Table:
    flight = "vacuum" if kick.air is None else f"air {kick.air.density:.4g} kg/m3"
    table = Table(
        title=f"{escape(leg.name)}: foot {kick.speed:g} m/s at {math.degrees(kick.attack):g} deg, "
        f"e {kick.restitution:g}, mu {kick.friction:g}, "
        f"ball {kick.ball.mass:g} kg, radius {kick.ball.radius:.4g} m, {flight}",
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1),
    )
    paper = any(line.paper for line in lines)
    for head in (
        "posture",
        escape(f"{' / '.join(leg.joint_names)}\ndeg"),
        "eff. mass\nkg",
        "impulse\nN s",
        "ball /\nfoot",
        "launch\ndeg",
        "spin\nrad/s",
        "carry\nm",
        "worst joint\nN s",
        "immovable\nN s",
        *(("Table 2\nN s",) if paper else ()),
    ):
        table.add_column(head, justify="left" if head == "posture" else "right", no_wrap=True)
    for line in lines:
        n, hit = line.numbers, line.outcome.hit
        angles = " / ".join(f"{value:.4g}" for value in line.angles.values())
        if hit is None:
            table.add_row(line.label, angles, line.outcome.status)
            continue
        table.add_row(
            line.label,
            angles,
            f"{n['effective_mass']:.4g}",
            f"{n['impulse']:.4f}",
            f"{n['speed_ratio']:.4f}",
            f"{math.degrees(n['launch_angle']):.2f}",
            f"{n['spin']:.3f}",
            f"{n['carry']:.4g}",
            escape(hit.worst_joint[0]) + f" {n['worst_joint_impulse']:.4f}",
            f"{n['immovable_impulse']:.4g}",
            *((f"{line.paper:.3f}" if line.paper else "",) if paper else ()),
        )
    return table


def _shown(lines: Sequence[Line], kick: Kick) -> tuple[Impact, Ball, Flight]:
    order = sorted(lines, key=lambda line: line.label != "best")
    for line in order:
        hit = line.outcome.hit
        if hit is not None:
            return hit, kick.ball, fly(hit.ball, kick.ball, kick.air)
    raise InvalidInput("no posture of the grid can kick so: there is nothing to view")


def _serve(lines: Sequence[Line], kick: Kick) -> None:
    from kickdyn.view.live import serve

    with serve(*_shown(lines, kick)) as server:
        click.echo(f"showing the kick at {server.url} (this machine only) until Ctrl-C", err=True)
        with suppress(KeyboardInterrupt):
            threading.Event().wait()


if __name__ == "__main__":
    run(posture_sweep)
