"""What a scene file may contain: sections, keys, and the values that each key takes.

Keys end in their unit; those without one are dimensionless, or names. Vectors are `[x, y, z]` in
the world frame.
"""

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from kickdyn.aerodynamics import coefficient_model, drag, lift, spin_decay
from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.errors import InvalidInput, SceneError
from kickdyn.ground import SURFACES
from kickdyn.impact.force_model import Dissipation
from kickdyn.impact.laws import ImpactLaw
from kickdyn.plane import ReachedBy
from kickdyn.restitution import Restitution, checked_restitution
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.descriptions import DESCRIPTION
from kickdyn.scene.scene import compliant_contact_faults

Check = Callable[[str, Any], Any]

REQUIRED = ("leg", "posture", "contact")


def _number(unit: str = "", **limits: Any) -> Check:
    """Return a check of a number within limits."""
    return partial(validation.number, unit=unit, **limits)


def _vector(unit: str) -> Check:
    """Return a check of a vector."""
    return partial(validation.vector, size=3, unit=unit)


def _direction(name: str, value: Any) -> Any:
    """Return a vector of any length but zero."""
    validation.direction(name, value)
    return validation.vector(name, value, 3)


def _choice(*choices: str) -> Check:
    """Return a check of one of some names."""
    known = f"choose {', '.join(choices)}"
    return _valid(lambda value: isinstance(value, str) and value in choices, known)


def _coefficient(kind: str, models: Mapping[str, Any]) -> Check:
    """Return a check of the name of a model, or of a coefficient that is the same everywhere."""
    number = _number(at_least=coefficient_model.least_value(kind))
    name = _valid(
        lambda value: isinstance(value, str) and value in models,
        f"choose {', '.join(models)}, or a number",
    )

    def check(key: str, value: Any) -> Any:
        """Return a name or a number that is valid."""
        return name(key, value) if isinstance(value, str | bool) else number(key, value)

    return check


def _valid(condition: Callable[[Any], bool], advice: str) -> Check:
    """Return a check of a condition; its message ends in the advice."""

    def check(name: str, value: Any) -> Any:
        """Return a value that meets the condition."""
        if not condition(value):
            raise InvalidInput(f"{name} is {validation.brief(value)}: {advice}")
        return value

    return check


def _by_joint(unit: str, **limits: float) -> Check:
    """Return a check of a table of numbers by joint."""
    advice = f"it must be a table, joint = number [{unit}]"
    is_table = _valid(lambda value: isinstance(value, dict), advice)

    def check(name: str, value: Any) -> dict[str, float]:
        """Return the numbers of a table by joint."""
        found, faults = {}, []
        for joint, entry in is_table(name, value).items():
            try:
                found[joint] = validation.number(f"{name}.{joint}", entry, unit=unit, **limits)
            except InvalidInput as error:
                faults.append(str(error))
        if faults:
            raise SceneError(name, faults)
        return found

    return check


_text = _valid(
    lambda value: isinstance(value, str) and value != "" and value.isprintable(),
    "it must be printable text",
)
_texts = _valid(
    lambda value: (
        isinstance(value, list) and len(value) <= 100 and all(isinstance(v, str) for v in value)
    ),
    "it must be a list of names, at most 100",
)
_pairs = _valid(
    lambda value: (
        isinstance(value, list)
        and len(value) <= 100
        and all(
            isinstance(pair, list) and len(pair) == 2 and all(isinstance(v, str) for v in pair)
            for pair in value
        )
    ),
    "it must be a list of pairs of names, at most 100",
)
_robot = _valid(
    lambda value: isinstance(value, str) and (value in ROBOTS or value.endswith(DESCRIPTION)),
    f"choose {', '.join(ROBOTS)}, or a name of robot_descriptions, NAME{DESCRIPTION}",
)


def _pressure(name: str, value: Any) -> float:
    """Return a gauge pressure [Pa] that a ball can have."""
    try:
        return float(Ball(pressure=value).pressure or 0.0)
    except InvalidInput as error:
        raise InvalidInput(str(error).replace("ball pressure", name, 1)) from None


