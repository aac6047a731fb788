"""The nonlinear program of a motion: its splines, dynamics and rows against differences."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
import scipy.sparse as sp
from tolerances import agrees, closed_form, differenced

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.motion.kick_task import TURN_SCALE, KickTask
from kickdyn.motion.limits import SpeedLimit, TorqueLimit
from kickdyn.motion.motion_problem import SHARE, MotionProblem
from kickdyn.motion.motion_program import (
    Block,
    Cost,
    MotionSolution,
    MotionSplines,
    Multipliers,
    SymbolicTree,
    block_solver,
    make_rows,
)
from kickdyn.motion.verdict import Verdict
from kickdyn.robot.collisions import TOUCHING, find_ball_overlaps
from kickdyn.robot.standing import StandingRobot, joint_spheres

BALL, LEG = kd.Ball(), kd.Leg.human()
VELOCITY, PLANE = np.array([12.0, 0.0, 5.0]), np.eye(3)[[0, 2]]
TABLE = ((3.0, 0.9), (9.0, 0.7), (20.0, 0.5))


def target_of(restitution, friction):
    contact = kd.Contact(None, restitution, friction, (0.02, 0.0, 0.01))
    return impact_target_for(VELOCITY, -8.0 * (friction > 0.0) * np.eye(3)[1], BALL, contact)


def problem_of(restitution=0.8, friction=0.4, centre=None):
    target = target_of(restitution, friction)
    rows, place = (np.zeros((0, 3)), np.zeros(3)) if centre is None else (PLANE, centre)
    task = KickTask(LEG, LEG, target, PLANE, rows, place, np.zeros((0, 3)), None)
    return MotionProblem(task, MotionSplines(0.5, 0.5, (4, 3)))


@pytest.fixture(scope="module")
def problem():
    return problem_of()


@pytest.mark.parametrize("share", [0.4, 1.0])
@pytest.mark.parametrize(("restitution", "friction"), [(0.8, 0.4), (TABLE, 0.4), (TABLE, 0.0)])
def test_a_strike_keeps_the_rows_of_the_impact(restitution, friction, share):
    q = np.array([0.5, 0.6, -0.3])
    posture = LEG.posture(q).with_contact_offset((0.02, 0.0, 0.01))
    normal = target_of(restitution, friction).contact.normal
    problem = problem_of(restitution, friction, posture.contact_point + BALL.radius * normal)
    target = problem.task.target
    agrees(problem.ball_centre(q), problem.task.ball_centre, closed_form(10))
    foot = target.foot_velocity(posture, share)
    slip = 0.1 * np.cross(normal, (0.0, 1.0, 0.0))  # in the plane of the leg
    for more, is_kept in ((0.0 * foot, True), (0.02 * foot, False), (slip, friction == 0.0)):
        v = posture.joint_velocity(foot + more)
        hit = kd.strike(posture, v, BALL, target.contact)
        whole = posture.solve(-target.impulse @ posture.jacobian)
        agrees(problem.jump(q), whole, closed_form(1e3))
        if not more.any():
            agrees(share * whole, hit.v_after - v, closed_form(1e4))
        z = np.concatenate([q, v, share * whole, [share], whole])
        values = np.asarray(problem.impact.values(z, [])[0]).ravel()
        broken = np.abs(values - np.clip(values, problem.impact.lower, problem.impact.upper)).max()
        assert (broken < closed_form(1e3)) == is_kept, (more, values)
    problem._resting, problem.task = [1], SimpleNamespace(resting=["knee"])
    pushed = problem.pushed(np.tile(q, (problem.splines.size, 1)), share)
    assert pushed == pytest.approx({"knee": share * whole[1]}, rel=closed_form(1e3))


def test_bodies_are_apart_by_the_rows_of_their_points(problem):
    q, hit = np.array([0.5, 0.6, -0.3]), np.array([0.1, 0.4, 0.0])
    data = LEG.model.createData()
    pin.forwardKinematics(LEG.model, data, q)
    a, n, b = np.array([0.1, 0.0, -0.2]), np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.1, -0.3])
    rows = problem._rows_apart((2, 1))
    p = np.concatenate([a, n, b])
    value = float(rows.values(q, p)[0])
    apart = data.oMi[1].act(b) - data.oMi[2].act(a)
    assert value == pytest.approx(data.oMi[2].rotation @ n @ apart - 2e-3, abs=closed_form(10))
    rows = problem._rows_apart((2, -1))
    value = float(rows.values(np.append(q, hit), p)[0])
    distance = np.linalg.norm(problem.ball_centre(hit) - data.oMi[2].act(a))
    least = BALL.radius - 2.5e-3
    assert value == pytest.approx((distance**2 - least**2) / (2 * BALL.radius), abs=closed_form(10))


def test_derivatives_of_blocks_are_differences():
    z, p, draw = ca.SX.sym("z", 2), ca.SX.sym("p"), np.random.default_rng(3)
    rows = make_rows(z, p, [(ca.sin(z[0]) * z[1] + p, -1.0, 2.0)], z[0] ** 2 * z[1])
    agrees([rows.lower[0], rows.upper[0]], [-1.0, 2.0], 0)
    maps, weights, ps = draw.normal(size=(4, 3)), np.array([0.5, 2.0]), np.array([[0.3, -0.2]])
    quadratic, centre, slope = np.diag([1.0, 2.0]), np.array([0.5, -1.0]), np.array([0, 0, 3.0])
    linear, block = np.array([[1.0, -2.0, 0.5]]), Block(rows, sp.csr_matrix(maps), ps, weights)
    cost = Cost(sp.csr_matrix(quadratic), centre, slope)
    solver = block_solver([block], sp.csr_matrix(linear), cost, 3, {})
    names, multipliers = ("nlp_grad_f", "nlp_jac_g", "nlp_hess_l"), np.array([0.7, -1.1, 0.4])
    gradient, jacobian, hessian = map(solver.get_function, names)

    def values(x):
        """Return the cost and the rows by hand."""
        a, b = (maps @ x).reshape(2, 2).T
        total = 0.5 * (x[:2] - centre) @ quadratic @ (x[:2] - centre) + slope @ x
        return np.array([total + weights @ (a**2 * b), *linear @ x, *np.sin(a) * b + ps[0]])

    def lagrangian_slope(x):
        rows = np.asarray(jacobian(x, [])[1])
        return 1.5 * np.asarray(gradient(x, [])[1]).ravel() + rows.T @ multipliers

    def differences(function):
        steps = 1e-5 * np.eye(3)
        return np.transpose([(function(x + e) - function(x - e)) / 2e-5 for e in steps])

    x = draw.normal(size=3)
    (total, first), (rows, others) = (map(np.asarray, f(x, [])) for f in (gradient, jacobian))
    agrees([*total.ravel(), *rows.ravel()], values(x), closed_form(10))
    agrees(np.vstack([first.reshape(1, 3), others]), differences(values), 10 * differenced())
    upper = np.asarray(ca.DM(hessian(x, [], 1.5, multipliers)))
    agrees(np.triu(upper), np.triu(differences(lagrangian_slope)), 10 * differenced())


def drawn_solution(problem, size=0.15):
    draw = np.random.default_rng(5)
    c = np.array([0.1, 0.3, -0.1]) + draw.normal(0.0, size, (problem.splines.size, 3))
    return MotionSolution(c[0], c, 1.0, problem.splines.times(2, 4))


def test_the_verdict_is_by_inverse_dynamics_on_a_finer_grid(problem):
    solution = drawn_solution(problem)
    verdict, model, data = Verdict(problem, solution), LEG.model, LEG.model.createData()
    splines, total, worst = problem.splines.motion(solution.coefficients), 0.0, {}
    for spline, times in zip(splines, verdict.times, strict=True):
        states = [[spline(t, order) for t in times] for order in range(3)]
        torque = np.array([pin.rnea(model, data, *state) for state in zip(*states, strict=True)])
        use = np.abs(torque) / LEG.effort_limit
        total += np.trapezoid((use**2).mean(axis=1), times)
        worst["torque"] = max(use.max(), worst.get("torque", 0.0))
        speed = np.abs(states[1]) / LEG.velocity_limit
        worst["speed"] = max(speed.max(), worst.get("speed", 0.0))
    assert verdict.torque_squared == pytest.approx(total, rel=closed_form(1e4))
    assert verdict.use(TorqueLimit) == pytest.approx(worst["torque"])
    assert verdict.use(SpeedLimit) == pytest.approx(worst["speed"])
    broken = [line for line in verdict.motion.warnings if "beyond its limit" in line]
    assert bool(broken) == (verdict.rows.min() < 0.0)
    agrees(verdict.motion.q(-0.2), splines[0](-0.2), closed_form(10))
    verdict.rows[:], verdict.rows[3, 1] = 1.0, problem.limits[0].reserve
    assert verdict.binding == ("torque of knee",)


@pytest.mark.parametrize(("size", "fault"), [(0.013, None), (0.02, "depth"), (0.15, "limit")])
def test_a_motion_is_as_bad_as_its_worst_limit_or_depth_in_the_ball(problem, size, fault):
    """Up to 4.5 mm inside the ball before the impact, a body counts as touching."""
    verdict = Verdict(problem, drawn_solution(problem, size))
    motion, more = verdict.motion, 5e-3
    centre, depth = problem.ball_centre(motion.q(0.0)), 0.0
    for t in verdict.times[0]:
        near = find_ball_overlaps(LEG.posture(motion.q(t)), centre, BALL.radius + more)
        depth = max([depth, *(value - more for value in near.values())])
    assert depth > 0.0
    right = {"depth": depth - (TOUCHING - 5e-4), "limit": -verdict.rows.min(), None: 0.0}
    assert right[fault] == max(right.values())
    assert verdict.broken == pytest.approx(right[fault], abs=closed_form(1e4))


def test_limits_hold_a_launch_back_by_their_multipliers(problem):
    """10 % more of a limit gives a tenth of its multipliers over the weight of the share."""
    start, n, rows = drawn_solution(problem), problem.n, len(problem.path.lower)
    points, speeds = np.zeros((sum(map(len, start.times)), rows + n)), np.zeros(6 * n)
    points[2, rows + 1], points[5, rows + 1], speeds[n + 2] = -3.0, 1.5, 0.9
    known = Multipliers(speeds, np.zeros(0), np.zeros(problem.splines.size * n + 1), points, [])
    solution = replace(start, share=0.83, multipliers=known)
    right = {"torque of knee": 0.1 * 4.5 / SHARE, "speed of ankle": 0.1 * 0.9 / SHARE}
    assert problem.effects(solution) == pytest.approx(right)
    line = Verdict(problem, solution).motion.warnings[0]
    assert re.search(r"reaches 83 % of the launch.*torque of knee.*speed of ankle", line)


@pytest.fixture(scope="module")
def on_a_foot():
    """The verdict on drawn splines on the left foot, of six joints."""
    sole = [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
    locked = {"*ankle*": 0, "*hip_yaw*": 0}
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True, locked=locked)
    stands = StandingRobot(
        robot.with_supports(kd.Support("left_ankle_roll_link", friction=0.6, sole=sole))
    )
    free = np.zeros((0, 3)), np.zeros(3), np.eye(3)[:2]
    task = KickTask(stands.robot, stands.leg, target_of(0.8, 0.4), np.eye(3), *free, stands)
    problem = MotionProblem(task, MotionSplines(0.5, 0.5, (3, 3)))
    c = np.random.default_rng(1).uniform(-0.2, 0.2, (problem.splines.size, problem.n))
    return Verdict(problem, MotionSolution(c[0], c, 1.0, problem.splines.times(2, 4)))


def ground_margins(standing, wrench):
    """Return the least margins of a wrench or impulse of the ground, by the sole's corners."""
    (x, y, z), moment = np.split(wrench, 2)
    low, high = standing.sole.min(axis=0), standing.sole.max(axis=0)
    turns, middle = np.arange(8) * math.pi / 4, (low + high) / 2
    centre = np.array([-moment[1], moment[0]]) / z
    twist = abs((moment[2] - middle[0] * y + middle[1] * x) / z)
    slope = ((np.cos(turns) * x + np.sin(turns) * y) / z).max()
    return {
        "friction": 0.6 * math.cos(math.pi / 8) - slope,
        "centre": min((centre - low).min(), (high - centre).min()),
        "moment": 0.5 * 0.6 * math.hypot(*(high - low)) / 2 - twist,
    }


