"""Kicks and traps of balls that move: followed, struck and flown again, also in moving frames."""

import pickle
import re
from types import SimpleNamespace

import numpy as np
import pytest
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.planning import moving_kick as module
from kickdyn.planning.interception import CANDIDATES, Reach, reach_of
from kickdyn.planning.kick_steps import KickSettings, SolvedKick, checked_contact, launch_for
from kickdyn.planning.kick_terms import KickObjective, KickPoint
from kickdyn.planning.moving_kick import Interceptor
from kickdyn.planning.plan_report import PlanReport

BALL, AIR = kd.Ball(), kd.Air()
HUMAN = kd.Leg.human()
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0), 5.0)
DROPPING = kd.BallState((2.2, 0.0, -0.3), (-5.0, 0.0, 0.3), (0.0, 6.0, 0.0))
ASIDE = kd.BallState((1.5, 0.6, -0.58), (-2.0, -0.9, 0.0), (8.0, -17.0, 3.0))
GOAL = kd.Goal(18, time=1.2)
BESIDE = (HUMAN, -0.7042, (14, 0.6)), (kd.Leg.testbed(), -0.75, (3, 0.25))


def interceptor(incoming, goal=GOAL, air=AIR, surface=None, reach=None, leg=HUMAN):
    options = checked_contact(None), KickObjective.JOINT_SPEED, True, surface
    settings = KickSettings(leg, goal, BALL, air, *options)
    return Interceptor(settings, incoming, reach=reach)


def struck_again(plan, incoming):
    """Return the ball before and the strike of a plan, from following the ball again."""
    course = kd.follow(incoming, BALL, AIR, plan.meeting.ground, 1e-12)
    ball = course.sample(plan.meeting.time - incoming.time)
    posture, contact = plan.leg.posture(plan.q), plan.impact.contact
    touching = posture.contact_point + BALL.radius * contact.normal
    assert touching == pytest.approx(ball.position, abs=optimized(1e-9))
    assert not plan.leg.outside_range(plan.q)
    motion = {"ball_velocity": ball.velocity, "ball_spin": ball.spin}
    return ball, kd.strike(posture, plan.v, BALL, contact, **motion)


def check(plan, goal, incoming):
    """Follow, strike and fly again, by the public names only."""
    _, hit = struck_again(plan, incoming)
    agrees(hit.ball_after.velocity, plan.launch.velocity, optimized(1e-9))
    assert hit.ball_after.spin == pytest.approx(plan.launch.spin, abs=optimized(1e-8))
    wall = kd.Plane(incoming.position + goal.target, -plan.goal.ahead, "centre")
    path = kd.fly(hit.ball_after, BALL, AIR, kd.Ground(-20.0), 1e-12, plane=wall)
    agrees(path.landing.position, incoming.position + goal.target, optimized(1e-8))
    assert plan.path.status == "at-plane"
    assert path.duration == pytest.approx(goal.time, abs=optimized(1e-7))
    assert plan.speed_use <= 1.0


@pytest.fixture(scope="module")
def rolling():
    return kd.plan_kick(HUMAN, GOAL, BALL, AIR, incoming=ROLLING)


def test_a_rolling_ball_is_met_at_the_cheapest_of_the_meetings(rolling):
    check(rolling, GOAL, ROLLING)
    kicks = [one for one in rolling.meetings if one.share == 1.0 and not one.reason]
    assert rolling.speed_use == min(meeting.speed_use for meeting in kicks)
    assert all(meeting.reason for meeting in rolling.meetings if meeting.impact is None)
    times = np.array([meeting.time for meeting in rolling.meetings])
    assert len(kicks) > 3  # followed from one to the next
    halves = 2 * (CANDIDATES - 1) * (times - times[0]) / np.ptp(times)
    assert halves == pytest.approx(halves.round(), abs=closed_form(1e4))  # all that were tried
    assert [n for n in halves.round() if n % 2 == 0] == [*range(0, 2 * CANDIDATES, 2)]
    assert np.ptp([n for n in halves.round() if n % 2 == 1]) == 2  # halfway beside the best one
    assert pickle.loads(pickle.dumps(rolling)).meeting.time == rolling.meeting.time
    chosen = kd.IncomingBall(ROLLING, meet_at=rolling.meeting.ball.position)
    again = kd.plan_kick(HUMAN, GOAL, BALL, AIR, incoming=chosen)
    assert again.meeting.time == pytest.approx(rolling.meeting.time, abs=optimized(1e-7))
    assert again.speed_use <= rolling.speed_use * 1.01


