"""Planned motions, against Pinocchio and an integrator that know nothing of splines or limits."""

import re
import shutil
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import gymnasium
import numpy as np
import pinocchio as pin
import pytest
from planned_motions import BALL, HUMAN, SOLE, standing, swinging, waist
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline
from scipy.spatial import ConvexHull

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.motion import plan_motion
from kickdyn.motion.impact_rows import _restitution
from kickdyn.motion.limbs import idle_limbs, limbs_aside
from kickdyn.motion.limits import RangeLimit, SpeedLimit, TorqueLimit
from kickdyn.motion.motion_problem import MotionProblem
from kickdyn.motion.separation import Surroundings
from kickdyn.motion.solution import Multipliers
from kickdyn.motion.splines import MotionSplines
from kickdyn.motion.verdict import Verdict
from kickdyn.planning import kick
from kickdyn.robot.collisions import find_ball_overlaps, find_self_collisions
from kickdyn.robot.kicking_chain import kicking_chain
from kickdyn.robot.standing import StandingRobot
from kickdyn.robot.urdf_file import shipped_urdf

AIR, TESTBED = kd.Air(drag="brazuca"), kd.Leg.testbed()
GOALS = {
    "human high": (HUMAN, kd.Goal(25.125, time=2.208)),
    "testbed": (TESTBED, kd.Goal(1.5, time=0.6)),
    "testbed fast": (TESTBED, kd.Goal(1.7027424644632017, time=0.3004798734347314)),
    "g1 leg": (kd.Leg.from_robot("g1"), kd.Goal((3, 0.5, 0), time=0.7)),
}


@cache
def planned(name):
    if name == "human":
        return swinging()
    leg, goal = GOALS[name]
    return kd.plan_kick(leg, goal, BALL, AIR, motion=True)


def times_of(motion, count=400):
    """Return times beside those of the solver and of its check."""
    draw = np.random.default_rng(1)
    return np.sort(draw.uniform(motion.begin, motion.end, count))


def limited_joints(plan):
    leg = plan.leg
    return [leg.velocity_index(name) for name in plan.motion.joints]


def check_limits(plan):
    motion, leg, columns = plan.motion, plan.leg, limited_joints(plan)
    for t in times_of(motion):
        assert (np.abs(motion.torque(t)) <= leg.effort_limit)[columns].all()
        assert (np.abs(motion.v(t)) <= leg.velocity_limit)[columns].all()
        q = motion.joint_state(t)[0]
        ranges = np.array([leg.joint_range(name) for name in motion.joints])
        assert (q >= ranges[:, 0]).all()
        assert (q <= ranges[:, 1]).all()


def check_impact(plan):
    motion, impact = plan.motion, plan.impact
    assert plan.share == 1.0
    assert plan.landing_error < 1e-9
    np.testing.assert_allclose(motion.q(0.0), plan.q, atol=1e-12)
    np.testing.assert_allclose(motion.v(0.0), plan.v, atol=1e-12)
    np.testing.assert_allclose(motion.v_after, impact.v_after, atol=1e-10)
    for t in (motion.begin, motion.end):
        assert np.abs(motion.v(t)).max() < 1e-9


@pytest.mark.parametrize("name", ["human", *GOALS])
def test_a_motion_meets_its_goal_within_its_limits(name):
    plan = planned(name)
    assert plan.status == "met"
    assert plan.motion.warnings == ()
    check_impact(plan)
    check_limits(plan)
    assert 0.0 < plan.torque_use <= 1.0
    assert 0.0 < plan.speed_use <= 1.0
    assert min(plan.motion.margins(-0.01).values()) >= 0.0


