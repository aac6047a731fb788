"""What is refused for a reason that no single argument has, and messages of commands."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline

import kickdyn as kd
from kickdyn.core import files, validation
from kickdyn.planning import plan_report
from kickdyn.robot.standing import StandingRobot
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.sweeps.queries import condition
from recorded.cases_commands import run
from recorded.parts import AIR, BALL, BOX, CONTACT, HUMAN, POSTURE, V, faults, legs, measured

TRACK = measured(30)
HIT = kd.strike(POSTURE, V, BALL, CONTACT)
LAUNCH = kd.BallState((0, 0, 1), (9, 1, 3))
ROLLING = kd.BallState((2.0, 0.0, -0.7042), (-2.5, 0.0, 0.0), (0.0, -2.5 / BALL.radius, 0.0))
INFERRED = kd.infer_impact(POSTURE, V, BALL, HIT.ball_before, HIT.ball_after)
MANY = kd.BallState([[0, 0, 1.0], [0, 0, 2.0]], [[9, 1, 3.0]] * 2)


def learner(**changes):
    return kd.Learner(
        kd.Goal(30.0, time=1.5), BALL, changes.pop("air", kd.Air(drag=0.2)), **changes
    )


def written(name, text):
    Path(name).write_text(text)
    return name


FLIGHT = {
    "acceleration": lambda: kd.fly(LAUNCH, BALL, kd.Air(drag=lambda reynolds, spin: math.inf)),
    "light": lambda: kd.fly(kd.BallState((0, 0, 1), (4e8, 0, 1)), BALL, AIR),
    "forever": lambda: kd.fly(kd.BallState((0, 0, 1), (1e200, 0, 1e308)), BALL, None, time_limit=1e308),
    "several": lambda: kd.fly(MANY, BALL), "one": lambda: kd.fly_many(LAUNCH, BALL), "one rolls": lambda: kd.follow_many(LAUNCH, BALL),
    "heights": lambda: kd.follow_many(MANY, BALL), "no surface": lambda: kd.follow_many(MANY, BALL, None, kd.Ground(0.0)),
    "not python": lambda: kd.fly_many(MANY, BALL, kd.Air(drag=math.hypot)),
    "wind": lambda: kd.Air(wind=lambda height: None), "air": lambda: kd.Air.at(temperature=20.0), "dense": lambda: kd.Ball(1e308, 1e200),
    "computed": lambda: kd.BallState.computed([0, 0], [1, 2, 3], "x"), "masked": lambda: validation.floats("x", np.ma.masked_equal([1.0, 2.0], 2.0)),
    "event": lambda: kd.fly(LAUNCH, BALL, ends=[kd.Event("landed", lambda state, numbers: 1.0)]),
    "numbers of an event": lambda: kd.fly(LAUNCH, BALL, ends=[kd.Event("x", lambda state, numbers: 1.0, [[1.0, 2.0]])]),
    "wind fails": lambda: kd.Air(wind=lambda height: {}[height]), "coefficient": lambda: AIR.drag(-1.0, 0.2),
    "beyond floats": lambda: kd.fly(kd.BallState((0, 0, 1), (1e300, 0, 1e150)), BALL, None, time_limit=2e300),
    "event fails": lambda: kd.fly(LAUNCH, BALL, AIR, ends=[kd.Event("x", lambda state, numbers: 1 / 0)]),
    "name of an end": lambda: kd.fly(LAUNCH, BALL, ends=[kd.Event("at rest", lambda state, numbers: 1.0)]), "no function": lambda: kd.fly(LAUNCH, BALL, ends=[kd.Event("x", 3.0)]),
    "numbers fail": lambda: kd.fly(LAUNCH, BALL, ends=[kd.Event("x", lambda state, numbers: 1.0, lambda state: 1 / 0)]),
    "beyond the plane": lambda: kd.fly(LAUNCH, BALL, plane=kd.Plane((-3.0, 1.0, 0.0), (-2, 1, 0), "centre")),
    "restitution": lambda: kd.Contact((1, 0, 0), [(5.0, 0.8), (4.0, 0.7)]),
    "steep restitution": lambda: kd.plan_kick(HUMAN, kd.Goal(10, time=1.2), BALL, None, contact=kd.Contact(restitution=[(5.0, 0.9), (5.5, 0.2)])),
}  # fmt: skip
IDENTIFICATION = {
    "two drags": lambda: kd.identify(TRACK, BALL, free=("drag", "drag-scale")),
    "no model": lambda: kd.identify(TRACK, BALL, kd.Air(drag=None), free=("drag-scale",)),
    "long": lambda: kd.identify(kd.Track(np.linspace(0, 250, 3000), np.linspace((0, 0, 1), (90, 2, 9), 3000)), BALL),
    "infinite": lambda: kd.BodyTrack([0, 1], ["a"], [[[1, 2, math.inf]], [[1, 2, 3]]]), "twice": lambda: kd.BodyTrack([0, 1], ["a", "a"], np.ones((2, 2, 3))),
    "inertia": lambda: kd.infer_impact(POSTURE, V, kd.Ball(0.4, 0.1, math.inf), LAUNCH, kd.BallState((0, 0, 1), (19, 1, 3))),
    "no drag": lambda: learner(air=kd.Air(drag=None)), "wind": lambda: learner(air=kd.Air(drag=0.2, wind=lambda height: (1.0, 0.0, 0.0))),
    "receiver": lambda: kd.Learner(kd.Goal(20, time=1.2, receiver_velocity=(2, 1, 0)), BALL, AIR),
    "time beside a track": lambda: learner().observe(TRACK, 1.0),
    "before the kick": lambda: learner().observe(kd.Track(TRACK.times - 0.25, TRACK.positions)),
    "few markers": lambda: kd.fit_motion(kd.BodyTrack([0, 1, 2, 3], ["a"], np.ones((4, 1, 3))), legs("human 3d"), {"a": "knee"}),
    "motion": lambda: learner(motion=True),
    "angle": lambda: kd.fit_motion(angles(5), HUMAN, angles={"hip": "a", "knee": "-b", "ankle": "c"}),
    "few angles": lambda: kd.fit_motion(angles(2), HUMAN, angles={"hip": "a", "knee": "-b", "ankle": "b"}),
    "late": lambda: kd.BodyTrack.from_trc(written("a.trc", TRC)),
    "radius": lambda: sphere().marker_track("a", "b", "c", "d", radius=0.2), "sound": lambda: kd.identify(kd.Track(np.arange(9) / 99, np.outer(np.arange(9), (8, 0, 1))), BALL),
    "height of a goal": lambda: kd.Learner(kd.Goal((30.0, 0, 1.5), time=1.5), BALL, kd.Air(drag=0.2)), "state": lambda: kd.infer_impact(POSTURE, V, BALL, MANY, LAUNCH),
    "coordinates": lambda: kd.fit_motion(angles(5), HUMAN, angles={"hip": "a"}), "cells": lambda: kd.Track.from_csv(written("b.csv", "t,x,y,z\n0,1,2,3\n0.1,1,2,3,4\n")),
    "under the ground": lambda: kd.segments(kd.Track(TRACK.times, TRACK.positions - (0, 0, 5.25)), BALL, ground=kd.Ground(0.125, surface="turf")),
    "point": lambda: kd.fit_motion(kd.BodyTrack(np.arange(9) / 99, ["a"], np.ones((9, 1, 3))), HUMAN, {"a": ("knee", (3.0, 0, 40.0))}),
    "unseen": lambda: kd.BodyTrack([0, 1], ["a", "b"], [[[1, 2, 3], [math.nan] * 3]] * 2).marker_track("b"),
    "rows of a table": lambda: kd.fit_restitution([INFERRED] * 2, knots=3), "equal speeds": lambda: kd.fit_restitution([INFERRED] * 4, knots=2),
}  # fmt: skip


def angles(count):
    return kd.BodyTrack(np.arange(count) / 9, angles={"a": np.zeros(count), "b": np.ones(count)})


def sphere():
    corners = 0.11 * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-0.6, 0.8, 0]])
    return kd.BodyTrack(
        [0, 1, 2], list("abcd"), np.stack([corners + np.array((i, 0, 1)) for i in range(3)])
    )


TRC = """PathFileType\t4\t(X/Y/Z)\ta.trc
DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits
100\t100\t2\t1\tm
Frame#\tTime\ta
\t\tX1\tY1\tZ1

