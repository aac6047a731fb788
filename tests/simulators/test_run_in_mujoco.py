"""Planned motions in MuJoCo: a leg on a fixed base, and a robot on one foot."""

import json
import math
import sys
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
from click.testing import CliRunner
from planned_motions import AIR, BALL, standing, swinging

import kickdyn as kd
from kickdyn.cli.plan_command import plan as plan_command
from kickdyn.planning import kick as kick_module
from kickdyn.planning.kick import turn_plan
from kickdyn.simulators import refine_kick as refinement
from kickdyn.simulators import run_in_mujoco as module
from kickdyn.simulators.disturbance import Disturbance
from kickdyn.simulators.mujoco_field import MujocoField

pytest.importorskip("mujoco")
pytest.importorskip("casadi")


@cache
def carried_out(plan):
    return kd.run_in_mujoco(plan())


def check_before(run, tolerance):
    """Check that the drives follow the motion to the impact, by the torques of the plan."""
    motion = run.plan.motion
    robot = motion.robot
    numbers = np.flatnonzero(run.t < -0.01)[::20]
    for number in numbers:
        planned = robot.joint_values(motion.q(run.t[number]))
        simulated = robot.joint_values(run.q[number])
        for name in motion.joints:
            assert simulated[name] == pytest.approx(planned[name], abs=tolerance)


def test_a_leg_on_a_fixed_base_kicks_as_planned():
    run = carried_out(swinging)
    check_before(run, 0.003)
    assert abs(run.speed_error) < 0.05
    assert run.direction_error < math.radians(10)  # ankle and knee give way under the ball
    assert abs(run.delay) < 0.006
    assert run.upright
    assert (np.abs(run.torque) <= swinging().leg.effort_limit).all()
    assert str(run).startswith("MujocoRun\n  launch")


def test_the_ball_lies_still_until_it_is_hit_and_then_flies():
    run = carried_out(swinging)
    still = run.ball_position[run.t <= run.delay]
    assert np.ptp(still, axis=0) == pytest.approx(0, abs=1e-12)
    launch = swinging().launch.velocity
    ratio = run.ball_after.speed / np.linalg.norm(launch)
    assert run.speed_error == pytest.approx(ratio - 1)
    end = run.path.landing.position - still[0]
    assert run.miss == pytest.approx(np.linalg.norm(end - swinging().goal.target))
    assert end[0] == pytest.approx(20, abs=1e-6) or end[2] < 0.0  # the plane or the ground
    # between the contact and the end MuJoCo's ball has gravity alone
    free = run.t > run.ball_after.time
    fallen = np.diff(run.ball_position[free, 2], 2) / 0.002**2
    assert fallen == pytest.approx(-9.81, rel=1e-3)


def test_a_robot_kicks_from_one_foot_and_stays_upright():
    run = carried_out(standing)
    check_before(run, 0.02)
    assert run.upright
    assert 0.1 < run.speed_error < 0.4  # drives push on during a contact of 14 ms
    assert run.direction_error < math.radians(9)
    assert abs(run.delay) < 0.01
    assert set(run.margins) == {"torque", "speed", "friction", "centre of pressure"}
    assert 0.0 < run.margins["friction"] < 1.0
    assert 0.0 <= run.margins["centre of pressure"] < 0.04  # between corners, which carry it
    tipped = replace(run, margins={"centre of pressure": 0.0})
    assert "margin, centre of pressure  0 m: the sole tips about an edge or" in str(tipped)
    drives = standing().leg.effort_limit[6:]
    assert (np.abs(run.torque[:, 6:]) <= drives * (1 + 1e-9)).all()
    assert not run.torque[:, :6].any()


def test_a_robot_without_torques_of_the_motion_does_not_follow_it():
    run = kd.run_in_mujoco(swinging(), controller="pd")
    motion = swinging().motion
    number = np.searchsorted(run.t, -0.1)
    late = np.abs(run.q[number] - motion.q(run.t[number])).max()
    exact = carried_out(swinging).q[number] - motion.q(run.t[number])
    assert late > 5 * np.abs(exact).max()