def test_a_strike_on_a_foot_keeps_the_rows_of_the_impact(on_a_foot):
    """Facing the ball is told in the axes of the foot, and how it turns across the normal."""
    problem, leg, n = on_a_foot.problem, on_a_foot.problem.task.leg, on_a_foot.problem.n
    model, data, normal = leg.model, leg.model.createData(), problem.task.target.contact.normal
    q = np.linspace(-0.3, 0.3, n)
    posture = leg.posture(q).with_contact_offset((0.02, 0.0, 0.01))
    v = posture.joint_velocity(problem.task.target.foot_velocity(posture))
    jump = problem.jump(q)
    agrees(jump, posture.solve(-problem.task.target.impulse @ posture.jacobian), closed_form(1e4))
    values, _ = problem.impact.values(np.concatenate([q, v, jump, [1.0], jump]), [])
    ends = np.cumsum([2 * n + 1, 2, 2, 2])
    kept, facing, slip, turning, _ = np.split(np.asarray(values).ravel(), ends)
    pin.forwardKinematics(model, data, q, v)
    rate = pin.getVelocity(model, data, leg.contact_joint, pin.LOCAL_WORLD_ALIGNED).angular
    agrees([*kept, *slip], np.zeros(2 * n + 3), closed_form(1e4))
    agrees(facing, (data.oMi[leg.contact_joint].rotation.T @ normal)[:2], closed_form(10))
    across = np.linalg.norm(np.cross(rate, normal))
    assert np.linalg.norm(turning) == pytest.approx(across / TURN_SCALE, rel=closed_form(1e4))


