"""Is a Pinocchio model fit to strike: its frames, inertias, placements and limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput

ROUNDING = 1e-9
"""How far a moment may break the triangle inequality, relative to all that moves with it."""


def frame_id(model: Any, name: str) -> int:
    """Return the id of a frame by name, a body before a joint; raise `InvalidInput`."""
    # Looked up here: getFrameId returns nframes for an unknown name, and using that crashes.
    matches = [i for i, frame in enumerate(model.frames) if frame.name == name and i > 0]
    if not matches:
        names = [frame.name for frame in model.frames][1:]
        raise InvalidInput(f"frame {name!r} is unknown: {model.name} has {listed(names)}")
    bodies = [i for i in matches if model.frames[i].type != pin.FrameType.JOINT]
    return bodies[0] if bodies else matches[0]


def listed(names: Sequence[str], most: int = 40) -> str:
    """Return names in one line; what is beyond `most` is counted."""
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest


def check_model(model: Any) -> None:
    """Refuse what no computation can rest on.

    A body may be massless if more moves with its joint, as the virtual links of joints in a row do.

    Raises:
        InvalidInput: an unsound inertia or placement, a joint that moves no mass, joints that are
            not in the order of their branches, or limits that make no sense; it names the culprit.
    """
    if model.nv == 0:
        raise InvalidInput("model has no moving joint")
    names = list(model.names)[1:]
    for name, joint in zip(names, list(model.joints)[1:], strict=True):
        if joint.shortname() == "JointModelMimic":
            raise InvalidInput(
                f"joint {name!r} mimics another: Pinocchio has no Newton-Euler for it (a model "
                "built without mimic joints moves it by itself)"
            )
    if not np.isfinite(model.gravity.vector).all():
        raise InvalidInput(f"gravity is {model.gravity.vector.tolist()}: it must be finite [m/s2]")
    _check_order(model)
    for name, placement in zip(names, list(model.jointPlacements)[1:], strict=True):
        turn = placement.rotation
        square = turn @ turn.T - np.eye(3)  # NaN where the placement has one
        if not (np.abs(square).max() < 1e-9 and np.isfinite(placement.translation).all()):
            raise InvalidInput(f"joint {name!r} is placed by what is no rigid motion")
    _check_bodies(model, names)
    for frame in model.frames:
        if not np.isfinite(frame.placement.homogeneous).all():
            raise InvalidInput(f"frame {frame.name!r} is placed by what is not finite")
    _check_limits(model)


def _check_order(model: Any) -> None:
    # Pinocchio's crba wants every branch in one piece: else it is wrong and does not say so
    branch = [0]
    for joint in range(1, model.njoints):
        parent = int(model.parents[joint])
        while branch[-1] != parent:
            branch.pop()
            if not branch:
                raise InvalidInput(
                    f"joint {model.names[joint]!r} comes after joints of another branch than its "
                    f"parent's, {model.names[parent]!r}: add the joints branch by branch"
                )
        branch.append(joint)


def find_singular_joints(model: Any, inertia: Array) -> list[str]:
    """Return the joints whose motion the joint-space inertia does not feel, or hardly.

    They are those with a share in its null vectors; or, if it has none, in the nearest to one.

    Args:
        model: of the leg.
        inertia: shape `(nv, nv)`, not positive definite or nearly so.
    """
    diagonal = inertia.diagonal()
    dead = diagonal <= 1e-14 * diagonal.max()  # moved without moving anything
    scale = np.where(dead, 0.0, 1.0 / np.sqrt(np.where(dead, 1.0, diagonal)))
    scaled = inertia * scale * scale[:, None] + np.diag(2.0 * dead)
    values, vectors = np.linalg.eigh(scaled)
    null = vectors[:, values <= max(1e-11, 10.0 * values[0])]
    guilty = dead if dead.any() else (np.abs(null) > 0.1).any(axis=1)
    return [
        model.names[joint]
        for joint in range(1, model.njoints)
        if guilty[model.idx_vs[joint] : model.idx_vs[joint] + model.nvs[joint]].any()
    ]


def _check_bodies(model: Any, names: list[str]) -> None:
    inertias = list(model.inertias)[1:]
    for name, inertia in zip(names, inertias, strict=True):
        mass, moments = inertia.mass, inertia.inertia
        empty = mass == 0.0 and not moments.any()
        if not (np.isfinite([mass, *inertia.lever, *moments.flat]).all() and (mass > 0 or empty)):
            raise InvalidInput(_unsound(name, mass))
    data = pin.Data(model)
    pin.crba(model, data, pin.neutral(model), pin.Convention.LOCAL)
    composites = list(data.Ycrb)[1:]  # all that moves with each joint
    idle = [name for name, moved in zip(names, composites, strict=True) if not moved.mass > 0]
    if idle:
        others = f", as do {listed(idle[1:])}" if idle[1:] else ""
        raise InvalidInput(
            f"joint {idle[0]!r} moves an unsound inertia (mass 0 kg){others}: what moves with a "
            "joint must have mass above 0"
        )
    for name, inertia, moved in zip(names, inertias, composites, strict=True):
        # a point's moments are 0 but for the rounding of those about its joint
        largest = max(
            _spread(moved)[0], _spread(inertia)[0], moved.mass * moved.lever @ moved.lever
        )
        if inertia.mass > 0 and not _spread(inertia)[-1] >= -ROUNDING * largest:
            raise InvalidInput(_unsound(name, inertia.mass))


def _unsound(name: str, mass: float) -> str:
    return (
        f"joint {name!r} moves an unsound inertia (mass {mass:g} kg): mass must be above 0, and "
        "the principal moments must satisfy the triangle inequality"
    )


def _spread(inertia: Any) -> Array:
    # Half the trace less a moment is how far the mass spreads along that axis, squared.
    moments = inertia.inertia
    return np.asarray(np.trace(moments) / 2 - np.linalg.eigvalsh(moments))


def _check_limits(model: Any) -> None:
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    if np.isnan([lower, upper]).any():
        raise InvalidInput(
            f"joint range is {lower.tolist()} to {upper.tolist()}: every limit must be a number"
        )
    if not (lower <= upper).all():
        raise InvalidInput(
            f"joint range is {lower.tolist()} to {upper.tolist()}: lower must not exceed upper"
        )
    if not (model.velocityLimit >= 0).all():
        raise InvalidInput(
            f"velocity limit is {model.velocityLimit.tolist()}: every entry must be 0 or more"
        )
    if not (np.isfinite(model.armature).all() and (model.armature >= 0).all()):
        raise InvalidInput(
            f"armature is {model.armature.tolist()}: every entry must be finite and 0 or more"
        )
