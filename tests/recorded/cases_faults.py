"""What bad input is refused for: each argument of each function with values of no use."""

import inspect
import math
from pathlib import Path

import numpy as np

import kickdyn as kd
from kickdyn.core import files, plot_style, validation
from recorded.parts import (
    AIR,
    BALL,
    BOX,
    CONTACT,
    GROUND,
    HUMAN,
    MIMIC,
    POSTURE,
    V,
    faults,
    g1,
    legs,
    measured,
)

BAD = {
    "nan": math.nan, "minus": -1.5, "nought": 0, "huge": 1e12, "text": "nonsense", "none": None, "pair": [1.0, 2.0],
    "inf": [math.inf, 0, 1], "object": {"a": 1}, "true": True, "empty": (), "unit": [0.0, 0.0, 0.0],
}  # fmt: skip
ONE = kd.BallState((0, 0, 1), (9, 1, 3))
TRACK = measured(30)
CALLS = {
    "Ball": (kd.Ball, {"mass": 0.4, "radius": 0.1, "inertia_factor": 0.6, "pressure": 8e4}),
    "BallState": (kd.BallState, {"position": (0, 0, 1), "velocity": (1, 2, 3), "spin": (1, 2, 3), "time": 0.3}),
    "Air": (kd.Air, {"density": 1.2, "viscosity": 1.8e-5, "wind": (1, 2, 3), "drag": 0.2, "lift": 0.2, "torque": 0.1, "buoyancy": True}),
    "Air.at": (kd.Air.at, {"altitude": 300.0, "temperature_c": 20.0, "pressure": 9e4, "drag": 0.2}),
    "Contact": (kd.Contact, {"normal": (1, 0, 0), "restitution": 0.7, "friction": 0.3, "offset": (0, 0, 0.1)}),
    "Surface": (kd.Surface, {"name": "mud", "restitution": 0.5, "friction": 0.5, "rolling_deceleration": 0.5, "tangential_restitution": 0.1, "deviations": {}}),
    "Ground": (kd.Ground, {"height": 0.1, "surface": "turf"}),
    "Plane": (kd.Plane, {"point": (1, 2, 3), "normal": (1, 0, 0), "reached_by": "front"}),
    "Wall": (kd.Wall, {"distance": 9.0, "height": 2.0, "width": 3.0}),
    "Drive": (kd.Drive, {"rotor_inertia": 1e-4, "gear": 50, "torque_limit": 90, "speed_limit": 9, "friction": 0.1, "stiffness": 300}),
    "Support": (kd.Support, {"frame": "foot", "point": False, "friction": 0.5, "sole": [(0, 0, 0), (1, 0, 0), (0, 1, 0)]}),
    "FootSurface": (kd.FootSurface, {"name": "x", "point": (0, 0, 0), "normal": (1, 0, 0), "size": (0.1, 0.1), "rise": (0.1, 0.2)}),
    "Goal": (kd.Goal, {"target": (10, 1, 0), "time": 1.0, "spin": (0, 1, 0), "arc": "low", "receiver_velocity": (1, 0, 0)}),
    "Goal over": (kd.Goal, {"target": (10, 1, 0), "over": (5, 2)}),
    "Goal apex": (kd.Goal, {"target": (10, 1, 0), "apex": 3.0}),
    "Goal beside": (kd.Goal, {"target": (10, 1, 0), "speed": 15, "beside": (5, 1)}),
    "Compliance": (kd.Compliance, {"contact_time": 0.01}),
    "Compliance by stiffness": (kd.Compliance, {"stiffness": 1e5}),
    "ForceModel": (kd.ForceModel, {"stiffness": 1e5, "restitution": 0.7, "exponent": 1.5}),
    "contact_stiffness": (kd.contact_stiffness, {"contact_time": 0.01, "mass": 0.4, "approach_speed": 10, "restitution": 0.7}),
    "normal_impulse": (kd.normal_impulse, {"approach_speed": 10, "restitution": 0.7, "leg_mass": 2, "ball_mass": 0.4}),
    "Event": (kd.Event, {"name": "x", "function": lambda s, n: s[2], "numbers": (1.0,), "terminal": True, "ends_step": False}),
    "Kick": (kd.Kick, {"speed": 3.0, "attack": 0.3, "restitution": 0.7, "friction": 0.3, "law": "newton", "ball": BALL, "air": AIR}),
    "Track": (kd.Track, {"times": [0, 1, 2], "positions": np.eye(3)}),
    "BodyTrack": (kd.BodyTrack, {"times": [0, 1, 2], "markers": ["a"], "positions": np.ones((3, 1, 3)), "angles": {"x": [1, 2, 3]}}),
    "IncomingBall": (kd.IncomingBall, {"state": ONE, "ground": GROUND, "meet_at": 0.3}),
    "strike": (kd.strike, {"posture": POSTURE, "v": V, "ball": BALL, "contact": CONTACT, "law": "newton", "engine": "closed-form",
                           "ball_velocity": (0, 0, 0), "ball_spin": (0, 0, 0)}),
    "unilateral_strike": (kd.unilateral_strike, {"posture": POSTURE, "v": V, "ball": BALL, "contact": CONTACT, "law": "newton"}),
    "strike_many": (kd.strike_many, {"leg": HUMAN, "q": [POSTURE.q], "v": [V], "ball": BALL, "contact": CONTACT, "law": "newton",
                                     "ball_velocity": (0, 0, 0), "slopes": False}),
    "posture": (HUMAN.posture, {"q": (0.1, 0.2, 0.3)}),
    "joint_velocity": (POSTURE.joint_velocity, {"point_velocity": (1, 0, 0)}),
    "effective_mass": (POSTURE.effective_mass, {"direction": (1, 0, 0)}),
    "point_velocity": (POSTURE.point_velocity, {"v": V}),
    "with_contact_offset": (POSTURE.with_contact_offset, {"offset": (0, 0, 0.1)}),
    "human": (kd.Leg.human, {"height": 1.7, "mass": 60, "sex": "female", "side": "left", "model": "3d", "base": "fixed"}),
    "locked": (HUMAN.locked, {"joints": {"knee": 0.3}}),
    "with_drives": (HUMAN.with_drives, {"drives": {"knee": kd.Drive(1e-4, 50)}}),
    "with_armature": (HUMAN.with_armature, {"armature": {"knee": 0.1}}),
    "with_base_velocity": (HUMAN.with_base_velocity, {"linear": (1, 0, 0), "angular": (0, 0, 0)}),
    "with_stiff_joints": (HUMAN.with_stiff_joints, {"joints": "knee"}),
    "with_supports": (legs("bolt").with_supports, {"supports": "FL_FOOT"}),
    "with_loops": (HUMAN.with_loops, {"loops": ("knee", "hip")}),
    "with_model": (HUMAN.with_model, {"model": HUMAN.model}),
    "configuration": (HUMAN.configuration, {"values": {"knee": 0.1}}),
    "from_robot": (kd.Leg.from_robot, {"name": "bolt", "frame": "FL_FOOT", "base": "fixed", "drives": False, "locked": {}}),
    "from_urdf": (kd.Leg.from_urdf, {"path": "leg.urdf", "frame": "toe", "base": "fixed", "locked": {}}),
    "from_mjcf": (kd.Leg.from_mjcf, {"path": "leg.xml", "frame": "toe", "base": "fixed", "locked": {}}),
    "kick_with": (kd.kick_with, {"leg": g1(), "surface": "toe"}),
    "fly": (kd.fly, {"state": ONE, "ball": BALL, "air": None, "ground": GROUND, "tol": 1e-9, "plane": None, "time_limit": 9.0, "max_step": 0.1, "ends": ()}),
    "follow": (kd.follow, {"state": ONE, "ball": BALL, "air": None, "ground": GROUND, "tol": 1e-9, "plane": None, "time_limit": 9.0}),
    "sample": (kd.fly(ONE, BALL, None, GROUND).sample, {"t": 0.1}),
    "orientation": (kd.fly(ONE, BALL, None, GROUND).orientation, {"t": 0.1}),
    "Scene": (kd.Scene, {"posture": POSTURE, "v": V, "ball": BALL, "contact": CONTACT, "law": "newton", "incoming": ONE, "air": None,
                         "ground": None, "plane": None, "wall": None, "uncertainty": {"q": 0.1}, "name": "x"}),
    "infer_impact": (kd.infer_impact, {"posture": POSTURE, "v": V, "ball": BALL, "ball_before": ONE, "ball_after": kd.BallState((0, 0, 1), (19, 1, 3)),
                                       "velocity_deviation": 0.1, "spin_deviation": 0.1, "joint_deviation": 0.1}),
    "Learner": (kd.Learner, {"goal": kd.Goal(30.0, time=1.5), "ball": BALL, "air": kd.Air(drag=0.2), "restitution": 0.7, "friction": 0.3, "scatter": 0.03,
                             "deviation": 0.05, "time_deviation": 0.02, "prior": {"wind_x": 1.0}}),
    "fit_motion": (kd.fit_motion, {"track": kd.BodyTrack([0, 1, 2], ["a"], np.ones((3, 1, 3))), "leg": HUMAN, "markers": {"a": "knee"}, "contact": 2.0, "scale": False}),
    "load_scene": (kd.load_scene, {"path": "nothing.toml"}),
    "open_sweep": (kd.open_sweep, {"path": "nothing.zarr"}),
    "from_csv": (kd.Track.from_csv, {"file": "nothing.csv", "columns": ("t", "x", "y", "z")}),
    "joint_loads": (kd.joint_loads, {"impact": kd.strike(POSTURE, V, BALL, CONTACT), "contact_time": 0.01}),
    "check_outputs": (files.check_writable, {"path": "a.json"}),
    "check_name": (plot_style.check_name, {"path": "a.png"}),
    "number": (validation.number, {"name": "x", "value": 1.0, "above": 0, "at_most": 3, "unit": "m"}),
}  # fmt: skip
SLOW = {
    "collide": (kd.collide, {"posture": POSTURE, "v": V, "ball": BALL, "contact": CONTACT, "contact_time": 0.01, "torque": None, "ball_velocity": (0, 0, 0), "tol": 1e-9}),
    "plan_launch": (kd.plan_launch, {"goal": kd.Goal(10, time=1), "ball": BALL, "air": None, "speed_limit": 30, "spin_limit": 100}),
    "plan_pass": (kd.plan_pass, {"goal": kd.Goal(10, time=1), "ball": BALL, "air": None, "surface": "turf", "angle": 0.0, "speed_limit": 30}),
    "plan_kick": (kd.plan_kick, {"leg": HUMAN, "goal": kd.Goal(10, time=1), "ball": BALL, "air": None, "objective": "joint-speed", "contact": None,
                                 "ball_position": -0.7, "incoming": None, "limits": True, "surface": None, "motion": False, "solver": "slsqp"}),
    "identify": (kd.identify, {"track": TRACK, "ball": BALL, "air": None, "free": ("spin",)}),
    "segments": (kd.segments, {"track": TRACK, "ball": BALL, "ground": None, "air": None}),
    "simulate": (kd.simulate, {"scene": kd.Scene(POSTURE, V, BALL, CONTACT), "tolerance": 0.05}),
    "simulate_many": (kd.simulate_many, {"scene": kd.Scene(POSTURE, V, BALL, CONTACT, uncertainty={"q": 0.1}), "draws": 3, "tolerance": 0.05, "seed": 0}),
    "sweep": (kd.sweep, {"leg": HUMAN, "postures": {"hip": 0.1, "knee": 0.1}, "kick": kd.Kick(), "store": None, "variables": None, "resume": False, "tolerance": 1e-6, "threads": 1}),
    "fly_many": (kd.fly_many, {"states": kd.BallState([[0, 0, 1]]), "ball": BALL, "air": None, "ground": None, "tol": 1e-9, "time_limit": 9.0, "error": False}),
    "follow_many": (kd.follow_many, {"states": kd.BallState([[0, 0, 1]]), "ball": BALL, "air": None, "ground": None, "tol": 1e-9, "time_limit": 9.0}),
    "tune_mujoco": (kd.tune_mujoco, {"posture": POSTURE, "v": V, "ball": BALL, "contact": CONTACT, "timestep": 0.002, "integrator": "Euler", "contact_time": 0.01, "tolerance": 0.03}),
    "page": (kd.page, {"subject": HUMAN, "path": None, "caption": "x", "scenery": ()}),
}  # fmt: skip
"""They take long where a value is accepted: only what is refused by its type is tried."""
TYPES = ("text", "object", "nan", "minus", "empty")


