"""The impulse from the ball's motion: kickdyn's own strikes are given back."""

import math
import re

import numpy as np
import pinocchio as pin
import pytest
from chains import random_kick, random_leg
from hypothesis import assume, example, given
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.identification.leg_motion import LegMotion
from kickdyn.robot.urdf_file import shipped_urdf

LEG, BALL = kd.Leg.human(), kd.Ball()


def struck(friction, angle=0.5, spin=(1.0, 2.0, 3.0), restitution=0.8, speed=8.0):
    posture = LEG.posture(np.radians([5, 10, -5]))
    contact = kd.Contact((np.cos(angle), 0.2, np.sin(angle)), restitution, friction)
    v = posture.joint_velocity([speed, 0, 0.25 * speed])
    return kd.strike(posture, v, BALL, contact, ball_spin=spin)


def inferred(hit, after=None, **deviations):
    return kd.infer_impact(
        hit.posture, hit.v_before, hit.ball, hit.ball_before, after or hit.ball_after, **deviations
    )


def changed(state, velocity=0.0, spin=0.0):
    return kd.BallState(state.position, state.velocity + velocity, state.spin + spin)


def assert_given_back(hit):
    found = inferred(hit)
    along = hit.impulse @ hit.contact.normal
    assert found.impulse == pytest.approx(hit.impulse, abs=1e-9)
    assert found.normal == pytest.approx(hit.contact.normal, abs=1e-9)
    assert found.contact_point == pytest.approx(hit.posture.contact_point, abs=1e-9)
    assert found.approach_speed == pytest.approx(hit.approach_speed, abs=1e-9)
    used = np.linalg.norm(hit.solution.tangential_impulses[0]) / along
    assert found.friction == pytest.approx(used, abs=1e-9)
    if hit.law == "newton" and not hit.sticking:  # by stronge, sliding may turn round
        assert found.friction == pytest.approx(hit.contact.friction, abs=1e-9)
    assert found.joint_impulses == pytest.approx(hit.joint_impulses, abs=1e-9)
    assert found.v_after == pytest.approx(hit.v_after, abs=1e-9)
    assert found.residual < 1e-9
    if hit.law == "newton":  # the ratio of velocities may exceed 1 by stronge
        assert found.warnings == hit.posture.warnings
    return found


@given(
    friction=st.floats(0, 0.8), angle=st.floats(-0.5, 1.0), restitution=st.floats(0, 1),
    spin=st.tuples(*3 * [st.floats(-50, 50)]),
)  # fmt: skip
@example(friction=0.0, angle=0.0, restitution=0.0, spin=(0.0, 0.0, 0.0))
@example(friction=0.0, angle=0.0, restitution=1.0, spin=(0.0, 0.0, 0.0))
def test_a_strike_is_given_back(friction, angle, restitution, spin):
    found = assert_given_back(struck(friction, angle, spin, restitution))
    assert found.restitution == pytest.approx(restitution, abs=1e-9)


@given(
    seed=st.integers(0, 2**32 - 1),
    friction=st.floats(0, 1),
    law=st.sampled_from(["newton", "stronge"]),
)
def test_a_strike_of_any_leg_is_given_back(seed, friction, law):
    rng = np.random.default_rng(seed)
    kick, ball = random_kick(rng, random_leg(rng), friction=friction)
    try:
        hit = kd.strike(*kick, law, **ball)
    except kd.NoImpact:
        assume(False)
    assume(hit.approach_speed > 0.1 and hit.posture.condition < 1e6)
    found = assert_given_back(hit)
    if law == "newton":
        assert found.restitution == pytest.approx(hit.contact.restitution, abs=1e-9)


