"""Checks of a Pinocchio model: frames, placements, limits, and the inertia of what moves together.

Inertias are judged joint by joint with all that moves with it, as M and an impact see them: a
published robot may have massless virtual links between joints, or mass at a point.
"""

import math
from operator import mul, truediv
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import lapack

from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.names import listed, lock_remedy, unknown
from kickdyn.robot.surgery import has_floating_base

MAX_CONDITION = 1e13
"""Condition number of the joint-space inertia from which it has no digits left."""

ROUNDING = 1e-9
"""How far a moment may break the triangle inequality, relative to all that moves with it."""

MAX_MAGNITUDE = 1e100
"""Masses, moments and distances stay below it, so that float64 holds their products."""


def check_is_model(model: Any) -> None:
    """Raise `InvalidInput` unless this is a `pin.Model`."""
    if not isinstance(model, pin.Model):
        raise InvalidInput(
            f"model is a {type(model).__name__}: it must be a pinocchio.Model; kd.Leg.from_urdf "
            "and kd.Leg.from_mjcf read files"
        )


def frame_id(model: Any, name: str) -> int:
    """Return the number of a frame by name; raise `InvalidInput` if there is none."""
    # not by getFrameId, which returns nframes for an unknown name: using that crashes
    numbers = frames_by_name(model)
    if not isinstance(name, str) or name not in numbers:
        frames = list(model.frames)[1:]
        last = [f for f in frames if len(model.subtrees[f.parentJoint]) == 1]
        kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
        ends = [frame.name for frame in last if frame.type in kinds]
        raise InvalidInput(unknown("frame", name, model.name, [f.name for f in frames], ends))
    return numbers[name]


def frames_by_name(model: Any) -> dict[str, int]:
    """Return the numbers of all frames but the universe.

    Of several frames with one name, it is a body's, else any but a joint's, and the first of these.
    """
    ranks = {pin.FrameType.BODY: 2, pin.FrameType.JOINT: 0}
    numbered = list(enumerate(model.frames))[:0:-1]  # the first frame of a name replaces the others
    numbered.sort(key=lambda pair: ranks.get(pair[1].type, 1))
    return {frame.name: number for number, frame in numbered}


def check_model(model: Any) -> None:
    """Raise `InvalidInput`, which names the joint at fault, for a model with unsound mechanics."""
    if model.nv == 0:
        raise InvalidInput("model has no moving joint")
    gravity = model.gravity.vector.tolist()
    if gravity not in ([0.0, 0.0, -GRAVITY, 0.0, 0.0, 0.0], [0.0] * 6):
        raise InvalidInput(
            f"gravity of the model is {gravity}: it must be (0, 0, -{GRAVITY:g}) m/s2, with which "
            "the ball flies, or zero"
        )
    names = list(model.names)[1:]
    for root in range(1, model.njoints):  # else crba is wrong, silently
        for joint, expected in zip(model.subtrees[root], range(root, model.njoints), strict=False):
            if joint != expected:
                raise InvalidInput(
                    f"joint {model.names[joint]!r} comes after joints of another branch than its "
                    f"parent's, {model.names[model.parents[joint]]!r}: add the joints branch by "
                    "branch"
                )
    placements = list(model.jointPlacements)[1:]
    for name, joint, placement in zip(names, list(model.joints)[1:], placements, strict=True):
        if joint.shortname() == "JointModelMimic":
            raise InvalidInput(
                f"joint {name!r} mimics another: Pinocchio has no Newton-Euler for it (a model "
                "built without mimic joints moves it by itself)"
            )
        rotation, distance = placement.rotation, np.abs(placement.translation).max()
        deviation = np.abs(rotation @ rotation.T - np.eye(3)).max()  # NaN if the placement has one
        if not (deviation < 1e-9 and distance < MAX_MAGNITUDE):
            raise InvalidInput(
                f"placement of joint {name!r} is not a rigid motion: it must be a rotation and a "
                f"translation below {MAX_MAGNITUDE:g} m"
            )
    _check_inertias(model, names)
    for frame in model.frames:
        if not np.isfinite(frame.placement.homogeneous).all():
            raise InvalidInput(f"placement of frame {frame.name!r} is not finite")
    _check_limits(model)


