"""Many flights side by side: none knows of its neighbours."""

import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.flight.batch import fly_many
from kickdyn.flight.compiling import LANES
from kickdyn.flight.flight_result import outside_ranges

BALL, AIR = kd.Ball(), kd.Air()


def slow_spin_only(reynolds, spin_parameter):
    return spin_parameter if spin_parameter < 0.3 else math.nan


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


@pytest.mark.parametrize("air", [AIR, kd.Air(lift=slow_spin_only)], ids=["all", "some fail"])
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


def quivering(reynolds, spin_parameter):
    return 0.2 + 0.1 * math.sin(3.0 * reynolds)


def test_a_flight_of_too_many_evaluations_fails():
    states = kd.BallState(velocity=[(25.0, 0, 8), (0.0, 0, 0)])
    many = fly_many(states, BALL, kd.Air(drag=quivering), kd.Ground(-BALL.radius), tol=1e-12)
    names = many.status.attrs["flag_meanings"].split()
    assert [names[k] for k in many.status.values] == ["failed", "landed"]


def test_outside_of_a_flight_that_failed_is_not_claimed():
    states = kd.BallState([(0, 0, 0)], [(10, 0, 8)], [(0, -60, 0)], [0])
    many = fly_many(states, BALL, kd.Air(lift=slow_spin_only))
    assert int(many.status[0]) == 2
    assert not many.outside[0]


def low_shots(n):
    """Launches up to 0.4 m above the ground, downward, with a back spin that lifts many of them."""
    draw = np.random.default_rng(7)
    height, down = draw.uniform(0.0, 0.4, n), draw.uniform(0.0, 3.0, n)
    position = np.column_stack([np.zeros((n, 2)), BALL.radius + height])
    velocity = np.column_stack([draw.uniform(10, 35, n), np.zeros(n), -down])
    side = draw.normal(0, 5, (2, n))
    spin = np.column_stack([side[0], -draw.uniform(0, 150, n), side[1]])
    return kd.BallState(position, velocity, spin, np.zeros(n))


def test_a_ball_that_dips_into_the_ground_within_a_step_lands():
    states, ground = low_shots(400), kd.Ground()
    many = fly_many(states, BALL, AIR, ground)
    rows = zip(states.position, states.velocity, states.spin, strict=True)
    paths = [kd.fly(kd.BallState(*row), BALL, AIR, ground) for row in rows]
    assert many.range.values == pytest.approx([path.range for path in paths], abs=1e-6)
    assert many.height.values == pytest.approx([path.height for path in paths], abs=1e-6)
    risen = many.apex_time.values > 0.0  # after a dip above the ground
    assert 20 < risen.sum() < 200


@pytest.mark.parametrize(
    ("gap", "velocity", "spin", "air"),
    [
        (0.3, (30, 0, -2), (0, -150, 0), AIR),
        (0.036, (33.29, 0, -0.592), (0, -45, 0), AIR),
        (1e-6, (0, 0, -0.1), (0, 0, 0), kd.Air(wind=(0, 0, 40))),
    ],
    ids=["fast spin", "shallow", "carried up by wind"],
)
@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
def test_a_dip_lands_where_fly_lands(gap, velocity, spin, air, tol):
    state = kd.BallState((0, 0, BALL.radius + gap), velocity, spin)
    path = kd.fly(state, BALL, air, kd.Ground(), tol)
    states = kd.BallState(*(each[None] for each in (state.position, state.velocity, state.spin)))
    many = fly_many(states, BALL, air, kd.Ground(), tol)
    assert path.status == "landed"
    assert int(many.status[0]) == 0
    assert float(many.duration[0]) == pytest.approx(path.duration, rel=10 * tol, abs=1e-10)


def test_the_apex_is_found_at_a_wide_tolerance():
    draw = np.random.default_rng(5)
    velocity = np.column_stack([draw.uniform(5, 30, 300), np.zeros(300), draw.uniform(2, 20, 300)])
    states = kd.BallState(velocity=velocity, spin=(0, -60, 9))
    exact, wide = (fly_many(states, BALL, AIR, tol=tol).height.values for tol in (1e-12, 1e-2))
    assert wide == pytest.approx(exact, abs=0.1)


def test_a_ball_that_turns_twice_within_a_step_is_seen_at_a_wide_tolerance():
    states = low_shots(400)
    exact, wide = (fly_many(states, BALL, AIR, kd.Ground(), tol) for tol in (1e-12, 1e-6))
    assert wide.range.values == pytest.approx(exact.range.values, abs=1e-3)
    assert wide.height.values == pytest.approx(exact.height.values, abs=1e-4)
