"""Many contacts that take time are the contacts one after the other."""

import math
from dataclasses import replace

import numpy as np
import pytest
from chains import floating_leg, rails, random_leg
from contacts import random_strikes
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.impact.collide import COLLIDE
from kickdyn.impact.strike_many import StrikeStatus

LEG = kd.Leg.human()
Q, V = np.array([[0.7, 0.5, -0.3]] * 2), np.array([[6.6, -14.5, 6.6]] * 2)
NAMES = ("impulse", "contact_time", "deflection", "energy_lost", "v_after", "q_after")


@pytest.fixture(autouse=True)
def machine_code(monkeypatch):
    """Without it, some hundred rows are computed by `collide`."""
    monkeypatch.setattr(COLLIDE, "pays", lambda _: True)


@pytest.mark.parametrize("seed", range(4))
def test_every_row_is_a_contact(seed):
    """Hinges and slides, a moving base, spring by time and by pressure, slip and stick."""
    rng = np.random.default_rng(seed)
    moving = LEG.with_base_velocity((1.0, 0.5, -0.3))
    leg, n = {0: moving, 3: rails("xyz")}.get(seed) or random_leg(rng), 20
    q, v, balls, contacts, motion = random_strikes(rng, leg, n, speed_table=seed == 1)
    if seed != 1:  # no spring has a restitution of 0
        contacts = [kd.Contact(c.normal, max(c.restitution, 0.1), c.friction, c.offset)
                    for c in contacts]  # fmt: skip
    options = {"contact_time": 0.004, "tol": 1e-9}
    if seed == 2:
        balls = [kd.Ball(b.mass, b.radius, b.inertia_factor, pressure=90e3) for b in balls]
        options = {"stiffness": "pressure", "tol": 1e-9}
    options["torque"] = 5.0 * rng.normal(size=leg.nv)
    many = kd.collide_many(leg, q, v, balls, contacts, **motion, **options)
    refused = []
    for i in range(n):
        row = {name: value[i] for name, value in motion.items()}
        try:
            one = kd.collide(leg.posture(q[i]), v[i], balls[i], contacts[i], **row, **options)
        except kd.KickdynError as error:
            status = StrikeStatus.of(error).flag
            refused.append((many.status[i] == status, np.isnan(many.impulse[i]).all()))
            continue
        for name in NAMES:
            agrees(getattr(many, name)[i], getattr(one, name), integrated(1e-8))
        agrees(many.ball_velocity[i], one.ball_after.velocity, integrated(1e-8))
        agrees(many.ball_spin[i], one.ball_after.spin, integrated(1e-8))
        agrees(many.ball_position[i], one.ball_after.position, integrated(1e-9))
        agrees(many.approach_speed[i], one.approach_speed, closed_form(1e3))
        assert many.energy_residual[i] < integrated(1e-8)
    assert np.all(refused)
    assert np.bincount(many.status, minlength=4)[1:3].min() > 2


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.4])
def test_one_contact_in_machine_code_is_the_one_in_python(monkeypatch, friction):
    """All that is read of it agrees to 1e-9, whatever the tolerance: they take the same steps."""
    contact, times = kd.Contact((2, 0.3, 1), 0.8, friction), np.linspace(0.0, 0.009, 20)
    kick = LEG.posture(Q[0]), V[0], kd.Ball(), contact
    compiled = kd.collide(*kick, ball_spin=(5, 50, -9), torque=[20, -5, 3], tol=1e-6)
    monkeypatch.setattr(COLLIDE, "pays", lambda _: False)
    plain = kd.collide(*kick, ball_spin=(5, 50, -9), torque=[20, -5, 3], tol=1e-6)
    for name in (*NAMES, "peak_force", "joint_impulses", "visible_contact_time"):
        agrees(getattr(compiled, name), getattr(plain, name), 1e-9)
    for one, other in zip(compiled.sample(times), plain.sample(times), strict=True):
        agrees(one, other, 1e-9)


def test_rows_without_machine_code():
    """A floating leg, an inflated ball, a foot that goes through a ball, and no row."""
    leg = floating_leg(np.random.default_rng(1))
    q, v = leg.configuration()[None], np.ones((1, leg.nv))
    contact = kd.Contact(leg.posture(q[0]).point_velocity(v[0]), 0.5)
    inflated, ball = kd.Contact((2, 0, 1), "inflated", 0.4), kd.Ball(pressure=80e3)
    slips = replace(inflated, friction=0.01)
    for kick in ((leg, q, v, kd.Ball(), contact), (LEG, Q[:1], V[:1], ball, inflated),
                 (LEG, Q[:1], V[:1], ball, slips)):  # fmt: skip
        one = kd.collide(kick[0].posture(kick[1][0]), kick[2][0], *kick[3:], tol=1e-7)
        many = kd.collide_many(*kick)
        assert many.impulse[0].tolist() == one.impulse.tolist()
        after = one.ball_after
        slip = math.hypot(*one._motion.equations.kinematics(one._end).relative[:2])
        sticks = slip < 1e-6 and kick[4].friction > 0.0
        assert many.status[0] == (StrikeStatus.STICKS if sticks else StrikeStatus.SLIPS).flag
        assert many.ball_after == kd.BallState(
            *([row] for row in (after.position, after.velocity, after.spin, after.time))
        )
        away = kd.collide_many(kick[0], kick[1], -kick[2], *kick[3:])
        assert away.status.tolist() == [StrikeStatus.NO_IMPACT.flag]
        assert np.isnan(away.contact_time).all()
    kick = LEG, Q, V * [[1.0], [-1.0]], kd.Ball(), kd.Contact((2, 0, 1), 0.8)
    soft = kd.collide_many(*kick, stiffness=300.0)
    assert soft.status.tolist() == [StrikeStatus.FAILED.flag, StrikeStatus.NO_IMPACT.flag]
    assert kd.collide_many(LEG, Q[:0], V[:0], kd.Ball(), inflated).impulse.shape == (0, 3)


@pytest.mark.parametrize(("changes", "words"), [
    ({"q": [0.1, 0.2, 0.3]}, r"q has shape \(3,\).*collide"),
    ({"v": np.ones((3, 3))}, "q has 2 rows and v 3"),
    ({"contact": [kd.Contact((1, 0, 0))] * 3}, "contact has length 3"),
    ({"contact": kd.Contact((1, 0, 0), 0.0)}, "restitution is 0.0"),
    ({"contact_time": 10}, "contact time is 10"), ({"torque": [1.0]}, "torque has shape"),
    ({"ball_spin": np.ones((3, 3))}, r"ball spin has shape \(3, 3\)")
])  # fmt: skip
def test_bad_input(changes, words):
    arguments = {"q": Q, "v": V, "ball": kd.Ball(), "contact": kd.Contact((1, 0, 0), 0.5)}
    with pytest.raises(kd.InvalidInput, match=words):
        kd.collide_many(LEG, **(arguments | changes))