@pytest.mark.parametrize("name", ["human", "testbed"])
def test_its_torques_move_the_leg_so(name):
    """Forward dynamics under the torques, from each knot to the next."""
    motion = planned(name).motion
    model, n = motion.robot.model, motion.robot.nv
    data = model.createData()

    def slope(t, x):
        return np.concatenate([x[n:], pin.aba(model, data, x[:n], x[n:], motion.torque(t))])

    state = np.concatenate([motion.q(motion.begin), motion.v(motion.begin)])
    for first, last in pairwise(np.unique(motion.before.t)):  # smooth in between
        inside = (first, last - 1e-12)
        state = solve_ivp(slope, inside, state, rtol=1e-10, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(state[:n], motion.q(0.0), atol=1e-6)
    np.testing.assert_allclose(state[n:], motion.v(0.0), atol=1e-5)


def test_the_value_is_the_integral_of_the_squared_torque():
    plan = planned("human")
    total = 0.0
    for begin, end in ((plan.motion.begin, 0.0), (1e-9, plan.motion.end)):
        times = np.linspace(begin, end, 2000)
        use = np.array([plan.motion.torque(t) for t in times]) / plan.leg.effort_limit
        total += np.trapezoid((use**2).mean(axis=1), times)
    assert plan.value == pytest.approx(total, rel=1e-2)
    assert plan.objective == "torque-squared"


def test_the_same_call_gives_the_same_motion():
    again = kd.plan_kick(HUMAN, kd.Goal(20, time=1.2), BALL, kd.Air(), motion=True)
    assert again.motion.before.c.tobytes() == planned("human").motion.before.c.tobytes()


def test_a_goal_beyond_the_leg_gives_a_share_of_its_launch():
    plan = kd.plan_kick(HUMAN, kd.Goal(30, time=1.5), BALL, AIR, motion=True)
    assert plan.status == "beyond-limits"
    assert 0.93 < plan.share < 1.0
    np.testing.assert_allclose(
        plan.impact.ball_after.velocity, plan.share * plan.launch.velocity, atol=1e-6
    )
    assert any(name.startswith("speed of ") for name in plan.binding)
    check_limits(plan)
    words, names = plan.motion.warnings[0].split("; limits that hold it back most: ")
    assert re.fullmatch(r"the motion reaches 9\d % of the launch", words)
    named = set(re.findall(r"\w+ of \w+", names))
    assert any(name.startswith("speed of ") for name in named)
    again = kd.plan_kick(relaxed(lambda name: name in named), plan.goal, BALL, AIR, motion=True)
    assert again.status == "met"


def relaxed(chosen):
    """Return the human leg with limits by 0.3 rad or 30 % larger."""
    model = HUMAN.model
    for i, name in enumerate(HUMAN.joint_names):
        model.velocityLimit[i] *= 1.3 if chosen(f"speed of {name}") else 1.0
        model.effortLimit[i] *= 1.3 if chosen(f"torque of {name}") else 1.0
        more = 0.3 if chosen(f"range of {name}") else 0.0
        model.lowerPositionLimit[i] -= more
        model.upperPositionLimit[i] += more
    return kd.Leg.from_model(model, "toe")


def test_limits_that_do_not_hold_a_motion_back_are_not_named():
    plan = kd.plan_kick(HUMAN, kd.Goal(30, time=1.5), BALL, AIR, motion=True)
    named = set(re.findall(r"\w+ of \w+", plan.motion.warnings[0]))
    other = relaxed(lambda name: name not in named)
    again = kd.plan_kick(other, plan.goal, BALL, AIR, motion=True)
    assert again.share < plan.share + 5e-3


def test_a_plan_takes_no_more_work_than_it_may(monkeypatch):
    """Its best motion comes with what it breaks, and with the limits that hold it back."""
    solved, solve = [], MotionProblem.solve
    monkeypatch.setattr(plan_motion, "MOST_WORK", 90)

    def counted(*args, **options):
        solved.append(solve(*args, **options))
        return solved[-1]

    monkeypatch.setattr(MotionProblem, "solve", counted)
    plan = kd.plan_kick(HUMAN, kd.Goal(30, time=1.5), BALL, AIR, motion=True)
    assert sum(solution.iterations for solution in solved) <= 90 / 3
    assert plan.status == "beyond-limits"
    assert plan.share < 1.0
    assert plan.motion.warnings[0].startswith("the motion reaches ")


def test_a_motion_knows_the_restitution_over_speed():
    contact = kd.Contact(None, [[5, 0.85], [25, 0.6]], 0.4)
    plan = kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR, contact=contact, motion=True)
    assert plan.status == "met"
    check_impact(plan)