def test_the_plot_has_the_meetings_and_errors_of_10_cm(rolling):
    """In percent, milliseconds and centimetres; seen from behind, the target's right is right."""
    left, right, late = (axes.lines for axes in rolling.plot().axes)
    kicks = [meeting for meeting in rolling.meetings if meeting.impact is not None]
    assert np.ravel(left[0].get_xdata()).tolist() == [rolling.meeting.time] * 2
    times, uses, exact = np.transpose([
        (one.time, 100 * one.speed_use, 1e3 * one.landing_slopes.tolerances[0]) for one in kicks
    ])  # fmt: skip
    agrees([left[1].get_data(), late[0].get_data()], [(times, uses), (times, exact)], closed_form())
    agrees(np.hypot(*right[0].get_data()), np.full(100, 10.0), closed_form(10))
    slopes, ahead = rolling.meeting.landing_slopes, -np.eye(3)[0]
    (said,) = (line for line in PlanReport(rolling).sentences() if "10 cm" in line)
    shown = [float(number) for number in re.findall(r"([\d.]+) m[ms]", said)]  # ms, mm/s, mm
    assert shown == pytest.approx([1e3 * error for error in slopes.tolerances], rel=0.06)
    ways = slopes.time, slopes.place @ ahead, slopes.place @ -np.eye(3)[1], slopes.velocity @ ahead
    for line, way in zip(right[1:], ways, strict=True):
        amount = float(re.search(r"\d[\d.e+-]*", line.get_label())[0]) / 1e3
        _, end = np.transpose(line.get_data())
        assert np.hypot(*end) == pytest.approx(10.0)
        assert end == pytest.approx(100 * amount * np.array([-way[1], way[2]]), rel=0.06, abs=0.6)


@pytest.mark.parametrize("seed", range(6))
def test_a_planar_leg_is_placed_at_a_ball_that_rolls_beside_its_plane_within_5_deg(seed):
    draw, (leg, z, launch) = np.random.default_rng(seed), BESIDE[seed % 2]
    ahead, comes = (np.array([np.cos(x), np.sin(x), 0.0]) for x in draw.uniform(-0.087, 0.087, 2))
    speed, place = draw.uniform(1.5, 3.0), np.array([0.4, draw.uniform(0.01, 0.1), z])
    spin = np.array([comes[1], -comes[0], 0.0]) * speed / BALL.radius
    start = kd.BallState(place + 0.4 * speed * comes, -speed * comes, spin)
    goal = kd.Goal(place - start.position + np.prod(launch) * ahead, time=launch[1])
    plan = kd.plan_kick(leg, goal, BALL, AIR, incoming=kd.IncomingBall(start, meet_at=0.4))
    check(plan, goal, start)
    agrees(plan.leg.model.jointPlacements[1].translation, plan.moved, closed_form())  # of the hip
    assert "moved by (" in PlanReport(plan).sentences()[1]


def test_a_half_volley_is_met_after_its_bounce():
    ground, goal = kd.Ground(-0.82, "turf"), kd.Goal((10.0, 0.0, 0.6), time=0.9)
    bounce = kd.follow(DROPPING, BALL, AIR, ground, 1e-12).bounces[0]
    incoming = kd.IncomingBall(DROPPING, ground, bounce.time + 0.02)
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, incoming=incoming)
    assert (plan.status, plan.meeting.time) == ("met", pytest.approx(bounce.time + 0.02))
    assert plan.meeting.ball.velocity[2] > 1.0
    check(plan, goal, DROPPING)


