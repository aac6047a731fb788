"""Planned motions and shifts of the weight, against Pinocchio and an integrator."""

import copy
import re
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from planned_motions import AIR, BALL, HUMAN, SOLE, standing, swinging, waist
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline
from scipy.spatial import ConvexHull
from tolerances import agrees, closed_form, integrated, optimized

import kickdyn as kd
from kickdyn.motion import plan_motion
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.motion.kick_task import KickTask
from kickdyn.motion.motion import Motion
from kickdyn.motion.motion_record import as_recorded
from kickdyn.motion.plan_motion import ASIDE, frames_of, idle_limbs, limbs_aside
from kickdyn.motion.separation import Surroundings
from kickdyn.motion.verdict import shift_weight
from kickdyn.motion.weight_shift import Feet, split_wrench
from kickdyn.planning import kick
from kickdyn.robot.collisions import find_ball_overlaps, find_self_collisions
from kickdyn.robot.standing import StandingRobot, kicking_chain

PLANS = {"human": swinging, "g1": standing, "g1 with its waist": waist}


def times_of(motion, count=300):
    """Return times beside those of the solver and of its check."""
    draw = np.random.default_rng(1)
    return np.sort(draw.uniform(motion.begin, motion.end, count))


def check_limits(plan):
    motion, leg = plan.motion, plan.leg
    columns = [leg.velocity_index(name) for name in motion.joints]
    low, high = np.transpose([leg.joint_range(name) for name in motion.joints])
    for t in times_of(motion):
        assert (np.abs(motion.torque(t)) <= leg.effort_limit)[columns].all(), t
        assert (np.abs(motion.v(t)) <= leg.velocity_limit)[columns].all(), t
        q = motion.joint_state(t)[0]
        assert ((q >= low) & (q <= high)).all(), t


def check_impact(plan):
    motion, impact = plan.motion, plan.impact
    hit = kd.strike(plan.leg.posture(plan.q), plan.v, BALL, plan.impact_target.contact)
    agrees(hit.ball_after.velocity, plan.launch.velocity, optimized(1e-10))
    assert plan.landing_error < optimized(1e-9)
    assert motion.q(0.0) == pytest.approx(plan.q, abs=closed_form(10))
    assert motion.v(0.0) == pytest.approx(plan.v, abs=closed_form(10))
    assert motion.v_after == pytest.approx(impact.v_after, abs=optimized(1e-10))
    for t in (motion.begin, motion.end):
        assert np.abs(motion.v(t)).max() < optimized(1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANS)
def test_a_motion_meets_its_goal_within_its_limits(name):
    plan = PLANS[name]()
    assert plan.status == "met"
    assert plan.motion.warnings == ()
    check_impact(plan)
    check_limits(plan)
    assert min(plan.motion.margins(-0.01).values()) >= 0.0


@pytest.mark.slow
def test_its_torques_move_the_leg_so_and_their_square_is_its_value():
    """Forward dynamics under the torques, from each knot to the next."""
    plan = swinging()
    motion = plan.motion
    model, n = motion.robot.model, motion.robot.nv
    data = model.createData()

    def slope(t, x):
        return np.concatenate([x[n:], pin.aba(model, data, x[:n], x[n:], motion.torque(t))])

    state = np.concatenate([motion.q(motion.begin), motion.v(motion.begin)])
    for first, last in pairwise(np.unique(motion.before.t)):  # smooth in between
        inside = (first, last - 1e-12)
        state = solve_ivp(slope, inside, state, rtol=1e-10, atol=1e-11).y[:, -1]
    assert state[:n] == pytest.approx(motion.q(0.0), abs=integrated(1e-8))
    assert state[n:] == pytest.approx(motion.v(0.0), abs=integrated(1e-7))
    total = 0.0
    for begin, end in ((motion.begin, 0.0), (1e-9, motion.end)):
        times = np.linspace(begin, end, 2000)
        use = np.array([motion.torque(t) for t in times]) / plan.leg.effort_limit
        total += np.trapezoid((use**2).mean(axis=1), times)
    assert plan.value == pytest.approx(total, rel=1e-2)  # of trapezoids