def test_a_ball_that_is_not_reached(monkeypatch):
    monkeypatch.setattr(module, "LATEST_IMPACT", -0.3)
    run = kd.run_in_mujoco(swinging())
    assert run.path is None
    assert run.miss == math.inf
    assert math.isnan(run.direction_error)
    assert run.speed_error == -1.0
    assert "the foot does not reach the ball" in run.warnings
    assert json.dumps(run.to_json(), allow_nan=False)


def test_bad_input(monkeypatch):
    with pytest.raises(kd.InvalidInput, match="controller is 'mpc': it must be one of torque"):
        kd.run_in_mujoco(swinging(), controller="mpc")
    with pytest.raises(kd.InvalidInput, match=r"timestep is 1\.0: it must be"):
        kd.run_in_mujoco(swinging(), timestep=1)
    with pytest.raises(kd.InvalidInput, match="the plan has no motion: plan it with plan_kick"):
        kd.run_in_mujoco(replace(swinging(), motion=None))
    with pytest.raises(kd.InvalidInput, match="the plan has no motion"):
        kd.refine_kick(replace(swinging(), motion=None))
    with pytest.raises(kd.InvalidInput, match="by is 'eye': it must be one of collide, mujoco"):
        kd.refine_kick(swinging(), by="eye")
    with pytest.raises(kd.InvalidInput, match="rounds is 0"):
        kd.refine_kick(swinging(), rounds=0)
    with pytest.raises(kd.InvalidInput, match=r"rounds is 1\.5"):
        kd.refine_kick(swinging(), rounds=1.5)
    with pytest.raises(kd.InvalidInput, match="noise is given without a seed"):
        kd.run_in_mujoco(swinging(), noise=kd.KickNoise())
    with pytest.raises(kd.InvalidInput, match="runs is 0"):
        kd.run_with_noise(swinging(), 0)
    with pytest.raises(kd.InvalidInput, match="seed is -1"):
        kd.run_in_mujoco(swinging(), seed=-1)
    with pytest.raises(kd.InvalidInput, match=r"mass is 0\.5: it must be"):
        kd.KickNoise(mass=0.5)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(kd.InvalidInput, match=r'install it with pip install "kickdyn\[mjcf\]"$'):
        kd.run_in_mujoco(swinging())


def miss_by_collide(plan):
    """Return how far the ball of `collide` is from the target at its height [m]."""
    impact = plan.impact
    hit = kd.collide(impact.posture, impact.v_before, impact.ball, impact.contact)
    end = kd.fly(hit.ball_after, BALL, AIR, kd.Ground(impact.ball_before.position[2] - BALL.radius))
    return np.linalg.norm(end.landing.position - impact.ball_before.position - plan.goal.target)


def test_a_corrected_kick_meets_the_target_with_a_contact_that_takes_time():
    plan = swinging()
    corrected = kd.refine_kick(plan, rounds=1)
    assert miss_by_collide(corrected) < 0.1 * miss_by_collide(plan)
    assert corrected.launch is plan.launch


def test_a_kick_at_a_ball_of_given_height_is_corrected():
    leg, goal = kd.Leg.human(), kd.Goal(20, time=1.2)
    plan = kd.plan_kick(leg, goal, BALL, AIR, ball_position=-0.7042, motion=True)
    corrected = kd.refine_kick(plan, rounds=1)
    assert corrected.impact.ball_before.position[2] == pytest.approx(-0.7042, abs=1e-6)
    assert miss_by_collide(corrected) < 0.1 * miss_by_collide(plan)