@pytest.mark.slow
def test_a_ball_that_comes_from_aside_is_met_and_a_weaker_kick_gives_a_share():
    goal = kd.Goal((4, 1, 0), time=0.8)
    check(kd.plan_kick(G1, goal, BALL, AIR, incoming=ASIDE), goal, ASIDE)
    plan = kd.plan_kick(HUMAN, kd.Goal(45, time=1.2), BALL, AIR, incoming=ROLLING)
    before, after = plan.meeting.ball.velocity, plan.impact.ball_after.velocity
    assert 0.3 < plan.share < 1.0
    agrees(after, before + plan.share * (plan.launch.velocity - before), optimized(1e-8))
    assert plan.share == max(one.share for one in plan.meetings if one.impact is not None)
    assert plan.path.landing.position[2] == pytest.approx(plan.meeting.ground.height + BALL.radius)


def test_a_plan_is_the_same_in_a_frame_that_moves_with_the_hip():
    """In a vacuum, where nothing tells the frames apart."""
    hip, goal = np.array([2.0, 0.0, 0.2]), kd.Goal((15.0, 0.0, 0.2), time=0.8)
    there = kd.Goal(goal.target - hip * goal.time, time=goal.time)
    ball = kd.BallState((0.5, 0.0, -0.7), (-3.0, 0.0, 0.5))
    seen = kd.BallState(ball.position, ball.velocity - hip)
    here, other = (
        kd.plan_kick(leg, aim, BALL, incoming=kd.IncomingBall(state, meet_at=0.0))
        for leg, aim, state in ((HUMAN.with_base_velocity(hip), goal, ball), (HUMAN, there, seen))
    )
    assert here.share == other.share == 1.0
    agrees(here.q, other.q, optimized(1e-9))
    agrees(here.v, other.v, optimized(1e-9))
    agrees(here.launch.velocity, other.launch.velocity + hip, optimized(1e-10))
    agrees(here.impact.impulse, other.impact.impulse, optimized(1e-9))


def test_a_ball_that_is_seen_again_is_met_at_the_same_time(rolling):
    later = kd.follow(ROLLING, BALL, AIR, rolling.meeting.ground).sample(0.02)
    place, time = later.position + 0.004 * np.eye(3)[0], ROLLING.time + 0.02
    seen = kd.BallState(place, later.velocity * 1.004, later.spin, time)
    again = rolling.replan(incoming=seen)
    assert again.meeting.time == pytest.approx(rolling.meeting.time, abs=closed_form(10))
    check(again, GOAL.seen_from(seen.position - ROLLING.position, 0.02), seen)
    agrees(again.target_position, rolling.target_position, closed_form(10))
    with pytest.raises(kd.InvalidInput, match="at least 99"):
        rolling.replan(incoming=kd.BallState(later.position, later.velocity, time=99.0))


@pytest.mark.parametrize(("ball", "word"), [
    (ASIDE, None), (kd.BallState((0.4, -0.2, -0.6), (18.0, 3.0, 1.0)), "faster than its launch"),
    (kd.BallState((0.4, -0.2, -0.6), (3.0, 2.5, 3.0)), "moves away from the foot")])  # fmt: skip
def test_where_a_ball_is_and_how_it_moves_away(ball, word):
    incoming, running = kd.IncomingBall(ball, kd.Ground(-1.0, "turf")), np.array([0.5, 0.3, 0.0])
    goal = kd.Goal((9, 1, 0), time=0.9, receiver_velocity=running)
    balls = interceptor(incoming, goal)
    kick = balls.at(0.1)
    velocity, launch = kick.before.velocity, kick.launch.velocity
    impulse = launch - velocity
    agrees(kick.target.impulse, BALL.mass * impulse, closed_form(10))
    target = ball.position + goal.target + (0.1 + 0.9) * running
    agrees(kick.before.position + kick.goal.target, target, closed_form(10))
    x, y, _ = kick.target.contact.normal  # in the plane of the foot
    across = np.array([-y, x, 0.0]) / np.hypot(x, y)
    assert balls.beside(0.1) == pytest.approx(float(kick.before.position @ across))
    away, along = velocity @ impulse, velocity @ launch / np.linalg.norm(launch)
    faster = "faster than its launch" if along > np.linalg.norm(launch) else None
    assert word == ("moves away from the foot" if away > 0 else faster)
    assert (word or "") in balls.escaping(0.1)
    whole = KickObjective.JOINT_SPEED.term
    for share, term in ((1.0, whole), (0.9, module.STRONGEST)):  # of a whole or weaker kick
        found = SolvedKick(kick, None, KickPoint(None, np.array([share])), *3 * [None])
        assert found.objective is term


