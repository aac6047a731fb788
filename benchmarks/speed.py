"""Measure the times in README.md and docs/how-to/which-function.md, and write their tables.

    python benchmarks/speed.py [tables | first NAME]

The rows are those of `kickdyn tradeoff`, with `plan_kick` and two settings of MuJoCo beside them;
times are processor times of one core, the shortest of several runs. The first use is the first call
in a process that finds no machine code on the disk (`first` prints it for one function). All is
stored in docs/speed.json, and docs/images/functions.png is drawn; `tables` only writes the tables
again.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import kickdyn as kd
from kickdyn.cli.function_costs import (
    EXACT,
    FRICTION,
    cost_figure,
    functions,
    kick,
    measure_functions,
)
from kickdyn.core.plot_style import save_figure

ROOT = Path(__file__).resolve().parents[1]
STORED = ROOT / "docs" / "speed.json"
PICTURE = ROOT / "docs" / "images" / "functions.png"
BARE = "pin.impulseDynamics, bare"
COMPILED = "strike_many", "sweep", "collide_many", "fly_many", "follow_many", "simulate_many"
STIFF, SOFT = "MuJoCo, 1e7 N/m", "MuJoCo, 1e5 N/m"

README_ROWS = (
    ("`strike`: impact with the impulses in all joints", "strike"),
    ("`strike_many`: the same, per strike in a batch of 10,000", "strike_many"),
    ("`sweep`: impact and flight of each posture", "sweep"),
    ("`fly`: flight with drag and lift", "fly"),
    ("`fly_many`: the same, per flight in a batch of 10,000", "fly_many"),
    ("`collide`: contact of finite time", "collide"),
    ("`plan_kick`: kick for a target", "plan_kick"),
)
"""What is computed, and by which function."""

PAGE_ROWS = (
    ("one impact, with the impulses in all joints", "kd.strike", "strike",
     "{} of the impulse, against 50 digits"),
    ("many impacts of one leg: arrays for learning, or their derivatives", "kd.strike_many",
     "strike_many", "{} of the impulse, against 50 digits"),
    ("impact and flight from every posture of a grid", "kd.sweep", "sweep",
     "{} of the impulse, against 50 digits; carry within 1e-6 m"),
    ("how much the contact time matters", "kd.collide", "collide",
     "{} of the impulse, against `tol=1e-12`"),
    ("the same for many contacts of one leg", "kd.collide_many", "collide_many",
     "{} of the impulse, likewise"),
    ("one flight", "kd.fly", "fly", "{} of its length, against `tol=1e-13`"),
    ("many flights", "kd.fly_many", "fly_many", "{} of their lengths, likewise"),
    ("bounces and rolling, one ball", "kd.follow", "follow", "{} of the distance, likewise"),
    ("bounces and rolling, many balls", "kd.follow_many", "follow_many",
     "{} of the distance, likewise"),
    ("a whole kick to a tolerance, with a contact that takes time", "kd.simulate", "simulate",
     "`answer.error`, within the tolerance"),
    ("the scatter of a whole kick", "kd.simulate_many", "simulate_many",
     "`many.model_error`, and the error of the Monte Carlo method"),
    ("a frictionless impulse alone, no checks", "pin.impulseDynamics", BARE,
     "{} of the impulse, against 50 digits"),
    ("contacts in a simulation of everything else, at 1e7 N/m and steps of 10 µs", "", STIFF,
     "{} of the impulse, against 50 digits"),
    ("the same at 1e5 N/m and steps of 1 ms", "", SOFT, "{} of the impulse, likewise"),
)  # fmt: skip
"""Question, function, its name among the figures, and what its error is relative to."""


def shown(value: float) -> str:
    """Return a time with two digits and its unit."""
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("µs", 1e6), ("ns", 1e9)):
        if value * scale >= 1 or unit == "ns":
            return f"{float(f'{value * scale:.2g}'):g} {unit}"
    raise AssertionError


def readme_table(stored: dict[str, Any]) -> str:
    """Return the table of README.md."""
    figures, lines = (
        stored["functions"],
        ["| Computation | Time | Rows alike | Over `impulseDynamics` |", "|---|---:|---:|---:|"],
    )
    for what, name in README_ROWS:
        seconds = figures[name]["seconds"]
        ratio = seconds / figures[BARE]["seconds"]
        least = float(f"{max(ratio, 1.0 / ratio):.2g}")
        over = f"{least:g}" if ratio > 1.0 else f"1/{least:g}"
        alike = shown(figures[name]["alike"]) if "alike" in figures[name] else ""
        lines.append(f"| {what} | {shown(seconds)} | {alike} | {over} |".replace("|  |", "| |"))
    return "\n".join(lines)


def page_table(stored: dict[str, Any]) -> str:
    """Return the table of which-function.md."""
    lines = [
        "| Question | Function | Error by rounding and integration | Cost | Rows alike "
        "| First use |",
        "|---|---|---|---:|---:|---:|",
    ]
    for question, call, name, error in PAGE_ROWS:
        figure = stored["functions"][name]
        called, first = f"`{call}`" if call else "MuJoCo", figure.get("first")
        size = f"{figure['rounding']:.0e}".replace("e-0", "e-") if "{}" in error else ""
        given = error.format(size)
        begins = shown(float(f"{first:.1g}")) if first else ""
        alike = shown(figure["alike"]) if "alike" in figure else ""
        columns = question, called, given, shown(figure["seconds"]), alike, begins
        lines.append(f"| {' | '.join(columns)} |".replace("|  |", "| |").replace("|  |", "| |"))
    return "\n".join(lines)


TABLES: dict[str, Callable[[dict[str, Any]], str]] = {
    "README.md": readme_table,
    "docs/how-to/which-function.md": page_table,
}
"""By page, what makes its table."""


def with_table(text: str, table: str) -> str:
    """Return a page with its table, which begins with the same words, written anew."""
    begins = re.escape(table.split("|")[1].strip())
    new, count = re.subn(rf"^\| {begins} \|.*?\n(?!\|)", table + "\n", text, flags=re.M | re.S)
    assert count == 1
    return new


def first_use(name: str) -> float:
    """Return the processor time of the first call of a function in this process [s]."""
    for measured in functions():
        if measured.name == name:
            began = time.process_time()
            measured.run()
            return time.process_time() - began
    raise KeyError(name)


def first_on_a_machine(name: str) -> float:
    """Return the processor time of the first call of a function on a machine [s]."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, __file__, "first", name], check=True, capture_output=True, text=True,
            env={**os.environ, "NUMBA_CACHE_DIR": folder},
        )  # fmt: skip
    return float(done.stdout)


