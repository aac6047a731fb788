"""Many strikes at once are the strikes one after the other."""

import numpy as np
import pytest
from chains import floating_leg, random_leg
from contacts import random_strikes

import kickdyn as kd
from kickdyn.impact.strike_many import StrikeStatus

LEG = kd.Leg.human()


@pytest.mark.parametrize("seed", range(4))
def test_every_row_is_a_strike(seed):
    rng = np.random.default_rng(seed)
    leg = LEG if seed == 0 else random_leg(rng)
    n, seen = 60, [0, 0, 0, 0]
    q, v, balls, contacts, motion = random_strikes(rng, leg, n, speed_table=seed == 1)
    many = kd.strike_many(leg, q, v, balls, contacts, **motion)
    for i in range(n):
        seen[many.status[i]] += 1
        row = {name: value[i] for name, value in motion.items()}
        try:
            one = kd.strike(leg.posture(q[i]), v[i], balls[i], contacts[i], **row)
        except kd.NoImpact:
            assert many.status[i] == StrikeStatus.NO_IMPACT.flag
            assert np.isnan(many.impulse[i]).all()
            assert np.isnan(many.joint_impulses[i]).all()
            continue
        size = np.linalg.norm(one.impulse)
        assert (many.status[i] == StrikeStatus.STICKS.flag) == one.sticking
        assert many.impulse[i] == pytest.approx(one.impulse, abs=1e-11 * size)
        assert many.joint_impulses[i] == pytest.approx(one.joint_impulses, abs=1e-11 * size)
        assert many.v_after[i] == pytest.approx(one.v_after, rel=1e-9, abs=1e-9)
        assert many.energy_lost[i] == pytest.approx(one.energy_lost, rel=1e-9, abs=1e-10)
        assert many.approach_speed[i] == pytest.approx(one.approach_speed, rel=1e-10)
        after = one.ball_after
        assert many.ball_velocity[i] == pytest.approx(after.velocity, abs=1e-10)
        assert many.ball_spin[i] == pytest.approx(after.spin, abs=1e-8)
        assert many.ball_position[i] == pytest.approx(after.position, abs=1e-13)
    assert min(seen[:3]) > 2
    assert seen[3] == 0


def test_one_ball_and_one_contact_serve_all_rows():
    q, v = np.array([[0.7, 0.5, -0.3], [0.4, 0.6, -0.2]]), np.array([[6.6, -14.5, 6.6]] * 2)
    contact, ball = kd.Contact((2, 0, 1), 0.8, 0.4), kd.Ball()
    one = kd.strike_many(LEG, q, v, ball, contact)
    lists = kd.strike_many(LEG, q, v, [ball] * 2, [contact] * 2)
    assert (one.impulse == lists.impulse).all()
    assert one.ball_after.velocity.shape == (2, 3)
    assert kd.strike_many(LEG, q[:0], v[:0], ball, contact).impulse.shape == (0, 3)


def test_a_leg_without_machine_code():
    leg = floating_leg(np.random.default_rng(1))
    q, v = np.array([leg.configuration()] * 2), np.array([np.ones(leg.nv), 2 * np.ones(leg.nv)])
    normal = leg.posture(q[0]).point_velocity(v[0])
    many = kd.strike_many(leg, q, v, kd.Ball(), kd.Contact(normal, 0.5))
    for i in range(2):
        one = kd.strike(leg.posture(q[i]), v[i], kd.Ball(), kd.Contact(normal, 0.5))
        assert many.impulse[i].tolist() == one.impulse.tolist()


