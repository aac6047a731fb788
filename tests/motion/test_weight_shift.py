"""The shift of the weight between both feet, against Pinocchio's dynamics of the whole robot."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import gymnasium
import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import BSpline

import kickdyn as kd
from kickdyn.motion import plan_motion
from kickdyn.motion.motion import Motion
from kickdyn.motion.verdict import shift_weight
from kickdyn.planning import kick

BALL, AIR = kd.Ball(), kd.Air()
FEET = "left_ankle_roll_link", "right_ankle_roll_link"


def problem_of(robot, **options):
    """Return the problem of a motion from both feet, and a posture at its ends with a start."""
    found = []

    def stop(task, near=None):
        problem = plan_motion._problem_of(task)
        found.extend([problem, *next(plan_motion._starts(problem, plan_motion._Near(None)))])
        raise kd.InvalidInput("enough")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan_motion, "plan_motion", stop)
        with pytest.raises(kd.InvalidInput, match="enough"):
            kd.plan_kick(robot, kd.Goal(2, time=0.4), BALL, AIR, motion="both-feet", **options)
    return found


@cache
def problem():
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    return problem_of(robot.with_supports(kd.Support(FEET[0], friction=0.7)))


@cache
def shifting():
    """Return a motion that is at rest on one foot between the shifts."""
    of_motion, rest, _ = problem()
    task = of_motion.task
    shift = shift_weight(of_motion, of_motion.feet, rest)
    splines = [BSpline(t, np.tile(rest, (4, 1)), 3) for t in np.repeat([[-0.3, 0], [0, 0.3]], 4, 1)]
    placement = task.standing.placement
    return Motion(task.robot, task.leg.joint_names, *splines, placement, shift=shift)


def times():
    motion = shifting()
    return np.linspace(motion.begin + 0.01, -0.31, 9)


@pytest.mark.parametrize("frame", FEET)
def test_both_feet_stay_in_place(frame):
    motion = shifting()
    model = motion.robot.model
    data, number = model.createData(), model.getFrameId(frame)
    places = []
    for t in (*times(), 0.0, motion.end):
        pin.forwardKinematics(model, data, motion.q(t), motion.v(t))
        places.append(pin.updateFramePlacement(model, data, number).homogeneous)
        assert np.abs(pin.getFrameVelocity(model, data, number).vector).max() < 1e-11
    assert np.ptp(places, axis=0).max() < 1e-11


def test_velocity_and_acceleration_are_derivatives():
    shift, h = shifting().shift, 1e-5
    for t in np.linspace(0.1, 0.9, 5) * shift.duration:
        states = [shift.joint_state(t + step) for step in (-h, 0.0, h)]
        for order in (0, 1):
            slope = (states[2][order] - states[0][order]) / (2 * h)
            np.testing.assert_allclose(states[1][order + 1], slope, atol=1e-7)
    for end in (0.0, shift.duration):
        assert np.abs(np.concatenate(shift.joint_state(end)[1:])).max() < 1e-12


def test_torques_and_both_wrenches_accelerate_the_robot_so():
    motion, h = shifting(), 1e-6
    model = motion.robot.model
    data, loaded = model.createData(), 0
    for t in times():
        q, v, force = motion.q(t), motion.v(t), motion.torque(t)
        wrenches = motion.foot_wrenches(t)
        np.testing.assert_allclose(sum(wrenches), motion.ground_wrench(t), atol=1e-10)
        for frame, wrench in zip(FEET, wrenches, strict=True):
            number = model.getFrameId(frame)
            pin.forwardKinematics(model, data, q)
            local = pin.updateFramePlacement(model, data, number).actInv(pin.Force(wrench)).vector
            force += pin.computeFrameJacobian(model, data, q, number, pin.LOCAL).T @ local
            loaded += wrench[2] > 1.0
        rate = (motion.v(t + h) - motion.v(t - h)) / (2 * h)
        np.testing.assert_allclose(pin.aba(model, data, q, v, force), rate, atol=2e-4)
    assert len(times()) < loaded < 2 * len(times())  # the kicking foot at some times


def test_each_foot_is_pressed_inside_its_sole():
    motion = shifting()
    feet = motion.shift.feet
    for t in times():
        soles = feet.standing.sole, feet.other.sole
        for wrench, sole in zip(motion.foot_wrenches(t), soles, strict=True):
            if wrench[2] > 1.0:
                centre = np.array([-wrench[4], wrench[3]]) / wrench[2]
                assert (centre > sole.min(axis=0) + 3e-3).all()
                assert (centre < sole.max(axis=0) - 3e-3).all()
                assert np.hypot(*wrench[:2]) < 0.7 * wrench[2]
        assert min(motion.margins(t).values()) >= 0.0
        limit = motion.robot.effort_limit[6:]
        assert (np.abs(motion.torque(t)[6:]) <= limit).all()


def test_the_weight_goes_from_both_feet_to_one_and_back():
    motion = shifting()
    weight = 9.81 * pin.computeTotalMass(motion.robot.model)
    at_rest, alone = motion.foot_wrenches(motion.begin), motion.foot_wrenches(0.0)
    assert [wrench[2] for wrench in at_rest] == pytest.approx([weight / 2] * 2, rel=1e-6)
    assert [wrench[2] for wrench in alone] == pytest.approx([weight, 0.0], abs=1e-9)
    assert [phase.name for phase in motion.phases] == [
        "shift onto one foot", "backswing", "recovery", "shift onto both feet"
    ]  # fmt: skip
    assert motion.begin == pytest.approx(-0.3 - motion.shift.duration)
    for t in (0.1, 0.4):
        np.testing.assert_allclose(motion.q(0.3 + t), motion.q(-0.3 - t), atol=1e-12)
        np.testing.assert_allclose(motion.v(0.3 + t), -motion.v(-0.3 - t), atol=1e-12)


def test_a_turned_motion_has_turned_wrenches():
    motion, turn = shifting(), pin.SE3(pin.rpy.rpyToMatrix(0, 0, 0.7), np.array([0.3, 0.1, 0.0]))
    turned = replace(motion, placement=turn * motion.placement)
    for wrench, other in zip(motion.foot_wrenches(-1.0), turned.foot_wrenches(-1.0), strict=True):
        np.testing.assert_allclose(turn.act(pin.Force(wrench)).vector, other, atol=1e-8)


def test_a_shift_that_is_too_fast_names_the_limits_that_it_breaks():
    shift = replace(shifting().shift, duration=0.25)
    lines = shift.warnings()
    assert any("centre of pressure under the supporting foot" in line for line in lines)
    assert all(line.endswith("while the weight is shifted") for line in lines)


def test_both_ends_of_a_solution_are_the_posture_on_both_feet():
    of_motion, rest, start = problem()
    options = {"mu_init": 1e-3, "max_iter": 3}
    solution = of_motion.solve(start, rest, start.times, shares=(0.0, 1.0), options=options)
    for end in (0, -1):
        np.testing.assert_array_equal(solution.coefficients[end], rest)
    assert np.abs(solution.coefficients[5] - rest).max() > 1e-3


def test_forces_of_joints_that_give_way_are_of_the_mean_of_two_solutions(monkeypatch):
    of_motion, rest, start = problem()
    find, seen = of_motion._changes, []

    def keep(times, coefficients, share):
        seen.append(coefficients)
        return find(times, coefficients, share)

    monkeypatch.setattr(of_motion, "_changes", keep)
    options = {"shares": (0.0, 1.0), "options": {"mu_init": 1e-3, "max_iter": 2}}
    for _ in range(2):
        start = of_motion.solve(start, rest, start.times, **options)
        assert start.linearized is seen[-1]
    last = of_motion.solve(start, rest, start.times, **options)
    np.testing.assert_array_equal(seen[2], (start.coefficients + seen[1]) / 2)
    assert np.abs(seen[2] - start.coefficients).max() > 1e-3
    assert last.linearized is seen[2]


def test_a_kicking_limb_of_too_few_joints_is_refused():
    file = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    humanoid = kd.Leg.from_mjcf(file, "right_foot", base="floating").with_supports("left_foot")
    front = kd.Contact(friction=0.4, offset=(0.1, 0.0, 0.1))
    with pytest.raises(kd.InvalidInput, match="has 4 joints: a motion that starts and ends on"):
        kd.plan_kick(humanoid, kd.Goal(1.5, time=0.4), BALL, AIR, contact=front, motion="both-feet")


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ("two", "motion is 'two': it must be True, False or 'both-feet'"),
        (kick.BOTH_FEET, "leg_human has no support: a motion starts on both feet with a robot"),
    ],
)
def test_other_motions_and_legs_are_refused(motion, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_kick(kd.Leg.human(), kd.Goal(10, time=1), BALL, AIR, motion=motion)
