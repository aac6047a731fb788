"""The backswing of a standing robot: against its plan, its support, the ground and momentum."""

import math
import re
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.planning import backswing as backswing_module
from kickdyn.planning.backswing import (
    LEAN,
    WEIGHTS,
    Backswing,
    _BackswingProblem,
    _Dynamics,
    find_backswing,
)
from kickdyn.planning.plan_report import verdict
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.robot.standing import StandingRobot, hold_support, joint_spheres

BALL, AIR, FOOT = kd.Ball(), kd.Air(), "left_ankle_roll_link"
ROBOT = kd.Leg.from_robot("g1", base="floating", legs_only=True).with_supports(
    kd.Support(FOOT, friction=0.7)
)


@pytest.fixture(scope="module")
def plan():
    return kd.plan_kick(ROBOT, kd.Goal(3, time=0.4), BALL, AIR, swing=True)


def fine_times(backswing, count=40):
    """Return times ten times finer than those at which the solver knows heights."""
    nodes = backswing.phase.nodes
    return np.interp(np.arange(count * (len(nodes) - 1) + 1) / count, range(len(nodes)), nodes)


def test_it_ends_in_the_plan_and_starts_at_rest(plan):
    backswing = plan.backswing
    assert plan.share == 1.0
    assert backswing.configuration(0.0) == pytest.approx(plan.q, abs=1e-9)
    assert backswing.velocity(0.0) == pytest.approx(plan.v, abs=1e-9)
    assert np.abs(backswing.velocity(-backswing.duration)).max() < 1e-9
    assert np.array_equal(
        backswing.configuration(-9.0), backswing.configuration(-backswing.duration)
    )
    assert 0.1 <= backswing.duration <= 1.0


def test_its_velocity_is_that_of_its_configurations(plan):
    backswing, model, step = plan.backswing, plan.leg.model, 1e-6
    for time in np.linspace(-0.9, -0.1, 5) * backswing.duration:
        ends = [backswing.configuration(time + side * step) for side in (-1, 1)]
        moved = pin.difference(model, *ends) / (2 * step)
        assert backswing.velocity(time) == pytest.approx(moved, abs=1e-5)


def test_the_supporting_foot_stays_where_it_stands(plan):
    model, data = plan.leg.model, plan.leg.model.createData()
    number = model.getFrameId(FOOT)
    pin.forwardKinematics(model, data, plan.q)
    place = pin.updateFramePlacement(model, data, number).copy()
    for time in fine_times(plan.backswing, 2):
        q, v = plan.backswing.configuration(time), plan.backswing.velocity(time)
        pin.forwardKinematics(model, data, q, v)
        here = pin.updateFramePlacement(model, data, number)
        assert here.homogeneous == pytest.approx(place.homogeneous, abs=1e-9)
        assert np.abs(pin.getFrameVelocity(model, data, number).vector).max() < 1e-9


def test_every_point_of_the_kicking_limb_is_above_the_ground(plan):
    leg, model, data = plan.leg, plan.leg.model, plan.leg.model.createData()
    joints = [
        model.getJointId(f"right_{name}_joint") for name in ("knee", "ankle_pitch", "ankle_roll")
    ]
    bodies, lowest = [(joint, joint_spheres(leg, joint)) for joint in joints], math.inf
    for time in fine_times(plan.backswing):
        pin.forwardKinematics(model, data, plan.backswing.configuration(time))
        for joint, body in bodies:
            points = body.centres @ data.oMi[joint].rotation.T + data.oMi[joint].translation
            lowest = min(lowest, float((points[:, 2] - body.radii).min()))
    assert lowest >= 0.0
    assert lowest == pytest.approx(plan.backswing.clearance, abs=5e-4)


def test_joints_and_trunk_keep_their_limits(plan):
    backswing, leg = plan.backswing, plan.leg
    for time in fine_times(backswing, 10):
        q, v = backswing.configuration(time), backswing.velocity(time)
        assert (q[7:] >= leg.lower[7:]).all()
        assert (q[7:] <= leg.upper[7:]).all()
        assert (np.abs(v[6:]) <= leg.velocity_limit[6:]).all()
        assert pin.Quaternion(q[3:7]).matrix()[2, 2] >= math.cos(LEAN) - 1e-9


