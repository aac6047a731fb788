import itertools
import math

import numpy as np
import pytest
from chains import random_leg

import kickdyn as kd
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.sweep_kick import (
    Kick,
    PostureStatus,
    kick_from,
    slowest_joint_velocity,
    speed_use,
)

LEG = kd.Leg.human()


def test_it_is_strike_and_fly():
    kick = Kick(speed=2.0, attack=math.radians(20), restitution=0.7, friction=0.1)
    posture = LEG.posture(np.radians([20, 30, 10]))
    outcome = kick_from(posture, kick)
    n = [math.cos(math.radians(20)), 0, math.sin(math.radians(20))]
    v = posture.joint_velocity(2 * np.array(n))
    impact = kd.strike(posture, v, kd.Ball(), kd.Contact(n, 0.7, 0.1))
    assert outcome.status == "ok"
    assert outcome.impact.impulse == pytest.approx(impact.impulse, rel=1e-13)
    assert outcome.impact.v_before == pytest.approx(v, rel=1e-13)
    assert outcome.carry == pytest.approx(
        kd.fly(impact.ball_after, kd.Ball(), kd.Air()).range, rel=1e-9
    )
    assert outcome.speed_use == least_use(posture, 2 * np.array(n))


@pytest.mark.parametrize("law", ["stronge", "paper"])
def test_another_law_is_that_of_strike(law, monkeypatch):
    q, kick = (0.35, 0.5, 0.17), Kick(law=law, friction=0.1)
    posture = LEG.posture(q)
    v = posture.joint_velocity(kick.direction)
    expected = kd.strike(posture, v, kd.Ball(), kick.contact, law).impulse
    impact = kick_from(posture, kick).impact
    assert impact.law == law
    assert impact.impulse == pytest.approx(expected, rel=1e-13)
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", 1)
    table = kd.sweep(LEG, {"hip": np.array([q[0]]), "knee": q[1], "ankle": q[2]}, kick)
    assert table.attrs["impact_law"] == law
    assert table.impulse.values.ravel() == pytest.approx([math.hypot(*expected)])


def test_an_unknown_law_is_refused():
    with pytest.raises(kd.InvalidInput, match="impact law is 'hooke'"):
        Kick(law="hooke")


def test_a_stretched_leg_cannot_kick_along_itself():
    outcome = kick_from(LEG.posture(np.radians([90, 0, 90])), Kick(attack=0.0))
    assert outcome.status == "out-of-reach"
    assert outcome.impact is None
    assert math.isnan(outcome.carry)


def test_a_fast_kick_exceeds_the_joints():
    outcome = kick_from(LEG.posture(np.radians([5, 10, -5])), Kick(speed=50))
    assert outcome.status == "too-fast"
    assert outcome.speed_use > 1
    assert outcome.impact is not None


def test_two_joints_that_may_not_move_leave_too_few():
    model = LEG.model
    for limits, status in (([0.0, 10.0, 10.0], "ok"), ([0.0, 0.0, 10.0], "too-fast")):
        model.velocityLimit = np.array(limits)
        leg = kd.Leg.from_model(model, "toe")
        outcome = kick_from(leg.posture(np.radians([5, 10, -5])), Kick())
        assert outcome.status == status
        assert (outcome.speed_use == math.inf) is (status == "too-fast")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"speed": 0}, "foot speed is 0"),
        ({"speed": math.nan}, "foot speed is nan"),
        ({"attack": 2.0}, r"attack is 2\.0: .* at least -1\.5708"),
        ({"restitution": 1.2}, r"restitution is 1\.2"),
        ({"friction": -0.1}, r"friction is -0\.1"),
    ],
)
def test_bad_kicks(change, words):
    with pytest.raises(kd.InvalidInput, match=words):
        Kick(**change)


def test_straight_up_is_allowed():
    assert Kick(attack=math.radians(90)).direction == pytest.approx([0, 0, 1], abs=1e-15)


def limited(leg, limits):
    model = leg.model
    model.velocityLimit = np.asarray(limits, float)
    return kd.Leg.from_model(model, leg.frame)


def least_use(posture, wish):
    return speed_use(posture, slowest_joint_velocity(posture, wish))


def dual_maximum(posture, wish):
    """The least speed use by the dual of its linear programme, all vertices tried."""
    limit = posture.leg.velocity_limit
    columns = posture.jacobian[:, limit > 0]
    y = np.array([np.cross(a, b) for a, b in itertools.combinations(columns.T, 2)])
    along = np.abs(y @ columns)
    along[along < 1e-12 * np.linalg.norm(y, axis=1)[:, None]] = 0.0
    with np.errstate(invalid="ignore"):
        capacity = np.nansum(along * limit[limit > 0], axis=1)
    return (np.abs(y @ wish) / capacity).max()