@pytest.mark.slow
def test_a_goal_beyond_the_leg_gives_a_share_of_its_launch_and_names_what_holds_it_back():
    goal = kd.Goal(30, time=1.5)
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, motion=True)
    assert plan.status == "beyond-limits"
    assert 0.9 < plan.share < 1.0
    agrees(plan.impact.ball_after.velocity, plan.share * plan.launch.velocity, optimized(1e-8))
    check_limits(plan)
    assert re.search(r"(speed|torque|range) of \w+", plan.motion.warnings[0])


def place_of(motion, t):
    model = motion.robot.model
    data = model.createData()
    pin.forwardKinematics(model, data, motion.q(t))
    return pin.updateFramePlacement(model, data, model.getFrameId(SOLE)).copy()


@pytest.mark.slow
def test_a_robot_on_one_foot_keeps_what_the_ground_can_supply():
    plan = standing()
    motion = plan.motion
    sole = plan.leg.supports[0].sole
    corners = np.array([place_of(motion, 0.0).act(corner) for corner in sole])
    assert np.abs(corners[:, 2]).max() < optimized(1e-10)
    edges = ConvexHull(corners[:, :2]).equations
    ball = plan.impact.ball_before.position
    for t in times_of(motion, 150):
        force, moment = np.split(motion.ground_wrench(t), 2)
        assert force[2] > 0.0
        assert np.hypot(*force[:2]) <= 0.7 * force[2]
        centre = np.array([-moment[1], moment[0]]) / force[2]
        assert (edges[:, :2] @ centre + edges[:, 2]).max() <= -3e-3, t  # inside the sole
        apart = place_of(motion, t).homogeneous - motion.placement.homogeneous
        assert np.abs(apart).max() < optimized(1e-10)
        q = motion.q(t)
        assert find_self_collisions(plan.leg, q) == {}
        assert t > 0 or find_ball_overlaps(plan.leg.posture(q), ball, BALL.radius) == {}
    assert set(plan.impact.footing.values()) <= {"stands", "turns"}


@pytest.mark.slow
def test_joints_at_rest_give_way_in_the_impact_and_return_within_their_limits():
    """The waist, while the legs kick; `strike` knows nothing of the motion."""
    plan = waist()
    motion, names = plan.motion, [f"waist_{axis}_joint" for axis in ("yaw", "roll", "pitch")]
    columns = [plan.leg.velocity_index(name) for name in names]
    assert not {*names} & {*motion.joints}
    assert np.abs(motion.v(0.0)[columns]).max() < closed_form(10)
    assert np.abs(motion.v_after[columns]).max() > 0.1
    assert np.abs(motion.q(motion.end)[np.add(columns, 1)]).max() < closed_form(10)
    for t in times_of(motion, 150):
        use = np.abs(motion.torque(t))[6:] / plan.leg.effort_limit[6:]
        assert (use <= 1.0).all(), t
        for name, column in zip(names, columns, strict=True):
            margin = motion.margins(t)[f"torque of {name}"]
            assert margin == pytest.approx(1.0 - use[column - 6], abs=closed_form(1e4))


def test_a_motion_is_planned_from_one_nearby_that_was_planned_or_recorded(tmp_path):
    plan = swinging()
    wished = 1.005 * plan.impact.ball_after.velocity + (0.0, 0.0, 0.05)
    found = [kick.replan_motion(plan, wished)]
    agrees(found[0].impact.ball_after.velocity, wished, optimized(1e-10))
    plan.motion.save(tmp_path / "kick.csv", rate=400)
    recorded = {"rate": 400, "contact": -plan.motion.begin}
    for start in (plan.motion, kd.read_motion(tmp_path / "kick.csv", HUMAN, **recorded)):
        found.append(kd.plan_kick(HUMAN, kd.Goal(20.2, time=1.21), BALL, AIR, motion=start))
        check_impact(found[-1])
    for again in found:
        assert again.status == "met"
        assert again.motion.v_after == pytest.approx(again.impact.v_after, abs=optimized(1e-7))
        assert np.abs(again.q - plan.q).max() < 0.2
        check_limits(again)


