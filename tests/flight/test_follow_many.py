"""Many balls followed at once are the balls followed one after the other."""

import numpy as np
import pytest

import kickdyn as kd

RNG = np.random.default_rng(1)
N = 12
STATES = kd.BallState(
    RNG.uniform((0, 0, 0.11), (1, 1, 1.2), (N, 3)),
    RNG.uniform((-5, -5, -1), (25, 8, 12), (N, 3)),
    40.0 * RNG.normal(size=(N, 3)),
)
WALL = kd.Plane((-1, 0, 0), (12, 0, 0))


def far(state, numbers):
    return 5.0 - state[1]


@pytest.mark.parametrize(
    ("air", "options"),
    [
        (None, {}),
        (None, {"ground": kd.Ground(0.0, "steel")}),
        (kd.Air(wind=(3, 1, 0)), {}),
        (kd.Air(wind=(14, 1, 0)), {}),
        (kd.Air(), {"plane": WALL}),
        (None, {"ends": [kd.Event("far", far)]}),
        (None, {"ground": kd.Ground(0.0, kd.Surface("rubber", 1.0, 0.1, 0.1))}),
    ],
    ids=["vacuum", "steel", "wind", "storm", "wall", "end", "no end of bounces"],
)
def test_every_row_is_followed(air, options):
    options = {"ground": kd.Ground(0.0, "turf"), **options}
    ball, seen = kd.Ball(pressure=80e3), set()
    many = kd.follow_many(STATES, ball, air, **options)
    names = many.status.attrs["flag_meanings"].split()
    for i in range(N):
        state = kd.BallState(STATES.position[i], STATES.velocity[i], STATES.spin[i])
        one = kd.follow(state, ball, air, **options)
        row = many.isel(flight=i)
        seen.add(one.status)
        assert names[int(row.status)] == one.status
        assert int(row.bounces) == len(one.bounces)
        if one.status == "blown":
            continue
        assert row.position.values == pytest.approx(one.rest.position, abs=1e-5)
        assert row.velocity.values == pytest.approx(one.rest.velocity, abs=1e-5)
        assert row.spin.values == pytest.approx(one.rest.spin, abs=1e-4)
        assert float(row.duration) == pytest.approx(one.duration, abs=1e-5)
        assert float(row.distance) == pytest.approx(one.distance, abs=1e-5)
    assert seen - {"at-rest"} or len(options) == 1


def test_balls_that_do_not_move_along_the_ground_rest():
    """They lie on it, at rest or turning, or fall straight down onto it."""
    states = kd.BallState(
        velocity=[(0, 0, 0), (0, 0, 0), (0, 0, -1), (1e-9, 0, 0)],
        spin=[(0, 0, 0), (0, 0, 9), (0, 0, 0), (0, 0, 0)],
    )
    for air in (None, kd.Air(), kd.Air(wind=(3, 0, 0)), kd.Air(wind=(30, 0, 0))):
        many = kd.follow_many(states, kd.Ball(), air)
        names = many.status.attrs["flag_meanings"].split()
        for i in range(4):
            state = kd.BallState(velocity=states.velocity[i], spin=states.spin[i])
            one = kd.follow(state, kd.Ball(), air)
            assert names[int(many.status[i])] == one.status
            if one.status == "at-rest":
                assert float(many.distance[i]) == pytest.approx(one.distance, abs=1e-9)
                assert float(many.duration[i]) == pytest.approx(one.duration, abs=1e-9)
                assert not many.velocity[i].values.any()


def test_balls_that_the_wind_stops_and_does_not_let_rest_are_blown():
    states = kd.BallState(
        [[0, 0, 0.11]] * 2, [[-2.0, 0, 0], [0, 0, 0]], [[0, -2.0 / 0.11, 0], [0, 0, 0]]
    )
    for wind, status in ((30.0, "blown"), (1.0, "at-rest")):
        many = kd.follow_many(
            states, kd.Ball(), kd.Air(wind=(wind, 0, 0)), kd.Ground(surface="turf")
        )
        names = many.status.attrs["flag_meanings"].split()
        assert [names[k] for k in many.status.values] == [status] * 2


def test_bad_input():
    turf = kd.Ground(0.0, "turf")
    with pytest.raises(kd.InvalidInput, match=r"launches have shape \(3,\): follow_many takes"):
        kd.follow_many(kd.BallState(), kd.Ball(), None, turf)
    with pytest.raises(kd.InvalidInput, match="the ground has no surface"):
        kd.follow_many(STATES, kd.Ball(), None, kd.Ground(0.0))
    with pytest.raises(kd.InvalidInput, match="launches have unequal heights"):
        kd.follow_many(STATES, kd.Ball())
