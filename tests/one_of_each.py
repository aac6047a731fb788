"""One object of every class that shows itself as a table, made when a test asks for it."""

import math
from dataclasses import replace
from functools import cache
from tempfile import TemporaryDirectory

import numpy as np
from scipy.interpolate import BSpline

import kickdyn as kd
from kickdyn.cli.check_file import FileCheck
from kickdyn.identification.infer_impact import RestitutionFit
from kickdyn.motion.motion import Motion
from kickdyn.motion.motion_record import record
from kickdyn.planning.reach import ReachRow, ReachTable
from kickdyn.simulators.mujoco_fit import KickError
from kickdyn.simulators.repeated_runs import NoisyRuns
from kickdyn.simulators.run_in_mujoco import MujocoRun
from kickdyn.simulators.tune_mujoco import MujocoTuning

BALL = kd.Ball(0.41, 0.105, pressure=80e3)
LEG = kd.Leg.human()
POSTURE = LEG.posture([0.7, 0.5, -0.3])
V = (6.6, -14.5, 6.6)
INCOMING = {"ball_velocity": (-3, 1, 0.5), "ball_spin": (5, -8, 3)}
CONTACT = kd.Contact((2, 0.3, 1), "peacock-ball", 0.02)
AIR = kd.Air(density=1.1, wind=(1, 2, 0.5), torque=None)
STATE = kd.BallState((0, 0, 0.11), (12, 3, 8), (5, -40, 20))
GOAL = kd.Goal((11, 1, 0), time=0.7)


def sticking(**of_contact):
    return kd.strike(POSTURE, V, BALL, kd.Contact((2, 0.3, 1), 0.7, 2.0, **of_contact), **INCOMING)


def stiff_impact():
    leg = LEG.with_stiff_joints("ankle").with_armature({"hip": 0.05, "knee": 0.02})
    return kd.strike(leg.posture(POSTURE.q), V, BALL, replace(CONTACT, friction=2.0), **INCOMING)


def motion():
    knots = [-0.5, -0.5, 0, 0], [0, 0, 0.75, 0.75]
    splines = [BSpline(ends, [POSTURE.q, 0.9 * POSTURE.q], 1) for ends in knots]
    return Motion(LEG, LEG.joint_names, *splines)


def motion_record():
    """A motion of 20 frames whose knee jumps out of its range, too fast for the leg."""
    angles = POSTURE.q + np.sin(np.arange(20) / 3.0)[:, None] * [0.3, 0.2, 0.1]
    angles[12:, 1] -= 0.5
    return record(LEG, 50.0, np.arange(20) / 50, angles, warnings=("knee",))


def tuning():
    return MujocoTuning(
        (-3e4, -40.0), (0.9, 0.95, 0.001, 0.5, 2.0), 0.4, (-1.0, -55.0), 0.007, 0.002,
        "implicitfast", 0.009, 0.010,
        (KickError("", 0.05, 0.02, math.radians(3), 0.6),
         KickError("speed x 0.5", 0.06, 0.08, math.radians(9), 1.1)),
        0.03, "<mujoco/>", BALL, np.array([1.0, 2.0, 3.0]),
    )  # fmt: skip


def run(faster=1.1):
    plan, rows = one("plan"), np.zeros((2, 3))
    launch = plan.impact.ball_after
    after = replace(launch, velocity=faster * launch.velocity + [0, 1, 0])
    margins = {"torque": 0.1, "centre of pressure": 0.02}
    return MujocoRun(plan, tuning(), np.zeros(2), rows, rows, rows, after, 0.004,
                     kd.fly(after, BALL, AIR, kd.Ground(-2.0)), faster == 1.1, margins)  # fmt: skip


def track():
    """A flight of 50 samples with noise of 4 mm, one of them 0.9 m off."""
    flight = kd.fly(kd.BallState((0, 0, 1), (18, 2, 9), (0, -40, 20)), BALL, kd.Air(drag=0.25))
    times = np.linspace(0.0, 0.8 * flight.duration, 50) ** 1.1
    noise = np.random.default_rng(2).normal(0.0, 0.004, (50, 3))
    noise[20] += 0.5
    return kd.Track(times, flight.sample(times).position + noise)


def learner():
    taught = kd.Learner(kd.Goal(30.0, time=1.5), BALL, AIR, restitution=0.7)
    taught.observe((28.0, 0.5), 1.4)
    return taught


def inferred():
    hit = one("impact")
    unsure = {"velocity_deviation": (0.1, 0.2), "spin_deviation": 1.3}
    return kd.infer_impact(POSTURE, V, BALL, hit.ball_before, hit.ball_after, **unsure)


def body():
    points = np.zeros((10, 2, 3))
    points[3:5, 1] = np.nan
    angles = {name: np.arange(10.0) / 50 for name in LEG.joint_names}
    angles["hip"][9] = np.nan
    return kd.BodyTrack(0.05 + np.arange(10) / 100, ["a", "b"], points, angles=angles)


def leg_motion():
    names = {name: name for name in LEG.joint_names}
    return kd.fit_motion(body(), LEG, angles=names, contact=(0.14, 0.0014))