@pytest.mark.parametrize("special", [None, 0.0, np.inf, 1e-2])
def test_no_joint_velocity_is_slower(special):
    rng = np.random.default_rng(5)
    for joints in (3, 4, 5, 6, 7, 8) * 4:
        limits = rng.uniform(0.5, 20.0, joints)
        if special is not None and joints > 4:
            limits[rng.integers(joints)] = special
        leg = limited(random_leg(rng, joints), limits)
        posture, wish = leg.posture(rng.uniform(-2, 2, joints)), rng.normal(size=3)
        v = slowest_joint_velocity(posture, wish)
        assert posture.point_velocity(v) == pytest.approx(wish, abs=1e-12 * max(1, abs(v).max()))
        assert dual_maximum(posture, wish) == pytest.approx(speed_use(posture, v), rel=1e-11)
        assert speed_use(posture, v) <= speed_use(posture, posture.joint_velocity(wish))


def test_in_a_plane_too():
    leg, wish = kd.Leg.human(), np.array([8.0, 0.0, 5.0])
    posture = leg.posture(np.radians([40, 30, -20]))
    v = slowest_joint_velocity(posture, wish)
    assert posture.point_velocity(v) == pytest.approx(wish, rel=1e-13, abs=1e-13)
    assert sorted(abs(v) / leg.velocity_limit)[1:] == pytest.approx(2 * [speed_use(posture, v)])
    assert least_use(posture, 3 * wish) == pytest.approx(3 * speed_use(posture, v), rel=1e-13)


def test_a_foot_so_slow_that_squares_of_its_speed_vanish():
    leg, wish = kd.Leg.human(), np.array([0.8, 0.0, 0.5])
    posture = leg.posture(np.radians([40, 30, -20]))
    v, slow = (slowest_joint_velocity(posture, scale * wish) for scale in (1.0, 1e-200))
    assert slow == pytest.approx(1e-200 * v, rel=1e-9, abs=0.0)


def test_joints_of_limit_0_and_of_none():
    leg, wish = kd.Leg.human(), np.array([1.0, 0.0, 0.0])
    q = np.radians([5, 10, -5])
    for limits, use in (([0, 10, 0], np.inf), ([0, 0, 0], np.inf), (3 * [np.inf], 0.0)):
        posture = limited(leg, limits).posture(q)
        assert least_use(posture, wish) == use


def test_a_limit_beyond_all_others_is_none_and_its_rounding_does_not_count():
    rng = np.random.default_rng(2)
    leg = random_leg(rng, 5)
    limits, wish = rng.uniform(1.0, 9.0, 5), rng.normal(size=3)
    for k in range(5):
        uses = []
        for most in (1e9, 1e16, 1e20, 1e200, np.inf):
            limits[k], before = most, limits[k]
            posture = limited(leg, limits).posture(np.full(5, 0.4))
            uses.append(least_use(posture, wish))
            limits[k] = before
        assert uses == pytest.approx(5 * [uses[-1]], rel=1e-8)
        assert uses[-1] > 0


def test_a_held_foot_counts():
    leg = kd.Leg.from_robot("g1", base="floating").with_supports("left_ankle_roll_link")
    posture = leg.posture(
        leg.configuration({"right_hip_pitch_joint": -0.3, "right_knee_joint": 0.5})
    )
    wish = np.array([1.0, 0.0, 0.2])
    v = slowest_joint_velocity(posture, wish)
    assert posture.point_velocity(v) == pytest.approx(wish, abs=1e-9)
    posture.check_velocity(v)
    assert speed_use(posture, v) < speed_use(posture, posture.joint_velocity(wish))


def test_a_kick_that_some_velocity_can_do_is_not_too_fast():
    leg = kd.Leg.human()
    posture, kick = leg.posture(np.radians([40, 30, -20])), Kick(speed=10.0)
    wish = kick.speed * kick.direction
    outcome = kick_from(posture, kick)
    assert speed_use(posture, posture.joint_velocity(wish)) == pytest.approx(1.3197, rel=1e-4)
    assert (outcome.status, outcome.speed_use) == ("ok", least_use(posture, wish))
    assert speed_use(posture, outcome.impact.v_before) == pytest.approx(0.64024, rel=1e-5)
    slow = kd.strike(posture, posture.joint_velocity(wish), kick.ball, kick.contact)
    assert outcome.impact.impulse == pytest.approx(slow.impulse, rel=1e-12)


def test_statuses_have_flags():
    assert {status.value: status.flag for status in PostureStatus} == {
        "ok": 0, "too-fast": 1, "out-of-reach": 2, "not-closed": 3, "not-computed": -1,
    }  # fmt: skip


