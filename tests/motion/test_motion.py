"""A motion of splines, by Pinocchio alone."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from kickdyn.motion.motion_plot import motion_figure


def test_a_motion_of_a_fixed_leg_is_its_splines_and_its_inverse_dynamics(swinging):
    leg, t = swinging.robot, -0.2
    q, v, a = (swinging.before(t, order) for order in range(3))
    np.testing.assert_allclose(swinging.q(t), q)
    np.testing.assert_allclose(swinging.v(t), v)
    torque = pin.rnea(leg.model, leg.model.createData(), q, v, a)
    np.testing.assert_allclose(swinging.torque(t), torque, atol=1e-12)
    assert not swinging.ground_wrench(t).any()
    assert (swinging.begin, swinging.end) == (-0.53, 0.61)
    assert [phase.name for phase in swinging.phases] == ["backswing", "recovery"]


def test_the_impact_is_a_jump_of_the_velocity_alone(swinging):
    np.testing.assert_allclose(swinging.q(0.0), swinging.q(1e-12), atol=1e-9)
    np.testing.assert_allclose(swinging.v(0.0), swinging.before(0.0, 1))
    np.testing.assert_allclose(swinging.v_after, swinging.after(0.0, 1))
    assert np.abs(swinging.v_after - swinging.v(0.0)).max() > 0.1


def test_a_robot_is_at_rest_before_and_after(walking):
    for t, end in ((-2.0, walking.begin), (2.0, walking.end)):
        np.testing.assert_allclose(walking.q(t), walking.q(end))
        assert not walking.v(t).any()
        weight = walking.ground_wrench(t)[2]
        mass = pin.computeTotalMass(walking.robot.model)
        assert weight == pytest.approx(9.81 * mass, rel=1e-12)


@pytest.mark.parametrize("t", [-0.31, -0.07, 0.0, 0.26])
def test_the_supporting_foot_does_not_move(walking, t):
    model = walking.robot.model
    data, frame = model.createData(), model.getFrameId("left_ankle_roll_link")
    pin.forwardKinematics(model, data, walking.q(t), walking.v(t))
    pose = pin.updateFramePlacement(model, data, frame)
    np.testing.assert_allclose(pose.homogeneous, walking.placement.homogeneous, atol=1e-12)
    assert np.abs(pin.getFrameVelocity(model, data, frame).vector).max() < 1e-12


@pytest.mark.parametrize("t", [-0.31, -0.07, 0.26])
def test_gravity_and_the_ground_change_the_momentum(walking, t):
    """The rate of the centroidal momentum by central differences."""
    model, h = walking.robot.model, 1e-5
    data = model.createData()

    def momentum(time):
        pin.computeCentroidalMomentum(model, data, walking.q(time), walking.v(time))
        centre = data.com[0].copy()
        force, moment = data.hg.linear.copy(), data.hg.angular.copy()
        return np.concatenate([force, moment + np.cross(centre, force)]), centre

    rate = (momentum(t + h)[0] - momentum(t - h)[0]) / (2 * h)
    weight = pin.computeTotalMass(model) * model.gravity.linear
    wrench = walking.ground_wrench(t)
    wrench += np.concatenate([weight, np.cross(momentum(t)[1], weight)])
    np.testing.assert_allclose(rate, wrench, rtol=1e-6, atol=1e-4)


def test_torques_drive_the_robot_as_its_accelerations_say(walking):
    """Forward dynamics with torques, and the wrench on the foot, gives the velocity's rate."""
    model, t, h = walking.robot.model, -0.2, 1e-6
    data, frame = model.createData(), model.getFrameId("left_ankle_roll_link")
    q, v = walking.q(t), walking.v(t)
    force = walking.torque(t)
    assert not force[:6].any()
    on_foot = walking.placement.actInv(pin.Force(walking.ground_wrench(t))).vector
    force += pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL).T @ on_foot
    acceleration = pin.aba(model, data, q, v, force)
    rate = (walking.v(t + h) - walking.v(t - h)) / (2 * h)
    np.testing.assert_allclose(acceleration, rate, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("name", ["swinging", "walking"])
def test_the_plot_has_all_torques_and_speeds(name, request):
    """In per cent of the limits, before and after the impact."""
    motion = request.getfixturevalue(name)
    robot, panels = motion.robot, motion.plot().axes
    at = [robot.velocity_index(joint) for joint in motion.joints]
    for axes, value, limit in (
        (panels[0], motion.torque, robot.effort_limit),
        (panels[1], motion.v, robot.velocity_limit),
    ):
        curves = axes.lines[: 2 * len(at)]
        for k, curve in enumerate(curves):
            times = curve.get_xdata()[[0, 7, -1]]
            column = at[k % len(at)]
            shown = [100 * value(t)[column] / limit[column] for t in times]
            assert curve.get_ydata()[[0, 7, -1]] == pytest.approx(shown, rel=1e-9, abs=1e-9)
            assert (times[0] < 0) == (k < len(at))
    assert [line.get_label() for line in panels[0].lines[: len(at)]] == list(motion.joints)
    words = ["torque, % of its limit", "speed, % of its limit"]
    assert [axes.get_ylabel() for axes in panels] == words
    assert panels[-1].get_xlabel() == "time from the impact [s]"


def test_margins_that_are_lengths_are_drawn_in_millimetres(swinging):
    class Held:
        def __getattr__(self, name):
            return getattr(swinging, name)

        def margins(self, t):
            return {"speed": 0.4, "centre of pressure [m]": 0.05 + 0.1 * t}

    panels = motion_figure(Held()).axes
    line = panels[2].lines[0]
    assert (line.get_label(), len(panels)) == ("centre of pressure", 3)
    assert line.get_ydata() == pytest.approx(50.0 + 100.0 * line.get_xdata())
    assert panels[2].get_ylabel() == "margin [mm]"


@pytest.fixture
def constrained(walking):
    """Return a function of q, v and torques: the acceleration while the foot is at rest."""
    model = walking.robot.model
    data, sole = model.createData(), model.frames[model.getFrameId("left_ankle_roll_link")]
    feet, foot_data = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    feet.append(
        pin.RigidConstraintModel(
            pin.ContactType.CONTACT_6D, model, sole.parentJoint, sole.placement
        )
    )
    foot_data.append(feet[0].createData())
    pin.initConstraintDynamics(model, data, feet, foot_data)

    def accelerations(q, v, torque):
        settings = pin.ProximalSettings(1e-14, 0.0, 1)
        return pin.constraintDynamics(model, data, q, v, torque, feet, foot_data, settings)

    return accelerations


@pytest.mark.parametrize("t", [-0.31, -0.07, 0.26])
def test_the_momentum_closes_with_gravity_and_the_ground(walking, constrained, t):
    model, q, v = walking.robot.model, walking.q(t), walking.v(t)
    data = model.createData()
    a = constrained(q, v, walking.torque(t))
    rate = pin.computeCentroidalMomentumTimeVariation(model, data, q, v, a).vector
    weight = pin.computeTotalMass(model) * model.gravity.linear
    force, moment = np.split(walking.ground_wrench(t), 2)
    supplied = np.concatenate([weight + force, moment - np.cross(data.com[0], force)])
    np.testing.assert_allclose(rate, supplied, atol=1e-9)


def test_torques_and_the_wrench_of_the_ground_are_those_of_rnea(walking, constrained):
    model, frame = walking.robot.model, walking.robot.model.getFrameId("left_ankle_roll_link")
    data = model.createData()
    for t in (-0.31, -0.07, 0.26):
        q, v, torque = walking.q(t), walking.v(t), walking.torque(t)
        a = constrained(q, v, torque)
        wrench = walking.placement.actInv(pin.Force(walking.ground_wrench(t))).vector
        rows = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
        np.testing.assert_allclose(
            pin.rnea(model, data, q, v, a), torque + rows.T @ wrench, rtol=0, atol=1e-10
        )


def test_constrained_dynamics_with_the_torques_follow_the_backswing(walking, constrained):
    """Of the robot with its floating base; the torques are smooth between knots."""
    nq = walking.robot.model.nq

    def slope(t, x):
        q, v = x[:nq].copy(), x[nq:]
        q[3:7] /= np.linalg.norm(q[3:7])
        turn = pin.Quaternion(q[3:7])
        turning = turn * pin.Quaternion(np.append(v[3:6], 0.0))  # a body's turning, in its axes
        moved = np.concatenate([turn.matrix() @ v[:3], 0.5 * turning.coeffs(), v[6:]])
        return np.concatenate([moved, constrained(q, v, walking.torque(t))])

    state = np.concatenate([walking.q(walking.begin), walking.v(walking.begin)])
    for first, last in pairwise(np.unique(walking.before.t)):
        inside = (first, last - 1e-12)
        state = solve_ivp(slope, inside, state, "DOP853", rtol=1e-10, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(state[:nq], walking.q(0.0), atol=1e-6)
    np.testing.assert_allclose(state[nq:], walking.v(0.0), atol=1e-5)