def test_a_spin_about_the_impulse_is_no_point_contact():
    hit = struck(0.0)
    along = hit.impulse / np.linalg.norm(hit.impulse)
    after = changed(hit.ball_after, spin=20.0 * along)
    found = inferred(hit, after)
    share = 20.0 * BALL.inertia / (BALL.radius * np.linalg.norm(hit.impulse))
    assert found.residual == pytest.approx(share, rel=1e-9)
    assert found.normal == pytest.approx(hit.contact.normal, abs=1e-9)
    assert any("at one point does not explain" in line for line in found.warnings)
    assert "warning" in str(found)
    deviation = 20.0 / 2.0
    unsure = inferred(hit, after, spin_deviation=(0.0, deviation))
    assert unsure.deviations["residual"] == pytest.approx(share / 2.0, rel=1e-6)
    assert unsure.warnings == ()


def test_a_spin_too_large_for_its_impulse_is_refused():
    hit = struck(0.0)
    after = changed(hit.ball_after, spin=1e4 * np.cross(hit.impulse, (0, 0, 1)))
    with pytest.raises(kd.InvalidInput, match="changes it by less than"):
        inferred(hit, after)
    with pytest.raises(kd.InvalidInput, match="with its deviation"):
        inferred(hit, spin_deviation=1e4)


def test_deviations_are_those_of_repeated_measurements():
    hit, rng = struck(0.3, angle=1.2), np.random.default_rng(4)
    noise = {
        "velocity_deviation": (0.02, 0.05),
        "spin_deviation": (0.2, 0.5),
        "joint_deviation": 0.03,
    }

    def measured():
        before, after = (
            changed(
                state,
                *(rng.normal(0, noise[f"{name}_deviation"][i], 3) for name in ("velocity", "spin")),
            )
            for i, state in enumerate((hit.ball_before, hit.ball_after))
        )
        v = hit.v_before + rng.normal(0, noise["joint_deviation"], 3)
        return kd.infer_impact(hit.posture, v, BALL, before, after)

    many = [measured() for _ in range(400)]
    found = inferred(hit, **noise)
    for name in ("restitution", "friction"):
        spread = np.std([getattr(one, name) for one in many])
        assert found.deviations[name] == pytest.approx(spread, rel=0.12)
    normals = np.array([one.normal for one in many])
    assert found.deviations["normal"] == pytest.approx(np.linalg.norm(normals.std(axis=0)), rel=0.1)
    # the sign of the residual is lost, so that its mean square is the variance
    residuals = np.array([one.residual for one in many])
    assert found.deviations["residual"] == pytest.approx(np.sqrt((residuals**2).mean()), rel=0.1)
    joints = np.linalg.norm([one.joint_impulses[:, :3] for one in many], axis=2)
    for name, spread in zip(hit.posture.leg.joint_names, joints.std(axis=0), strict=True):
        assert found.joint_deviations[name] == pytest.approx(spread, rel=0.12)
    masses = np.std([one.effective_mass for one in many])
    assert found.deviations["effective_mass"] == pytest.approx(masses, rel=0.12)
    assert str(found).count("+-") == 6
    assert "+-" in found._repr_html_()


def test_what_does_not_go_together_is_warned_of():
    hit = struck(0.3)
    moved = kd.BallState((9, 0, 0), hit.ball_before.velocity, hit.ball_before.spin)
    found = kd.infer_impact(hit.posture, hit.v_before, BALL, moved, hit.ball_after)
    assert any("from the contact point of the posture" in line for line in found.warnings)
    fast = changed(hit.ball_after, velocity=3 * hit.ball_after.velocity)
    assert any("outside 0 to 1" in line for line in inferred(hit, fast).warnings)
    above = changed(struck(0.3, restitution=1.0).ball_after, velocity=0.1 * hit.contact.normal)
    for deviation, count in ((0.0, 1), (0.1, 0)):
        found = inferred(struck(0.3, restitution=1.0), above, velocity_deviation=deviation)
        assert 1.0 < found.restitution < 1.03
        assert sum("outside 0 to 1" in line for line in found.warnings) == count


