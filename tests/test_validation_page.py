"""Numbers of validation.md, paper.md and the README are those of benchmarks and of items."""

import re
import runpy
from collections import Counter
from pathlib import Path

import pytest
import validation
from shown_numbers import Number, first_missing, numbers_of

import kickdyn as kd
from kickdyn.paper import fig_10, fig_15, table_2, tables_4_5
from kickdyn.paper.assumptions import ALTERNATIVES, DEFAULT

ROOT = Path(__file__).resolve().parent.parent
EXPLANATION = ROOT / "docs" / "explanation"
README, PAPER = (
    " ".join(file.read_text("utf-8").split())
    for file in (ROOT / "README.md", EXPLANATION / "paper.md")
)


def rows(text):
    """Return the cells of the rows of comparisons on a page."""
    lines = text.replace("`", "").splitlines()
    return [line.strip("| ").split(" | ") for line in lines if re.match(r"\| [MAPV]\d+ \|", line)]


MADE = runpy.run_path(str(ROOT / "docs" / "reference_tables.py"))["read"]("explanation/validation")
PAGE, SHORT = rows(MADE), rows((ROOT / "README.md").read_text("utf-8"))


@pytest.mark.slow
def test_rows_have_the_numbers_and_verdicts_of_the_script():
    """All but the row on the flights of the match, which takes long: the next test has some."""
    computed = [
        row for section in validation.PARTS if section != validation.tracked for row in section()
    ]
    for shown in (row for row in (*PAGE, *SHORT) if not re.match("A1|[PV]", row[0])):
        same = [
            row for row in computed if row.number == shown[0] and shown[1] in (row.what, row.short)
        ]
        assert same, shown
        assert first_missing(shown[3], same[0].ours) is None, (shown[3], same[0].ours)
        assert shown[4] == same[0].verdict, shown


def test_the_rules_of_the_verdicts():
    agrees, partly, disagrees = "agrees", "**partly**", "**disagrees**"
    assert validation.within(1, 3, 1, 3) == validation.range_within(1, 3, 1, 3) == agrees
    assert validation.within(1, 3, 0.9, 2) == validation.range_within(1, 3, 0.5, 1) == partly
    assert validation.within(1, 3, 0.9, 3.1) == validation.range_within(1, 3, 0.1, 0.9) == disagrees
    assert validation.range_within(1, 3, 0.5, 4) == partly
    assert validation.close((1.09, 1.0), (0.91, 1.0)) == agrees
    assert validation.close((1.11, 1.0), (0.91, 1.0)) == partly
    assert validation.sign(-0.1, 1) == disagrees


def test_the_readme_repeats_rows_of_the_pages_and_counts_all_of_them():
    """A row with two verdicts counts by the first, which is that of the default."""
    checks = rows((EXPLANATION / "verification.md").read_text("utf-8"))
    pages = {(row[0], *row[2:5]) for row in (*PAGE, *checks)}
    assert {(row[0], *row[2:]) for row in SHORT} <= pages
    verdicts = [row[4] for row in PAGE if row[0][0] in "MA" and row[4] != "fitted"]
    counts = Counter(verdict.split()[0].strip("*,") for verdict in verdicts)
    stated = re.search(r"Of all (\d+) comparisons.*?(\d+) agree, (\d+) .*? (\d+) disagree", README)
    assert [*map(int, stated.groups())] == [
        len(verdicts), counts["agrees"], counts["partly"], counts["disagrees"],
    ]  # fmt: skip


CHOICES = {choice.name: choice for choice in (DEFAULT, *ALTERNATIVES)}
PLAIN, WANG, BOTH = "drag supercritical", "lift wang", "drag supercritical, lift wang"


def worst_of_tables_4_5(choice):
    paths = {row: tables_4_5.kick(row, tables_4_5.fit(choice), choice) for row in
             tables_4_5.PREDICTED}  # fmt: skip
    return 100 * max(abs(path.range / row.experiment - 1) for row, path in paths.items())


STATED = [
    (PAPER, r"difference of the three is (\S+) %.*?, (\S+) % with.*?, and (\S+) % with",
     lambda: [worst_of_tables_4_5(CHOICES[name]) for name in (DEFAULT.name, PLAIN, BOTH)]),
    (README, r"interval, (\S+) to (\S+) m", lambda: tables_4_5.fit(DEFAULT).middle),
    (PAPER, r"The curve is (\S+) m, and (\S+) m with .*? it is (\S+) and (\S+) m",
     lambda: [fig_10.curve(fig_10.flights(CHOICES[name])["right-low"])
              for name in (DEFAULT.name, PLAIN, WANG, BOTH)]),
    (PAPER, r"takes (\d+), (\d+) and (\d+) with .*?, (\d+), (\d+) and (\d+) with the default",
     lambda: [item.ours for name in (DEFAULT.name, PLAIN)
              for item in fig_15.varying(CHOICES[name])]),
    (PAPER, r"minus knee, (\S+) to (\S+) deg, and e, (\S+) to (\S+)\. That",
     lambda: [number.value for number in numbers_of(table_2.items()[0].why)][:4]),
    (PAPER, r"gives more than (\S+) N s in case \(c\)",
     lambda: [kd.normal_impulse(1.0, 0.8, table_2.search(1.0)[1].max(axis=0)[2], 0.45)]),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("page", "pattern", "values"), STATED, ids=[row[1] for row in STATED])
def test_a_sentence_states_the_numbers_of_the_items(page, pattern, values):
    stated = re.search(pattern, page)
    assert stated, pattern
    for text, value in zip(stated.groups(), values(), strict=True):
        (shown,) = numbers_of(text)
        assert shown.agrees(Number("", float(value), 0.0)), (text, value)