def _check_inertias(model: Any, names: list[str]) -> None:
    bodies = list(model.inertias)[1:]
    for name, body in zip(names, bodies, strict=True):
        is_empty = body.mass == 0.0 and not body.inertia.any()
        largest = np.abs([body.mass, *body.lever, *body.inertia.flat]).max()
        if not (largest < MAX_MAGNITUDE and (body.mass > 0 or is_empty)):
            raise InvalidInput(
                f"joint {name!r} moves an unsound inertia (mass {body.mass:g} kg): mass must be "
                f"above 0 (or 0 without moments of inertia), and mass, centre and moments below "
                f"{MAX_MAGNITUDE:g}; correct it in the file"
            )
    data = pin.Data(model)
    pin.crba(model, data, pin.neutral(model), pin.Convention.LOCAL)
    composites = list(data.Ycrb)[1:]  # all that moves with each joint
    low, high = 1e-15, 1e18  # [kg]; beyond, squares and quotients leave the range of float64
    for name, composite in zip(names, composites, strict=True):
        if not low <= composite.mass <= high:
            idle = [n for n, m in zip(names, composites, strict=True) if not low <= m.mass <= high]
            also = f", as do {listed(idle[1:])}" if idle[1:] else ""
            remedy = f", or {remedy}" if (remedy := lock_remedy(model, idle)) else ""
            raise InvalidInput(
                f"joint {name!r} moves an unsound inertia (mass {composite.mass:g} kg){also}: what "
                f"moves with a joint must have {low:g} to {high:g} kg; give a link there mass and "
                f"inertia{remedy}"
            )
        if not np.abs(composite.inertia).max() < MAX_MAGNITUDE**2:
            raise InvalidInput(
                f"joint {name!r} moves an unsound inertia: its moments exceed the range of "
                "float64; masses are in kg and lengths in m"
            )
    unsound: list[str] = []
    for name, body, composite in zip(names, bodies, composites, strict=True):
        # a point's moments are 0 but for the rounding of those about its joint
        of_moved, of_body = second_moments(composite.inertia), second_moments(body.inertia)
        largest = max(of_moved[0], composite.mass * composite.lever @ composite.lever)
        if not of_body[-1] >= -ROUNDING * largest:
            unsound.append(name)
    if unsound:
        faulty = bodies[names.index(unsound[0])]
        moments = ", ".join(f"{moment:.3g}" for moment in np.linalg.eigvalsh(faulty.inertia))
        also = f", as do {listed(unsound[1:])}" if unsound[1:] else ""
        raise InvalidInput(
            f"joint {unsound[0]!r} moves an unsound inertia (principal moments {moments} kg m2)"
            f"{also}: none may be negative or exceed the sum of the others (triangle "
            "inequality); correct the inertias in the file"
        )


def second_moments(moments: Array) -> Array:
    r"""Return the second moments of mass along the principal axes, shape `(3,)`, falling [kg m2].

    With the principal moments of inertia :math:`I_k` they are :math:`\sum_j I_j / 2 - I_k`, and
    none is negative for a body: this is the triangle inequality.
    """
    return np.asarray(np.trace(moments) / 2 - np.linalg.eigvalsh(moments))


def _check_limits(model: Any) -> None:
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    span, speed, rotors = np.stack([lower, upper], axis=1), model.velocityLimit, model.armature
    for name, values, sound, valid in (
        ("joint range", span, ~np.isnan(span).any(axis=1), "every limit must be a number"),
        ("joint range", span, lower <= upper, "lower must not exceed upper"),
        ("velocity limit", speed, speed >= 0, "every entry must be 0 or more"),
        ("armature", rotors, np.isfinite(rotors), "every entry must be finite"),
        ("armature", rotors, rotors >= 0, "every entry must be 0 or more"),
    ):
        if not sound.all():
            worst, starts = int(np.argmin(sound)), model.idx_qs if values is span else model.idx_vs
            joint = max(j for j in range(1, model.njoints) if starts[j] <= worst)
            value = values[worst].tolist()
            raise InvalidInput(f"{name} of {model.names[joint]!r} is {value}: {valid}")