def test_changes_of_the_velocity_are_those_of_parabolas():
    """A kick meets a goal some time after it; of a ball without air, launches between are exact."""
    ball, hip = kd.BallState((0.6, 0.1, 0.2), (-3.0, -0.4, 1.0)), reach_of(HUMAN, BALL)
    trap, goal = kd.BallState(velocity=(1.0, 0.5, 0.0)), kd.Goal((9, 1, 0), time=0.9)
    waits, gravity = np.linspace(0.0, 0.2, 5), np.array([0.0, 0.0, -9.81])
    incoming = kd.IncomingBall(ball, kd.Ground(-9.0, "turf"))
    before = ball.velocity + np.outer(waits, gravity)
    left = goal.target - np.outer(waits, ball.velocity) - np.outer(waits**2 / 2, gravity)
    launches = left / 0.9 - 0.9 / 2 * gravity
    for wish, after, exact in ((trap, trap.velocity, slice(5)), (goal, launches, slice(0, 5, 2))):
        changes = interceptor(incoming, wish, None, reach=hip).changes(waits)
        agrees(changes[:, :2], (after - before)[:, :2], optimized(1e-9))
        agrees(changes[exact], (after - before)[exact], optimized(1e-9))


@pytest.mark.parametrize(("ball", "height"), [(ROLLING, -0.8142), (DROPPING, -0.82)])
def test_a_ball_that_rolls_is_passed_along_the_ground(ball, height):
    """Also where it was seen in the air; the impulse does not change the spin along it."""
    ground = kd.Ground(height, "carpet")
    course = kd.follow(ball, BALL, AIR, ground, 1e-12)
    lower = round(height + BALL.radius - ball.position[2], 3)
    goal = kd.Goal((7, 1, lower), time=1.5)
    leg = kd.Leg.human(height=1.8, mass=75, model="3d") if ball is ROLLING else HUMAN
    balls = interceptor(kd.IncomingBall(ball, ground), goal, surface="carpet", leg=leg)
    kick = balls.at(0.99 * course.duration)
    impulse = kick.launch.velocity - kick.before.velocity
    agrees(kick.launch.spin @ impulse, kick.before.spin @ impulse, optimized(1e-7))
    start = kd.BallState(kick.before.position, kick.launch.velocity, kick.launch.spin)
    place = kd.follow(start, BALL, AIR, ground).sample(1.5).position
    assert place[:2] == pytest.approx((ball.position + goal.target)[:2], abs=optimized())
    if ball is DROPPING:
        with pytest.raises(kd.InvalidInput, match=r"0\.4\d* m above the ground"):
            balls.at(0.0)


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_a_kick_leaves_the_spin_that_its_impulse_cannot_change(friction):
    goal, contact = kd.Goal((14, 1, 0.5), time=1.0), kd.Contact(restitution=0.8, friction=friction)
    before = kd.BallState(velocity=(-3.0, 0.5, 1.0), spin=(40.0, -9.0, 20.0))
    launch = launch_for(KickSettings(HUMAN, goal, BALL, AIR, contact), goal, before)
    impulse = BALL.mass * (launch.velocity - before.velocity)
    along = impulse / np.linalg.norm(impulse)
    kept = along * (along @ before.spin) if friction else before.spin
    agrees(launch.spin, kept, closed_form(10))
    start = kd.BallState(velocity=launch.velocity, spin=kept)
    end = kd.fly(start, BALL, AIR, kd.Ground(-9.0), 1e-12, time_limit=1.0).landing.position
    agrees(end, goal.target, optimized(1e-8))
    asked = kd.Goal(18, time=1.2, spin=(0, -10, 0))
    with pytest.raises(kd.InvalidInput, match=r"rad/s: with friction 0 "):
        kd.plan_kick(HUMAN, asked, BALL, AIR, contact=kd.Contact(friction=0.0), incoming=ROLLING)
    with pytest.raises(kd.InvalidInput, match=r"no launch .* 45 m/s"):  # the search diverges
        interceptor(kd.IncomingBall(kd.BallState((2, 0, 0), (-45, 0, 0)))).at(0.0)


