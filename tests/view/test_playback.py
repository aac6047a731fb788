import math
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.view import playback as motion


def hit_with(before, after):
    return SimpleNamespace(v_before=np.array(before), v_after=np.array(after))


@pytest.mark.parametrize("duration", [0.0, 1e-6, 0.1, 2.5, 1000.0])
@pytest.mark.parametrize("speed", [0.0, 1e-3, 1.0, 40.0])
def test_the_whole_flight_is_shown_in_about_four_seconds(duration, speed):
    pace = motion.kick_pace(hit_with([speed, -speed / 2], [0.0, speed / 3]), duration)
    assert len(pace.times) / motion.RATE == pytest.approx(4.0, abs=0.1)
    assert 4 < pace.end / motion.RATE < 6
    assert (np.diff(pace.times) > 0).all()
    assert pace.times[pace.impact] == pytest.approx(0, abs=1e-12)
    assert pace.times[-1] >= duration * (1 - 1e-9)
    if duration:
        assert pace.times[-1] == pytest.approx(duration)


def test_the_stated_factors_are_those_shown():
    pace = motion.kick_pace(hit_with([30.0], [20.0]), 2.5)
    steps = np.diff(pace.times) * motion.RATE
    assert pace.strike == pytest.approx(1 / steps[0])
    assert pace.flight == pytest.approx(1 / steps[-1])
    assert pace.strike > 10 * pace.flight
    assert -pace.times[0] * 30 == pytest.approx(motion.SWING_LENGTH)


def test_a_slow_kick_has_one_pace():
    pace = motion.kick_pace(hit_with([1.0], [0.5]), 0.1)
    assert pace.strike == pytest.approx(pace.flight)
    np.testing.assert_allclose(np.diff(pace.times), 1 / motion.RATE / pace.strike)


@pytest.fixture
def struck(make_kick):
    return make_kick(kd.Leg.human(), 5.0, degrees=(20, 40, 0))


def test_the_leg_passes_the_impact_with_its_velocities(struck):
    hit, step = struck[0], 1e-7
    np.testing.assert_array_equal(motion.leg_configuration(hit, 0.0), hit.posture.q)
    before = (hit.posture.q - motion.leg_configuration(hit, -step)) / step
    after = (motion.leg_configuration(hit, step) - hit.posture.q) / step
    np.testing.assert_allclose(before, hit.v_before, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(after, hit.v_after, rtol=1e-5, atol=1e-6)


def test_the_leg_stays_in_its_limits_and_comes_to_rest(struck):
    hit = struck[0]
    leg = hit.posture.leg
    far = [motion.leg_configuration(hit, time) for time in (-10.0, 0.1, 10.0, 20.0)]
    for q in far:
        assert (leg.lower <= q).all()
        assert (q <= leg.upper).all()
    np.testing.assert_allclose(far[2], far[3])
    assert np.abs(far[3] - hit.posture.q).max() <= motion.SWING_LENGTH * (1 + 1e-9)


def test_a_posture_outside_the_limits_does_not_jump(make_kick):
    hit = make_kick(kd.Leg.human(), 1.0, degrees=(-30, -20, 0))[0]
    np.testing.assert_array_equal(motion.leg_configuration(hit, 0.0), hit.posture.q)


def test_joints_that_are_no_single_number_stay_on_their_manifold():
    model = pin.buildModelFromXML(kd.Leg.human().file.text, pin.JointModelFreeFlyer())
    model.inertias[1] = pin.Inertia(10.0, np.zeros(3), 0.2 * np.eye(3))
    leg = kd.Leg.from_model(model, "toe")
    posture = leg.posture(leg.configuration({"knee": 0.5}))
    v = posture.joint_velocity([4, 1, 3])
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact([4, 1, 3], 0.8, 0.4))
    for time in (-0.3, 0.3):
        assert pin.isNormalized(model, motion.leg_configuration(hit, time), 1e-12)