def planned() -> float:
    """Return the processor time of `plan_kick` [s]."""
    least = np.inf
    for _ in range(6):
        began = time.process_time()
        kd.plan_kick(kd.Leg.human(), kd.Goal(30, time=1.5), kd.Ball(), kd.Air())
        least = min(least, time.process_time() - began)
    return float(least)


def mujoco_figures() -> dict[str, dict[str, float]]:
    """Return time and error of a contact in MuJoCo, stiff with short steps and soft with long."""
    from measurement import shortest_time
    from mujoco_comparison import mujoco_kick

    exact, figures = np.array(EXACT[FRICTION]), {}
    for name, stiffness, dt in ((STIFF, 1e7, 1e-5), (SOFT, 1e5, 1e-3)):
        run = mujoco_kick(kick(FRICTION), stiffness, dt)
        error = float(np.linalg.norm(run() - exact) / np.linalg.norm(exact))
        figures[name] = {"seconds": shortest_time(run), "rounding": error}
    return figures


def machine() -> str:
    """Return the name of the processor, as Linux has it."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))


def measure() -> dict[str, Any]:
    """Return all figures, with errors that do not apply left out."""
    figures: dict[str, dict[str, float]] = {}
    rows = measure_functions(lambda name: print(name, flush=True))
    save_figure(cost_figure(rows), str(PICTURE))
    for row in rows:
        figures[row.function] = {"seconds": row.seconds}
        for key, value in (("rounding", row.rounding), ("alike", row.seconds_alike)):
            if value == value:
                figures[row.function][key] = value
    figures["plan_kick"] = {"seconds": planned()}
    figures |= mujoco_figures()
    for name in COMPILED:
        figures[name]["first"] = first_on_a_machine(name)
    rounded = {
        name: {key: float(f"{value:.3g}") for key, value in figure.items()}
        for name, figure in figures.items()
    }
    return {"machine": machine(), "functions": rounded}


def main() -> None:
    """Measure and store, unless only the tables are asked for; write the tables."""
    if sys.argv[1:2] == ["first"]:
        print(first_use(sys.argv[2]))
        return
    if sys.argv[1:] != ["tables"]:
        STORED.write_text(json.dumps(measure(), indent=1) + "\n")
    stored = json.loads(STORED.read_text())
    for page, table in TABLES.items():
        path = ROOT / page
        path.write_text(with_table(path.read_text("utf-8"), table(stored)), "utf-8")


if __name__ == "__main__":
    main()
