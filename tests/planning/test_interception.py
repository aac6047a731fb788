"""Where and when balls that move come within the reach of a leg."""

import math

import numpy as np
import pytest
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.planning import interception as module
from kickdyn.planning.interception import CANDIDATES, Reach, reach_of
from kickdyn.robot.ground_clearance import find_depths

BALL, AIR = kd.Ball(), kd.Air()
HUMAN = kd.Leg.human()
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
BOLT = kd.Leg.from_robot("bolt", base="floating")
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0), 5.0)
FLOOR = kd.Ground(-9.0, "turf")


def waits(incoming, reach, seconds, changes=None):
    """Return the times at which a kick is tried of a ball in the vacuum."""
    meets = incoming if isinstance(incoming, kd.IncomingBall) else kd.IncomingBall(incoming, FLOOR)
    course = meets.course(BALL, None, seconds)
    still = changes or (lambda times: np.zeros((len(times), 3)))
    return module.waits_in_reach(meets, course, reach, BALL.radius, still, lambda _: "")


def test_the_reach_is_that_of_the_straight_leg_from_the_hip():
    model, hip = HUMAN.model.copy(), np.array([0.1, 0.2, 0.3])
    model.jointPlacements[1].translation = hip
    leg = HUMAN.with_model(model)
    reach = reach_of(leg, BALL)
    draw, points = np.random.default_rng(5), []
    for q in draw.uniform(leg.lower, leg.upper, (2000, 3)):
        points.append(leg.posture(q).contact_point)
    longest = np.linalg.norm(np.array(points) - hip, axis=1).max() + BALL.radius
    assert reach.centre == pytest.approx(hip)
    assert reach.radius == pytest.approx(longest, rel=0.05)
    assert reach.across == pytest.approx([0, 1, 0], abs=closed_form(1e4))
    assert reach.beside == pytest.approx(points[0][1], abs=closed_form(1e4))
    assert reach_of(G1, BALL).across is None


@pytest.mark.parametrize("speed", [4.0, 90.0])
def test_times_within_reach_are_those_of_the_parabola(speed):
    """Past a sphere of 1 m about the origin, 0.6 m aside, before the leg until x = -r."""
    rise = 14.0 / speed
    state = kd.BallState((3.0, 0.6, 0.0), (-speed, 0.0, rise))
    times = waits(state, Reach(np.zeros(3), 1.0, None, 0.0), 1.2)
    dense = np.linspace(0.0, 4.8 / speed, 12001)
    x, z = 3.0 - speed * dense, rise * dense - 4.905 * dense**2
    inside = (x**2 + 0.36 + z**2 <= 1.0) & (x >= -BALL.radius)
    first, last = dense[inside][[0, -1]]
    assert len(times) == CANDIDATES
    expected = np.linspace(first, last, CANDIDATES + 2)[1:-1]
    assert times == pytest.approx(expected, abs=4.8 / speed / 400)


@pytest.mark.parametrize(("leg", "height", "rate", "ground"), [
    (G1, 0.5, 1.0, None), (G1, -0.9, 1.0, -0.9), (G1, 0.5, 0.0, 0.5), (G1, 0.5, 1e-17, 0.5),
    (BOLT, 0.5, 1.0, 0.0),
    (HUMAN, 0.5, 1.0, HUMAN.posture(np.zeros(3)).contact_point[2])])  # fmt: skip
def test_the_ground_is_under_the_other_foot_or_under_a_lower_ball(leg, height, rate, ground):
    ball = kd.BallState((1.0, 0.0, height + BALL.radius), (-1.0, 0.0, rate))
    level = kd.IncomingBall(ball).on_ground_of(leg, BALL).ground.height
    if ground is not None:
        assert level == pytest.approx(ground)
    for lift in (1e-3, 5e-3) if ground is None else ():
        depth = find_depths(leg, np.zeros(leg.nq), level + lift).get("left_ankle_roll_link", 0.0)
        assert depth == pytest.approx(lift if lift > 2e-3 else 0.0)


@pytest.mark.parametrize(("passes", "beside"), [(0.2, 0.0), (0.2, 0.004), (0.0, 0.0), (0.45, 0.0)])
def test_a_place_on_the_path_gives_the_time(passes, beside):
    """In the middle, at the beginning and at the end of the path, and a little beside it."""
    flies = kd.BallState((0.4, 0.0, 0.5), (-1.0, 0.0, 0.0), time=2.0)
    ground = kd.Ground(-0.79, "turf")
    point = kd.follow(flies, BALL, None, ground, 1e-12).sample(passes).position
    meets = kd.IncomingBall(flies, ground, point + np.array([0.0, beside, 0.0]))
    agrees(waits(meets, reach_of(HUMAN, BALL), 0.45), [passes], optimized(1e-11))
    timed = kd.IncomingBall(flies, ground, 2.25)
    assert waits(timed, reach_of(HUMAN, BALL), 0.45) == pytest.approx([0.25])
    ball = module.state_at(meets, meets.course(BALL, None), passes)
    assert ball.time == pytest.approx(2.0 + passes)
    assert ball.position == pytest.approx(point, abs=closed_form(1e4))


@pytest.mark.parametrize(("meet_at", "words"), [
    ((1, 2, 3), "passes it at a distance of"), (5.3, r"out of reach at meet_at: .* 0\.3 s"),
    (14.0, r"meet_at is 14 s: it must be at most .* comes to rest"),
    (6.4, "behind the leg at meet_at")])  # fmt: skip
def test_a_meeting_that_cannot_be_is_named(meet_at, words):
    meets = kd.IncomingBall(ROLLING, meet_at=meet_at).on_ground_of(HUMAN, BALL)
    course, reach = meets.course(BALL, AIR), reach_of(HUMAN, BALL)

    def forwards(times):
        return np.tile([9.0, 0.0, 3.0], (len(times), 1))

    with pytest.raises(kd.InvalidInput, match=words):
        module.waits_in_reach(meets, course, reach, BALL.radius, forwards, lambda _: "")


def test_times_in_the_plane_are_the_roots_of_the_distance():
    times = np.linspace(0.0, 2.0, 9)
    roots = module.waits_in_plane(times, lambda t: math.cos(2.0 * t))
    assert roots == pytest.approx([math.pi / 4], abs=optimized(1e-10))
    assert module.waits_in_plane(times, lambda t: 1e-9).tolist() == times.tolist()
    assert not len(module.waits_in_plane(times, lambda t: 0.5 + t))


@pytest.mark.parametrize(("state", "options", "words"), [
    (kd.BallState(velocity=(101, 0, 0)), {}, "speed of the incoming ball is 101"),
    (ROLLING, {"meet_at": (math.nan, 0, 0)}, "finite"),
    (ROLLING, {"meet_at": (1, 0)}, r"shape \(2,\)"),
    (kd.BallState(velocity=[(1, 0, 0)] * 2), {}, "several states"),
    (ROLLING, {"meet_at": 1.0}, "meet_at is 1 s: it must be at least 5 s"),
    (ROLLING, {"ground": kd.Ground(-0.7, "turf")}, r"0\.114 m in the ground"),
    (ROLLING, {"ground": kd.Ground(-0.9)}, "no surface")])  # fmt: skip
def test_bad_input(state, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.IncomingBall(state, **options).on_ground_of(HUMAN, BALL)
