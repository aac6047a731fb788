"""Reads a scene file: strict TOML, all faults of its form at once, then those of the robot."""

import math
import os
import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.files import read_text, shipped
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, SceneError, printable
from kickdyn.ground import Ground
from kickdyn.impact.force_model import Dissipation
from kickdyn.plane import Plane
from kickdyn.robot.leg import Leg
from kickdyn.robot.leg_file import read_leg, read_robot
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.scene.pitch import Wall
from kickdyn.scene.scene import Scene
from kickdyn.scene.schema import REQUIRED, UNCERTAINTY, check_document, faults_of

MAX_BYTES = 100_000
"""Size of the largest scene file that is read."""

MAX_DOTS = 1000
"""In a line of a scene file: each part of a dotted key is a table inside the one before."""

MAX_FAULTS = 100
"""Faults of a scene file that are listed."""


def load_scene(path: str | PathLike[str]) -> Scene:
    """Read a scene from a TOML file.

    Sections and keys are those of `kickdyn.scene.schema.SECTIONS`; a leg's file is looked for
    relative to the scene's folder. Aerodynamic effects act only if named: air without `drag` has
    none.

    Args:
        path: the file, at most `MAX_BYTES` long; or the name of a shipped scene, such as
            `free_kick`, where there is no such file.

    Raises:
        SceneError: with a line for each fault: all of the file's form (unknown, missing and invalid
            values), or, where there are none, those that only the robot shows.
        InvalidInput: `path` is no path at all.
    """
    try:
        file, source = Path(path), str(path)
    except TypeError:
        raise InvalidInput(f"scene path is {path!r}: it must be a str or a Path") from None
    file = _named(file, source)
    text = read_text(file, source, MAX_BYTES, SceneError)
    if max(line.count(".") for line in text.split("\n")) > MAX_DOTS:  # of a key's nested tables
        raise SceneError(source, [f"has more than {MAX_DOTS} dots in a line"])
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: an endless integer, too
        raise SceneError(source, [f"is not TOML: {error}{_line_of(text, error)}"]) from None
    faults = check_document(document)
    try:
        if not faults:
            return _scene(document, file.resolve().parent, file.stem)
    except InvalidInput as error:
        faults = faults_of(error)
    more = len(faults) - MAX_FAULTS
    raise SceneError(source, faults if more <= 0 else [*faults[:-more], f"and {more} more faults"])


def _line_of(text: str, error: Exception) -> str:
    """Return the line of a TOML text that an error names, and what is often wrong; or nothing."""
    place = re.search(r"at line (\d+)", str(error))
    if place is None:
        return ""
    line = validation.brief(text.split("\n")[int(place[1]) - 1].strip())
    return (
        f": {line}; keys are written as key = value, each once in a section, text in quotes, and "
        "numbers with a decimal point"
    )


def _named(file: Path, source: str) -> Path:
    """Return the file of a shipped scene where one is named, else the file."""
    if file.name != source or file.suffix or os.path.lexists(file):
        return file
    known = {scene.stem: scene for scene in sorted(shipped("scenes").glob("*.toml"))}
    if source not in known:
        line = f"is neither a file nor a scene of kickdyn: choose {', '.join(known)}"
        raise SceneError(source, [line])
    return known[source]


def _scene(document: dict[str, Any], folder: Path, stem: str) -> Scene:
    """Return the scene of a document of the right form; `stem` names one without a name."""
    at_leg, posture, at_contact = (document[name] for name in REQUIRED)
    at_ball = document.get("ball", {})
    with _faults_in("leg"):
        leg = _leg(at_leg, folder)
    _check_joints(leg, document)
    with _faults_in("leg"):
        if "armature_kg_m2" in at_leg:
            leg = leg.with_armature(at_leg["armature_kg_m2"])
        if "supports" in at_leg:
            leg = leg.with_supports(*at_leg["supports"])
        if "loops" in at_leg:
            leg = leg.with_loops(*at_leg["loops"])
        if "stiff_joints" in at_leg:
            leg = leg.with_stiff_joints(*at_leg["stiff_joints"])
    with _faults_in("posture"):
        degrees, metres = (posture.get(key, {}) for key in ("angles_deg", "positions_m"))
        angles = {joint: math.radians(angle) for joint, angle in degrees.items()}
        named = angles | metres
        q = leg.close_loops(leg.configuration(named), keep=named)
        contact, ball = _contact(at_contact), _ball(at_ball)
        scene = Scene(
            leg,
            q,
            _joint_velocity(posture, leg, q, contact),
            ball,
            contact,
            law=at_contact.get("law", "newton"),
            contact_time=at_contact.get("contact_time_s"),
            stiffness=at_contact.get("stiffness"),
            dissipation=at_contact.get("dissipation", Dissipation.WALTON_BRAUN),
            ball_velocity=at_ball.get("velocity_m_s", (0.0, 0.0, 0.0)),
            ball_spin=at_ball.get("spin_rad_s", (0.0, 0.0, 0.0)),
            air=_air(document["air"]) if "air" in document else None,
            plane=_plane(document["plane"]) if "plane" in document else None,
            wall=_wall(document["wall"]) if "wall" in document else None,
            uncertainty={
                UNCERTAINTY[key][0]: UNCERTAINTY[key][2] * value
                for key, value in document.get("uncertainty", {}).items()
            },
            name=document.get("name", printable(stem)),
        )
    if "ground" not in document:
        return scene
    under_ball = float(scene.ball_position[2]) - ball.radius
    ground = document["ground"]
    height = ground.get("height_m", under_ball)
    if height > under_ball + 1e-6 * ball.radius:
        raise InvalidInput(
            f"ground.height_m is {height:g}: the ball would start {height - under_ball:.3g} m "
            f"inside the ground; it must be at most {under_ball:.6g} m, or left out"
        )
    return scene.replace(ground=Ground(height, ground.get("surface")))