def test_a_ball_at_a_place_is_struck_there():
    goal = kd.Goal(10, time=1)
    free = kd.plan_kick(HUMAN, goal, BALL, AIR, motion=True).impact.ball_before.position
    place = np.add(free, (0.02, 0.0, 0.03))
    plan = kd.plan_kick(HUMAN, goal, BALL, AIR, ball_position=place, motion=True)
    np.testing.assert_allclose(plan.impact.ball_before.position, place, atol=1e-6)
    check_impact(plan)


def test_a_robot_on_one_foot_keeps_what_the_ground_can_supply():
    plan = standing()
    assert plan.motion.warnings == ()
    check_impact(plan)
    check_limits(plan)
    motion = plan.motion
    corners = np.array([place_of(motion, 0.0).act(corner) for corner in sole_of(plan)])
    assert np.abs(corners[:, 2]).max() < 1e-9
    edges = ConvexHull(corners[:, :2]).equations
    for t in times_of(motion, 200):
        force, moment = np.split(motion.ground_wrench(t), 2)
        assert force[2] > 0.0
        assert np.hypot(*force[:2]) <= 0.7 * force[2]
        centre = np.array([-moment[1], moment[0]]) / force[2]
        assert (edges[:, :2] @ centre + edges[:, 2]).max() <= -3e-3  # inside the sole
        moved = place_of(motion, t).homogeneous - motion.placement.homogeneous
        assert np.abs(moved).max() < 1e-9
    assert plan.impact.footing == {SOLE: "stands"}


def test_bodies_of_a_robot_stay_apart_and_out_of_the_ball():
    """At times beside those of the check; forearms at 0 are in front of the trunk of G1."""
    plan = standing()
    assert plan.status == "met"
    ball = plan.impact.ball_before.position
    for t in times_of(plan.motion, 300):
        q = plan.motion.q(t)
        assert find_self_collisions(plan.leg, q) == {}
        if t <= 0.0:
            assert find_ball_overlaps(plan.leg.posture(q), ball, BALL.radius) == {}


def test_bodies_that_are_inside_each_other_in_the_motion_are_a_line():
    plan = standing()
    before, crossed = plan.motion.before, plan.motion.joint_state(0.0)[0].copy()
    crossed[plan.motion.joints.index("right_hip_roll_joint")] += 0.5
    still = BSpline(before.t, np.tile(crossed, (len(before.c), 1)), before.k)
    moved = replace(plan, motion=replace(plan.motion, before=still))
    assert moved.status == "collides"
    (line,) = [line for line in moved.warnings if "inside each other" in line]
    words = "bodies are inside each other in the motion: "
    pair = r"(\w+) and (\w+) by (0\.\d+) m at (-\S+) s"
    first, other, depth, t = re.match(pair, line.removeprefix(words)).groups()
    depths = find_self_collisions(plan.leg, moved.motion.q(float(t)))
    assert float(depth) == pytest.approx(depths[first, other], abs=1e-3)


def blocked(folder, place):
    """Return the human leg with a box in place of the pelvis."""
    shutil.copytree(shipped_urdf("leg_human.urdf").parent, folder / "urdf")
    file = folder / "urdf/leg_human.urdf"
    mesh = '<geometry><mesh filename="meshes/human_pelvis.stl"/></geometry>'
    box = f'<origin xyz="{place[0]} 0 {place[2]}"/><geometry><box size="0.1 0.3 0.1"/></geometry>'
    text = file.read_text()
    assert mesh in text
    file.write_text(text.replace(mesh, box))
    return kd.Leg.from_urdf(file, "toe", drives=False)