def refusals(name):
    """Return what a function says of each bad value of each argument."""
    slow = name in SLOW
    function, good = (SLOW if slow else CALLS)[name]
    if name in ("from_urdf", "from_mjcf"):
        Path("leg.urdf").write_text(MIMIC)
        Path("leg.xml").write_text(BOX)
    calls = {}
    variadic = {
        p.name
        for p in inspect.signature(function).parameters.values()
        if p.kind is p.VAR_POSITIONAL
    }
    for argument in good:
        for kind, bad in BAD.items():
            if slow and kind not in TYPES:
                continue
            if argument in variadic:
                calls[f"{argument} {kind}"] = lambda bad=bad: function(bad)
            else:
                calls[f"{argument} {kind}"] = lambda bad=bad, argument=argument: function(
                    **{**good, argument: bad}
                )
    return faults(calls)


FILES = {
    "no xml": ("leg.urdf", "hello"), "empty": ("leg.urdf", ""), "no joint": ("leg.urdf", '<robot name="x"><link name="toe"/></robot>'),
    "no mass": ("leg.urdf", MIMIC.replace('<mass value="3"/>', '<mass value="0"/>')),
    "negative": ("leg.urdf", MIMIC.replace('ixx="0.05"', 'ixx="-0.05"')),
    "triangle": ("leg.urdf", MIMIC.replace('ixx="0.05"', 'ixx="5"')),
    "no limit": ("leg.urdf", MIMIC.replace('<limit lower="0" upper="2.5" effort="80" velocity="20"/>', "")),
    "crossed": ("leg.urdf", MIMIC.replace('lower="0" upper="2.5"', 'lower="3" upper="2.5"')),
    "axis": ("leg.urdf", MIMIC.replace('xyz="0 -1 0"', 'xyz="0 0 0"')), "child": ("leg.urdf", MIMIC.replace('child link="foot"', 'child link="fuss"')),
    "number": ("leg.urdf", MIMIC.replace('value="7"', 'value="seven"')), "twice": ("leg.urdf", MIMIC.replace('joint name="heel"', 'joint name="knee"')),
    "planar": ("leg.urdf", MIMIC.replace('name="knee" type="revolute"', 'name="knee" type="planar"')),
    "mimic": ("leg.urdf", MIMIC.replace('mimic joint="knee"', 'mimic joint="toe"')), "entity": ("leg.urdf", '<!DOCTYPE a [<!ENTITY b "c">]><robot>&b;</robot>'),
    "mjcf gravity": ("leg.xml", BOX.replace("<default>", '<option gravity="0 0 -3"/><default>')),
    "mjcf ball": ("leg.xml", BOX.replace('<joint name="knee" axis="0 1 0" range="-0.1 2.4" armature="0.01"/>', '<joint name="knee" type="ball"/>')),
    "mjcf spring": ("leg.xml", BOX.replace('armature="0.03"', 'stiffness="30"')), "mjcf xml": ("leg.xml", "<mujoco>"),
    "mjcf heavy": ("leg.xml", BOX.replace('mass="1.1"', 'mass="1e30"')), "mjcf none": ("leg.xml", "<mujoco><worldbody/></mujoco>"),
    "mjcf weld": ("leg.xml", BOX.replace("<actuator>", '<equality><weld body1="foot" body2="pelvis"/></equality><actuator>')),
    "mjcf tendon": ("leg.xml", BOX.replace("<actuator>", '<tendon><fixed name="t"><joint joint="hip" coef="1"/></fixed></tendon><actuator>')),
    "mjcf frame": ("leg.xml", BOX.replace('site name="toe"', 'site name="tip"')),
    "mjcf far": ("leg.xml", BOX.replace('<inertial pos="0.05 0.01 -0.02"', '<inertial pos="1e30 0 0"')),
}  # fmt: skip


