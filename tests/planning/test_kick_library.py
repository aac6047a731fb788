"""Kicks of a library keep the equations of the impact and all limits, between its motions too."""

import math
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from chains import at, random_inertia, serial
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, Unfinished
from kickdyn.planning import kick_reader
from kickdyn.planning.kick_library import KickLibrary
from kickdyn.planning.kick_reader import KickReader, read_kicks
from kickdyn.planning.library_motions import body_arrays

HEIGHT = -0.7042
ANGLES = math.radians(10), math.radians(12.5), math.radians(2.5)
SETTINGS = {"speed": (12.0, 12.4), "elevation": ANGLES, "height": HEIGHT}


def make(file: Path, **settings) -> KickLibrary:
    return kd.kick_library(kd.Leg.human(), file, **{**SETTINGS, **settings})


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> KickLibrary:
    return make(tmp_path_factory.mktemp("library") / "human.npz")


@pytest.fixture
def points(library) -> Array:
    draw = np.random.default_rng(1)
    return draw.uniform(library.reader.lower, library.reader.upper, (20, 5))


def test_any_launch_in_between_is_met_by_strike(library, points):
    assert library.covered == 1.0
    assert len(library.reader.node_points) == 4  # a step of 2 degrees would have more
    for point in points:
        kick = library.kick_at(point)
        impact = kick.impact
        agrees(impact.ball_after.velocity, kick.launch, closed_form(1e4))
        assert math.hypot(*kick.launch) == pytest.approx(point[0], rel=closed_form())
        assert math.asin(kick.launch[2] / point[0]) == pytest.approx(point[1], rel=1e-12)
        agrees(impact.ball_before.position, [*point[3:], HEIGHT], closed_form(1e4))
        agrees(impact.ball_after.spin, 0.0, 1e-9)
        agrees(impact.v_after, kick.interpolated.v_after, closed_form(1e6))
        agrees(kick.motion.v_after, impact.v_after, closed_form(1e6))


def test_motions_in_between_keep_all_limits(library, points):
    leg = kd.Leg.human()
    for point in points[:5]:
        kick = library.kick_at(point)
        motion = kick.motion
        times = np.linspace(motion.begin, motion.end, 400)
        q, v, torque = (
            np.array([of(t) for t in times]) for of in (motion.q, motion.v, motion.torque)
        )
        assert (np.abs(torque) <= 1.01 * leg.effort_limit).all()
        assert (np.abs(v) <= 1.01 * leg.velocity_limit).all()
        assert (q >= leg.model.lowerPositionLimit - 3e-3).all()
        assert (q <= leg.model.upperPositionLimit + 3e-3).all()
        assert min(kick.margins.values()) >= -0.01


def test_goals_are_met_by_their_launch(library):
    goal, air = kd.Goal(5.3, speed=12.2), kd.Air()
    launch = kd.plan_launch(goal, kd.Ball(), air)
    kick = library.kick(goal, air=air)
    assert library.reader.lower[1] < launch.angle < library.reader.upper[1]
    agrees(kick.launch, launch.velocity, closed_form(1e3))
    agrees(kick.impact.ball_after.velocity, launch.velocity, closed_form(1e4))
    plan = library.plan(goal, air=air)
    assert plan.landing_error < 1e-6
    fastest = np.max(np.abs(plan.v) / plan.leg.velocity_limit)
    assert plan.speed_use == pytest.approx(fastest, rel=0.02)
    again = library.replan(plan, 0.99 * launch.velocity)
    agrees(again.impact.ball_after.velocity, 0.99 * launch.velocity, closed_form(1e4))
    agrees(again.impact.ball_before.position, plan.impact.ball_before.position, closed_form(1e4))
    with pytest.raises(InvalidInput, match=r"speed is 11 m/s"):
        library.plan(kd.Goal(5.3, speed=11.0), air=air)
    with pytest.raises(InvalidInput, match="spin"):
        library.kick(kd.Goal(5.3, speed=12.2, spin=(0, -5, 0)))


