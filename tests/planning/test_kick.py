"""Planned kicks: struck and flown again, within limits, and no worse than kicks that are drawn."""

import math
from itertools import pairwise
from pathlib import Path

import gymnasium
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq
from scipy.spatial import ConvexHull
from threadpoolctl import threadpool_limits
from tolerances import agrees, optimized

import kickdyn as kd
from kickdyn.planning.objectives import OBJECTIVES

HUMAN = kd.Leg.human()
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")
FOOT = "left_ankle_roll_link"
STANDING = kd.Leg.from_robot("g1", base="floating", legs_only=True).with_supports(
    kd.Support(FOOT, friction=0.7)
)
FRONT = kd.Contact(friction=0.4, offset=(0.075, 0.0, 0.1))
PLACE = 1e-6
"""Error of a ball's place [m] after a flight by `fly`."""


def check(plan, goal, height=None):
    """Strike and fly again, by the public names only, and compare with the limits."""
    leg = plan.leg
    hit = kd.strike(leg.posture(plan.q), plan.v, plan.impact.ball, plan.impact_target.contact)
    agrees(hit.ball_after.velocity, plan.launch.velocity, optimized(1e-10))
    assert hit.ball_after.spin == pytest.approx(plan.launch.spin, abs=1e-7)
    start = hit.ball_after.position
    wall = kd.Plane(start + goal.target, -goal.ahead, "centre")
    path = kd.fly(hit.ball_after, BALL, AIR, kd.Ground(-20.0), 1e-12, plane=wall)
    assert path.landing.position - start == pytest.approx(goal.target, abs=PLACE)
    assert path.duration == pytest.approx(plan.launch.time, abs=PLACE)
    assert plan.landing_error < PLACE
    assert not leg.outside_range(plan.q)
    assert (np.abs(plan.v) <= leg.velocity_limit).all()
    torque = pin.nonLinearEffects(leg.model, leg.model.createData(), plan.q, plan.v)
    moving = [
        leg.velocity_index(name) for name in leg.single_joints if plan.v[leg.velocity_index(name)]
    ]
    speed_use = (np.abs(plan.v) / leg.velocity_limit)[moving].max()
    torque_use = (np.abs(torque) / leg.effort_limit)[moving].max()
    assert (plan.speed_use, plan.torque_use) == pytest.approx((speed_use, torque_use), rel=1e-9)
    assert torque_use <= 1
    if height is not None:
        assert start[2] == pytest.approx(height, abs=1e-4)


def drawn_postures(height, normal, count):
    """Yield postures of the human leg with the ball at a height, of drawn hips and ankles."""
    draw, knees = np.random.default_rng(3), np.linspace(HUMAN.lower[1], HUMAN.upper[1], 12)
    for hip, ankle in draw.uniform(HUMAN.lower[[0, 2]], HUMAN.upper[[0, 2]], (count, 2)):

        def above(knee, hip=hip, ankle=ankle):
            point = HUMAN.posture(np.array([hip, knee, ankle])).contact_point
            return point[2] + BALL.radius * normal[2] - height

        for low, high in pairwise(knees):
            if above(low) * above(high) < 0.0:
                knee = brentq(above, low, high, xtol=1e-9)
                yield HUMAN.posture(np.array([hip, knee, ankle]))


@pytest.mark.parametrize("objective", [o for o in OBJECTIVES if o != "most-joint-impulse"])
def test_no_drawn_kick_of_the_human_leg_is_better(objective):
    """Of the least joint velocity or energy of each posture, within speed and torque limits."""
    goal, height = kd.Goal(15, time=1.1), -0.704
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, objective=objective, ball_position=height)
    assert plan.share == 1.0
    check(plan, goal, height)
    target, limit = plan.impact_target, HUMAN.velocity_limit
    model, data, values = HUMAN.model, HUMAN.model.createData(), []
    for posture in drawn_postures(height, target.contact.normal, 300):
        rows, foot = posture.jacobian[[0, 2]], target.foot_velocity(posture)[[0, 2]]
        for weights in (posture.inertia, np.diag(1 / limit**2)):
            inner = np.linalg.solve(weights, rows.T)
            v = inner @ np.linalg.solve(rows @ inner, foot)
            torque = pin.nonLinearEffects(model, data, posture.q, v)
            if (np.abs(v) > limit).any() or (np.abs(torque) > HUMAN.effort_limit).any():
                continue
            values.append({
                "joint-speed": lambda q, v: np.mean((v / limit) ** 2),
                "kinetic-energy": lambda q, v: 0.5 * v @ q.inertia @ v,
                "foot-speed": lambda q, v: np.linalg.norm(q.jacobian @ v),
                "joint-impulse": lambda q, v: kd.strike(q, v, BALL, target.contact).worst_joint[1],
            }[objective](posture, v))  # fmt: skip
    assert len(values) > 20
    smooth = 3 ** (1 / 12) if objective == "joint-impulse" else 1.0  # of the smoothed maximum
    assert plan.value <= 1.02 * smooth * min(values)


