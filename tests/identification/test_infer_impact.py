"""The impulse from the ball's motion: kickdyn's own strikes are given back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kickdyn as kd

LEG, BALL = kd.Leg.human(), kd.Ball()


def struck(friction, angle=0.5, spin=(1.0, 2.0, 3.0), restitution=0.8):
    posture = LEG.posture(np.radians([5, 10, -5]))
    contact = kd.Contact((np.cos(angle), 0.2, np.sin(angle)), restitution, friction)
    v = posture.joint_velocity([8, 0, 2])
    return kd.strike(posture, v, BALL, contact, ball_spin=spin)


@given(
    friction=st.floats(0, 0.8), angle=st.floats(-0.5, 1.0), restitution=st.floats(0, 1),
    spin=st.tuples(*3 * [st.floats(-50, 50)]),
)  # fmt: skip
def test_a_strike_is_given_back(friction, angle, restitution, spin):
    hit = struck(friction, angle, spin, restitution)
    found = kd.infer_impact(hit.posture, hit.v_before, BALL, hit.ball_before, hit.ball_after)
    assert found.impulse == pytest.approx(hit.impulse, abs=1e-9)
    assert found.normal == pytest.approx(hit.contact.normal, abs=1e-9)
    assert found.contact_point == pytest.approx(hit.posture.contact_point, abs=1e-9)
    assert found.restitution == pytest.approx(restitution, abs=1e-9)
    if hit.sticking:
        assert found.friction <= friction + 1e-9
    else:
        assert found.friction == pytest.approx(friction, abs=1e-9)
    assert found.joint_impulses == pytest.approx(hit.joint_impulses, abs=1e-9)
    assert found.v_after == pytest.approx(hit.v_after, abs=1e-9)
    assert found.residual < 1e-9
    assert found.warnings == hit.posture.warnings


def test_a_spin_about_the_impulse_is_no_point_contact():
    hit = struck(0.0)
    along = hit.impulse / np.linalg.norm(hit.impulse)
    after = kd.BallState(
        hit.ball_after.position, hit.ball_after.velocity, hit.ball_after.spin + 20.0 * along
    )
    found = kd.infer_impact(hit.posture, hit.v_before, BALL, hit.ball_before, after)
    size = np.linalg.norm(hit.impulse)
    assert found.residual == pytest.approx(20.0 * BALL.inertia / (BALL.radius * size), rel=1e-9)
    assert any("cannot come from an impulse at one point" in line for line in found.warnings)


def test_a_spin_too_large_for_its_impulse_is_named():
    hit = struck(0.0)
    across = np.cross(hit.impulse, (0, 0, 1))
    after = kd.BallState(hit.ball_after.position, hit.ball_after.velocity, 1e4 * across)
    found = kd.infer_impact(hit.posture, hit.v_before, BALL, hit.ball_before, after)
    assert found.residual > 1.0
    assert np.linalg.norm(found.normal) == pytest.approx(1.0)


def test_deviations_are_those_of_repeated_measurements():
    hit = struck(0.3)
    rng = np.random.default_rng(4)

    def measured():
        noise = np.r_[rng.normal(0, 0.05, 3), rng.normal(0, 0.5, 3)] * 2**0.5
        after = kd.BallState(
            hit.ball_after.position, hit.ball_after.velocity + noise[:3],
            hit.ball_after.spin + noise[3:],
        )  # fmt: skip
        return kd.infer_impact(hit.posture, hit.v_before, BALL, hit.ball_before, after)

    many = [measured() for _ in range(300)]
    found = kd.infer_impact(
        hit.posture, hit.v_before, BALL, hit.ball_before, hit.ball_after,
        velocity_deviation=0.05, spin_deviation=0.5,
    )  # fmt: skip
    for name in ("restitution", "friction"):
        spread = np.std([getattr(one, name) for one in many])
        assert found.deviations[name] == pytest.approx(spread, rel=0.15)
    assert "+-" in str(found)


def test_what_is_no_impact_is_refused():
    hit = struck(0.3)
    before, after = hit.ball_before, hit.ball_after
    with pytest.raises(kd.NoImpact, match="the same before and after"):
        kd.infer_impact(hit.posture, hit.v_before, BALL, before, before)
    with pytest.raises(kd.NoImpact, match="separate"):
        kd.infer_impact(hit.posture, -hit.v_before, BALL, before, after)
    with pytest.raises(kd.InvalidInput, match="v has shape"):
        kd.infer_impact(hit.posture, [1.0], BALL, before, after)
    for arguments in ((None, BALL, before, after), (hit.posture, 1, before, after)):
        posture, *rest = arguments
        with pytest.raises(kd.InvalidInput, match="it must be a kickdyn"):
            kd.infer_impact(posture, hit.v_before, *rest)
    many = kd.BallState(np.zeros((2, 3)))
    with pytest.raises(kd.InvalidInput, match="it must be one state"):
        kd.infer_impact(hit.posture, hit.v_before, BALL, before, many)
