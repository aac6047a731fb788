"""Stops of one joint without gravity: the double integrator, whose best stops are in books.

The equations of motion in symbols are compared with Pinocchio's.
"""

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.planning.stop_problem import Stop, StopSolver, point_function, torque_function
from kickdyn.planning.swing_phase import swing_chain

EFFORT, INERTIA, SPEED = 3.0, 0.2, 50.0
MOST = EFFORT / INERTIA


def pendulum(low=-2.0, high=2.0, mass=1.0):
    """Return a joint about the vertical, which gravity does not turn."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    body = pin.Inertia(mass, np.zeros(3), INERTIA * np.eye(3))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    toe = pin.SE3(np.eye(3), np.array([0.5, 0, 0]))
    model.addFrame(pin.Frame("toe", joint, 0, toe, pin.FrameType.OP_FRAME))
    model.velocityLimit, model.effortLimit = np.array([SPEED]), np.array([EFFORT])
    model.lowerPositionLimit, model.upperPositionLimit = np.array([low]), np.array([high])
    return kd.Leg.from_model(model, "toe")


def stop(leg, q, w, objective, nodes=24, rest=None, longest=5.0):
    solver = StopSolver(swing_chain(leg), nodes, objective)
    rest = None if rest is None else np.array([rest])
    return solver.solve(Stop(1, np.array([q]), np.array([w]), rest, longest))


def test_the_quickest_stop_is_at_full_torque():
    found = stop(pendulum(), 0.0, 5.0, "time")
    phase = found.phase
    assert found.share == 1.0
    assert phase.duration == pytest.approx(5.0 / MOST, rel=1e-6)
    motion = phase.sample(phase.nodes)
    assert motion.a == pytest.approx(-MOST, rel=1e-5)
    assert motion.q[-1] == pytest.approx(5.0**2 / (2 * MOST), rel=1e-6)


@pytest.mark.parametrize(("nodes", "within"), [(12, 0.01), (48, 6e-4)])
def test_from_rest_to_rest_and_past_it_it_is_bang_bang(nodes, within):
    """To stop at 1 rad before its own braking distance is over takes one switch of sign.

    Torques are continuous here, so that the switch takes an interval or two: the time is longer
    than bang-bang's by less than `within`, which falls with the nodes.
    """
    w, rest = 5.0, 0.3
    brake = w * w / (2 * MOST)  # rests at 0.833, and must come back by 0.533 rad
    exact = w / MOST + 2 * np.sqrt((brake - rest) / MOST)
    phase = stop(pendulum(), 0.0, w, "time", nodes, rest).phase
    assert exact < phase.duration < exact * (1 + within)
    assert np.abs(phase.sample(phase.nodes).a).max() <= MOST * (1 + 1e-6)


def test_the_least_torque_over_a_given_distance_is_linear_in_time():
    """Least integral of a^2 with both ends given: a is linear, as in any book on splines."""
    w, rest, time = 4.0, 1.5, 1.0
    found = stop(pendulum(), 0.0, w, "torque-squared", rest=rest, longest=time)
    phase = found.phase
    s = np.linspace(0.0, time, 25)
    first, last = 6 * rest - 4 * w, 2 * w - 6 * rest  # of the cubic through both ends
    assert phase.duration == pytest.approx(time, rel=1e-6)
    assert phase.sample(phase.nodes).a[:, 0] == pytest.approx(first + (last - first) * s, abs=2e-3)
    exact = (first**2 + first * last + last**2) / 3 / MOST**2
    assert phase.torque_squared == pytest.approx(exact, rel=1e-4)


def test_the_most_that_can_be_braked_in_the_room_there_is():
    found = stop(pendulum(high=0.4), 0.0, 10.0, "time")
    assert found.share == pytest.approx(np.sqrt(2 * MOST * 0.4) / 10.0, rel=1e-5)
    assert found.binding in (("range", 0), ("torque", 0))


def test_the_speed_limit_binds_where_it_does():
    found = stop(pendulum(), 0.0, 2 * SPEED, "time")
    assert found.share <= 0.5
    wide = stop(pendulum(-3, 3), -3.0, 1.02 * SPEED, "time")
    assert wide.binding != ("speed", 0)  # 3 + pi rad stop 13 rad/s


def test_positions_keep_their_range_between_nodes_too():
    """With few intervals, limits at nodes alone would let the cubic pass outside."""
    leg = pendulum(low=-0.05, high=0.5)
    phase = stop(leg, 0.0, 3.0, "torque-squared", nodes=4, rest=0.0).phase
    q = phase.sample(np.linspace(0.0, phase.duration, 800)).q
    assert q.max() <= 0.5
    assert q.min() >= -0.05


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


def legs():
    pin.seed(0)
    yield pytest.param(kd.Leg.human(), id="human")
    yield pytest.param(slider(), id="slider")
    for name in ("g1", "talos"):
        yield pytest.param(kd.Leg.from_robot(name), id=name)


@pytest.mark.parametrize("leg", list(legs()))
def test_the_symbols_are_pinocchio_to_rounding(leg):
    joints = swing_chain(leg)
    draw = np.random.default_rng(1)
    joints.model.armature = draw.uniform(0.0, 0.1, joints.model.nv)
    model, data = joints.model, joints.model.createData()
    in_symbols, point = torque_function(model), point_function(model)
    for _ in range(5):
        q, v, a = draw.normal(size=(3, model.nv))
        torque = pin.rnea(model, data, q, v, a)
        assert np.asarray(in_symbols(q, v, a)).ravel() == pytest.approx(torque, rel=1e-9, abs=1e-10)
        posture = leg.posture(whole(leg, joints, q))
        where = np.asarray(point(q, posture.contact_lever)).ravel()
        assert where == pytest.approx(posture.contact_point, abs=1e-12)


def whole(leg, joints, q):
    full = leg.configuration()
    full[joints.qs] = q
    return full
