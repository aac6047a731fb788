"""What a sweep was made of: enough to compute the same again, and to tell it from others."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from importlib import metadata
from typing import Any, TypeGuard

import numpy as np

from kickdyn._version import __version__
from kickdyn.air import Air
from kickdyn.flight.compiling import fingerprint
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.grid import DIGITS, Grid
from kickdyn.sweeps.kick import Kick

_HASHED = {
    "leg_sha256": "the text of its leg's URDF is not this one's",
    "model_sha256": "its leg's model is not this one's: masses, lengths, armature, what is locked "
    "or what holds it",
    "air_sha256": "its air is not this one's: digits that are not shown, or functions",
}
"""What to say where a hash differs, of which the digits say nothing."""


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


def difference(
    found: Mapping[str, Any], wanted: Mapping[str, Any], units: Mapping[str, str]
) -> str | None:
    """Return in words the first thing by which a sweep is another; None if there is none.

    Args:
        found: its provenance and the `axes` of its `grid`, as JSON has them.
        wanted: what they would have to be.
        units: of the joints that are wanted.
    """
    for name, value in wanted.items():
        there = found.get(name)
        if name == "grid" and _are_axes(there):
            if list(there) != list(value):  # the same joints in another order as well
                return f"its joints are {', '.join(there)}, this one's {', '.join(value)}"
            if said := [
                _axis(k, there[k], value[k], units[k]) for k in value if there[k] != value[k]
            ]:
                return "; ".join(said)
        elif there != value:
            return _HASHED.get(name, f"its {name} is {there!r}, this one's {value!r}")
    return None


def _are_axes(found: Any) -> TypeGuard[dict[str, list[Any]]]:
    """Return whether this is what `axes` gives; a store's attributes may be anything."""
    kinds = (int, int | float, int | float, str)
    return isinstance(found, dict) and all(
        isinstance(axis, list)
        and len(axis) == len(kinds)
        and all(isinstance(part, kind) for part, kind in zip(axis, kinds, strict=True))
        for axis in found.values()
    )


def _axis(name: str, there: Any, here: Any, unit: str) -> str:
    """Return how an axis differs from another."""
    (said, ends), (wanted, others) = (_span(each, unit) for each in (there, here))
    if ends == others and said != wanted:
        return f"{name} has {said} {ends} there, {wanted} here"
    if ends != others:
        return f"{name} has {said} {ends} there, {wanted} {others} here"
    return f"{name} has {said} {ends} there as here, but not the same ones"


def _span(axis: Any, unit: str) -> tuple[str, str]:
    count, low, high, _ = axis
    first, last = (
        f"{round(float(np.degrees(end)) if unit == 'rad' else end, DIGITS):.12g}"
        for end in (low, high)
    )
    shown = "deg" if unit == "rad" else unit
    if count == 1:
        return "1 value", f"of {first} {shown}"
    return f"{count} values", f"from {first} to {last} {shown}"


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
