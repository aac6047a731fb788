"""Reading a scene file: strict TOML, all faults at once."""

from __future__ import annotations

import math
import os
import stat
import tomllib
from collections.abc import Callable, Iterable
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core.files import shipped
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, SceneError, printable
from kickdyn.ground import Ground
from kickdyn.plane import Plane
from kickdyn.robot.leg import Leg
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.scene.scene import Scene
from kickdyn.scene.schema import SOURCES, Values, checked, faults_of, unusable

MAX_BYTES = 100_000

Made = TypeVar("Made")


def load_scene(path: str | PathLike[str]) -> Scene:
    """Read a scene from a TOML file.

    Sections and keys are those of `kickdyn.scene.schema.SECTIONS`; a leg's file is looked for
    from the scene's folder. Aerodynamic effects act only if named: air without `drag` has none.

    Args:
        path: the file, at most `MAX_BYTES` long; or the name of a scene that comes with kickdyn,
            such as `free_kick`, where there is no such file.

    Raises:
        SceneError: with all faults of the file, one line each.
        InvalidInput: `path` is no path at all.
    """
    try:
        file, source = Path(path), str(path)
    except TypeError:
        raise InvalidInput(f"scene path is {path!r}: it must be a str or a Path") from None
    file = _named(file, source)
    text = _read(file, source)
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: an endless integer, too
        raise SceneError(source, [f"is not TOML: {error}"]) from None
    values, faults = checked(document)
    builder = _Builder(values, faults, unusable(document, values), file.resolve().parent)
    scene = builder.scene(file.stem)
    if scene is None:
        raise SceneError(source, [line for lines in builder.faults.values() for line in lines])
    return scene


def _named(file: Path, source: str) -> Path:
    """Return the file of a scene that comes with kickdyn where one is named, else the file."""
    if file.name != source or file.suffix or os.path.lexists(file):
        return file
    known = {scene.stem: scene for scene in sorted(shipped("scenes").glob("*.toml"))}
    if source not in known:
        line = f"is neither a file nor a scene of kickdyn: choose {', '.join(known)}"
        raise SceneError(source, [line])
    return known[source]


def _read(file: Path, source: str) -> str:
    try:
        status = file.stat()
        if not stat.S_ISREG(status.st_mode):  # a FIFO would block for ever
            raise SceneError(source, ["is not a regular file"])
        if status.st_size > MAX_BYTES:
            raise SceneError(source, [f"has {status.st_size} bytes: at most {MAX_BYTES} are read"])
        return file.read_bytes().decode("utf-8-sig")
    except SceneError:  # a ValueError as well
        raise
    except UnicodeDecodeError as error:
        raise SceneError(source, [f"is not UTF-8 text (byte {error.start})"]) from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError(source, [f"cannot be read ({reason})"]) from None