def loaded(name, text):
    Path(name).write_text(text)
    leg = (kd.Leg.from_mjcf if name.endswith("xml") else kd.Leg.from_urdf)(name, "toe")
    return leg.warnings


CSV = {
    "columns": "t,x,y\n0,1,2\n", "text": "t,x,y,z\n0,1,2,a\n", "short": "t,x,y,z\n0,1,2\n", "order": "t,x,y,z\n1,1,2,3\n0,1,2,3\n",
    "one": "t,x,y,z\n1,1,2,3\n", "empty": "", "nan": "t,x,y,z\n0,1,2,nan\n1,1,1,1\n2,2,2,2\n", "twice": "t,x,y,z\n0,1,2,3\n0,1,2,3\n",
}  # fmt: skip


def read_csv(text):
    Path("a.csv").write_text(text)
    return kd.Track.from_csv("a.csv")


UNITS = {
    "still": (TRACK.times, 0 * TRACK.positions + 1), "millimetres": (TRACK.times, 1e3 * TRACK.positions),
    "milliseconds": (1e3 * TRACK.times, TRACK.positions), "y up": (TRACK.times, TRACK.positions[:, [0, 2, 1]]),
    "long": (60 * TRACK.times, TRACK.positions), "few": (TRACK.times[:4], TRACK.positions[:4]),
    "minutes": (np.linspace(0, 40.0, 30), TRACK.positions),
}  # fmt: skip
OUTPUTS = {
    "nothing": "", "folder": "folder", "no folder": "none/a.json", "link": "link", "nul": "a\0b", "device": "/dev/null", "long": "x" * 300,
}  # fmt: skip


