"""From the text of a URDF to a Pinocchio model, what C++ says included; locking joints."""

from __future__ import annotations

import os
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, UrdfError

BASES = ("fixed", "floating")


def build_model(text: str, source: str, base: str) -> Any:
    """Return the `pin.Model` of a URDF.

    Args:
        text: the document.
        source: its name, for errors.
        base: `fixed` welds the root link to the world; `floating` lets it move, as the first
            joint, `root_joint`, of seven coordinates (position, quaternion xyzw) and six
            velocities (linear, angular, in the base's own axes).

    Raises:
        UrdfError: Pinocchio refuses it, or complains, or no joint moves.
        InvalidInput: an unknown base.
    """
    if base not in BASES:
        raise InvalidInput(f"base is {base!r}: it must be {' or '.join(BASES)}")
    root = (pin.JointModelFreeFlyer(),) if base == "floating" else ()
    with _captured_stderr() as said:
        try:
            model = pin.buildModelFromXML(text, *root)
        except Exception as error:
            model, reason = None, str(error).strip().splitlines()[0]
    complaints = [line for line in map(_told, said) if line]
    if model is None:
        raise UrdfError(source, ["Pinocchio cannot read it", *(complaints or [reason])])
    if complaints:
        raise UrdfError(source, ["Pinocchio complains", *complaints])
    if model.nv == 0:
        raise UrdfError(source, ["has no moving joint"])
    return model


def reduced_model(model: Any, joints: Iterable[str], q: Array) -> Any:
    """Return a model with joints, by name, locked as they are at `q`.

    `pin.buildReducedModel` wants one frame of each joint's name: a link of that name has another
    meanwhile, and a joint without a frame, with which it would crash, gets one.
    """
    own = model.copy()
    names, moving = list(own.names), pin.FrameType.JOINT
    framed = {frame.name for frame in own.frames if frame.type == moving}
    for joint, name in enumerate(names):
        if joint and name not in framed:
            own.addJointFrame(joint)
    renamed = {}
    for number, frame in enumerate(own.frames):
        if frame.name in names and frame.type != moving:
            renamed[f"{frame.name}/{number}"] = frame.name
            frame.name = f"{frame.name}/{number}"
    reduced = pin.buildReducedModel(own, [names.index(joint) for joint in joints], q)
    for frame in reduced.frames:
        frame.name = renamed.get(frame.name, frame.name)
    return reduced


def _told(line: str) -> str:
    """Return what a line of the parser's tells; nothing of one that says where its code is."""
    line = line.strip()
    return "" if line.startswith("at line ") else line.removeprefix("Error:").strip()


_stderr_lock = threading.Lock()  # file descriptor 2 belongs to the whole process


@contextmanager
def _captured_stderr() -> Iterator[list[str]]:
    """Catch what C++ writes to file descriptor 2, which contextlib does not see."""
    lines: list[str] = []
    with _stderr_lock, tempfile.TemporaryFile() as sink:
        saved = os.dup(2)
        os.dup2(sink.fileno(), 2)
        try:
            yield lines
        finally:
            os.dup2(saved, 2)
            os.close(saved)
            sink.seek(0)
            lines += sink.read().decode(errors="replace").splitlines()