def test_a_motion_avoids_a_body_that_is_in_its_way(tmp_path):
    goal = kd.Goal(15, time=1)
    free = kd.plan_kick(HUMAN, goal, BALL, AIR, motion=True).motion
    leg = blocked(tmp_path, HUMAN.posture(free.q(0.1)).contact_point)
    plan = kd.plan_kick(leg, goal, BALL, AIR, motion=True)
    times = times_of(free, 300)
    inside = [find_self_collisions(leg, free.q(t)) for t in times]
    assert max(max(depths.values(), default=0.0) for depths in inside) > 0.04
    assert plan.status == "met"
    check_impact(plan)
    check_limits(plan)
    assert not any(find_self_collisions(leg, plan.motion.q(t)) for t in times)


def test_limbs_in_the_way_of_a_motion_of_the_legs_are_put_aside():
    robot = kd.Leg.from_robot("g1", base="floating", locked={"*wrist*": 0.0})
    stance = StandingRobot(robot.with_supports(SOLE))
    legs = kicking_chain(stance.leg).leg
    limbs = idle_limbs(stance.leg, legs)
    names = [{stance.leg.model.names[joint] for joint in limb} for limb in limbs]
    sides = ("left", "right")
    parts = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")
    assert sorted(names, key=min) == [{f"{x}_{part}_joint" for part in parts} for x in sides]
    task = SimpleNamespace(robot=stance.robot, target=SimpleNamespace(ball=BALL))
    joints = legs.joint_names
    raised = np.zeros(len(joints))
    raised[[joints.index("right_hip_pitch_joint"), joints.index("right_knee_joint")]] = -2.0, 1.0
    postures = stance.leg.configuration()[None].copy()
    postures[:, [stance.leg.joint_names.index(name) for name in joints]] = raised
    aside = limbs_aside(task, stance.leg, postures, limbs)
    assert set(aside) == {f"right_{part}_joint" for part in parts}
    placed = stance.leg.joint_values(stance.leg.configuration())
    placed |= dict(zip(joints, raised, strict=True))
    at = [StandingRobot.robot_state(stance, stance.leg.configuration(x), np.zeros(23))[0]
          for x in (placed, placed | aside)]  # fmt: skip
    assert find_self_collisions(stance.robot, at[0])
    assert not find_self_collisions(stance.robot, at[1])


def sole_of(plan) -> Array:
    return plan.leg.supports[0].sole


def place_of(motion, t):
    model = motion.robot.model
    data = model.createData()
    pin.forwardKinematics(model, data, motion.q(t))
    return pin.updateFramePlacement(model, data, model.getFrameId(SOLE)).copy()


def test_bodies_inside_the_ball_before_the_impact_are_a_line():
    plan = planned("human")
    words = "bodies are inside the ball before the impact: "
    assert not any(line.startswith(words) for line in plan.warnings)
    before = plan.motion.before
    forward = plan.motion.joint_state(0.0)[0] + [0.15, 0.0, 0.0]  # hip
    still = BSpline(before.t, np.tile(forward, (len(before.c), 1)), before.k)
    moved = replace(plan, motion=replace(plan.motion, before=still))
    (line,) = (line for line in moved.warnings if line.startswith(words))
    name, depth = re.match(r"(\w+) by ([0-9.]+) m at ", line.removeprefix(words)).groups()
    posture = plan.leg.posture(moved.motion.q(-0.05))
    inside = find_ball_overlaps(posture, plan.impact.ball_before.position, BALL.radius)
    assert float(depth) == pytest.approx(inside[name], abs=1e-3)
    assert inside[name] > 0.02
    assert moved.status == "collides"


def test_bodies_in_the_way_of_the_ball_after_the_impact_are_a_line():
    plan = planned("human")
    words = "bodies are in the way of the ball after the impact: "
    assert not any(line.startswith(words) for line in plan.warnings)
    ball = plan.impact.ball_after
    backwards = kd.fly(replace(ball, velocity=(-10.0, 0.0, 1.0)), BALL, AIR, kd.Ground(-9))
    (line,) = (line for line in replace(plan, path=backwards).warnings if line.startswith(words))
    name, depth = re.match(r"(\w+) by ([0-9.]+) m at ", line.removeprefix(words)).groups()
    deepest = max(
        find_ball_overlaps(
            plan.leg.posture(plan.motion.q(t)), backwards.sample(t).position, BALL.radius
        ).get(name, 0.0)
        for t in np.linspace(0.001, 0.1, 100).tolist()
    )
    assert deepest - 0.03 <= float(depth) <= deepest + 1e-3  # at steps of half a radius
    assert deepest > 0.1
    assert replace(plan, path=backwards).status == "collides"