def test_it_starts_in_a_posture_that_stands(plan):
    start, model = plan.backswing.configuration(-plan.backswing.duration), plan.leg.model
    centre = pin.centerOfMass(model, model.createData(), start)[:2]
    (support,) = plan.leg.constraints.supports
    data = model.createData()
    pin.forwardKinematics(model, data, start)
    pose = pin.updateFramePlacement(model, data, model.getFrameId(FOOT))
    corners = [pose.act(corner)[:2] for corner in support.sole]
    turns = [np.cross([*(a - centre), 0], [*(b - centre), 0])[2] for a in corners for b in corners]
    assert max(turns) > 0.0 > min(turns)
    sides = np.sort([math.atan2(*(corner - centre)[::-1]) for corner in corners])
    assert np.diff(np.append(sides, sides[0] + 2 * math.pi)).max() < math.pi  # inside their hull


def test_the_wrench_of_the_ground_is_the_change_of_momentum(plan):
    """Of the robot on its floating base, about the world's origin, less gravity."""
    backswing, model = plan.backswing, plan.leg.model
    data, step = model.createData(), 1e-5
    dynamics = _Dynamics(backswing.phase.chain)

    def momentum(time):
        q, v = backswing.configuration(time), backswing.velocity(time)
        pin.computeCentroidalMomentum(model, data, q, v)
        linear, centre = data.hg.linear, data.com[0]
        return np.concatenate([linear, data.hg.angular + np.cross(centre, linear)]), centre.copy()

    for time in (-0.8 * backswing.duration, -0.03, -0.001):
        (before, _), (after, _) = momentum(time - step), momentum(time + step)
        here = backswing.phase.sample(time)
        wrench = dynamics.torques(here.q[0], here.v[0], here.a[0])[0][:6]
        weight = np.array([0.0, 0.0, -dynamics.weight])
        gravity = np.concatenate([weight, np.cross(momentum(time)[1], weight)])
        change = (after - before) / (2 * step)
        assert wrench + gravity == pytest.approx(change, rel=1e-4, abs=0.05)


def test_what_it_takes_beyond_the_limits_is_named(plan):
    backswing = plan.backswing
    chain, most = backswing.phase.chain, np.abs(backswing.phase.fine.torque).max(axis=0)

    def line_of(limit):
        phase = replace(backswing.phase, chain=replace(chain, effort_limit=limit))
        lines = Backswing(phase, backswing.standing).warnings
        return [one for one in lines if one.startswith("the backswing takes more than")]

    assert line_of(1.001 * most) == []
    limit = np.append(1.001 * most[:-1], most[-1] / 2)
    last = f"the backswing takes more than the torque limits: {chain.names[-1]} 200%"
    assert line_of(limit) == [last]


def test_torques_above_their_limits_are_beyond_the_limits(plan):
    over = plan.backswing.too_strong
    assert over  # of this kick
    assert plan.status == "beyond-limits"
    assert set(plan.binding) >= {f"torque of {name} in the backswing" for name in over}
    line = verdict(plan)
    assert line.startswith("The ball reaches the target (3, 0, 0) m after 0.4 s; ")
    assert line.endswith(" But the backswing takes more than the torque limits of the robot.")


def test_a_support_that_does_not_stand_is_named(plan):
    rough = StandingRobot(ROBOT.with_supports(kd.Support(FOOT, friction=0.01)))
    (line,) = [one for one in Backswing(plan.backswing.phase, rough).warnings if "slips" in one]
    assert line.startswith(f"in the backswing, {FOOT} ")
    assert line.endswith("of the time; the motion takes forces that ground cannot supply")
    assert set(plan.backswing.warnings) <= set(plan.warnings)


def test_slopes_of_the_residuals_are_those_of_differences(plan):
    chain = plan.backswing.phase.chain
    problem = _BackswingProblem(
        StandingRobot(ROBOT),
        np.array([plan.leg.joint_values(plan.q)[name] for name in chain.names]),
        np.array([plan.v[plan.leg.velocity_index(name)] for name in chain.names]),
    )
    draw, step = np.random.default_rng(2), 1e-6
    x = problem.guess()
    x[:-1] += draw.normal(size=len(x) - 1)
    _, slopes = problem._residuals(x, WEIGHTS[1])
    for i in [*draw.choice(len(x) - 1, 6, replace=False), len(x) - 1]:
        ends = [
            problem._residuals(x + side * step * np.eye(len(x))[i], WEIGHTS[1])[0]
            for side in (-1, 1)
        ]
        expected = (ends[1] - ends[0]) / (2 * step)
        assert slopes[:, i] == pytest.approx(expected, rel=1e-4, abs=1e-3 * np.abs(expected).max())