def test_the_ball_rests_then_flies_and_spins(struck):
    hit, _ball, path = struck
    before = hit.ball_before
    assert not before.velocity.any()
    assert not before.spin.any()
    early = motion.ball_pose(before, path, -0.1)
    np.testing.assert_array_equal(early[:3, :3], np.eye(3))
    np.testing.assert_array_equal(early[:3, 3], hit.ball_after.position)
    late = motion.ball_pose(before, path, 0.1)
    np.testing.assert_allclose(late[:3, 3], path.sample(0.1).position)
    # It turns about the spin by the right-hand rule: the axis stays, and the angle is |spin| t.
    spin = hit.ball_after.spin
    np.testing.assert_allclose(late[:3, :3] @ spin, spin)
    angle = math.acos((np.trace(late[:3, :3]) - 1) / 2)
    assert angle == pytest.approx(np.linalg.norm(spin) * 0.1)
    step = motion.ball_pose(before, path, 1e-6)[:3, :3] @ (1, 0, 0) - (1, 0, 0)
    np.testing.assert_allclose(step / 1e-6, np.cross(spin, (1, 0, 0)), rtol=1e-3, atol=1e-3)


def test_the_ball_stays_where_it_landed(struck):
    hit, _ball, path = struck
    end = motion.ball_pose(hit.ball_before, path, path.duration + 1)
    np.testing.assert_allclose(end[:3, 3], path.landing.position)


def test_a_ball_that_came_is_shown_coming():
    leg, ball = kd.Leg.human(), kd.Ball()
    posture = leg.posture(np.radians([5, 10, -5]))
    velocity, spin = [-5.0, 1.0, 0.0], [0.0, 30.0, 4.0]
    hit = kd.strike(posture, np.zeros(3), ball, kd.Contact([1, 0, 0.3], 0.8, 0.4),
                       ball_velocity=velocity, ball_spin=spin)  # fmt: skip
    before = hit.ball_before
    np.testing.assert_allclose(before.velocity, velocity, atol=1e-8)
    np.testing.assert_allclose(before.spin, spin, atol=1e-8)
    early = motion.ball_pose(before, kd.fly(hit.ball_after, ball), -0.1)[:3, 3]
    np.testing.assert_allclose(early, hit.ball_after.position - 0.1 * np.array(velocity))


def test_a_ball_whose_spin_decays_is_shown_turning_less(struck):
    hit, ball, _ = struck
    thick = kd.Air(torque=lambda reynolds, spin_parameter: 1.0)  # a hundred times the default
    launch = kd.BallState(hit.ball_after.position, hit.ball_after.velocity, (0, -3, 0))
    path = kd.fly(launch, ball, thick)
    end = motion.ball_pose(hit.ball_before, path, path.duration + 1)[:3, :3]
    np.testing.assert_allclose(end, path.orientation(path.duration).as_matrix())
    turned = path.orientation(path.duration).magnitude()
    assert 0 < turned < 0.9 * 3 * path.duration < math.pi


def test_a_ball_on_the_ground_turns_as_it_rolls():
    ball = kd.Ball()
    start = kd.BallState((0, 0, ball.radius), (2.0, 0, 0), (0, 2.0 / ball.radius, 0))
    course = kd.follow(start, ball, None, kd.Ground(surface="turf"))
    way = course.sample(0.5).position[0]
    place = motion.ball_pose(start, course, 0.5)
    angle = math.remainder(way / ball.radius, 2 * math.pi)
    assert place[:3, :3] == pytest.approx(pin.rpy.rpyToMatrix(0, angle, 0), abs=1e-3)
    assert place[0, 3] == pytest.approx(way)


def test_a_support_stays_where_it_is():
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    leg, foot = robot.with_supports("left_ankle_roll_link"), "left_ankle_roll_link"
    posture = leg.posture(leg.configuration({"right_hip_pitch_joint": -0.3}))
    v = posture.joint_velocity([4, 0, 1])
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact((4, 0, 1), 0.8))
    data, places = leg.model.createData(), []
    for time in (0.0, -0.1, -0.02, 0.05, 3.0):
        pin.framesForwardKinematics(leg.model, data, motion.leg_configuration(hit, time))
        places.append(data.oMf[leg.model.getFrameId(foot)].copy())
    assert all(place.isApprox(places[0], 1e-12) for place in places)


@pytest.mark.parametrize("backswing", [None, 0.3])
def test_the_clock_of_the_page_shows_the_times_of_the_pictures(backswing):
    pace = motion.kick_pace(hit_with([30.0], [20.0]), 2.5, backswing)
    shown = np.interp(np.arange(len(pace.times)) / motion.RATE, *pace.knots.T)
    np.testing.assert_allclose(shown, pace.times, atol=1e-12)