def outputs():
    Path("folder").mkdir()
    Path("link").symlink_to("folder")
    return faults(
        {name: (lambda path=path: files.check_writable(path)) for name, path in OUTPUTS.items()}
    )


MOTIONS = {
    "rate": lambda: _motion().save("a.csv", 5.0), "ending": lambda: _motion().save("a.docx"), "time": lambda: _motion().q(9.0),
    "wrench": lambda: _motion().ground_wrench(0.0), "margins": lambda: _motion().margins(0.0),
}  # fmt: skip


def _motion():
    from recorded.cases_planning import made_motion

    return made_motion()


KICKS = {
    "away": lambda: kd.strike(POSTURE, [-x for x in V], BALL, CONTACT), "slower": lambda: kd.strike(POSTURE, V, BALL, CONTACT, ball_velocity=(60, 0, 30)),
    "collide away": lambda: kd.collide(POSTURE, [-x for x in V], BALL, CONTACT), "normal": lambda: kd.strike(POSTURE, V, BALL, kd.Contact()),
    "no pressure": lambda: kd.collide(POSTURE, V, kd.Ball(), CONTACT, stiffness="pressure"),
    "inflated": lambda: kd.strike(POSTURE, V, kd.Ball(), kd.Contact((1, 0, 0), "inflated")),
    "both": lambda: kd.collide(POSTURE, V, BALL, CONTACT, stiffness=1e5, contact_time=0.01),
    "infinite": lambda: kd.collide(POSTURE, V, kd.Ball(math.inf, 0.1), CONTACT), "no source": lambda: _hit().uncertainty(),
    "unknown source": lambda: _hit().uncertainty(spin=3), "negative": lambda: _hit().uncertainty(q=-1), "odd": lambda: _hit().uncertainty(q=[1, 2]),
    "large": lambda: _hit().uncertainty(q=5), "paper moving": lambda: kd.strike(POSTURE, V, BALL, CONTACT, "paper", ball_spin=(9, 9, 9)),
    "engine": lambda: kd.strike(POSTURE, V, BALL, kd.Contact((1, 0, 0.1), 0.7, 0.4), engine="pinocchio"),
    "time of loads": lambda: kd.joint_loads(_hit(), 0.0), "law": lambda: kd.strike(POSTURE, V, BALL, CONTACT, "stronk"),
    "no approach in the batch": lambda: kd.strike_many(HUMAN, [POSTURE.q], [[-x for x in V]], BALL, CONTACT).status.tolist(),
}  # fmt: skip


def _hit():
    return kd.strike(POSTURE, V, BALL, CONTACT)


CASES = {
    **{f"arguments of {name}": (lambda name=name: refusals(name)) for name in (*CALLS, *SLOW)},
    "robot files": lambda: faults(
        {name: (lambda args=args: loaded(*args)) for name, args in FILES.items()}
    ),
    "tracks": lambda: faults(
        {name: (lambda text=text: read_csv(text)) for name, text in CSV.items()}
    ),
    "units": lambda: faults(
        {
            name: (lambda args=args: kd.identify(kd.Track(*args), BALL))
            for name, args in UNITS.items()
        }
    ),
    "segments of odd tracks": lambda: faults(
        {name: (lambda args=args: kd.segments(kd.Track(*args))) for name, args in UNITS.items()}
    ),
    "outputs": outputs,
    "motions": lambda: faults(MOTIONS),
    "kicks": lambda: faults(KICKS),
}