def test_a_corrected_kick_meets_the_target_in_mujoco():
    """The ball of the correction differs from the wished one as far as the first one did not."""
    plan, run = swinging(), carried_out(swinging)
    corrected = kd.refine_kick(plan, rounds=1, by="mujoco")
    again = kd.run_in_mujoco(corrected)
    assert corrected.launch is plan.launch
    ball = run.ball_after
    goal = plan.goal.seen_from(ball.position - plan.impact.ball_before.position, 0.0)
    goal = kd.Goal(goal.target, time=goal.time - 0.5 * run.contact_time, spin=ball.spin)
    wished = kd.plan_launch(goal, BALL, AIR).velocity
    command = plan.impact.ball_after.velocity + wished - ball.velocity
    np.testing.assert_allclose(corrected.impact.ball_after.velocity, command, atol=1e-9)
    assert again.miss < 0.2 * run.miss
    assert again.direction_error < run.direction_error


def test_corrections_learn_how_the_ball_answers(monkeypatch):
    """Of a ball that answers a correction twice as much, and aside; without planning any motion."""
    plan, wished, seen = swinging(), np.array([17.0, 0.0, 5.0]), []
    off_at_first = np.array([0.4, 0.0, -0.6])
    answer = np.array([[1.9, 0.0, -1.2], [0.0, 1.0, 0.0], [0.4, 0.0, 0.8]])

    def replan(plan, velocity):
        after = replace(plan.impact.ball_after, velocity=velocity)
        return replace(plan, impact=replace(plan.impact, ball_after=after))

    def observed(plan, by):
        off = plan.impact.ball_after.velocity - swinging().impact.ball_after.velocity
        seen.append(wished + off_at_first + answer @ off)
        return replace(plan.impact.ball_after, velocity=seen[-1])

    monkeypatch.setattr(refinement, "replan_motion", replan)
    monkeypatch.setattr(refinement, "_observe", observed)
    monkeypatch.setattr(refinement, "_wished_velocity", lambda plan, ball: wished)
    errors = []
    for rounds in (1, 2, 6):
        corrected = kd.refine_kick(plan, rounds=rounds).impact.ball_after.velocity
        off = answer @ (corrected - plan.impact.ball_after.velocity)
        errors.append(np.linalg.norm(off_at_first + off))
    first = seen[0] - wished
    np.testing.assert_allclose(seen[1] - wished, first - answer @ first)  # with the slope 1
    assert errors[2] < 0.02 * np.linalg.norm(first)
    assert errors == sorted(errors, reverse=True)


def test_a_standing_robot_turned_about_the_ball_kicks_the_same_way():
    plan, run = standing(), carried_out(standing)
    angle = 0.05
    turned = turn_plan(plan, angle)
    rotation = pin.rpy.rpyToMatrix(0, 0, angle)
    assert turned.heading == pytest.approx(angle)
    ball = plan.impact.ball_before.position
    np.testing.assert_allclose(turned.impact.ball_before.position, ball, atol=1e-12)
    velocity = rotation @ plan.impact.ball_after.velocity
    np.testing.assert_allclose(turned.impact.ball_after.velocity, velocity, atol=1e-9)
    again = kd.run_in_mujoco(turned, tuning=run.tuning)
    np.testing.assert_allclose(
        again.ball_after.velocity, rotation @ run.ball_after.velocity, atol=1e-6
    )
    assert again.margins == pytest.approx(run.margins, abs=1e-6)
    for t in (-0.3, 0.2):
        foot = turned.motion.ground_wrench(t)
        np.testing.assert_allclose(foot[:3], rotation @ plan.motion.ground_wrench(t)[:3])


def test_a_correction_turns_a_standing_robot_by_the_error_of_the_azimuth(monkeypatch):
    """Without the planner: the same motion again, whose only error is then that of the azimuth."""
    plan, run = standing(), carried_out(standing)
    monkeypatch.setattr(refinement, "replan_motion", lambda plan, velocity: plan)
    monkeypatch.setattr(refinement, "run_in_mujoco", lambda plan: run)
    corrected = kd.refine_kick(plan, rounds=1, by="mujoco")
    again = kd.run_in_mujoco(corrected, tuning=run.tuning)
    assert abs(run.ball_after.velocity[1]) > 0.05
    aside = again.path.landing.position[1] - plan.impact.ball_before.position[1]
    assert aside == pytest.approx(0.0, abs=2e-3)


