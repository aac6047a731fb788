import numpy as np
import pinocchio as pin
import pytest
from chains import random_leg
from extremes.extreme_impacts import chain

import kickdyn as kd
from kickdyn.flight import batch
from kickdyn.flight.batch import fly_many
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.chunk_solver import ChunkSolver
from kickdyn.sweeps.dataset import VARIABLES, variables_of
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.sweep_kick import Kick, kick_from

KICK = Kick(speed=3.0, attack=0.5, restitution=0.6, friction=0.15, air=None)


@pytest.fixture(autouse=True)
def small_grids_take_the_kernel(monkeypatch):
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", 1)


def solver(leg, grid):
    found = ChunkSolver(leg, grid, KICK)
    found.prepare()
    return found


@pytest.mark.parametrize("last", [1e-3, 1e-7])
@pytest.mark.parametrize("planar", [True, False])
def test_sweeps_of_short_light_feet_are_kick_from_and_do_not_stop(planar, last):
    rods = chain((0.4, 0.4, 0.3 * last), (2.0, 2.0, last))
    leg = rods if planar else random_leg(np.random.default_rng(3), 5, last=last)
    grid = Grid({name: np.linspace(-1.5, 1.4, 3) for name in leg.joint_names})
    rows, status = solver(leg, grid)(0, grid.size)
    for i in range(0, grid.size, 9):
        outcome = kick_from(leg.posture(grid.configuration(leg, i)), KICK)
        assert status[i] == outcome.status.flag
        alone = np.array(list(variables_of(outcome, KICK).values()))
        assert rows[:, i] == pytest.approx(alone, rel=1e-11, abs=1e-12, nan_ok=True)


def test_a_ball_that_the_batch_does_not_land_is_flown_alone(monkeypatch):
    def one_is_lost(*args, **how):
        flights = fly_many(*args, **how).copy(deep=True)
        flights.status[0], flights.range[0] = 1, np.nan
        return flights

    monkeypatch.setattr(batch, "fly_many", one_is_lost)
    leg, grid = kd.Leg.human(), Grid({"hip": np.array([0.1, 0.2])})
    rows = solver(leg, grid)(0, 2)[0]
    carries = [kick_from(leg.posture([hip, 0.0, 0.0]), KICK).carry for hip in (0.1, 0.2)]
    assert rows[list(VARIABLES).index("carry")] == pytest.approx(carries, rel=1e-9)


def test_a_nearly_straight_posture_does_not_cost_the_sweep(monkeypatch):
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", 2000)
    model, parent = pin.Model(), 0
    turns = pin.JointModelRY(), pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRY()
    for k, turn in enumerate(turns):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3 if k else 0.0]))
        parent = model.addJoint(parent, turn, place, f"j{k}")
        body = pin.Inertia(2.0, np.array([0.0, 0.0, -0.15]), 0.01 * np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3]))
    model.addFrame(pin.Frame("toe", parent, 0, tip, pin.FrameType.OP_FRAME))
    leg = kd.Leg.from_model(model, "toe")
    small = [1e-9, 2e-9, 5e-9, 1e-8, 3e-8]  # of some, rounding decides whether they can kick
    joints = {"j0": [-0.01], "j1": [0], "j2": small, "j3": [*small, 0.5]}
    table = kd.sweep(leg, joints, kd.Kick(attack=-np.pi / 2))
    assert table.impulse.values[..., -1].ravel() == pytest.approx(5 * [0.61154], rel=1e-5)
    straight = table.impulse.values[..., :-1]
    assert straight[np.isfinite(straight)] == pytest.approx(0.77395, rel=1e-5)


def test_flown_carries_are_right_to_what_is_promised():
    leg = kd.Leg.human()
    kick = Kick(speed=30.0, attack=0.3, restitution=0.6, friction=0.3, air=kd.Air())
    grid = Grid({"hip": np.linspace(-0.4, 0.9, 12), "knee": np.linspace(-1.4, -0.1, 12)})
    found = ChunkSolver(leg, grid, kick, 0.0)
    found.prepare()
    rows = found(0, grid.size)[0]
    carries = rows[list(VARIABLES).index("carry")]
    outcomes = [kick_from(leg.posture(grid.configuration(leg, i)), kick) for i in range(grid.size)]
    struck = [i for i, outcome in enumerate(outcomes) if outcome.impact is not None]
    launches = [outcomes[i].impact.ball_after for i in struck]
    states = kd.BallState(*(np.array([getattr(each, name) for each in launches])
                            for name in ("position", "velocity", "spin")))  # fmt: skip
    exact = fly_many(states, kick.ball, kick.air, tol=1e-13).range.values
    assert (exact > 1.0).sum() > 100
    assert carries[struck] == pytest.approx(exact, rel=2e-9)
    assert [outcomes[i].carry for i in struck] == pytest.approx(exact, rel=2e-9)
