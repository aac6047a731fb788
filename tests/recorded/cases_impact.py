"""Impacts: strikes by each law, of each kind of leg, with what follows from them."""

import math

import numpy as np

import kickdyn as kd
from kickdyn.impact import pinocchio_engine
from kickdyn.impact.laws import normal_impulse
from recorded.parts import AIR, BALL, CONTACT, HUMAN, MOVING, POSTURE, V, g1, legs, standing

STICKY = kd.Contact((2, 0.3, 1), 0.7, 2.0)
TABLE = kd.Contact((2, 0.3, 1), [(5, 0.8), (20, 0.6)], 0.15, offset=(0.01, 0.0, -0.02))
KINDS = {
    "slips": (POSTURE, V, BALL, CONTACT),
    "sticks": (POSTURE, V, BALL, STICKY),
    "restitution by speed": (POSTURE, V, BALL, TABLE),
    "inflated": (POSTURE, V, BALL, kd.Contact((2, 0.3, 1), "inflated", 0.3)),
    "frictionless": (POSTURE, V, BALL, kd.Contact((2, 0.3, 1), 0.7)),
}


def on_leg(name, friction=0.25):
    """Return a kick of a leg of `legs`, its foot forward and up."""
    leg = legs(name)
    draw = np.random.default_rng(len(name))
    q = leg.configuration()
    if leg.loops:
        q = leg.close_loops(leg.configuration({"rocker_b": 0.4}), keep=("hip", "rocker_b", "ankle"))
    elif leg.mimics:
        q = leg.configuration({"hip": 0.3, "knee": 0.4})
    elif leg.nq == leg.nv:
        q = np.clip(draw.uniform(-0.4, 0.5, leg.nq), leg.lower + 0.01, leg.upper - 0.01)
    posture = leg.posture(q)
    planar = name in ("testbed", "fourbar", "run-up")
    wish = np.array([3.0, 0.0, 0.8]) if planar else (3, 0.4, 0.8)
    if name == "mimic":
        wish = posture.jacobian @ posture.admissible(np.array([2.0, -6.0, 0.0]))
    v = posture.joint_velocity(np.asarray(wish) + posture.transport_velocity)
    return posture, v, BALL, kd.Contact((1, 0.05, 0.3), 0.75, friction)


def struck(name, law="newton", **more):
    return kd.strike(*KINDS[name], law, **{**MOVING, **more})


def spread(hit):
    return hit.uncertainty(
        q=0.02, v=0.3, restitution=0.04, friction=0.05, normal=0.03, ball_mass=0.005,
        ball_velocity=0.2, ball_spin=2.0,
    )  # fmt: skip


def unilateral(friction=0.6, wish=(4.0, 0.5, 1.0), **more):
    leg = standing(friction)
    posture = leg.posture(leg.configuration({
        "right_hip_pitch_joint": -0.4, "right_knee_joint": 0.6, "left_knee_joint": 0.3,
        "left_ankle_pitch_joint": -0.3,
    }))  # fmt: skip
    v = posture.joint_velocity(wish)
    return posture, v, kd.Ball(), kd.Contact(wish, 0.7, 0.3, **more)