@pytest.mark.parametrize(
    "objective", ["joint-speed", pytest.param("joint-impulse", marks=pytest.mark.slow)]
)
def test_a_kick_of_g1_meets_its_goal_within_all_limits(objective):
    goal = kd.Goal((4, 1, 0), time=0.8)
    plan = kd.plan_kick(G1, goal, BALL, AIR, objective=objective, ball_position=-0.58)
    assert plan.share == 1.0
    check(plan, goal, -0.58)


def test_the_most_joint_impulse_is_more_than_the_least_from_one_place():
    goal = kd.Goal(15, time=1)
    there = kd.plan_kick(HUMAN, goal, BALL, AIR).impact.ball_after.position
    plans = {
        objective: kd.plan_kick(HUMAN, goal, BALL, AIR, objective=objective, ball_position=there)
        for objective in ("joint-impulse", "most-joint-impulse")
    }
    for plan in plans.values():
        check(plan, goal)
        agrees(plan.impact.ball_after.position, there, 1e-4)
    least, most = (plan.impact.worst_joint[1] for plan in plans.values())
    assert most > 1.04 * least


def test_spin_is_given_as_asked_and_too_much_is_refused():
    goal = kd.Goal(15, time=1, spin=(0, -20, 0))
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR)
    agrees(plan.impact.ball_after.spin, [0, -20, 0], 1e-8)
    check(plan, goal)
    with pytest.raises(kd.InvalidInput, match=r"900.*with friction 0\.4"):
        kd.plan_kick(HUMAN, kd.Goal(15, time=1, spin=(0, -900, 0)), BALL)


@pytest.mark.parametrize("side", [1, -1])
def test_a_planar_leg_is_turned_towards_a_goal_aside(side):
    goal = kd.Goal((20, 3.4 * side, 2.2), over=(9.15, 2.05))
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR)
    assert plan.heading == pytest.approx(plan.launch.azimuth)
    assert plan.heading * side > 0.1
    check(plan, goal)


@pytest.mark.parametrize("leg", [HUMAN, G1], ids=["human", "g1"])
def test_a_pass_is_struck_and_rolls_to_its_target(leg):
    goal = kd.Goal((4, 1, 0) if leg is G1 else 6, time=2)
    plan = kd.plan_kick(leg, goal, BALL, AIR, surface="carpet")
    assert plan.status != "beyond-limits"
    start = plan.impact.ball_after
    ground = kd.Ground(start.position[2] - BALL.radius, "carpet")
    place = kd.follow(start, BALL, AIR, ground, time_limit=10).sample(2.0).position
    assert place - start.position == pytest.approx(goal.target, abs=1e-5)
    assert plan.landing_error < 1e-3


def test_a_pass_beyond_limits_comes_late():
    plan = kd.plan_kick(HUMAN, kd.Goal(15, time=0.55), BALL, AIR, surface="carpet")
    assert plan.status == "beyond-limits"
    assert plan.time_error == pytest.approx(plan.path.duration - 0.55)
    assert plan.time_error > 0.02


def test_a_goal_beyond_the_limits_gives_the_hardest_kick_in_its_direction():
    goal = kd.Goal(100, time=3)
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR)
    assert plan.status == "beyond-limits"
    assert 0.3 < plan.share < 0.8
    agrees(plan.impact.ball_after.velocity, plan.share * plan.launch.velocity, 1e-7)
    assert plan.speed_use == pytest.approx(1, abs=1e-3)
    # it ends on the ground that the ball lay on, and misses from there
    start, end = plan.impact.ball_after.position, plan.path.landing.position
    assert end[2] == pytest.approx(start[2], abs=1e-9)
    assert plan.landing_error == pytest.approx(100 - (end - start)[0])
    lifted = kd.plan_kick(HUMAN, goal, BALL, AIR, limits=False)
    assert lifted.status == "met"
    assert lifted.speed_use > 1


