"""The terms and objectives of a kick: slopes against differences, values against strikes."""

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form, differenced

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning import kick_terms as module
from kickdyn.planning.kick_limits import (
    RESERVE,
    BodyClearance,
    KickMuscleTorqueLimit,
    KickSpeedLimit,
    KickTorqueLimit,
    SupportImpulse,
)
from kickdyn.planning.kick_problem import kick_problem
from kickdyn.planning.kick_terms import OBJECTIVES, BallPosition, KickVariables, LargestShare
from kickdyn.planning.problem import Function
from kickdyn.robot.collisions import TOUCHING, bodies_at, find_ball_overlaps

BALL = kd.Ball()
LEGS = {"human": kd.Leg.human(), "g1": kd.Leg.from_robot("g1", legs_only=True)}
LEGS["standing"] = kd.Leg.from_robot("g1", base="floating", legs_only=True).with_supports(
    kd.Support("left_ankle_roll_link", friction=0.6)
)
TABLE = ((2.0, 0.9), (20.0, 0.4))


def target_of(friction=0.4, restitution=0.8, offset=None):
    spin = np.array([0.0, -10.0 if friction else 0.0, 0.0])
    contact = kd.Contact(None, restitution, friction, offset)
    return impact_target_for(np.array([6.0, 0.0, 3.0]), spin, BALL, contact)


def drawn(variables, share=0.8, low=0.1, high=0.5, seed=0):
    """Return unknowns of a drawn posture and velocity."""
    draw = np.random.default_rng(seed)
    return np.append(draw.uniform(low, high, 2 * variables.n), share)


def compare_slopes(term, variables, x, tolerance):
    """Compare the slope of a term with central differences of its value."""
    step = 1e-6
    differences = [
        (term.value(variables.point(x + way)) - term.value(variables.point(x - way))) / (2 * step)
        for way in step * np.eye(len(x))
    ]
    agrees(term.slope(variables.point(x)), np.transpose(differences), tolerance)


@pytest.mark.parametrize(("name", "friction", "restitution", "offset"), [
    ("human", 0.4, 0.8, None), ("human", 0.0, TABLE, (0.02, 0, 0.01)), ("g1", 0.4, TABLE, None),
    ("g1", 0.0, 0.8, (0.02, 0, 0.01)), ("standing", 0.4, 0.8, (0.02, 0, 0.01))])  # fmt: skip
def test_slopes_are_those_of_the_values(name, friction, restitution, offset):
    target = target_of(friction, restitution, offset)
    problem = kick_problem(LEGS[name], target, BALL.radius if name == "standing" else -0.6)
    variables, x = problem.variables, drawn(problem.variables)
    for term in (term for term in problem.terms if isinstance(term, Function)):
        order = 1 if isinstance(term, SupportImpulse) else 2  # its slope is of differences, too
        compare_slopes(term, variables, x, 10 * differenced(order))
    for objective in () if name == "standing" else OBJECTIVES.values():
        compare_slopes(objective, variables, x, 10 * differenced(1))
    compare_slopes(LargestShare(), variables, x, differenced())


@pytest.mark.parametrize("away", [(0.02, 0.0), (0.0, -0.02), (0.015, 0.02)])
@pytest.mark.parametrize("end", [None, 2], ids=["free", "ankle at its end"])
def test_a_ball_nearby_is_placed_exactly_and_a_joint_at_its_end_stays_there(end, away):
    variables = KickVariables(LEGS["human"], target_of())
    x, rows = drawn(variables), np.eye(3)[[0, 2]]
    x[1] = 1.2
    if end is not None:
        x[end] = variables.upper[end]
    start = variables.point(x)
    place = start.ball_centre + rows.T @ away
    found = module.place_exactly(BallPosition(variables, place, rows), start)
    agrees(found.ball_centre, place, closed_form())
    assert end is None or found.x[end] == variables.upper[end]
    agrees(found.x[variables.n :], x[variables.n :], 0)


def test_the_torque_keeps_the_speed_of_the_joints():
    """Coriolis forces and gravity, over the limit: 1 less the square of its use."""
    for name, leg in (("human", LEGS["human"]), ("g1", LEGS["g1"])):
        variables = KickVariables(leg, target_of())
        point, term = variables.point(drawn(variables)), KickTorqueLimit(variables)
        model, data = leg.model, leg.model.createData()
        torque = pin.nonLinearEffects(model, data, point.posture.q, point.v)[variables.vs]
        limit = leg.effort_limit[variables.vs]
        agrees(term.use(point), np.abs(torque) / limit, closed_form(10))
        agrees(term.value(point), 1 - (torque / limit) ** 2, closed_form(10))
        agrees(variables.upper, np.minimum(leg.upper[variables.vs], np.pi), 0)
        speed = KickSpeedLimit(variables)
        use = np.abs(point.v[variables.vs]) / leg.velocity_limit[variables.vs]
        agrees(speed.use(point), use, closed_form(10))
        over = np.append(np.zeros(variables.n), [*np.full(variables.n, 1.0), 1.0])
        named = speed.binding(variables.point(over))
        assert named == [f"speed of {joint}" for joint in variables.names], name


