"""The paper on the screen: what fits, what is said once, and what the verdicts mean."""

from collections import defaultdict

import pytest
from rich.console import Console

from kickdyn.paper import paper_report as report
from kickdyn.paper.item import MEANINGS, Item
from kickdyn.paper.paper_report import COLOURS, sensitivity, show


@pytest.fixture(scope="module")
def items(compared):
    return {name: items for name, (items, _) in compared.items()}


@pytest.fixture(scope="module")
def others(compared):
    return {name: others for name, (_, others) in compared.items() if others}


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
    numbers = defaultdict(set)
    for item in (each for section in others.values() for each in section):
        numbers[item.item].add(f"{item.ours:.4g}")
    for shown in (each for each in numbers.values() if len(each) > 1):
        assert shown <= set(words)


def test_a_reason_is_said_once_and_found_by_its_number(items, monkeypatch, capsys):
    monkeypatch.setattr(report, "screen_width", lambda: 120)
    show({"Fig. 9": items["Fig. 9"]}, {})
    lines = capsys.readouterr().out.splitlines()
    reasons = {text for item in items["Fig. 9"] for text in (item.why, *item.notes)}
    assert len(reasons) > 12
    whole = " ".join(" ".join(lines).split())
    assert [whole.count(reason) for reason in reasons] == [1] * len(reasons)
    last = items["Fig. 9"][-1]
    row = next(line for line in lines if line.split()[:3] == ["case", "3", "apex"])
    numbers = row.split()[-1 - len(last.notes) :]
    for number, text in zip(numbers, (last.why, *last.notes), strict=True):
        note = next(line for line in lines if line.split()[:1] == [number])
        assert text.startswith(note.split(maxsplit=1)[1])


def test_the_foot_says_what_the_verdicts_are(items, monkeypatch, capsys):
    monkeypatch.setattr(report, "screen_width", lambda: 200)
    show(items, {})
    said = capsys.readouterr().out
    assert set(MEANINGS) == set(COLOURS)
    for verdict, meaning in MEANINGS.items():
        count = sum(item.verdict == verdict for section in items.values() for item in section)
        assert f"\n{verdict} ({count}): {meaning}\n" in said
    assert "within 10 % of the value of the test bed" in said
    show({"Table 2": items["Table 2"]}, {})
    assert "\nreproduced (" not in capsys.readouterr().out


def test_other_coefficients_have_a_line_each_and_no_number_twice():
    found = [
        Item(f"Fig. 8 {what}", None, ours, "m", "shape-reproduced", "", "", f"drag {number}")
        for number in range(9)
        for what, ours in (("range", 1.25 + number), ("apex", 2.0 * number), ("same", 3.0))
    ] + [
        Item("Fig. 8 again", None, 1.25 + number, "m", "shape-reproduced", "", "", f"drag {number}")
        for number in range(9)
    ]
    table = sensitivity("Fig. 8", found)
    assert [column.header for column in table.columns] == [
        "coefficients",
        "range \\[m]",
        "apex \\[m]",
    ]
    assert table.row_count == 9
    with (console := Console(width=60, highlight=False)).capture() as said:
        console.print(table)
    assert "drag 8" in said.get()