def two_feet():
    robot = kd.Leg.from_robot("g1", "right_wrist_yaw_link", base="floating", drives=False)
    sole = [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
    leg = robot.with_supports(
        kd.Support("left_ankle_roll_link", friction=0.4, sole=sole),
        kd.Support("right_ankle_roll_link", friction=0.8, sole=sole),
    )
    posture = leg.posture(leg.configuration({"right_elbow_joint": 0.7}))
    v = posture.joint_velocity((3.0, 0.3, 0.5))
    return kd.unilateral_strike(posture, v, BALL, kd.Contact((3, 0.2, 0.6), 0.7, 0.3), **MOVING)


def batch(**more):
    draw = np.random.default_rng(4)
    q = POSTURE.q + draw.normal(0, 0.1, (9, 3))
    v = np.array(V) + draw.normal(0, 1, (9, 3))
    contact = [kd.Contact((2, 0.1 * k, 1), 0.6 + 0.02 * k, 0.05 * k) for k in range(9)]
    many = kd.strike_many(HUMAN, q, v, BALL, contact, ball_velocity=(-2, 0.5, 0.1), **more)
    return {name: getattr(many, name) for name in (
        "impulse", "ball_velocity", "ball_spin", "ball_position", "v_after", "joint_impulses",
        "approach_speed", "energy_lost", "status",
    )} | {"after": many.ball_after, "slopes": _slopes(many)}  # fmt: skip


def _slopes(many):
    return None if many.slopes is None else {
        name: getattr(many.slopes, name) for name in vars(many.slopes)
    }  # fmt: skip


def collision(**more):
    hit = kd.collide(POSTURE, V, BALL, kd.Contact((2, 0.3, 1), 0.7, 0.1), **{**MOVING, **more})
    times = np.linspace(0, hit.contact_time, 5)
    return {"hit": hit, "during": [hit.sample(t) for t in times[1:-1]]}


def loads(hit):
    return kd.joint_loads(hit, 0.01)


def both_engines(name):
    one = kd.strike(*on_leg(name), "newton", **MOVING)
    posture, v, ball, contact = on_leg(name, 0.0)
    other = kd.strike(posture, v, ball, contact, engine="pinocchio", **MOVING)
    return {"closed form": one, "pinocchio": other, "loads": loads(one)}


def sensitivities(name):
    hit = kd.strike(*(KINDS[name] if name in KINDS else on_leg(name)), **MOVING)
    slopes = hit.sensitivity()
    return {
        "slopes": slopes,
        "html": slopes._repr_html_(),
        "without leg": hit.sensitivity(of_leg=False),
    }


def drives():
    leg = HUMAN.with_stiff_joints("ankle").with_armature({"hip": 0.05, "knee": 0.02})
    hit = kd.strike(leg.posture(POSTURE.q), V, BALL, STICKY, **MOVING)
    stiff = HUMAN.with_drives(
        {
            "hip": kd.Drive(1e-4, 80, 100, 12, 0.5, 800.0),
            "kn*": kd.Drive(2e-4, 50, 90, 20, 0.2, 500.0),
        }
    )
    soft = kd.collide(stiff.posture(POSTURE.q), V, BALL, STICKY, contact_time=0.009, **MOVING)
    return {
        "hit": hit, "loads": loads(hit), "figure": hit.plot(), "stiff": stiff, "soft": soft,
        "limits": stiff.posture(POSTURE.q).effective_mass_limits(CONTACT.normal),
        "unlimited": kd.strike(stiff.posture(POSTURE.q), V, BALL, CONTACT, **MOVING),
    }  # fmt: skip


CASES = {
    **{
        f"{name}, {law}": (lambda name=name, law=law: struck(name, law))
        for name in KINDS
        for law in ("newton", "stronge", "paper")
        if law != "paper" or name in ("slips", "frictionless")
    },
    **{f"uncertainty, {name}": (lambda name=name: spread(struck(name))) for name in KINDS},
    **{
        f"slopes, {name}": (lambda name=name: sensitivities(name))
        for name in (
            "slips",
            "sticks",
            "restitution by speed",
            "run-up",
            "fourbar",
            "bolt",
            "mimic",
        )
    },
    **{
        f"leg {name}": (lambda name=name: both_engines(name))
        for name in (
            "testbed",
            "fourbar",
            "run-up",
            "bolt",
            "g1",
            "human 3d",
            "held",
            "mjcf",
            "mimic",
        )
    },
    **{
        f"leg {name}, stronge": (lambda name=name: kd.strike(*on_leg(name), "stronge", **MOVING))
        for name in ("fourbar", "g1", "human 3d")
    },
    "plot": lambda: struck("slips").plot(),
    "plot with deviations": lambda: struck("slips").plot(q=0.02, v=0.3, friction=0.05),
    "of an immovable obstacle": lambda: kd.strike(
        POSTURE, V, kd.Ball(math.inf, 0.105), kd.Contact((2, 0.3, 1), 0.7, 0.1)
    ),
    "moving base": lambda: kd.strike(*on_leg("run-up")),
    "loads": lambda: loads(struck("sticks")),
    "batch": batch,
    "batch by stronge": lambda: batch(law="stronge"),
    "batch with slopes": lambda: batch(slopes=True),
    "batch of a robot": lambda: (
        kd.strike_many(
            g1(),
            np.zeros((3, g1().nq)) + 0.1,
            np.full((3, g1().nv), 0.5) * [[1], [2], [3]],
            BALL,
            kd.Contact((1, 0.1, 0.2), 0.7, 0.3),
        ).joint_impulses
    ),
    "on one foot": lambda: kd.unilateral_strike(*unilateral(), **MOVING),
    "on one slippery foot": lambda: kd.unilateral_strike(*unilateral(0.05, (4, 0, 0.3)), **MOVING),
    "on one foot, down": lambda: kd.unilateral_strike(*unilateral(0.6, (1, 0.2, -4)), **MOVING),
    "on one foot, instep": lambda: kd.unilateral_strike(
        *unilateral(offset=(0.05, 0.01, 0.02)), **MOVING
    ),
    "on one foot, held": lambda: kd.strike(*unilateral(), **MOVING),
    "on one foot, held, sliding": lambda: kd.strike(*unilateral(0.1), **MOVING).footing,
    "on two feet": two_feet,
    "drives": drives,
    "in time": collision,
    "in time, stiffness": lambda: collision(stiffness=4e5),
    "in time, stiffer": lambda: collision(contact_time=0.006),
    "in time, pressure": lambda: collision(stiffness="pressure"),
    "in time, torque": lambda: collision(torque=(30.0, -20.0, 5.0)),
    "in time, torque by state": lambda: collision(torque=lambda t, q, v: -2.0 * v),
    "in time, run-up": lambda: kd.collide(
        HUMAN.with_base_velocity((3.0, 0.0, 0.4)).posture(POSTURE.q), V, BALL, CONTACT, **MOVING
    ),
    "in time, turning": lambda: kd.collide(*on_leg("run-up"), contact_time=0.01, **MOVING),
    "in time, 3d": lambda: kd.collide(*on_leg("human 3d"), contact_time=0.01, **MOVING),
    "in time, held": lambda: kd.collide(*on_leg("held"), contact_time=0.01, tol=1e-7, **MOVING),
    "pressed flat": lambda: kd.collide(POSTURE, V, BALL, CONTACT, stiffness=2e3),
    "force model": lambda: {
        "model": kd.ForceModel(4e5, 0.7),
        "force": [kd.ForceModel(4e5, 0.7).force(x) for x in (0.001, 0.01)],
        "stored": kd.ForceModel(4e5, 0.7).stored(0.01),
        "returned": kd.ForceModel(4e5, 0.7).returned(0.008, 0.01),
        "separation": kd.ForceModel(4e5, 0.7).separation(0.01),
        "stiffness": [
            kd.contact_stiffness(0.01, 0.4, 12.0),
            kd.contact_stiffness(0.01, 0.4, 12.0, 0.6),
        ],
    },
    "one formula": lambda: [normal_impulse(12.0, 0.7, 2.5, 0.4), normal_impulse(12.0, 0.7, 2.5)],
    "joined": lambda: pinocchio_engine.joined_state(
        kd.strike(*on_leg("run-up"), **MOVING).approach
    ),
    "flight of it": lambda: kd.fly(struck("slips").ball_after, BALL, AIR),
}
LOOSE = {"in time, held": 1e-5, **{f"in time{x}": 1e-6 for x in ("", ", pressure")}}