@pytest.mark.parametrize("kernel_from", [1, 10**9])
def test_a_table_is_taken_at_the_foots_speed(kernel_from, monkeypatch):
    """The foot moves along the normal with one speed, and so e is one number in a sweep."""
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", kernel_from)
    postures = {"hip": np.array([0.1, 0.35]), "knee": np.array([0.5]), "ankle": np.array([0.17])}
    table = [[5.0, 0.8], [15.0, 0.6]]
    steep, flat = (kd.sweep(LEG, postures, Kick(speed=10.0, restitution=e)) for e in (table, 0.7))
    assert Kick(speed=10.0, restitution=table).restitution_used == pytest.approx(0.7, abs=1e-15)
    for name in ("impulse", "immovable_impulse", "carry", "ball_speed"):
        assert steep[name].values == pytest.approx(flat[name].values, rel=1e-13), name
    assert steep.restitution_residual.max() < 1e-12
    assert steep.attrs["restitution"] == pytest.approx(0.7, abs=1e-15)
    assert steep.attrs["restitution_given"] == "[[5, 0.8], [15, 0.6]]"
    assert flat.attrs["restitution_given"] == 0.7
    slow = kd.sweep(LEG, postures, Kick(speed=1.0, restitution="peacock-ball"))
    assert "9.1 to 21.2 m/s" in slow.attrs["warnings"]
    assert slow.attrs["restitution_given"] == "peacock-ball"
    ball = kd.Ball(pressure=70e3)
    kick = Kick(speed=12.0, restitution="inflated", ball=ball)
    inflated = kd.sweep(LEG, postures, kick)
    assert type(inflated.attrs["restitution_given"]) is str  # else netCDF refuses it
    for hip, impulse in zip(postures["hip"], inflated.impulse.values.ravel(), strict=True):
        posture = LEG.posture([hip, 0.5, 0.17])
        hit = kd.strike(posture, posture.joint_velocity(12 * kick.direction), ball, kick.contact)
        assert impulse == pytest.approx(math.hypot(*hit.impulse), rel=1e-12)


def test_the_joints_move_the_foot_relative_to_a_base_that_moves():
    """The foot is as fast in the world, the joints move it by what it is faster than the hip."""
    kick, hip, posture = Kick(speed=12.0), np.array([3.0, 0.0, 0.5]), [0.5, 0.4, 0.1]
    moving = LEG.with_base_velocity(hip).posture(posture)
    outcome = kick_from(moving, kick)
    relative = 12.0 * np.asarray(kick.direction) - hip
    slowest = slowest_joint_velocity(LEG.posture(posture), relative)
    assert outcome.impact.foot_velocity == pytest.approx(12.0 * kick.direction, abs=1e-11)
    assert outcome.speed_use == pytest.approx(speed_use(LEG.posture(posture), slowest), rel=1e-9)
    resting = kick_from(LEG.posture(posture), kick)
    assert outcome.impact.impulse == pytest.approx(resting.impact.impulse, rel=1e-12)


def test_a_large_sweep_with_a_base_that_moves_is_that_of_its_postures(monkeypatch):
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", 1)
    leg, kick = LEG.with_base_velocity((3, 0, 0), (0, -1, 0)), Kick(speed=9.0)
    table = kd.sweep(leg, {"hip": [0.1, 0.5], "knee": [0.4]}, kick)
    for k, hip in enumerate((0.1, 0.5)):
        outcome = kick_from(leg.posture([hip, 0.4, 0.0]), kick)
        assert float(table.speed_use[k, 0]) == pytest.approx(outcome.speed_use, rel=1e-12)
        assert float(table.ball_speed[k, 0]) == pytest.approx(
            outcome.impact.ball_after.speed, rel=1e-13
        )
    assert table.attrs["model_sha256"] != kd.sweep(LEG, {"hip": [0.1]}, kick).attrs["model_sha256"]


@pytest.mark.parametrize("kernel_from", [1, 10**9], ids=["compiled", "one by one"])
def test_a_sweep_with_a_base_that_moves_is_one_in_another_frame(monkeypatch, kernel_from):
    """Seen from the hip, which is at rest there, the ball comes with the opposite velocity."""
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", kernel_from)
    hip, kick, ball = np.array([3.0, 0.0, 0.5]), Kick(speed=9.0), kd.Ball()
    grid = {"hip": [0.1, 0.5, 0.9], "knee": [0.4, 1.1]}
    table = kd.sweep(LEG.with_base_velocity(hip), grid, kick)
    for i, j in np.ndindex(3, 2):
        there = LEG.posture([grid["hip"][i], grid["knee"][j], 0.0])
        v = slowest_joint_velocity(there, 9.0 * kick.direction - hip)
        hit = kd.strike(there, v, ball, kick.contact, ball_velocity=-hip)
        row = {name: float(table[name][i, j]) for name in table.data_vars}
        speed = np.linalg.norm(hit.ball_after.velocity + hip)
        assert row["ball_speed"] == pytest.approx(speed, rel=1e-13)
        assert row["impulse"] == pytest.approx(np.linalg.norm(hit.impulse), rel=1e-13)
        assert row["worst_joint_impulse"] == pytest.approx(hit.worst_joint[1], rel=1e-13)
        assert row["speed_use"] == pytest.approx(speed_use(there, v), rel=1e-13)
