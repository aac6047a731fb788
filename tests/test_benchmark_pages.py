"""Pages of the docs show the numbers that benchmarks print, and the benchmarks are right."""

import contextlib
import io
import math
import re
import runpy
from pathlib import Path

import inflated_ball
import pytest
from impact_methods import kick
from references.exact_impact import exact_impact, given
from scipy.integrate import solve_ivp
from shown_numbers import first_missing
from tolerances import integrated

ROOT = Path(__file__).resolve().parent.parent
EXPLANATION = ROOT / "docs" / "explanation"


@pytest.mark.slow
@pytest.mark.parametrize(("script", "page"), [
    ("inflated_ball.py", "inflated-ball.md"), ("compliance.py", "compliance.md")])  # fmt: skip
def test_the_table_of_a_page_is_printed(script, page, monkeypatch):
    monkeypatch.setattr("sys.argv", [script])
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        runpy.run_path(str(ROOT / "benchmarks" / script), run_name="__main__")
    rows = re.findall(r"(?m)^\| \d.*", (EXPLANATION / page).read_text("utf-8"))
    assert rows
    for row in rows:
        assert first_missing(row, printed.getvalue()) is None, row
    if script == "compliance.py":  # the contact time of a Hertzian spring k falls with k^-0.4
        table = printed.getvalue().split("order in k", 1)[1].split("\n\n")[0].splitlines()
        orders = [float(row.strip("| ").split(" | ")[-1]) for row in table[-2:]]
        assert orders == pytest.approx([-0.4, -0.4], abs=0.005)


def rows_of_verification(heading):
    """Return the cells of the table with this heading, row by row."""
    text = (EXPLANATION / "verification.md").read_text("utf-8")
    lines = text.split(f"| {heading} |", 1)[1].split("\n\n", 1)[0].splitlines()[2:]
    return [[cell.strip(" `") for cell in line.strip("|").split(" | ")] for line in lines]


@pytest.mark.slow
def test_the_errors_of_the_kick():
    pytest.importorskip("mujoco")
    from mujoco_comparison import mujoco_kick

    impact = kick(0.0)
    exact = exact_impact(*given(impact))["impulse"]
    (_, bound, _), *simulated = rows_of_verification("Impulse")
    assert exact.error(impact.impulse) < float(bound.removeprefix("<"))
    for name, error, _ in simulated:
        stiffness, dt = map(float, re.fullmatch(r"MuJoCo, (\S+) N/m, dt (\S+) s", name).groups())
        right = exact.error(mujoco_kick(impact, stiffness, dt)())
        assert float(error) == pytest.approx(right, rel=0.02), name


@pytest.mark.parametrize("mass", [0.86, 1.95, 40.0])
def test_an_inflated_ball_on_a_foot_that_moves_by_integration_over_time(mass):
    """Ball and foot with the flat part of the shell, whose mass grows and falls."""
    ball, pressure, speed = inflated_ball.INFLATED, 80e3, 17.0
    m, radius = ball.mass, ball.radius

    def rates(_, y):  # deflection over radius, speed of approach, below 0 in the rebound
        u, w = y
        push, stopped = pressure * math.pi * radius**2 * u * (2 - u), m * w * w / (2 * radius)
        shell, foot = m * (1 - 0.5 * u), mass + 0.5 * m * u
        return w / radius, -push / shell - push / foot + (
            -stopped / foot if w > 0 else stopped / shell
        )

    def apart(_, y):
        return y[0]

    apart.terminal, apart.direction = True, -1
    tol = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    after = -solve_ivp(rates, (0, 0.1), (0, speed), events=apart, **tol).y[1, -1]
    ratio = inflated_ball.ratio_of_foot(mass, speed)
    assert ratio == pytest.approx(after / speed, rel=integrated(1e-10))