def test_the_high_arc_is_kicked():
    plan = kd.plan_kick(HUMAN, kd.Goal(10, speed=14, arc="high"), BALL, None)
    tangent = (14**2 + math.sqrt(14**4 - (9.81 * 10) ** 2)) / (9.81 * 10)
    assert plan.launch.angle == pytest.approx(math.atan(tangent))
    agrees(plan.impact.ball_after.velocity, plan.launch.velocity, 1e-9)


@pytest.mark.parametrize(
    ("goal", "options", "words"),
    [
        (kd.Goal(30, time=1.5), {"objective": "beauty"}, "beauty.*joint-speed, joint-impulse"),
        (kd.Goal(15, time=1), {"objective": "torque-squared"}, "torque-squared"),
        (kd.Goal(15, time=1), {"objective": "joint-speed", "motion": True}, "motion=True"),
        (kd.Goal(15, time=1), {"limits": False, "motion": True}, "limits is False"),
        (kd.Goal(15, time=1), {"motion": "two"}, "motion is 'two'.*both-feet"),
        (kd.Goal(15, time=1), {"contact": kd.Contact((1, 0, 0))}, r"normal \[1.0, 0.0, 0.0\]"),
        (kd.Goal(15, time=1), {"ball_position": (0, 1)}, r"ball_position has shape \(2,\)"),
        (kd.Goal(15, time=1), {"ball_position": 1e10}, r"ball_position is 1(e\+|0{10})"),
        (kd.Goal(15, time=1), {"ball_position": (0.2, 0.2, -0.7)}, "is 0.2 m from the plane"),
        (kd.Goal((10, 0, 3), apex=1), {}, "apex 3 m"),
        (kd.Goal(4, apex=1), {"surface": "carpet"}, "must have a time or a speed"),
        (kd.Goal(4, time=60), {"surface": "carpet"}, "stops before the target"),
        (kd.Goal(4, time=1, spin=(5, 0, 0)), {"surface": "carpet"}, r"spin has [45]\.?\d* rad/s"),
    ],
)
def test_bad_input(goal, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_kick(HUMAN, goal, BALL, None, **options)


@pytest.mark.parametrize("restitution", [((3.0, 0.85), (20.0, 0.5)), "inflated"])
def test_a_plan_knows_the_restitution_over_speed(restitution):
    contact, ball, goal = (
        kd.Contact(None, restitution, 0.4),
        kd.Ball(pressure=80e3),
        kd.Goal(15, time=1),
    )
    plan = kd.plan_kick(HUMAN, goal, ball, AIR, contact=contact)
    check(plan, goal)
    assert plan.impact.restitution == plan.impact.contact.restitution_at(plan.impact.approach_speed)
    far = kd.plan_kick(HUMAN, kd.Goal(45, time=2), ball, AIR, contact=contact)
    assert far.status == "beyond-limits"
    agrees(far.impact.ball_after.velocity, far.share * far.launch.velocity, 1e-9)


def test_a_plan_warns_outside_the_data_of_its_restitution():
    contact = kd.Contact(None, "peacock-ball", 0.4)
    plan = kd.plan_kick(HUMAN, kd.Goal(3, time=0.6), BALL, AIR, contact=contact)
    assert any("9.1 to 21.2 m/s" in line for line in plan.warnings)


@pytest.mark.slow
def test_a_plan_for_the_whole_robot_is_that_for_its_leg():
    robot, goal = kd.Leg.from_robot("g1"), kd.Goal((4, 1, 0), time=0.8)
    whole, alone = (kd.plan_kick(leg, goal, BALL) for leg in (robot, G1))
    angles = alone.leg.joint_values(alone.q)
    shown = {name: robot.joint_values(whole.q)[name] for name in angles}
    assert shown == pytest.approx(angles, abs=1e-6)
    assert whole.value == pytest.approx(alone.value, rel=1e-9)


@pytest.mark.parametrize(
    "leg", [HUMAN, pytest.param(G1, marks=pytest.mark.slow)], ids=["human", "g1"]
)
def test_a_base_that_moves_lets_the_leg_be_slower(leg):
    goal = kd.Goal(4, time=0.6) if leg is G1 else kd.Goal(25, time=1.4)
    height = -0.58 if leg is G1 else -0.704
    still, running = (
        kd.plan_kick(one, goal, BALL, AIR, ball_position=height)
        for one in (leg, leg.with_base_velocity((0.6, 0.0, 0.1), (0.0, -0.5, 0.0)))
    )
    hit = kd.strike(running.leg.posture(running.q), running.v, BALL, running.impact_target.contact)
    agrees(hit.ball_after.velocity, running.launch.velocity, 1e-9)
    assert running.speed_use < still.speed_use
    assert running.landing_error < PLACE


def test_a_base_that_moves_aside_kicks_without_friction_only():
    aside = HUMAN.with_base_velocity((3, 1, 0))
    with pytest.raises(kd.InvalidInput, match="velocity of the base"):
        kd.plan_kick(aside, kd.Goal(20, time=1.2), BALL, AIR)
    frictionless = kd.Contact(restitution=0.8, friction=0.0)
    met = kd.plan_kick(aside, kd.Goal(20, time=1.2), BALL, AIR, contact=frictionless)
    agrees(met.impact.ball_after.velocity, met.launch.velocity, 1e-9)
    with pytest.raises(kd.InvalidInput, match="base at rest"):
        kd.plan_kick(aside, kd.Goal(20, time=1.2), BALL, AIR, motion=True)


@pytest.fixture(scope="module")
def standing():
    return kd.plan_kick(STANDING, kd.Goal(3, time=0.4), BALL, AIR)


def frame_pose(leg, q, name):
    data = leg.model.createData()
    pin.framesForwardKinematics(leg.model, data, q)
    return data.oMf[leg.model.getFrameId(name)]


@pytest.mark.slow
def test_a_standing_robot_kicks_a_ball_on_the_ground_from_its_foot(standing):
    assert standing.status == "met"
    again = kd.strike(
        standing.leg.posture(standing.q), standing.v, BALL, standing.impact_target.contact
    )
    agrees(again.ball_after.velocity, standing.launch.velocity, 1e-9)
    assert standing.landing_error < PLACE
    assert standing.impact.ball_before.position[2] == pytest.approx(BALL.radius, abs=1e-4)
    foot = frame_pose(standing.leg, standing.q, FOOT)
    corners = standing.leg.constraints.supports[0].sole @ foot.rotation.T + foot.translation
    assert corners[:, 2] == pytest.approx(0.0, abs=1e-12)
    centre = pin.centerOfMass(standing.leg.model, standing.leg.model.createData(), standing.q)[:2]
    edges = ConvexHull(corners[:, :2]).equations
    inside = -(edges[:, :2] @ centre + edges[:, 2]).max()
    assert standing.balance == pytest.approx(inside, abs=1e-9)
    assert inside >= 0
    assert not standing.leg.outside_range(standing.q)
    assert (np.abs(standing.v[6:]) <= standing.leg.velocity_limit[6:]).all()
    tilt = math.acos(pin.Quaternion(standing.q[3:7]).matrix()[2, 2])
    assert math.degrees(tilt) <= 30.0
    assert set(standing.impact.footing.values()) <= {"stands", "turns"}


@pytest.mark.slow
def test_momentum_of_robot_and_ball_is_the_impulse_of_the_ground(standing):
    impact, model, totals = standing.impact, standing.leg.model, []
    for v, ball in ((impact.v_before, impact.ball_before), (impact.v_after, impact.ball_after)):
        data = model.createData()
        pin.computeCentroidalMomentum(model, data, standing.q, v)
        p, of_ball = data.hg.linear.copy(), BALL.mass * ball.velocity
        angular = data.hg.angular + np.cross(data.com[0], p) + np.cross(ball.position, of_ball)
        totals.append([*(p + of_ball), *(angular + BALL.inertia * ball.spin)])
    wrench = impact.support_impulses[FOOT]
    place = frame_pose(standing.leg, standing.q, FOOT).translation
    ground = [*wrench[:3], *(wrench[3:] + np.cross(place, wrench[:3]))]
    assert np.subtract(*totals[::-1]) == pytest.approx(ground, abs=1e-11)


@pytest.mark.slow
def test_a_plan_does_not_depend_on_the_number_of_threads_of_blas(standing):
    for count in (1, 2):
        with threadpool_limits(count, "blas"):
            plan = kd.plan_kick(STANDING, kd.Goal(3, time=0.4), BALL, AIR)
        assert plan.q.tolist() == standing.q.tolist()
        assert plan.v.tolist() == standing.v.tolist()


@pytest.mark.slow
def test_a_foot_that_cannot_stand_is_held_and_named():
    """On a sole of a millimetre, in a kick for which the ground must push to the side."""
    sole = [(0.03, 0.0, -0.035), (0.031, 0.0, -0.035), (0.03, 0.001, -0.035)]
    narrow = kd.Support(FOOT, friction=0.01, sole=sole)
    plan = kd.plan_kick(STANDING.with_supports(narrow), kd.Goal((4, 1, 0), time=0.8), BALL, AIR)
    assert (plan.share, plan.status) == (1.0, "support-moves")
    (state,) = plan.impact.footing.values()
    assert any(FOOT in line and state.replace("-", " ") in line for line in plan.warnings)


def test_a_standing_robot_kicks_from_its_ground_only():
    for height in (BALL.radius + 1e-4, (0.3, 0.0, 0.2)):
        with pytest.raises(kd.InvalidInput, match="lies on its ground"):
            kd.plan_kick(STANDING, kd.Goal(3, time=0.4), BALL, ball_position=height)


@pytest.mark.slow
def test_a_humanoid_of_an_mjcf_file_kicks_with_joints_in_their_ranges(tmp_path):
    """The ball of its foot is a sphere; an elbow's range does not contain 0."""
    file = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    elbow = 'name="right_elbow" pos="0 0 0" range="{}"'
    text = file.read_text().replace(elbow.format("-90 50"), elbow.format("20 90"))
    (tmp_path / "humanoid.xml").write_text(text)
    robot = kd.Leg.from_mjcf(tmp_path / "humanoid.xml", "right_foot", base="floating")
    robot = robot.with_supports("left_foot")
    plan = kd.plan_kick(robot, kd.Goal(1.5, time=0.5), BALL, AIR, contact=FRONT)
    assert plan.share == 1.0
    assert plan.landing_error < PLACE
    foot = frame_pose(plan.leg, plan.q, "left_foot")
    assert foot.act(np.array([0.0, 0.0, 0.1]))[2] == pytest.approx(0.075, abs=1e-9)
    assert not plan.leg.outside_range(plan.q)
    assert plan.leg.angles_deg(plan.q)["right_elbow"] == pytest.approx(20.0, abs=1e-12)


def test_a_continuous_joint_is_planned_by_its_angle(tmp_path):
    path, text = tmp_path / "leg.urdf", HUMAN.file.text
    path.write_text(text.replace('name="ankle" type="revolute"', 'name="ankle" type="continuous"'))
    leg = kd.Leg.from_urdf(path)
    plan = kd.plan_kick(leg, kd.Goal(20.0, time=1.3), BALL, ball_position=-0.7042)
    assert plan.share == 1.0
    assert (leg.nq, plan.q.shape) == (4, (3,))
    agrees(leg.posture(plan.q).contact_point, plan.impact.posture.contact_point, 1e-12)


def test_mimic_joints_outside_the_kicking_limb_are_no_obstacle(leg_with_arm):
    leg, goal = kd.Leg.from_urdf(leg_with_arm), kd.Goal(20.0, time=1.3)
    plan = kd.plan_kick(leg, goal, BALL, ball_position=-0.7042)
    alone = kd.plan_kick(HUMAN, goal, BALL, ball_position=-0.7042)
    assert plan.leg.joint_values(plan.q)["elbow"] == 0.3
    agrees(plan.impact.impulse, alone.impact.impulse, 1e-9)
    arm = kd.Leg.from_urdf(leg_with_arm, "elbow_link")
    with pytest.raises(kd.InvalidInput, match=r"'elbow' mimics 'shoulder'"):
        kd.plan_kick(arm, goal, BALL)