def test_without_a_backswing_the_reason_is_named(plan, monkeypatch):
    monkeypatch.setattr(backswing_module, "WEIGHTS", WEIGHTS[:1])
    chain, standing = plan.backswing.phase.chain, StandingRobot(ROBOT)
    q = np.array([plan.leg.joint_values(plan.q)[name] for name in chain.names])
    v = np.array([plan.v[plan.leg.velocity_index(name)] for name in chain.names])
    at_end = q.copy()
    at_end[0] = chain.upper[0]
    found, reason = find_backswing(standing, at_end, np.where(np.arange(len(v)) == 0, -5.0, v))
    assert found is None
    assert "under the ground" in reason or f"{chain.names[0]} is" in reason


def test_a_foot_that_would_have_to_rise_from_under_the_ground_is_refused():
    bare = kd.Leg.from_robot("g1", base="floating", legs_only=True, drives=False)
    robot = bare.with_supports(*ROBOT.supports)
    with pytest.raises(kd.InvalidInput, match="finds no backswing to this kick: its kicking foot"):
        kd.plan_kick(robot, kd.Goal(2, time=0.5), BALL, AIR, swing=True)


def test_a_launch_beyond_the_limits_is_refused():
    with pytest.raises(kd.InvalidInput, match="no posture reaches the launch within its limits"):
        kd.plan_kick(ROBOT, kd.Goal(60, time=0.8), BALL, AIR, swing=True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"limits": False}, "limits is False: a swing is planned within limits"),
        ({"objective": "foot-speed"}, r"with swing=True \(--swing\) it must be joint-speed"),
    ],
)
def test_options_that_have_no_swing_are_refused(options, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.plan_kick(ROBOT, kd.Goal(3, time=0.4), BALL, AIR, swing=True, **options)


def test_a_plan_without_a_backswing_says_how_to_ask_for_it():
    plan = kd.plan_kick(ROBOT, kd.Goal(2, time=0.5), BALL, AIR)
    assert plan.backswing is None
    start = "bodies come from under the ground if the joints keep the velocity of the impact: right"
    (line,) = [one for one in plan.warnings if one.startswith(start)]
    assert line.endswith("swing=True (--swing) plans the motion, with the foot above the ground")
    frame, depth, moment = re.search(r"(right\w+) by (\S+) m \((\d+) ms before\)", line).groups()
    model, posture, expected = plan.leg.workspace.model, plan.impact.posture, {}
    for time in np.linspace(0.0, BALL.radius / np.linalg.norm(plan.impact.foot_velocity), 10):
        q = hold_support(posture, pin.integrate(model, plan.q, -time * plan.v))
        depths = {under.frame: under.depth for under in find_depths(plan.leg, [q], 0.0)}
        expected[time] = depths.get(frame, 0.0)
    deepest = max(expected, key=expected.get)
    assert float(depth) == pytest.approx(expected[deepest], abs=6e-4)
    assert float(moment) == pytest.approx(1e3 * deepest, abs=0.51)


def test_a_humanoid_of_an_mjcf_file_has_a_backswing():
    file = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    humanoid = kd.Leg.from_mjcf(file, "right_foot", base="floating").with_supports("left_foot")
    front = kd.Contact(friction=0.4, offset=(0.075, 0.0, 0.1))
    plan = kd.plan_kick(humanoid, kd.Goal(1.5, time=0.5), BALL, AIR, contact=front, swing=True)
    model, data = plan.leg.model, plan.leg.model.createData()
    assert plan.share == 1.0
    assert (plan.status == "beyond-limits") == (plan.backswing.phase.torque_use > 1.0)
    for time in fine_times(plan.backswing):
        pin.forwardKinematics(model, data, plan.backswing.configuration(time))
        for foot, height in (("right_foot", plan.backswing.clearance - 5e-4), ("left_foot", -1e-9)):
            pose = pin.updateFramePlacement(model, data, model.getFrameId(foot))
            assert pose.act(np.array([0.0, 0.0, 0.1]))[2] - 0.075 >= height  # a sphere
        assert data.oMi[1].rotation[2, 2] >= math.cos(LEAN) - 1e-9  # the torso, above its waist
    assert plan.backswing.clearance >= 0.0
    assert not any("under the ground" in line for line in plan.warnings)


def test_a_centre_of_pressure_beside_the_sole_counts_on_every_side(plan):
    standing, chain = plan.backswing.standing, plan.backswing.phase.chain
    n = len(chain.names)
    problem = backswing_module._BackswingProblem(standing, plan.q[-n:], np.zeros(n))
    force, none = [0.0, 0.0, 300.0], [np.zeros((6, n))] * 3
    centre = standing.sole.mean(axis=0)
    for corner in standing.sole:
        for share in (0.95, 1.1):
            point = [*(centre + share * (corner - centre)), 0.0]
            wrench = np.array([*force, *np.cross(point, force)])
            assert problem._wrench(wrench, none, 1.0).values.any() == (share > 1.0)
