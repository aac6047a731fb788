import numpy as np
import pytest
from chains import random_leg

import kickdyn as kd
from kickdyn.flight.batch import fly_many
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.carry_table import CarryTable, launches
from kickdyn.sweeps.chunk_solver import ChunkSolver
from kickdyn.sweeps.grid import Grid, read_postures
from kickdyn.sweeps.kernel import KernelModel
from kickdyn.sweeps.sweep_kick import Kick

LEG = kd.Leg.human()


@pytest.mark.parametrize(
    ("speed", "attack", "friction", "error"),
    [(1.0, 30.0, 0.4, 1e-8), (12.0, 30.0, 0.4, 1e-6), (18.0, 10.0, 0.4, 1e-4),
     (9.0, 0.0, 0.2, 1e-6)],
)  # fmt: skip
def test_carries_are_within_their_error(speed, attack, friction, error):
    kick = Kick(speed=speed, attack=np.radians(attack), friction=friction)
    model = KernelModel.of(LEG, kick)
    table = CarryTable(model, error)
    draw, n = np.random.default_rng(3), 5000
    normal = 1.8 * speed * kick.ball.mass * draw.uniform(0, 1, n)
    tangent = friction * normal * draw.uniform(-1, 1, n)
    carry = np.full(n, np.nan)
    unknown = table(normal, tangent, carry)
    balls = launches(model, np.column_stack([tangent, np.zeros(n), normal]))
    flown = fly_many(balls, kick.ball, kick.air, tol=1e-11).range.values
    assert unknown.mean() < 0.01
    assert np.abs(carry - flown)[~unknown].max() <= error
    assert np.isnan(carry[unknown]).all()


def test_what_is_off_the_box_is_not_known():
    kick = Kick(speed=3.0)
    table = CarryTable(KernelModel.of(LEG, kick), 1e-3)
    most = 1.8 * 3.0 * kick.ball.mass
    normal = np.array([most, 1.01 * most, 0.5 * most, 0.5 * most, 0.0, np.nan])
    tangent = np.array([0.0, 0.0, 0.39, 0.41, 0.0, 0.0]) * 0.5 * most
    assert table(normal, tangent, np.full(6, np.nan)).tolist() == [
        False,
        True,
        False,
        True,
        True,
        True,
    ]


def grid(leg, joints):
    return Grid.of(leg, read_postures(leg, joints))


def solver(leg, postures, kick, tolerance):
    found = ChunkSolver(leg, postures, kick, tolerance)
    found.prepare()
    return found


def test_a_sweep_interpolates_what_it_would_fly(monkeypatch):
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", 1)
    kick = Kick(speed=14.0)
    postures = grid(LEG, ["hip=-10:80:10", "knee=0:130:10", "ankle=-20:50:10"])
    flown = solver(LEG, postures, kick, 0.0)(0, postures.size)[0]
    read = solver(LEG, postures, kick, 1e-5)(0, postures.size)[0]
    off = np.abs(flown - read).max(axis=1)
    assert 0 < off[10] <= 1e-5
    assert not np.delete(off, 10).any()


def test_only_planar_flights_through_air_are_interpolated(monkeypatch):
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", 1)

    def tolerance(leg, kick):
        axes = {name: np.zeros(1) for name in leg.joint_names}
        return ChunkSolver(leg, Grid(axes), kick, 1e-6).carry_tolerance

    assert tolerance(random_leg(np.random.default_rng(0), joints=3), Kick()) == 0.0
    assert tolerance(LEG, Kick(air=None)) == 0.0
    assert tolerance(LEG, Kick()) == 1e-6
