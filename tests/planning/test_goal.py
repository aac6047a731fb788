import math

import pytest

import kickdyn as kd
from kickdyn.planning.goal import nominal_velocity

G = 9.81


def test_a_distance_is_a_point_along_x():
    assert kd.Goal(30, time=1).target.tolist() == [30, 0, 0]


@pytest.mark.parametrize("kind", ["time", "apex", "speed", "over"])
def test_nominal_times_are_those_of_the_parabola(kind):
    target, time, part = (18.0, 2.0, 1.5), 1.9, 0.4
    velocity = nominal_velocity(kd.Goal(target, time=1).target, time)
    distance, at = math.hypot(18, 2), part * time
    wished = {
        "time": time,
        "apex": velocity[2] ** 2 / (2 * G),
        "speed": math.hypot(*velocity),
        "over": (part * distance, velocity[2] * at - G / 2 * at**2),
    }[kind]
    times = kd.Goal(target, **{kind: wished}).nominal_times()
    assert min(abs(found - time) for found in times) < 1e-12
    assert len(times) == (2 if kind == "speed" else 1)


def test_what_the_vacuum_does_not_allow_has_no_nominal_time():
    assert kd.Goal(30, speed=10).nominal_times() == []
    assert kd.Goal((10, 0, 3), apex=2).nominal_times() == []
    assert kd.Goal((10, 0, 2), over=(5, 0.9)).nominal_times() == []


@pytest.mark.parametrize(
    ("target", "named", "words"),
    [
        (30, {}, "nothing is given in addition to the target"),
        (30, {"time": 1, "apex": 2}, "time and apex are given"),
        (
            30,
            {"time": -1},
            "time is -1.0: it must be a finite number at least 1e-06 and at most 1000",
        ),
        (
            20,
            {"time": 1e-300},
            "time is 1e-300: it must be a finite number at least 1e-06 and at most 1000",
        ),
        (-3, {"time": 1}, "distance is -3.0"),
        ((0, 0, 3), {"time": 1}, "straight above or below"),
        ((1, 2), {"time": 1}, r"shape \(2,\)"),
        (2e4, {"time": 1}, "at most 10000 m"),
        (30, {"over": (31, 2)}, "over is at 31 m: it must be between"),
        (30, {"time": 1, "beside": (0, 2)}, "beside is at 0 m"),
        (math.nan, {"time": 1}, "target is nan"),
        (30, {"time": 1, "spin": (0, 1)}, "spin has shape"),
        (30, {"time": 1, "arc": "flat"}, "arc is 'flat': it must be one of low, high"),
    ],
)
def test_bad_input(target, named, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Goal(target, **named)