def test_the_splines_of_a_recorded_motion_are_those_it_was_sampled_from(task):
    motion, rate = swinging().motion, 500.0
    fitted = plan_motion.fitted_motion(as_recorded(motion), replace(task, leg=HUMAN, standing=None))
    for side in ("before", "after"):
        spline, other = getattr(motion, side), getattr(fitted, side)
        times = np.linspace(*spline.t[[0, -1]], 200)
        gap = np.abs(spline(times, 2)).max() / (8.0 * rate**2)  # of lines through the samples
        assert np.abs(other(times) - spline(times)).max() < 2.0 * gap


def test_a_motion_that_a_plan_cannot_start_from_is_refused():
    planned, other = swinging().motion, kd.Leg.human(height=1.8, mass=75, model="3d")
    recorded, spoilt = as_recorded(planned), copy.deepcopy(planned.before)
    spoilt.c[3] = np.nan
    for motion, change, named in (
        (recorded, {"leg": other}, "hip_adduction.*has hip, knee, ankle"),
        (recorded, {"contact": None}, "no impact.*contact="),
        (recorded, {"contact": recorded.end}, "its impact at .* between"),
        (planned, {"before": spoilt}, "not finite"),
        (planned, {"robot": replace(HUMAN, frame="shank")}, "kicks with"),
    ):
        with pytest.raises(kd.InvalidInput, match=named):
            kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR, motion=replace(motion, **change))


def test_a_motion_of_other_limits_can_be_started_from():
    leg, motion = kd.Leg.human(height=1.8, mass=75), True
    for limits in ("muscles", True, "muscles"):
        plan = kd.plan_kick(leg, kd.Goal(9, time=0.8), BALL, AIR, limits=limits, motion=motion)
        assert plan.muscles == (limits == "muscles")
        assert plan.share == 1.0
        motion = plan.motion


@pytest.fixture(scope="module")
def task():
    robot = kd.Leg.from_robot("g1", base="floating", locked={"*wrist*": 0})
    robot, free = robot.with_supports("left_ankle_roll_link"), (np.zeros((0, 3)), np.zeros(3))
    stands, contact = StandingRobot(robot), kd.Contact(friction=0.4)
    target = impact_target_for((4.0, 0.5, 2.0), np.zeros(3), BALL, contact)
    return KickTask(stands.robot, stands.leg, target, np.eye(3), *free, free[0], stands)


def test_a_limb_in_the_way_of_a_motion_is_put_aside_and_others_stay(task):
    """A thigh that is lifted beside the trunk hits the hand of the same side."""
    whole, standing = task.leg, task.standing
    limbs = idle_limbs(whole, kicking_chain(whole).leg)
    names = [{whole.model.names[joint] for joint in limb} for limb in limbs]
    assert [len(limb) for limb in names] == [4, 4]
    hip = {"right_hip_pitch_joint": -2.0, "right_hip_roll_joint": -0.3, "right_knee_joint": 1.5}
    motion = [{name: share * angle for name, angle in hip.items()} for share in (0.0, 0.5, 1.0)]

    def collisions(values):
        q = whole.configuration(values)
        return find_self_collisions(standing.robot, standing.robot_state(q, 0.0 * q)[0])

    angles = limbs_aside(task, whole, np.array([*map(whole.configuration, motion)]), limbs)
    assert collisions(hip)
    assert angles.keys() in names
    assert not any(collisions({**values, **angles}) for values in motion)
    arm = next(limb for limb, joints in zip(limbs, names, strict=True) if joints == angles.keys())
    around = Surroundings(task.robot, whole, BALL.radius).only(frames_of(whole, arm))
    at_rest = {gap.frames for gap in around.gaps(whole.configuration(), None, ASIDE)}
    near = around.gaps(whole.configuration({**hip, **angles}), None, ASIDE)
    assert {gap.frames for gap in near} <= at_rest
    assert not any(map(whole.outside_range, [whole.configuration(angles)]))


