"""Legs and kicks in MuJoCo: inertia and places of Pinocchio, and motions carried out."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from planned_motions import AIR, BALL, HUMAN, SOLE, SWING, by_hand, standing
from scipy.interpolate import BSpline
from scipy.optimize import fsolve
from tolerances import agrees, closed_form, optimized, sampled

import kickdyn as kd
from kickdyn.impact.approach import find_approach
from kickdyn.motion.motion import Motion
from kickdyn.planning.kick import turn_plan
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.robot.standing import StandingRobot
from kickdyn.simulators import repeated_runs as refinement
from kickdyn.simulators import run_in_mujoco as module
from kickdyn.simulators.mujoco_field import Disturbance, MujocoField, draw
from kickdyn.simulators.mujoco_kick import MujocoContact, MujocoKick, ball_spin, write_bodies
from kickdyn.simulators.repeated_runs import NoisyRuns

mujoco = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def plan():
    return by_hand()


@pytest.fixture(scope="module")
def run(plan):
    return kd.run_in_mujoco(plan)


def test_the_drives_follow_the_motion_to_the_impact_and_the_ball_flies(plan, run):
    motion, launch = plan.motion, plan.launch.velocity
    for number in np.flatnonzero(run.t < -0.01)[::20]:
        assert run.q[number] == pytest.approx(motion.q(run.t[number]), abs=0.01)
    assert run.q[-1, 0] == pytest.approx(motion.q(SWING)[0], abs=0.01)  # others are at their stops
    assert abs(run.speed_error) < 0.1
    assert run.direction_error < math.radians(12)  # ankle and knee give way under the ball
    assert abs(run.delay) < 0.008
    assert 0.005 < run.contact_time < 0.02
    assert (np.abs(run.torque) <= HUMAN.effort_limit * (1 + closed_form(1e4))).all()
    still = run.ball_position[run.t <= run.delay]
    assert np.ptp(still, axis=0).max() < closed_form(10)
    velocity = run.ball_after.velocity
    assert run.speed_error == pytest.approx(np.linalg.norm(velocity) / np.linalg.norm(launch) - 1)
    cosine = velocity @ launch / np.linalg.norm(velocity) / np.linalg.norm(launch)
    assert run.direction_error == pytest.approx(math.acos(cosine), rel=closed_form(1e7))
    end = run.path.landing.position - plan.impact.ball_before.position
    assert run.miss == pytest.approx(np.linalg.norm(end - plan.goal.target))
    free = run.t > run.ball_after.time  # MuJoCo's ball has gravity alone
    assert np.diff(run.ball_position[free, 2], 2) / 0.002**2 == pytest.approx(-9.81, rel=1e-3)
    track = run.track
    start = run.path.launch.position - plan.impact.ball_before.position
    agrees(track.positions[0], start, closed_form(10))
    assert track.times[0] == pytest.approx(0.5 * (run.ball_after.time - run.delay))
    use = np.abs(run.torque) / HUMAN.effort_limit
    assert run.margins["torque"] == pytest.approx(1 - use.max())


def test_a_ball_that_is_not_reached(plan, run, monkeypatch):
    monkeypatch.setattr(module, "LATEST_IMPACT", -0.1)
    missed = kd.run_in_mujoco(plan, tuning=run.tuning)
    assert (missed.path, missed.miss, missed.speed_error) == (None, math.inf, -1.0)
    assert math.isnan(missed.direction_error)
    assert any("does not reach" in line for line in missed.warnings)
    with pytest.raises(kd.InvalidInput, match="misses the ball"):
        _ = missed.track


def test_each_kind_of_noise_reaches_the_simulation(plan, run):
    silent = kd.KickNoise(mass=0, friction=0, delay=0, place=0)
    exact = kd.run_in_mujoco(plan, tuning=run.tuning, seed=1, noise=silent)
    agrees(exact.ball_after.velocity, run.ball_after.velocity, closed_form(10))
    for name, amount in (("mass", 0.1), ("friction", 0.3), ("delay", 0.02), ("place", 0.01)):
        noise = replace(silent, **{name: amount})
        noisy = kd.run_in_mujoco(plan, tuning=run.tuning, seed=1, noise=noise)
        drawn = draw(noise, 1, 3)
        change = np.linalg.norm(noisy.ball_after.velocity - run.ball_after.velocity)
        assert change > 1e-4, name
        if name == "delay":  # in steps of 2 ms
            assert noisy.delay - run.delay == pytest.approx(drawn.delay, abs=0.0041)
        place = noisy.ball_position[0] - run.ball_position[0]
        agrees(place, [*drawn.place, 0.0], closed_form(1e4))
    factors = np.linspace(0.8, 1.3, 3)
    fields = [
        MujocoField(plan.motion, plan.impact, None, run.tuning, Disturbance(x, 1, 1, 0, [0, 0]))
        for x in (np.ones(3), factors)
    ]
    for factor, name in zip(factors, HUMAN.joint_names, strict=True):
        body = int(fields[0].model.joint(name).bodyid[0])
        for values in ("body_mass", "body_inertia"):
            plain, noisy = (getattr(field.model, values)[body] for field in fields)
            assert noisy == pytest.approx(factor * plain)


@pytest.mark.parametrize("gravity", [9.81, 0.0])
def test_the_field_has_the_dynamics_of_the_robot(plan, run, gravity):
    """Inertia, and gravity and Coriolis forces, of a leg whose drives have rotors."""
    model = HUMAN.with_armature({"hip": 0.2, "knee": 0.1, "ankle": 0.05}).model
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    leg = kd.Leg.from_model(model, "toe")
    motion, still = replace(plan.motion, robot=leg), Disturbance(np.ones(3), 1, 1, 0, [0, 0])
    field = MujocoField(motion, plan.impact, None, run.tuning, still)
    field.place()
    q, v = np.array([0.4, 0.7, -0.2]), np.array([3.0, -5.0, 2.0])
    field.data.qpos[field.addresses], field.data.qvel[field.rates] = q, v
    field.mujoco.mj_forward(field.model, field.data)
    bias, momentum = pin.nonLinearEffects(model, model.createData(), q, v), np.zeros(9)
    agrees(field.data.qfrc_bias[field.rates], bias, closed_form(1e4))
    field.data.qvel[-6:] = 0.0
    field.mujoco.mj_mulM(field.model, field.data, momentum, field.data.qvel)
    inertia, comes = leg.posture(q).inertia, kd.BallState((1, 2, 3), (4, 5, 6))
    agrees(momentum[field.rates], inertia @ v, closed_form(1e4))
    field.set_gains(leg, q)
    damping = 0.6 * np.sqrt(8.0 * HUMAN.effort_limit * inertia.diagonal())
    agrees(field.damping, damping, closed_form(10))
    field.impact = SimpleNamespace(ball_before=comes)
    agrees(field.set_ball(-0.05), [0.8, 1.75, 2.7], closed_form())


def test_a_kick_is_corrected_by_the_observer_that_is_named(plan, run, monkeypatch):
    """The ball of `collide`, or of MuJoCo, in the middle of its contact."""
    monkeypatch.setattr(refinement, "run_in_mujoco", lambda plan, foot: run)
    impact = plan.impact
    hit = kd.collide(impact.posture, impact.v_before, impact.ball, impact.contact)
    for by, ball, time in (("collide", hit.ball_after, hit.contact_time),
                           ("mujoco", run.ball_after, run.contact_time)):  # fmt: skip
        seen = refinement._observe(plan, refinement.Observer(by), "shapes")
        agrees(seen.velocity, ball.velocity, closed_form(10))
        assert seen.time == pytest.approx(0.5 * time)
        wished = refinement._wished_velocity(plan, seen)
        start, left = kd.BallState(seen.position, wished, seen.spin), 0.9 - float(seen.time)
        end = kd.fly(start, BALL, AIR, kd.Ground(-20.0), 1e-12, time_limit=left).landing
        agrees(end.position, plan.target_position, optimized(1e-9))


def test_a_standing_robot_is_turned_so_that_its_ball_flies_towards_the_target(monkeypatch):
    """Which is seen from where the turned ball leaves; the rest is an error along the launch."""
    place, after, ball = np.array([[0.2, 0.1, 0.11], [4.0, 0.5, 2.0], [3.6, 1.2, 1.7]])
    balls = {"ball_before": kd.BallState(place), "ball_after": kd.BallState(velocity=after)}
    robot = kd.Leg.from_robot("bolt", base="floating")
    plan = SimpleNamespace(leg=robot, impact=SimpleNamespace(**balls))
    seen = kd.BallState(place + np.array([0.5, 0.2, 0.1]), ball, (1.0, -9.0, 2.0), 0.005)
    monkeypatch.setattr(refinement, "_observe", lambda *_: seen)
    monkeypatch.setattr(refinement, "_wished_velocity", lambda _, ball: 5.0 * after - ball.position)
    _, error, turn = refinement._try(plan, refinement.Observer.COLLIDE, "shapes")

    def azimuth(velocity):
        return math.atan2(velocity[1], velocity[0])

    first = azimuth(5.0 * after - seen.position) - azimuth(ball)
    wished = 5.0 * after - place - pin.rpy.rpyToMatrix(0, 0, first) @ (seen.position - place)
    assert turn == pytest.approx(azimuth(wished) - azimuth(ball))
    level = (np.hypot(*wished[:2]) - np.hypot(*ball[:2])) * after[:2] / np.hypot(*after[:2])
    agrees(error, [*level, wished[2] - ball[2]], closed_form(10))


def test_the_floor_carries_a_robot_at_rest_under_its_centre_of_mass(run):
    """It leans so that this is above its left foot; the other foot is in the air."""
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    standing = StandingRobot(robot.with_supports(kd.Support(SOLE, friction=0.7)))
    robot, leg, middle = standing.robot, standing.leg, standing.sole.mean(axis=0)
    model, data = robot.model, robot.model.createData()

    def place(angles):
        values = dict(zip(("left_ankle_roll_joint", "left_ankle_pitch_joint"), angles, strict=True))
        q = leg.configuration(values)
        return q, pin.centerOfMass(model, data, standing.robot_state(q, 0.0 * q)[0])[:2]

    rest, _ = place(fsolve(lambda angles: place(angles)[1] - middle, [0.2, 0.0]))
    splines = [BSpline(knots, [rest] * 2, 1) for knots in ([-0.5, -0.5, 0, 0], [0, 0, 0.5, 0.5])]
    motion = Motion(robot, leg.joint_names, *splines, standing.placement)
    posture, still = robot.posture(motion.q(0.0)), Disturbance(np.ones(13), 0.9, 1, 0, [0, 0])
    contact = kd.Contact((3, 0, 1), 0.8, 0.4)
    hit = kd.strike(posture, posture.joint_velocity([3, 0, 1]), BALL, contact)
    field, loads = MujocoField(motion, hit, standing, run.tuning, still), []
    field.set_gains(leg, rest)
    field.place()
    for _ in range(200):
        field.data.ctrl[:] = field.reference(-0.3, feed_forward=True)
        field.set_ball(-0.3)
        field.mujoco.mj_step(field.model, field.data)
        loads.append(field.sole_load())
    weight = 9.81 * pin.computeTotalMass(model)
    agrees(np.mean(loads[-100:], axis=0) / weight, [1, 0, 0, *middle], 1e-4)  # it sways a little
    agrees(module._configuration(field, field.data.qpos), motion.q(0.0), 1e-3)
    agrees(field.model.pair_friction[1:-1, 0], 0.9 * 0.7, closed_form())
    spheres = [field.model.geom(f"foot {n}").id for n in range(24)]
    lowest = (field.data.geom_xpos[spheres, 2] - field.model.geom_size[spheres, 0]).min()
    depth = find_depths(robot, motion.q(0.0), 1.0)["right_ankle_roll_link"]
    assert lowest == pytest.approx(1.0 - depth, abs=1e-3)
    trunk, upright = field.data.body("root_joint"), motion.q(0.0)
    planned = pin.Quaternion(upright[3:7]).matrix()
    for tilt, height, stands in ((50, 0.9, False), (40, 0.9, True), (0.0, 0.5, False)):
        turn = pin.AngleAxis(math.radians(tilt), np.array([0.6, 0.8, 0])).matrix()
        trunk.xpos[2], trunk.xmat[:] = height * upright[2], (turn @ planned).ravel()
        assert field.is_upright(upright) is stands


def test_draws_have_their_standard_deviations():
    noise, count = kd.KickNoise(0.02, 0.1, 0.005, 0.004), 2000
    draws = [draw(noise, seed, 2) for seed in range(count)]
    for values, size in (
        ([one.masses[1] - 1 for one in draws], 0.02), ([one.place[0] for one in draws], 0.004),
        ([one.ground_friction - 1 for one in draws], 0.1),
        ([one.delay - 0.0025 for one in draws], 0.005 / math.sqrt(12)),
    ):  # fmt: skip
        assert np.mean(values) == pytest.approx(0, abs=sampled(count) * size)
        assert np.std(values) == pytest.approx(size, rel=sampled(count))
    columns = [[*one.masses, one.ground_friction, one.ball_friction, *one.place] for one in draws]
    independent = np.corrcoef(columns, rowvar=False) - np.eye(6)
    assert np.abs(independent).max() < sampled(count)


def test_runs_are_counted_and_their_launches_compared(plan, run):
    launch, turn = plan.launch.velocity, pin.rpy.rpyToMatrix(0, -0.02, 0)
    runs = [run, replace(run, upright=False), replace(run, path=None)]
    errors = [(1.1, 0.05), (0.9, -0.03), (1.0, 0.0)]
    for k, (speed, azimuth) in enumerate(errors):
        velocity = speed * pin.rpy.rpyToMatrix(0, 0, azimuth) @ turn @ launch
        runs[k] = replace(runs[k], ball_after=replace(run.ball_after, velocity=velocity))
    noisy = NoisyRuns(tuple(runs), kd.KickNoise())
    assert (noisy.upright, len(noisy.hits)) == (2, 2)
    agrees(noisy.launch_errors, [[0.1, 0.05, 0.02], [-0.1, -0.03, 0.02]], closed_form(1e4))
    assert noisy.means == pytest.approx([0, 0.01, 0.02])
    agrees(noisy.deviations, [math.sqrt(0.02), 0.08 / math.sqrt(2), 0], closed_form(1e4))
    assert noisy.misses.tolist() == [run.miss, run.miss, math.inf]


def test_noisy_runs_are_those_of_the_seeds_with_one_contact(plan, run):
    noise, lines = kd.KickNoise(mass=0.1), []
    noisy = kd.run_with_noise(plan, 2, noise=noise, tuning=run.tuning, progress=lines.append)
    assert len(lines) == len(noisy.runs) == 2
    alone = kd.run_in_mujoco(plan, tuning=run.tuning, seed=1, noise=noise)
    assert noisy.runs[1].ball_after.velocity.tolist() == alone.ball_after.velocity.tolist()
    assert noisy.runs[0].speed_error != noisy.runs[1].speed_error
    assert {one.tuning for one in noisy.runs} == {run.tuning}


def test_corrections_learn_how_the_ball_answers(plan, monkeypatch):
    """Of a ball that answers a correction twice as much, and aside; without planning any motion."""
    wished, offset = np.array([17.0, 0.0, 5.0]), np.array([0.4, 0.0, -0.6])
    answer = np.array([[1.9, 0.0, -1.2], [0.0, 1.0, 0.0], [0.4, 0.0, 0.8]])
    first, errors = plan.impact.ball_after.velocity, []

    def replan(plan, velocity):
        after = replace(plan.impact.ball_after, velocity=velocity)
        return replace(plan, impact=replace(plan.impact, _ball_after=after))

    def observed(plan, by, foot):
        change = plan.impact.ball_after.velocity - first
        return replace(plan.impact.ball_after, velocity=wished + offset + answer @ change)

    monkeypatch.setattr(refinement, "replan_motion", replan)
    monkeypatch.setattr(refinement, "_observe", observed)
    monkeypatch.setattr(refinement, "_wished_velocity", lambda plan, ball: wished)
    with pytest.raises(kd.InvalidInput, match=r"has no motion: .*motion=True"):
        kd.refine_kick(replace(plan, motion=None))
    for rounds in (1, 2, 6):
        corrected = kd.refine_kick(plan, rounds=rounds).impact.ball_after.velocity
        errors.append(np.linalg.norm(offset + answer @ (corrected - first)))
    assert errors == sorted(errors, reverse=True)
    assert errors[2] < 0.02 * np.linalg.norm(offset)


@pytest.mark.slow
def test_a_robot_kicks_from_one_foot_and_may_be_turned():
    plan = standing()
    run = kd.run_in_mujoco(plan)
    assert run.upright
    assert 0.0 < run.speed_error < 0.4  # drives push on during a contact of 14 ms
    assert 0.0 < run.margins["friction"] < 1.0
    assert 0.0 <= run.margins["centre of pressure"] < 0.04
    turned, rotation = turn_plan(plan, 0.05), pin.rpy.rpyToMatrix(0, 0, 0.05)
    right = rotation @ plan.impact.ball_after.velocity
    agrees(turned.impact.ball_after.velocity, right, closed_form(1e4))
    agrees(turned.impact.ball_before.position, plan.impact.ball_before.position, closed_form(10))
    assert turned.heading == pytest.approx(plan.heading + 0.05)
    again = kd.run_in_mujoco(turned, tuning=run.tuning)
    agrees(again.ball_after.velocity, rotation @ run.ball_after.velocity, closed_form(1e7))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["g1", "icub"])
def test_a_ball_aside_leaves_the_foot_as_its_shapes_say(name):
    """In 10 ms, a ball that is turned aside moves farther from its place, and is turned more."""
    icub, goal = kd.Leg.from_robot("icub", legs_only=True), kd.Goal(3, time=0.6)
    plan = standing() if name == "g1" else kd.plan_kick(icub, goal, BALL, AIR, motion=True)
    runs, aside = [kd.run_in_mujoco(plan)], 0.01 * np.array([-1.0, 1.0]) * plan.aim.ahead[1::-1]
    for place in (aside, -aside):
        runs.append(kd.run_in_mujoco(plan, tuning=runs[0].tuning, ball_displacement=place))
    planned, *others = (run.ball_after.velocity / run.ball_after.speed for run in runs)
    sine = max(np.linalg.norm(np.cross(planned, other)) for other in others)
    more = runs[0].ball_after.speed * sine * runs[0].contact_time / 2 / 0.01
    seen = plan.sensitivity_to_ball.across.direction_deg
    assert seen == pytest.approx(math.degrees(math.asin(sine)), rel=more)
    assert more < 0.4


def test_margins_of_the_sole_are_the_least_of_averaged_loads(monkeypatch):
    """A square sole of 0.2 m; the load moves to an edge and then pulls across the ground."""
    edges = np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]]), np.full(4, 0.1)
    monkeypatch.setattr(module, "sole_edges", lambda standing: edges)
    weight = 9.81 * sum(body.mass for body in HUMAN.model.inertias)
    motion = SimpleNamespace(robot=HUMAN)
    field = SimpleNamespace(standing="stands", timestep=0.01, friction=0.5, motion=motion)
    rows = [(1, 0, 0, 0, 0), (1, 0.1, 0, 0.05, 0), (1, 0.3, 0, 0, 0.02), (0.01, 9, 9, 9, 9)]
    loads = [weight * np.array(row) for row in np.repeat(rows, 5, axis=0)]
    steady = module._ground_margins(field, SimpleNamespace(ground=loads[:15]))
    assert steady["friction"] == pytest.approx(1 - 0.3 / 0.5)
    assert steady["centre of pressure"] == pytest.approx(0.1 - 0.05)
    margins = module._ground_margins(field, SimpleNamespace(ground=loads))
    mixed = (0.3 + 9) / (0.5 * 1.01)  # of the mean over the last two rows that carry weight
    assert margins["friction"] == pytest.approx(1 - math.hypot(mixed, 9 / (0.5 * 1.01)))
    assert margins["centre of pressure"] == pytest.approx(0.1 - 9.02 / 1.01)


KINDS = {
    "free": pin.JointModelFreeFlyer, "ball": pin.JointModelSpherical,
    "slide": lambda: pin.JointModelPrismaticUnaligned(np.array([0.6, 0.0, 0.8])),
    "hinge": lambda: pin.JointModelRevoluteUnaligned(np.array([0.0, 0.6, 0.8])),
    "continuous": pin.JointModelRUBX}  # fmt: skip


def tree(*kinds):
    """Return a leg of joints of these kinds, with an arm beside it that is added first."""
    model, draw, parent = pin.Model(), np.random.default_rng(5), 0
    for number, kind in enumerate(kinds):
        place = pin.SE3.Identity() if kind == "free" else pin.SE3.Random()
        place.translation = 0.3 * draw.normal(size=3) if kind != "free" else np.zeros(3)
        parent = model.addJoint(parent, KINDS[kind](), place, f"{kind}{number}")
        inertia = np.diag([0.05, 0.06, 0.07])
        body = pin.Inertia(1.0 + number, 0.1 * draw.normal(size=3), inertia)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        if number == 0:
            arm = model.addJoint(parent, KINDS["hinge"](), pin.SE3.Identity(), "arm")
            model.appendBodyToJoint(arm, pin.Inertia.FromSphere(0.5, 0.1), pin.SE3.Identity())
    toe = pin.SE3(np.eye(3), np.array([0.1, 0.2, -0.3]))
    model.addFrame(pin.Frame("toe", parent, toe, pin.FrameType.OP_FRAME))
    model.armature[-1] = 0.02
    return kd.Leg.from_model(model, "toe")


@pytest.fixture(params=[("free", "ball", "hinge"), ("slide", "continuous", "hinge")], ids=str)
def kick(request):
    pin.seed(3)
    leg = tree(*request.param)
    q = pin.integrate(leg.model, pin.neutral(leg.model), np.linspace(-0.5, 0.7, leg.nv))
    posture, v = leg.posture(q), np.linspace(1.0, -2.0, leg.nv)
    contact = kd.Contact(posture.jacobian @ v, restitution=0.7)
    return find_approach(posture, v, kd.Ball(), contact, (0.1, 0.2, 0.3), (1.0, -2.0, 3.0))


def test_mujoco_has_the_same_leg_and_ball(kick):
    run = MujocoKick(kick, 1e-4, MujocoContact())
    model, data, posture, ball = run.model, run.data, kick.posture, kick.ball
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    momentum, before = np.zeros(model.nv), kick.ball_before
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    energy = 0.5 * kick.v @ posture.inertia @ kick.v
    energy += 0.5 * ball.mass * before.velocity @ before.velocity
    energy += 0.5 * ball.inertia * before.spin @ before.spin
    assert 0.5 * data.qvel @ momentum == pytest.approx(energy, rel=closed_form(1e4))
    foot, normal, place = data.geom("foot"), kick.contact.normal, posture.contact_point
    axis = foot.xmat.reshape(3, 3)[:, 2]
    agrees(axis, normal, closed_form(1e4))
    agrees(foot.xpos + 0.1 * axis, place, closed_form(1e4))
    agrees(data.geom("ball").xpos, place + ball.radius * normal, closed_form(1e4))
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, foot.id, velocity, 0)
    at_toe = velocity[3:] + np.cross(velocity[:3], place - foot.xpos)
    agrees(at_toe, kick.foot_velocity, closed_form(1e4))
    data.qpos[-4:] = 0.8, 0.0, 0.36, 0.48  # the ball's spin is in the world's axes
    mujoco.mj_forward(model, data)
    ball_id = model.body("ball").id
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, ball_id, velocity, 0)
    agrees(ball_spin(data), velocity[:3], closed_form(10))


def test_joints_stop_at_the_ends_of_their_ranges_but_for_continuous_ones():
    model = tree("slide", "continuous", "hinge").model
    model.lowerPositionLimit, model.upperPositionLimit = np.outer([-1, 1], np.arange(1, 6))
    bodies = write_bodies(model, {}, limits=True)
    text = f'<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody></mujoco>'
    stops = mujoco.MjModel.from_xml_string(text).jnt_range.tolist()
    assert stops == [[-1, 1], [-2, 2], [0, 0], [-5, 5]]


def test_a_simulation_that_diverges_or_does_not_end_is_an_error(kick, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    hard = MujocoContact((-1e15, -1.0), (0.9999, 0.9999, 1.0, 0.5, 1.0))
    with pytest.raises(kd.KickdynError):
        MujocoKick(kick, 0.02, hard).run()
    with pytest.raises(kd.KickdynError, match=r"separate within 0\.001 s"):
        MujocoKick(kick, 5e-4, MujocoContact()).run(longest=0.001)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