def test_seeded_noise_is_the_same_for_a_seed_and_scatters_the_ball():
    plan, run = swinging(), carried_out(swinging)
    first, same, other = (
        kd.run_in_mujoco(plan, tuning=run.tuning, seed=seed) for seed in (3, 3, 4)
    )
    assert (first.ball_after.velocity == same.ball_after.velocity).all()
    assert first.seed == 3
    scattered = [first.ball_after.velocity, other.ball_after.velocity, run.ball_after.velocity]
    assert np.ptp(scattered, axis=0)[[0, 2]].min() > 1e-3
    silent = kd.KickNoise(mass=0, friction=0, delay=0, place=0)
    exact = kd.run_in_mujoco(plan, tuning=run.tuning, seed=3, noise=silent)
    np.testing.assert_array_equal(exact.ball_after.velocity, run.ball_after.velocity)


def test_each_kind_of_noise_reaches_the_simulation():
    plan, run = swinging(), carried_out(swinging)
    still = {"mass": 0, "friction": 0, "delay": 0, "place": 0}
    for name, amount in (("mass", 0.1), ("friction", 0.3), ("delay", 0.02), ("place", 0.01)):
        noise = kd.KickNoise(**{**still, name: amount})
        noisy = kd.run_in_mujoco(plan, tuning=run.tuning, seed=1, noise=noise)
        assert np.linalg.norm(noisy.ball_after.velocity - run.ball_after.velocity) > 1e-4, name
        if name == "delay":  # by up to 20 ms, of which a step is 2 ms
            assert 0.002 <= noisy.delay - run.delay <= 0.022
        if name == "place":
            moved = noisy.ball_position[0] - run.ball_position[0]
            assert 0.001 < np.linalg.norm(moved) < 0.03
            assert moved[2] == 0.0


def test_mass_and_inertia_are_multiplied():
    plan, tuning = swinging(), carried_out(swinging).tuning
    count = plan.motion.robot.model.njoints - 1
    exact, noisy = (
        MujocoField(plan.motion, plan.impact, None, tuning, Disturbance(factors, 1, 1, 0, [0, 0]))
        for factors in (np.ones(count), np.linspace(0.8, 1.3, count))
    )
    for factor, name in zip(np.linspace(0.8, 1.3, count), exact.joints, strict=True):
        body = int(exact.model.joint(name).bodyid[0])
        assert noisy.model.body_mass[body] == pytest.approx(factor * exact.model.body_mass[body])
        turned = exact.model.body_inertia[body]
        assert noisy.model.body_inertia[body] == pytest.approx(factor * turned)


def test_runs_with_noise_are_those_of_the_seeds():
    plan, run, lines = swinging(), carried_out(swinging), []
    noisy = kd.run_with_noise(plan, 3, tuning=run.tuning, progress=lines.append)
    assert lines == ["run 1 of 3", "run 2 of 3", "run 3 of 3"]
    third = kd.run_in_mujoco(plan, tuning=run.tuning, seed=2)
    np.testing.assert_array_equal(noisy.runs[2].ball_after.velocity, third.ball_after.velocity)
    speeds = [one.speed_error for one in noisy.runs]
    assert noisy.means[0] == pytest.approx(np.mean(speeds))
    assert noisy.deviations[0] == pytest.approx(np.std(speeds, ddof=1))
    launch = plan.launch.velocity
    for one, (_, azimuth, elevation) in zip(noisy.runs, noisy.launch_errors, strict=True):
        turned = pin.rpy.rpyToMatrix(0, -elevation, 0) @ launch  # the launch is along x and z
        turned = pin.rpy.rpyToMatrix(0, 0, azimuth) @ turned * one.ball_after.speed
        direction = turned / np.linalg.norm(launch)
        np.testing.assert_allclose(one.ball_after.velocity, direction, atol=1e-9)
    assert noisy.misses.tolist() == [one.miss for one in noisy.runs]
    assert noisy.to_json()["upright"] == 3


