"""What a standing robot must keep: against the robot on its support, and by differences."""

import math

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.impact.constraint_impulses import footing
from kickdyn.planning.stance import CLEARANCE, LENGTH, TILT, Condition, Stance
from kickdyn.robot.standing import StandingRobot, joint_spheres

FOOT = "left_ankle_roll_link"
CORNERS = [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
ROBOT = kd.Leg.from_robot("g1", base="floating", legs_only=True)
STANDING = StandingRobot(ROBOT.with_supports(kd.Support(FOOT, friction=0.6, sole=CORNERS)))
IMPULSE = np.array([3.0, 0.5, 1.5])
LEG = STANDING.leg
REST = np.zeros(LEG.nv)


def postures():
    draw = np.random.default_rng(3)
    return [LEG.posture(draw.uniform(-0.6, 0.6, size=LEG.nq)) for _ in range(3)]


@pytest.mark.parametrize("impulse", [None, IMPULSE])
def test_slopes_are_those_of_differences(impulse):
    stance, vs, step = Stance(STANDING, impulse), np.arange(LEG.nv), 1e-6
    for posture in postures():
        ends = [
            [stance.margins(LEG.posture(posture.q + sign * step * unit), REST) for sign in (-1, 1)]
            for unit in np.eye(LEG.nq)
        ]
        slopes = np.array([(high - low) / (2 * step) for low, high in ends]).T
        assert stance.slopes(posture, REST, vs)[0] == pytest.approx(slopes, abs=1e-5)
        assert stance.slopes(posture, REST, vs[2:5])[0] == pytest.approx(slopes[:, 2:5], abs=1e-5)


def test_the_centre_of_mass_is_that_of_the_robot_on_its_support():
    stance, model = Stance(STANDING), ROBOT.model
    for posture in postures():
        q, _ = STANDING.whole(posture.q, np.zeros(LEG.nv))
        centre = pin.centerOfMass(model, model.createData(), q)
        assert stance.centre_of_mass(posture) == pytest.approx(centre, abs=1e-12)
        # of a rectangle: to the nearest of four edges
        low, high = STANDING.sole.min(axis=0), STANDING.sole.max(axis=0)
        inside = min((centre[:2] - low).min(), (high - centre[:2]).min())
        assert stance.balance(posture) == pytest.approx(inside, abs=1e-12)


def test_the_impulse_of_the_support_is_that_of_a_strike():
    stance = Stance(STANDING, IMPULSE)
    for posture in postures():
        q, _ = STANDING.whole(posture.q, np.zeros(LEG.nv))
        there = STANDING.robot.posture(q)
        _, expected = there.respond(-IMPULSE @ there.jacobian)
        about = expected[3:] + np.cross(STANDING.placement.translation, expected[:3])
        found = stance.support_impulse(posture)
        assert found == pytest.approx([*expected[:3], *about], abs=1e-12)


def test_margins_agree_with_the_verdict_on_a_support():
    (support,) = STANDING.robot.constraints.supports
    plain, draw = len(Stance(STANDING).margins(postures()[0], REST)), np.random.default_rng(1)
    seen = set()
    for _ in range(300):
        impulse = draw.normal(size=3)
        stance = Stance(STANDING, impulse)
        posture = LEG.posture(draw.uniform(-0.6, 0.6, size=LEG.nq))
        p = stance.support_impulse(posture)
        about = p[3:] - np.cross(STANDING.placement.translation, p[:3])
        verdict = footing(support, [*p[:3], *about], STANDING.placement.rotation, 1.0)
        assert (verdict == "stands") == (stance.margins(posture, REST)[plain:] >= 0.0).all()
        seen.add(verdict)
    assert seen == {"stands", "slips", "tips", "lifts-off"}


def test_the_kicking_foot_is_as_high_as_its_lowest_corner():
    stance = Stance(STANDING)
    level = LEG.posture(LEG.configuration())  # both soles are on one level
    heights = stance.margins(level, REST)[stance.rows(Condition.CLEARANCE)] * LENGTH
    assert -7e-3 < heights.min() < -CLEARANCE
    bend = {"right_hip_pitch_joint": -0.8, "right_knee_joint": 0.8}
    raised = LEG.posture(LEG.configuration(bend))
    assert (stance.margins(raised, REST)[stance.rows(Condition.CLEARANCE)] * LENGTH).min() > 0.03


def test_no_point_of_the_kicking_foot_is_lower_than_its_margin_says():
    stance, robot = Stance(STANDING), STANDING.robot
    foot, data = joint_spheres(robot, robot.contact_joint), robot.model.createData()
    for posture in postures():
        pin.forwardKinematics(robot.model, data, STANDING.whole(posture.q, REST)[0])
        pose = data.oMi[robot.contact_joint]
        lowest = (foot.centres @ pose.rotation[2] - foot.radii).min() + pose.translation[2]
        margin = stance.margins(posture, REST)[stance.rows(Condition.CLEARANCE)].min() * LENGTH
        assert lowest - 7e-3 < margin < lowest - CLEARANCE + 2e-4


def test_a_kick_of_talos_has_its_foot_above_the_ground():
    talos = kd.Leg.from_robot("talos", base="floating", legs_only=True)
    robot = talos.with_supports(kd.Support("left_sole_link", friction=0.8))
    plan = kd.plan_kick(robot, kd.Goal(3, time=0.4), kd.Ball(), kd.Air())
    assert not any("under the ground at the impact" in line for line in plan.warnings)
    foot, data = joint_spheres(robot, robot.contact_joint), robot.model.createData()
    pin.forwardKinematics(robot.model, data, plan.q)
    pose = data.oMi[robot.contact_joint]
    lowest = (foot.centres @ pose.rotation[2] - foot.radii).min() + pose.translation[2]
    assert lowest > 0.5 * CLEARANCE


def test_the_trunk_is_upright_within_30_degrees_of_the_vertical():
    stance, draw, seen = Stance(STANDING), np.random.default_rng(5), set()
    assert stance.margins(LEG.posture(LEG.configuration()), REST)[-1] == pytest.approx(
        1.0, abs=1e-12
    )
    for _ in range(50):
        posture = LEG.posture(draw.uniform(-0.6, 0.6, size=LEG.nq))
        q, _ = STANDING.whole(posture.q, np.zeros(LEG.nv))
        height = pin.Quaternion(q[3:7]).matrix()[2, 2]  # of the base's vertical axis
        found = stance.margins(posture, REST)[-1]
        assert found == pytest.approx((height - math.cos(TILT)) / (1 - math.cos(TILT)), abs=1e-9)
        assert (found >= 0.0) == (math.degrees(math.acos(height)) <= 30.0)
        seen.add(bool(found >= 0.0))
    assert seen == {False, True}


def test_a_trunk_that_is_the_foot_is_upright():
    robot = kd.Leg.from_robot("g1", base="floating").with_supports(
        kd.Support("pelvis", sole=[(0.1, 0.1, -0.1), (-0.1, 0.1, -0.1), (0.0, -0.1, -0.1)])
    )
    stance = Stance(standing := StandingRobot(robot))
    posture, still = standing.leg.posture(np.full(standing.leg.nq, 0.1)), np.zeros(standing.leg.nv)
    assert stance.margins(posture, still)[-1] == pytest.approx(1.0)
    assert not stance.slopes(posture, still, np.arange(len(still)))[0][-1].any()


@pytest.mark.parametrize("condition", Condition)
def test_a_condition_is_left_out(condition):
    rows = {
        Condition.BALANCE: slice(0, 4),
        Condition.CLEARANCE: slice(4, -1),
        Condition.UPRIGHT: slice(-1, None),
    }
    named = Stance(STANDING, without=condition)
    for other in set(Condition) - {condition}:
        margins = named.margins(postures()[0], REST)[named.rows(other)]
        assert (
            margins.tolist() == Stance(STANDING).margins(postures()[0], REST)[rows[other]].tolist()
        )
    posture, vs = postures()[0], np.arange(LEG.nv)
    every, fewer = Stance(STANDING), Stance(STANDING, without=condition)
    margins, slopes = every.margins(posture, REST), every.slopes(posture, REST, vs)[0]
    left = np.delete(np.arange(len(margins)), rows[condition])
    assert fewer.margins(posture, REST) == pytest.approx(margins[left], abs=1e-12)
    assert fewer.slopes(posture, REST, vs)[0] == pytest.approx(slopes[left], abs=1e-12)


def test_a_foot_that_rises_is_higher():
    """By the rule for each corner, and with slopes by q and v as of differences."""
    stance, plain, lift = Stance(STANDING, lift=20.0), Stance(STANDING), 20.0
    draw, step, vs = np.random.default_rng(7), 1e-6, np.arange(LEG.nv)
    for posture in postures():
        v = draw.normal(size=LEG.nv)
        off = (plain.margins(posture, v) - stance.margins(posture, v))[
            stance.rows(Condition.CLEARANCE)
        ] * LENGTH
        rising = (
            plain.slopes(posture, v, vs)[0][stance.rows(Condition.CLEARANCE)] * LENGTH @ v
        )  # of each corner
        left = stance._left
        high = np.maximum(left, rising.clip(min=0.0) ** 2 / (2 * lift))
        assert off == pytest.approx(high - left, abs=1e-9)
        for side, (by_q, by_v) in enumerate([(1.0, 0.0), (0.0, 1.0)]):
            ends = [
                [
                    stance.margins(
                        LEG.posture(posture.q + by_q * sign * unit), v + by_v * sign * unit
                    )
                    for sign in (-step, step)
                ]
                for unit in np.eye(LEG.nv)
            ]
            slopes = np.array([(high - low) / (2 * step) for low, high in ends]).T
            assert stance.slopes(posture, v, vs)[side] == pytest.approx(slopes, abs=1e-4)