@contextmanager
def _faults_in(section: str) -> Iterator[None]:
    """Name the section in the faults that are found inside."""
    try:
        yield
    except InvalidInput as error:
        lines = [f"{section}: {line}" for line in faults_of(error)]
        raise SceneError(section, lines) from None


def _leg(section: dict[str, Any], folder: Path) -> Leg:
    """Return the leg, without what is added to it."""
    base, frame = section.get("base", "fixed"), section.get("frame")
    locked = section.get("locked")
    if "robot" in section:
        only = section.get("legs_only", False)
        return read_robot(section["robot"], frame, base, legs_only=only, locked=locked)
    if "model" in section:
        path = shipped_urdf(f"leg_{section['model']}.urdf")
        return read_leg(path, frame or "toe", base, locked=locked)
    packages = [folder / each for each in section.get("package_dirs", ())]
    return read_leg(folder / section["file"], frame or "toe", base, packages, locked)


def _check_joints(leg: Leg, document: dict[str, Any]) -> None:
    """Raise `SceneError` with a line for every joint that cannot take its value."""
    faults = []
    for section, key, unit in (
        ("leg", "armature_kg_m2", ""),
        ("posture", "angles_deg", "rad"),
        ("posture", "positions_m", "m"),
        ("posture", "joint_velocity_rad_s", ""),
    ):
        for joint in document[section].get(key, {}):
            try:
                moves_in = leg.joint_unit(joint)
                if unit and moves_in != unit:
                    faults.append(f"{section}: {key} names {joint}, which moves in {moves_in}")
            except InvalidInput as error:
                faults.append(f"{section}: {error}")
    if faults:
        raise SceneError("joints", faults)


def _joint_velocity(section: dict[str, Any], leg: Leg, q: Array, contact: Contact) -> Array:
    """Return v from the velocity of the contact point, or from those of joints."""
    if "foot_velocity_m_s" in section:
        posture = leg.posture(q).with_contact_offset(contact.offset)
        return posture.joint_velocity(section["foot_velocity_m_s"])
    v = np.zeros(leg.nv)
    for joint, speed in section["joint_velocity_rad_s"].items():
        v[leg.velocity_index(joint)] = speed
    return v


def _ball(section: dict[str, Any]) -> Ball:
    """Return the ball."""
    usual = Ball.paper() if section.get("model") == "paper" else Ball()
    return Ball(
        section.get("mass_kg", usual.mass),
        section.get("radius_m", usual.radius),
        section.get("inertia_factor", usual.inertia_factor),
        section.get("pressure_pa"),
    )


def _contact(section: dict[str, Any]) -> Contact:
    """Return the contact."""
    normal = section.get("normal")
    if normal is None:
        up, side = math.radians(section["attack_deg"]), math.radians(section.get("side_deg", 0.0))
        level = math.cos(up)
        normal = (level * math.cos(side), level * math.sin(side), math.sin(up))
    friction, offset = section.get("friction", 0.0), section.get("offset_m")
    return Contact(normal, section["restitution"], friction, offset)


def _air(section: dict[str, Any]) -> Air:
    """Return the air, without the effects that are not named."""
    weather = (section.get(key) for key in ("temperature_c", "pressure_pa"))
    if section.get("model") == "paper":
        here = Air.paper()
    else:
        here = Air.at(section.get("altitude_m", 0.0), *weather)
    models = {kind: section.get(kind) for kind in ("drag", "lift", "torque")}
    wind, buoyancy = section.get("wind_m_s", (0.0, 0.0, 0.0)), section.get("buoyancy", False)
    return Air(here.density, here.viscosity, wind, **models, buoyancy=buoyancy)


def _plane(section: dict[str, Any]) -> Plane:
    """Return the plane."""
    return Plane(section["point_m"], section["normal"], section.get("reached_by", "front"))


def _wall(section: dict[str, Any]) -> Wall:
    """Return the wall of players."""
    size = {key: section[f"{key}_m"] for key in ("height", "width") if f"{key}_m" in section}
    return Wall(section["distance_m"], **size)
