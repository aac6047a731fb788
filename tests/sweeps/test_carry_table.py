"""Interpolated carries are within their tolerance of flown ones."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.flight.batch import fly_many
from kickdyn.sweeps.carry_table import CarryTable, launches
from kickdyn.sweeps.kernel import KernelModel
from kickdyn.sweeps.sweep_kick import Kick

LEG = kd.Leg.human()


@pytest.mark.parametrize(("speed", "attack", "friction", "tolerance"), [
    (1.0, 30.0, 0.4, 1e-8), (12.0, 30.0, 0.4, 1e-6), (18.0, 10.0, 0.4, 1e-4),
    (9.0, 0.0, 0.2, 1e-6)])  # fmt: skip
def test_carries_are_within_their_tolerance(speed, attack, friction, tolerance):
    kick = Kick(speed=speed, attack=np.radians(attack), friction=friction)
    model, draw, n = KernelModel.of(LEG, kick), np.random.default_rng(3), 2000
    normal = 1.8 * speed * kick.ball.mass * draw.uniform(0, 1, n)  # (1 + e) m v
    tangent = friction * normal * draw.uniform(-1, 1, n)
    carry = np.full(n, np.nan)
    to_fly = CarryTable(model, tolerance)(normal, tangent, carry)
    balls = launches(model, np.column_stack([tangent, np.zeros(n), normal]))
    flown = fly_many(balls, kick.ball, kick.air, tol=1e-11).range.values
    assert to_fly.mean() < 0.01
    assert np.abs(carry - flown)[~to_fly].max() <= tolerance
    assert np.isnan(carry[to_fly]).all()


def test_impulses_outside_the_table_are_to_be_flown():
    """Above (1 + e) m v, beyond the friction, 0, or not finite."""
    kick = Kick(speed=3.0)
    most = 1.8 * 3.0 * kick.ball.mass
    normal = np.array([0.99 * most, 1.01 * most, 0.5 * most, 0.5 * most, 0.0, np.nan])
    tangent = np.array([0.0, 0.0, 0.39, 0.41, 0.0, 0.0]) * 0.5 * most
    to_fly = CarryTable(KernelModel.of(LEG, kick), 1e-3)(normal, tangent, np.full(6, np.nan))
    assert to_fly.tolist() == [False, True, False, True, True, True]
