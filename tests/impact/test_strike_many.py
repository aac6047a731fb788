"""Many strikes at once are the strikes one after the other."""

import sys

import numpy as np
import pinocchio as pin
import pytest
from chains import at, floating_leg, random_leg, serial
from contacts import random_strikes
from tolerances import agrees, closed_form, differenced

import kickdyn as kd
from kickdyn.impact import strike_kernel
from kickdyn.impact.strike_many import Impacts, StrikeStatus

LEG = kd.Leg.human()
BALL, CONTACT = kd.Ball(), kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
PROMISED = 1e-10
"""Agreement that `strike_many` promises."""
MODULE = sys.modules[StrikeStatus.__module__]


def not_to_be_called(*arguments, **options):
    pytest.fail("this way is not to be taken")


@pytest.mark.parametrize("seed", range(4))
def test_every_row_is_a_strike(seed, monkeypatch):
    """Hinges and slides, restitution over speed, points that stick, slip, or do not meet.

    On arrays and in machine code, to the same digits, and no row by `strike`.
    """
    rng = np.random.default_rng(seed)
    leg, n = LEG if seed == 0 else random_leg(rng), 60
    q, v, balls, contacts, motion = random_strikes(rng, leg, n, speed_table=seed == 1)
    for i, (old, velocity) in enumerate(zip(contacts, motion["ball_velocity"], strict=True)):
        approach = leg.posture(q[i]).point_velocity(v[i]) - velocity  # a third of them recedes
        normal = approach / np.linalg.norm(approach) + rng.uniform(-0.4, 0.4, 3)
        normal, friction = (1, 1, -1)[i % 3] * normal, (3.0, 0.05, 0.4)[i % 3]
        contacts[i] = kd.Contact(normal, old.restitution, friction, old.offset)
    monkeypatch.setattr(MODULE, "strike", not_to_be_called)
    ways = []
    for is_compiled in (False, True):
        monkeypatch.setattr(strike_kernel.KERNEL, "pays", lambda _, answer=is_compiled: answer)
        ways.append(kd.strike_many(leg, q, v, balls, contacts, **motion))
    arrays, many = ways
    for name in set(Impacts.__dataclass_fields__) - {"slopes"}:
        np.testing.assert_array_equal(getattr(arrays, name), getattr(many, name), name)
    for i in range(n):
        row = {name: value[i] for name, value in motion.items()}
        try:
            one = kd.strike(leg.posture(q[i]), v[i], balls[i], contacts[i], **row)
        except kd.NoImpact:
            assert many.status[i] == StrikeStatus.NO_IMPACT.flag
            assert np.isnan([*many.impulse[i], *many.joint_impulses[i].flat]).all()
            continue
        assert (many.status[i] == StrikeStatus.STICKS.flag) == one.sticking
        for name in ("impulse", "joint_impulses", "approach_speed"):
            agrees(getattr(many, name)[i], getattr(one, name), PROMISED)
        for name in ("v_after", "energy_lost"):
            agrees(getattr(many, name)[i], getattr(one, name), 100 * PROMISED)
        agrees(many.ball_velocity[i], one.ball_after.velocity, PROMISED)
        agrees(many.ball_spin[i], one.ball_after.spin, PROMISED)
        agrees(many.ball_position[i], one.ball_after.position, closed_form(10))
    assert np.bincount(many.status, minlength=4).clip(0, n // 6).tolist() == [10, 10, 10, 0]


@pytest.mark.parametrize(("last", "mass"), [(1e-4, 0.43), (1e-7, 0.43), (1e-7, 1e3)])
def test_rows_that_lose_digits_are_computed_at_once(last, mass, monkeypatch):
    """A light last body, a ball that jams, many turns, a foot that moves along the ball."""
    rng, ball, contact = np.random.default_rng(0), kd.Ball(mass), kd.Contact((2, 0.3, 1), 0.8, 1.0)
    leg = random_leg(np.random.default_rng(3), 5, last=last)
    q, v = rng.uniform(-1.5, 0.5, (40, 5)), rng.normal(0.0, 5.0, (40, 5))
    q[::5] += [2e6 * (leg.joint_unit(name) == "rad") for name in leg.joint_names]
    for angles, speeds in zip(q[::4], v[::4], strict=True):
        row = contact.normal @ leg.posture(angles).jacobian
        speeds -= row * (row @ speeds) / (row @ row)
    monkeypatch.setattr(MODULE, "strike", not_to_be_called)
    many = kd.strike_many(leg, q, v, ball, contact)
    for i in np.flatnonzero(many.status < StrikeStatus.NO_IMPACT.flag):
        one = kd.strike(leg.posture(q[i]), v[i], ball, contact)
        assert (many.status[i] == StrikeStatus.STICKS.flag) == one.sticking
        agrees(many.impulse[i], one.impulse, PROMISED + 10.0**-one.digits)
        agrees(many.joint_impulses[i], one.joint_impulses, PROMISED + 10 ** -min(one.joint_digits))


@pytest.mark.parametrize("restitution", [0.8, "inflated"])
def test_one_ball_and_one_contact_serve_all_rows(restitution):
    q, v = np.array([[0.7, 0.5, -0.3], [0.4, 0.6, -0.2]]), np.array([[6.6, -14.5, 6.6]] * 2)
    ball, contact = kd.Ball(pressure=80e3), kd.Contact((2, 0, 1), restitution, 0.4)
    one = kd.strike_many(LEG, q, v, ball, contact)
    lists = kd.strike_many(LEG, q, v, [ball] * 2, contact)
    assert one.impulse.tolist() == lists.impulse.tolist()
    agrees(one.impulse[1], kd.strike(LEG.posture(q[1]), v[1], ball, contact).impulse, PROMISED)
    assert one.ball_after.velocity.shape == (2, 3)
    assert kd.strike_many(LEG, q[:0], v[:0], BALL, CONTACT).impulse.shape == (0, 3)


def screw_leg():
    """A helical joint that carries a hinge, on which a foot is."""
    place, body = at(0.1, 0, -0.4), pin.Inertia(1.0, np.array([0.1, 0, -0.2]), 0.02 * np.eye(3))
    joints = ("a", pin.JointModelHX(0.3), place, body), ("b", pin.JointModelRY(), place, body)
    return kd.Leg.from_model(serial(joints, place), "toe")


@pytest.mark.parametrize("leg", [
    LEG, floating_leg(np.random.default_rng(1)), screw_leg()], ids=["kernel", "floats", "screw"]
)  # fmt: skip
@pytest.mark.parametrize("friction", [0.02, 0.4])
def test_slopes_are_those_of_the_sensitivity(leg, friction):
    """With machine code and without; a row that recedes has a status in place of numbers."""
    q, v = np.array([leg.configuration()] * 3), np.outer([1.0, 2.0, -1.0], np.ones(leg.nv))
    velocity = leg.posture(q[0]).point_velocity(v[0])
    contact = kd.Contact(velocity + 0.1 * velocity[[2, 0, 1]], 0.8, friction)
    many = kd.strike_many(leg, q, v, BALL, contact, slopes=True)
    assert many.status[2] == StrikeStatus.NO_IMPACT.flag
    for i in range(2):
        impact = kd.strike(leg.posture(q[i]), v[i], BALL, contact)
        agrees(many.joint_impulses[i], impact.joint_impulses, closed_form(10))
        exact = impact.sensitivity()
        for source in ("q", "v"):
            for result in ("velocity", "spin"):
                slope = getattr(many.slopes, f"{result}_by_{source}")[i]
                agrees(slope, getattr(exact, result)[source], differenced())


@pytest.mark.parametrize(("changes", "words"), [
    ({"q": [0.1, 0.2, 0.3]}, r"q has shape \(3,\).*strike"),
    ({"v": np.ones((3, 3))}, "q has 2 rows and v 3"), ({"law": "stronge"}, "'stronge': .*'newton'"),
    ({"ball": [kd.Ball()] * 3}, "ball has length 3"), ({"contact": "x"}, "contact is 'x'"),
    ({"ball_spin": np.ones((3, 3))}, r"ball spin has shape \(3, 3\)"),
    ({"slopes": "yes"}, "slopes is 'yes'"), ({"v": [[np.nan] * 3] * 2}, "v is .*finite")
])  # fmt: skip
def test_bad_input(changes, words):
    arguments = {"q": np.ones((2, 3)), "v": np.ones((2, 3)), "ball": BALL, "contact": CONTACT}
    with pytest.raises(kd.InvalidInput, match=words):
        kd.strike_many(LEG, **(arguments | changes))
