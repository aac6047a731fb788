"""The terms and objectives of a kick: slopes against differences, values against strikes."""

import math

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, differenced

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning.kick_problem import kick_problem
from kickdyn.planning.kick_terms import (
    BallPosition,
    Facing,
    JointRange,
    KickVariables,
    SpeedLimit,
    StrikeVelocity,
    TorqueLimit,
    check_limits,
    place_exactly,
)
from kickdyn.planning.objectives import OBJECTIVES, LargestShare
from kickdyn.planning.problem import Function, Kind
from kickdyn.planning.stance import Balance, Clearance, SupportImpulse, Upright

BALL = kd.Ball()
LEGS = {"human": kd.Leg.human(), "g1": kd.Leg.from_robot("g1", legs_only=True)}
STANDING = kd.Leg.from_robot("g1", base="floating", legs_only=True).with_supports(
    kd.Support("left_ankle_roll_link", friction=0.6)
)
VELOCITY = np.array([6.0, 0.0, 3.0])
TABLE = ((2.0, 0.9), (20.0, 0.4))


def target_of(friction=0.4, restitution=0.8, offset=None, velocity=VELOCITY):
    spin = np.array([0.0, -10.0 if friction else 0.0, 0.0])
    contact = kd.Contact(None, restitution, friction, offset)
    return impact_target_for(np.asarray(velocity), spin, BALL, contact)


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


@pytest.mark.parametrize(
    ("name", "friction", "restitution", "offset"),
    [
        ("human", 0.4, 0.8, None),
        ("human", 0.0, TABLE, (0.02, 0, 0.01)),
        ("g1", 0.4, TABLE, None),
        ("g1", 0.0, 0.8, (0.02, 0, 0.01)),
    ],
)
def test_slopes_are_those_of_the_values(name, friction, restitution, offset):
    problem = kick_problem(LEGS[name], target_of(friction, restitution, offset), -0.6)
    variables, x = problem.variables, drawn(problem.variables)
    for term in (term for term in problem.terms if isinstance(term, Function)):
        compare_slopes(term, variables, x, 10 * differenced())
    for objective in OBJECTIVES.values():
        compare_slopes(objective(), variables, x, 10 * differenced(1))
    compare_slopes(LargestShare(), variables, x, differenced())


@pytest.fixture(scope="module")
def standing_problem():
    return kick_problem(STANDING, target_of(velocity=(3, 0.0, 1.5)), BALL.radius)


@pytest.mark.parametrize("offset", [None, (0.02, 0, 0.01)])
def test_slopes_of_a_stance_are_those_of_the_values(offset):
    problem = kick_problem(STANDING, target_of(offset=offset, velocity=(3, 0.0, 1.5)), BALL.radius)
    variables, x = problem.variables, drawn(problem.variables, low=-0.5)
    for kind in (Balance, Clearance, Upright):
        compare_slopes(problem.find(kind), variables, x, 10 * differenced())
    compare_slopes(problem.find(SupportImpulse), variables, x, 10 * differenced(1))


@pytest.mark.parametrize("share", [0.4, 1.0])
@pytest.mark.parametrize("restitution", [0.8, TABLE])
@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_a_foot_with_the_strike_velocity_gives_a_share_of_the_launch(friction, restitution, share):
    target = target_of(friction, restitution)
    problem = kick_problem(LEGS["g1"], target)
    term, start = problem.find(StrikeVelocity), problem.variables.point(drawn(problem.variables))
    assert np.abs(term.value(start)).max() > 0.1
    x = np.append(start.x[:-1], share)
    exact = term.make_exact(problem.variables.point(x))
    assert np.abs(term.value(exact)).max() < 1e-13
    assert exact.x[: problem.variables.n].tolist() == start.x[: problem.variables.n].tolist()
    hit = kd.strike(exact.posture, exact.v, BALL, target.contact)
    agrees(hit.ball_after.velocity, share * VELOCITY, 1e-11)
    spin = np.array([0.0, -10.0 if friction else 0.0, 0.0])
    assert hit.ball_after.spin == pytest.approx(share * spin, abs=1e-9)


def test_a_ball_is_placed_where_the_foot_touches_it():
    variables = KickVariables(LEGS["g1"], target_of())
    start, other = (variables.point(drawn(variables, high=high)) for high in (0.3, 0.35))
    place = other.posture.contact_point + BALL.radius * variables.target.contact.normal
    term = kick_problem(LEGS["g1"], variables.target, place).find(BallPosition)
    assert np.abs(term.residual(other.posture, other.v)).max() < 1e-12
    apart = start.posture.contact_point - other.posture.contact_point
    agrees(term.residual(start.posture, start.v), term.rows @ apart, 1e-12)
    assert np.linalg.norm(apart) > 0.01
    agrees(place_exactly(term, start).ball_centre, place, 1e-12)
    height = kick_problem(LEGS["human"], target_of(), -0.6)
    placed = place_exactly(height.find(BallPosition), height.variables.point(np.zeros(7)))
    assert placed.ball_centre[2] == pytest.approx(-0.6, abs=1e-12)


