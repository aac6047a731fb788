"""What a scene file may contain: sections, keys, and the values that each key takes.

Keys end in their unit; those without one are dimensionless, or names. Vectors are `[x, y, z]` in
the world frame.
"""

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, NamedTuple

from kickdyn.aerodynamics import coefficient_model, drag, lift, spin_decay
from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.errors import InvalidInput, SceneError
from kickdyn.ground import SURFACES
from kickdyn.impact.force_model import Dissipation
from kickdyn.impact.laws import LAWS
from kickdyn.plane import ReachedBy
from kickdyn.restitution import MODELS as RESTITUTIONS
from kickdyn.restitution import Restitution, checked_restitution
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.descriptions import DESCRIPTION
from kickdyn.scene.scene import compliant_contact_faults

Check = Callable[[str, Any], Any]

REQUIRED = ("leg", "posture", "contact")


class Kind(NamedTuple):
    """A kind of value.

    Attributes:
        takes: what it is, for the reader of `docs/reference/scene-file.md`.
        check: returns a valid value of a name, or raises `InvalidInput`.
    """

    takes: str
    check: Check


class Key(NamedTuple):
    """A key of a section.

    Attributes:
        kind: of its value.
        meaning: of the key, and what holds without it, for the reader of
            `docs/reference/scene-file.md`.
    """

    kind: Kind
    meaning: str


def _of_unit(unit: str) -> str:
    """Return a unit in brackets after a blank, or nothing."""
    return f" [{unit}]" if unit else ""


def _number(unit: str = "", **limits: Any) -> Kind:
    """Return numbers within limits, which are those of `validation.number`."""
    finite = {name: limit for name, limit in limits.items() if math.isfinite(limit)}
    words = " and ".join(f"{name.replace('_', ' ')} {limit:g}" for name, limit in finite.items())
    check = partial(validation.number, unit=unit, **limits)
    return Kind(", ".join(filter(None, ["number", words])) + _of_unit(unit), check)


def _vector(unit: str) -> Kind:
    """Return vectors."""
    return Kind(f"vector{_of_unit(unit)}", partial(_check_vector, unit=unit))


def _check_vector(name: str, value: Any, unit: str = "") -> Any:
    """Return a list of three numbers."""
    if not isinstance(value, list) or len(value) != 3:
        raise InvalidInput(
            f"{name} is {validation.brief(value)}: it must be three numbers, [x, y, z]"
            f"{_of_unit(unit)}"
        )
    return validation.vector(name, value, 3, unit=unit)


def _check_direction(name: str, value: Any) -> Any:
    """Return a vector of any length but zero."""
    vector = _check_vector(name, value)
    validation.direction(name, vector)
    return vector


def _choice(*choices: str) -> Kind:
    """Return some names."""
    return Kind(_quoted(choices), _name_of(choices))


def _name_of(choices: Iterable[str], alternative: str = "") -> Check:
    """Return a check that a value is one of some names; its message names the nearest."""
    known = list(choices)

    def check(name: str, value: Any) -> Any:
        """Return the name."""
        if not (isinstance(value, str) and value in known):
            raise InvalidInput(
                f"{name} is {validation.brief(value)}: {_advice(value, known, alternative)}"
            )
        return value

    return check


def _quoted(names: Iterable[str]) -> str:
    """Return names in quotes, as code."""
    return ", ".join(f'`"{name}"`' for name in names)


def _coefficient(kind: str, models: Mapping[str, Any]) -> Kind:
    """Return names of models, and coefficients that are the same everywhere."""
    number = _number(**coefficient_model.constant_limits(kind))
    name = _name_of(models, ", or a number")

    def check(key: str, value: Any) -> Any:
        """Return a name or a number that is valid."""
        return name(key, value) if isinstance(value, str | bool) else number.check(key, value)

    return Kind(f"{number.takes}, or {_quoted(models)}", check)


def _valid(condition: Callable[[Any], bool], advice: str) -> Check:
    """Return a check of a condition; its message ends in the advice."""

    def check(name: str, value: Any) -> Any:
        """Return a value that meets the condition."""
        if not condition(value):
            raise InvalidInput(f"{name} is {validation.brief(value)}: {advice}")
        return value

    return check


def _by_joint(unit: str, **limits: float) -> Kind:
    """Return tables of numbers by joint."""
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

    return Kind(f"table, joint = {_number(unit, **limits).takes}", check)