def test_limbs_that_a_motion_put_aside_stay_there_when_it_is_planned_again(task, monkeypatch):
    """The centre of mass is that of the robot whose arm is lifted."""
    aside, whole = {"left_shoulder_roll_joint": 0.7}, task.leg
    near = SimpleNamespace(aside=aside, joints=kicking_chain(whole).leg.joint_names)
    planned = lambda task, *_, **__: SimpleNamespace(task=task, is_met=True)  # noqa: E731
    monkeypatch.setattr(plan_motion, "_plan", planned)
    again = plan_motion.plan_motion(task, near).task
    assert again.aside == aside
    place = pin.centerOfMass(whole.model, whole.model.createData(), whole.configuration(aside))
    legs = again.leg
    centre = pin.centerOfMass(legs.model, legs.model.createData(), legs.configuration())
    agrees(centre, place, closed_form(10))


FEET = "left_ankle_roll_link", "right_ankle_roll_link"
ANCHORS = np.array([[0.0, 0.1], [0.05, -0.12]])


@pytest.mark.parametrize("share", [-0.2, 0.0, 0.3, 1.0, 1.4])
def test_the_wrench_is_split_into_parallel_forces_at_both_feet(share):
    """Their centres of pressure are the points of the soles, displaced by the same offset."""
    force, twist = np.array([20.0, -30.0, 300.0]), 4.0
    part = min(max(share, 0.0), 1.0)
    way = ANCHORS[1] - ANCHORS[0]
    across = 0.02 * np.array([-way[1], way[0]]) / np.linalg.norm(way)
    place = across + (1 - share) * ANCHORS[0] + share * ANCHORS[1]
    moment = np.cross([*place, 0.0], force) + twist * np.eye(3)[2]
    parts = split_wrench(np.concatenate([force, moment]), ANCHORS)
    agrees(sum(parts), np.concatenate([force, moment]), closed_form(10))
    for wrench, weight, anchor in zip(parts, (1 - part, part), ANCHORS, strict=True):
        agrees(wrench[:3], weight * force, closed_form(10))
        if weight > 0:
            centre = np.array([-wrench[4], wrench[3]]) / wrench[2]
            right = place - (1 - part) * ANCHORS[0] - part * ANCHORS[1]
            agrees(centre - anchor, right, closed_form(1e4))
            about = wrench[5] - np.cross([*centre, 0.0], wrench[:3])[2]
            assert about == pytest.approx(weight * twist)


@pytest.fixture(scope="module")
def motion():
    """G1 at rest on one foot between shifts of its weight to and from both."""
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    robot, tasks = robot.with_supports(kd.Support(FEET[0], friction=0.7)), []

    def stop(task, near=None):
        tasks.append(task)
        raise kd.InvalidInput("enough")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan_motion, "plan_motion", stop)
        with pytest.raises(kd.InvalidInput, match="enough"):
            kd.plan_kick(robot, kd.Goal(2, time=0.4), kd.Ball(), motion="both-feet")
    task, problem = tasks[0], plan_motion.motion_problem(tasks[0])
    rest, _ = next(plan_motion._starts(problem))
    knots = np.repeat([[-0.3, 0], [0, 0.3]], 4, 1)
    splines = [BSpline(t, np.tile(rest, (4, 1)), 3) for t in knots]
    place, shift = task.standing.placement, shift_weight(problem, problem.feet, rest)
    return Motion(task.robot, task.leg.joint_names, *splines, place, shift=shift)