def test_runs_that_fall_or_miss_are_counted():
    run = carried_out(swinging)
    runs = (run, replace(run, upright=False), replace(run, path=None))
    noisy = kd.NoisyRuns(runs, kd.KickNoise())
    assert (noisy.upright, len(noisy.hits)) == (2, 2)
    assert noisy.misses.tolist() == [run.miss, run.miss, math.inf]
    assert f"up to {run.miss:.3g} m" in str(noisy)
    assert "up to inf m" in str(noisy)
    missed = kd.NoisyRuns(runs[2:], kd.KickNoise())
    assert np.isnan([*missed.means, *missed.deviations]).all()
    assert json.dumps(missed.to_json(), allow_nan=False)


def test_the_track_of_a_run_is_its_flight_since_the_kick():
    run = carried_out(swinging)
    track = run.track
    start = run.plan.impact.ball_before.position
    np.testing.assert_allclose(track.positions[0] + start, run.path.launch.position)
    assert track.times[0] == pytest.approx(0.5 * (run.ball_after.time - run.delay))


def test_a_learner_meets_the_target_with_kicks_of_a_noisy_robot():
    goal, prior = swinging().goal, {"elevation": 0.15}
    learner = kd.Learner(goal, BALL, AIR, kd.Leg.human(), motion=True, scatter=0.02, prior=prior)
    tuning, misses = carried_out(swinging).tuning, []
    for seed in range(3):
        run = kd.run_in_mujoco(learner.command, tuning=tuning, seed=seed)
        misses.append(run.miss)
        learner.observe(run.track)
        assert learner.command.motion is not None
    assert misses[0] > 2.0
    assert max(misses[1:]) < 0.5
    assert np.mean(misses[1:]) < 0.3
    assert learner.estimates["elevation"] > 0.1
    with pytest.raises(kd.InvalidInput, match="motion is True without a leg"):
        kd.Learner(goal, BALL, AIR, motion=True)


def test_a_correction_of_a_standing_robot_is_turned_to_its_azimuth(monkeypatch):
    plan = standing()
    monkeypatch.setattr(kick_module, "replan_motion", lambda plan, velocity, contact: plan)
    before, angle = plan.impact.ball_after.velocity, 0.1
    wished = pin.rpy.rpyToMatrix(0, 0, angle) @ before
    turned = kick_module.replan_turned(plan, wished)
    np.testing.assert_allclose(turned.impact.ball_after.velocity, wished, atol=1e-9)
    assert turned.heading == pytest.approx(angle)


def test_a_page_shows_the_run_beside_the_plan():
    run = carried_out(swinging)
    page = kd.page(run)
    said = [umsgpack.unpackb(packed) for packed in page.viewer.window.commands]
    (film,) = (command for command in said if command["type"] == "set_animation")
    tracks = {
        (animation["path"], track["name"]): [key["value"] for key in track["keys"]]
        for animation in film["animations"]
        for track in animation["clip"]["tracks"]
    }
    leg = {path for path, _ in tracks if "/run/leg/" in path}
    assert len(leg) == 3
    ball = tracks["/meshcat/run/ball", ".position"]
    np.testing.assert_allclose(ball[0], run.ball_position[0], atol=1e-9)
    np.testing.assert_allclose(ball[-1], run.path.landing.position, atol=1e-6)
    assert "misses the target by" in page.panel
    missed = replace(run, path=None)
    assert "the foot misses the ball" in kd.page(missed).panel