def test_slopes_are_those_of_the_sensitivity():
    q, v = np.array([[0.7, 0.5, -0.3], [0.3, 0.6, 0.1]]), np.array([[6.6, -14.5, 6.6]] * 2)
    for friction in (0.02, 0.4):
        contact = kd.Contact((2, 0.1, 1), 0.8, friction)
        slopes = kd.strike_many(LEG, q, v, kd.Ball(), contact, slopes=True).slopes
        for i in range(2):
            exact = kd.strike(LEG.posture(q[i]), v[i], kd.Ball(), contact).sensitivity()
            for by in ("q", "v"):
                for of in ("velocity", "spin"):
                    found = getattr(slopes, f"{of}_by_{by}")[i]
                    scale = np.abs(getattr(exact, of)[by]).max()
                    assert found == pytest.approx(getattr(exact, of)[by], abs=1e-7 * scale)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"q": [0.1, 0.2, 0.3]}, r"q has shape \(3,\): it must be \(n, 3\); strike takes one"),
        ({"v": np.ones((3, 3))}, "q has 2 rows and v 3"),
        ({"law": "stronge"}, "impact law is 'stronge': strike_many takes 'newton'"),
        ({"ball": [kd.Ball()] * 3}, "ball has length 3: it must be one or 2"),
        ({"contact": "x"}, "contact is 'x': it must be a Contact or 2 of them"),
        ({"ball_spin": np.ones((3, 3))}, r"ball spin has shape \(3, 3\): .* \(3,\) or \(2, 3\)"),
        ({"slopes": "yes"}, "slopes is 'yes': it must be True or False"),
        ({"v": [[np.nan] * 3] * 2}, "v is .*: every entry must be finite"),
    ],
)
def test_bad_input(changes, words):
    given = {"q": np.ones((2, 3)), "v": np.ones((2, 3)), "ball": kd.Ball()}
    given |= {"contact": kd.Contact((1, 0, 0))} | changes
    with pytest.raises(kd.InvalidInput, match=words) as caught:
        kd.strike_many(LEG, **given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda leg, rows: leg.posture(rows),
            r"q has shape \(5, 3\).*; strike_many takes \(n, 3\)",
        ),
        (
            lambda leg, rows: kd.strike(leg.posture(rows[0]), rows, *PARTS),
            r"v has shape \(5, 3\).*; strike_many takes \(n, 3\)",
        ),
        (
            lambda leg, rows: kd.strike(leg.posture(rows[0]), rows[0], *PARTS, ball_spin=rows),
            r"ball spin has shape \(5, 3\).*; strike_many takes \(n, 3\)",
        ),
        (lambda _, rows: kd.fly(kd.BallState(velocity=rows), kd.Ball()), "fly_many takes many"),
        (
            lambda _, rows: kd.follow(kd.BallState(velocity=rows), kd.Ball()),
            "follow_many takes many",
        ),
        (
            lambda leg, rows: kd.strike_many(leg, rows, rows[:4], *PARTS),
            "q has 5 rows and v 4: both must have the same number",
        ),
        (
            lambda leg, rows: kd.strike_many(leg, rows, rows, kd.Ball(), [PARTS[1]] * 2),
            "contact has length 2: it must be one or 5",
        ),
        (
            lambda *_: kd.simulate_many(kd.load_scene("volley").replace(uncertainty={}), 100),
            "the scene has no uncertainty: draws need one",
        ),
    ],
)
def test_a_wrong_number_of_rows_names_the_function_for_it(call, message):
    with pytest.raises(kd.InvalidInput, match=message) as refused:
        call(kd.Leg.human(), np.full((5, 3), 0.3))
    assert "\n" not in str(refused.value)


PARTS = kd.Ball(), kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_strikes_are_left_to_strike_in_doubt_only(friction, monkeypatch):
    rng = np.random.default_rng(6)
    q = rng.uniform(-0.4, 0.4, (24, 3))
    v = np.tile([6.6, -14.5, 6.6], (24, 1)) * rng.uniform(0.5, 1.0, (24, 1))
    monkeypatch.setattr("kickdyn.impact.strike_many.strike", None)
    contact = kd.Contact((2, 0.3, 1), 0.8, friction)
    many = kd.strike_many(LEG, q, v, kd.Ball(), contact)
    assert (many.status < 2).sum() > 12
