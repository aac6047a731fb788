"""What a scene file may say: sections, keys, and what each takes.

Keys end in their unit; those without one are dimensionless, or names. Vectors are `[x, y, z]` in
the world frame.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from kickdyn.aerodynamics import drag, lift
from kickdyn.aerodynamics import spin_decay as torque
from kickdyn.core import validation
from kickdyn.errors import InvalidInput, SceneError
from kickdyn.ground import SURFACES
from kickdyn.robot.catalog import ROBOTS
from kickdyn.scene.scene import clash_of_time

Check = Callable[[str, Any], Any]

LAWS = ("newton", "stronge", "paper")
REQUIRED = ("leg", "posture", "contact")


def _number(unit: str = "", **limits: float) -> Check:
    return lambda name, value: validation.number(name, value, unit=unit, **limits)


def _vector(unit: str = "") -> Check:
    return lambda name, value: validation.vector(name, value, 3, unit=unit)


def _direction(name: str, value: Any) -> Any:
    validation.direction(name, value)
    return validation.vector(name, value, 3)


def _choice(*choices: str) -> Check:
    def check(name: str, value: Any) -> str:
        if not isinstance(value, str) or value not in choices:
            raise InvalidInput(f"{name} is {validation.brief(value)}: choose {', '.join(choices)}")
        return value

    return check


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str) or not value or not value.isprintable():
        raise InvalidInput(f"{name} is {validation.brief(value)}: it must be printable text")
    return value


def _texts(name: str, value: Any) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        raise InvalidInput(f"{name} is {validation.brief(value)}: it must be a list of names")
    return value


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise InvalidInput(f"{name} is {validation.brief(value)}: it must be true or false")
    return value


def _by_joint(unit: str, **limits: float) -> Check:
    def check(name: str, value: Any) -> dict[str, float]:
        if not isinstance(value, dict):
            raise InvalidInput(
                f"{name} is {validation.brief(value)}: it must be a table, joint = number [{unit}]"
            )
        found, faults = {}, []
        for joint, entry in value.items():
            try:
                found[joint] = validation.number(f"{name}.{joint}", entry, unit=unit, **limits)
            except InvalidInput as error:
                faults.append(str(error))
        if faults:
            raise SceneError(name, faults)
        return found

    return check


SECTIONS: dict[str, dict[str, Check]] = {
    "": {"name": _text},
    "leg": {
        "model": _choice("human", "testbed"),
        "file": _text,
        "robot": _choice(*ROBOTS),
        "frame": _text,
        "base": _choice("fixed", "floating"),
        "legs_only": _flag,
        "supports": _texts,
        "armature_kg_m2": _by_joint("kg m2", at_least=0.0),
    },
    "posture": {
        "angles_deg": _by_joint("deg"),
        "positions_m": _by_joint("m"),
        "foot_velocity_m_s": _vector("m/s"),
        "joint_velocity_rad_s": _by_joint("rad/s"),
    },
    "ball": {
        "model": _choice("size 5", "paper"),
        "mass_kg": _number("kg", above=0.0),
        "radius_m": _number("m", above=0.0),
        "inertia_factor": _number(above=0.0, at_most=2.0 / 3.0),
        "velocity_m_s": _vector("m/s"),
        "spin_rad_s": _vector("rad/s"),
    },
    "contact": {
        "normal": _direction,
        "attack_deg": _number("deg", at_least=-90.0, at_most=90.0),
        "side_deg": _number("deg", at_least=-180.0, at_most=180.0),
        "restitution": _number(at_least=0.0, at_most=1.0),
        "friction": _number(at_least=0.0),
        "law": _choice(*LAWS),
        "offset_m": _vector("m"),
        "contact_time_s": _number("s", above=0.0, at_most=0.1),
    },
    "air": {
        "model": _choice("standard", "paper"),
        "altitude_m": _number("m", at_least=-1000.0, at_most=11_000.0),
        "temperature_c": _number("degC", at_least=-80.0, at_most=60.0),
        "pressure_pa": _number("Pa", above=0.0),
        "drag": _choice(*drag.MODELS),
        "lift": _choice(*lift.MODELS),
        "torque": _choice(*torque.MODELS),
        "wind_m_s": _vector("m/s"),
        "buoyancy": _flag,
    },
    "ground": {"height_m": _number("m"), "surface": _choice(*SURFACES)},
    "plane": {
        "point_m": _vector("m"),
        "normal": _direction,
        "reached_by": _choice("front", "centre", "back"),
    },
    "uncertainty": {
        "angles_deg": _number("deg", at_least=0.0),
        "joint_velocity_rad_s": _number("rad/s", at_least=0.0),
        "normal_deg": _number("deg", at_least=0.0),
        "restitution": _number(at_least=0.0),
        "friction": _number(at_least=0.0),
        "ball_mass_kg": _number("kg", at_least=0.0),
        "ball_radius_m": _number("m", at_least=0.0),
        "ball_velocity_m_s": _number("m/s", at_least=0.0),
        "ball_spin_rad_s": _number("rad/s", at_least=0.0),
    },
}
"""By section and key, what a value is checked with. Section "" is the top of the file."""

SOURCES = {
    "angles_deg": ("q", math.radians(1.0)),
    "joint_velocity_rad_s": ("v", 1.0),
    "normal_deg": ("normal", math.radians(1.0)),
    "restitution": ("restitution", 1.0),
    "friction": ("friction", 1.0),
    "ball_mass_kg": ("ball_mass", 1.0),
    "ball_radius_m": ("ball_radius", 1.0),
    "ball_velocity_m_s": ("ball_velocity", 1.0),
    "ball_spin_rad_s": ("ball_spin", 1.0),
}
"""What a key of section uncertainty is called by `Impact.uncertainty`, and its unit there."""

ONE_OF = {
    "leg": ("model", "file", "robot"),
    "posture": ("foot_velocity_m_s", "joint_velocity_rad_s"),
    "contact": ("normal", "attack_deg"),
}
"""Of these, a section names exactly one."""

NEEDED = {"contact": ("restitution",), "plane": ("point_m", "normal")}

GOES_WITH = {("leg", "legs_only"): "robot", ("contact", "side_deg"): "attack_deg"}


def _known_air(said: dict[str, Any]) -> list[str]:
    if said.get("model") != "paper":
        return []
    weather = ("altitude_m", "temperature_c", "pressure_pa")
    known = [key for key in weather if key in said]
    return [f"{key} is named with model 'paper', whose air is known: leave it out" for key in known]


CLASHES: dict[str, Callable[[dict[str, Any]], list[str]]] = {
    "air": _known_air,
    "contact": lambda said: (
        clash_of_time(said.get("law", "newton"), said.get("restitution", 1.0))
        if "contact_time_s" in said
        else []
    ),
}
"""By section, a line for each valid value that does not go with another."""

Values = dict[str, dict[str, Any]]


def checked(document: Mapping[str, Any]) -> tuple[Values, dict[str, list[str]]]:
    """Return the valid values of each section that is named, and by section a line per fault."""
    values: Values = {"": {}}
    faults: dict[str, list[str]] = {name: [] for name in ("", *SECTIONS)}
    for name, content in document.items():
        if name in SECTIONS[""]:
            values[""] |= _section("", {name: content}, faults[""])
        elif name not in SECTIONS:
            names = [*(known for known in SECTIONS if known), *SECTIONS[""]]
            kind = f"section [{name}]" if isinstance(content, dict) else name
            faults[""].append(_unknown(kind, name, names))
        elif not isinstance(content, dict):
            said = validation.brief(content)
            faults[name].append(f"{name} is {said}: it must be a section, [{name}]")
        else:
            values[name] = _section(name, content, faults[name])
    for name in REQUIRED:
        if name not in document:
            faults[name].append(f"section [{name}] is missing")
    return values, faults


def _section(section: str, content: dict[str, Any], faults: list[str]) -> dict[str, Any]:
    found = {}
    for key, value in content.items():
        name = f"{section}.{key}" if section else key
        if key not in SECTIONS[section]:
            faults.append(_unknown(name, key, SECTIONS[section]))
            continue
        try:
            found[key] = SECTIONS[section][key](name, value)
        except InvalidInput as error:
            faults += faults_of(error)
    choice = ONE_OF.get(section, ())
    named = [key for key in choice if key in content]
    if choice and len(named) != 1:
        said = " and ".join(named) or "none of them"
        faults.append(f"{section} names {said}: it must name one of {', '.join(choice)}")
    faults += [
        f"{section}.{key} is missing" for key in NEEDED.get(section, ()) if key not in content
    ]
    faults += [
        f"{section}.{key} is named without {other}: it goes with that"
        for (place, key), other in GOES_WITH.items()
        if place == section and key in content and other not in content
    ]
    if section in CLASHES:
        faults += [f"{section}.{line}" for line in CLASHES[section](found)]
    return found


def unusable(document: Mapping[str, Any], values: Values) -> set[str]:
    """Return what nothing can stand on, as `section.key`: bad, not clear, or needed and missing."""
    bad = set()
    for section in SECTIONS:
        content, valid = document.get(section), values.get(section, {})
        keys = [key for key in content if key not in valid] if isinstance(content, dict) else []
        if content is not None or section in REQUIRED:
            missing = [key for key in NEEDED.get(section, ()) if key not in valid]
            choice = ONE_OF.get(section, ())
            keys += [*missing, *(choice if sum(key in valid for key in choice) != 1 else ())]
        bad |= {f"{section}.{key}" for key in keys}
    return bad


def faults_of(error: InvalidInput) -> list[str]:
    """Return the lines of an error, one for each fault."""
    return list(error.faults) if isinstance(error, SceneError) else [str(error)]


def _unknown(name: str, word: str, known: Iterable[str]) -> str:
    """Return the line for a word that is not known, with the nearest that is."""
    known = list(known)
    near = difflib.get_close_matches(word, known, 1, 0.5)
    hint = f"did you mean {near[0]}?" if near else f"choose {', '.join(known)}"
    return f"{name} is unknown: {hint}"
