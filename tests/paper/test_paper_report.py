"""The paper on the screen: what fits, what is said once, and what the verdicts mean."""

import pytest
from rich.console import Console

from kickdyn.paper import paper_report as report
from kickdyn.paper.item import MEANINGS, Item
from kickdyn.paper.paper_report import COLOURS, sensitivity, show
from kickdyn.paper.reproduce import SECTIONS


@pytest.fixture(scope="module")
def items():
    return {section.name: section.items() for section in SECTIONS}


@pytest.fixture(scope="module")
def others():
    return {section.name: section.sensitivity() for section in SECTIONS if section.sensitivity}


@pytest.mark.parametrize("width", [80, 200])
def test_it_fits_and_no_number_is_cut(items, others, width, monkeypatch, capsys):
    monkeypatch.setattr(report, "screen_width", lambda: width)
    show(items, others)
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= width
    assert "\u2026" not in said
    words = said.split()
    for item in (each for section in items.values() for each in section):
        assert f"{item.ours:.5g}" in words
        assert item.difference in said
    for item in (each for section in others.values() for each in section):
        assert f"{item.ours:.4g}" in words


def test_a_reason_is_said_once_and_found_by_its_number(items, monkeypatch, capsys):
    monkeypatch.setattr(report, "screen_width", lambda: 80)
    show({"Fig. 9": items["Fig. 9"]}, {})
    lines = capsys.readouterr().out.splitlines()
    reasons = {item.why for item in items["Fig. 9"]}
    whole = " ".join(" ".join(lines).split())
    assert [whole.count(reason) for reason in reasons] == [1] * len(reasons)
    row = next(line for line in lines if line.split()[:3] == ["case", "3", "apex"])
    note = next(line for line in lines if line.split()[:1] == row.split()[-1:])
    assert items["Fig. 9"][-1].why.startswith(note.split(maxsplit=1)[1])


def test_the_foot_says_what_the_verdicts_are(items, monkeypatch, capsys):
    monkeypatch.setattr(report, "screen_width", lambda: 200)
    show(items, {})
    said = capsys.readouterr().out
    assert set(MEANINGS) == set(COLOURS)
    for verdict, meaning in MEANINGS.items():
        assert f"\n{verdict}: {meaning}\n" in said
    assert "within 10 % in Tables 4-5" in said
    show({"Table 2": items["Table 2"]}, {})
    assert "\nreproduced: " not in capsys.readouterr().out


def test_other_coefficients_have_a_line_each():
    found = [
        Item(f"Fig. 8 {what}", None, 1.25, "m", "shape-reproduced", "", "", f"drag {number}")
        for number in range(9)
        for what in ("range", "apex")
    ]
    table = sensitivity("Fig. 8", found)
    assert [column.header for column in table.columns] == ["coefficients", "range, m", "apex, m"]
    assert table.row_count == 9
    with (console := Console(width=60, highlight=False)).capture() as said:
        console.print(table)
    assert "drag 8" in said.get()
