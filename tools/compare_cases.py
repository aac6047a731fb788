"""What `tools/compare.py` computes in both trees, with public names of kickdyn and commands only.

`GROUPS` has the cases as expressions, which `CASES` evaluates, each in an empty folder.
"""

import base64
import contextlib
import io
import json
import math  # noqa: F401, for the cases
import re
import runpy
import shlex
import sys
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import measured_kicks
import numpy as np

import kickdyn as kd
from kickdyn.impact.force_model import ForceModel

# fmt: off
TOLERANCES = {"collide": 1e-6, "flight": 1e-7, "sweep": 1e-6, "scene": 1e-5, "plan": 1e-4, "track": 1e-5, "learner": 1e-3, "paper": 1e-5,
              "view": 1e-5, "command": 1e-4, "slow": 2e-2}  # relative, of groups with integrators or solvers
ROOT = Path(kd.__file__).resolve().parents[1]
HUMAN, V, MOVING = kd.Leg.human(), (6.6, -14.5, 6.6), {"ball_velocity": (-3, 1, 0.5), "ball_spin": (5, -8, 3)}
POSTURE, BALL, ROUGH = HUMAN.posture([0.7, 0.5, -0.3]), kd.Ball(0.41, 0.105, pressure=8e4), kd.Contact((2, 0.3, 1), 0.7, 0.1)
AIR, CALM = kd.Air(1.1, wind=(1, 2, 0.5), drag="brazuca"), kd.Air(1.15, drag="tango12", lift="wang")
LOW, TURF, COURT = kd.Ground(-0.4), kd.Ground(-0.95, "turf"), kd.Ground(-0.95, kd.Surface("court", 0.75, 0.7, 0.3, 0.4))
LINE, HIGH = kd.Plane((14, 0, 0), (-1, 0.1, 0), "back"), kd.Event("high", lambda state, numbers: numbers[0] - state[2], (2.5,))
LAUNCH, SLIDING = kd.BallState((0.1, -0.2, 0.3), (17, 3, 9), (8, -40, 25), 0.4), kd.BallState((0, 0, -0.845), (6, 1, 0), (2, -30, 5))
ROLLING, NEAR, SPRING = kd.BallState((2, 0, -0.7042), (-2.5, 0, 0), (0, -22.8, 0), 5), kd.Goal((4, 1, 0), time=0.8), ForceModel(4e5, 0.7)
SPREAD = {"q": 0.02, "v": 0.3, "restitution": 0.04, "friction": 0.05, "normal": 0.03, "ball_mass": 0.005, "ball_velocity": 0.2, "ball_spin": 2.0}
DRAW, AXES = np.random.default_rng(7).normal(0, 1, (3, 6, 3)), {"hip": [-0.1, 0.4, 0.8], "knee": [0.1, 0.5, 1.0, 1.6], "ankle": [-0.1, 0.3]}
MANY = kd.BallState(0.1 * DRAW[0], (16, 1, 7) + 3 * DRAW[1], 25 * DRAW[2], np.linspace(0, 1, 6))
CONTACTS = {
    "slips": kd.Contact((2, 0.3, 1), "peacock-ball", 0.02), "sticks": kd.Contact((2, 0.3, 1), 0.7, 2.0), "smooth": kd.Contact((2, 0.3, 1), 0.7),
    "inflated": kd.Contact((2, 0.3, 1), "inflated", 0.3), "table": kd.Contact((2, 0.3, 1), [(5, 0.8), (20, 0.6)], 0.15, (0.01, 0, -0.02)),
}
AIRS = {
    "wind": AIR, "calm": CALM, "default": kd.Air(), "paper": kd.Air.paper(), "high": kd.Air.at(2400.0, 3.0), "brown": kd.Air(drag="brown-lawler"),
    "sheared": kd.Air(wind=lambda z: (2 + 0.5 * z, 1, 0.1)), "goff": kd.Air(drag="goff-carre", lift="nathan"), "vacuum": None,
    "own": kd.Air(drag=lambda re, s: 0.2 + 1e-8 * re, lift=0.15, torque="tavares", buoyancy=False), "teamgeist": kd.Air(drag="teamgeist"),
    "sphere": kd.Air(drag="sphere", lift=None, torque=None), "jabulani": kd.Air(drag="jabulani"), "stokes": kd.Air(drag="stokes"),
}
SCENES: dict[str, dict[str, Any]] = {
    "plain": {}, "compliant": {"law": kd.Compliance(0.008)}, "stronge": {"law": "stronge"}, "course": {"ground": TURF}, "vacuum": {"air": None},
    "plane": {"plane": kd.Plane((14, 4, 0), (-1, 0.1, 0), "back"), "wall": kd.Wall(6, 1.2)}, "pressure": {"law": kd.Compliance(None, "pressure")},
    "uncertain": {"uncertainty": {"q": 0.02, "v": 0.3, "restitution": 0.03, "normal": 0.02}},
}
SHIPPED = ", ".join(sorted(file.stem for file in (Path(__file__).parents[1] / "scenes").glob("*.toml")))
GOALS = {
    "time": kd.Goal((11, 1, 0.4), time=0.7, spin=(0, -20, 5)), "apex": kd.Goal((16, -2, 0.0), apex=3.0), "speed": kd.Goal((18, 2, 0.5), speed=19),
    "high": kd.Goal((11, 1, 0.2), speed=15, arc="high"), "over": kd.Goal((20, 1, 0.5), over=(9.15, 2.3)), "far": kd.Goal(14, time=1.1),
    "receiver": kd.Goal(16, time=1.2, receiver_velocity=(2, 1, 0)), "beside": kd.Goal((20, 0, 1), speed=25, beside=(9, 1)), "too far": kd.Goal(60, time=1.9),
}
BENT = {"hip": 0.7, "knee": 0.5, "hip_rotation": 0.2, "right_hip_pitch_joint": -0.4, "right_knee_joint": 0.6, "left_knee_joint": 0.3,
        "left_ankle_pitch_joint": -0.3, "right_elbow_joint": 0.7, "leg_right_4_joint": 0.8, "leg_right_3_joint": -0.5, "FL_KFE": 0.6,
        "FL_HFE": -0.4, "thigh_joint": -0.3, "leg_joint": -0.5}