def test_the_ground_s_impulse_in_a_verdict_is_that_of_a_strike(on_a_foot):
    verdict, task, motion = on_a_foot, on_a_foot.problem.task, on_a_foot.motion
    standing = task.standing
    posture = standing.robot.posture(motion.q(0.0)).with_contact_offset((0.02, 0.0, 0.01))
    impulse = task.target.impulse
    _, wrench = posture.respond(-impulse @ posture.jacobian)
    about = wrench[3:] + np.cross(standing.placement.translation, wrench[:3])
    right = ground_margins(standing, np.append(wrench[:3], about))
    right = [wrench[2] / np.linalg.norm(impulse) - 0.005, *right.values()]
    shown = [rows.min() for rows in np.split(verdict.impulse, [1, 9, 13])]
    agrees(shown, right, closed_form(1e4))
    named = {line.partition(" in the impact is beyond")[0] for line in motion.warnings}
    labels = [limit.limit.labels[0] for limit in verdict.problem.impulse_limits]
    assert [label in named for label in labels] == [margin < 0.0 for margin in right]
    assert min(right) < 0.0


@pytest.mark.parametrize("t", np.arange(-44, 46, 4) / 100)
def test_the_margins_of_a_motion_are_those_of_its_torques_and_its_ground(on_a_foot, t):
    standing, motion = on_a_foot.problem.task.standing, on_a_foot.motion
    robot, margins, q = motion.robot, motion.margins(t), motion.q(t)
    wrench, model, data = motion.ground_wrench(t), robot.model, robot.model.createData()
    right = ground_margins(standing, wrench)
    pin.forwardKinematics(model, data, q)
    foot, pose = joint_spheres(robot, robot.contact_joint), data.oMi[robot.contact_joint]
    places = foot.centres @ pose.rotation.T + pose.translation
    weight = 9.81 * pin.computeTotalMass(model)
    expected = {
        "the ground's force on the supporting foot": wrench[2] / weight - 0.05,
        "friction under the supporting foot": right["friction"],
        "the centre of pressure under the supporting foot [m]": right["centre"] - 3e-3,
        "the moment about the vertical under the supporting foot [m]": right["moment"],
        "the tilt of the trunk": data.oMi[1].rotation[2, 2] - math.cos(math.radians(40)),
    }
    for name in motion.joints:
        column, (low, high) = robot.velocity_index(name), robot.joint_range(name)
        angle = robot.joint_values(q)[name]
        torque, speed = abs(motion.torque(t)[column]), abs(motion.v(t)[column])
        expected[f"torque of {name}"] = 1.0 - torque / robot.effort_limit[column]
        expected[f"speed of {name}"] = 1.0 - speed / robot.velocity_limit[column]
        expected[f"range of {name} [rad]"] = min(angle - low, high - angle)
    shown = {name: margins[name] for name in expected}
    assert shown == pytest.approx(expected, rel=closed_form(1e4))
    height = margins.pop("the height of the kicking foot above the ground [m]")
    apart = margins.pop("the distance of the kicking foot from the supporting foot [m]")
    assert margins.keys() == expected.keys()
    # 14 and 6 spheres that span the foot are beyond its points
    assert height == pytest.approx((places[:, 2] - foot.radii).min(), abs=8e-3)
    beside = standing.sole[:, 1].min() - (places[:, 1] + foot.radii).max()
    assert apart == pytest.approx(beside, abs=0.02)


