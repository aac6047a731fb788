"""The impulse from the ball's motion: strikes are given back; tables of measured kicks."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from chains import random_kick, random_leg
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tolerances import closed_form, optimized, sampled

import kickdyn as kd
from kickdyn.identification.infer_impact import COVERED, LARGEST_FRICTION
from kickdyn.identification.leg_motion import LegMotion, ball_side

LEG, BALL = kd.Leg.human(), kd.Ball()


def struck(friction, angle=0.5, spin=(1.0, 2.0, 3.0), restitution=0.8, speed=8.0):
    posture = LEG.posture(np.radians([5, 10, -5]))
    contact = kd.Contact((np.cos(angle), 0.2, np.sin(angle)), restitution, friction)
    v = posture.joint_velocity([speed, 0, 0.25 * speed])
    return kd.strike(posture, v, BALL, contact, ball_spin=spin)


def inferred_from(hit, after=None, **deviations):
    return kd.infer_impact(
        hit.posture, hit.v_before, hit.ball, hit.ball_before, after or hit.ball_after, **deviations
    )


def changed(state, velocity=0.0, spin=0.0):
    return kd.BallState(state.position, state.velocity + velocity, state.spin + spin)


def slid(hit):
    """Return the ratio of the impulses across and along the normal."""
    along = hit.impulse @ hit.contact.normal
    return np.linalg.norm(hit.solution.tangential_impulses[0]) / along


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1), st.sampled_from(["newton", "stronge"]))
def test_a_strike_of_any_leg_is_given_back(seed, friction, law):
    rng = np.random.default_rng(seed)
    kick, ball = random_kick(rng, random_leg(rng), friction=friction)
    try:
        hit = kd.strike(*kick, law, **ball)
    except kd.NoImpact:
        assume(False)
    assume(hit.approach_speed > 0.1 and hit.posture.condition < 1e4)
    result, tolerance = inferred_from(hit), closed_form(1e4)
    for name, right in (
        ("impulse", hit.impulse), ("normal", hit.contact.normal), ("friction", slid(hit)),
        ("contact_point", hit.posture.contact_point), ("approach_speed", hit.approach_speed),
        ("joint_impulses", hit.joint_impulses), ("v_after", hit.v_after), ("residual", 0.0),
        ("foot_velocity", hit.foot_velocity), ("effective_mass", hit.effective_mass),
    ):  # fmt: skip
        near = {"rtol": tolerance, "atol": tolerance, "err_msg": name}
        np.testing.assert_allclose(getattr(result, name), right, **near)
    if hit.law == "newton":  # by stronge, the ratio of velocities may exceed 1
        assert result.restitution == pytest.approx(hit.contact.restitution, abs=tolerance)
        assert result.warnings == hit.posture.warnings


def test_a_spin_about_the_impulse_is_the_residual():
    """An impulse at one point does not turn the ball about itself."""
    hit = struck(0.0)
    size = np.linalg.norm(hit.impulse)
    after = changed(hit.ball_after, spin=20.0 * hit.impulse / size)
    result, share = inferred_from(hit, after), 20.0 * BALL.inertia / (BALL.radius * size)
    assert result.residual == pytest.approx(share)
    assert result.normal == pytest.approx(hit.contact.normal)
    unsure = inferred_from(hit, after, spin_deviation=(0.0, 10.0))
    assert unsure.deviations["residual"] == pytest.approx(share / 2.0, rel=optimized())
    assert any("spin" in line for line in result.warnings) > any(unsure.warnings)


def test_an_impact_warns_on_one_side_of_a_limit():
    """Of the restitution by three deviations, of the contact point by a quarter of the radius."""
    hit = struck(0.0, restitution=1.0)
    fast, start = inferred_from(hit, changed(hit.ball_after, hit.impulse)), hit.ball_before
    for share, count in ((0.99, 1), (1.01, 0)):
        spread = share * (fast.restitution - 1.0) / 3.0
        aside = start.position + np.array([0.0, 0.25 * BALL.radius / share, 0.0])
        for words, changes in (
            ("restitution is", {"deviations": {"restitution": spread}}),
            ("from the contact point", {"ball_before": replace(start, position=aside)}),
            ("residual is", {"residual": 0.05 / share}),
        ):
            lines = replace(fast, **changes).warnings
            assert sum(words in line for line in lines) == count, words


def test_deviations_are_those_of_repeated_measurements():
    hit, rng, draws, many = struck(0.3, angle=1.2), np.random.default_rng(4), 400, []
    before, after = hit.ball_before, hit.ball_after
    for _ in range(draws):
        states = [changed(state, rng.normal(0, sizes[0], 3), rng.normal(0, sizes[1], 3))
                  for state, sizes in ((before, (0.02, 0.2)), (after, (0.05, 0.5)))]  # fmt: skip
        v = hit.v_before + rng.normal(0, 0.03, 3)
        many.append(kd.infer_impact(hit.posture, v, BALL, *states))
    result = inferred_from(hit, velocity_deviation=(0.02, 0.05), spin_deviation=(0.2, 0.5),
                           joint_deviation=0.03)  # fmt: skip
    spreads = {name: np.std([getattr(one, name) for one in many])
               for name in ("restitution", "friction", "effective_mass")}  # fmt: skip
    spreads |= {
        "impulse": np.std([np.linalg.norm(one.impulse) for one in many]),
        "foot_speed": np.std([np.linalg.norm(one.foot_velocity) for one in many]),
        "ball_speed": np.std([one.ball_after.speed for one in many]),
        # the sign of the residual is lost, so that its mean square is the variance
        "residual": np.sqrt(np.mean([one.residual**2 for one in many])),
        "normal": np.linalg.norm(np.std([one.normal for one in many], axis=0)),
    }
    assert result.deviations == pytest.approx(spreads, rel=sampled(2 * draws))
    joints = np.std(np.linalg.norm([one.joint_impulses[:, :3] for one in many], axis=2), axis=0)
    joints = dict(zip(LEG.joint_names, joints, strict=True))
    assert result.joint_deviations == pytest.approx(joints, rel=sampled(2 * draws))
    drawn = [bar.get_width() for bar in result.plot().axes[0].patches]
    assert drawn == pytest.approx([*result.joint_sizes.values()])


def test_what_is_no_impact_is_refused():
    hit = struck(0.3)
    v, before, after = hit.v_before, hit.ball_before, hit.ball_after
    turning = changed(after, spin=1e4 * np.cross(hit.impulse, (0, 0, 1)))
    for arguments, options, message in (
        ((v, BALL, before, before), {}, "same before and after"), (([1.0],), {}, "ball_before"),
        ((-v, BALL, before, after), {}, f"separate at {hit.approach_speed:.3g}"),
        (([1.0], BALL, before, after), {}, "v has shape"), ((v, 1, before, after), {}, "kickdyn"),
        ((v, kd.Ball(mass=np.inf), before, after), {}, "finite"),
        ((v, BALL, before, turning), {}, "changes it by less than"),
        ((v, BALL, before, after), {"velocity_deviation": -1.0}, "below 0"),
    ):  # fmt: skip
        with pytest.raises(kd.KickdynError, match=message):
            kd.infer_impact(hit.posture, *arguments, **options)


@pytest.mark.parametrize("law", ["newton", "stronge"])
def test_without_spin_the_deviations_cover_what_friction_may_have_done(law):
    """Kicks beside the centre, which slide or stick: with the impulse as normal, e is too small."""
    leg = kd.Leg.human(height=1.65, mass=58, sex="female", model="3d", frame="instep")
    q = leg.configuration({"hip": 0.35, "knee": 0.6, "ankle": 0.7, "subtalar": 0.1})
    v, frames = np.array([5.5, 1.0, 2.0, -18.0, 1.0, 0.0]), np.arange(-0.1, -1e-4, 1 / 250)
    motion = LegMotion(
        leg, frames, np.array([pin.integrate(leg.model, q, v * t) for t in frames]),
        np.tile(1e8 * np.eye(leg.nv), (len(frames), 1, 1)), None, 1e-4, {}, {}, {}, (), (),
        tuple(range(len(frames))),
    )  # fmt: skip
    posture, rng = leg.posture(q), np.random.default_rng(1)
    foot = posture.point_velocity(v) / np.linalg.norm(posture.point_velocity(v))
    times, errors, along_impulse, stuck = np.arange(-0.1, 0.12, 1 / 250), [], [], 0
    for angle in np.radians(np.linspace(2, 40, 8)):
        beside = np.cross(foot, rng.normal(size=3))
        normal = np.cos(angle) * foot + np.sin(angle) * beside / np.linalg.norm(beside)
        contact = kd.Contact(normal, rng.uniform(0.5, 0.9), rng.uniform(0.0, 0.6))
        hit = kd.strike(posture, v, BALL, contact, law)
        path = posture.contact_point + BALL.radius * normal
        path = path + np.outer(np.maximum(times, 0.0), hit.ball_after.velocity)
        path += 1e-5 * rng.normal(size=path.shape)
        track = kd.Track(times, path)
        result = kd.infer_impact(motion, track, BALL, contact=0.0)
        after = kd.BallState(hit.ball_after.position, hit.ball_after.velocity)
        plain = kd.infer_impact(posture, v, BALL, hit.ball_before, after)
        assert result.joint_impulses == pytest.approx(hit.joint_impulses, abs=0.01)
        errors.append(result.restitution - contact.restitution)
        along_impulse.append(plain.restitution - contact.restitution)
        assert abs(errors[-1]) < COVERED * result.deviations["restitution"], angle
        turn = np.arccos(min(1.0, float(result.normal @ hit.contact.normal)))
        assert turn < COVERED * result.deviations["normal"] + 0.02, angle
        if hit.sticking:  # with this ratio of impulses, whatever the coefficient
            stuck, most = stuck + 1, min(slid(hit), LARGEST_FRICTION)
            # the mean of uniform coefficients, up to sticking; the interval includes 0
            mean = most - most**2 / (2 * LARGEST_FRICTION)
            assert result.friction == pytest.approx(mean, rel=1e-2)
            deviation = result.friction / COVERED
            assert result.deviations["friction"] == pytest.approx(deviation, rel=1e-2)
    assert stuck > 1
    # a ball that is seen far worse than the leg: its deviations are those of the impulse
    track = kd.Track(times, path + 2e-3 * rng.normal(size=path.shape))
    sides = ball_side(track, "before", -0.1, 0, 0), ball_side(track, "after", 0.015, 0.115, 0)
    spread = [float(side.velocity_deviation.mean()) for side in sides]
    plain = kd.infer_impact(posture, v, BALL, hit.ball_before, after, velocity_deviation=spread)
    seen = kd.infer_impact(motion, track, BALL, contact=0.0).joint_deviations
    assert seen == pytest.approx(plain.joint_deviations, rel=0.3)
    # a leg that is seen ten times worse: its deviations grow, but by smoothing less than that
    worse = [replace(motion, information=share * motion.information) for share in (0.1, 1e-3)]
    seen = [kd.infer_impact(one, kd.Track(times, path), BALL, contact=0.0) for one in worse]
    less, more = (result.deviations["foot_speed"] for result in seen)
    assert 3.0 * less < more < 10.0 * less
    assert np.abs(np.mean(errors)) < 0.5 * np.abs(np.mean(along_impulse))


SPEEDS = np.linspace(4.0, 20.0, 9)


def test_a_line_of_restitution_over_speed_has_the_covariance_of_polyfit():
    noise = np.random.default_rng(5).normal(0.0, 0.02, SPEEDS.size)
    impacts = [
        inferred_from(struck(0.0, restitution=0.82 - 0.01 * u + error, speed=u))
        for u, error in zip(SPEEDS, noise, strict=True)
    ]
    fit, tolerance = kd.fit_restitution(impacts), closed_form(1e4)
    speeds, values = np.array([(one.approach_speed, one.restitution) for one in impacts]).T
    line, covariance = np.polyfit(speeds, values, 1, cov=True)
    ends = np.vander([speeds.min(), speeds.max()], 2)
    assert fit.table == pytest.approx(np.column_stack([ends[:, 0], ends @ line]), rel=tolerance)
    deviations = np.sqrt((ends @ covariance @ ends.T).diagonal())
    assert fit.deviations == pytest.approx(deviations, rel=tolerance)
    scatter = np.sqrt(((np.polyval(line, speeds) - values) ** 2).sum() / 7)
    assert fit.scatter == pytest.approx(scatter, rel=tolerance)
    constant = kd.fit_restitution(impacts, knots=1).table
    assert constant == pytest.approx(np.array([[speeds.mean(), values.mean()]]), rel=tolerance)
    one = impacts[0]
    for few, knots, message in (([], 2, "0 kicks"), ([one, 1], 2, "impact 1 is 1"),
                                ([one] * 4, 2, "fewer knots"), ([one] * 4, 0, "0")):  # fmt: skip
        with pytest.raises(kd.InvalidInput, match=message):
            kd.fit_restitution(few, knots)


POSTURE = LEG.posture([0.2, 0.4, -0.1])


def inferred(speed, leg=LEG, **deviations):
    q = leg.configuration(dict(zip(LEG.joint_names, POSTURE.q.tolist(), strict=True)))
    posture = leg.posture(q)
    v = posture.joint_velocity([speed, 0.0, 1.0])
    hit = kd.strike(posture, v, BALL, kd.Contact((1, 0, 0.2), 0.7, 0.3))
    return kd.infer_impact(posture, v, BALL, hit.ball_before, hit.ball_after, **deviations)


def test_each_kick_has_values_and_deviations():
    slow, fast = inferred(10.0, joint_deviation=0.1), inferred(15.0)
    table = kd.kick_table({"slow": slow, "fast": fast})
    speed = {kick: np.linalg.norm(kick.ball_after.velocity) for kick in (slow, fast)}
    for row, column, value in (
        ("restitution", "slow", 0.7), ("foot speed [m/s]", "fast", np.hypot(15.0, 1.0)),
        ("ball speed [m/s]", "slow", speed[slow]), ("ball speed [m/s]", "fast", speed[fast]),
        ("impulse on the ball [N s]", "fast", BALL.mass * speed[fast]),
        ("effective mass [kg]", "slow", slow.effective_mass),
        ("effective mass [kg]", "slow +-", slow.deviations["effective_mass"]),
        ("foot speed [m/s]", "slow +-", slow.deviations["foot_speed"]),
        ("impulse in knee [N s]", "slow", slow.joint_sizes["knee"]),
        ("impulse in knee [N s]", "slow +-", slow.joint_deviations["knee"]),
    ):  # fmt: skip
        assert table.loc[row, column] == pytest.approx(value), (row, column)
    assert table["fast +-"].isna().all()


def test_a_table_of_kicks_of_other_joints_is_refused():
    other = kd.Leg.human(height=1.7, mass=60, model="3d")
    with pytest.raises(kd.InvalidInput, match="'b' has other joints than 'a'"):
        kd.kick_table({"a": inferred(10.0), "b": inferred(9.0, other)})
    with pytest.raises(kd.InvalidInput, match=r"^kicks is .{1,250}\.\.\.: it must map names"):
        kd.kick_table([inferred(10.0)])
