"""What a standing robot must keep, against the robot on its support."""

import math

import numpy as np
import pinocchio as pin
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.impact.leg_response import footing
from kickdyn.planning import kick_limits as module
from kickdyn.robot.standing import StandingRobot, joint_spheres

FOOT = "left_ankle_roll_link"
CORNERS = [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
ROBOT = kd.Leg.from_robot("g1", base="floating", legs_only=True)
STANDING = StandingRobot(ROBOT.with_supports(kd.Support(FOOT, friction=0.6, sole=CORNERS)))
IMPULSE = np.array([3.0, 0.5, 1.5])
LEG = STANDING.leg
STILL = np.zeros(LEG.nv)


def postures(count=3, seed=3):
    draw = np.random.default_rng(seed)
    return [LEG.posture(draw.uniform(-0.6, 0.6, size=LEG.nq)) for _ in range(count)]


def on_robot(posture):
    return STANDING.robot_state(posture.q, STILL)[0]


def test_the_centre_of_mass_is_that_of_the_robot_on_its_support():
    balance, model = module.Balance(STANDING), ROBOT.model
    for posture in postures():
        centre = pin.centerOfMass(model, model.createData(), on_robot(posture))
        assert module.centre_of_mass(posture) == pytest.approx(centre, abs=closed_form(10))
        # of a rectangle: to the nearest of four edges
        low, high = STANDING.sole.min(axis=0), STANDING.sole.max(axis=0)
        inside = min((centre[:2] - low).min(), (high - centre[:2]).min())
        assert balance.distance(posture) == pytest.approx(inside, abs=closed_form(10))


def test_the_impulse_of_the_support_is_that_of_a_strike():
    term = module.SupportImpulse(STANDING, IMPULSE)
    support = kd.Support(FOOT, sole=CORNERS)  # of unknown friction, which limits nothing
    smooth = module.SupportImpulse(StandingRobot(ROBOT.with_supports(support)), IMPULSE)
    for posture in postures():
        assert smooth.residual(posture).tolist() == term.residual(posture)[:-1].tolist()
        assert term.residual(posture)[0] == term.wrench(posture)[2]  # the normal impulse
        there = STANDING.robot.posture(on_robot(posture))
        _, expected = there.respond(-IMPULSE @ there.jacobian)
        about = expected[3:] + np.cross(STANDING.placement.translation, expected[:3])
        assert term.wrench(posture) == pytest.approx([*expected[:3], *about], abs=closed_form(10))


def test_a_support_impulse_is_kept_where_the_strike_says_that_the_foot_stands():
    (support,) = STANDING.robot.constraints.supports
    draw, seen = np.random.default_rng(1), set()
    for _ in range(300):
        term = module.SupportImpulse(STANDING, draw.normal(size=3))
        posture = LEG.posture(draw.uniform(-0.6, 0.6, size=LEG.nq))
        residual, p = term.residual(posture), term.wrench(posture)
        if np.abs(residual).min() < 1e-6:
            continue
        about = p[3:] - np.cross(STANDING.placement.translation, p[:3])
        verdict = footing(support, [*p[:3], *about], STANDING.placement.rotation, 1.0)
        assert (verdict in ("stands", "turns")) == (residual >= 0.0).all(), (verdict, residual)
        seen.add(verdict)
    assert seen == {"stands", "turns", "slips", "tips", "lifts-off"}


@pytest.mark.parametrize("ground", [0.0, -0.3])
def test_no_point_of_the_kicking_foot_is_lower_than_its_value_says(ground):
    clearance = module.KickClearance(STANDING.robot, STANDING.leg, ground)
    robot = STANDING.robot
    foot, data = joint_spheres(robot, robot.contact_joint), robot.model.createData()
    for posture in (*postures(), LEG.posture(LEG.configuration())):
        pin.forwardKinematics(robot.model, data, on_robot(posture))
        pose = data.oMi[robot.contact_joint]
        lowest = (foot.centres @ pose.rotation[2] - foot.radii).min() + pose.translation[2]
        value = clearance.residual(posture, STILL).min()
        # the spheres that span the foot may be up to 7 mm lower than its points
        assert lowest - ground - 7e-3 < value < lowest - ground - module.CLEARANCE + 2e-4


def test_the_trunk_is_upright_within_30_degrees_of_the_vertical():
    upright, seen = module.Upright(STANDING), set()
    level = upright.residual(LEG.posture(LEG.configuration()), STILL)
    assert level == pytest.approx([1 - math.cos(math.radians(30))], abs=closed_form(10))
    for posture in postures(30, seed=5):
        height = pin.Quaternion(on_robot(posture)[3:7]).matrix()[2, 2]  # of the base's axis
        (value,) = upright.residual(posture, STILL)
        assert value == pytest.approx(height - math.cos(module.TILT), abs=closed_form(1e4))
        seen.add(bool(value >= 0.0))
    assert seen == {False, True}