SPLINES = MotionSplines(0.5, 0.7, (6, 4))
COEFFICIENTS = np.random.default_rng(0).normal(size=(SPLINES.size, 2))


def values(t, order=0):
    sides = [np.array([t]), np.zeros(0)] if t <= 0 else [np.zeros(0), np.array([t])]
    return (SPLINES.values(sides, order) @ COEFFICIENTS)[0]


def test_a_motion_starts_and_ends_at_rest_and_does_not_jump_at_the_impact():
    for t in (-0.5, 0.7):
        for order in (1, 2):
            assert values(t, order) == pytest.approx(np.zeros(2), abs=closed_form(1e4))
    agrees(values(-0.5), COEFFICIENTS[0], closed_form(10))
    agrees(values(0.7), COEFFICIENTS[-1], closed_form(10))
    q, before, jump = SPLINES.at_impact() @ COEFFICIENTS
    first, second = SPLINES.motion(COEFFICIENTS)
    agrees(first(0.0), q, closed_form(10))
    agrees(second(0.0), q, closed_form(10))
    agrees(before, first(0.0, 1), closed_form(10))
    agrees(jump, second(0.0, 1) - first(0.0, 1), closed_form(10))
    assert np.abs(jump).min() > 0.1


@pytest.mark.parametrize("t", [-0.31, -0.04, 0.02, 0.4])
def test_derivatives_are_those_of_differences(t):
    h = 1e-3  # differences of the fourth order are exact for cubics
    for order in (0, 1, 2):
        wide, close = ((values(t + k * h, order) - values(t - k * h, order)) for k in (2, 1))
        agrees(values(t, order + 1), (8 * close - wide) / (12 * h), closed_form(1e4))