def test_each_objective_is_what_its_name_says():
    leg = LEGS["human"]
    variables = KickVariables(leg, target_of())
    point = variables.point(drawn(variables))
    posture, v, impulse = point.posture, point.v, variables.target.impulse
    values = {name: term.quantity(point) for name, term in OBJECTIVES.items()}
    data = leg.model.createData()
    energy = pin.computeKineticEnergy(leg.model, data, posture.q, v)
    assert values["kinetic-energy"] == pytest.approx(energy, rel=closed_form(10))
    assert values["joint-speed"] == pytest.approx(np.mean((v / leg.velocity_limit) ** 2))
    assert values["foot-speed"] == pytest.approx(np.linalg.norm(posture.jacobian @ v))
    contact = variables.target.contact
    closing = variables.target.foot_velocity(posture)
    hit = kd.strike(posture, posture.joint_velocity(closing), BALL, contact)
    agrees(hit.impulse, impulse, closed_form(1e4))
    worst = hit.worst_joint[1]
    assert worst <= values["joint-impulse"] <= 3 ** (1 / 12) * worst
    assert values["most-joint-impulse"] == values["joint-impulse"]
    signs = {name: term.value(point)[0] / values[name] for name, term in OBJECTIVES.items()}
    assert signs.pop("most-joint-impulse") == -1
    assert set(signs.values()) == {1}


def test_the_torques_of_muscles_fall_with_the_speed():
    """Hill 1938: (1 - u) / (1 + 4 u) of the limit at the share u of the speed limit."""

    def hill(speed):
        return (1 - np.maximum(speed, 0)) / (1 + 4 * np.maximum(speed, 0))

    leg = LEGS["human"]
    variables = KickVariables(leg, target_of())
    term, plain = KickMuscleTorqueLimit(variables), KickTorqueLimit(variables)
    for limits, kind in ((True, KickTorqueLimit), ("muscles", KickMuscleTorqueLimit)):
        assert type(kick_problem(leg, target_of(), limits=limits).find(KickTorqueLimit)) is kind
    for x in ([0.4, 0.7, -0.2, 0.3, -0.4, 0.2, 0.9], [0.1, 1.2, 0.3, -0.6, 0.5, -0.1, 1.0]):
        point = variables.point(np.array(x))
        share = plain.torque(point.posture, point.v) / leg.effort_limit
        speed = point.v / leg.velocity_limit
        up, down = term.value(point).reshape(2, 3)
        agrees(up, hill(speed) - share, closed_form(10))
        agrees(down, hill(-speed) + share, closed_form(10))
        most = np.where(share > 0, hill(speed), hill(-speed))
        agrees(term.use(point), np.abs(share) / most, closed_form(10))
        compare_slopes(term, variables, np.array(x), 10 * differenced())


def test_slopes_between_bodies_are_those_of_the_distances():
    """Of legs beside and inside each other, and of a foot and a thigh that move with one chain."""
    pairs = [("left_knee_link", "right_knee_link"), ("right_ankle_roll_link", "left_hip_yaw_link")]
    pairs.append(("right_hip_yaw_link", "right_ankle_roll_link"))
    robot, variables = LEGS["g1"], KickVariables(LEGS["g1"], target_of())
    bodies = [tuple(bodies_at(robot, frame)[0] for frame in pair) for pair in pairs]
    term = BodyClearance(robot, variables, bodies)
    x, values = np.zeros(variables.size), []
    for roll, bend in ((-0.2, 0.6), (0.2, 0.8), (0.45, 0.5)):
        x[1], x[3] = roll, bend
        values.append(term.value(variables.point(x))[0])
        compare_slopes(term, variables, x, 1e-6)  # coal's distances are iterated
    assert min(values) < 0 < max(values)


def test_the_distance_of_a_body_from_the_ball_is_that_of_its_overlap_with_a_larger_one():
    leg, target = LEGS["human"], target_of(offset=(0.03, 0, 0))
    variables, more = KickVariables(leg, target), 0.5
    term = BodyClearance(leg, variables, [(x, None) for x in bodies_at(leg, "shank")])
    for knee in (0.3, 1.2, 2.0):
        posture = variables.posture(np.array([0.4, knee, -0.2]))
        centre = posture.contact_point + BALL.radius * target.contact.normal
        depth = find_ball_overlaps(posture, centre, BALL.radius + more)["shank"] - more
        value = term.residual(posture, None).min()
        assert value == pytest.approx(TOUCHING - RESERVE - depth, abs=closed_form(1e4))