def test_trunk_and_arms_join_in_where_legs_do_not_suffice(monkeypatch):
    """Of the humanoid of gymnasium, whose knees have no speed limit; with splines of few knots."""
    monkeypatch.setattr(plan_motion, "INTERVALS", {True: (8, 7)})
    file = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    humanoid = kd.Leg.from_mjcf(file, "right_foot", base="floating").with_supports("left_foot")
    front = kd.Contact(friction=0.4, offset=(0.1, 0.0, 0.1))
    goal = kd.Goal(1.5, time=0.4)
    plan = kd.plan_kick(humanoid, goal, BALL, kd.Air(), contact=front, motion=True)
    assert plan.motion.warnings == ()
    assert {"abdomen_y", "left_elbow"} <= set(plan.motion.joints)
    check_impact(plan)
    least = min(min(plan.motion.margins(t).values()) for t in times_of(plan.motion, 200))
    assert least >= 0.0


def test_joints_at_rest_give_way_in_the_impact_and_return():
    """The waist, while the legs kick; `strike` knows nothing of the motion."""
    plan = waist()
    motion, names = plan.motion, [f"waist_{axis}_joint" for axis in ("yaw", "roll", "pitch")]
    columns = [plan.leg.velocity_index(name) for name in names]
    assert not {*names} & {*motion.joints}
    assert np.abs(motion.v(0.0)[columns]).max() < 1e-12
    assert np.abs(motion.v_after[columns]).max() > 0.1
    check_impact(plan)
    before, after = motion.v(1e-3 - 1e-7), motion.v(1e-3 + 1e-7)
    q = [motion.q(1e-3 + step)[7:] for step in (-1e-7, 1e-7)]
    np.testing.assert_allclose((q[1] - q[0]) / 2e-7, (before + after)[6:] / 2, atol=1e-5)
    np.testing.assert_allclose(motion.q(motion.end)[7:][np.array(columns) - 6], 0.0, atol=1e-12)


def test_the_torques_of_joints_at_rest_keep_their_limits():
    plan = waist()
    motion = plan.motion
    for t in times_of(motion):
        assert (np.abs(motion.torque(t)) <= plan.leg.effort_limit)[6:].all()
        margin = motion.margins(t)["torque of waist_roll_joint"]
        column = plan.leg.velocity_index("waist_roll_joint")
        use = abs(motion.torque(t)[column]) / plan.leg.effort_limit[column]
        assert margin == pytest.approx(1.0 - use, abs=1e-9)


@pytest.mark.parametrize("kick", [standing, waist])
def test_the_impact_of_a_standing_robot_conserves_momentum(kick):
    """The ground's impulse and the ball's change the momentum about the world's origin."""
    plan = kick()
    model, impact = plan.leg.model, plan.impact
    data = model.createData()
    changes = []
    for v in (plan.motion.v(0.0), plan.motion.v_after):
        pin.computeCentroidalMomentum(model, data, plan.q, v)
        momentum, centre = data.hg.vector.copy(), data.com[0].copy()
        momentum[3:] += np.cross(centre, momentum[:3])
        changes.append(momentum)
    ground = impact.support_impulses[SOLE]
    frame = plan.motion.placement.translation
    ball = np.concatenate([impact.impulse, np.cross(impact.posture.contact_point, impact.impulse)])
    supplied = np.concatenate([ground[:3], ground[3:] + np.cross(frame, ground[:3])])
    np.testing.assert_allclose(changes[1] - changes[0], supplied - ball, atol=1e-10)