def test_what_is_no_impact_is_refused():
    hit = struck(0.3)
    before, after = hit.ball_before, hit.ball_after
    with pytest.raises(kd.NoImpact, match="the same before and after"):
        kd.infer_impact(hit.posture, hit.v_before, BALL, before, before)
    speed = f"{hit.approach.speed:.3g}"
    with pytest.raises(kd.NoImpact, match=f"separate at {re.escape(speed)} m/s along the normal"):
        kd.infer_impact(hit.posture, -hit.v_before, BALL, before, after)
    with pytest.raises(kd.InvalidInput, match="v has shape"):
        kd.infer_impact(hit.posture, [1.0], BALL, before, after)
    for arguments in ((None, BALL, before, after), (hit.posture, 1, before, after)):
        posture, *rest = arguments
        with pytest.raises(kd.InvalidInput, match="it must be a kickdyn"):
            kd.infer_impact(posture, hit.v_before, *rest)
    leg = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf")).with_loops(
        ("shank_pin", "rocker_b_tip")
    )
    angles = {"hip": 1.0, "rocker_b": 0.5}
    held = leg.posture(leg.close_loops(leg.configuration(angles), keep=angles))
    with pytest.raises(kd.InvalidInput, match=r"v moves .* a constraint of the leg"):
        kd.infer_impact(held, np.ones(leg.nv), BALL, before, after)
    many = kd.BallState(np.zeros((2, 3)))
    with pytest.raises(kd.InvalidInput, match="it must be one state"):
        kd.infer_impact(hit.posture, hit.v_before, BALL, before, many)
    for ball in (kd.Ball(mass=np.inf), kd.Ball(inertia_factor=np.inf)):
        with pytest.raises(kd.InvalidInput, match="finite"):
            kd.infer_impact(hit.posture, hit.v_before, ball, before, after)
    with pytest.raises(kd.InvalidInput, match="must not be below 0"):
        inferred(hit, velocity_deviation=-1.0)
    with pytest.raises(kd.InvalidInput, match="spin deviation has shape"):
        inferred(hit, spin_deviation=(1.0, 2.0, 3.0))


def measured_motion(leg, q, v, rate=250):
    """Return a motion with constant velocities that is known to 0.1 mm and 0.1 mrad."""
    times = np.arange(-0.1, -1e-4, 1 / rate)
    configurations = np.array([pin.integrate(leg.model, q, v * t) for t in times])
    information = np.tile(1e8 * np.eye(leg.nv), (len(times), 1, 1))
    nothing = (None, 1e-4, {}, {}, {}, (), ())
    return LegMotion(leg, times, configurations, information, *nothing, tuple(range(len(times))))


@pytest.mark.parametrize("law", ["newton", "stronge"])
def test_without_spin_the_deviations_cover_what_friction_may_have_done(law):
    """Kicks beside the centre, which slide or stick: with the impulse as normal, e is too small."""
    leg = kd.Leg.human(height=1.65, mass=58, sex="female", model="3d", frame="instep")
    q = leg.configuration({"hip": 0.35, "knee": 0.6, "ankle": 0.7, "subtalar": 0.1})
    v = np.array([5.5, 1.0, 2.0, -18.0, 1.0, 0.0])
    posture, rng = leg.posture(q), np.random.default_rng(1)
    foot = posture.point_velocity(v)
    foot /= np.linalg.norm(foot)
    times = np.arange(-0.1, 0.12, 1 / 250)
    motion, scores, errors, along_impulse = measured_motion(leg, q, v), [], [], []
    for angle in np.radians(np.linspace(2, 40, 8)):
        beside = np.cross(foot, rng.normal(size=3))
        normal = np.cos(angle) * foot + np.sin(angle) * beside / np.linalg.norm(beside)
        contact = kd.Contact(normal, rng.uniform(0.5, 0.9), rng.uniform(0.0, 0.6))
        hit = kd.strike(posture, v, BALL, contact, law)
        path = posture.contact_point + BALL.radius * normal
        path = path + np.outer(np.maximum(times, 0.0), hit.ball_after.velocity)
        path += 1e-5 * rng.normal(size=path.shape)
        found = kd.infer_impact(motion, kd.Track(times, path), BALL, contact=0.0)
        after = kd.BallState(hit.ball_after.position, hit.ball_after.velocity)
        plain = kd.infer_impact(posture, v, BALL, hit.ball_before, after)
        assert found.joint_impulses == pytest.approx(hit.joint_impulses, abs=0.01)
        assert found.friction <= 0.63
        (line,) = (line for line in found.warnings if "does not show the spin" in line)
        assert "with a friction between 0 and" in line
        errors.append(found.restitution - contact.restitution)
        along_impulse.append(plain.restitution - contact.restitution)
        scores.append(errors[-1] / found.deviations["restitution"])
        turn = math.acos(min(1.0, float(found.normal @ hit.contact.normal)))
        assert turn < 1.96 * found.deviations["normal"] + 0.02
    assert np.abs(scores).max() < 1.96
    assert np.abs(np.mean(errors)) < 0.5 * np.abs(np.mean(along_impulse))