1\t0.02\t1\t2\t3
2\t0.01\t1\t2\t3
"""
IMPACT = {
    "slow": lambda: kd.collide(POSTURE, 1e-8 * np.array(V), BALL, CONTACT),
    "sole": lambda: kd.Support("FL_FOOT", friction=0.5, sole=[(0, 0, 0), (1, 0, 0.5), (2, 0, 1)]), "tilted": lambda: tilted_strike(),
    "immovable": lambda: kd.normal_impulse(3.0, 0.5, math.inf, math.inf),
    "no supports": lambda: kd.unilateral_strike(POSTURE, V, BALL, kd.Contact((1, 0, 0), 0.5)),
    "no friction": lambda: standing_strike(kd.Support("FL_FOOT")), "no sole": lambda: standing_strike(kd.Support("FL_FOOT", friction=0.5)),
    "scene with a restitution": lambda: kd.simulate_many(kd.Scene(POSTURE, V, BALL, CONTACT, uncertainty={"restitution": 0.1}), 3),
    "both of them": lambda: kd.page({"a": HIT, "b": kd.fly(LAUNCH, BALL)}),
    "takes time": lambda: kd.page(kd.simulate(kd.Scene(POSTURE, V, BALL, CONTACT, kd.Compliance(0.01)), None)),
    "belongs": lambda: kd.page(HUMAN, kd.fly(LAUNCH, BALL)),
    "fast": lambda: kd.strike(POSTURE, np.array(V) * 1e160, BALL, CONTACT),
    "patch": lambda: kd.collide(POSTURE, V, BALL, CONTACT, model=kd.FootPatch(0.05), stiffness=1e5),
    "offset": lambda: kd.collide(POSTURE, V, BALL, CONTACT, model=kd.FootPatch(0.05, offset=0.3)),
    "covariance": lambda: HIT.uncertainty(q=[[1.0, 0.5, 0], [0.25, 1, 0], [0, 0, -3.0]]), "result": lambda: HIT.uncertainty(q=0.01).share("height"),
    "no sensitivity": lambda: kd.strike(POSTURE, V, BALL, CONTACT, law="stronge").sensitivity(),
}  # fmt: skip


def standing_strike(*supports):
    leg = kd.Leg.from_robot("bolt", "FR_FOOT", base="floating").with_supports(*supports)
    posture = leg.posture(leg.configuration({}))
    return kd.unilateral_strike(
        posture, posture.admissible(np.ones(leg.nv)), BALL, kd.Contact((1, 0, 0), 0.5)
    )


def tilted_strike():
    corners = [(0.1, 0.04, 0), (0.1, -0.04, 0), (-0.1, -0.04, 0), (-0.1, 0.04, 0)]
    leg = kd.Leg.from_robot("bolt", "FR_FOOT", base="floating").with_supports(
        kd.Support("FL_FOOT", friction=0.5, sole=corners)
    )
    posture = leg.posture(leg.configuration({"FL_KFE": 0.3}))
    return kd.unilateral_strike(
        posture, posture.admissible(np.ones(leg.nv)), BALL, kd.Contact((1, 0, 0), 0.5)
    )


PLANNING = {
    "supports": lambda: kd.plan_kick(HUMAN.with_supports("toe"), kd.Goal(10, time=1), BALL, None),
    "incoming": lambda: kd.plan_kick(HUMAN, kd.Goal(10, time=1), BALL, None, incoming=LAUNCH, ball_position=-0.7),
    "incoming in a motion": lambda: kd.plan_kick(HUMAN, kd.Goal(10, time=1), BALL, None, incoming=LAUNCH, motion=True),
    "faster": lambda: kd.plan_kick(HUMAN, kd.Goal(10, time=1), BALL, None, incoming=kd.BallState((0.3, 0, -0.7), (20, 0, 0))),
    "fast receiver": lambda: kd.Goal(20, speed=15, receiver_velocity=(90, 60, 0)),
    "receiver": lambda: kd.plan_kick(HUMAN, kd.Goal(20, speed=15, receiver_velocity=(40, 3, 0)), BALL, None),
    "loops": lambda: kd.plan_kick(legs("fourbar"), kd.Goal(10, time=1), BALL, None),
    "mimic": lambda: legs("mimic").locked({"heel": 0.1}),
    "frame": lambda: kd.Leg.human(frame="knie", height=1.7, mass=60),
    "path": lambda: kd.plan_kick(HUMAN, kd.Goal(18, time=1.2), BALL, AIR, incoming=kd.IncomingBall(ROLLING, meet_at=(0.5, 1.0, -0.7))),
    "angles of reach": lambda: kd.reach(HUMAN, BALL, None, elevations=[10.0, 95.0]),
    "open": lambda: kd.strike(legs("fourbar").posture(np.full(legs("fourbar").nq, 0.1)), np.zeros(legs("fourbar").nv), BALL, CONTACT),
    "kept": lambda: legs("fourbar").close_loops(legs("fourbar").configuration(), keep="hip"), "legs": lambda: kd.Leg.from_robot("panda", legs_only=True),
    "packages": lambda: kd.Leg.from_urdf(shipped_urdf("leg_human.urdf"), package_dirs="/"), "folder": lambda: kd.Leg.from_urdf(shipped_urdf("leg_human.urdf"), package_dirs=["none"]),
    "mjcf included twice": lambda: mjcf('<include file="part.xml"/><include file="part.xml"/><default>', "<default>"),
    "mjcf twins": lambda: mjcf("<body ", '<body name="shank" ', '<body name="body3"', '<body name="thigh"'),
    "no mjcf": lambda: kd.Leg.from_mjcf(written("a.xml", "<html/>"), "toe"), "no urdf": lambda: kd.Leg.from_urdf(written("a.urdf", "<html/>"), "toe"),
    "slow receiver": lambda: kd.plan_kick(HUMAN, kd.Goal(20, speed=12, receiver_velocity=(11.9, 0, 0)), BALL, AIR),
    "never in reach": lambda: kd.plan_kick(HUMAN, kd.Goal(40, time=1.2), BALL, None, incoming=kd.BallState((2.0, 0.0, -0.7042), (-1, 0.0, 0.0)), surface="carpet"),
    "aside": lambda: kd.plan_trap(HUMAN, ROLLING, BALL, kd.Air(), velocity=(2, 0.5, 1)),
    "patterns": lambda: HUMAN.locked({"h*": 0.1, "*p": 0.2}), "velocity": lambda: POSTURE.joint_velocity((1e308, 1e308, 0)),
}  # fmt: skip


def mjcf(*edits):
    """Read the robot of the tables with each new text for the old one behind it."""
    text = BOX
    for new, old in zip(edits[::2], edits[1::2], strict=True):
        assert old in text
        text = text.replace(old, new, 1)
    written("part.xml", '<mujocoinclude><default class="x"/></mujocoinclude>')
    return kd.Leg.from_mjcf(written("robot.xml", text), "toe")


def told(plan):
    """Return what the report of a plan says, in sentences and in its table."""
    report = plan_report.PlanReport(plan)
    return [*report.sentences(), *report.table()]


def larger(factor, *arguments):
    """Return a motion of splines that is larger by a factor."""
    from recorded.cases_planning import made_motion

    motion = made_motion(*arguments)
    splines = (BSpline(x.t, factor * x.c, x.k) for x in (motion.before, motion.after))
    return replace(motion, **dict(zip(("before", "after"), splines, strict=True)))


def swung_through_the_ball():
    plan = kd.plan_kick(HUMAN, kd.Goal(20, time=1.2), BALL, None, ball_position=-0.72)
    return replace(plan, motion=larger(-3.0)).warnings


def swung_through_the_other_leg():
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True, drives=False)
    plan = kd.plan_kick(
        robot.with_supports(kd.Support("left_ankle_roll_link", friction=0.7)),
        kd.Goal(2, time=0.4),
        BALL,
        None,
    )
    stood = StandingRobot(plan.leg)
    return replace(
        plan, motion=larger(3.0, stood.robot, stood.placement, stood.leg.joint_names)
    ).warnings


SWEEPS = {
    "executor": lambda: kd.sweep(HUMAN, {"hip": 0.1}, kd.Kick(), threads=2, executor=ThreadPoolExecutor(1)),
    "resume": lambda: kd.sweep(HUMAN, {"hip": 0.1}, kd.Kick(), resume=True), "folder": lambda: kd.sweep(HUMAN, {"hip": 0.1}, kd.Kick(), store="none/a.zarr"),
    "not toml": lambda: kd.load_scene(written("a.toml", "[ball\nx = 3")), "input": lambda: files.check_outputs(written("a.nc", "x"), inputs=["a.nc"]),
    "number": lambda: condition(kd.sweep(HUMAN, {"hip": 0.1}, kd.Kick()), "hip + 1"), "call": lambda: condition(kd.sweep(HUMAN, {"hip": 0.1}, kd.Kick()), "abs(hip) > 1"),
    "samples": lambda: kd.sweep(HUMAN, {"hip": [0.1, 0.2]}, kd.Kick(), samples="all"), "half": lambda: kd.sweep(HUMAN, {"hip": [0.1, 0.2]}, kd.Kick(), samples=2.5),
    "list": lambda: kd.sweep(HUMAN, {"hip": [0.1, 0.2], "knee": [0.1]}, kd.Kick(), samples="list"),
    "large": lambda: kd.sweep(HUMAN, {"hip": np.linspace(0, 1, 40_000), "knee": np.linspace(0, 1, 40_000)}, kd.Kick()), "falling": lambda: kd.sweep(HUMAN, {"hip": [0.2, 0.1]}, kd.Kick()),
    "of what": lambda: condition(kd.sweep(HUMAN, {"hip": 0.1}, kd.Kick()), "hip ="), "scene of two": lambda: kd.Scene(POSTURE, V, BALL, CONTACT, incoming=MANY),
    "tolerance": lambda: kd.simulate(kd.Scene(POSTURE, V, BALL, CONTACT), 1e-14), "section": lambda: kd.load_scene(written("b.toml", "ball = 3\n[leg]\nname = 'human'\n")),
    "view": lambda: kd.page(HIT).save("a.docx"), "time step": lambda: kd.tune_mujoco(POSTURE, V, BALL, CONTACT, timestep=0.02),
}  # fmt: skip
SAID = {
    "ball": lambda: kd.Ball(430.0, 22.0).warnings, "ends of a loop": lambda: kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf")).open_loops,
    "flattened": lambda: kd.collide(POSTURE, V, kd.Ball(0.43, 0.11, pressure=9e3), CONTACT, stiffness="pressure").warnings,
    "a motion through the ball": swung_through_the_ball, "a motion through the other leg": swung_through_the_other_leg,
    "far from the posture": lambda: kd.infer_impact(POSTURE, V, BALL, HIT.ball_before, kd.BallState(HIT.ball_after.position, HIT.ball_after.velocity, (40, 9, 3))).warnings,
}  # fmt: skip
CLEAR = kd.Air()
PLANS = {
    "late": lambda: kd.plan_kick(HUMAN, kd.Goal(15, time=0.55), BALL, CLEAR, surface="carpet"),
    "late and high": lambda: kd.plan_kick(HUMAN, kd.Goal((30, 2, 5), time=1.3), BALL, CLEAR),
    "stops": lambda: kd.plan_kick(legs("testbed"), kd.Goal(40, time=9), BALL, CLEAR, surface="turf"),
    "trap": lambda: kd.plan_trap(HUMAN, ROLLING, BALL, CLEAR), "weak trap": lambda: kd.plan_trap(HUMAN, ROLLING, BALL, CLEAR, velocity=(60, 0, 1)),
    "weak": lambda: kd.plan_kick(HUMAN, kd.Goal(40, time=1.2), BALL, CLEAR, incoming=ROLLING),
}  # fmt: skip
COMMANDS = {
    "distance": "plan", "ball position": "plan --distance 9 --ball-position 0,0,0.1 --ball-velocity 1,0,0 --ball-height -0.7", "picture": "view free_kick --at 1 --out a.html",
    "both feet": "plan --distance 9 --time 1 --both-feet", "corrections": "plan --distance 9 --time 1 --corrections 2", "noisy runs": "plan --distance 9 --time 1 --noisy-runs 3",
    "moving in a motion": "plan --distance 9 --time 1 --ball-position 1,0,-0.7 --ball-velocity -1,0,0 --motion",
    "wind": "plan --distance 9 --time 1 --air none --wind 1,2,0", "leg": "posture-sweep --leg human:weight=3",
    "joint twice": "posture-sweep --joint hip=0:9:3 --joint hip=1", "joints of a robot": "posture-sweep --leg bolt --frame FL_FOOT",
    "marker": "identify track.csv --marker ball", "step": "posture-sweep --joint hip=0:9:-3", "one axis": "posture-sweep --joint hip=0:9:1e-12",
}  # fmt: skip


CASES = {
    **{f"{group} {name}": (lambda call=call: faults({"": call})[""]) for group, calls in {"flight": FLIGHT, "identification": IDENTIFICATION, "impact": IMPACT,
       "planning": PLANNING, "sweeps": SWEEPS}.items() for name, call in calls.items()},
    **{f"said of {name}": call for name, call in SAID.items()},
    **{f"plan {name}": (lambda call=call: told(call())) for name, call in PLANS.items()},
    **{f"command {name}": (lambda line=line: run(*line.split())) for name, line in COMMANDS.items()},
}  # fmt: skip