def test_a_motion_is_planned_again_for_a_launch_nearby():
    plan = planned("human")
    assert plan.motion.solution is not None  # from which it starts
    wished = 1.005 * plan.impact.ball_after.velocity + (0.0, 0.0, 0.05)
    again = kick.replan_motion(plan, wished)
    assert again.share == 1.0
    np.testing.assert_allclose(again.impact.ball_after.velocity, wished, atol=1e-9)
    np.testing.assert_allclose(again.motion.v_after, again.impact.v_after, atol=1e-6)
    assert np.abs(again.q - plan.q).max() < 0.2
    check_limits(again)
    with pytest.raises(kd.InvalidInput, match="the plan has no motion: plan it with motion=True"):
        kick.replan_motion(kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR), wished)


def test_a_pass_that_is_planned_again_stays_on_the_ground():
    plan = kd.plan_kick(HUMAN, kd.Goal(10, time=2), BALL, AIR, motion=True, surface="turf")
    again = kick.replan_motion(plan, plan.impact.ball_after.velocity)
    assert isinstance(again.path, kd.Course)
    assert again.landing_error == pytest.approx(plan.landing_error, abs=1e-6)


def limited(what, limit):
    model = HUMAN.model
    limits = getattr(model, what).copy()
    limits[1] = limit
    setattr(model, what, limits)
    return kd.Leg.from_model(model, "toe")


def test_a_joint_without_a_torque_limit_is_refused():
    leg = limited("effortLimit", np.inf)
    with pytest.raises(kd.InvalidInput, match="limit of knee is inf: a motion needs one, above 0"):
        kd.plan_kick(leg, kd.Goal(5, time=1), BALL, AIR, motion=True)


def test_all_joints_without_a_torque_limit_are_named():
    model = HUMAN.model
    model.effortLimit = np.array([np.inf, 100.0, np.inf])
    leg = kd.Leg.from_model(model, "toe")
    with pytest.raises(kd.InvalidInput, match=r"^torque limit of hip, ankle is inf: a motion"):
        kd.plan_kick(leg, kd.Goal(5, time=1), BALL, AIR, motion=True)


@pytest.mark.parametrize("limit", [200, 0])
def test_a_file_without_drives_is_refused_before_any_solve(tmp_path, monkeypatch, limit):
    """The line names the joints and what to give; `drives=False` says that there are no rotors."""
    monkeypatch.setattr(kick, "plan_flight_launch", None)
    text = re.sub(r'effort="[^"]*"', f'effort="{limit}"', shipped_urdf("biped.urdf").read_text())
    (tmp_path / "own.urdf").write_text(text)
    own = kd.Leg.from_urdf(tmp_path / "own.urdf", "right_foot", base="floating")
    own = own.with_supports("left_foot")
    words = "" if limit else ", and torque limits of [^;]* more"
    joints = "left_hip_yaw, left_hip_roll, left_hip_pitch, left_knee, left_ankle_pitch, "
    with pytest.raises(kd.InvalidInput, match=joints + f"left_ankle_roll and 6 more{words}; give"):
        kd.plan_kick(own, kd.Goal(2, time=0.4), BALL, AIR, motion=True)


def test_a_joint_may_have_no_speed_limit():
    leg = limited("velocityLimit", np.inf)
    plan = kd.plan_kick(leg, kd.Goal(5, time=1), BALL, AIR, motion=True)
    assert plan.status == "met"
    check_impact(plan)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"objective": "joint-speed"}, r"a motion \(motion=True, --motion\) has the objective"),
        ({"limits": False}, "a motion is planned within limits"),
    ],
)
def test_options_that_have_no_motion_are_refused(options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR, motion=True, **options)


def test_torque_squared_needs_a_motion():
    with pytest.raises(kd.InvalidInput, match="has the objective torque-squared, which"):
        kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR, objective="torque-squared")


def test_without_casadi_it_says_how_to_install_it(monkeypatch):
    monkeypatch.setattr(kick, "find_spec", lambda name: None)
    with pytest.raises(kd.InvalidInput, match=r'pip install "kickdyn\[motion\]"'):
        kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR, motion=True)


