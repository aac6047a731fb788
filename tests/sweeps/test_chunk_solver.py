"""Ranges of postures by kernel and flights are those of `kick_from`, one by one where doubtful."""

import numpy as np
import pytest
from chains import random_leg
from extremes.extreme_impacts import chain
from tolerances import closed_form

import kickdyn as kd
from kickdyn.flight.batch import fly_many
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.chunk_solver import CarryTable, ChunkSolver, launches
from kickdyn.sweeps.dataset import VARIABLES, variables_of
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel import KernelModel
from kickdyn.sweeps.sweep_kick import Kick, kick_from

CARRY = list(VARIABLES).index("carry")
KICK = Kick(speed=3.0, attack=0.5, restitution=0.6, friction=0.15, air=None)
LEG = kd.Leg.human()


def solved(leg, grid, kick=KICK, tolerance=0.0):
    solver = ChunkSolver(leg, grid, kick, tolerance)
    solver.prepare()
    return solver(0, grid.size)


@pytest.mark.parametrize("planar", [True, False])
def test_doubtful_postures_of_short_light_feet_are_kick_from(planar):
    rods = chain((0.4, 0.4, 3e-6), (2.0, 2.0, 1e-5))
    leg = rods if planar else random_leg(np.random.default_rng(3), 5, last=1e-5)
    grid = Grid({name: np.array([-1.5, 0.3]) for name in leg.joint_names})
    rows, status = solved(leg, grid)
    for i in range(0, grid.size, 3):
        outcome = kick_from(leg.posture(grid.configuration(leg, i)), KICK)
        assert status[i] == outcome.status.flag
        right = np.array(list(variables_of(outcome, KICK).values()))
        close = {"rel": closed_form(1e3), "abs": closed_form(10), "nan_ok": True}
        assert rows[:, i] == pytest.approx(right, **close), i


def test_blocks_of_a_grid_are_parts_of_the_whole(monkeypatch):
    names = ("hip", "knee", "ankle")
    grid = Grid({name: np.linspace(-0.4, 0.9, n) for name, n in zip(names, (5, 3, 3), strict=True)})
    rows, status = solved(LEG, grid)
    monkeypatch.setattr(chunk_solver, "BLOCK", 16)
    solver = ChunkSolver(LEG, grid, KICK)
    solver.prepare()
    for first, count in ((0, 45), (7, 33)):
        part, flags = solver(first, count)
        right = rows[:, first : first + count]
        assert part == pytest.approx(right, rel=closed_form(1e4), abs=closed_form(10), nan_ok=True)
        assert flags.tolist() == status[first : first + count].tolist()


@pytest.mark.processor_limit(10)  # of 750 flights one by one, where machine code is not stored
def test_interpolation_changes_carries_only_and_within_the_tolerance():
    kick = Kick(speed=14.0)
    axes = {"hip": np.linspace(-0.2, 1.4, 15), "knee": np.linspace(0, 2.2, 25), "ankle": [0, 0.5]}
    grid = Grid({name: np.asarray(values) for name, values in axes.items()})
    difference = np.abs(solved(LEG, grid, kick)[0] - solved(LEG, grid, kick, 1e-5)[0]).max(axis=1)
    assert 0 < difference[CARRY] <= 1e-5
    assert not np.delete(difference, CARRY).any()


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