def _is_list(value: Any, is_item: Callable[[Any], bool]) -> bool:
    """Return whether a value is a list of at most 100 such items."""
    return isinstance(value, list) and len(value) <= 100 and all(map(is_item, value))


def _is_pair(value: Any) -> bool:
    """Return whether a value is a list of two names."""
    return isinstance(value, list) and len(value) == 2 and all(isinstance(v, str) for v in value)


def _check_pressure(name: str, value: Any) -> float:
    """Return a gauge pressure [Pa] that a ball can have."""
    try:
        return float(Ball(pressure=value).pressure or 0.0)
    except InvalidInput as error:
        raise InvalidInput(str(error).replace("ball pressure", name, 1)) from None


def _check_restitution(name: str, value: Any) -> Restitution:
    """Return a number, a table of rows (speed, e) or the name of a model."""
    try:
        return checked_restitution(value)
    except InvalidInput as error:
        raise InvalidInput(str(error).replace("restitution", name, 1)) from None


_text = Kind(
    "text",
    _valid(
        lambda value: isinstance(value, str) and value != "" and value.isprintable(),
        "it must be printable text",
    ),
)
_texts = Kind(
    "list of names",
    _valid(
        lambda value: _is_list(value, lambda item: isinstance(item, str)),
        "it must be a list of names, at most 100",
    ),
)
_pairs = Kind(
    "list of pairs of names",
    _valid(
        lambda value: _is_list(value, _is_pair),
        "it must be a list of pairs of names, at most 100",
    ),
)
_robot = Kind(
    f'{_quoted(ROBOTS)}, or a name of robot_descriptions, `"NAME{DESCRIPTION}"`',
    _valid(
        lambda value: isinstance(value, str) and (value in ROBOTS or value.endswith(DESCRIPTION)),
        f"choose {', '.join(ROBOTS)}, or a name of robot_descriptions, NAME{DESCRIPTION}",
    ),
)
_direction = Kind("vector of any length but 0", _check_direction)
_pressure = Kind("number [Pa]", _check_pressure)
_restitution = Kind(
    f"number from 0 to 1, rows `[[speed, e], ...]` [m/s, 1], or {_quoted(RESTITUTIONS)}",
    _check_restitution,
)
_flag = Kind("`true` or `false`", _valid(lambda v: isinstance(v, bool), "it must be true or false"))

UNCERTAINTY = {
    "angles_deg": ("q", "deg", math.radians(1.0), "the angle of each joint"),
    "joint_velocity_rad_s": ("v", "rad/s", 1.0, "the velocity of each joint"),
    "normal_deg": ("normal", "deg", math.radians(1.0), "the direction of the contact normal"),
    "restitution": ("restitution", "", 1.0, "the coefficient of restitution"),
    "friction": ("friction", "", 1.0, "the coefficient of friction"),
    "ball_mass_kg": ("ball_mass", "kg", 1.0, "the mass of the ball"),
    "ball_radius_m": ("ball_radius", "m", 1.0, "the radius of the ball"),
    "ball_velocity_m_s": ("ball_velocity", "m/s", 1.0, "each component of the ball's velocity"),
    "ball_spin_rad_s": ("ball_spin", "rad/s", 1.0, "each component of the ball's spin"),
}
"""By key of section uncertainty: its name in `Impact.uncertainty`, its unit in the file, the
factor between the units, and what it is."""

