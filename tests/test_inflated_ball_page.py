"""The model of an inflated ball in benchmarks/inflated_ball.py, and the numbers of its page."""

import math
import re
from pathlib import Path

import inflated_ball
import pytest
from scipy.integrate import solve_ivp
from shown_numbers import first_missing
from test_compliance_page import printed_by
from tolerances import integrated

PAGE = Path(__file__).resolve().parent.parent / "docs" / "explanation" / "inflated-ball.md"
BALL = inflated_ball.INFLATED


@pytest.mark.slow
def test_the_table_of_the_page_is_printed(monkeypatch):
    monkeypatch.setattr("sys.argv", ["inflated_ball.py"])
    printed = printed_by("inflated_ball.py")
    shown = re.findall(r"(?m)^\| \d.*", PAGE.read_text("utf-8"))
    assert shown
    for row in shown:
        assert first_missing(row, printed) is None, row


@pytest.mark.parametrize("mass", [0.86, 1.95, 40.0])
def test_a_foot_that_moves_by_integration_over_time(mass):
    """Ball and foot with the flat part of the shell, whose mass grows and falls."""
    pressure, speed, m, radius = 80e3, 17.0, BALL.mass, BALL.radius

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
    ratio = inflated_ball.ratio_of_foot(mass, speed)
    assert ratio == pytest.approx(after / speed, rel=integrated(1e-10))


@pytest.mark.parametrize("speed", [0.1, 0.2])
def test_small_deflections_give_the_spring_from_pressure(speed):
    gap = 1.0 - inflated_ball.peak_force(speed) / inflated_ball.spring_force(speed)
    deflection = inflated_ball.deflection_at(lambda u: 80e3, speed)
    assert gap == pytest.approx(0.5 * deflection, rel=1e-6)
