"""Many contacts that take time are the contacts one after the other."""

import math

import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg, random_leg
from contacts import random_strikes

import kickdyn as kd
from kickdyn.impact.strike_many import StrikeStatus

LEG = kd.Leg.human()
NAMES = ("impulse", "contact_time", "deflection", "energy_lost", "v_after", "q_after")


def one_by_one(leg, rows, i, **options):
    q, v, balls, contacts, motion = rows
    row = {name: value[i] for name, value in motion.items()}
    return kd.collide(leg.posture(q[i]), v[i], balls[i], contacts[i], **row, **options)


@pytest.mark.parametrize("seed", range(4))
def test_every_row_is_a_contact(seed):
    """Hinges and slides, spring by time and by pressure, points that slip, stick and start to."""
    rng = np.random.default_rng(seed)
    leg, n, seen = LEG if seed == 0 else random_leg(rng), 24, [0, 0, 0, 0]
    rows = q, v, balls, contacts, motion = random_strikes(rng, leg, n, speed_table=seed == 1)
    contacts[:] = [
        kd.Contact(c.normal, max(c.restitution, 0.1) if seed != 1 else c.restitution, c.friction,
                   offset=c.offset)
        for c in contacts
    ]  # fmt: skip
    options = {"contact_time": 0.004, "tol": 1e-9}
    if seed == 2:
        balls[:] = [kd.Ball(b.mass, b.radius, b.inertia_factor, pressure=90e3) for b in balls]
        options = {"stiffness": "pressure", "tol": 1e-9}
    torque = 5.0 * rng.normal(size=leg.nv)
    many = kd.collide_many(leg, q, v, balls, contacts, torque=torque, **motion, **options)
    for i in range(n):
        seen[many.status[i]] += 1
        try:
            one = one_by_one(leg, rows, i, torque=torque, **options)
        except kd.NoImpact:
            assert many.status[i] == StrikeStatus.NO_IMPACT.flag
            assert np.isnan(many.impulse[i]).all()
            continue
        except kd.KickdynError:
            assert many.status[i] == StrikeStatus.FAILED.flag
            continue
        for name in NAMES:
            value = np.asarray(getattr(one, name))
            scale = np.abs(value).max()
            assert getattr(many, name)[i] == pytest.approx(value, abs=1e-6 * scale), name
        after = one.ball_after
        assert many.ball_velocity[i] == pytest.approx(after.velocity, abs=1e-6 * after.speed)
        assert many.ball_spin[i] == pytest.approx(after.spin, abs=1e-6 * np.abs(after.spin).max())
        assert many.ball_position[i] == pytest.approx(after.position, abs=1e-8)
        assert many.approach_speed[i] == pytest.approx(one.approach_speed, rel=1e-10)
        assert many.energy_residual[i] < 2e-5
    assert min(seen[1:3]) > 2


def test_energy_and_momentum_without_the_kernel_of_their_own():
    """A mass on a rail under gravity, and a human leg whose energy Pinocchio computes."""
    rng = np.random.default_rng(5)
    q, v = rng.uniform(-0.4, 0.4, (40, 3)), np.tile([6.6, -14.5, 6.6], (40, 1))
    v = v * rng.uniform(0.5, 1.0, (40, 1))
    contact, ball = kd.Contact((2, 0.3, 1), 0.8, 0.3), kd.Ball()
    many = kd.collide_many(LEG, q, v, ball, contact, tol=1e-9, ball_spin=(0, 30, 5))
    model, gravity = LEG.model, np.array(LEG.model.gravity.linear)
    data, struck = model.createData(), many.status < 2
    assert struck.sum() > 20

    def energy(q, v, velocity, spin, position):
        inertia = pin.crba(model, data, q)
        leg = 0.5 * v @ inertia @ v + pin.computePotentialEnergy(model, data, q)
        moving = 0.5 * ball.mass * velocity @ velocity + 0.5 * ball.inertia * spin @ spin
        return leg + moving - ball.mass * gravity @ position

    for i in np.flatnonzero(struck):
        begin = LEG.posture(q[i]).contact_point + ball.radius * contact.normal
        before = energy(q[i], v[i], np.zeros(3), np.array([0, 30.0, 5]), begin)
        after = energy(many.q_after[i], many.v_after[i], many.ball_velocity[i], many.ball_spin[i],
                       many.ball_position[i])  # fmt: skip
        assert before - after == pytest.approx(many.energy_lost[i], abs=2e-7 * abs(before))
    gained = ball.mass * (many.ball_velocity - many.contact_time[:, None] * gravity)
    assert many.impulse[struck] == pytest.approx(gained[struck], rel=1e-9, abs=1e-12)


