"""Many flights side by side: none knows of its neighbours."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.core.lanes import LANES
from kickdyn.flight.batch import fly_many
from kickdyn.flight.flight_result import outside_ranges

BALL, AIR = kd.Ball(), kd.Air()


def mixed(n):
    """Fast kicks among which some are slow, at rest, vertical, in the drag crisis or fail."""
    draw = np.random.default_rng(3)
    velocity = draw.normal(size=(n, 3)) * draw.choice([0.5, 5.0, 12.0, 25.0], (n, 1))
    velocity[:, 2] = np.abs(velocity[:, 2])
    velocity[::17] = 0.0
    spin = draw.normal(0, 40, (n, 3)) * draw.choice([0.0, 1.0], (n, 1))
    return kd.BallState(draw.normal(size=(n, 3)), velocity, spin, np.zeros(n))


def part(states, rows):
    return kd.BallState(*(getattr(states, name)[rows] for name in ("position", "velocity", "spin")),
                        states.time[rows])  # fmt: skip


@pytest.mark.parametrize("air", [AIR, kd.Air(lift="kiratidis-leinweber")], ids=["all", "some fail"])
def test_neighbours_do_not_matter(air):
    states = mixed(5 * LANES + 7)
    together = fly_many(states, BALL, air)
    order = np.random.default_rng(1).permutation(len(states.position))
    shuffled = fly_many(part(states, order), BALL, air)
    for name in together:
        assert np.array_equal(together[name][order], shuffled[name], equal_nan=name != "status")
    for i in (0, 1, 20, len(order) - 1):
        alone = fly_many(part(states, [i]), BALL, air)
        assert np.array_equal(alone.landing_position[0], together.landing_position[i], True)
    assert set(np.unique(together.status)) == ({0} if air is AIR else {0, 2})


def left_at_a_node(path):
    """Return whether launch, apex or landing lies outside of a coefficient's range."""
    if path.air is None or path.evaluations == 0:
        return False
    nodes = (path.launch, path.apex, path.landing)
    place, velocity, spin = (
        np.array([getattr(node, name) for node in nodes])
        for name in ("position", "velocity", "spin")
    )
    left = outside_ranges(place[:, 2], velocity, spin, path.ball, path.air)
    return any(out.any() for _, out in left)


def test_outside_is_what_warnings_say():
    states = mixed(3 * LANES)
    for air in (AIR, kd.Air(drag="sphere"), kd.Air(wind=lambda z: (2.0 * z, 0.0, 0.0)), None):
        many = fly_many(states, BALL, air)
        for i in range(len(states.position)):
            path = kd.fly(kd.BallState(states.position[i], states.velocity[i], states.spin[i]),
                          BALL, air)  # fmt: skip
            assert bool(many.outside[i]) == left_at_a_node(path)
            assert bool(path.warnings) or not many.outside[i]


def test_outside_of_a_flight_that_failed_is_not_claimed():
    states = kd.BallState([(0, 0, 0)], [(10, 0, 8)], [(0, -15, 0)], [0])
    many = fly_many(states, BALL, kd.Air(lift="kiratidis-leinweber"))
    assert int(many.status[0]) == 2
    assert not many.outside[0]
