"""Measure errors and times, and write them and their pictures into docs.

The pages are docs/explanation/accuracy.md, docs/explanation/extremes.md and
docs/reference/accuracy-tables.md.

    python benchmarks/accuracy_page.py

It takes a minute and a half of processor time. Errors do not depend on the machine, times do.
"""

import os
import platform
import re
import resource
import sys
import time
from collections.abc import Iterable, Sequence
from importlib import metadata
from pathlib import Path

from flight_methods import TOLERANCES, measure_flights
from heyoka_flight import heyoka_methods
from impact_methods import measure_impacts
from measurement import Measurement, front_figure

from kickdyn.air import Air
from kickdyn.ball import Ball

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from extremes.extreme_case import NOT_FINITE, ExtremeCase
from extremes.extremes_report import cells, condition_figure, extreme_cases, summary
from extremes.gains import Gain, gains

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"

PACKAGES = ("numpy", "scipy", "pin", "mpmath", "mujoco", "heyoka")

USUAL = "1e+05 N/m, dt 0.001 s"
"""A usual setting of MuJoCo."""

TOLERANCE = "tol 1e-09"
"""The setting of the flights in the short table."""


def table(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown, numbers to the right."""
    listed = list(lines)
    right = [
        all(re.match(r"[\d.*]*(e[-+]\d+)?$", line[i]) for line in listed) for i in range(len(heads))
    ]
    rule = "|".join(" ---: " if one else " --- " for one in right)
    text = [f"| {' | '.join(heads)} |", f"|{rule}|"]
    return "\n".join(text + [f"| {' | '.join(line)} |" for line in listed])


def impact_table(found: Sequence[Measurement]) -> str:
    """Return the impacts, times relative to kickdyn's closed form."""
    lines = []
    for row in found:
        ours = next(o.seconds for o in found if o.scene == row.scene and o.method == "closed form")
        setting = row.setting or "-"
        front = "*" if row.pareto else ""
        ratio = f"{row.seconds / ours:.2g}"
        lines.append((row.scene, row.method, setting, f"{row.error:.1e}", ratio, front))
    return table(("kick", "method", "setting", "error", "time", "front"), lines)


def flight_table(found: Sequence[Measurement]) -> str:
    """Return the flights, times relative to the fastest of their scene."""
    lines = []
    for row in found:
        fastest = min(other.seconds for other in found if other.scene == row.scene)
        lines.append(
            (
                row.scene, row.method, row.setting.removeprefix("tol ") or "-", f"{row.error:.1e}",
                f"{row.calls:.0f}", f"{row.seconds / fastest:.2g}",
                "*" if row.pareto else "",
            )
        )  # fmt: skip
    return table(("scene", "method", "tol", "error [m]", "calls", "time", "front"), lines)


def short_flight_table(found: Sequence[Measurement]) -> str:
    """Return the flights with all effects at one tolerance, times relative to `kd.fly_many`."""
    rows = [row for row in found if (row.scene, row.setting) == ("full", TOLERANCE)]
    ours = next(row.seconds for row in rows if row.method == "kd.fly_many")
    lines = [(f"`{row.method}`", f"{row.error:.1e}", f"{row.seconds / ours:.2g}") for row in rows]
    return table(("method", "error [m]", "time"), lines)


def extremes_table(found: Sequence[ExtremeCase]) -> str:
    """Return the extremes; arguments that are not finite are counted."""
    heads = ("case", "worst error", "condition", "error", "digits", "allowed", "of", "verdict")
    shown = [cells(row) for row in found if row.family != NOT_FINITE]
    lines = [[line[0], *(cell or "-" for cell in line[1:])] for line in shown]
    refused = sum(row.family == NOT_FINITE for row in found)
    lines.append(["NaN, inf, Reynolds number 0", *["-"] * 6, f"{refused} refused"])
    return table(heads, lines)


def gains_table(found: Sequence[Gain], first: str, second: str) -> str:
    """Return two formulas side by side."""
    lines = ((g.what, g.plain, f"{g.plain_error:.1e}", g.ours, f"{g.our_error:.1e}") for g in found)
    return table(("what", first, "error", second, "error"), lines)


def kick_table(found: Sequence[Measurement]) -> str:
    """Return the paper's kick in short: kickdyn, MuJoCo as usual and at its most exact."""
    smooth = [row for row in found if row.scene == "frictionless"]
    ours = next(row for row in smooth if row.method == "closed form")
    engine = [row for row in smooth if row.method == "MuJoCo"]
    chosen = {
        "`kd.strike`": ours,
        f"MuJoCo, {USUAL}": next(row for row in engine if row.setting == USUAL),
    }
    best = min(engine, key=lambda row: row.error)
    chosen[f"MuJoCo, {best.setting}"] = best
    lines = [
        (
            name,
            "< 1e-15" if row.error < 1e-15 else f"{row.error:.1e}",
            f"{row.seconds / ours.seconds:.2g}",
        )
        for name, row in chosen.items()
    ]
    return table(("the paper's kick, impulse", "relative error", "time"), lines)


def machine(began: float) -> str:
    """Return where and with what all of it was measured, and what it took."""
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in PACKAGES)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20  # KiB on Linux
    return (
        f"The numbers are those of one run on {os.cpu_count()} CPUs ({platform.machine()}) with "
        f"Python {platform.python_version()}, {versions}. It took {time.process_time() - began:.0f}"
        f" s of CPU and {most:.1f} GiB of memory, which the chain of 500 joints needs."
    )


def write(page: Path, filled: dict[str, str]) -> None:
    """Put blocks between their marks."""
    text = page.read_text(encoding="utf-8")
    for name, block in filled.items():
        mark = f"<!-- {name} -->"
        if text.count(mark) != 2:
            raise RuntimeError(f"{page.name} has no place for {name}")
        before, _, after = text.split(mark)
        text = f"{before}{mark}\n{block}\n{mark}{after}"
    page.write_text(text, encoding="utf-8")


def main() -> None:
    """Write the pages."""
    began = time.process_time()
    heyoka = heyoka_methods(Ball(), Air(drag="brazuca"), TOLERANCES)
    impacts, flights = measure_impacts(), measure_flights(further_integrators=heyoka)
    found = list(extreme_cases())
    for file, figure in (
        ("tradeoff.png", front_figure(impacts, flights)),
        ("extremes.png", condition_figure(found)),
    ):
        figure.savefig(DOCS / "images" / file, dpi=80)
    explanation, reference = DOCS / "explanation", DOCS / "reference"
    short = {"kick": kick_table(impacts), "flights": short_flight_table(flights)}
    write(explanation / "accuracy.md", short)
    formulas = gains_table(gains(), "the plain formula", "kickdyn's")
    write(explanation / "extremes.md", {"summary": summary(found) + ".", "gains": formulas})
    write(
        reference / "accuracy-tables.md",
        {
            "impact": impact_table(impacts),
            "flight": flight_table(flights),
            "extremes": extremes_table(found),
            "machine": machine(began),
        },
    )


if __name__ == "__main__":
    main()
