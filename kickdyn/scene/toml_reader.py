"""Reads a scene file: strict TOML, all faults at once."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Callable, Iterable
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core.files import read_text, shipped
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, SceneError, printable
from kickdyn.ground import Ground
from kickdyn.plane import Plane
from kickdyn.robot.leg import Leg
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.scene.scene import Scene
from kickdyn.scene.schema import (
    UNCERTAINTY,
    FaultyValueError,
    SectionValues,
    check_document,
    faults_of,
)

MAX_BYTES = 100_000
"""Size of the largest scene file that is read."""

Made = TypeVar("Made")


def load_scene(path: str | PathLike[str]) -> Scene:
    """Read a scene from a TOML file.

    Sections and keys are those of `kickdyn.scene.schema.SECTIONS`; a leg's file is looked for
    relative to the scene's folder. Aerodynamic effects act only if named: air without `drag` has
    none.

    Args:
        path: the file, at most `MAX_BYTES` long; or the name of a shipped scene, such as
            `free_kick`, where there is no such file.

    Raises:
        SceneError: with all faults of the file, one line each.
        InvalidInput: `path` is no path at all.
    """
    try:
        file, source = Path(path), str(path)
    except TypeError:
        raise InvalidInput(f"scene path is {path!r}: it must be a str or a Path") from None
    file = _named(file, source)
    text = read_text(file, source, MAX_BYTES, SceneError)
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: an endless integer, too
        raise SceneError(source, [f"is not TOML: {error}"]) from None
    sections, faults = check_document(document)
    scene = _Builder(sections, faults, file.resolve().parent).scene(file.stem)
    if scene is None:
        raise SceneError(source, [line for lines in faults.values() for line in lines])
    return scene


def _named(file: Path, source: str) -> Path:
    """Return the file of a shipped scene where one is named, else the file."""
    if file.name != source or file.suffix or os.path.lexists(file):
        return file
    known = {scene.stem: scene for scene in sorted(shipped("scenes").glob("*.toml"))}
    if source not in known:
        line = f"is neither a file nor a scene of kickdyn: choose {', '.join(known)}"
        raise SceneError(source, [line])
    return known[source]


class _Builder:
    """Makes the parts of a scene, each by itself, so that the faults of all are found.

    It adds lines to the faults by section; a leg's file is looked for from the folder.
    """

    def __init__(
        self, sections: dict[str, SectionValues], faults: dict[str, list[str]], folder: Path
    ) -> None:
        self.sections, self.faults, self.folder = sections, faults, folder

    def scene(self, stem: str) -> Scene | None:
        """Return the scene, None where there are faults; `stem` is its name if it has none."""
        leg = self._make("leg", self._leg)
        geared = self._make("leg", self._with_armature, leg)
        supported = self._make("leg", self._with_supports, geared or leg)
        contact = self._make("contact", self._contact)
        q = self._make("posture", self._configuration, leg)
        if "foot_velocity_m_s" in self._section("posture"):
            v = self._make("posture", self._from_foot_velocity, supported, q, contact)
        else:
            v = self._make("posture", self._joint_velocity, leg)
        parts: dict[str, Any] = {"ball": self._make("ball", self._ball)}
        for name, make in (("air", self._air), ("ground", self._ground), ("plane", self._plane)):
            if name in self.sections:
                parts[name] = self._make(name, make)
        if any(self.faults.values()):
            return None
        return self._make("posture", lambda: self._scene(stem, supported, q, v, contact, **parts))

    def _make(self, section: str, make: Callable[..., Made], *needed: Any) -> Made | None:
        """Return what `make` returns; None where it finds faults, or something it needs is None."""
        if any(each is None for each in needed):
            return None
        try:
            return make(*needed)
        except FaultyValueError:
            return None
        except InvalidInput as error:
            self.faults[section] += [f"{section}: {line}" for line in faults_of(error)]
            return None

    def _section(self, name: str) -> SectionValues:
        """Return the valid values of a section; none where the file does not have it."""
        return self.sections.get(name, SectionValues())

    def _leg(self) -> Leg:
        """Return the leg, without what is added to it."""
        leg = self._section("leg")
        base, frame, model = leg.read("base", "fixed"), leg.read("frame"), leg.read("model")
        if leg.read("robot") is not None:
            only = leg.get("legs_only", False)
            return Leg.from_robot(leg["robot"], frame, base=base, legs_only=only)
        file = shipped_urdf(f"leg_{model}.urdf") if model else self.folder / leg.read("file")
        return Leg.from_urdf(file, frame or "toe", base=base)

    def _with_armature(self, leg: Leg) -> Leg:
        """Return the leg with its rotors."""
        armature = self._section("leg").read("armature_kg_m2", {})
        _check_joints("armature_kg_m2", leg, armature)
        return leg.with_armature(armature) if armature else leg

    def _with_supports(self, leg: Leg) -> Leg:
        """Return the leg on its supports."""
        supports = self._section("leg").read("supports")
        return leg if supports is None else leg.with_supports(*supports)

    def _configuration(self, leg: Leg) -> Array:
        """Return q."""
        posture = self._section("posture")
        values: dict[str, float] = {}
        faults: list[str] = []
        for key, unit, scale in (("angles_deg", "rad", math.pi / 180), ("positions_m", "m", 1.0)):
            joints = posture.read(key, {})
            try:
                _check_joints(key, leg, joints, unit)
            except SceneError as error:
                faults += error.faults
            values |= {joint: scale * value for joint, value in joints.items()}
        if faults:
            raise SceneError("posture", faults)
        return leg.configuration(values)

    def _joint_velocity(self, leg: Leg) -> Array:
        """Return v from the velocities of joints."""
        speeds = self._section("posture").read("joint_velocity_rad_s", {})
        _check_joints("joint_velocity_rad_s", leg, speeds)
        v = np.zeros(leg.nv)
        for joint, speed in speeds.items():
            v[leg.velocity_index(joint)] = speed
        return v

    def _from_foot_velocity(self, leg: Leg, q: Array, contact: Contact) -> Array:
        """Return v from the velocity of the contact point."""
        posture = leg.posture(q).with_contact_offset(contact.offset)
        return posture.joint_velocity(self._section("posture").read("foot_velocity_m_s"))

    def _ball(self) -> Ball:
        """Return the ball."""
        ball = self._section("ball")
        usual = Ball.paper() if ball.read("model") == "paper" else Ball()
        return Ball(
            ball.read("mass_kg", usual.mass),
            ball.read("radius_m", usual.radius),
            ball.read("inertia_factor", usual.inertia_factor),
        )

    def _contact(self) -> Contact:
        """Return the contact; invalid coefficients are replaced, to check the rest."""
        contact = self._section("contact")
        normal = contact.read("normal")
        if normal is None:
            up, side = math.radians(contact.read("attack_deg")), contact.get("side_deg", 0.0)
            level, side = math.cos(up), math.radians(side)
            normal = np.array([level * math.cos(side), level * math.sin(side), math.sin(up)])
        restitution, friction = contact.get("restitution", 1.0), contact.get("friction", 0.0)
        return Contact(normal, restitution, friction, contact.read("offset_m"))

    def _air(self) -> Air:
        """Return the air, without the effects that are not named."""
        air = self._section("air")
        height, *weather = (air.read(k) for k in ("altitude_m", "temperature_c", "pressure_pa"))
        here = Air.paper() if air.read("model") == "paper" else Air.at(height or 0.0, *weather)
        models = {kind: air.get(kind) for kind in ("drag", "lift", "torque")}
        wind, buoyancy = air.get("wind_m_s", (0.0, 0.0, 0.0)), air.get("buoyancy", False)
        return Air(here.density, here.viscosity, wind, **models, buoyancy=buoyancy)

    def _ground(self) -> Ground:
        """Return the ground, at height 0 where no height is given."""
        ground = self._section("ground")
        return Ground(ground.read("height_m", 0.0), ground.read("surface"))

    def _plane(self) -> Plane:
        """Return the plane."""
        plane = self._section("plane")
        reached_by = plane.read("reached_by", "front")
        return Plane(plane.read("point_m"), plane.read("normal"), reached_by)

    def _scene(self, stem: str, leg: Any, q: Any, v: Any, contact: Any, **parts: Any) -> Scene:
        """Return the scene, its ground under the ball where no height is given."""
        ball, at_contact = self._section("ball"), self._section("contact")
        scene = Scene(
            leg,
            q,
            v,
            contact=contact,
            law=at_contact.get("law", "newton"),
            contact_time=at_contact.get("contact_time_s"),
            ball_velocity=ball.get("velocity_m_s", np.zeros(3)),
            ball_spin=ball.get("spin_rad_s", np.zeros(3)),
            uncertainty={
                UNCERTAINTY[key][0]: UNCERTAINTY[key][2] * value
                for key, value in self._section("uncertainty").items()
            },
            name=self._section("").get("name", printable(stem)),
            **parts,
        )
        if scene.ground is None or "height_m" in self._section("ground"):
            return scene
        below = float(scene.ball_position[2]) - scene.ball.radius
        return scene.replace(ground=Ground(below, scene.ground.surface))


def _check_joints(key: str, leg: Leg, joints: Iterable[str], unit: str = "") -> None:
    """Raise `SceneError` with a line for every joint that cannot take its value."""
    faults = []
    for joint in joints:
        try:
            moves_in = leg.joint_unit(joint)
            if unit and moves_in != unit:
                faults.append(f"{key} names {joint}, which moves in {moves_in}")
        except InvalidInput as error:
            faults.append(str(error))
    if faults:
        raise SceneError(key, faults)