GEARED = re.sub(r'(?s)(<joint name="ankle".*?)(</joint>)', r'\1<mimic joint="knee" multiplier="-0.6" offset="0.2"/>\2',
                (ROOT / "urdf" / "leg_human.urdf").read_text())
def file(name: str, text: str) -> str:
    Path(name).write_text(text)
    return name
def on_feet(frame: str, **friction: float) -> Any:
    robot, sole = kd.Leg.from_robot("g1", frame, base="floating", drives=False), [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
    return robot.with_supports(*(kd.Support(f"{side}_ankle_roll_link", friction=mu, sole=sole) for side, mu in friction.items()))
@cache
def leg(name: str) -> Any:
    drives = {"hip": kd.Drive(1e-4, 80, 100, 12, 0.5, 800.0), "k*": kd.Drive(2e-4, 50, 90, 20, 0.2, 500.0)}
    gymnasium, right = Path(str(find_spec("gymnasium").origin)).parent, "right_ankle_roll_link"
    return {
        "human": lambda: HUMAN, "human 3d": lambda: kd.Leg.human(height=1.65, mass=58, sex="female", side="left", model="3d"),
        "testbed": kd.Leg.testbed, "bolt": lambda: kd.Leg.from_robot("bolt", base="floating"),
        "g1": lambda: kd.Leg.from_robot("g1", legs_only=True), "talos": lambda: kd.Leg.from_robot("talos", legs_only=True),
        "hopper": lambda: kd.Leg.from_mjcf(gymnasium / "envs/mujoco/assets/hopper.xml", "foot"),
        "geared": lambda: kd.Leg.from_urdf(file("geared.urdf", GEARED), "toe"),
        "four-bar": lambda: kd.Leg.from_urdf(ROOT / "urdf" / "leg_fourbar.urdf").with_loops(("shank_pin", "rocker_b_tip")),
        "run-up": lambda: HUMAN.with_base_velocity((3.0, 0.0, 0.4), (0.2, -1.0, 0.3)), "driven": lambda: HUMAN.with_drives(drives),
        "stiff": lambda: HUMAN.with_stiff_joints("ankle").with_armature({"hip": 0.05, "knee": 0.02}),
        "foot": lambda: on_feet(right, left=0.6), "slippery foot": lambda: on_feet(right, left=0.05), "feet": lambda: on_feet("right_wrist_yaw_link", left=0.4, right=0.8),
        "legged": lambda: kd.Leg.from_robot("g1", base="floating", legs_only=True).with_supports(kd.Support("left_ankle_roll_link", friction=0.7)),
    }[name]()
@cache
def on_leg(name: str) -> Any:
    """Return a bent leg, joint velocities with its foot forward and up, and the ball."""
    body = leg(name)
    bent = BENT if len(body.supports) < 2 else {"right_elbow_joint": 0.7}
    q = body.configuration({joint: angle for joint, angle in bent.items() if joint in body.single_joints})
    if body.loops:
        q = body.close_loops(body.configuration({"rocker_b": 0.4}), keep=("hip", "rocker_b", "ankle"))
    posture = body.posture(q)
    wish = (3.0, 0.4 * (np.linalg.matrix_rank(posture.jacobian, 1e-6) > 2), 0.8)
    return posture, posture.joint_velocity(wish + posture.transport_velocity), BALL
def body(name: str) -> Any:
    (posture, v, _), normal, ramp = on_leg(name), np.array([0.9, 0.1, 0.4]), np.arange(leg(name).nv)
    model = posture.leg.model
    return [posture.leg, posture, v, posture.point_velocity(v), posture.delassus(), posture.solve(ramp - 1.0), posture.effective_mass(normal),
            posture.effective_mass_limits(normal), posture.admissible(v + ramp), posture.with_contact_offset((0.02, 0.01, -0.03)).jacobian,
            posture.without_stiff_joints.delassus(), posture.leg.angles_deg(posture.q), posture.leg.too_fast(9 * ramp), model.armature,
            [x.toDynamicParameters() for x in model.inertias], {x.name: x.placement.homogeneous for x in model.frames}]
def hit(kind: str = "slips", law: str = "newton", ball: Any = BALL, **more: Any) -> Any:
    return kd.strike(POSTURE, V, ball, CONTACTS[kind], law, **MOVING | more)
def hit_by(name: str, law: str = "newton", friction: float = 0.25, **more: Any) -> Any:
    return kd.strike(*on_leg(name), kd.Contact((1, 0.05, 0.3), 0.75, friction), law, **MOVING, **more)
def stand(name: str, wish: Any = (4.0, 0.5, 1.0), **more: Any) -> Any:
    posture = on_leg(name)[0]
    return kd.unilateral_strike(posture, posture.joint_velocity(wish), BALL, kd.Contact(wish, 0.7, 0.3, **more), **MOVING)
def many(function: Any, name: str = "human", **more: Any) -> Any:
    (posture, v, _), noise = on_leg(name), np.random.default_rng(4).normal(0, 0.05, (9, leg(name).nq))
    v = v * np.array([[1, 1.2, 1.4, 0.8, -1, 1.6, 2, 3, 1.1]]).T  # one of them misses
    contacts = [kd.Contact((9, 0.1 * k, 3), 0.6, 0.05 * k) for k in range(9)]
    return function(posture.leg, posture.q + noise, v, BALL, contacts, ball_velocity=(-2, 0.5, 0.1), **more)
def collide(name: str = "", contact: str = "", **more: Any) -> Any:
    collision = kd.collide(*(on_leg(name) if name else (POSTURE, V, BALL)), CONTACTS.get(contact, ROUGH), **MOVING, **more)
    return [collision, [collision.sample(share * collision.contact_time) for share in (0.2, 0.5, 0.8)]]
def fly(air: Any = AIR, ground: Any = LOW, state: Any = LAUNCH, **more: Any) -> Any:
    path = kd.fly(state, BALL, air, ground, **more)
    return [path, path.sample(np.linspace(0, path.duration, 7)), path.orientation(0.3)]
def follow(air: Any = AIR, ground: Any = TURF, state: Any = LAUNCH, **more: Any) -> Any:
    path = kd.follow(state, BALL, air, ground, **more)
    return [path, path.sample(np.linspace(0, path.duration, 9))]
def coefficients(air: Any) -> Any:
    points = [(re, s) for re in (2, 900, 5e4, 9e4, 2e5, 3e5, 5e5, 3e6) for s in (0, 0.05, 0.2, 0.9, 1.6)]
    return [air, air.wind_at(3.0), *(x and [x(*point) for point in points] for x in (air.drag, air.lift, air.torque))]
def sweep(name: str = "human", speed: float = 9.0, axes: Any = AXES, law: str = "newton", **more: Any) -> Any:
    fields = {"attack": 0.3, "restitution": [(5, 0.8), (20, 0.6)], "friction": 0.15, "ball": BALL, "air": kd.Air(drag="brazuca")}
    return kd.sweep(leg(name), axes, kd.Kick(speed=speed, law=law, **fields), **more)
def scene(name: str = "plain", **more: Any) -> Any:
    fields = {"incoming": kd.BallState(velocity=(-3, 1, 0.5), spin=(5, -8, 3)), "air": AIR, "ground": kd.Ground(-2)}
    return kd.Scene(POSTURE, V, BALL, ROUGH, **fields | SCENES[name] | more)
@cache
def kick(goal: Any = GOALS["far"], leg_name: str = "human", air: Any = AIR, **more: Any) -> Any:
    return kd.plan_kick(leg(leg_name), goal, BALL, air, **more)
def meet(incoming: Any, goal: Any = kd.Goal(18, time=1.2), leg_name: str = "human") -> Any:  # noqa: B008
    plan = kick(goal, leg_name, CALM, incoming=incoming)
    return [plan, plan.meeting.landing_slopes, plan.plot()]
def motion(*kicked: Any) -> Any:
    plan = kick(*kicked, motion=True)
    plan.motion.save("kick.npz", 50)
    return [plan, plan.motion, dict(np.load("kick.npz")), [plan.motion.margins(t) for t in (-0.2, -0.01, 0.1)]]
def match(first: int = 2813, last: int = 2896) -> Any:
    track = kd.Track.from_csv(ROOT / "data" / "match_ball.csv")
    return kd.Track(track.times[first:last], track.positions[first:last])
def sampled(path: Any, noise: float, count: int, last: float) -> Any:
    times, draw = np.linspace(0, min(path.duration, last), count), np.random.default_rng(2)
    return kd.Track(times, path.sample(times).position + draw.normal(0, noise, (count, 3)))
def flown(noise: float = 0.004, count: int = 60) -> Any:
    return sampled(kd.fly(kd.BallState((0, 0, 1), (18, 2, 9), (3, -40, 20)), BALL, kd.Air(drag=0.25)), noise, count, 1.6)
def fit(track: Any = None, air: Any = None, **more: Any) -> Any:
    return kd.identify(track or flown(), BALL, air or kd.Air(drag=0.2), **more)
def bounced(noise: float, **more: Any) -> Any:
    start, ground = kd.BallState((0, 0, 0.4), (9, 2, 6), (4, -30, 12)), kd.Ground(0.0, COURT.surface)
    return kd.segments(sampled(kd.follow(start, BALL, kd.Air(drag=0.22), ground), noise, 420, 7.0), **more)
def markers(surface: str) -> Any:
    """Return body, motion and impact of a kick by its markers and by its ball."""
    (body, places), path = measured_kicks.subject(surface), ROOT / "data" / f"kick_{surface}.c3d"
    track, ball = kd.BodyTrack.from_c3d(path), kd.Track.from_c3d(path, "ball")
    swing = kd.fit_motion(track, body, places, contact=measured_kicks.CONTACT)
    return [track, ball, swing, swing.q(0.15), swing.v(0.15), swing.deviations(0.15), swing.at_contact(), swing.plot(),
            kd.infer_impact(swing, ball, measured_kicks.BALL)]
def infer(speed: float = 12.0, **more: Any) -> Any:
    v, change = np.array(V) * speed / 12, np.array([0.1, -0.05, 0.08])
    impact = kd.strike(POSTURE, v, BALL, kd.Contact((2, 0.3, 1), 0.8 - speed / 99, 0.1), **MOVING)
    after = kd.BallState(impact.ball_after.position, impact.ball_after.velocity + change, impact.ball_after.spin + 2 * change)
    return kd.infer_impact(POSTURE, v, BALL, impact.ball_before, after, **more)
def learn(body: Any = None, **more: Any) -> Any:
    learner = kd.Learner(kd.Goal((30, 1, 0), time=1.5), BALL, AIR, body, **more)
    results = [learner.launch]
    for seen in (((28.0, 0.5), 1.4), ((31.0, 1.4), 1.55)):
        learner.observe(*seen)
        results += [learner.estimates, learner.deviations, learner.landing_scatter, learner.landing_uncertainty, learner.command]
    return results
def elements(html: str) -> dict[str, Any]:
    """Return what a page sends to meshcat, its times, and its words."""
    import umsgpack

    parts: dict[str, Any] = {"times": list(map(json.loads, re.findall(r'"times": ?(\[\[.*?\]\])', html)))}
    for packed in re.findall(r'^"([A-Za-z0-9+/=]+)",?$', html, re.MULTILINE):
        command = umsgpack.unpackb(base64.b64decode(packed))
        parts.setdefault(f"{command.pop('type', '')} {command.pop('path', '')}", []).append(command)
    return {**parts, "words": re.sub(r"(?s)<script.*?</script>|<style.*?</style>", "", html)}
def page(*subject: Any, **more: Any) -> Any:
    return elements(kd.page(*subject, **more).html)
def run(line: str) -> dict[str, Any]:
    """Return the status of `kickdyn LINE`, what it prints, and what its files hold."""
    names, out, err, status = {*Path().iterdir()}, io.StringIO(), io.StringIO(), None
    sys.argv = ["kickdyn", *shlex.split(line)]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            runpy.run_module("kickdyn", run_name="__main__")
        except SystemExit as end:
            status = end.code
    if missing := re.search(r"No such (option|command)\W+[\w-]+", err.getvalue()):
        raise AttributeError(f"kickdyn {line.split()[0]} has no attribute: {missing[0]}")
    read = {".json": json.loads, ".html": elements, ".csv": lambda text: f"{text}\n"}
    files = {x.name: read.get(x.suffix, bool)(x.read_text("utf-8", "replace")) for x in {*Path().iterdir()} - names}
    return {"status": status, "out": f"{out.getvalue()}\n", "err": f"{err.getvalue()}\n", "files": files}
def identify(options: str) -> Any:
    lines = (ROOT / "data" / "match_ball.csv").read_text().splitlines(keepends=True)
    return run(f"identify {file('track.csv', ''.join([lines[0], *lines[2600:3500]]))} {options}")

# Expressions, separated by semicolons and ends of lines.
GROUPS = {
    "leg": """
body("@") for @ in human, testbed, human 3d, g1, talos, bolt, hopper, geared, four-bar, run-up, stiff, driven, foot
kd.Leg.human(height=1.65, mass=58, sex="female"); leg("g1").locked({"*hip_yaw*": 0.1}); kd.foot_surfaces(leg("@")) for @ in human, human 3d, g1
kd.kick_with(leg("g1"), "inside"); kd.kick_with(HUMAN, kd.FootSurface("mine", (0.1, 0, 0), (1, 0, 0.2))); leg("driven").without_rotors()
kd.foot_surfaces(kd.Leg.from_robot("g1", "left_ankle_roll_link", legs_only=True)); kd.Leg.human(height=1.75, mass=70, model="3d", base="floating")
HUMAN.posture([0, 1e-9, 0]); HUMAN.posture([0, 0, 0]).try_joint_velocity((0, 0, 1)); HUMAN.posture([2.9, -0.4, 1.4]).warnings""",
    "value": """
kd.Ball(); kd.Ball.paper(); BALL; kd.Ball(math.inf, 0.1); kd.Ball(0.43, 0.11, pressure=3e3); LAUNCH; MANY; LINE; LINE.gap(BALL, (9, 1, 2))
TURF; COURT; kd.Wall(9.15, 1.9); kd.Plane((9, 1, 0), (-2, 0.5, 0)).gap(BALL, (8, 1, 2)); kd.KickNoise()
CONTACTS["@"] for @ in slips, sticks, smooth, table, inflated
[CONTACTS["@"].restitution_at(speed, BALL) for speed in (1, 5, 9, 15, 30)] for @ in slips, sticks, smooth, table, inflated
[GOALS["@"], GOALS["@"].named_values(), GOALS["@"].nominal_times(), GOALS["@"].at(0.3)] for @ in time, apex, speed, over, beside, receiver
[x(0.01) for x in (SPRING.force, SPRING.stored, SPRING.separation)]; SPRING.returned(0.008, 0.01); kd.normal_impulse(12, 0.7, 2.5, 0.4)""",
    "strike": """
hit("@") for @ in slips, sticks, smooth, table, inflated
hit("@", "stronge") for @ in slips, sticks, smooth, table, inflated
hit("slips", "paper"); hit("smooth", "paper"); hit("@").uncertainty(**SPREAD) for @ in slips, sticks, smooth, table, inflated
hit("@").sensitivity() for @ in slips, sticks, smooth, table
hit_by("@") for @ in human, testbed, human 3d, g1, talos, bolt, hopper, geared, four-bar, run-up, stiff, driven, foot
hit_by("@", "stronge") for @ in four-bar, g1, human 3d, geared
[hit_by("@", friction=0.05 * k) for k in range(1, 16)] for @ in human, human 3d
hit_by("@").sensitivity() for @ in run-up, four-bar, bolt, geared, hopper, human 3d
hit().sensitivity(of_leg=False); hit(ball_velocity=(60, 0, 30)); hit("sticks", ball=kd.Ball(5, 0.12, 0.4)); hit().plot(q=0.02, v=0.3)
kd.strike(POSTURE, np.negative(V), BALL, ROUGH); kd.strike(POSTURE, V, kd.Ball(math.inf, 0.1), ROUGH); kd.strike(POSTURE, V, BALL, ROUGH)
kd.joint_loads(hit(), 0.01); kd.joint_loads(hit("sticks"), 0.01); kd.joint_loads(hit_by("g1"), 0.01); stand("@") for @ in foot, slippery foot, feet
stand("foot", (1, 0.2, -4)); stand("foot", offset=(0.05, 0, 0)); many(kd.strike_many, "@") for @ in human, g1, talos, run-up
many(kd.strike_many, slopes=True)""",
    "collide": """
collide(); collide(contact_time=0.006); collide(stiffness=4e5); collide(stiffness="pressure"); collide(stiffness=3e4); collide("", "sticks")
collide(torque=(30, -20, 5)); collide(torque=lambda t, q, v: -2 * v); collide("", "inflated", stiffness="inflated")
collide("", "inflated", model="patch"); many(kd.collide_many, "@") for @ in human, g1
collide("@", contact_time=0.01, tol=1e-8) for @ in testbed, human 3d, driven, g1, foot
many(kd.collide_many, stiffness="pressure", torque=(30, -20, 5))""",
    "flight": """
fly(AIRS["@"]) for @ in wind, calm, default, paper, high, sheared, goff, own, sphere, teamgeist, jabulani, stokes, brown, vacuum
coefficients(AIRS["@"]) for @ in wind, calm, default, paper, high, sheared, goff, own, sphere, teamgeist, jabulani, stokes, brown
fly(plane=LINE); fly(time_limit=0.8); fly(tol=1e-4); fly(max_step=0.05); fly(ends=[HIGH]); fly(ground=None)
fly(state=kd.BallState((0, 0, 1), (60, 0, 9), (0, -150, 0))); fly(state=kd.BallState((0, 0, 5))); fly(plane=LINE)[0].arrival(9.0)
follow(); follow(ground=COURT); follow(ground=kd.Ground(-0.95, "carpet")); follow(None); follow(plane=LINE); follow(ends=[HIGH])
follow(time_limit=1.7); follow(CALM, COURT, LAUNCH); follow(state=SLIDING); follow(state=SLIDING, plane=kd.Plane((4, 0, 0), (-1, 0, 0)))
kd.fly_many(MANY, BALL, AIRS["@"], LOW) for @ in vacuum, wind, sheared, own
kd.fly_many(MANY, BALL, AIR, LOW, plane=LINE, error=True); kd.fly_many(MANY, BALL, AIR, LOW, ends=[HIGH]); kd.follow_many(MANY, BALL, AIR, TURF)
kd.follow_many(MANY, BALL, CALM, COURT); kd.follow_many(MANY, BALL, AIR, TURF, plane=LINE); kd.follow_many(MANY, BALL, AIR, TURF, time_limit=1.5)""",
    "sweep": """
sweep("@") for @ in human, stiff, run-up
sweep(tolerance=0); sweep(law="stronge"); sweep(variables=["impulse", "carry"]); sweep(axes={x: y[:2] for x, y in AXES.items()}, samples="list")
sweep(axes={x: y[:2] for x, y in AXES.items()}, samples=16); sweep(axes={x: np.linspace(y[0], y[-1], 14) for x, y in AXES.items()})
sweep("g1", 3.0, {"right_hip_pitch_joint": [-0.9, -0.2], "right_knee_joint": [0.35, 1.0], "right_hip_roll_joint": [-0.1, 0.1]})
sweep("hopper", 3.0, {"rootz": [1.2, 1.3], "thigh_joint": [-0.4, -0.2], "leg_joint": [-0.5, -0.3]}); kd.sweep(HUMAN, AXES, kd.Kick())
kd.sweep(HUMAN, AXES, kd.Kick(speed=4, friction=2, air=None)); [sweep(store="s.zarr"), sweep(store="s.zarr", resume=True), kd.open_sweep("s.zarr").load()]""",
    "scene": f"""
kd.load_scene(ROOT / "scenes/@.toml") for @ in {SHIPPED}
kd.simulate(kd.load_scene(ROOT / "scenes/@.toml")) for @ in {SHIPPED}
kd.simulate(kd.load_scene(ROOT / "scenes/@.toml"), None) for @ in {SHIPPED}
kd.simulate(scene("@"), 0.2) for @ in plain, compliant, pressure, stronge, plane, vacuum, course, uncertain
kd.simulate_many(scene("@", uncertainty={{"v": 0.3, "friction": 0.05}}), 5, seed=1) for @ in plain, course, plane, compliant
kd.simulate(scene(), 1e-3); scene().with_leg(leg("stiff")); scene("compliant").as_instant()""",
    "plan": """
kd.plan_launch(GOALS["@"], BALL, AIR) for @ in time, apex, speed, high, over, beside, receiver, far, too far
kd.plan_launch(GOALS["time"], BALL); kd.plan_launch(GOALS["far"], BALL, AIR, speed_limit=10); kd.plan_launch(GOALS["beside"], BALL, AIR, spin_limit=9)
kd.plan_pass(kd.Goal((12, 3, 0), time=@), BALL, AIR, surface="carpet") for @ in 1.5, 2.5, 30
kd.plan_pass(kd.Goal((12, 3, 0), time=1.5), BALL); kd.plan_pass(kd.Goal((6, 1, 0), time=1.3, spin=(0, -10, 20)), BALL, CALM, angle=0.3)
kick(GOALS["@"]) for @ in apex, receiver, far, too far
kick(objective="@") for @ in joint-impulse, most-joint-impulse, kinetic-energy, foot-speed
kick(ball_position=-0.704); kick(air=CALM, ball_position=(0.35, 0, -0.68)); kick(kd.Goal(45, time=1.6), limits=False); kick(kd.Goal(12, time=1.5), surface="turf")
kick(contact=kd.Contact(restitution="inflated", friction=0.3, offset=(0.02, 0, -0.01))); kick(NEAR, "g1"); kick(kd.Goal(1.2, time=0.3), "testbed")
kick(kd.Goal(3, time=0.4), "legged"); meet(ROLLING); meet(kd.BallState((4, 0, -0.3), (-9, 0, 1.5), (0, 5, 0)), kd.Goal((10, 0, 0.3), time=1.0))
meet(kd.BallState((1.5, 0.6, -0.58), (-2, -0.9, 0), (8, -17, 3)), NEAR, "g1"); meet(kd.IncomingBall(ROLLING, meet_at=5.72))
meet(kd.BallState((5, 3, -0.7), (1, 1, 0))); meet(ROLLING)[0].replan(incoming=kd.BallState((1.6, 0, -0.7042), (-2.4, 0, 0), (0, -22, 0), 5.16))
kd.plan_trap(HUMAN, ROLLING, BALL, CALM); kd.plan_trap(HUMAN, ROLLING, BALL, CALM, velocity=(2, 0, 1)); kd.reach(HUMAN, BALL, elevations=[20])""",
    "track": """
fit(); fit(air=kd.Air(drag=0.25), free=()); fit(air=kd.Air(drag=0.2, wind=(3, 1, 0))); fit().plot(); fit(flown(0.03)); fit(flown(0.004, 20))
fit(match()); fit(match(), free=("drag",)); fit(match(), kd.Air(drag="brazuca"), free=("spin", "drag-scale")); kd.segments(match(2600, 3500))
[kd.segments(kd.Track(x.times[k], x.positions[k])) for x in [match(2600, 3500)] for k in [np.r_[0:150, 180:369]]]
bounced(0.003); bounced(0.02); bounced(0.003, ball=BALL, ground=kd.Ground(0.0), air=kd.Air(drag=0.22)); markers("@") for @ in instep, toe
infer(); infer(velocity_deviation=0.2, spin_deviation=2, joint_deviation=0.1); infer(joint_deviation=0.1).plot()
kd.fit_restitution([infer(x, velocity_deviation=0.1 + 0.01 * x) for x in range(6, 20, 2)], @) for @ in 1, 2
kd.kick_table({"slow": infer(6.0), "fast": infer(20.0, velocity_deviation=0.1)}).to_numpy()""",
    "learner": """learn(); learn(HUMAN); learn(prior={"wind_x": 0.5, "drag_scale": 0.1}, scatter=0.03, time_deviation=0.05)""",
    "paper": """run("paper --only @ --json out.json") for @ in fig1, table2, fig8, fig9, fig10, fig15, table4""",
    "view": """
page(hit(), kd.fly(hit().ball_after, BALL, AIR, kd.Ground(-2)), caption="a <kick>"); page(hit(), kd.follow(hit().ball_after, BALL, AIR, TURF))
page({"soft": hit(), "<hard>": hit_by("testbed")}); page({"calm": fly(CALM)[0], "wind": fly()[0]}, caption="two"); page(POSTURE); page(hit_by("@")) for @ in g1, human 3d, hopper
page(kd.plan_pass(kd.Goal((12, 3, 0), time=1.5), BALL)); page(fit()); page(kick()); page(meet(ROLLING)[0]); page(scene("@")) for @ in compliant, course, plane
page(leg("@")) for @ in g1, geared""",
    "command": """
run("@ --help") for @ in plan, posture-sweep, identify
run("plan --distance @ --json out.json --view out.html") for @ in 30 --time 1.5, 20 --height 0.9 --over 9.15:2.6 --goal --wall 9.15:1.9
run("plan --distance @ --json out.json") for @ in 16 --time 1.2 --receiver-velocity 2,0,0, 20 --wall 9.15:1.9, 12 --time 1.5 --pass turf --ball 0.41:0.105:80000, 300 --time 1.2
run("plan --leg g1 --frame toe --distance 4 --left 1 --time 0.8 --json out.json")
run("plan --distance 18 --time 1.2 --ball-position 2,0,-0.7042 --ball-velocity -2.5,0,0 --ball-spin 0,-22.8,0 --json out.json")
run("plan --distance 40 --apex 6 --no-limits --objective kinetic-energy --restitution 5:0.8,20:0.65 --wind 1,0,0 --drag brazuca --json out.json")
run("posture-sweep --joint hip=-10:60:10 --joint knee=0:90:15 --joint ankle=-5:15:10 --speed 2 --view out.html --json out.json")
run("posture-sweep --joint hip=0:60:10 --joint knee=0:90:30 --where 'knee < 50' --law stronge --restitution peacock-ball --json out.json")
run("posture-sweep --leg g1 --frame toe --joint right_hip_pitch_joint=-60:10:10 --joint right_knee_joint=10:70:10 --attack 20 --json out.json")
run("@ --json out.json") for @ in simulate robot_chip, simulate volley --exact, tradeoff --scene free_kick, reach --elevation 20 --tolerance 0.2 --out out.csv
run("view @ --out out.html --json out.json") for @ in wet_grass_pass, volley
identify("@ --json out.json") for @ in --view out.html, --start 213 --end 296 --drag brazuca, --start 213 --end 296 --drag 0.16 --ball 0.42:0.109""",
    "bad": """
kd.Ball(-0.4); kd.Ball(0.4, math.nan); kd.BallState((math.inf, 0, 0)); kd.Air(-1.0); kd.Air(drag="golf"); kd.Air.at(1e6); kd.Contact((0, 0, 0))
kd.Contact((1, 0, 0), 1.7); kd.Contact((1, 0, 0), 0.7, -1); kd.Contact((1, 0, 0), [(5, 0.8), (4, 0.7)]); kd.Ground(0.1, "lava"); kd.Wall(-9, 2)
kd.Goal(10); kd.Goal(10, time=1, apex=2); kd.Drive(-1.0); kd.Compliance(0.01, 1e5); kd.Leg.human(height=9.0); kd.Leg.from_robot("g2")
kd.Leg.from_robot("g1", "left_tow"); HUMAN.locked({"knie": 0}); HUMAN.posture((0.1, 0.2)); POSTURE.joint_velocity((1, 50, 1)); hit(law="stronk")
scene(law="soft"); hit("inflated", ball=kd.Ball()); hit().uncertainty(spin=3); hit(law="stronge").sensitivity()
kd.joint_loads(hit(), 0.0); kd.unilateral_strike(POSTURE, V, BALL, ROUGH); collide(stiffness=1e5, contact_time=0.01); kd.fly_many(LAUNCH, BALL)
kd.strike_many(HUMAN, [POSTURE.q], [V, V], BALL, ROUGH); fly(tol=1.0); fly(ground=kd.Ground(2.0)); fly(plane=kd.Plane((-3, 1, 0), (-2, 1, 0)))
sweep(axes={"hipp": [0.1]}); sweep(axes={"hip": [0.2, 0.1]}); sweep(resume=True); kd.open_sweep("no.zarr"); kd.load_scene("no.toml")
kd.load_scene(file("a.toml", "[ball")); kd.simulate_many(scene(), 0); kick(objective="speed"); kick(leg_name="four-bar")
kick(kd.Goal(300, time=1.2)); kd.plan_trap(HUMAN, ROLLING, BALL, velocity=(2, 0.5, 1)); kd.reach(HUMAN, BALL, elevations=[95.0])
fit(free=("drag", "drag-scale")); fit(kd.Track([0, 1], np.eye(3)[:2])); kd.Track.from_csv(file("a.csv", "t,x,y\\n0,1,2\\n")); kd.page(3)
kd.fit_restitution([infer()], 3); kd.Learner(GOALS["receiver"], BALL, AIR); kd.page(HUMAN).save("a.docx"); kd.Leg.from_mjcf(file("a.xml", "<x>"), "x")
kd.Leg.from_urdf(file("a.urdf", GEARED.replace('joint="knee"', 'joint="toe"')), "toe")
run("@") for @ in plan, plan --distance 12, plan --distance 12 --wall 13:2, posture-sweep --joint hip=40:0:20, simulate nothing, identify no.csv""",
    "slow": """
motion(); motion(kd.Goal(2, time=0.4), "legged"); page(kick(motion=True)); kd.run_in_mujoco(kick(motion=True))
kd.tune_mujoco(POSTURE, V, BALL, kd.Contact((2, 0, 1), 0.7, 0.3), timestep=0.002, contact_time=0.01)""",
}
CASES = {
    f"{group}: {line}": partial(eval, line, globals())
    for group, text in GROUPS.items() for case in re.split(r"; |\n", text.strip()) for form, _, words in [case.partition(" for @ in ")]
    for line in (form.replace("@", word) for word in words.split(", "))
}
