"""The tables of docs/explanation/inflated-ball.md are the output of a script."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from test_compliance_page import printed_by

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = ROOT / "benchmarks" / "inflated_ball.py"
PAGE = ROOT / "docs" / "explanation" / "inflated-ball.md"

pytestmark = pytest.mark.skipif(
    not SCRIPT.exists(), reason="benchmarks come with the checkout only"
)


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPT.parent))
    import inflated_ball

    yield inflated_ball
    for name in ("inflated_ball", "compliance"):
        sys.modules.pop(name, None)


def cells(printed, column, width):
    """Return a column of the rows of numbers with this many columns."""
    rows = [line.strip("| ").split(" | ") for line in printed.splitlines() if line[:2] == "| "]
    return [row[column] for row in rows if len(row) == width and row[0].isdigit()]


def test_the_numbers_of_the_page_are_the_output_of_the_scripts(script, monkeypatch):
    """The first table is on the page; of the others, the page has sentences."""
    monkeypatch.setattr(sys, "argv", [str(SCRIPT)])
    text = PAGE.read_text(encoding="utf-8")
    walls, strips = printed_by(SCRIPT), printed_by(SCRIPT.with_name("foot_patch.py"))
    tables = [part.splitlines() for part in walls.split("\n\n") if part.startswith("|")]
    assert tables[0] == [line for line in text.splitlines() if line.startswith("|")]
    text = " ".join(text.split())
    compressed = [
        cell.partition("(")[2].strip(")").replace("%", " %") for cell in cells(walls, 2, 6)
    ]
    assert f"{compressed[0]} at 5 m/s, {compressed[3]} at 20 m/s" in text
    springs = [cell.partition("(+")[2].strip("%)") for cell in cells(walls, 3, 6)]
    assert f"by {springs[0]} % at 5 m/s and {springs[3]} % at 20 m/s" in text
    lasts = [float(cell) for cell in cells(walls, 4, 6)]
    assert f"{min(lasts):.1f} to {max(lasts):.1f} ms" in text
    smooth, rough = (
        [int(cell.split()[0]) for cell in cells(strips, column, 8)] for column in (1, 3)
    )
    assert f"spins by at most {max(smooth)} rad/s" in text
    added = [more - less for less, more in zip(smooth, rough, strict=True)]
    assert abs(max(added) - 21) <= 1  # of rounded numbers
    assert f"create up to {max(int(cell[:-1]) for cell in cells(strips, 7, 8))} % of energy" in text


@pytest.mark.parametrize("mass", [0.86, 1.95, 40.0])
def test_a_foot_that_moves_by_integration_over_time(script, mass):
    """Ball and foot with the flat part of the shell, whose mass grows and falls."""
    ball, pressure, speed = script.INFLATED, 80e3, 17.0
    m, radius = ball.mass, ball.radius

    def push(u):
        return pressure * math.pi * radius**2 * u * (2 - u)

    def closing(_, y):  # u, speed of approach
        u, w = y
        taken = (push(u) + m * w * w / (2 * radius)) / (mass + 0.5 * m * u)
        return w / radius, -push(u) / (m * (1 - 0.5 * u)) - taken

    def opening(_, y):  # u, speed of separation
        u, w = y
        pulled = (push(u) - m * w * w / (2 * radius)) / (m * (1 - 0.5 * u))
        return -w / radius, pulled + push(u) / (mass + 0.5 * m * u)

    def at_rest(_, y):
        return y[1]

    def apart(_, y):
        return y[0]

    at_rest.terminal = apart.terminal = True
    at_rest.direction = apart.direction = -1
    tol = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    end = solve_ivp(closing, (0, 0.1), (0, speed), events=at_rest, **tol).y[:, -1]
    after = solve_ivp(opening, (0, 0.1), (end[0], 0.0), events=apart, **tol).y[1, -1]
    assert script.ratio_of_foot(mass, speed) == pytest.approx(after / speed, rel=1e-8)


@pytest.mark.parametrize("speed", [2.0, 11.0, 19.0])
def test_energy_and_momentum_are_balanced(script, speed):
    """The shell loses energy where it stops and starts; the force has the momentum's change."""
    m = script.INFLATED.mass
    for pressure in (script.constant(70e3), script.compressed(70e3)):
        largest, ratio = script.deflection_at(pressure, speed), script.ratio_at(pressure, speed)
        before = script.compression(pressure, largest)

        def lost(u, pressure=pressure, largest=largest, before=before):
            back = quad(lambda x: pressure(x) * x * (2 - x) ** 2, u, largest, epsabs=1e-9)[0]
            scale = math.pi * script.INFLATED.radius**3 / m
            square = before - script.compression(pressure, u)
            return 0.25 * m * (square + scale * back / (1 - 0.5 * u) ** 2)

        energy = quad(lost, 0.0, largest, epsrel=1e-12)[0]
        assert energy == pytest.approx(0.5 * m * speed**2 * (1 - ratio**2), rel=1e-10)
        times, force = script.force_over_time(pressure, speed)
        impulse = np.trapezoid(force, times)
        assert impulse == pytest.approx(m * speed * (1 + ratio), rel=1e-4)


def test_small_deflections_give_the_spring_from_pressure(script):
    for speed in (0.1, 0.2):
        gap = 1.0 - script.peak_force(speed) / script.spring_force(speed)
        assert gap == pytest.approx(0.5 * script.deflection_at(lambda u: 80e3, speed), rel=1e-6)
