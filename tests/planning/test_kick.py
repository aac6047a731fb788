import math
from pathlib import Path as FilePath
from types import SimpleNamespace

import gymnasium
import numpy as np
import pinocchio as pin
import pytest
from matplotlib.path import Path
from scipy.spatial import ConvexHull
from threadpoolctl import threadpool_limits

import kickdyn as kd
from kickdyn.planning import kick, kick_plan
from kickdyn.planning.objectives import KickObjective
from kickdyn.planning.plan_report import verdict
from kickdyn.robot.standing import hold_support

HUMAN = kd.Leg.human()
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")
OBJECTIVES = [name for name in KickObjective if name != "torque-squared"]


def check(leg, plan, ball_height=None):
    """Strike and fly again, by the public names only."""
    hit = kd.strike(leg.posture(plan.q), plan.v, plan.impact.ball, plan.impact_target.contact)
    assert hit.ball_after.velocity == pytest.approx(plan.launch.velocity, abs=1e-8)
    assert hit.ball_after.spin == pytest.approx(plan.launch.spin, abs=1e-7)
    wall = kd.Plane(hit.ball_after.position + plan.goal.target, -plan.goal.ahead, "centre")
    path = kd.fly(hit.ball_after, BALL, AIR, kd.Ground(-20.0), 1e-12, plane=wall)
    assert np.abs(path.landing.position - hit.ball_after.position - plan.goal.target).max() < 1e-6
    assert path.duration == pytest.approx(plan.launch.time, abs=1e-7)
    assert plan.landing_error < 1e-3
    assert (plan.q >= leg.lower).all()
    assert (plan.q <= leg.upper).all()
    assert (np.abs(plan.v) <= leg.velocity_limit).all()
    assert plan.speed_use <= 1
    assert plan.torque_use <= 1
    if ball_height is not None:
        assert hit.ball_after.position[2] == pytest.approx(ball_height, abs=1e-4)


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize(
    ("leg", "goal", "height"),
    [(HUMAN, kd.Goal(30, time=1.5), -0.704), (G1, kd.Goal((4, 1, 0), time=0.8), -0.58)],
)
def test_a_plan_meets_its_goal_within_all_limits(leg, goal, height, objective):
    plan = kd.plan_kick(leg, goal, BALL, AIR, objective=objective, ball_position=height)
    assert (plan.share, plan.status != "beyond-limits") == (1.0, True)
    check(leg, plan, height)


@pytest.mark.parametrize(
    "goal", [kd.Goal((4, 1, 0), time=0.8), kd.Goal((3, -1, 0), time=1.0), kd.Goal(5, time=0.6)]
)
def test_a_robot_turns_the_front_of_its_toe_to_the_ball(goal):
    """So that the ball lies ahead of the foot, not in it; elsewhere on the foot, anywhere."""

    def turned(plan):
        foot = kd.Leg.from_robot("g1", "right_ankle_roll_link", legs_only=True)
        axes = [foot.posture(plan.q).with_contact_offset(axis).contact_point for axis in np.eye(3)]
        normal = (
            np.array(axes) - foot.posture(plan.q).contact_point
        ) @ plan.impact_target.contact.normal
        return np.degrees([np.arctan2(normal[1], normal[0]), np.arcsin(normal[2])])

    for options in (
        {},
        {"objective": "kinetic-energy"},
        {"ball_position": -0.58},
        {"limits": False},
    ):
        side, up = turned(kd.plan_kick(G1, goal, BALL, AIR, **options))
        assert abs(side) < 15.01
        assert -0.01 < up < 60.01
    side, up = turned(
        kd.plan_kick(G1, goal, BALL, AIR, contact=kd.Contact(friction=0.4, offset=(0, 0, 0)))
    )
    assert abs(side) > 20 or not 0 < up < 60


def test_each_objective_is_best_at_its_own():
    goal = kd.Goal(20, time=1.2)
    plans = {name: kd.plan_kick(HUMAN, goal, BALL, AIR, objective=name) for name in OBJECTIVES}
    rated = {
        "joint-speed": lambda plan: np.mean((plan.v / HUMAN.velocity_limit) ** 2),
        "joint-impulse": lambda plan: plan.impact.worst_joint[1],
        "kinetic-energy": lambda plan: 0.5 * plan.v @ plan.impact.posture.inertia @ plan.v,
    }
    for name, rate in rated.items():
        own = rate(plans[name])
        assert plans[name].value == pytest.approx(own, rel=0.15)
        assert all(own <= rate(other) * (1 + 1e-3) for other in plans.values())