def test_the_front_of_the_toe_of_g1_faces_the_ball():
    """Within 15 degrees to either side of the foot's axis, and 0 to 60 degrees upwards."""
    foot = kd.Leg.from_robot("g1", "right_ankle_roll_link", legs_only=True)
    problem, draw, seen = kick_problem(LEGS["g1"], target_of()), np.random.default_rng(2), set()
    facing, variables = problem.find(Facing), problem.variables
    normal = variables.target.contact.normal
    data = foot.model.createData()
    number = foot.model.getFrameId("right_ankle_roll_link")
    for q in draw.uniform(-0.35, 0.35, (60, variables.n)):
        point = variables.point(np.append(q, np.zeros(variables.n + 1)))
        pin.framesForwardKinematics(foot.model, data, problem.on_robot(point)[0])
        x, y, z = data.oMf[number].rotation.T @ normal
        side, up = math.degrees(math.atan2(y, x)), math.degrees(math.asin(z))
        margin = min(15 - abs(side), up, 60 - up)
        if abs(margin) < 0.5:
            continue
        faces = bool((facing.residual(point.posture, point.v) >= 0).all())
        assert faces == (margin > 0), (side, up)
        seen.add(faces)
    assert seen == {True, False}


def test_the_torque_keeps_the_speed_of_the_joints():
    """Coriolis forces and gravity, over the limit: 1 less the square of its use."""
    for name, leg in LEGS.items():
        variables = KickVariables(leg, target_of())
        point, term = variables.point(drawn(variables)), TorqueLimit(variables)
        model, data = leg.model, leg.model.createData()
        torque = pin.nonLinearEffects(model, data, point.posture.q, point.v)[variables.vs]
        limit = leg.effort_limit[variables.vs]
        agrees(term.use(point), np.abs(torque) / limit, 1e-12)
        agrees(term.value(point), 1 - (torque / limit) ** 2, 1e-12)
        speed = SpeedLimit(variables)
        use = np.abs(point.v[variables.vs]) / leg.velocity_limit[variables.vs]
        agrees(speed.use(point), use, 1e-12)
        over = np.append(np.zeros(variables.n), [*np.full(variables.n, 1.0), 1.0])
        named = speed.binding(variables.point(over))
        assert named == [f"speed of {joint}" for joint in variables.names], name


def test_bounds_are_ranges_and_speed_limits():
    leg = LEGS["human"]
    variables = KickVariables(leg, target_of())
    ranges, speeds = JointRange(variables, 0.3), SpeedLimit(variables)
    assert ranges.lower[:3].tolist() == leg.lower.tolist()
    assert ranges.upper[:3].tolist() == leg.upper.tolist()
    assert (ranges.lower[-1], ranges.upper[-1]) == (0.3, 1.0)
    agrees(speeds.upper[3:6] * variables.velocity_scale, leg.velocity_limit, 2e-4)
    assert (speeds.lower == -speeds.upper).all()
    model = leg.model
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = -50, 50
    turns = KickVariables(kd.Leg.from_model(model, "toe"), target_of())
    assert turns.lower.tolist() == [-math.pi] * 3
    assert turns.upper.tolist() == [math.pi] * 3


@pytest.mark.parametrize(("what", "named"), [("velocityLimit", "speed"), ("effortLimit", "torque")])
def test_a_limit_of_0_is_refused_and_an_infinite_one_has_no_use(what, named):
    model = LEGS["human"].model
    for value in (0.0, np.inf):
        limits = getattr(model, what).copy()
        limits[1] = value
        setattr(model, what, limits)
        variables = KickVariables(kd.Leg.from_model(model, "toe"), target_of())
        if value == 0.0:
            with pytest.raises(kd.InvalidInput, match=f"{named} limit of knee is 0"):
                check_limits(variables)
        else:
            check_limits(variables)
            term = SpeedLimit(variables) if named == "speed" else TorqueLimit(variables)
            assert term.use(variables.point(drawn(variables)))[1] == 0.0


def test_each_objective_is_what_its_name_says():
    leg = LEGS["human"]
    variables = KickVariables(leg, target_of())
    point = variables.point(drawn(variables))
    posture, v, impulse = point.posture, point.v, variables.target.impulse
    values = {name: term().quantity(point) for name, term in OBJECTIVES.items()}
    data = leg.model.createData()
    energy = pin.computeKineticEnergy(leg.model, data, posture.q, v)
    assert values["kinetic-energy"] == pytest.approx(energy, rel=1e-12)
    assert values["joint-speed"] == pytest.approx(np.mean((v / leg.velocity_limit) ** 2))
    assert values["foot-speed"] == pytest.approx(np.linalg.norm(posture.jacobian @ v))
    contact = variables.target.contact
    closing = variables.target.foot_velocity(posture)
    hit = kd.strike(posture, posture.joint_velocity(closing), BALL, contact)
    agrees(hit.impulse, impulse, 1e-9)
    worst = hit.worst_joint[1]
    assert worst <= values["joint-impulse"] <= 3 ** (1 / 12) * worst
    assert values["most-joint-impulse"] == values["joint-impulse"]
    signs = {name: term().value(point)[0] / values[name] for name, term in OBJECTIVES.items()}
    assert signs.pop("most-joint-impulse") == -1
    assert set(signs.values()) == {1}


def test_terms_have_one_kind_each(standing_problem):
    kinds = {type(term): term.kind for term in standing_problem.terms}
    assert kinds[StrikeVelocity] == kinds[BallPosition] == Kind.EQUALITY
    assert kinds[TorqueLimit] == kinds[Balance] == kinds[SupportImpulse] == Kind.INEQUALITY
    assert kinds[SpeedLimit] == kinds[JointRange] == Kind.BOUND
    free = kick_problem(STANDING, target_of(velocity=(3, 0.0, 1.5)), limits=False)
    omitted = {BallPosition, SpeedLimit, TorqueLimit}
    assert {type(term) for term in free.terms} == set(kinds) - omitted