def test_the_command_writes_the_motion_and_carries_it_out(tmp_path):
    kick = ["--distance", "20", "--time", "1.2", "--leg", "human"]
    out, numbers = tmp_path / "kick.csv", tmp_path / "kick.json"
    ended = CliRunner().invoke(
        plan_command,
        [
            *[*kick, "--motion", "--run", "mujoco", "--corrections", "1", "--noisy-runs", "2"],
            *["--out", str(out), "--json", str(numbers)],
        ],
    )
    assert ended.exit_code == 0, ended.output
    assert "The launch is corrected by its motion in MuJoCo" in ended.output
    assert "MujocoRun" in ended.output
    assert "2 of 2" in ended.output
    assert np.loadtxt(out, delimiter=",").shape[1] == 3
    written = json.loads(numbers.read_text())
    assert written["run"]["upright"]
    assert written["corrected_by"] == "mujoco"
    assert len(written["noisy_runs"]["misses"]) == 2
    ended = CliRunner().invoke(plan_command, [*kick, "--out", str(out)])
    assert str(ended.exception).endswith("it needs the motion, so add --motion")
    ended = CliRunner().invoke(plan_command, [*kick, "--motion", "--noisy-runs", "5"])
    assert str(ended.exception) == "--noisy-runs is 5: it needs a simulator, so add --run mujoco"
    ended = CliRunner().invoke(plan_command, [*kick, "--motion", "--out", "kick.txt"])
    assert str(ended.exception).startswith("kick.txt has the extension '.txt'")


def test_margins_of_the_sole_are_the_least_of_averaged_loads(monkeypatch):
    """A square sole of 0.2 m; the load moves to an edge and then pulls across the ground."""
    edges = np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]]), np.full(4, 0.1)
    monkeypatch.setattr(module, "sole_edges", lambda standing: edges)
    leg = kd.Leg.human()
    weight = 9.81 * sum(body.mass for body in leg.model.inertias)
    field = SimpleNamespace(
        standing="stands", timestep=0.01, friction=0.5, motion=SimpleNamespace(robot=leg)
    )
    rows = [(1, 0, 0, 0, 0), (1, 0.1, 0, 0.05, 0), (1, 0.3, 0, 0, 0.02), (0.01, 9, 9, 9, 9)]
    loads = [weight * np.array(row) for row in np.repeat(rows, 5, axis=0)]
    margins = module._ground_margins(field, SimpleNamespace(ground=loads))
    mixed = (0.3 + 9) / (0.5 * 1.01)  # of the mean over the last two rows that carry weight
    assert margins["friction"] == pytest.approx(1 - math.hypot(mixed, 9 / (0.5 * 1.01)))
    assert margins["centre of pressure"] == pytest.approx(0.1 - 9.02 / 1.01)
    steady = module._ground_margins(field, SimpleNamespace(ground=loads[:15]))
    assert steady["friction"] == pytest.approx(1 - 0.3 / 0.5)
    assert steady["centre of pressure"] == pytest.approx(0.1 - 0.05)
    lifted = module._ground_margins(field, SimpleNamespace(ground=loads[15:]))
    assert set(lifted.values()) == {-math.inf}


@pytest.mark.parametrize(
    ("tilt", "height", "upright"),
    [(0.0, 1.0, True), (50, 0.9, False), (40, 0.9, True), (0.0, 0.5, False), (0.0, -1.0, False)],
)
def test_a_robot_is_upright_by_its_base(tilt, height, upright):
    """Turned from the planned pose about an axis that is level, at a share of its height."""
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    planned = robot.configuration()
    planned[2] = 0.8
    pose = pin.AngleAxis(math.radians(tilt), np.array([0.6, 0.8, 0])).matrix()
    body = SimpleNamespace(xpos=np.array([3.0, 1.0, 0.8 * height]), xmat=pose.ravel())
    field = object.__new__(MujocoField)
    field.standing, field.motion = "stands", SimpleNamespace(robot=robot)
    field.data = SimpleNamespace(body=lambda name: body)
    assert field.is_upright(planned) is upright
