"""Reads a scene file: strict TOML, all faults of its tables at once, then the robot's."""

import difflib
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.files import FileName, read_toml, shipped
from kickdyn.errors import FaultyFile, InvalidInput, SceneError, printable
from kickdyn.scene.scene import Scene
from kickdyn.scene.scene_tables import TABLES, Table, joint_faults


def load_scene(path: FileName) -> Scene:
    """Read a scene from a TOML file.

    Tables and keys are defined in `kickdyn.scene.scene_tables.TABLES`; the file of a leg is looked
    for relative to the folder of the scene. Aerodynamic effects act only if they are named: air
    without `drag` has none.

    Args:
        path: the file, of 100 kB at most; or the name of a shipped scene, such as
            `free_kick`, where there is no such file.

    Raises:
        SceneError: with a line for each fault: all unknown, missing and invalid values of the
            tables, or, where there are none, those that only the robot shows.
        InvalidInput: `path` is no path at all.
    """
    try:
        file, source = Path(path), str(path)
    except TypeError:
        raise InvalidInput(f"scene path is {path!r}: it must be a str or a Path") from None
    if file.name == source and not file.suffix and not os.path.lexists(file):
        scenes = {scene.stem: scene for scene in sorted(shipped("scenes").glob("*.toml"))}
        if source not in scenes:
            line = f"is neither a file nor a scene of kickdyn: choose {', '.join(scenes)}"
            raise SceneError(source, [line])
        file = scenes[source]
    faults, arguments = _read_tables(read_toml(file, source, SceneError))
    try:
        if not faults:
            return _scene(arguments, file.resolve().parent, printable(file.stem))
    except InvalidInput as error:
        faults = list(error.faults)
    # most faults of a scene file that are listed
    more = len(faults) - 100
    raise SceneError(source, faults if more <= 0 else [*faults[:-more], f"and {more} more faults"])


def _read_tables(document: dict[str, Any]) -> tuple[list[str], dict[str, Any]]:
    """Return a line for each fault of the tables, and by table the result of its constructor."""
    tables = {table.name: table for table in TABLES}
    top = {key.name for key in tables[""].keys}
    contents = {"": {name: value for name, value in document.items() if name in top}}
    faults, made = [], {}
    for name, value in document.items():
        if name in top:
            continue
        if name not in tables:
            kind = f"section [{name}]" if isinstance(value, dict) else name
            faults.append(_unknown(kind, name, [*filter(None, tables), *top]))
        elif isinstance(value, dict):
            contents[name] = value
        else:
            faults.append(f"{name} is {validation.brief(value)}: it must be a section, [{name}]")
    for name, content in contents.items():
        of_table = _faults_of(tables[name], content)
        try:
            if not of_table:
                made[name] = tables[name].constructor(**_arguments(tables[name], content))
        except InvalidInput as error:
            of_table = [f"{name}: {line}" for line in error.faults]
        faults += of_table
    faults += [
        f"section [{table.name}] is missing"
        for table in TABLES
        if table.is_required and table.name not in document
    ]
    return faults, made


def _faults_of(table: Table, content: dict[str, Any]) -> list[str]:
    prefix = f"{table.name}." if table.name else ""
    keys, faults = {key.name: key for key in table.keys}, []
    for name, value in content.items():
        if name not in keys:
            faults.append(_unknown(prefix + name, name, keys))
            continue
        key = keys[name]
        examples = [next(iter(group.items())) for group in table.required if name not in group]
        try:
            if not isinstance(key.takes, str) and value not in list(key.takes):
                hint = _hint(value, key.takes)
                raise InvalidInput(f"{validation.brief(value)} is unknown: {hint}")
            if key.check is not None:
                key.check(value)
            table.constructor(**_arguments(table, {**dict(examples), name: value}))
        except InvalidInput as error:
            faults += [f"{prefix}{name}: {line}" for line in error.faults]
        if key.needs and not content.keys() & set(key.needs):
            needed = " or ".join(key.needs)
            faults.append(f"{prefix}{name} is given without {needed}, which it needs")
    for group in table.required:
        present = [name for name in group if name in content]
        if not present and len(group) == 1:
            faults += [f"{prefix}{name} is missing" for name in group]
        elif len(present) != 1:
            which = " and ".join(present) or "none"
            among = ", ".join(group)
            faults.append(f"{table.name} has {which} of {among}: it must have exactly one")
    return faults


def _arguments(table: Table, content: dict[str, Any]) -> dict[str, Any]:
    return {key.argument: content[key.name] for key in table.keys if key.name in content}


def _unknown(shown: str, word: str, known: Iterable[str]) -> str:
    shown = shown if len(shown) <= 100 else shown[:100] + "..."
    return f"{shown} is unknown: {_hint(word, known)}"


def _hint(word: object, known: Iterable[str]) -> str:
    """Return the nearest of the known words as a question, or all of them to choose from."""
    names = list(known)
    matches = difflib.get_close_matches(str(word)[:100], names, 1, 0.5)
    return f"did you mean {matches[0]}?" if matches else f"choose {', '.join(names)}"


def _scene(sections: dict[str, Any], folder: Path, stem: str) -> Scene:
    leg_table, posture_table = sections.pop("leg"), sections.pop("posture")
    contact, law = sections.pop("contact")
    ball, incoming = sections.pop("ball", (Ball(), BallState()))
    has_height, ground = sections.pop("ground", (True, None))
    top = {"name": stem, **sections.pop("")}
    with _faults_in("leg"):
        leg = leg_table.read(folder)
    if faults := joint_faults(leg, leg_table, posture_table):
        raise InvalidInput(*faults)
    with _faults_in("leg"):
        leg = leg_table.change(leg)
    with _faults_in("posture"):
        posture = leg.posture(posture_table.configuration(leg)).with_contact_offset(contact.offset)
        v = posture_table.velocity(posture)
    scene = Scene(posture, v, ball, contact, law, incoming=incoming, **top, **sections)
    if ground is None:
        return scene
    under_ball = float(scene.ball_position[2]) - ball.radius
    if not has_height:
        ground = replace(ground, height=under_ball)
    if ground.height > under_ball + 1e-6 * ball.radius:
        raise InvalidInput(
            f"ground.height_m is {ground.height:g}: the ball would start "
            f"{ground.height - under_ball:.3g} m inside the ground; it must be at most "
            f"{under_ball:.6g} m, or left out"
        )
    return scene.replace(ground=ground)


@contextmanager
def _faults_in(table: str) -> Iterator[None]:
    """Name the table in the faults that are raised inside."""
    try:
        yield
    except FaultyFile as error:  # a robot's file, whose name is in the message
        raise InvalidInput(f"{table}: {error}") from None
    except InvalidInput as error:
        raise InvalidInput(*(f"{table}: {line}" for line in error.faults)) from None
