"""Flights side by side do not influence each other; events within a step are found."""

import math

import numpy as np
import pytest
from tolerances import closed_form, integrated

import kickdyn as kd
from kickdyn.flight.batch import MARCH, fly_many
from kickdyn.flight.compiling import LANES

BALL, AIR = kd.Ball(), kd.Air()


@pytest.fixture(autouse=True)
def machine_code(monkeypatch):
    monkeypatch.setattr(MARCH, "pays", lambda _: True)


def slow_spin_only(reynolds, spin_parameter):
    return spin_parameter if spin_parameter < 0.3 else math.nan


def mixed(n):
    """Return fast kicks among which some are slow, at rest, or in the drag crisis."""
    draw = np.random.default_rng(3)
    velocity = draw.normal(size=(n, 3)) * draw.choice([0.5, 5.0, 12.0, 25.0], (n, 1))
    velocity[:, 2] = np.abs(velocity[:, 2])
    velocity[::17] = 0.0
    spin = draw.normal(0, 40, (n, 3)) * draw.choice([0.0, 1.0], (n, 1))
    return kd.BallState(draw.normal(size=(n, 3)), velocity, spin)


def part(states, rows):
    return kd.BallState(states.position[rows], states.velocity[rows], states.spin[rows])


@pytest.mark.parametrize("air", [AIR, kd.Air(lift=slow_spin_only)], ids=["all", "some fail"])
def test_neighbours_do_not_matter(air):
    states = mixed(3 * LANES + 7)
    together = fly_many(states, BALL, air)
    order = np.random.default_rng(1).permutation(len(states.position))
    shuffled = fly_many(part(states, order), BALL, air)
    for name in together:
        assert np.array_equal(together[name][order], shuffled[name], equal_nan=name != "status")
    alone = fly_many(part(states, [20]), BALL, air)
    assert np.array_equal(alone.landing_position[0], together.landing_position[20], True)
    assert set(np.unique(together.status)) == ({0} if air is AIR else {0, 2})


@pytest.mark.parametrize(("gap", "velocity", "spin", "air"), [(0.3, (30, 0, -2), (0, -150, 0), AIR),
    (0.02, (33.29, 0, -0.592), (0, -45, 0), AIR),
    (1e-6, (0, 0, -0.1), (0, 0, 0), kd.Air(wind=(0, 0, 40))),
    (0.0, (-5.4, 28.1, 4.5), (4, -50, 24), kd.Air(drag=0.2, lift=0.15, torque=0.01))],
    ids=["fast spin", "shallow", "carried up by wind", "would rise again"])  # fmt: skip
@pytest.mark.parametrize("tol", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_ball_lands_where_it_first_meets_the_ground(gap, velocity, spin, air, tol):
    state = kd.BallState((0, 0, BALL.radius + gap), velocity, spin)
    path = kd.fly(state, BALL, air, kd.Ground(), tol)
    many = fly_many(kd.BallState(state.position, [velocity], spin), BALL, air, kd.Ground(), tol)
    assert path.status == "landed"
    assert int(many.status[0]) == 0
    right = pytest.approx(path.duration, rel=integrated(tol), abs=closed_form(10))
    assert float(many.duration[0]) == right
    assert many.landing_spin[0].values == pytest.approx(path.landing.spin, rel=integrated(tol))


@pytest.mark.parametrize("tol", [1e-3, 1e-9])
def test_a_ball_that_leaves_a_wall_is_blown_back_to_it_within_a_step(tol):
    wall, air = kd.Plane((0, 0, 0), (1, 0, 0), "centre"), kd.Air(wind=(-40, 0, 0))
    state = kd.BallState((0, 0, 1), [(0.1, 0, 9)])
    many = fly_many(state, BALL, air, kd.Ground(), tol, plane=wall)
    path = kd.fly(part(state, 0), BALL, air, kd.Ground(), tol, plane=wall)
    assert (path.status, int(many.status[0])) == ("at-plane", 3)
    assert 0 < float(many.duration[0]) == pytest.approx(path.duration, rel=integrated(tol))