def test_a_ball_that_the_foot_cannot_touch_is_refused():
    far = (2.0, 0.0, -0.7)
    with pytest.raises(
        kd.InvalidInput, match="no posture was found in which leg_human can touch the ball at rest"
    ):
        kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, AIR, ball_position=far, motion=True)


def test_curves_of_the_plot_are_shares_of_limits():
    plan = planned("human")
    figure = plan.motion.plot()
    torque, speed = figure.axes
    largest = max(np.abs(line.get_ydata()).max() for line in torque.lines[:6])
    assert largest == pytest.approx(100 * plan.torque_use, abs=1.0)
    largest = max(np.abs(line.get_ydata()).max() for line in speed.lines[:6])
    assert largest == pytest.approx(100 * plan.speed_use, abs=1.0)


@pytest.mark.parametrize("table", [((3.0, 0.85), (9.0, 0.7), (20.0, 0.5)), 0.6])
def test_the_restitution_of_a_problem_is_that_of_its_table(table):
    """Linear between the rows and constant below the first one and above the last one."""
    contact, speeds = kd.Contact((1, 0, 0), table), np.array([0.0, 1.0, 3.0, 7.0, 9.0, 15.0, 40.0])
    given = [_restitution(SimpleNamespace(contact=contact), ca.DM(speed)) for speed in speeds]
    wanted = np.interp(speeds, *np.transpose(table)) if np.ndim(table) else 0.6
    assert np.array([float(e) for e in given]) == pytest.approx(wanted, rel=1e-12)


def test_margins_of_the_plot_are_those_of_the_motion_in_millimetres():
    motion = standing().motion
    axes = motion.plot().axes[2]
    lengths = [label for label in motion.margins(0.0) if label.endswith(" [m]")]
    assert [f"{curve.get_label()} [m]" for curve in axes.lines[: len(lengths)]] == lengths != []
    for curve, label in zip(axes.lines, lengths, strict=False):
        for k in (0, 9, -1):
            margin = motion.margins(curve.get_xdata()[k])[label]
            assert curve.get_ydata()[k] == pytest.approx(1e3 * margin)
    assert axes.get_ylabel() == "margin [mm]"


def test_every_limit_that_is_broken_has_a_line_with_its_excess_and_time():
    """Rows below 0 by hand: of a torque, a speed, a range and the ground's impulse."""
    leg, names = kd.Leg.human(), ("hip", "knee", "ankle")
    model, spline = leg.model, BSpline([-1, -1, 1, 1], [[0.0] * 3] * 2, 1)
    limits = [
        TorqueLimit(names, model.effortLimit), SpeedLimit(names, model.velocityLimit),
        RangeLimit(names, model.lowerPositionLimit, model.upperPositionLimit),
    ]  # fmt: skip
    verdict = object.__new__(Verdict)
    verdict.problem = SimpleNamespace(
        task=SimpleNamespace(standing=None, robot=leg, leg=leg, aside={}), limits=limits,
        feet=None, pushed=lambda *_: {},
        impulse_limits=[SimpleNamespace(labels=["friction of the ground", "its pressure"])],
        splines=SimpleNamespace(motion=lambda _: (spline, spline)),
    )  # fmt: skip
    verdict.solution = SimpleNamespace(
        feasible=False, share=0.5, coefficients=None, multipliers=None
    )
    verdict.times = [np.array([-0.25, -0.1]), np.array([0.0, 0.2])]
    verdict.rows, verdict.impulse = np.full((4, 9), 0.5), np.array([-0.031, -1e-7])
    verdict.rows[1, 1], verdict.rows[3, 5], verdict.rows[0, 6] = -0.125, -0.02, -0.0713
    verdict.rows[2, 0] = 0.011  # hip's torque is near its limit
    verdict.margins, verdict.torque_squared, verdict.broken = None, 2.0, 0.125
    found = verdict.planned()
    assert found.motion.warnings == (
        "torque of knee is beyond its limit by 12.5 %, 100 ms before the impact",
        "speed of ankle is beyond its limit by 2.0 %, 200 ms after the impact",
        "range of hip is beyond its limit by 0.071 rad, 250 ms before the impact",
        "friction of the ground is beyond its limit by 0.031",
        "the solver finds no motion that keeps the equations of the impact",
    )
    assert set(found.binding) == {
        "torque of hip",
        "torque of knee",
        "speed of ankle",
        "range of hip",
    }
    assert (found.torque_use, found.speed_use) == pytest.approx((1.125, 1.02))
    assert not found.keeps_limits
    words = "torque of hip is beyond its limit by 3.1 %, 40 ms after the impact"
    assert limits[0].describe("torque of hip", -0.031, 0.04) == words
    limits[0].unit = "N m"
    words = "the moment is beyond its limit by 0.031 N m, 40 ms before the impact"
    assert limits[0].describe("the moment", -0.031, -0.04) == words
    limits[0].unit = "m"
    words = "the sole is beyond its limit by 3.1 mm, 40 ms before the impact"
    assert limits[0].describe("the sole", -0.0031, -0.04) == words