def test_no_other_joint_velocity_of_that_posture_is_slower():
    plan = kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR)
    null = np.linalg.svd(plan.impact.posture.jacobian)[2][2:]
    slower = plan.v / HUMAN.velocity_limit
    for way in null:
        assert abs(slower @ (way / HUMAN.velocity_limit)) < 1e-3


def test_spin_is_given_as_asked():
    plan = kd.plan_kick(HUMAN, kd.Goal(15, time=1, spin=(0, -20, 0)), BALL, AIR)
    assert plan.impact.ball_after.spin == pytest.approx([0, -20, 0], abs=1e-8)
    check(HUMAN, plan)


def test_a_planar_leg_is_turned_towards_a_goal_aside():
    goal = kd.Goal((20, 3.4, 2.2), over=(9.15, 2.05))
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR)
    assert plan.heading == pytest.approx(plan.launch.azimuth)
    assert plan.heading > 0.1
    check(plan.leg, plan)
    straight = kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR)
    assert straight.heading == 0
    assert straight.leg is HUMAN


def test_a_pass_is_struck_and_rolls_to_its_target():
    goal = kd.Goal((4, 1, 0), time=2)
    plan = kd.plan_kick(G1, goal, BALL, AIR, surface="carpet")
    assert plan.status == "met"
    assert plan.landing_error < 1e-3
    ground = kd.Ground(plan.impact.ball_after.position[2] - BALL.radius, "carpet")
    course = kd.follow(plan.impact.ball_after, BALL, AIR, ground, time_limit=10)
    where = course.sample(2.0).position - plan.impact.ball_after.position
    assert where == pytest.approx(goal.target, abs=1e-5)
    assert plan.path.launch.velocity == pytest.approx(plan.launch.velocity, abs=1e-9)
    height = plan.impact.ball_after.position[2]
    assert plan.path.sample([0.0, 0.5, 1.5]).position[:, 2] == pytest.approx(height, abs=1e-6)


def test_a_pass_rolls_where_rounding_lifts_the_ball():
    """Its upward speed is a few 1e-18 m/s at some of these heights, which differ by processor."""
    bolt, ball = kd.Leg.from_robot("bolt", legs_only=True), kd.Ball(0.05, 0.04)
    for height in (-0.34, -0.32, -0.3):
        goal = kd.Goal(1, time=1)
        plan = kd.plan_kick(bolt, goal, ball, AIR, surface="carpet", ball_position=height)
        assert plan.landing_error < 1e-9
        assert abs(plan.impact.ball_after.velocity[2]) < 1e-15


def test_a_pass_that_comes_late_says_so():
    plan = kd.plan_kick(HUMAN, kd.Goal(15, time=0.55), BALL, AIR, surface="carpet")
    assert plan.status == "beyond-limits"
    assert plan.landing_error < 1e-3
    assert plan.time_error == pytest.approx(plan.path.duration - 0.55)
    assert plan.time_error > 0.02


def test_a_way_through_the_ground_is_refused():
    with pytest.raises(kd.InvalidInput, match="lead through the ground; the nearest is time"):
        kd.plan_kick(HUMAN, kd.Goal(25, time=0.8, spin=(0, -80, 0)), BALL, AIR, limits=False)


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        (kd.Goal(4, apex=1), "must have a time or a speed"),
        (kd.Goal((4, 0, 1), time=1), "a target as high as the ball"),
        (
            kd.Goal(4, time=60),
            "out of reach: a slower ball stops before the target; the nearest is 3.655 s",
        ),
        (kd.Goal(4, time=1, spin=(5, 0, 0)), r"spin has 4.995\d* rad/s along the pass"),
    ],
)
def test_a_pass_that_cannot_be(goal, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_kick(G1, goal, BALL, AIR, surface="carpet")


def test_a_goal_beyond_the_limits_gives_the_hardest_kick_in_its_direction():
    goal = kd.Goal(100, time=3)
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR)
    assert plan.status == "beyond-limits"
    assert 0.3 < plan.share < 0.8
    assert plan.impact.ball_after.velocity == pytest.approx(
        plan.share * plan.launch.velocity, rel=1e-7
    )
    assert plan.speed_use == pytest.approx(1, abs=1e-3)
    # it ends on the ground that the ball lay on, and misses from there
    start, end = plan.impact.ball_after.position, plan.path.landing.position
    assert plan.path.status == "landed"
    assert end[2] == pytest.approx(start[2], abs=1e-9)
    assert plan.landing_error == pytest.approx(100 - (end - start)[0])
    assert plan.path.range == pytest.approx(
        kd.fly(plan.impact.ball_after, BALL, AIR).range, abs=1e-6
    )
    assert plan.time_error == pytest.approx(plan.path.duration - 3)
    lifted = kd.plan_kick(HUMAN, goal, BALL, AIR, limits=False)
    assert lifted.status == "met"
    assert lifted.speed_use > 1
    assert lifted.landing_error < 1e-3


