"""What a sweep was made of: enough to compute the same again, and to tell it from others."""

from __future__ import annotations

import hashlib
from importlib import metadata
from typing import Any

import numpy as np

from kickdyn.air import Air
from kickdyn.flight.fingerprint import fingerprint
from kickdyn.leg import Leg
from kickdyn.sweep.grid import Grid
from kickdyn.sweep.kick import Kick
from kickdyn.version import __version__


def provenance(leg: Leg, kick: Kick) -> dict[str, str | float]:
    """Return what a sweep says of its leg and its kick, as plain values."""
    air = kick.air
    text = "" if leg.urdf is None else leg.urdf.text
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("pin", "numpy", "scipy"))
    return {
        "title": f"kicking postures of {leg.name}",
        "source": f"kickdyn {__version__} ({versions})",
        "leg": leg.name,
        "leg_sha256": _sha256(text.encode()) if text else "",
        "model_sha256": _sha256(_model(leg).encode()),
        "frame": leg.frame,
        "foot_speed_m_s": kick.speed,
        "attack_deg": round(float(np.degrees(kick.attack)), 10),
        "attack_rad": kick.attack,
        "restitution": kick.restitution,
        "friction": kick.friction,
        "impact_law": "newton",
        "ball_mass_kg": kick.ball.mass,
        "ball_radius_m": kick.ball.radius,
        "ball_inertia_factor": kick.ball.inertia_factor,
        "air": "none" if air is None else repr(air),
        "air_sha256": "" if air is None else _digest(air),
    }


def axes(grid: Grid) -> dict[str, list[Any]]:
    """Return of each axis of a grid its length, first and last value [rad; m], hash of all."""
    return {
        name: [len(values), float(values[0]), float(values[-1]), _sha256(values.tobytes())]
        for name, values in grid.axes.items()
    }


def _model(leg: Leg) -> str:
    """Return every number of a leg's model, and what holds it, as a text."""
    held = leg.constraints
    feet, loops = ([], []) if held is None else (held.supports, held.loops)
    return f"{leg.model.saveToString()} {[(s.frame, s.point) for s in feet]} {list(loops)}"


def _digest(air: Air) -> str:
    """Return a hash of all digits and functions; empty where a function is not plain Python."""
    wind = air.wind if callable(air.wind) else tuple(air.wind.tolist())
    numbers = (air.density, air.viscosity, air.buoyancy)
    return fingerprint((*numbers, wind, air.drag, air.lift, air.torque)) or ""


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