def test_corrections_invert_launches_that_are_linear_in_those_of_the_nodes(library, points):
    slopes, offset = np.array([[1.05, 0.3, 0], [0.02, 0.6, 0], [0, 0, 1]]), np.array([0.1, 0.2, 0])
    corrected = KickLibrary(library.file, library.robot)
    nodes = corrected.reader.node_points
    corrected.reader.arrays["simulated"] = nodes[:, :3] @ slopes.T + offset
    for point in points:
        wished = slopes @ point[:3] + offset
        agrees(corrected.kick_for([*wished, *point[3:]]).point, point, 1e-5)
    launch = kick_reader.launch_velocity(wished)
    plan = corrected.plan(kd.Goal(0.4 * launch - [0, 0, 9.81 * 0.08], time=0.4))
    agrees(plan.launch.velocity, launch, closed_form(1e4))
    agrees(plan.impact.ball_after.velocity, kick_reader.launch_velocity(point), 1e-5)
    assert plan.corrected_by == "mujoco"
    assert "no kick has this launch in MuJoCo" in corrected.kick_for([9, 0.6, 0, *point[3:]]).reason
    assert "x is" in corrected.kick_for([*wished, 5.0, point[4]]).reason


@pytest.mark.slow
def test_kicks_meet_goals_in_mujoco_once_all_motions_were_carried_out(library, tmp_path):
    pytest.importorskip("mujoco")
    runs, file = [], shutil.copy(library.file, tmp_path / "one.npz")

    def stop(*counts):
        runs.append(counts)
        if len(runs) == 1:
            raise KeyboardInterrupt

    with pytest.raises(Unfinished, match=r"1 runs are stored in .*one\.npz"):
        kd.correct_library(KickLibrary(file, library.robot), progress=stop)
    corrected = kd.correct_library(KickLibrary(file, library.robot), progress=stop)
    assert runs == [("runs", 1, 4), *(("runs", k, 3) for k in (1, 2, 3))]
    launches = corrected.reader.arrays["simulated"]
    assert np.abs(launches[:, 0] / library.reader.node_points[:, 0] - 1.0).max() > 0.02
    speed, elevation, _ = launches.mean(axis=0)
    goal = kd.Goal(speed**2 * math.sin(2.0 * elevation) / 9.81, speed=speed)
    run = kd.run_in_mujoco(corrected.plan(goal))
    assert abs(run.speed_error) < 0.01
    assert run.direction_error < math.radians(0.5)
    other = KickLibrary(shutil.copy(library.file, tmp_path / "two.npz"), library.robot)
    shared = kd.correct_library(other, tuning=run.tuning).reader.arrays["simulated"]
    assert 0.0 < np.abs(shared[:, 0] / launches[:, 0] - 1.0).max() < 0.02


def test_samples_are_those_of_the_motion(library, points):
    kick = library.kick_at(points[0])
    t, q, v = library.reader.samples(kick.interpolated, 100.0)
    samples = kick.motion.samples(100.0)
    inside = (samples.t >= kick.motion.begin) & (samples.t <= kick.motion.end)
    agrees(t, samples.t[inside], closed_form())
    agrees(q, samples.q[inside], closed_form(1e3))
    agrees(v, samples.v[inside], closed_form(1e4))


