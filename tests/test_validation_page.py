"""The tables of validation.md and README.md are the output of benchmarks/validation.py."""

import csv
import math
import re
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.paper import fig_9, fig_10, fig_15, table_2, tables_4_5
from kickdyn.paper.assumptions import ALTERNATIVES, DEFAULT
from kickdyn.paper.reproduce import SECTIONS

ROOT = Path(__file__).resolve().parent.parent
PAGE, README = ROOT / "docs" / "explanation" / "validation.md", ROOT / "README.md"
VERIFICATION = ROOT / "docs" / "explanation" / "verification.md"
BENCHMARKS = ROOT / "benchmarks"


def rows(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    row = re.compile(r"\| [MAPV]\d+ \|( .* \|){3}")
    return [line for line in lines if row.match(line)]


def with_assumptions():
    """Return the lines of the rows of validation.csv, which have no line breaks inside."""
    return PAGE.with_suffix(".csv").read_text(encoding="utf-8").splitlines()


@pytest.mark.skipif(not BENCHMARKS.exists(), reason="benchmarks come with the checkout only")
def test_the_rows_are_those_of_the_script(monkeypatch):
    """All but the row on the flights of the match, which takes long: the next test has some."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import validation

    try:
        found = [row for part in validation.PARTS if part != validation.tracked for row in part()]
    finally:
        for name in ("validation", "compliance", "inflated_ball", "foot_patch"):
            sys.modules.pop(name, None)
    page = [line for line in rows(PAGE) if not re.match(r"\| (A1|[PV]\d) \|", line)]
    assert validation.lines(found)[2:] == page
    assert validation.csv_text(found).splitlines() == [
        line for line in with_assumptions() if not line.startswith("A1,")
    ]
    readme = [line for line in rows(README) if not re.match(r"\| (A1|[PV]\d) \|", line)]
    assert validation.short_lines(found) == readme


@pytest.mark.skipif(not BENCHMARKS.exists(), reason="benchmarks come with the checkout only")
def test_the_rows_on_flights_of_the_match(monkeypatch):
    """The two flights with the smallest and the largest drag coefficient."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import validation

    try:
        flights = validation.long_flights()
    finally:
        for name in ("validation", "compliance", "inflated_ball", "foot_patch"):
            sys.modules.pop(name, None)
    low, high = (kd.identify(flights[i], kd.Ball()).values["drag"] for i in (3, 4))
    (drags,) = [line for line in rows(PAGE) if line.startswith("| A1 |")]
    fitted = f"{low:.3f} to {high:.3f} fitted by `kd.identify` (n = {len(flights)})"
    assert f"| 0.2 (default); {fitted} |" in drags
    assert any(f"| 0.2 (default); {fitted} |" in line for line in rows(README))


@pytest.mark.skipif(not BENCHMARKS.exists(), reason="benchmarks come with the checkout only")
def test_the_rules_of_the_verdicts(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import validation

    try:
        found = [validation.within(1, 3, *values) for values in ((1, 3), (0.9, 2), (0.9, 3.1))] + [
            validation.range_within(1, 3, *ends)
            for ends in ((1, 3), (0.5, 1), (2, 4), (0.5, 4), (0.1, 0.9), (3.1, 4))
        ]
        assert validation.close((1.09, 1.0), (0.91, 1.0)) == "agrees"
        assert validation.close((1.11, 1.0), (0.91, 1.0)) == "**partly**"
        assert validation.sign(-0.1, 1) == "**disagrees**"
    finally:
        for name in ("validation", "compliance", "inflated_ball", "foot_patch"):
            sys.modules.pop(name, None)
    partly, disagrees = "**partly**", "**disagrees**"
    assert found == ["agrees", partly, disagrees, "agrees", *[partly] * 3, disagrees, disagrees]


def test_every_row_that_does_not_agree_has_its_assumptions():
    """A number has them once, at its first row."""
    table = list(csv.DictReader(with_assumptions()))
    numbers = {f"M{k}" for k in (*range(1, 11), *range(12, 17))} | {"A1", "A3"}
    assert {row["row"] for row in table} == numbers
    assert numbers == {line.split()[1] for line in rows(PAGE)} - {"P1", "P4"}
    noted = {row["row"] for row in table if row["assumptions"]}
    for row in table:
        if "disagrees" in row["verdict"] or "partly" in row["verdict"]:
            assert row["row"] in noted, row


def test_the_readme_repeats_rows_of_the_page_and_counts_all_of_them():
    """A row with two verdicts counts by the first, which is that of the default."""
    page = [line.strip("| ").split(" | ") for line in rows(PAGE)]
    verified = [line.strip("| ").split(" | ") for line in rows(VERIFICATION)]
    given = {(row[0], *row[2:5]) for row in (*page, *verified)}
    chosen = [line.strip("| ").split(" | ") for line in rows(README)]
    assert {(row[0], *row[2:]) for row in chosen} <= given
    measured, shown = (
        [row[4].split()[0].strip("*,") for row in table if row[0][0] in "MA" and row[4] != "fitted"]
        for table in (page, chosen)
    )
    counts = Counter(measured)
    text = " ".join(README.read_text("utf-8").split())
    assert (
        f"Of all {len(measured)} comparisons with measurements, {counts['agrees']} agree, "
        f"{counts['partly']} agree in part and {counts['disagrees']} disagree; in "
        f"{counts['same']}, only the sign of a trend is known, and agrees."
    ) in text
    for verdict in ("partly", "disagrees"):
        assert shown.count(verdict) / len(shown) >= counts[verdict] / len(measured)


def row_of(number):
    (row,) = [line for line in rows(PAGE) if line.startswith(f"| {number} |")]
    return [cell.strip() for cell in row.strip("|").split("|")]


def test_the_row_on_table_2():
    attack = [math.cos(math.radians(30)), 0, math.sin(math.radians(30))]
    postures = [kd.Leg.human().posture(np.radians([5, 10, ankle])) for ankle in (-5, 15, 40)]
    ours = [kd.normal_impulse(1.0, 0.8, posture.effective_mass(attack)) for posture in postures]
    _, _, reference, shown, difference = row_of("P1")
    assert shown == ", ".join(f"{value:.3f}" for value in ours) + " N s"
    printed = [float(value) for value in reference.removesuffix(" N s").split(", ")]
    worst = max(abs(value / paper - 1) for value, paper in zip(ours, printed, strict=True))
    assert difference.startswith(f"≤ {100 * worst:.2f} %,")


def test_the_row_on_tables_4_and_5():
    ours = {item.item: item for section in SECTIONS for item in section.items()}
    predicted = [ours[f"{row.name} distance"] for row in tables_4_5.PREDICTED]
    assert ", ".join(f"{item.ours:.2f}" for item in predicted) in row_of("P4")[3]
    choices = {choice.name: choice for choice in (DEFAULT, *ALTERNATIVES)}
    worst = [
        100 * max(
            abs(tables_4_5.kick(row, tables_4_5.fit(choice), choice).range / row.experiment - 1)
            for row in tables_4_5.PREDICTED
        )
        for choice in (
            DEFAULT, choices["drag supercritical"], choices["drag supercritical, lift wang"]
        )
    ]  # fmt: skip
    assert row_of("P4")[4] == (
        f"≤ {worst[0]:.2f} %; ≤ {worst[1]:.2f} % with the default drag, ≤ {worst[2]:.2f} % with "
        "that and lift `wang`"
    )
    paper = " ".join((PAGE.parent / "paper.md").read_text("utf-8").split())
    assert (
        f"is {worst[0]:.1f} % with the drag `brazuca`, {worst[1]:.1f} % with the default drag, and "
        f"{worst[2]:.1f} % with that and the lift `wang`"
    ) in paper
    least, most = tables_4_5.fit(DEFAULT).middle
    readme = " ".join(README.read_text("utf-8").split())
    assert f"give {least:.1f} to {most:.1f} m at 40 deg" in paper
    assert f"the interval, {least:.1f} to {most:.1f} m, that the two fitted distances" in readme
    squares = [7.5 * (v / 2.2) ** 2 / measured - 1 for v, measured in ((2.0, 6.3), (1.8, 5.3))]
    assert f"{100 * squares[0]:.1f} and {100 * squares[1]:.1f} %" in paper
    assert f"gives the other two within {-100 * squares[1]:.1f} %" in readme


def test_the_page_of_the_paper_has_the_numbers_of_the_items():
    """Its sentences on Figs. 9 to 15 and Table 2, also with the models of `kd.Air()`."""
    paper = " ".join((PAGE.parent / "paper.md").read_text("utf-8").split())
    choices = {choice.name: choice for choice in (DEFAULT, *ALTERNATIVES)}
    default = choices["drag supercritical"]
    assert (default.air().drag, default.air().lift) == (kd.Air().drag, kd.Air().lift)
    curves = [
        fig_10.curve(fig_10.flights(choice)["right-low"])
        for choice in (DEFAULT, default, choices["lift wang"],
                       choices["drag supercritical, lift wang"])
    ]  # fmt: skip
    assert (
        "The curve is {:.2f} m, and {:.2f} m with the default drag; with the lift `wang` it is "
        "{:.2f} and {:.2f} m."
    ).format(*curves) in paper
    ranges = [path.range for path in fig_9.flights(default)]
    assert f"the three ranges differ by {max(ranges) - min(ranges):.2f} m" in paper
    rounds = {
        choice.name: [item.ours for item in fig_15.varying(choice)]
        for choice in (DEFAULT, *ALTERNATIVES)
    }
    first, second = (rounds[choice.name] for choice in (DEFAULT, default))
    others = [count for counts in rounds.values() for count in counts]
    assert (
        f"takes {first[0]}, {first[1]} and {first[2]} with the drag `brazuca`, {second[0]}, "
        f"{second[1]} and {second[2]} with the default, and between {min(others)} and {max(others)}"
    ) in paper
    items = {item.item: item for item in table_2.items()}
    with_ball = items["Table 2 least error, with the ball"]
    assert "no posture has the ratios of the three totals within 15 %" in paper
    assert 15 < with_ball.ours < 16
    largest = kd.normal_impulse(1.0, 0.8, table_2.search(1.0)[1].max(axis=0)[2], 0.45)
    assert f"no hip and knee angle gives more than {largest:.2f} N s in case (c)" in paper
    assert "the least error of the totals is 0.04 %" in paper
    assert "without the ball's term it is 0.04 %" in with_ball.why
