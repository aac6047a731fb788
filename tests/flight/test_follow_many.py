"""Many balls followed at once are the balls followed one after the other."""

import numpy as np
import pytest
from tolerances import agrees, integrated

import kickdyn as kd
from kickdyn.flight.batch import MARCH

RNG = np.random.default_rng(1)
N = 12
STATES = kd.BallState(RNG.uniform((0, 0, 0.11), (1, 1, 1.2), (N, 3)),
    RNG.uniform((-5, -5, -1), (25, 8, 12), (N, 3)), 40.0 * RNG.normal(size=(N, 3)))  # fmt: skip
TURF = kd.Ground(0.0, "turf")
LYING = kd.BallState((0, 0, 0.11), [(0, 0, 0), (0, 0, 0), (0, 0, -1), (1e-9, 0, 0), (-2, 0, 0)],
                     [(0, 0, 0), (0, 0, 9), (0, 0, 0), (0, 0, 0), (0, -2 / 0.11, 0)])  # fmt: skip
SLIDING = kd.BallState((0, 0, 0.11), [(8, 4, 0), (0, 12, 0), (3, 0, 0), (0, -9, 0)], (9, 5, 0))
WIND, SHEAR = kd.Air(wind=(3, 1, 0)), kd.Air(wind=lambda z: (3.0 + 2.0 * z, 1.0, 0.0))


@pytest.fixture(autouse=True, params=[False, True], ids=["Python", "machine code"])
def way(request, monkeypatch):
    monkeypatch.setattr(MARCH, "pays", lambda _: request.param)


def far(state, numbers):
    return 5.0 - state[1]


@pytest.mark.parametrize(("states", "air", "options", "statuses"), [(STATES, None, {}, {"at-rest"}),
    (STATES, None, {"ground": kd.Ground(0.0, "steel")}, {"at-rest"}),
    (STATES, SHEAR, {}, {"at-rest"}),
    (STATES, kd.Air(wind=(18, 1, 0)), {"time_limit": 6.0}, {"blown"}),
    (STATES, WIND, {"plane": kd.Plane((12, 0, 0), (-1, 0, 0))}, {"at-rest", "at-plane"}),
    (STATES, None, {"ends": [kd.Event("far", far)]}, {"at-rest", "far"}),
    (SLIDING, None, {"ends": [kd.Event("far", far)]}, {"at-rest", "far"}),
    (STATES, None, {"ground": kd.Ground(0, kd.Surface("rubber", 1, 0.1, 0.1))}, {"bouncing"}),
    (LYING, None, {}, {"at-rest"}), (LYING, WIND, {}, {"at-rest"}),
    (LYING, kd.Air(wind=(30, 0, 0)), {"time_limit": 20.0}, {"blown"})],
    ids=["vacuum", "steel", "wind", "storm", "wall", "event", "sliding", "rubber", "lying",
    "lying in wind", "lying in storm"])  # fmt: skip
def test_every_row_is_followed(states, air, options, statuses):
    options, ball = {"ground": TURF, **options}, kd.Ball(radius=0.11, pressure=80e3)
    many, seen, near = kd.follow_many(states, ball, air, **options), set(), integrated(1e-7)
    names = many.status.attrs["flag_meanings"].split()
    for i in range(len(states.position)):
        state = kd.BallState(states.position[i], states.velocity[i], states.spin[i])
        one, row = kd.follow(state, ball, air, **options), many.isel(flight=i)
        seen.add(one.status)
        assert (names[int(row.status)], int(row.bounces)) == (one.status, len(one.bounces)), i
        if one.status == "blown":
            continue
        for name, size in (("position", 1), ("velocity", 1), ("spin", 10)):
            right = pytest.approx(getattr(one.rest, name), abs=near * size)
            assert row[name].values == right, (name, i)
        assert float(row.duration) == pytest.approx(one.duration, abs=near), i
        for name in ("duration", "distance"):  # of 1 ns, too
            assert float(row[name]) == pytest.approx(getattr(one, name), rel=10 * near, abs=0), i
    assert seen == statuses


def test_a_plane_where_balls_come_to_rest_does_not_change_where_they_end():
    """Their distance from it is there little more than rounding."""
    ball, air, ahead = kd.Ball(radius=0.11), kd.Air(wind=(1, 0.5, 0)), np.array([0.6, -0.8, 0])
    one = kd.BallState((0, 0, 0.11), 8 * ahead, 8 / 0.11 * np.array([0.8, 0.6, 0]))
    end, past = kd.follow(one, ball, air, TURF).rest.position, np.geomspace(1e-14, 1e-9, 40)
    motion = (np.tile(vector, (40, 1)) for vector in (one.velocity, one.spin))
    states = kd.BallState(past[:, None] * ahead + one.position, *motion)
    many = kd.follow_many(states, ball, air, TURF, plane=kd.Plane(end, -ahead, "centre"))
    agrees(many.position.values, np.tile(end, (40, 1)), integrated(1e-8))


@pytest.mark.parametrize(("states", "ground", "words"), [
    (kd.BallState(), TURF, r"\(3,\).*follow_many"), (STATES, kd.Ground(0.0), "no surface"),
    (STATES, None, "unequal heights"),
    (STATES, kd.Ground(0, kd.Surface("ice", 0.5, 0.0, 0.5)), "friction of ice is 0")])  # fmt: skip
def test_refusals(states, ground, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.follow_many(states, kd.Ball(), None, ground)