def test_two_masses():
    """Restitution, contact time and largest deflection of a mass on a rail come out exactly."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
    model.appendBodyToJoint(
        joint, pin.Inertia(2.0, np.zeros(3), 0.01 * np.eye(3)), pin.SE3.Identity()
    )
    model.addFrame(pin.Frame("toe", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.gravity = pin.Motion.Zero()
    leg, ball, speed = kd.Leg.from_model(model, "toe"), kd.Ball(), np.array([[9.0], [3.0]])
    e = [0.8, 0.4]
    contacts = [kd.Contact((1, 0, 0), value) for value in e]
    many = kd.collide_many(
        leg, np.zeros((2, 1)), speed, ball, contacts, contact_time=0.009, tol=1e-11
    )
    assert many.contact_time == pytest.approx([0.009] * 2, rel=1e-7)
    expected = [
        kd.normal_impulse(u, r, 2.0, ball.mass) for u, r in zip(speed[:, 0], e, strict=True)
    ]
    assert many.impulse[:, 0] == pytest.approx(expected, rel=1e-8)
    mass = 1 / (1 / 2.0 + 1 / ball.mass)
    lost = [0.5 * mass * u * u * (1 - r * r) for u, r in zip(speed[:, 0], e, strict=True)]
    assert many.energy_lost == pytest.approx(lost, rel=1e-7)
    k = mass / math.sqrt(9.0) * (0.9 * 3.2180 / 0.009) ** 2.5  # Johnson 1985, Eq. 11.24
    assert many.deflection[0] == pytest.approx((5 * mass * 81.0 / (4 * k)) ** 0.4, rel=1e-4)


def test_rows_without_machine_code():
    """A floating leg, an inflated ball, a foot that goes through a ball, and none."""
    leg = floating_leg(np.random.default_rng(1))
    q, v = leg.configuration()[None], np.ones((1, leg.nv))
    contact = kd.Contact(leg.posture(q[0]).point_velocity(v[0]), 0.5)
    many = kd.collide_many(leg, q, v, kd.Ball(), contact)
    one = kd.collide(leg.posture(q[0]), v[0], kd.Ball(), contact, tol=1e-7)
    assert many.impulse[0].tolist() == one.impulse.tolist()
    q, v = np.array([[0.7, 0.5, -0.3]] * 2), np.array([[6.6, -14.5, 6.6]] * 2)
    inflated = kd.Contact((2, 0, 1), "inflated", 0.4)
    ball = kd.Ball(pressure=80e3)
    many = kd.collide_many(LEG, q[:1], v[:1], ball, inflated)
    one = kd.collide(LEG.posture(q[0]), v[0], ball, inflated, tol=1e-7)
    assert many.impulse[0].tolist() == one.impulse.tolist()
    soft = kd.collide_many(LEG, q, v * [[1.0], [-1.0]], kd.Ball(), kd.Contact((2, 0, 1), 0.8),
                           stiffness=300.0)  # fmt: skip
    assert soft.status.tolist() == [StrikeStatus.FAILED.flag, StrikeStatus.NO_IMPACT.flag]
    assert kd.collide_many(LEG, q[:0], v[:0], kd.Ball(), inflated).impulse.shape == (0, 3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"q": [0.1, 0.2, 0.3]}, r"q has shape \(3,\): it must be \(n, 3\); collide takes one"),
        ({"v": np.ones((3, 3))}, "q has 2 rows and v 3"),
        ({"contact": [kd.Contact((1, 0, 0))] * 3}, "contact has length 3: it must be one or 2"),
        (
            {"contact": kd.Contact((1, 0, 0), 0.0)},
            "restitution is 0.0: it must be a finite number at least 0.01",
        ),
        ({"contact_time": 10}, "contact time is 10.0: it must be a finite number above 0"),
        ({"contact_time": 0.01, "stiffness": 1e5}, "give only one of them"),
        ({"stiffness": "pressure"}, "pressure"),
        ({"ball": kd.Ball(math.inf)}, "mass is inf"),
        ({"torque": [1.0]}, "torque has shape"),
        ({"tol": 1.0}, "tol is 1"),
        ({"ball_spin": np.ones((3, 3))}, r"ball spin has shape \(3, 3\): .* \(3,\) or \(2, 3\)"),
    ],
)
def test_bad_input(changes, words):
    given = {"q": np.ones((2, 3)), "v": np.ones((2, 3)), "ball": kd.Ball()}
    given |= {"contact": kd.Contact((1, 0, 0), 0.5)} | changes
    with pytest.raises(kd.InvalidInput, match=words) as caught:
        kd.collide_many(LEG, **given)
    assert "\n" not in str(caught.value)


def test_one_contact_names_the_function_for_many():
    rows = np.ones((5, 3))
    for call in (
        lambda: kd.collide(LEG.posture(rows[0]), rows, kd.Ball(), kd.Contact((1, 0, 0), 0.5)),
        lambda: kd.collide(
            LEG.posture(rows[0]), rows[0], kd.Ball(), kd.Contact((1, 0, 0), 0.5), ball_spin=rows
        ),
    ):
        with pytest.raises(kd.InvalidInput, match=r"shape \(5, 3\).*; collide_many takes \(n, 3\)"):
            call()


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_contacts_are_left_to_collide_in_doubt_only(friction, monkeypatch):
    rng, left = np.random.default_rng(6), []
    q = rng.uniform(-0.4, 0.4, (24, 3))
    v = np.tile([6.6, -14.5, 6.6], (24, 1)) * rng.uniform(0.5, 1.0, (24, 1))
    monkeypatch.setattr("kickdyn.impact.collide_many.collide", lambda *row, **_: left.append(row))
    many = kd.collide_many(LEG, q, v, kd.Ball(), kd.Contact((2, 0.3, 1), 0.8, friction))
    assert left == []
    assert np.isfinite(many.impulse[many.status < 2]).all()
    assert (many.status < 2).sum() > 12