def test_the_same_plan_again():
    first, again = (kd.plan_kick(G1, kd.Goal(3, time=0.7), BALL, AIR) for _ in range(2))
    assert first.q.tolist() == again.q.tolist()


@pytest.mark.parametrize(
    ("goal", "options", "words"),
    [
        (
            kd.Goal(30, time=1.5),
            {"objective": "beauty"},
            "one of joint-speed, joint-impulse, kinetic-energy",
        ),
        (kd.Goal(15, time=1, spin=(0, 0, 20)), {}, "cannot give this spin"),
        (kd.Goal(15, time=1), {"ball_position": -2}, "can give a ball at a height of -2 m the"),
        (
            kd.Goal((10, 0, 3), apex=1),
            {},
            "no flight to the target stays that low; the nearest is apex 3 m",
        ),
        (kd.Goal(15, time=1, spin=(0, -900, 0)), {}, "with friction 0.4"),
        (
            kd.Goal(15, time=1),
            {"contact": kd.Contact((1, 0, 0))},
            r"the contact has the normal \[1.0, 0.0, 0.0\]: plan_kick computes the normal",
        ),
        (kd.Goal(15, time=1), {"ball_position": (0, 1)}, r"ball_position has shape \(2,\)"),
        (
            kd.Goal(15, time=1),
            {"ball_position": 1e10},
            "ball_position is 1e10|ball_position is 10000000000.0",
        ),
    ],
)
def test_bad_input(goal, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_kick(HUMAN, goal, BALL, None, **options)


def test_a_plan_for_the_whole_robot_is_that_for_its_leg():
    robot, goal = kd.Leg.from_robot("g1"), kd.Goal((4, 1, 0), time=0.8)
    whole, alone = (kd.plan_kick(leg, goal, BALL) for leg in (robot, G1))
    assert whole.leg is robot
    names = [name for name in robot.joint_names if robot.angles_deg(whole.q)[name]]
    angles = alone.leg.angles_deg(alone.q)
    assert [robot.angles_deg(whole.q)[name] for name in names] == pytest.approx(
        [angles[name] for name in names], abs=1e-6
    )
    assert whole.value == pytest.approx(alone.value, rel=1e-9)


@pytest.mark.parametrize(
    ("leg", "goal", "more"),
    [
        (G1, kd.Goal((4, 1, 0), time=0.8), 1.2),
        (HUMAN, kd.Goal(15, time=1), 1.04),
    ],
)
def test_from_one_place_a_kick_takes_the_least_or_the_most(leg, goal, more):
    ball = kd.Ball()
    first = kd.plan_kick(leg, goal, ball)
    there = first.impact.ball_after.position
    rated = {}
    for objective in ("joint-impulse", "most-joint-impulse", "foot-speed"):
        plan = kd.plan_kick(leg, goal, ball, objective=objective, ball_position=there)
        assert plan.share == 1.0
        assert plan.impact.ball_after.position == pytest.approx(there, abs=2e-5)
        assert plan.impact.ball_after.velocity == pytest.approx(
            first.impact.ball_after.velocity, abs=1e-9
        )
        assert plan.impact.ball_after.spin == pytest.approx(first.impact.ball_after.spin, abs=1e-9)
        assert max(plan.speed_use, plan.torque_use) <= 1
        rated[objective] = plan.impact.worst_joint[1], np.linalg.norm(plan.impact.foot_velocity)
    worst = {name: impulse for name, (impulse, _) in rated.items()}
    assert worst["most-joint-impulse"] > more * worst["joint-impulse"]
    slowest = min(speed for _, speed in rated.values())
    assert rated["foot-speed"][1] == pytest.approx(slowest, rel=1e-9)


def test_a_ball_beside_the_plane_of_the_foot_is_refused():
    with pytest.raises(kd.InvalidInput, match=r"is 0.2 m from the plane in which the foot of"):
        kd.plan_kick(HUMAN, kd.Goal(15, time=1), kd.Ball(), ball_position=(0.2, 0.2, -0.7))


def test_the_high_arc_is_kicked():
    low, high = (
        kd.plan_kick(HUMAN, kd.Goal(10, speed=14, arc=arc), BALL, AIR) for arc in ("low", "high")
    )
    assert low.launch.angle < 0.6 < 0.9 < high.launch.angle
    for plan in (low, high):
        assert plan.impact.ball_after.speed == pytest.approx(14)
        assert plan.landing_error < 1e-3


FOOT = "left_ankle_roll_link"
STANDING = kd.Leg.from_robot("g1", base="floating", legs_only=True).with_supports(
    kd.Support(FOOT, friction=0.7)
)


@pytest.fixture(scope="module")
def standing():
    """A kick of G1 on its left foot."""
    return kd.plan_kick(STANDING, kd.Goal(3, time=0.4), BALL, AIR)


def frame_pose(leg, q, name):
    data = leg.model.createData()
    pin.framesForwardKinematics(leg.model, data, q)
    return data.oMf[leg.model.getFrameId(name)]


def test_a_standing_robot_meets_its_goal_on_the_ground(standing):
    plan = standing
    assert plan.status == "met"
    assert plan.landing_error < 1e-6
    again = kd.strike(plan.leg.posture(plan.q), plan.v, BALL, plan.impact_target.contact)
    assert again.ball_after.velocity == pytest.approx(plan.launch.velocity, abs=1e-9)
    assert plan.impact.ball_before.position[2] == pytest.approx(BALL.radius, abs=1e-4)
    assert plan.impact.footing == {FOOT: "turns"}
    (support,) = plan.leg.constraints.supports
    foot = frame_pose(plan.leg, plan.q, FOOT)
    corners = support.sole @ foot.rotation.T + foot.translation
    assert corners[:, 2] == pytest.approx(0.0, abs=1e-12)
    centre = pin.centerOfMass(plan.leg.model, plan.leg.model.createData(), plan.q)[:2]
    assert Path(corners[ConvexHull(corners[:, :2]).vertices, :2]).contains_point(centre)
    assert plan.balance >= 0.0
    for name in plan.leg.single_joints:
        low, high = plan.leg.joint_range(name)
        assert low <= plan.leg.joint_values(plan.q)[name] <= high
    limit = plan.leg.velocity_limit[6:]
    assert (np.abs(plan.v[6:]) <= limit).all()
    assert not any("under the ground at the impact" in line for line in plan.warnings)


@pytest.mark.parametrize("goal", [None, kd.Goal(1.5, time=0.5)])
def test_the_trunk_of_a_standing_robot_is_at_most_30_degrees_from_upright(standing, goal):
    plan = standing if goal is None else kd.plan_kick(STANDING, goal, BALL, AIR)
    axis = pin.Quaternion(plan.q[3:7]).matrix()[:, 2]
    assert (plan.status, plan.impact.footing) == ("met", {FOOT: "turns"})
    assert math.degrees(math.atan2(math.hypot(axis[0], axis[1]), axis[2])) <= 30.0


def test_momentum_of_robot_and_ball_is_the_impulse_of_the_ground(standing):
    impact, model = standing.impact, standing.leg.model
    robot = []
    for v in (impact.v_before, impact.v_after):
        data = model.createData()
        pin.computeCentroidalMomentum(model, data, standing.q, v)
        p = data.hg.linear.copy()
        robot.append(np.concatenate([p, data.hg.angular + np.cross(data.com[0], p)]))
    ball = []
    for state in (impact.ball_before, impact.ball_after):
        p = BALL.mass * state.velocity
        ball.append([*p, *(np.cross(state.position, p) + BALL.inertia * state.spin)])
    wrench = impact.support_impulses[FOOT]
    place = frame_pose(standing.leg, standing.q, FOOT).translation
    ground = [*wrench[:3], *(wrench[3:] + np.cross(place, wrench[:3]))]
    change = robot[1] - robot[0] + np.subtract(ball[1], ball[0])
    assert change == pytest.approx(ground, abs=1e-12)


def test_constrained_dynamics_from_before_the_impact_meet_the_plan(standing):
    """By Pinocchio, with the support as a constraint and torques that keep the joints' speed."""
    leg, duration, steps = standing.leg, 0.02, 20
    model = leg.model
    number = model.getFrameId(FOOT)
    frame = model.frames[number]
    place = frame_pose(leg, standing.q, FOOT)
    hold = pin.RigidConstraintModel(
        *(pin.ContactType.CONTACT_6D, model, frame.parentJoint, frame.placement),
        *(0, place, pin.LOCAL),
    )
    holds, kept = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    holds.append(hold)
    kept.append(hold.createData())
    data, other = model.createData(), model.createData()
    pin.initConstraintDynamics(model, data, holds, kept)

    def base_velocity(q, joints):
        rows = pin.computeFrameJacobian(model, other, q, number, pin.LOCAL)
        return np.concatenate([np.linalg.solve(rows[:, :6], -rows[:, 6:] @ joints), joints])

    def torque(time):
        """The torque at a posture on the straight line of the joints, by inverse dynamics."""
        q = held(time)
        v = base_velocity(q, standing.v[6:])
        pin.forwardKinematics(model, other, q, v, np.zeros(model.nv))
        bias = pin.getFrameAcceleration(model, other, number, pin.LOCAL).vector
        rows = pin.computeFrameJacobian(model, other, q, number, pin.LOCAL)
        a = np.zeros(model.nv)
        a[:6] = np.linalg.solve(rows[:, :6], -bias)
        needed = pin.rnea(model, other, q, v, a)
        # the ground's wrench balances the base; it loads the joints too
        wrench = np.linalg.solve(rows[:, :6].T, needed[:6])
        return np.concatenate([np.zeros(6), needed[6:] - rows[:, 6:].T @ wrench])

    def held(time):
        q = standing.q.copy()
        q[7:] += time * standing.v[6:]
        return hold_support(standing.impact.posture, q)

    def rates(q, v, time):
        return pin.constraintDynamics(model, data, q, v, torque(time), holds, kept)

    q = held(-duration)
    v = base_velocity(q, standing.v[6:])
    step = duration / steps
    for k in range(steps):  # Runge-Kutta on the group
        time = -duration + k * step
        v1, a1 = v, rates(q, v, time)
        v2 = v + step / 2 * a1
        a2 = rates(pin.integrate(model, q, step / 2 * v1), v2, time + step / 2)
        v3 = v + step / 2 * a2
        a3 = rates(pin.integrate(model, q, step / 2 * v2), v3, time + step / 2)
        v4 = v + step * a3
        a4 = rates(pin.integrate(model, q, step * v3), v4, time + step)
        q = pin.integrate(model, q, step / 6 * (v1 + 2 * v2 + 2 * v3 + v4))
        v = v + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    assert q[7:] == pytest.approx(standing.q[7:], abs=1e-8)
    posture = leg.posture(q)
    assert posture.contact_point == pytest.approx(standing.impact.posture.contact_point, abs=1e-6)
    assert posture.jacobian @ v == pytest.approx(standing.impact.foot_velocity, abs=1e-6)


def test_a_foot_that_cannot_stand_is_held_and_named():
    """On a sole of a millimetre, in a kick for which the ground must push to the side."""
    sole = [(0.03, 0.0, -0.035), (0.031, 0.0, -0.035), (0.03, 0.001, -0.035)]
    narrow = kd.Support(FOOT, friction=0.01, sole=sole)
    plan = kd.plan_kick(STANDING.with_supports(narrow), kd.Goal((4, 1, 0), time=0.8), BALL, AIR)
    assert plan.share == 1.0
    assert plan.status == "support-moves"
    assert verdict(plan).endswith(" But the ground cannot keep the supporting foot at rest.")
    (state,) = plan.impact.footing.values()
    assert state in ("slips", "tips", "lifts-off")
    assert any(
        line.startswith(f"{FOOT} {state.replace('-', ' ')}; the plan assumes")
        for line in plan.warnings
    )


def test_a_foot_that_turns_about_the_vertical_does_not_count():
    goal = kd.Goal((4, 1, 0), time=0.8)
    plan = kd.plan_kick(STANDING, goal, BALL, AIR)
    free = kd.unilateral_strike(plan.leg.posture(plan.q), plan.v, BALL, plan.impact_target.contact)
    assert plan.impact.footing == {FOOT: "turns"}
    assert free.footing == {FOOT: "slips"}
    assert plan.status != "support-moves"  # this twist hardly changes the kick


def test_a_motion_of_a_standing_robot_without_rotors_is_warned_of():
    bare = kd.Leg.from_robot("g1", base="floating", legs_only=True, drives=False)
    lines = {
        leg: kick_plan.check_drives(SimpleNamespace(motion="planned", balance=0.01, leg=leg))
        for leg in (STANDING, bare)
    }
    assert lines[STANDING] == []
    (line,) = lines[bare]
    assert line.endswith("give their drives (Leg.with_drives, --drives FILE)")
    assert kick_plan.check_drives(SimpleNamespace(motion=None, balance=0.01, leg=bare)) == []


def test_a_floating_base_without_a_support_is_refused():
    with pytest.raises(kd.InvalidInput, match="does not stand: kicks are planned for robots on a"):
        kd.plan_kick(STANDING.with_supports(), kd.Goal(3, time=0.4), BALL, AIR)


def test_a_humanoid_of_an_mjcf_file_kicks_from_one_foot():
    file = FilePath(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    humanoid = kd.Leg.from_mjcf(file, "right_foot", base="floating").with_supports("left_foot")
    front = (0.075, 0.0, 0.1)
    plan = kd.plan_kick(
        humanoid, kd.Goal(1.5, time=0.5), BALL, AIR, contact=kd.Contact(friction=0.4, offset=front)
    )
    assert plan.share == 1.0
    assert plan.landing_error < 1e-6
    assert plan.impact.ball_before.position[2] == pytest.approx(BALL.radius, abs=1e-4)
    foot = frame_pose(plan.leg, plan.q, "left_foot")
    lowest = foot.act(np.array([0.0, 0.0, 0.1]))[2] - 0.075  # a sphere
    assert lowest == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_joints_that_do_not_move_stay_in_their_range(tmp_path, base):
    file = FilePath(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    elbow = 'name="right_elbow" pos="0 0 0" range="{}"'
    text = file.read_text().replace(elbow.format("-90 50"), elbow.format("20 90"))
    (tmp_path / "humanoid.xml").write_text(text)
    robot = kd.Leg.from_mjcf(tmp_path / "humanoid.xml", "right_foot", base=base)
    standing = robot.with_supports("left_foot") if base == "floating" else robot
    plan = kd.plan_kick(
        standing,
        kd.Goal(1.5, time=0.5),
        BALL,
        AIR,
        contact=kd.Contact(friction=0.4, offset=(0.075, 0.0, 0.1)),
    )
    assert not plan.leg.outside_range(plan.q)
    assert plan.leg.angles_deg(plan.q)["right_elbow"] == pytest.approx(20.0, abs=1e-12)


def test_a_continuous_joint_is_planned_by_its_angle(tmp_path):
    path = tmp_path / "leg.urdf"
    text = kd.Leg.human().file.text
    path.write_text(text.replace('name="ankle" type="revolute"', 'name="ankle" type="continuous"'))
    leg, goal = kd.Leg.from_urdf(path), kd.Goal(20.0, time=1.3)
    planned = kd.plan_kick(leg, goal, kd.Ball(), ball_position=-0.7042)
    assert planned.status == "met"
    assert (leg.nq, planned.q.shape) == (4, (3,))
    assert leg.posture(planned.q).contact_point == pytest.approx(
        planned.impact.posture.contact_point
    )


def test_mimic_joints_outside_the_kicking_limb_are_no_obstacle(leg_with_arm):
    """An arm of two joints that follow each other, beside a leg on a fixed base."""
    leg, goal = kd.Leg.from_urdf(leg_with_arm), kd.Goal(20.0, time=1.3)
    planned = kd.plan_kick(leg, goal, kd.Ball(), ball_position=-0.7042)
    alone = kd.plan_kick(kd.Leg.human(), goal, kd.Ball(), ball_position=-0.7042)
    assert planned.leg.joint_values(planned.q)["elbow"] == 0.3
    assert planned.impact.impulse == pytest.approx(alone.impact.impulse, rel=1e-9)
    arm_leg = kd.Leg.from_urdf(leg_with_arm, "elbow_link")
    with pytest.raises(
        kd.InvalidInput,
        match=r"joint 'elbow' mimics 'shoulder': .*lock 'shoulder', which locks both",
    ):
        kd.plan_kick(arm_leg, goal, kd.Ball())


@pytest.mark.parametrize("restitution", [((3.0, 0.85), (20.0, 0.5)), "peacock-ball", "inflated"])
@pytest.mark.parametrize("objective", ["joint-speed", "kinetic-energy"])
def test_a_plan_knows_the_restitution_over_speed(restitution, objective):
    options = {"objective": objective, "contact": kd.Contact(None, restitution, 0.4)}
    ball = kd.Ball(pressure=80e3)
    near = kd.plan_kick(HUMAN, kd.Goal(15, time=1), ball, AIR, **options)
    check(HUMAN, near)
    assert near.impact.contact.restitution == restitution
    assert near.impact.restitution == near.impact.contact.restitution_at(near.impact.approach_speed)
    assert near.warnings == ()
    far = kd.plan_kick(HUMAN, kd.Goal(45, time=2), ball, AIR, **options)
    assert far.status == "beyond-limits"
    slower = far.share * far.launch.velocity  # the same direction, although e is another
    assert far.impact.ball_after.velocity == pytest.approx(slower, abs=1e-10)


def test_a_plan_of_a_constant_table_has_the_bits_of_the_number():
    flat, goal = [[1, 0.8], [9, 0.8], [30, 0.8]], kd.Goal(15, time=1)
    for friction, options in (
        (0.4, {}),
        (0.0, {"objective": "kinetic-energy"}),
        (0.4, {"motion": True}),
    ):
        one, other = (
            kd.plan_kick(HUMAN, goal, BALL, AIR, contact=kd.Contact(None, e, friction), **options)
            for e in (0.8, flat)
        )
        assert one.q.tobytes() == other.q.tobytes()
        assert one.v.tobytes() == other.v.tobytes()
        assert one.value == other.value
        assert one.impact.impulse.tobytes() == other.impact.impulse.tobytes()
        assert (
            one.impact.ball_after.velocity.tobytes() == other.impact.ball_after.velocity.tobytes()
        )


def test_a_plan_warns_outside_the_table():
    plan = kd.plan_kick(
        HUMAN, kd.Goal(3, time=0.6), BALL, AIR, contact=kd.Contact(None, "peacock-ball", 0.4)
    )
    assert any("9.1 to 21.2 m/s" in line for line in plan.warnings)


def test_a_plan_does_not_depend_on_the_number_of_threads_of_blas():
    plans = []
    for count in (1, 2):
        with threadpool_limits(count, "blas"):
            plans.append(kd.plan_kick(STANDING, kd.Goal(3, time=0.4), BALL, AIR))
    first, second = plans
    assert (first.q == second.q).all()
    assert (first.v == second.v).all()


@pytest.mark.parametrize("leg", [HUMAN, G1], ids=["human", "g1"])
def test_a_plan_with_a_base_that_moves(leg):
    """It is met in the world, and by a slower leg than from a base at rest."""
    goal = kd.Goal(4, time=0.6) if leg is G1 else kd.Goal(25, time=1.4)
    height = -0.58 if leg is G1 else -0.704
    hip = (0.6, 0.0, 0.1), (0.0, -0.5, 0.0)
    still, running = (
        kd.plan_kick(each, goal, BALL, AIR, ball_position=height)
        for each in (leg, leg.with_base_velocity(*hip))
    )
    check(running.leg, running, height)
    assert running.leg.base_velocity.tolist() == [*hip[0], *hip[1]]
    assert running.speed_use < still.speed_use


def test_what_a_base_that_moves_cannot_do():
    aside = HUMAN.with_base_velocity((3, 1, 0))
    with pytest.raises(kd.InvalidInput, match="velocity of the base leaves the plane"):
        kd.plan_kick(aside, kd.Goal(20, time=1.2), BALL, AIR)
    frictionless = kd.Contact(restitution=0.8, friction=0.0)
    met = kd.plan_kick(aside, kd.Goal(20, time=1.2), BALL, AIR, contact=frictionless)
    assert met.impact.ball_after.velocity == pytest.approx(met.launch.velocity, abs=1e-9)
    with pytest.raises(kd.InvalidInput, match="a motion from rest to rest needs a base at rest"):
        kd.plan_kick(aside, kd.Goal(20, time=1.2), BALL, AIR, motion=True)


def test_the_height_that_a_message_names_is_on_the_ground():
    with pytest.raises(kd.InvalidInput, match=r"lies on its ground, at 0\.109817 m"):
        kick._lying_on_ground(0.1099, BALL)
    assert kick._lying_on_ground(0.109817, BALL) == 0.109817
