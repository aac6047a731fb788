"""The snippets of the README print the outputs that it shows, and its table is recomputed."""

import contextlib
import io
import math
import re
import shlex
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from references.exact_impact import exact_impact, given

import kickdyn as kd
from kickdyn.accuracy.impact_methods import kick
from kickdyn.cli.posture_sweep_command import posture_sweep
from kickdyn.paper import tables_4_5
from kickdyn.paper.reproduce import SECTIONS

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)
PAIRS = [
    (code, expected)
    for (kind, code), (next_kind, expected) in pairwise(BLOCKS)
    if kind == "python" and next_kind == "text"
]
COMMANDS = [
    expected
    for kind, expected in BLOCKS
    if kind == "text" and expected.startswith("$ kickdyn posture-sweep")
]


def test_the_readme_has_snippets_and_commands():
    assert PAIRS
    assert COMMANDS


@pytest.mark.parametrize(("code", "expected"), PAIRS)
def test_snippets_print_the_outputs_shown(code, expected):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.chdir(ROOT):
        exec(compile(code, "README.md", "exec"), {})
    assert printed.getvalue().strip() == expected.strip()


@pytest.mark.parametrize("block", COMMANDS)
def test_commands_print_the_outputs_shown(block):
    command, expected = block.split("\n", 1)
    arguments = shlex.split(command.removeprefix("$ kickdyn posture-sweep"))
    result = CliRunner().invoke(posture_sweep, arguments)
    assert [line.rstrip() for line in result.output.strip().splitlines()] == [
        line.rstrip() for line in expected.strip().splitlines()
    ]


def test_the_posture_sweep_module_is_named_once_and_the_script_elsewhere():
    assert re.findall(r"python -m (\S+?)`", README) == ["kickdyn.posture_sweep"]
    assert README.count("python -m kickdyn") == 1


def test_make_targets_exist():
    for target in re.findall(r"^make (\w+)", README, re.MULTILINE):
        ended = subprocess.run(["make", "-n", target], cwd=ROOT, capture_output=True, text=True)
        assert ended.returncode == 0, ended.stderr


def test_pictures_and_links_exist():
    for link in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / link).exists(), link


def table_2(ankle_deg):
    attack = [math.cos(math.radians(30)), 0, math.sin(math.radians(30))]
    posture = kd.Leg.human().posture(np.radians([5, 10, ankle_deg]))
    return kd.normal_impulse(1.0, 0.8, posture.effective_mass(attack))


RECOMPUTED = {
    "Table 2 a": lambda: table_2(-5),
    "Table 2 b": lambda: table_2(15),
    "Table 2 c": lambda: table_2(40),
}


@pytest.mark.parametrize("item", RECOMPUTED)
def test_the_table_of_validation(item):
    row = next(line for line in README.splitlines() if line.startswith(f"| {item}"))
    reference, ours, difference = (cell.strip() for cell in row.split("|")[2:5])
    value = RECOMPUTED[item]()
    printed = ours.split()[0]
    assert f"{value:.{len(printed.partition('.')[2])}f}" == printed
    percent = 100 * (value / float(reference.split()[0]) - 1)
    assert f"{percent:+.2f} %" == difference


def row_of(start):
    return next(line for line in README.splitlines() if line.startswith(f"| {start}"))


def test_the_rows_on_mujoco():
    pytest.importorskip("mujoco")
    from kickdyn.accuracy.mujoco_kick import mujoco_kick

    impact = kick(0.0)
    exact = exact_impact(*given(impact))["impulse"]
    # Below 1e-15 the error is rounding, and its digits differ between machines.
    assert row_of("`kd.strike` | ").split("|")[2].strip() == "< 1e-15"
    assert exact.error(impact.impulse) < 1e-15
    rows = re.findall(r"^\| MuJoCo, (\S+) N/m, dt (\S+) s \| (\S+) \|", README, re.MULTILINE)
    assert len(rows) == 2
    for stiffness, dt, error in rows:
        assert f"{exact.error(mujoco_kick(impact, float(stiffness), float(dt))()):.1e}" == error


def test_the_rows_of_the_paper():
    ours = {item.item: item for section in SECTIONS for item in section.items()}
    spins = [ours[f"Fig. 9 case {case} spin"] for case in (1, 2, 3)]
    assert ", ".join(f"{item.ours:.2f}" for item in spins) in row_of("Fig. 9")
    worst = max(abs(item.relative_error) for item in spins)
    assert f"≤ {100 * worst:.2f} %" in row_of("Fig. 9")
    goal = "Fig. 13-15 100 m, 3 s"
    learned, steps = ours[f"{goal} learning loop rounds"].ours, ours[f"{goal} planner steps"].ours
    assert f"| {learned}; Newton: {steps} steps" in row_of("Fig. 15")
    predicted = [ours[f"{row.name} distance"] for row in tables_4_5.PREDICTED]
    assert ", ".join(f"{item.ours:.2f}" for item in predicted) in row_of("Tables 4-5")
    worst = max(abs(item.relative_error) for item in predicted)
    assert f"≤ {100 * worst:.2f} %" in row_of("Tables 4-5")
    least, most = tables_4_5.fit(tables_4_5.DEFAULT).middle
    assert f"{least:.1f} to {most:.1f} m for the first distance" in README