@pytest.mark.slow
def test_torques_and_the_wrenches_on_both_feet_accelerate_the_robot(motion):
    h, times = 1e-6, np.linspace(motion.begin + 0.01, -0.31, 7)
    model, feet, loaded = motion.robot.model, motion.shift.feet, 0
    data, limit = model.createData(), motion.robot.effort_limit[6:]
    for t in times:
        q, v, force = motion.q(t), motion.v(t), motion.torque(t)
        assert (np.abs(force[6:]) <= limit).all()
        wrenches = motion.foot_wrenches(t)
        agrees(sum(wrenches), motion.ground_wrench(t), closed_form(10))
        soles = feet.standing.sole, feet.other.sole
        for frame, wrench, sole in zip(FEET, wrenches, soles, strict=True):
            number = model.getFrameId(frame)
            pin.forwardKinematics(model, data, q, v)
            assert np.abs(pin.getFrameVelocity(model, data, number).vector).max() < closed_form(100)
            local = pin.updateFramePlacement(model, data, number).actInv(pin.Force(wrench)).vector
            force += pin.computeFrameJacobian(model, data, q, number, pin.LOCAL).T @ local
            if wrench[2] > 1.0:
                loaded += 1
                centre = np.array([-wrench[4], wrench[3]]) / wrench[2]
                assert (centre > sole.min(axis=0) + 3e-3).all()
                assert (centre < sole.max(axis=0) - 3e-3).all()
                assert np.hypot(*wrench[:2]) < 0.7 * wrench[2]
        rate = (motion.v(t + h) - motion.v(t - h)) / (2 * h)
        assert pin.aba(model, data, q, v, force) == pytest.approx(rate, abs=2e-4)  # of differences
        assert min(motion.margins(t).values()) >= 0.0
    assert len(times) < loaded < 2 * len(times)


@pytest.mark.slow
def test_the_weight_goes_from_both_feet_to_one_and_back(motion):
    shift = motion.shift
    weight = 9.81 * pin.computeTotalMass(motion.robot.model)
    at_rest, alone = motion.foot_wrenches(motion.begin), motion.foot_wrenches(0.0)
    assert [wrench[2] for wrench in at_rest] == pytest.approx([weight / 2] * 2, rel=optimized(1e-7))
    assert [wrench[2] for wrench in alone] == pytest.approx([weight, 0.0], abs=optimized(1e-10))
    ends = [motion.begin, -0.3, 0.0, 0.3, motion.end]
    assert [phase[1:] for phase in motion.phases] == [*pairwise(ends)]
    assert motion.begin == pytest.approx(-0.3 - shift.duration)
    for t in (0.1, 0.4):
        agrees(motion.q(0.3 + t), motion.q(-0.3 - t), closed_form(10))
        agrees(motion.v(0.3 + t), -motion.v(-0.3 - t), closed_form(10))
    turn = pin.SE3(pin.rpy.rpyToMatrix(0, 0, 0.7), np.array([0.3, 0.1, 0.0]))
    turned = replace(motion, placement=turn * motion.placement)
    for wrench, other in zip(motion.foot_wrenches(-1.0), turned.foot_wrenches(-1.0), strict=True):
        agrees(other, turn.act(pin.Force(wrench)).vector, closed_form(1e4))
    lines = replace(shift, duration=0.25).warnings()
    assert any("centre of pressure" in line for line in lines)


def test_a_motion_on_both_feet_needs_a_support_and_six_joints():
    with pytest.raises(kd.InvalidInput, match="leg_human has no support"):
        kd.plan_kick(kd.Leg.human(), kd.Goal(10, time=1), kd.Ball(), motion=kick.BOTH_FEET)
    leg = kd.Leg.human()
    standing = SimpleNamespace(robot=leg, support=SimpleNamespace(frame="base"))
    with pytest.raises(kd.InvalidInput, match=r"has 3 joints.*six"):
        Feet(leg, standing, None).following()
