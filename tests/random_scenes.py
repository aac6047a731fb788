"""Random scenes: kicks of robots and people, in air or none, to every end of a path."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from kickdyn.aerodynamics import drag, lift
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.ground import Ground
from kickdyn.plane import Plane
from kickdyn.robot.leg import Leg
from kickdyn.scene.scene import Compliance, Scene

BALLS = (
    Ball(), Ball(0.2, 0.07), Ball(0.3, 0.09), Ball(0.05, 0.11), Ball(0.1, 0.2), Ball(0.02, 0.11)
)  # fmt: skip
"""Two of them a beach ball and a balloon."""


@lru_cache(maxsize=1)
def _legs() -> tuple[Leg, Leg]:
    return Leg.human(), Leg.testbed()


def random_scene(rng: np.random.Generator, **parts: Any) -> Scene:
    """Return a scene with a foot of 0.5 to 16 m/s; `parts` replace random ones.

    Half of the scenes have a contact that takes time.
    """
    leg = _legs()[rng.integers(2)]
    q = np.radians([rng.uniform(-20, 50), rng.uniform(5, 60), rng.uniform(-20, 40)])
    speed, up = math.exp(rng.uniform(math.log(0.5), math.log(16))), rng.uniform(0.1, 0.9)
    posture = leg.posture(q)
    v = posture.joint_velocity(speed * np.array([math.cos(up), 0.0, math.sin(up)]))
    tilt, side = up + rng.normal() * 0.15, rng.normal() * 0.1
    normal = [math.cos(tilt) * math.cos(side), math.cos(tilt) * math.sin(side), math.sin(tilt)]
    friction = rng.uniform(0.2, 0.6) if rng.random() < 0.8 else 0.0
    contact = Contact(normal, rng.uniform(0.5, 0.9), friction)
    ball = Ball() if rng.random() < 0.7 else Ball(0.2, 0.07)
    ball = parts.pop("ball", ball)
    moving = rng.random() < 0.2
    ball_velocity = rng.normal(size=3) * 0.5 * moving
    centre = posture.contact_point + ball.radius * contact.normal
    scene: dict[str, Any] = {
        "air": _air(rng) if rng.random() < 0.9 else None,
        "ground": _ground(rng, float(centre[2]) - ball.radius),
        "plane": None,
        "contact_time": rng.uniform(0.006, 0.012) if rng.random() < 0.5 else None,
        "incoming": BallState(velocity=ball_velocity, spin=rng.normal(size=3) * 10 * moving),
    }
    if scene["ground"] is not None and scene["ground"].surface is None and rng.random() < 0.3:
        scene["plane"] = Plane(centre + np.array([rng.uniform(0.5, 20), 0, 0]), (-1, 0, 0))
    scene |= parts
    time = scene.pop("contact_time")
    if time is not None:
        scene["law"] = Compliance(contact_time=time)
    return Scene(posture, v, ball, contact, **scene)


def wide_scene(rng: np.random.Generator) -> Scene:
    """Return a scene from a wider world: light balls, any drag and lift, planes by bouncing balls.

    Half have a contact that takes time, a third of these a brief one.
    """
    ball = BALLS[rng.integers(len(BALLS))]
    brief, time = rng.random() < 1 / 3, rng.uniform(0.004, 0.015)
    wind = rng.normal(size=3) * [5, 5, 0] if rng.random() < 0.5 else (0, 0, 0)
    drag_name, lift_name = (rng.choice(sorted(kind)) for kind in (drag.MODELS, lift.MODELS))
    air = Air(
        wind=wind,
        drag=str(drag_name) if rng.random() < 0.9 else None,
        lift=str(lift_name) if rng.random() < 0.6 else None,
        torque="smits-smith" if rng.random() < 0.4 else None,
        buoyancy=bool(rng.random() < 0.5),
    )
    takes_time, walled, away = rng.random() < 0.5, rng.random() < 0.3, rng.uniform(0.5, 15)
    scene = random_scene(
        rng,
        ball=ball,
        air=air if rng.random() < 0.95 else None,
        contact_time=(1e-2 * time if brief else time) if takes_time else None,
    )
    if not walled:
        return scene
    plane = Plane(scene.ball_position + np.array([away, 0, 0]), (-1, 0, 0))
    return scene.replace(plane=plane)


def _air(rng: np.random.Generator) -> Air:
    def named(name: str, share: float) -> str | None:
        return name if rng.random() < share else None

    wind = rng.normal(size=3) * [3, 3, 0] if rng.random() < 0.4 else (0, 0, 0)
    return Air(
        wind=wind,
        drag=named("brazuca", 0.9),
        lift=named("saturating", 0.7),
        torque=named("smits-smith", 0.4),
        buoyancy=bool(rng.random() < 0.5),
    )


def _ground(rng: np.random.Generator, below: float) -> Ground | None:
    kind = rng.random()
    if kind < 0.2:
        return None
    if kind < 0.75:
        return Ground(below - rng.uniform(0, 0.5) * (rng.random() < 0.5))
    return Ground(below, surface=("turf", "wet-grass", "carpet")[rng.integers(3)])