def cholesky_with_condition(inertia: Array) -> tuple[Array, float]:
    r"""Return the Cholesky factor L of M, its upper triangle unused, and a bound on the condition.

    If M is not positive definite, the factor is 0 and the bound inf. Scaled to unit diagonal, M
    has eigenvalues that add up to n, so its condition is below :math:`n^{1.5} e / \det`; if many
    joints make that too large, it is below :math:`n^2 \operatorname{tr} M\,|M^{-1}|` (van der Sluis
    1969).
    """
    # of lower=1 and clean=0, the names would take a third of the time
    factor, info = lapack.dpotrf(inertia.T, 1, 0)
    if info:
        return np.zeros_like(factor), math.inf
    diagonal, n = inertia.diagonal().tolist(), len(inertia)
    roots = factor.diagonal().tolist()
    determinant = math.prod(map(truediv, map(mul, roots, roots), diagonal))
    if determinant > 1e-9:  # far below 1 it is rounding
        return factor, n**1.5 * math.e / determinant
    reciprocal, _ = lapack.dpocon(factor, sum(diagonal), uplo="L")
    return factor, n * n / float(reciprocal) if reciprocal else math.inf


def singularity_fault(model: Any, inertia: Array, condition: float) -> str:
    """Return the fault of a singular joint-space inertia, with the joints that cause it."""
    fault = (
        "is not positive definite: a joint moves no inertia"
        if condition == math.inf
        else f"has condition {condition:.1g}, above {MAX_CONDITION:g}: no digits"
    )
    joints = find_singular_joints(model, inertia)
    causes = [listed(joints), lock_remedy(model, joints)]
    if has_floating_base(model) and model.inertias[1].mass == 0.0:
        causes.append(
            "the base floats and has no mass: give its link mass and inertia in the file, or fix "
            "the base, by base='fixed' in Python, without --support in commands"
        )
    return f"{fault} (at fault: {'; '.join(filter(None, causes))})"


def find_singular_joints(model: Any, inertia: Array) -> list[str]:
    """Return joints with a share in the null vectors of an inertia, or with infinite entries."""
    singular: NDArray[np.bool_] = np.logical_not(np.isfinite(inertia).all(axis=1))
    if not singular.any():
        diagonal = inertia.diagonal()
        singular = np.asarray(diagonal <= 1e-14 * diagonal.max())  # they move no inertia
        if not singular.any():
            scale = 1.0 / np.sqrt(diagonal)
            values, vectors = np.linalg.eigh(inertia * scale * scale[:, None])
            null = vectors[:, values <= max(1e-11, 10.0 * values[0])]
            singular = np.asarray((np.abs(null) > 0.1).any(axis=1))
    return [
        model.names[joint]
        for joint in range(1, model.njoints)
        if singular[model.idx_vs[joint] : model.idx_vs[joint] + model.nvs[joint]].any()
    ]


def facing_doubts(model: Any, contact_joint: int) -> tuple[str, ...]:
    """Return a line if another foot, a limb's end as high at q = 0, is apart from this along x."""
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    places = np.array([placement.translation for placement in data.oMi])
    ends = set(range(1, model.njoints)) - set(model.parents) - set(model.supports[contact_joint])
    feet = [
        end
        for end in ends
        if contact_joint not in model.supports[end]
        and abs(places[end, 2] - places[contact_joint, 2]) < 0.05 * np.ptp(places[1:, 2])
    ]
    for end in feet:
        along, across = np.abs(places[end] - places[contact_joint])[:2]
        if along > 2.0 * across:
            return (
                f"the ends of two limbs are {along:.3g} m apart along x: a robot whose feet these "
                "are faces y or -y; facing='y' or '-y' (--facing) turns its base",
            )
    return ()
