import pytest
from rich.console import Console

import kickdyn as kd
from kickdyn.sweep.grid import grid
from kickdyn.sweep.kick import Kick
from kickdyn.sweep.report import show, table
from kickdyn.sweep.run import sweep
from kickdyn.sweep.summary import best_and_worst, paper_lines

LEG, KICK = kd.Leg.human(), Kick()


@pytest.fixture(scope="module")
def lines():
    data = sweep(LEG, grid(LEG, ["hip=0:10:10", "knee=10"]), KICK)
    from kickdyn.sweep.opened import Sweep

    return [*paper_lines(LEG, KICK), *best_and_worst(LEG, Sweep(data), KICK)]


def printed(lines, width):
    console = Console(width=200)
    with console.capture() as captured:
        console.print(table(LEG, KICK, lines, width))
    return captured.get().splitlines()[2:]


def test_a_narrow_screen_has_a_column_per_posture(lines):
    wide, narrow = printed(lines, 200), printed(lines, 80)
    assert max(map(len, wide)) > 80 >= max(map(len, narrow))
    words = " ".join(narrow).split()
    for row in wide[3:]:
        assert set(row.split()) <= set(words), row
    (heads,) = [line.split() for line in narrow if "paper a" in line]
    (masses,) = [line.split() for line in narrow if "eff. mass, kg" in line]
    assert heads[0] == "posture"
    assert masses[-len(lines) :] == [f"{line.numbers['effective_mass']:.4g}" for line in lines]


def test_a_pipe_has_no_width(lines, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    show(LEG, KICK, lines)
    assert max(map(len, capsys.readouterr().out.splitlines())) > 80