def _restitution(name: str, value: Any) -> Restitution:
    """Return a number, a table of rows (speed, e) or the name of a model."""
    try:
        return checked_restitution(value)
    except InvalidInput as error:
        raise InvalidInput(str(error).replace("restitution", name, 1)) from None


_flag = _valid(lambda value: isinstance(value, bool), "it must be true or false")

UNCERTAINTY = {
    "angles_deg": ("q", "deg", math.radians(1.0)),
    "joint_velocity_rad_s": ("v", "rad/s", 1.0),
    "normal_deg": ("normal", "deg", math.radians(1.0)),
    "restitution": ("restitution", "", 1.0),
    "friction": ("friction", "", 1.0),
    "ball_mass_kg": ("ball_mass", "kg", 1.0),
    "ball_radius_m": ("ball_radius", "m", 1.0),
    "ball_velocity_m_s": ("ball_velocity", "m/s", 1.0),
    "ball_spin_rad_s": ("ball_spin", "rad/s", 1.0),
}
"""By key of section uncertainty: its name in `Impact.uncertainty`, its unit in the file, and the
factor between the units."""

SECTIONS: dict[str, dict[str, Check]] = {
    "": {"name": _text},
    "leg": {
        "model": _choice("human", "testbed"),
        "file": _text,
        "robot": _robot,
        "frame": _text,
        "base": _choice("fixed", "floating"),
        "package_dirs": _texts,
        "legs_only": _flag,
        "locked": _by_joint("deg; m"),
        "supports": _texts,
        "loops": _pairs,
        "stiff_joints": _texts,
        "armature_kg_m2": _by_joint("kg m2", at_least=0.0),
    },
    "posture": {
        "angles_deg": _by_joint("deg"),
        "positions_m": _by_joint("m"),
        "foot_velocity_m_s": _vector("m/s"),
        "joint_velocity_rad_s": _by_joint("rad/s"),
    },
    "ball": {
        "model": _choice("size-5", "paper"),
        "mass_kg": _number("kg", above=0.0),
        "radius_m": _number("m", above=0.0),
        "inertia_factor": _number(above=0.0, at_most=2.0 / 3.0),
        "pressure_pa": _pressure,
        "velocity_m_s": _vector("m/s"),
        "spin_rad_s": _vector("rad/s"),
    },
    "contact": {
        "normal": _direction,
        "attack_deg": _number("deg", at_least=-90.0, at_most=90.0),
        "side_deg": _number("deg", at_least=-180.0, at_most=180.0),
        "restitution": _restitution,
        "friction": _number(at_least=0.0),
        "law": _choice(*ImpactLaw),
        "offset_m": _vector("m"),
        "contact_time_s": _number("s", above=0.0, at_most=0.1),
        "stiffness": _choice("pressure"),
        "dissipation": _choice(*Dissipation),
    },
    "air": {
        "model": _choice("standard", "paper"),
        "altitude_m": _number("m", at_least=-1000.0, at_most=11_000.0),
        "temperature_c": _number("degC", at_least=-80.0, at_most=60.0),
        "pressure_pa": _number("Pa", above=0.0),
        "drag": _coefficient("drag", drag.MODELS),
        "lift": _coefficient("lift", lift.MODELS),
        "torque": _coefficient("torque", spin_decay.MODELS),
        "wind_m_s": _vector("m/s"),
        "buoyancy": _flag,
    },
    "ground": {"height_m": _number("m"), "surface": _choice(*SURFACES)},
    "plane": {
        "point_m": _vector("m"),
        "normal": _direction,
        "reached_by": _choice(*ReachedBy),
    },
    "uncertainty": {key: _number(unit, at_least=0.0) for key, (_, unit, _) in UNCERTAINTY.items()},
}
"""By section and key, the check of a value. Section "" is the top of the file."""

