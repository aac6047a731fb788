"""Kicks of balls that move: followed, struck and flown again, and the same in frames that move."""

import math
import pickle

import numpy as np
import pytest
from tolerances import agrees, optimized

import kickdyn as kd
from kickdyn.planning.intercepting_kick import STRONGEST, KickSettings
from kickdyn.planning.kick_problem import best_from
from kickdyn.planning.kick_steps import checked_contact
from kickdyn.planning.moving_kick import Interceptor
from kickdyn.planning.objectives import OBJECTIVES, KickObjective

BALL, AIR = kd.Ball(), kd.Air()
HUMAN = kd.Leg.human()
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0), 5.0)
ASIDE = kd.BallState((1.5, 0.6, -0.58), (-2.0, -0.9, 0.0), (8.0, -17.0, 3.0))
FLYING = kd.BallState((4.0, 0.0, -0.3), (-9.0, 0.0, 1.5), (0.0, 5.0, 0.0))
GOAL = kd.Goal(18, time=1.2)


def check(plan, goal, incoming):
    """Follow, strike and fly again, by the public names only."""
    meeting, posture = plan.meeting, plan.leg.posture(plan.q)
    course = kd.follow(incoming, BALL, AIR, meeting.ground, 1e-12)
    ball = course.sample(meeting.time - incoming.time)
    contact = plan.impact.contact
    touching = posture.contact_point + BALL.radius * contact.normal
    assert touching == pytest.approx(ball.position, abs=1e-8)
    hit = kd.strike(
        posture, plan.v, BALL, contact, ball_velocity=ball.velocity, ball_spin=ball.spin
    )
    assert hit.sticking or not contact.friction
    agrees(hit.ball_after.velocity, plan.launch.velocity, optimized(1e-9))
    assert hit.ball_after.spin == pytest.approx(plan.launch.spin, abs=1e-7)
    agrees(hit.impulse, BALL.mass * (plan.launch.velocity - ball.velocity), optimized(1e-9))
    wall = kd.Plane(incoming.position + goal.target, -goal.ahead, "centre")
    path = kd.fly(hit.ball_after, BALL, AIR, kd.Ground(-20.0), 1e-12, plane=wall)
    assert path.landing.position == pytest.approx(incoming.position + goal.target, abs=1e-6)
    assert path.duration == pytest.approx(goal.time, abs=1e-6)
    assert not plan.leg.outside_range(plan.q)
    assert plan.speed_use <= 1.0


@pytest.fixture(scope="module")
def rolling():
    return kd.plan_kick(HUMAN, GOAL, BALL, AIR, incoming=ROLLING)


def test_a_rolling_ball_is_met_at_the_cheapest_of_the_meetings(rolling):
    check(rolling, GOAL, ROLLING)
    kicks = [one for one in rolling.meetings if one.share == 1.0 and not one.reason]
    assert rolling.speed_use == min(meeting.speed_use for meeting in kicks)
    assert all(meeting.reason for meeting in rolling.meetings if meeting.impact is None)
    assert pickle.loads(pickle.dumps(rolling)).meeting.time == rolling.meeting.time
    chosen = kd.IncomingBall(ROLLING, meet_at=rolling.meeting.ball.position)
    again = kd.plan_kick(HUMAN, GOAL, BALL, AIR, incoming=chosen)
    assert again.meeting.time == pytest.approx(rolling.meeting.time, abs=1e-6)
    assert again.speed_use <= rolling.speed_use * 1.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("leg", "goal", "incoming"),
    [
        (G1, kd.Goal((4, 1, 0), time=0.8), ASIDE),
        (HUMAN, kd.Goal((10, 0, 0.3), time=1.0), FLYING),
    ],
    ids=["aside", "flying"],
)
def test_a_ball_is_met_where_it_comes(leg, goal, incoming):
    check(kd.plan_kick(leg, goal, BALL, AIR, incoming=incoming), goal, incoming)


HIP = np.array([2.0, 0.0, 0.2])


