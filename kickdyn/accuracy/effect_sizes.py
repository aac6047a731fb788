"""Models: what each physical effect of a scene is worth, at the impact and where the ball ends."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kickdyn.accuracy.error_plots import worth_picture
from kickdyn.core.console import empty_table, screen_width
from kickdyn.core.files import check_outputs, write_json
from kickdyn.errors import KickdynError
from kickdyn.scene.effects import EFFECTS
from kickdyn.scene.flight_end import ENDS
from kickdyn.scene.scene import Scene
from kickdyn.scene.simulate import simulate
from kickdyn.scene.simulation import Simulation
from kickdyn.scene.toml_reader import load_scene
from kickdyn.sweeps.sweep_plot import check_name, save_figure

TOLERANCE = 0.05
"""What `simulate` answers to unless told; a line in the picture [m]."""


@dataclass(frozen=True)
class Worth:
    """What leaving one effect out changes, everything else modelled.

    Attributes:
        effect: its name.
        end: distance that the end of the ball's way moves [m]; nan where there is no answer.
        impulse: magnitude of the change of the impulse on the ball [N s]; likewise.
        why_not: why there is none.
    """

    effect: str
    end: float
    impulse: float
    why_not: str = ""


def worths(
    scene: Scene, told: Callable[[str], None] | None = None, whole: Simulation | None = None
) -> list[Worth]:
    """Measure every effect that a scene names, the largest first.

    Args:
        scene: the kick.
        told: called with each effect's name as it begins.
        whole: its simulation with everything modelled, where that is there already.

    Raises:
        KickdynError: as of `simulate`, for the scene as it is.
    """
    whole = simulate(scene, None) if whole is None else whole
    rows = []
    for effect in EFFECTS:
        if not effect.is_in(scene):
            continue
        if told is not None:
            told(effect.name)
        try:
            less = simulate(effect.without(scene, whole.launch), None)
        except KickdynError as error:
            rows.append(Worth(effect.name, math.nan, math.nan, str(error)))
            continue
        impulse = float(np.linalg.norm(less.impact.impulse - whole.impact.impulse))
        endless = [end.status for end in (whole, less) if end.status not in ENDS]
        if endless:
            rows.append(Worth(effect.name, math.nan, impulse, f"no end: {endless[0]}"))
            continue
        moved = float(np.linalg.norm(less.end.position - whole.end.position))
        rows.append(Worth(effect.name, moved, impulse))
    return sorted(rows, key=lambda row: -row.end if row.end == row.end else math.inf)


def show(file: str, json_file: str | None = None, plot: str | None = None) -> None:
    """Print the effects of a scene file and what each is worth, draw them, or write them as JSON.

    Args:
        file: the scene.
        json_file: where the JSON goes, `-` is stdout; None, none.
        plot: where the picture goes; None, none.

    Raises:
        InvalidInput: the scene, or where JSON or picture are to go, cannot be used.
    """
    if plot is not None:
        check_name(plot)
    check_outputs(plot, json_file=json_file)
    scene = load_scene(file)
    whole = simulate(scene, None)
    with Console(stderr=True).status("measuring") as status:
        rows = worths(scene, lambda name: status.update(f"measuring {name}"), whole)
    if plot is not None:
        save_figure(worth_picture(scene.name, rows, TOLERANCE), plot)
    if json_file is not None:
        write_json(json_file, _document(whole, rows))
        if json_file == "-":
            return
    x, y, z = whole.end.position.round(3) + 0.0  # no -0
    console = Console(highlight=False, width=screen_width())
    ended = whole.status if whole.status in ENDS else f"NO END, given up {whole.status}"
    console.print(
        f"{scene.name}: {np.linalg.norm(whole.impact.impulse):.4g} N s, {ended} at "
        f"({x:.3f}, {y:.3f}, {z:.3f}) m. What leaving one effect out changes:",
        markup=False,
    )
    console.print(_table(rows))
    for note in scene.notes:
        console.print(f"note: {note}", markup=False)


def _document(whole: Simulation, rows: list[Worth]) -> dict[str, Any]:
    """Return what JSON can hold: nan is null."""
    listed = [dataclasses.asdict(row) for row in rows]
    for row in listed:
        row |= {name: None for name in ("end", "impulse") if math.isnan(row[name])}
    return {
        "scene": whole.scene.name,
        "status": whole.status,
        "end": whole.end.position.tolist(),
        "impulse": whole.impact.impulse.tolist(),
        "units": {"end": "m", "impulse": "N s"},
        "effects": listed,
    }


def _table(rows: list[Worth]) -> Table:
    table = empty_table("")
    table.add_column("effect")
    for head in ("end moves m", "impulse changes N s"):
        table.add_column(head, justify="right")
    table.add_column("")
    for row in rows:
        cells = ("" if math.isnan(value) else f"{value:.3g}" for value in (row.end, row.impulse))
        table.add_row(row.effect, *cells, escape(row.why_not))
    return table