class _Builder:
    """Makes the nouns of a scene, each on its own, so that the faults of all are found."""

    def __init__(
        self, values: Values, faults: dict[str, list[str]], bad: set[str], folder: Path
    ) -> None:
        self.values, self.faults, self.bad, self.folder = values, faults, bad, folder

    def scene(self, stem: str) -> Scene | None:
        """Return the scene; None where there are faults."""
        leg = self._made("leg", ("model", "file", "robot", "frame", "base"), self._leg)
        joints = self._made("leg", ("armature_kg_m2",), self._rotors, leg)
        held = self._made("leg", ("supports",), self._held, joints or leg)
        ball = self._made("ball", (), self._ball)
        contact = self._made("contact", ("normal", "attack_deg", "offset_m"), self._contact)
        air = self._made("air", ("altitude_m", "temperature_c", "pressure_pa"), self._air)
        ground = self._made("ground", (), self._ground)
        plane = self._made("plane", ("point_m", "normal"), self._plane)
        q = self._made("posture", ("angles_deg", "positions_m"), self._configuration, leg)
        v = self._made("posture", ("joint_velocity_rad_s",), self._joint_velocity, leg)
        if "foot_velocity_m_s" in self._said("posture"):
            v = self._made("posture", ("foot_velocity_m_s",), self._foot_velocity, held, q, contact)
        if any(self.faults.values()):
            return None
        nouns: tuple[Any, ...] = (held, q, v, ball, contact, air, ground, plane)
        return self._made("posture", (), lambda: self._whole(stem, *nouns))

    def _made(
        self, section: str, keys: tuple[str, ...], make: Callable[..., Made], *parts: Any
    ) -> Made | None:
        """Return what `make` does; None where it cannot, or finds faults, which are noted.

        Args:
            section: of the file.
            keys: of it that this stands on.
            make: does it.
            *parts: nouns that this stands on, too.
        """
        if any(f"{section}.{key}" in self.bad for key in keys) or any(p is None for p in parts):
            return None
        try:
            return make(*parts)
        except InvalidInput as error:
            self.faults[section] += [f"{section}: {line}" for line in faults_of(error)]
            return None

    def _said(self, section: str) -> dict[str, Any]:
        return self.values.get(section, {})

    def _leg(self) -> Leg:
        said = self._said("leg")
        base, frame = said.get("base", "fixed"), said.get("frame")
        if "robot" in said:
            only = said.get("legs_only", False)
            leg = Leg.from_robot(said["robot"], frame, base=base, legs_only=only)
        else:
            file = (
                self.folder / said["file"]
                if "file" in said
                else shipped_urdf(f"leg_{said['model']}.urdf")
            )
            leg = Leg.from_urdf(file, frame or "toe", base=base)
        return leg

    def _rotors(self, leg: Leg) -> Leg:
        rotors = self._said("leg").get("armature_kg_m2", {})
        _check_joints("armature_kg_m2", leg, rotors)
        return leg.with_armature(rotors) if rotors else leg

    def _held(self, leg: Leg) -> Leg:
        feet = self._said("leg").get("supports")
        return leg if feet is None else leg.with_supports(*feet)

    def _configuration(self, leg: Leg) -> Array:
        said = self._said("posture")
        values: dict[str, float] = {}
        faults: list[str] = []
        for key, unit, scale in (("angles_deg", "rad", math.pi / 180), ("positions_m", "m", 1.0)):
            joints = said.get(key, {})
            try:
                _check_joints(key, leg, joints, unit)
            except SceneError as error:
                faults += error.faults
            values |= {joint: scale * value for joint, value in joints.items()}
        if faults:
            raise SceneError("posture", faults)
        return leg.configuration(values)

    def _joint_velocity(self, leg: Leg) -> Array:
        speeds = self._said("posture").get("joint_velocity_rad_s", {})
        _check_joints("joint_velocity_rad_s", leg, speeds)
        v = np.zeros(leg.nv)
        for joint, speed in speeds.items():
            v[leg.velocity_index(joint)] = speed
        return v

    def _foot_velocity(self, leg: Leg, q: Array, contact: Contact) -> Array:
        posture = leg.posture(q).with_contact_offset(contact.offset)
        return posture.joint_velocity(self._said("posture")["foot_velocity_m_s"])

    def _ball(self) -> Ball:
        said = self._said("ball")
        usual = Ball.paper() if said.get("model") == "paper" else Ball()
        return Ball(
            said.get("mass_kg", usual.mass),
            said.get("radius_m", usual.radius),
            said.get("inertia_factor", usual.inertia_factor),
        )

    def _contact(self) -> Contact:
        said = self._said("contact")
        normal = said.get("normal")
        if normal is None:
            up, side = math.radians(said["attack_deg"]), math.radians(said.get("side_deg", 0.0))
            level = math.cos(up)
            normal = np.array([level * math.cos(side), level * math.sin(side), math.sin(up)])
        restitution = said.get("restitution", 1.0)  # where it is bad, the rest can still be checked
        return Contact(normal, restitution, said.get("friction", 0.0), said.get("offset_m"))

    def _air(self) -> Air | None:
        if "air" not in self.values:
            return None
        said = self._said("air")
        if said.get("model") == "paper":
            here = Air.paper()
        else:
            here = Air.at(
                said.get("altitude_m", 0.0), said.get("temperature_c"), said.get("pressure_pa")
            )
        models = {kind: said.get(kind) for kind in ("drag", "lift", "torque")}
        wind, buoyancy = said.get("wind_m_s", (0.0, 0.0, 0.0)), said.get("buoyancy", False)
        return Air(here.density, here.viscosity, wind, **models, buoyancy=buoyancy)

    def _ground(self) -> Ground | None:
        """Return the ground; at height 0, to be put under the ball, where none is named."""
        if "ground" not in self.values:
            return None
        said = self._said("ground")
        return Ground(said.get("height_m", 0.0), said.get("surface"))

    def _plane(self) -> Plane | None:
        if "plane" not in self.values:
            return None
        said = self._said("plane")
        return Plane(said["point_m"], said["normal"], said.get("reached_by", "front"))

    def _whole(
        self,
        stem: str,
        leg: Leg,
        q: Array,
        v: Array,
        ball: Ball,
        contact: Contact,
        air: Air | None,
        ground: Ground | None,
        plane: Plane | None,
    ) -> Scene:
        if ground is not None and "height_m" not in self._said("ground"):
            foot = leg.posture(q).with_contact_offset(contact.offset).contact_point
            place = foot + ball.radius * contact.normal
            ground = Ground(float(place[2]) - ball.radius, ground.surface)
        moving, section = self._said("ball"), self._said("contact")
        return Scene(
            leg,
            q,
            v,
            ball,
            contact,
            law=section.get("law", "newton"),
            contact_time=section.get("contact_time_s"),
            ball_velocity=moving.get("velocity_m_s", np.zeros(3)),
            ball_spin=moving.get("spin_rad_s", np.zeros(3)),
            air=air,
            ground=ground,
            plane=plane,
            spread={
                SOURCES[key][0]: SOURCES[key][1] * value
                for key, value in self._said("uncertainty").items()
            },
            name=self.values[""].get("name", printable(stem)),
        )


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
