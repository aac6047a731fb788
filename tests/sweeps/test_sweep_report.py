import pytest
from rich.console import Console

import kickdyn as kd
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.run import sweep
from kickdyn.sweeps.summary import best_and_worst, paper_lines
from kickdyn.sweeps.sweep_report import show, table, text

LEG, KICK = kd.Leg.human(), Kick()


@pytest.fixture(scope="module")
def lines():
    data = sweep(LEG, grid(LEG, ["hip=0:10:10", "knee=10"]), KICK)
    from kickdyn.sweeps.opened import Sweep

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
    for joint, values in (("hip", [5, 5, 5, 10, 0]), ("ankle", [-5, 15, 40, 0, 0])):
        (angles,) = [line.split() for line in narrow if line.startswith(f" {joint}, deg")]
        assert angles[-len(lines) :] == [str(value) for value in values]
    (masses,) = [line.split() for line in narrow if "eff. mass, kg" in line]
    assert heads[0] == "posture"
    assert masses[-len(lines) :] == [f"{line.numbers['effective_mass']:.4g}" for line in lines]


def test_prose_fits_a_screen(lines):
    counted, where = (
        {"ok": 3, "too fast": 0, "out of reach": 1},
        ("hip < 5 and " * 9 + "knee > 1", 2),
    )
    for width, most in ((None, 80), (60, 60)):
        said = text(counted, 1e-15, lines, where, *([] if width is None else [width]))
        assert most - 12 < max(map(len, said.splitlines())) <= most
        assert "Best and worst are of the 2 that are ok where hip < 5" in said
        assert "4 postures: 3 ok, 1 out of reach." in said


def test_a_pipe_has_no_width(lines, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    show(LEG, KICK, {"ok": 2}, 1e-15, lines)
    table, prose = capsys.readouterr().out.split("\nbest (")
    assert max(map(len, table.splitlines())) > 80
    assert 60 < max(map(len, prose.splitlines())) <= 80