@pytest.mark.parametrize(
    ("leg", "hip", "ball", "goal"),
    [
        pytest.param(
            G1, (1.1, 0.3, 0.0), kd.BallState((0.4, -0.08, -0.6), (-3.0, 0.3, 0.5), (2, 9, 1)),
            kd.Goal((6.0, 0.5, 0.2), time=0.8, spin=(3.0, -5.0, 2.0)), marks=pytest.mark.slow,
        ),
        (
            HUMAN, HIP, kd.BallState((0.5, 0.0, -0.7), (-3.0, 0.0, 0.5)),
            kd.Goal((15.0, 0.0, 0.2), time=0.8),
        ),
    ],
    ids=["g1", "human"],
)  # fmt: skip
def test_a_plan_is_the_same_in_a_frame_that_moves_with_the_hip(leg, hip, ball, goal):
    """In a vacuum, where nothing tells the frames apart."""
    hip = np.array(hip)
    there = kd.Goal(goal.target - hip * goal.time, time=goal.time, spin=goal.spin)
    seen = kd.BallState(ball.position, ball.velocity - hip, ball.spin)
    here, other = (
        kd.plan_kick(moving, aim, BALL, incoming=kd.IncomingBall(state, meet_at=0.0))
        for moving, aim, state in ((leg.with_base_velocity(hip), goal, ball), (leg, there, seen))
    )
    assert here.share == other.share == 1.0
    agrees(here.q, other.q, optimized(1e-9))
    agrees(here.v, other.v, optimized(1e-9))
    agrees(here.launch.velocity, other.launch.velocity + hip, optimized(1e-10))
    agrees(
        here.impact.ball_after.velocity, other.impact.ball_after.velocity + hip, optimized(1e-10)
    )
    agrees(here.impact.impulse, other.impact.impulse, optimized(1e-9))


def test_a_ball_that_is_seen_again_is_met_at_the_same_time(rolling):
    later = kd.follow(ROLLING, BALL, AIR, rolling.meeting.ground).sample(0.02)
    seen = kd.BallState(
        later.position + 0.004 * np.eye(3)[0],
        later.velocity * 1.004,
        later.spin,
        ROLLING.time + 0.02,
    )
    again = rolling.replan(incoming=seen)
    assert again.meeting.time == pytest.approx(rolling.meeting.time, abs=1e-12)
    assert np.abs(again.q - rolling.q).max() < 0.1
    check(again, GOAL.seen_from(seen.position - ROLLING.position, 0.02), seen)
    agrees(again.target_position, rolling.target_position, 1e-12)
    with pytest.raises(kd.InvalidInput, match="at least 99"):
        rolling.replan(incoming=kd.BallState(later.position, later.velocity, time=99.0))


def test_a_meeting_in_which_bodies_collide_is_not_preferred():
    """The cheaper meetings with this ball have the toe in the ground."""
    plan = kd.plan_kick(HUMAN, kd.Goal((16, 0, 0.9), time=1.1), BALL, AIR, incoming=ROLLING)
    assert plan.status == "met"
    cheaper = [meeting for meeting in plan.meetings if meeting.speed_use < plan.speed_use]
    assert cheaper
    assert all("under the ground" in meeting.reason for meeting in cheaper)


@pytest.mark.slow
def test_a_plan_beyond_limits_reaches_a_share_of_the_change_of_velocity():
    goal = kd.Goal(45, time=1.2)
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, incoming=ROLLING)
    before, after = plan.meeting.ball.velocity, plan.impact.ball_after
    assert 0.3 < plan.share < 1.0
    agrees(after.velocity, before + plan.share * (plan.launch.velocity - before), optimized(1e-8))
    assert plan.share == max(one.share for one in plan.meetings if one.impact is not None)
    assert plan.target_position == pytest.approx(ROLLING.position + goal.target, abs=1e-9)


@pytest.mark.slow
def test_a_ball_that_is_kicked_downwards_flies_to_its_ground():
    seen = kd.BallState((2.0, 0.0, -0.3), (-2.5, 0.0, -5.0))
    plan = kd.plan_kick(HUMAN, kd.Goal((45, 0, 2.0), time=1.2), BALL, AIR, incoming=seen)
    assert plan.share < 1.0
    assert plan.path.landing.position[2] == pytest.approx(plan.meeting.ground.height + BALL.radius)


def settings_of(goal):
    contact = checked_contact(None)
    return KickSettings(
        goal, BALL, AIR, contact, KickObjective.JOINT_SPEED, True, None, "slsqp"
    )  # fmt: skip


@pytest.mark.parametrize("distance", [18, 45], ids=["whole launch", "weaker"])
def test_a_polished_kick_does_not_depend_on_where_the_solver_stops(distance):
    goal, weaker = kd.Goal(distance, time=1.2), distance == 45
    incoming = kd.IncomingBall(ROLLING).on_ground_of(HUMAN, BALL)
    task = Interceptor(HUMAN, settings_of(goal), incoming).at(0.66)
    problem = task.problem()
    objective = STRONGEST if weaker else OBJECTIVES[KickObjective.JOINT_SPEED]()
    best = best_from(problem, objective, problem.starts())
    other = np.append(best.x[:-1] * (1.0 - 1e-7), best.x[-1])
    polished = [task.kick(problem, problem.variables.point(x)).polished() for x in (best.x, other)]
    assert (polished[0].meeting.share < 1.0) == weaker
    agrees(polished[0].chosen[0].q, polished[1].chosen[0].q, 1e-9)
    agrees(polished[0].chosen[1], polished[1].chosen[1], 1e-9)