def test_limbs_are_put_aside_of_the_whole_motion(monkeypatch):
    """Beginning, impact and end of it included."""
    leg, splines = kd.Leg.from_robot("g1"), MotionSplines(0.9, 0.4, (7, 3))
    whole, seen = kd.Leg.from_robot("g1", base="fixed"), []
    coefficients = np.random.default_rng(2).normal(size=(splines.size, leg.nv))
    monkeypatch.setattr(plan_motion, "limbs_aside", lambda *given: seen.append(given[2]))
    problem = SimpleNamespace(task=SimpleNamespace(leg=leg), splines=splines)
    moved = SimpleNamespace(coefficients=coefficients)
    assert plan_motion._put_aside(problem, moved, whole, []) is problem
    moving = [whole.joint_names.index(name) for name in leg.joint_names]
    ends = splines.values([np.array([-0.9]), np.array([0.0, 0.4])], 0) @ coefficients
    assert seen[0][[0, len(seen[0]) // 2, -1]][:, moving] == pytest.approx(ends)


def test_effects_have_the_names_of_their_limits():
    """Each is the multiplier of one limit, ten times a tenth of it, or of 1 cm, if it is large."""
    n, rows = TESTBED.nv, [f"{name} of " for name in ("torque", "speed", "range")]
    problem = SimpleNamespace(
        task=SimpleNamespace(leg=TESTBED), path=SimpleNamespace(lower=range(2)), n=n,
        splines=SimpleNamespace(size=2), _on_path=[("height of a foot", "m"), ("lift", "N")],
        impulse_limits=[SimpleNamespace(labels=["slip", "tip"])],
        surroundings=Surroundings(TESTBED, TESTBED, BALL.radius),
    )  # fmt: skip
    known = Multipliers(
        speeds=np.r_[10.0 + np.arange(n), -20.0 - np.arange(n)],
        impact=np.array([99.0, -7.0, 8.0]),
        bounds=np.r_[40.0 + np.arange(n), 50.0 + np.arange(n), 99.0],
        points=np.array(
            [np.r_[1.0, 2.0, 60.0 + np.arange(n)], np.r_[-3.0, -4.0, np.full(n, 0.04)]]
        ),
        apart=[(((1, -1), None, None), np.array([5.0])), (((2, 1), None, None), np.array([6.0]))],
    )
    joints = TESTBED.joint_names
    expected = {"height of a foot": 0.04, "lift": 0.6, "slip": 0.7, "tip": 0.8}
    for i, name in enumerate(joints):
        sizes = 60.0 + i, 30.0 + 2 * i, 90.0 + 2 * i
        expected |= {row + name: 0.1 * size for row, size in zip(rows, sizes, strict=True)}
    expected[f"distance of bodies of {joints[0]} from the ball"] = 0.05
    expected[f"distance of bodies of {joints[1]} from those of {joints[0]}"] = 0.06
    effects = MotionProblem.effects(problem, SimpleNamespace(multipliers=known))
    assert effects == pytest.approx({name: size / 3.0 for name, size in expected.items()})
