"""Legs from every source, their postures, constraints, drives, surfaces and shapes."""

from pathlib import Path

import numpy as np

import kickdyn as kd
from kickdyn.robot import ground_clearance, names
from kickdyn.robot.standing import StandingRobot
from recorded.cases_impact import on_leg
from recorded.parts import HUMAN, POSTURE, faults, g1, legs, standing

LEGS = ("testbed", "fourbar", "run-up", "bolt", "g1", "human 3d", "held", "mjcf", "mimic")
PEOPLE = {
    "male": {"height": 1.82, "mass": 80}, "female": {"height": 1.65, "mass": 58, "sex": "female"},
    "left": {"side": "left", "model": "3d", "height": 1.75, "mass": 70},
    "floating": {"model": "3d", "base": "floating", "height": 1.75, "mass": 70, "sex": "female"},
}  # fmt: skip


def posture_of(name):
    posture, v, *_ = on_leg(name)
    leg = posture.leg
    normal = np.array([0.9, 0.1, 0.4])
    return {
        "posture": posture,
        "v": v,
        "delassus": posture.delassus(),
        "admissible": posture.admissible(v + 0.1 * np.arange(leg.nv)),
        "effective mass": posture.effective_mass(normal),
        "limits": posture.effective_mass_limits(normal),
        "solve": posture.solve(np.arange(leg.nv) - 1.0),
        "free": posture.without_stiff_joints.delassus(),
        "elsewhere": posture.with_contact_offset((0.02, 0.01, -0.03)),
        "refused": faults({"velocity": lambda: posture.joint_velocity((1, 50, 1))}),
        "try": posture.try_joint_velocity((1.0, 0.2, 0.3)),
    }


def changed():
    leg = HUMAN.with_stiff_joints("ankle").with_armature({"hip": 0.05, "knee": 0.02})
    floating = legs("bolt")
    return {
        "stiff": leg, "locked": HUMAN.locked({"ankle": 0.2}), "moving": legs("run-up"),
        "model": HUMAN.with_model(HUMAN.model), "supports": standing(0.5).supports,
        "names": HUMAN.expand_joint_names({"k*": 1, "hip": 2}), "range": HUMAN.joint_range("knee"),
        "configuration": floating.configuration({"FL_HAA": 0.1} if "FL_HAA" in floating.joint_names else {}),
        "held bolt": floating.with_supports("FL_FOOT"),
        "kick with": kd.kick_with(g1(), "inside"), "instep": kd.kick_with(HUMAN, kd.FootSurface("mine", (0.1, 0, 0), (1, 0, 0.2))),
        "point": floating.with_supports(kd.Support("FL_FOOT", point=True, friction=0.5)),
    }  # fmt: skip


def loops():
    leg = legs("fourbar")
    q = leg.close_loops(leg.configuration({"rocker_b": 0.7}), keep=("hip", "rocker_b", "ankle"))
    far = leg.close_loops(
        leg.configuration({"rocker_b": 1.3, "hip": 0.4}), keep=("hip", "rocker_b")
    )
    return [q, far, leg.open_loops, leg.posture(q), leg.warnings]


def shapes(leg, q=None):
    q = leg.configuration() if q is None else q
    return {
        "under": ground_clearance.depths_below(leg, q, 0.3)
        if hasattr(ground_clearance, "depths_below")
        else None,
        "frames": ground_clearance.body_frames(leg),
    }


def stood():
    robot = StandingRobot(standing(0.7))
    return {"leg": robot.leg.joint_names, "placement": robot.placement, "robot": robot}


CASES = {
    **{f"leg {name}": (lambda name=name: legs(name)) for name in LEGS},
    **{f"posture {name}": (lambda name=name: posture_of(name)) for name in (*LEGS,)},
    **{f"person {name}": (lambda who=who: kd.Leg.human(**who)) for name, who in PEOPLE.items()},
    "human": lambda: [HUMAN, str(HUMAN), POSTURE, repr(POSTURE)],
    "changed": changed,
    "loops": loops,
    "surfaces": lambda: {name: kd.foot_surfaces(leg) for name, leg in (("human", HUMAN), ("g1", g1()), ("3d", legs("human 3d")))},
    "talos": lambda: kd.Leg.from_robot("talos", legs_only=True),
    "floating g1": lambda: kd.Leg.from_robot("g1", base="floating", locked={"*wrist*": 0}),
    "icub": lambda: kd.Leg.from_robot("icub", legs_only=True),
    "kicking foot": lambda: [kd.Leg.from_robot("g1", frame, legs_only=True).frame for frame in ("left_ankle_roll_link", "toe", "inside")],
    "stood": stood,
    "shapes": lambda: shapes(g1()),
    "human in degrees": lambda: kd.Leg.human().posture([40, 30, -20]).warnings,
    "out of range": lambda: [HUMAN.posture([2.9, -0.4, 1.4]).warnings, HUMAN.too_fast([30.0, 10, 60]), HUMAN.outside_range([2.9, -0.4, 1.4])],
    "singular": lambda: [HUMAN.posture([0.0, 1e-9, 0.0]), HUMAN.posture([0, 0, 0]).joint_velocity((0, 0, 0.5))],
    "mjcf, floating": lambda: kd.Leg.from_mjcf(_gym("humanoid.xml"), "right_foot", base="floating"),
    "mjcf, hopper": lambda: kd.Leg.from_mjcf(_gym("hopper.xml"), "foot"),
    "mjcf, ant": lambda: kd.Leg.from_mjcf(_gym("ant.xml"), "aux_1", locked={"hip_2": 0.2}),
    "names": lambda: [names.unknown("joint", "knie", ("hip", "knee", "ankle"), "the leg"), names.listed(list("abcdefghijklmnop"), 5)],
    "unknown frames": lambda: faults({
        **{frame: (lambda frame=frame: kd.Leg.from_robot("g1", frame)) for frame in ("left_tow", "right_foot", "foot_left", "hand", "xyz")},
        **{f"human {frame}": (lambda frame=frame: kd.Leg.human().with_supports(frame)) for frame in ("foott", "sole", "left foot")},
        **{joint: (lambda joint=joint: g1().locked({joint: 0})) for joint in ("left_knee", "*elbow*", "knie")},
        **{robot: (lambda robot=robot: kd.Leg.from_robot(robot)) for robot in ("g2", "talus", "nao")},
    }),
}  # fmt: skip
LOOSE = {"loops": 1e-5}


def _gym(name):
    from importlib.util import find_spec

    return Path(find_spec("gymnasium").origin).parent / "envs" / "mujoco" / "assets" / name