@pytest.mark.parametrize(
    ("ball", "word"),
    [
        (ASIDE, None),
        (kd.BallState((0.4, -0.2, -0.6), (18.0, 3.0, 1.0)), "faster than its launch"),
        (kd.BallState((0.4, -0.2, -0.6), (3.0, 2.5, 3.0)), "moves away from the foot"),
    ],
)
def test_where_a_ball_is_and_how_it_moves_away(ball, word):
    incoming = kd.IncomingBall(ball, kd.Ground(-1.0, surface="turf"))
    balls = Interceptor(HUMAN, settings_of(kd.Goal((9, 1, 0), time=0.9)), incoming)
    kick = balls.at(0.1)
    impulse = kick.launch.velocity - kick.before.velocity
    agrees(kick.target.impulse, BALL.mass * impulse, 1e-12)
    across = np.array([-impulse[1], impulse[0], 0.0]) / np.hypot(*impulse[:2])
    assert balls.beside(0.1) == pytest.approx(float(kick.before.position @ across))
    velocity, speed = kick.before.velocity, np.linalg.norm(kick.launch.velocity)
    away = velocity @ impulse / np.linalg.norm(impulse)
    along = velocity @ kick.launch.velocity / speed
    expected = "moves away from the foot" if away > 0 else None
    expected = expected or ("faster than its launch" if along > speed else None)
    assert expected == word
    text = balls.escaping(0.1)
    number = {None: "", "moves away from the foot": f"{away:.3g} m/s"}.get(word, f"{along:.3g} m/s")
    assert (text == "") if word is None else (word in text and number in text)


def test_changes_of_velocity_are_those_of_the_launches():
    incoming = kd.IncomingBall(ROLLING).on_ground_of(HUMAN, BALL)
    trap = Interceptor(HUMAN, settings_of(kd.BallState(velocity=(0.5, 0, 0))), incoming)
    waits = np.array([0.5, 0.6, 0.7])
    before = trap.course.sample(waits).velocity
    agrees(trap.changes(waits), [0.5, 0, 0] - before, 1e-12)
    kick = Interceptor(HUMAN, settings_of(GOAL), incoming)
    assert not kick.changes(waits).any()  # of a leg that is not turned it does not count


@pytest.mark.parametrize(
    ("incoming", "options", "words"),
    [
        (kd.BallState((0.4, -0.3, -0.5), (0, 0.6, 0)), {}, "leaves the plane|does not cross it"),
        (ROLLING, {"motion": True}, "exclude each other"),
        (ROLLING, {"ball_position": -0.7}, "exclude each other"),
    ],
)
def test_a_ball_that_cannot_be_met(incoming, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_kick(HUMAN, kd.Goal(14, time=0.6), BALL, AIR, incoming=incoming, **options)


def test_a_plan_of_a_ball_at_rest_is_not_planned_again():
    plan = kd.plan_kick(HUMAN, kd.Goal(10, time=1), BALL, AIR)
    with pytest.raises(kd.InvalidInput, match="ball at rest"):
        plan.replan(incoming=ROLLING)
    with pytest.raises(kd.InvalidInput, match="nothing to plot"):
        plan.plot()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("leg", "incoming", "words"),
    [
        (HUMAN, kd.BallState((0.3, 0, -0.7), (20, 0, 0)), "the ball (is faster|moves away)"),
        (G1, kd.BallState((0.55, -1.0, -0.6825), (0.0, 1.5, 0.0)), "no posture .* touches the"),
    ],
)
def test_a_ball_without_a_kick_has_a_reason(leg, incoming, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_kick(leg, kd.Goal(14, time=0.8), BALL, AIR, incoming=incoming)


def test_a_half_volley_is_met_after_its_bounce():
    drops = kd.BallState((2.2, 0.0, -0.3), (-5.0, 0.0, 0.3), (0.0, 6.0, 0.0))
    ground, goal = kd.Ground(-0.82, "turf"), kd.Goal((10.0, 0.0, 0.6), time=0.9)
    bounce = kd.follow(drops, BALL, AIR, ground, 1e-12).bounces[0]
    incoming = kd.IncomingBall(drops, ground, bounce.time + 0.02)
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, incoming=incoming)
    assert plan.meeting.ball.velocity[2] > 1.0
    assert math.isclose(plan.meeting.wait, bounce.time + 0.02, abs_tol=1e-12)
    check(plan, goal, drops)