def scene(**law):
    incoming = kd.BallState(velocity=(-3, 1, 0.5), spin=(5, -8, 3))
    return kd.Scene(POSTURE, V, BALL, CONTACT, air=AIR, ground=kd.Ground(-2.0), name="a kick",
                    incoming=incoming, **law)  # fmt: skip


def meeting():
    rolls = kd.BallState((2, 0, -0.7042), (-2.5, 0, 0), (0, -22.8, 0))
    plan = kd.plan_kick(LEG, kd.Goal(18, time=1.2), kd.Ball(), incoming=rolls)
    return next(meeting for meeting in plan.meetings if meeting.impact is not None)


def standing_impact():
    sole = [(0.1, 0.03, -0.03), (0.1, -0.03, -0.03), (-0.05, 0, -0.03)]
    leg = kd.Leg.from_robot("g1", base="floating")
    leg = leg.with_supports(kd.Support("left_ankle_roll_link", friction=0.7, sole=sole))
    posture = leg.posture(leg.configuration({"right_knee_joint": 0.5}))
    contact = kd.Contact((3, 0, 1), 0.8, 0.3, offset=(0.01, 0, 0))
    return kd.strike(posture, posture.joint_velocity([6, 0, 2]), kd.Ball(), contact)


def library():
    """Return a library with a single kick, of the goal of "library kick"."""
    launch = kd.plan_launch(kd.Goal(5.3, speed=12.0), BALL)
    with TemporaryDirectory() as folder:
        return kd.kick_library(
            LEG, f"{folder}/one.npz", BALL, speed=12.0, elevation=launch.angle, height=-0.7042
        )


MADE = {
    "ball": lambda: BALL,
    "incoming ball": lambda: kd.IncomingBall(kd.BallState((2, 0, -1), (-3, 0.2, 0), (0, -9, 1))),
    "ground": lambda: kd.Ground(0.2, surface=kd.Surface("mud", 0.3, 0.9, 4.0)),
    "air": lambda: AIR,
    "contact": lambda: kd.Contact((2, 0.3, 1), 0.7, 0.1, offset=(0.01, 0, -0.02)),
    "plane": lambda: kd.Plane((30, 1, 0), (-2, 0, 0), "centre"),
    "leg": lambda: LEG,
    "posture": lambda: LEG.with_stiff_joints("ankle").posture(POSTURE.q),
    "impact": lambda: kd.strike(POSTURE, V, BALL, CONTACT, **INCOMING),
    "stiff impact": stiff_impact,
    "standing impact": standing_impact,
    "collision": lambda: kd.collide(POSTURE, V, BALL, CONTACT, **INCOMING),
    "stick": lambda: sticking().sensitivity(),
    "slip": lambda: kd.strike(POSTURE, V, BALL, kd.Contact((2, 0.3, 1), 0.7, 0.02)).sensitivity(),
    "flight": lambda: kd.fly(STATE, BALL, AIR),
    "course": lambda: kd.follow(STATE, BALL, AIR, kd.Ground(surface="turf")),
    "goal": lambda: kd.Goal((20, 0, 1), speed=25, beside=(9, 1), spin=(0, -20, 5)),
    "launch": lambda: kd.plan_launch(kd.Goal((11, 1, 0), speed=16), BALL, AIR),
    "unreachable": lambda: kd.plan_launch(kd.Goal(30.0, time=0.5), BALL, AIR, speed_limit=40),
    "pass": lambda: kd.plan_pass(kd.Goal((12, 3, 0), time=1.5), BALL, None),
    "plan": lambda: kd.plan_kick(LEG, GOAL, BALL, AIR),
    "meeting": meeting,
    "motion": motion,
    "motion record": motion_record,
    "motion check": lambda: kd.check_motion(one("motion record"), LEG, BALL, CONTACT),
    "scene": scene,
    "slow scene": lambda: scene(law=kd.Compliance(contact_time=0.008)),
    "simulation": lambda: kd.simulate(scene(), 0.1),
    "track": track,
    "identification": lambda: kd.identify(track(), BALL, kd.Air(drag=0.2), free=["spin", "drag"]),
    "inferred": inferred,
    "restitution": lambda: RestitutionFit(
        np.array([[8, 0.7], [16.5, 0.61]]), np.array([0.02, 0.034]), 0.05
    ),
    "body": body,
    "file": lambda: FileCheck("ball track", (("rate", 49.7, "Hz"),), ("no z",), ("kickdyn plan",)),
    "leg motion": leg_motion,
    "contact motion": lambda: leg_motion().at_contact(),
    "learner": learner,
    "tuning": tuning,
    "run": run,
    "noisy runs": lambda: NoisyRuns((run(), run(1.32)), kd.KickNoise()),
    "library": library,
    "library kick": lambda: one("library").kick(kd.Goal(5.3, speed=12.0)),
    "reach": lambda: ReachTable("robot", True, (
        ReachRow(-10.0, 20.0, 21.43, 23.0, "speed of knee", 31.26, 44.32),
        ReachRow(0.0, 35.0, 18.71, None, "", 26.54, 37.98),
    )),
}  # fmt: skip
"""A function that makes each object, by its name."""


@cache
def one(name):
    """Return the object of a name, made once."""
    return MADE[name]()