ONE_OF = {
    "leg": ("model", "file", "robot"),
    "posture": ("foot_velocity_m_s", "joint_velocity_rad_s"),
    "contact": ("normal", "attack_deg"),
}
"""Keys of which a section contains exactly one."""

NEEDED = {"contact": ("restitution",), "plane": ("point_m", "normal")}
"""Keys without which a section is not complete."""

GOES_WITH = {
    "leg": {"legs_only": "robot", "package_dirs": "file"},
    "contact": {"side_deg": "attack_deg"},
}
"""By section and key, another key that it has a meaning with only."""


def check_document(document: Mapping[str, Any]) -> list[str]:
    """Return a line for each fault of a TOML document's form: unknown, missing or invalid values.

    What only the robot can tell, such as the names of its joints, is not checked.
    """
    faults = []
    for name, content in document.items():
        if name in SECTIONS[""]:
            faults += _check_section("", {name: content})
        elif name not in SECTIONS:
            names = [*(known for known in SECTIONS if known), *SECTIONS[""]]
            kind = f"section [{name}]" if isinstance(content, dict) else name
            faults.append(_unknown(kind, name, names))
        elif not isinstance(content, dict):
            value = validation.brief(content)
            faults.append(f"{name} is {value}: it must be a section, [{name}]")
        else:
            faults += _check_section(name, content)
    missing = [f"section [{name}] is missing" for name in REQUIRED if name not in document]
    return faults + missing


def _check_section(section: str, content: dict[str, Any]) -> list[str]:
    """Return a line for each fault of a section."""
    faults, valid = [], {}
    for key, value in content.items():
        name = f"{section}.{key}" if section else key
        if key not in SECTIONS[section]:
            faults.append(_unknown(name, key, SECTIONS[section]))
            continue
        try:
            valid[key] = SECTIONS[section][key](name, value)
        except InvalidInput as error:
            faults += faults_of(error)
    choice, needed = ONE_OF.get(section, ()), NEEDED.get(section, ())
    named = [key for key in choice if key in content]
    if choice and len(named) != 1:
        which = " and ".join(named) or "none"
        faults.append(f"{section} names {which} of {', '.join(choice)}: it must name one")
    faults += [f"{section}.{key} is missing" for key in needed if key not in content]
    faults += [
        f"{section}.{key} is named without {other}: it goes with that"
        for key, other in GOES_WITH.get(section, {}).items()
        if key in content and other not in content
    ]
    return faults + [f"{section}.{line}" for line in _clashes(section, valid)]


def _clashes(section: str, valid: dict[str, Any]) -> list[str]:
    """Return a line for each valid value that does not go with another."""
    if section == "contact":
        named = [key for key in ("contact_time_s", "stiffness") if key in valid]
        if not named:
            alone = "is named without contact_time_s or stiffness: it goes with one of them"
            return [f"dissipation {alone}"] if "dissipation" in valid else []
        law = ImpactLaw(valid.get("law", "newton"))
        lines = compliant_contact_faults(law, valid.get("restitution", 1.0))
        both = "stiffness is named beside contact_time_s: leave one of them out"
        return lines + [both] * (len(named) > 1)
    if section == "air" and valid.get("model") == "paper":
        weather = (key for key in ("altitude_m", "temperature_c", "pressure_pa") if key in valid)
        why = "is named with model 'paper', whose air is known: leave it out"
        return [f"{key} {why}" for key in weather]
    return []


def faults_of(error: InvalidInput) -> list[str]:
    """Return the lines of an error, one for each fault."""
    return list(error.faults) if isinstance(error, SceneError) else [str(error)]


def _unknown(name: str, word: str, known: Iterable[str]) -> str:
    """Return the line for a word that is not known, with the nearest that is."""
    known = list(known)
    near = difflib.get_close_matches(word[:100], known, 1, 0.5)
    hint = f"did you mean {near[0]}?" if near else f"choose {', '.join(known)}"
    return f"{name if len(name) <= 100 else name[:100] + '...'} is unknown: {hint}"