def test_a_robot_needs_the_file_of_the_reader_and_numpy_only(library, points, tmp_path):
    shutil.copy(kick_reader.__file__, tmp_path / "kick_reader.py")
    code = (
        "import sys, numpy as np; from kick_reader import read_kicks; "
        f"kick = read_kicks({str(library.file)!r}).kick(np.array({points[0].tolist()})); "
        "print(*kick.v_before.tolist()); "
        "print(*{name.split('.')[0] for name in sys.modules} & {'kickdyn', 'scipy', 'pinocchio'})"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    velocities, loaded = done.stdout.split("\n")[:2]
    right = library.kick_at(points[0]).interpolated.v_before
    agrees([float(v) for v in velocities.split()], right, closed_form(1e4))
    assert loaded == ""


def test_an_interrupted_library_is_continued(library, tmp_path):
    calls = []

    def stop(what, count, total):
        calls.append(what)
        if len(calls) in (3, 5):
            raise KeyboardInterrupt

    file = tmp_path / "again.npz"
    for _ in range(2):
        with pytest.raises(Unfinished, match=r"again\.npz\.parts"):
            make(file, progress=stop)
        with (tmp_path / "again.npz.parts" / "log.jsonl").open("a") as log:
            log.write('{"node": [0')  # as if the process had been killed
    heavier = kd.Leg.human(height=1.8, mass=75)
    with pytest.raises(InvalidInput, match="other settings"):
        kd.kick_library(heavier, file, **SETTINGS)
    with pytest.raises(InvalidInput, match="other settings"):
        make(file, speed=(12.0, 12.3))
    with ThreadPoolExecutor(1) as executor:
        again = make(file, progress=lambda *_: calls.append("last"), executor=executor)
    assert not file.with_name("again.npz.parts").exists()
    checks_and_motions = 4 + 5
    assert len(calls) <= checks_and_motions  # nothing is computed twice
    for name, values in library.reader.arrays.items():
        if values.dtype.kind == "f":
            agrees(again.reader.arrays[name], values, 1e-9)


def test_what_is_outside_is_said_with_the_nearest_kick_and_what_is_no_point_refused(library):
    kick = library.kick_at(library.reader.upper + np.eye(5)[0])
    assert not kick.met
    assert kick.motion is kick.impact is None
    assert "speed is 13.4 m/s, outside of 12 to 12.4" in kick.reason
    assert "nearest kick has speed 12.4 m/s" in kick.reason
    for point in (library.reader.lower[:2], np.full(5, np.nan)):
        with pytest.raises(InvalidInput, match="point"):
            library.kick_at(point)
        with pytest.raises(ValueError, match="5 finite numbers, speed"):
            library.reader.kick(point)


def test_files_of_others_are_refused(library, tmp_path):
    with pytest.raises(InvalidInput, match="leg_human, with 3 joints"):
        KickLibrary(library.file, kd.Leg.testbed())
    damaged = bytearray(library.file.read_bytes())
    damaged[len(damaged) // 2] ^= 255
    (tmp_path / "damaged.npz").write_bytes(damaged)
    arrays = dict(library.reader.arrays)
    np.savez(tmp_path / "changed.npz", **{**arrays, "masses": arrays["masses"] * 2, "checksum": ""})
    np.savez(tmp_path / "other.npz", format=np.array("kickdyn kick library 9"))
    (tmp_path / "text.npz").write_text("no archive")
    for name in ("damaged", "changed", "other", "text"):
        with pytest.raises(ValueError, match=f"{name}.npz"):
            read_kicks(tmp_path / f"{name}.npz")
        with pytest.raises(InvalidInput, match=f"{name}.npz"):
            KickLibrary(tmp_path / f"{name}.npz", kd.Leg.human())


@pytest.mark.parametrize(("settings", "named"), [
    ({"speed": (12.4, 12.0)}, "speed"), ({"speed": -1.0}, "speed"),
    ({"elevation": (10.0, 12.0)}, "radians"), ({"azimuth": 0.3}, "azimuth"),
    ({"speed": (12.0, 12.4, 0.0)}, "a step above 0"),
    ({"height": None}, "height"),
    ({"contact": kd.Contact(None, [(5, 0.8), (20, 0.6)])}, "restitution")])  # fmt: skip
def test_bad_ranges_are_named(settings, named, tmp_path):
    with pytest.raises(InvalidInput, match=named):
        make(tmp_path / "bad.npz", **settings)


@pytest.mark.parametrize(("other", "named"), [
    ({"ball": kd.Ball(0.3, 0.11)}, "mass of the ball is 0.3"), ({"ball": kd.Ball(radius=0.1)},
    "radius of the ball is 0.1"), ({"height": -0.5}, "height of the ball is -0.5"),
    ({"contact": kd.Contact(None, 0.3, 0.4)}, "restitution is 0.3"),
    ({"contact": kd.Contact(None, 0.8, 0.6)}, "friction is 0.6")])  # fmt: skip
def test_a_library_of_another_impact_is_refused(other, named, library):
    with pytest.raises(InvalidInput, match=f"{named}: human.npz exists"):
        kd.kick_library(kd.Leg.human(), library.file, **other)


def test_a_library_is_read_for_its_ranges_only(library, tmp_path):
    assert make(library.file).covered == 1.0
    assert kd.kick_library(kd.Leg.human(), library.file).covered == 1.0
    with pytest.raises(InvalidInput, match=r"exists, for 12 to 12\.4 m/s"):
        make(library.file, speed=(1.0, 2.0))
    with pytest.raises(InvalidInput, match="does not exist"):
        kd.kick_library(kd.Leg.human(), tmp_path / "none.npz")
    with pytest.raises(InvalidInput, match=r"written as \.npz"):
        kd.kick_library(kd.Leg.human(), tmp_path / "kicks.csv")


@pytest.mark.parametrize("slides", [0, 1, 2])
def test_the_bodies_of_any_chain_move_as_in_pinocchio(slides):
    draw = np.random.default_rng(slides)
    kinds = [pin.JointModelRevoluteUnaligned] * 3
    kinds[slides] = pin.JointModelPrismaticUnaligned
    bodies = [
        (f"joint{k}", kind(np.array([0.6, 0.0, 0.8])), at(0.3, k, 0.1), random_inertia(draw))
        for k, kind in enumerate(kinds)
    ]
    model = serial(bodies, at(0.1, 0.2, -0.3))
    model.armature = draw.uniform(0.0, 0.1, 3)
    leg = kd.Leg.from_model(model, "toe")
    ranges = dict.fromkeys(("lower", "upper", "limits", "cell_reasons"), np.zeros(0))
    every = {"moving": np.arange(3), "resting": np.zeros(3)}
    reader = KickReader(body_arrays(leg) | ranges | every)
    posture = leg.posture(draw.uniform(-1.0, 1.0, 3))
    point, jacobian, inertia = reader.kinematics(posture.q)
    agrees(point, posture.contact_point, closed_form())
    agrees(jacobian, posture.jacobian[:3], closed_form())
    agrees(inertia, posture.inertia, closed_form())


def test_a_learner_corrects_kicks_of_a_library(library):
    """The foot of the world is less elastic, and sends the ball higher."""
    ball, air = kd.Ball(), kd.Air(lift=None)
    goal, turn = kd.Goal(5.3, speed=12.2), pin.rpy.rpyToMatrix(0.0, -0.007, 0.0)
    library = KickLibrary(library.file, library.robot)
    learner = kd.Learner(goal, ball, air, library, scatter=0.002, deviation=0.005)
    assert learner.command.landing_error < 1e-6
    with pytest.raises(InvalidInput, match=r"0\.3.*exists, for 0\.43 kg"):
        kd.Learner(goal, kd.Ball(mass=0.3), air, library)
    misses = []
    for _ in range(3):
        contact = replace(learner.command.impact.contact, restitution=0.79)
        hit = kd.strike(learner.command.impact.posture, learner.command.v, ball, contact).ball_after
        path = kd.fly(kd.BallState(velocity=turn @ hit.velocity), ball, air)
        learner.observe(path.landing.position, path.duration)
        assert learner.command.landing_error < 5e-3  # of the ball that is expected
        misses.append(math.hypot(*(path.landing.position - goal.target)))
    assert misses[0] > 0.1
    assert misses[2] < 0.02


def test_the_reach_of_a_library_is_its_largest_covered_speed(library):
    table = kd.reach(library, kd.Ball(), elevations=(5, 11))
    outside, inside = table.rows
    assert (outside.speed, inside.speed) == (0.0, 12.4)
    assert outside.reason.startswith("elevation is 5 deg, outside of")
    assert inside.reason == "it is the largest one of the library"
    assert library.kick_at([inside.speed, math.radians(11), 0.0, *library.place(None)]).met
    arrays = library.reader.arrays | {
        "cell_reasons": np.array(["slips"] * library.reader.arrays["cell_reasons"].size)
    }
    holes = KickLibrary(library.file, library.robot)
    holes.reader = KickReader(arrays)
    assert kd.reach(holes, kd.Ball(), elevations=(11,)).rows[0].reason == "not covered: slips"
    for drawn, covered in ((library, 1.0), (holes, 0.0)):
        axes = drawn.plot().axes[0]
        grey, kicks = axes.collections[:2]
        counts = len(kicks.get_paths()), len(grey.get_paths())
        assert counts[0] / sum(counts) == covered
