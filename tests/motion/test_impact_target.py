import numpy as np
import pytest

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for

LEG, BALL = kd.Leg.from_robot("g1", legs_only=True), kd.Ball()
BENT = {"right_hip_pitch_joint": -0.3, "right_knee_joint": 0.6}
ROUGH = kd.Contact(restitution=0.8, friction=0.4)


@pytest.mark.parametrize(
    ("friction", "spin"),
    [(0.4, (0, 0, 0)), (0.4, (0, -30, 0)), (0.5, (3, 5, -6)), (0.0, (0, 0, 0))],
)
def test_the_strike_gives_what_was_wished_for(friction, spin):
    velocity = np.array([6.0, 1.0, 2.0])
    spin = np.array(spin, float) - (np.dot(spin, velocity) / (velocity @ velocity)) * velocity
    impact_target = impact_target_for(velocity, spin, BALL, kd.Contact(None, 0.7, friction))
    posture = LEG.posture(LEG.configuration(BENT))
    v = posture.joint_velocity(impact_target.foot_velocity(posture))
    hit = kd.strike(posture, v, BALL, impact_target.contact)
    assert hit.ball_after.velocity == pytest.approx(velocity, abs=1e-12)
    assert hit.ball_after.spin == pytest.approx(spin, abs=1e-10)
    below, left = impact_target.contact_offset
    from_centre = posture.contact_point - hit.ball_after.position
    assert below == pytest.approx(from_centre[2], abs=1e-12)
    sideways = np.cross((0, 0, 1.0), velocity / np.hypot(6, 1))
    assert left == pytest.approx(sideways @ from_centre, abs=1e-12)


def test_too_much_spin_names_what_friction_allows():
    with pytest.raises(kd.InvalidInput, match=r"spin is 500 rad/s: with friction 0.4 .* at most"):
        impact_target_for(np.array([10.0, 0, 0]), np.array([0, -500.0, 0]), BALL, ROUGH)


@pytest.mark.parametrize("power", [-40, 3, 30])
def test_an_impact_target_does_not_depend_on_the_units(power):
    velocity, spin, scale = np.array([9.0, 2.0, 4.0]), np.array([0.0, -10.0, 5.0]), 2.0**power
    plain = impact_target_for(velocity, spin, BALL, ROUGH)
    heavy = impact_target_for(velocity, spin, kd.Ball(scale * BALL.mass, BALL.radius), ROUGH)
    large = impact_target_for(
        scale * velocity, spin, kd.Ball(BALL.mass, scale * BALL.radius), ROUGH
    )
    for other in (heavy, large):
        assert other.impulse.tolist() == (scale * plain.impulse).tolist()
        assert other.contact.normal.tolist() == plain.contact.normal.tolist()


@pytest.mark.parametrize("speed", [2.0, 4.0, 8.0, 16.0])
@pytest.mark.parametrize(("friction", "spin"), [(0.4, (0, -5, 0)), (0.0, (0, 0, 0))])
def test_the_way_back_knows_the_restitution_over_speed(speed, friction, spin):
    table = [[3.0, 0.9], [6.0, 0.6], [9.0, 0.7]]
    velocity = speed * np.array([0.9, 0.0, 0.4])
    target = impact_target_for(
        velocity, np.array(spin, float), BALL, kd.Contact(None, table, friction)
    )
    posture = LEG.posture(LEG.configuration(BENT))
    v = posture.joint_velocity(target.foot_velocity(posture))
    hit = kd.strike(posture, v, BALL, target.contact)
    assert hit.ball_after.velocity == pytest.approx(velocity, abs=1e-11)
    assert hit.ball_after.spin == pytest.approx(spin, abs=1e-9)
    share = posture.joint_velocity(target.foot_velocity(posture, 0.5))
    half = kd.strike(posture, share, BALL, target.contact)
    assert half.ball_after.velocity == pytest.approx(0.5 * velocity, abs=1e-11)


def test_the_gain_is_the_derivative_of_the_foot_velocity():
    target = impact_target_for(
        np.array([9.0, 0, 4.0]), np.zeros(3), BALL, kd.Contact(None, [[3, 0.9], [12, 0.5]], 0.4)
    )
    change, h = np.array([9.0, 1.0, 5.0]), 1e-4
    rows = [
        (target.foot_velocity_for(change + h * axis) - target.foot_velocity_for(change - h * axis))
        / (2 * h)
        for axis in np.eye(3)
    ]
    np.testing.assert_allclose(target.foot_gain(change), np.transpose(rows), atol=1e-8)


def test_a_restitution_that_falls_too_fast_has_no_way_back():
    with pytest.raises(kd.InvalidInput, match="a faster foot would kick a slower ball"):
        impact_target_for(
            np.array([9.0, 0, 4.0]), np.zeros(3), BALL, kd.Contact(None, [[5, 1.0], [6, 0.1]], 0.4)
        )