def test_a_ball_behind_the_hip_by_more_than_its_radius_is_refused():
    balls = interceptor(kd.IncomingBall(ROLLING, kd.Ground(-1.0, "turf")))
    ahead, aside = np.array([0.6, 0.8, 0.0]), np.array([0.8, -0.6, 0.5])
    balls._reach = Reach(aside, 1.0, np.eye(3)[1], 0.1)
    places = [kd.BallState(2 * aside - behind * ahead) for behind in (-0.3, 0.1, 0.12)]
    *before, behind = (SimpleNamespace(ahead=ahead, before=ball) for ball in places)
    for task in before:
        balls._check_facing(task)
    with pytest.raises(kd.InvalidInput, match=r"0\.12 m behind the hip"):
        balls._check_facing(behind)


def test_of_kicks_in_which_bodies_collide_the_first_that_can_be_mended_is_taken(monkeypatch):
    def made(time, *lines):
        plan = SimpleNamespace(collisions=lines)
        kick = SimpleNamespace(time=time, plan=plan)
        kick.polished = lambda: kick
        return kick

    hits, worse, free = made(1.0, "in the ball; turn", "more"), made(2.0, "in it"), made(3.0)
    monkeypatch.setattr(module, "_plan_of", lambda kick: kick.plan)
    for kicks, mended, chosen, reasons in (
        ([hits, worse, free], {}, free.plan, {1.0: "in the ball", 2.0: "in it"}),
        ([hits, worse], {2.0: "mended"}, "mended", {1.0: "in the ball"}),
        ([hits, worse], {}, hits.plan, {}),
    ):
        monkeypatch.setattr(module, "_mended", lambda kick, by=mended: by.get(kick.time))
        found = module._without_collisions({kick.time: kick for kick in kicks})
        assert found[1:] == (chosen, reasons)


def test_a_ball_that_rests_before_it_was_to_be_met_is_met_where_it_rests(rolling):
    ground, place = rolling.meeting.ground, rolling.meeting.ball.position
    slow = kd.BallState(place, (-0.05, 0, 0), (0, -0.05 / BALL.radius, 0), ROLLING.time)
    course = kd.follow(slow, BALL, AIR, ground)
    assert course.duration < rolling.meeting.time - ROLLING.time
    met = rolling.replan(incoming=slow).meeting.ball
    agrees(met.position, course.rest.position, closed_form(1e4))
    assert met.velocity == pytest.approx(np.zeros(3), abs=closed_form(1e4))


@pytest.mark.parametrize(("leg", "incoming", "velocity"), [
    (HUMAN, ROLLING, (0.0, 0.0, 0.0)), (HUMAN, DROPPING, (0.5, 0.0, 0.0)),
    pytest.param(G1, ASIDE, (0.3, -0.4, 0.2), marks=pytest.mark.slow),
], ids=["rolling", "dropping", "aside"])  # fmt: skip
def test_a_trapped_ball_has_the_wished_velocity(leg, incoming, velocity):
    """The spin along the impulse stays, and friction takes of the other part what it can."""
    plan = kd.plan_trap(leg, incoming, BALL, AIR, velocity=velocity)
    ball, hit = struck_again(plan, incoming)
    assert hit.ball_after.velocity == pytest.approx(velocity, abs=optimized(1e-9))
    along = hit.impulse / np.linalg.norm(hit.impulse)
    assert hit.ball_after.spin @ along == pytest.approx(ball.spin @ along, abs=optimized(1e-8))
    remaining = np.linalg.norm(np.cross(hit.ball_after.spin, along))
    pressed = hit.impulse @ plan.impact.contact.normal
    rubbed = np.linalg.norm(hit.impulse - pressed * plan.impact.contact.normal)
    near = optimized(1e-8)
    assert remaining < near or rubbed == pytest.approx(0.4 * pressed, rel=near)
    assert plan.velocity_error < optimized(1e-9)
    with pytest.raises(kd.InvalidInput, match="no target"):
        _ = plan.landing_error