SPEEDS = np.linspace(4.0, 20.0, 9)


def test_restitution_over_speed_is_given_back():
    impacts = [inferred(struck(0.3, restitution=0.9 - 0.02 * u, speed=u)) for u in SPEEDS]
    fit = kd.fit_restitution(impacts)
    speeds = [one.approach_speed for one in impacts]
    assert fit.table[:, 0] == pytest.approx([min(speeds), max(speeds)])
    assert fit.table[:, 1] == pytest.approx([0.82, 0.5], abs=1e-9)
    assert np.interp(speeds, *fit.table.T) == pytest.approx(0.9 - 0.02 * SPEEDS, abs=1e-9)
    assert fit.scatter < 1e-9
    assert fit.table.shape == (2, 2)
    assert kd.fit_restitution(impacts, knots=1).table == pytest.approx(
        np.array([[np.mean(speeds), 0.66]]), abs=1e-9
    )


def test_the_scatter_of_restitution_is_found():
    rng = np.random.default_rng(5)
    wanted = 0.7 - 0.01 * (SPEEDS - 12.0)
    off = []
    for _ in range(30):
        noise = rng.normal(0.0, 0.02, SPEEDS.size)
        impacts = [
            inferred(struck(0.0, restitution=e, speed=u))
            for u, e in zip(SPEEDS, wanted + noise, strict=True)
        ]
        fit = kd.fit_restitution(impacts)
        off.append([*(fit.table[:, 1] - wanted[[0, -1]]) / fit.deviations, fit.scatter / 0.02])
    off = np.array(off)
    assert np.sqrt((off[:, 2] ** 2).mean()) == pytest.approx(1.0, rel=0.1)
    assert (np.abs(off[:, :2]) < 2.4).mean() > 0.88  # 95 % of Student's distribution, 7 degrees
    assert "scatter of a kick" in str(fit)
    assert "+-" in fit._repr_html_()


def test_what_gives_no_table_is_refused():
    one = inferred(struck(0.3))
    for impacts, knots, message in (
        (one, 2, "must be a Sequence"),
        ([], 2, "there are 0 kicks"),
        ([one, 1], 2, "impact 1 is 1"),
        ([one, one], 2, "there are 2 kicks: a table needs one row or more"),
        ([one] * 4, 2, "take fewer knots"),
        ([one] * 4, 0, "knots is 0"),
        ([one] * 4, 1.5, "knots is 1.5"),
    ):
        with pytest.raises(kd.InvalidInput, match=message):
            kd.fit_restitution(impacts, knots)


def test_a_velocity_that_supports_or_loops_forbid_is_refused():
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    posture = robot.with_supports("left_ankle_roll_link").posture(robot.configuration())
    place = posture.contact_point + np.array([0.11, 0, 0])
    before, after = kd.BallState(place), kd.BallState(place, (5, 0, 1))
    with pytest.raises(kd.InvalidInput, match="left_ankle_roll_link"):
        kd.infer_impact(posture, np.ones(robot.nv), kd.Ball(), before, after)
