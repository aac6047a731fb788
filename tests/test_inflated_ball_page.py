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


def test_every_row_is_the_output_of_the_script(script, monkeypatch):
    monkeypatch.setattr(sys, "argv", [str(SCRIPT)])
    printed = printed_by(SCRIPT) + printed_by(SCRIPT.with_name("foot_patch.py"))
    rows = [line for line in printed.splitlines() if line.startswith("|")]
    page = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    assert rows == page


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