SECTIONS: dict[str, dict[str, Key]] = {
    "": {"name": Key(_text, "of the scene; without it, that of the file")},
    "leg": {
        "model": Key(_choice("human", "testbed"), "a leg of kickdyn"),
        "file": Key(_text, "a URDF or MJCF file, relative to the folder of the scene"),
        "robot": Key(_robot, "a robot by name; needs the extra `robots` or `descriptions`"),
        "frame": Key(
            _text,
            "link, joint, body, site or geom whose origin strikes the ball; without it "
            "`toe`, or the foot of a `robot`",
        ),
        "base": Key(
            _choice("fixed", "floating"),
            "whether the root of the robot is fixed, as without this key, or moves freely",
        ),
        "package_dirs": Key(
            _texts, "folders in which the meshes of `file` are looked for, relative to the scene"
        ),
        "legs_only": Key(
            _flag,
            "whether to lock all joints of a `robot` but those of its legs; without it `false`",
        ),
        "locked": Key(_by_joint("deg; m"), "joints that are fixed, and where"),
        "supports": Key(
            _texts,
            "frames that are held in place during the impact, such as the foot on the ground",
        ),
        "loops": Key(_pairs, "pairs of frames that coincide, which closes a kinematic loop"),
        "stiff_joints": Key(_texts, "joints whose velocity does not change in the impact"),
        "armature_kg_m2": Key(
            _by_joint("kg m2", at_least=0.0), "inertia of the rotors, seen from the joint"
        ),
    },
    "posture": {
        "angles_deg": Key(_by_joint("deg"), "positions of joints that turn; 0 for those left out"),
        "positions_m": Key(_by_joint("m"), "positions of prismatic joints; 0 for those left out"),
        "foot_velocity_m_s": Key(
            _vector("m/s"),
            "of the contact point; the joint velocity is the one of least kinetic energy",
        ),
        "joint_velocity_rad_s": Key(
            _by_joint("rad/s"),
            "velocities of the joints, in m/s for prismatic ones; 0 for those left out",
        ),
    },
    "ball": {
        "model": Key(
            _choice("size-5", "paper"),
            "the ball whose values hold for the keys left out; without it a football of size 5",
        ),
        "mass_kg": Key(_number("kg", above=0.0), "mass"),
        "radius_m": Key(_number("m", above=0.0), "radius"),
        "inertia_factor": Key(
            _number(above=0.0, at_most=2.0 / 3.0),
            "moment of inertia over m r^2; 2/3 of a shell without it",
        ),
        "pressure_pa": Key(
            _pressure, "gauge pressure, from which `stiffness` of the contact follows"
        ),
        "velocity_m_s": Key(_vector("m/s"), "before the contact; 0 without it"),
        "spin_rad_s": Key(_vector("rad/s"), "before the contact; 0 without it"),
    },
    "contact": {
        "normal": Key(_direction, "from the foot into the ball"),
        "attack_deg": Key(
            _number("deg", at_least=-90.0, at_most=90.0),
            "angle of the normal above the horizontal, instead of `normal`",
        ),
        "side_deg": Key(
            _number("deg", at_least=-180.0, at_most=180.0),
            "angle of the normal to the left; 0 without it",
        ),
        "restitution": Key(_restitution, "coefficient of restitution e"),
        "friction": Key(
            _number(at_least=0.0), "coefficient of friction between foot and ball; 0 without it"
        ),
        "law": Key(_choice(*LAWS), "impact law of an instantaneous contact; without it `newton`"),
        "offset_m": Key(
            _vector("m"), "contact point in the axes of `frame`; without it its origin"
        ),
        "contact_time_s": Key(
            _number("s", above=0.0, at_most=0.1),
            "duration of a contact that takes time; without it and `stiffness` the "
            "contact is instantaneous",
        ),
        "stiffness": Key(
            _choice("pressure"),
            "stiffness of a contact that takes time, from the pressure of the ball, "
            "instead of `contact_time_s`",
        ),
        "dissipation": Key(
            _choice(*Dissipation),
            "how a contact that takes time loses energy; without it `walton-braun`",
        ),
    },
    "air": {
        "model": Key(
            _choice("standard", "paper"),
            "the standard atmosphere, as without this key, or the air of the paper",
        ),
        "altitude_m": Key(
            _number("m", at_least=-1000.0, at_most=11_000.0), "above the sea; 0 without it"
        ),
        "temperature_c": Key(
            _number("degC", at_least=-80.0, at_most=60.0),
            "without it that of the standard atmosphere",
        ),
        "pressure_pa": Key(_number("Pa", above=0.0), "without it that of the standard atmosphere"),
        "drag": Key(_coefficient("drag", drag.MODELS), "drag coefficient; no drag without it"),
        "lift": Key(_coefficient("lift", lift.MODELS), "lift coefficient; no lift without it"),
        "torque": Key(
            _coefficient("torque", spin_decay.MODELS),
            "coefficient of spin decay; constant spin without it",
        ),
        "wind_m_s": Key(_vector("m/s"), "velocity of the air; 0 without it"),
        "buoyancy": Key(_flag, "whether the weight of the displaced air acts; without it `false`"),
    },
    "ground": {
        "height_m": Key(
            _number("m"), "height of the ground; without it, directly under the ball at the contact"
        ),
        "surface": Key(
            _choice(*SURFACES),
            "with it, the ball bounces and rolls until it is at rest; without it, the "
            "path ends where the ball lands",
        ),
    },
    "plane": {
        "point_m": Key(_vector("m"), "a point of the plane"),
        "normal": Key(_direction, "normal of the plane, on the side from which the ball comes"),
        "reached_by": Key(
            _choice(*ReachedBy),
            "part of the ball that ends the path where it reaches the plane; without it `front`. "
            "An upright plane that is reached by `centre` or `back` is a goal line: a goal, "
            "7.32 m wide and 2.44 m high, stands around `point_m`",
        ),
    },
    "wall": {
        "distance_m": Key(
            _number("m", above=0.0),
            "from the ball along the line to `point_m` of the plane, on which the middle of a wall "
            "of players stands",
        ),
        "height_m": Key(_number("m", above=0.0), "height of the wall"),
        "width_m": Key(_number("m", above=0.0), "width of the wall; 2.5 without it"),
    },
    "uncertainty": {
        key: Key(_number(unit, at_least=0.0), f"standard deviation of {words}")
        for key, (_, unit, _, words) in UNCERTAINTY.items()
    },
}
"""By section and key, its kind of value and its meaning. Section "" is the top of the file."""