def test_coefficients_are_those_of_a_motion():
    agrees(SPLINES.coefficients(*SPLINES.motion(COEFFICIENTS)), COEFFICIENTS, closed_form())


def slider():
    """Return a prismatic joint, tilted, behind a turning one."""
    model = pin.Model()
    turn = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Random(), "turn")
    slide = model.addJoint(
        turn, pin.JointModelPrismaticUnaligned(np.array([0.6, 0, 0.8])), pin.SE3.Random(), "slide"
    )
    for joint in (turn, slide):
        body = pin.Inertia.FromBox(2.0, 0.1, 0.2, 0.3)
        model.appendBodyToJoint(joint, body, pin.SE3.Random())
    model.addFrame(pin.Frame("toe", slide, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    model.velocityLimit = model.effortLimit = np.full(2, 10.0)
    return kd.Leg.from_model(model, "toe")


G1 = kd.Leg.from_robot("g1", base="floating", legs_only=True)
STANDING = StandingRobot(G1.with_supports("left_ankle_roll_link"))
LEGS = {"human": kd.Leg.human(), "slider": slider(), "g1 on a foot": STANDING.leg}


@pytest.mark.parametrize("name", LEGS)
def test_the_symbols_are_those_of_pinocchio(name):
    pin.seed(0)
    leg, draw = LEGS[name], np.random.default_rng(1)
    model, joint = leg.model, leg.contact_joint
    model.armature = draw.uniform(0.0, 0.1, model.nv)
    data, tree = model.createData(), SymbolicTree(model)
    other, local = model.njoints // 2, np.array([0.1, -0.2, 0.3])
    results = {
        "torque": tree.inverse_dynamics()[0], "wrench": tree.inverse_dynamics()[1],
        "no gravity": tree.inverse_dynamics(gravity=False)[0],
        "point": tree.point(joint, leg.contact_lever), "rotation": tree.rotation(joint),
        "turning": tree.angular_velocity(joint), "seen": tree.seen_from(other, joint, ca.DM(local)),
    }  # fmt: skip
    in_symbols = ca.Function("all", [tree.q, tree.v, tree.a], list(results.values()))
    for q, v, a in draw.normal(size=(5, 3, model.nv)):
        pin.forwardKinematics(model, data, q, v)
        torque, wrench = pin.rnea(model, data, q, v, a), -(model.inertias[0] * model.gravity)
        for child in model.children[0]:
            wrench += data.oMi[child].act(data.f[child])
        weight = pin.computeGeneralizedGravity(model, model.createData(), q)
        turning = pin.getVelocity(model, data, joint, pin.LOCAL_WORLD_ALIGNED).angular
        expected = {
            "torque": torque, "wrench": wrench.vector, "no gravity": torque - weight,
            "point": leg.posture(q).contact_point, "rotation": data.oMi[joint].rotation,
            "turning": turning, "seen": data.oMi[other].actInv(data.oMi[joint].act(local)),
        }  # fmt: skip
        values = dict(zip(results, in_symbols(q, v, a), strict=True))
        for what, right in expected.items():
            agrees(np.asarray(values[what]).squeeze(), right, closed_form(1e3))