ONE_OF = {
    "leg": ("model", "file", "robot"),
    "posture": ("foot_velocity_m_s", "joint_velocity_rad_s"),
    "contact": ("normal", "attack_deg"),
}
"""Keys of which a section contains exactly one."""

NEEDED = {
    "contact": ("restitution",),
    "plane": ("point_m", "normal"),
    "wall": ("distance_m", "height_m"),
}
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
    contact, ball = (document.get(name) for name in ("contact", "ball"))
    by_pressure = isinstance(contact, dict) and contact.get("stiffness") == "pressure"
    if by_pressure and "pressure_pa" not in (ball if isinstance(ball, dict) else {}):
        missing.append(
            'ball.pressure_pa is missing: with contact.stiffness = "pressure" the stiffness of the '
            "contact follows from it"
        )
    if "wall" in document and "plane" not in document:
        missing.append(
            "section [plane] is missing: the wall stands on the line from the ball to the point_m "
            "of a plane"
        )
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
            valid[key] = SECTIONS[section][key].kind.check(name, value)
        except InvalidInput as error:
            faults += faults_of(error)
    choice, needed = ONE_OF.get(section, ()), NEEDED.get(section, ())
    named = [key for key in choice if key in content]
    if choice and len(named) != 1:
        which = " and ".join(named) or "none"
        faults.append(f"{section} has {which} of {', '.join(choice)}: it must have exactly one")
    faults += [f"{section}.{key} is missing" for key in needed if key not in content]
    faults += [
        f"{section}.{key} is given without {other}: it has a meaning only with {other}"
        for key, other in GOES_WITH.get(section, {}).items()
        if key in content and other not in content
    ]
    return faults + [f"{section}.{line}" for line in _clashes(section, valid)]


def _clashes(section: str, valid: dict[str, Any]) -> list[str]:
    """Return a line for each valid value that does not go with another."""
    if section == "contact":
        named = [key for key in ("contact_time_s", "stiffness") if key in valid]
        if not named:
            alone = "is given without contact_time_s or stiffness: it needs one of them"
            return [f"dissipation {alone}"] if "dissipation" in valid else []
        lines = compliant_contact_faults(valid.get("law", "newton"), valid.get("restitution", 1.0))
        both = "stiffness and contact_time_s are both given: leave one of them out"
        return lines + [both] * (len(named) > 1)
    if section == "air" and valid.get("model") == "paper":
        weather = (key for key in ("altitude_m", "temperature_c", "pressure_pa") if key in valid)
        why = "is given with model 'paper', whose air is fixed: leave one of them out"
        return [f"{key} {why}" for key in weather]
    return []


def faults_of(error: InvalidInput) -> list[str]:
    """Return the lines of an error, one for each fault."""
    return list(error.faults) if isinstance(error, SceneError) else [str(error)]


def _unknown(name: str, word: str, known: Iterable[str]) -> str:
    """Return the line for a word that is not known, with the nearest that is."""
    shown = name if len(name) <= 100 else name[:100] + "..."
    return f"{shown} is unknown: {_advice(word, list(known))}"


def _advice(word: Any, known: list[str], alternative: str = "") -> str:
    """Return the nearest of the known words as a question, or all of them to choose from."""
    near = difflib.get_close_matches(str(word)[:100], known, 1, 0.5)
    return f"did you mean {near[0]}?" if near else f"choose {', '.join(known)}{alternative}"
