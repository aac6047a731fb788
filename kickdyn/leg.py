"""The leg: a Pinocchio model with a contact frame, checked before it is used."""

from __future__ import annotations

import math
import os
import tempfile
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn import checks
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput, UrdfError
from kickdyn.posture import Posture
from kickdyn.urdf_file import UrdfFile, read_urdf


class Leg:
    """A leg on a fixed base, with the frame that touches the ball.

    A leg does not change; for another mass or rotor inertia, change your own `pin.Model` and make
    a new leg with `from_model`. It can be pickled and shared between threads.

    Attributes:
        name: of the robot.
        frame: name of the contact frame.
        urdf: the checked file it came from, None for `from_model`.
        joint_names: without the universe, in the model's order.
        nq, nv: sizes of configuration and velocity.
        lower, upper: joint range, shape `(nq,)` [rad; m for prismatic joints].
        velocity_limit, effort_limit: shape `(nv,)` [rad/s, N m].
    """

    def __init__(self, model: Any, frame: str, urdf: UrdfFile | None = None) -> None:
        self._model = model.copy()
        self._model.gravity = pin.Motion.Zero()  # an impact is too short for gravity
        self._gravity = model.gravity.copy()
        self.name = str(model.name)
        self.frame = frame
        self.urdf = urdf
        self.frame_id = _frame_id(self._model, frame)
        self.contact_joint = int(self._model.frames[self.frame_id].parentJoint)
        if self.contact_joint == 0:
            raise InvalidInput(f"frame {frame!r} is fixed to the base: a kick must move it")
        self.contact_lever = self._model.frames[self.frame_id].placement.translation.copy()
        self.joint_names: tuple[str, ...] = tuple(self._model.names)[1:]
        self.nq, self.nv = int(model.nq), int(model.nv)
        self.lower: Array = self._model.lowerPositionLimit.copy()
        self.upper: Array = self._model.upperPositionLimit.copy()
        self.velocity_limit: Array = self._model.velocityLimit.copy()
        self.effort_limit: Array = self._model.effortLimit.copy()
        for limit in (self.lower, self.upper, self.velocity_limit, self.effort_limit):
            limit.setflags(write=False)
        self._workspace = Workspace(self._model)

    @classmethod
    def human(cls) -> Leg:
        """Return the human leg of the paper's Table 1: hip, knee, ankle; contact at the toe."""
        return cls.from_urdf(shipped_urdf("leg_human.urdf"))

    @classmethod
    def testbed(cls) -> Leg:
        """Return the test bed of the paper's Table 6: hip, knee, ankle; contact at the toe."""
        return cls.from_urdf(shipped_urdf("leg_testbed.urdf"))

    @classmethod
    def from_urdf(cls, path: str | PathLike[str], frame: str = "toe") -> Leg:
        """Load a URDF file, its root link fixed to the world.

        Args:
            path: the file; it is read once and checked before Pinocchio sees it.
            frame: link or joint of the file whose origin touches the ball.

        Raises:
            UrdfError: the file is refused, with all its faults in one message.
            InvalidInput: there is no such frame.
        """
        urdf = read_urdf(path)
        with _captured_stderr() as said:
            try:
                model = pin.buildModelFromXML(urdf.text)
            except Exception as error:
                model, reason = None, str(error).strip().splitlines()[0]
        complaints = [line.strip() for line in said if line.strip()]
        if model is None:
            raise UrdfError(urdf.source, ["Pinocchio cannot read it", *(complaints or [reason])])
        if complaints:
            raise UrdfError(urdf.source, ["Pinocchio complains", *complaints])
        if model.nv == 0:
            raise UrdfError(urdf.source, ["has no moving joint"])
        return cls(model, frame, urdf)

    @classmethod
    def from_model(cls, model: Any, frame: str) -> Leg:
        """Take a copy of a `pin.Model` built elsewhere, `armature` and all.

        Args:
            model: with positive mass and a sound inertia on every joint.
            frame: name of one of its frames.

        Raises:
            InvalidInput: not a model, an unsound inertia or placement, or no such frame.
        """
        if not isinstance(model, pin.Model):
            raise InvalidInput(f"model is a {type(model).__name__}: it must be a pinocchio.Model")
        if model.nv == 0:
            raise InvalidInput("model has no moving joint")
        _check_bodies(model)
        return cls(model, frame)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the model with the frame's name; the workspace is made anew."""
        return (Leg, (self.model, self.frame, self.urdf))

    def __repr__(self) -> str:
        """Name the leg, its joints and its contact frame."""
        return f"Leg({self.name!r}, joints={list(self.joint_names)}, frame={self.frame!r})"

    @property
    def model(self) -> Any:
        """A copy of the `pin.Model`; what is changed there does not change this leg."""
        model = self._model.copy()
        model.gravity = self._gravity.copy()
        return model

    @property
    def workspace(self) -> Workspace:
        """This thread's scratch space for Pinocchio's calls; what it holds is overwritten."""
        return self._workspace

    def posture(self, q: ArrayLike) -> Posture:
        """Run kinematics and inertia at a configuration, inside the joints' range or not.

        Args:
            q: shape `(nq,)` [rad; m for prismatic joints].

        Raises:
            InvalidInput: wrong shape, an entry that is not finite, or an inertia without digits.
        """
        return Posture(self, q)

    def configuration(self, angles: Mapping[str, float] | None = None) -> Array:
        """Return q with the named joints at their values and all others at 0.

        Args:
            angles: joint name to value [rad; m for prismatic joints].

        Raises:
            InvalidInput: no such joint, or a value that is not finite.
        """
        step = np.zeros(self.nv)
        for name, value in (angles or {}).items():
            step[self.velocity_index(name)] = checks.number(f"joint {name}", value)
        return np.asarray(pin.integrate(self._model, pin.neutral(self._model), step))

    def angles_deg(self, q: Array) -> dict[str, float]:
        """Return the joints' values at a configuration [deg; m for prismatic joints]."""
        step = pin.difference(self._model, pin.neutral(self._model), q)
        values = {}
        for name in self.joint_names:
            value = float(step[self.velocity_index(name)])
            values[name] = value if self.joint_unit(name) == "m" else math.degrees(value)
        return values

    def velocity_index(self, joint: str) -> int:
        """Return the index of a joint of one degree of freedom in v; raise `InvalidInput`."""
        if joint not in self.joint_names:
            raise InvalidInput(
                f"joint {joint!r} is unknown: {self.name} has {', '.join(self.joint_names)}"
            )
        index = 1 + self.joint_names.index(joint)
        if self._model.nvs[index] != 1:
            raise InvalidInput(f"joint {joint!r} has {self._model.nvs[index]} degrees of freedom")
        return int(self._model.idx_vs[index])

    def joint_unit(self, joint: str) -> str:
        """Return `m` for a prismatic joint, `rad` for any other of one degree of freedom."""
        self.velocity_index(joint)
        kind = self._model.joints[1 + self.joint_names.index(joint)].shortname()
        return "m" if kind.startswith("JointModelP") else "rad"

    def joint_range(self, joint: str) -> tuple[float, float]:
        """Return lower and upper limit of a joint [rad or m]; +-pi for a continuous one."""
        self.velocity_index(joint)
        index = 1 + self.joint_names.index(joint)
        if self._model.nqs[index] != 1:
            return -math.pi, math.pi
        at = self._model.idx_qs[index]
        return float(self.lower[at]), float(self.upper[at])


def shipped_urdf(name: str) -> Path:
    """Return the path of a URDF that comes with kickdyn: in the wheel, or in the checkout."""
    here = Path(__file__).resolve().parent
    packaged = here / "urdf" / name
    return packaged if packaged.exists() else here.parent / "urdf" / name


class Workspace(threading.local):
    """Scratch space per thread: two threads in one `pin.Data` would mix their kinematics.

    Attributes:
        model: the leg's model, without gravity; read only.
        data: `pin.Data` of that model.
        external: one zero `pin.Force` per joint.
    """

    def __init__(self, model: Any) -> None:
        self.model = model
        self.data = model.createData()
        self.external = pin.StdVec_Force()
        self.external.extend([pin.Force.Zero() for _ in range(model.njoints)])


def _frame_id(model: Any, name: str) -> int:
    # Looked up here: getFrameId returns nframes for an unknown name, and using that crashes.
    matches = [i for i, frame in enumerate(model.frames) if frame.name == name and i > 0]
    if not matches:
        names = [frame.name for frame in model.frames][1:]
        shown = ", ".join(names[:40]) + (f" and {len(names) - 40} more" if len(names) > 40 else "")
        raise InvalidInput(f"frame {name!r} is unknown: {model.name} has {shown}")
    bodies = [i for i in matches if model.frames[i].type != pin.FrameType.JOINT]
    return bodies[0] if bodies else matches[0]


def _check_bodies(model: Any) -> None:
    names = list(model.names)[1:]
    for name, inertia in zip(names, list(model.inertias)[1:], strict=True):
        parts = [inertia.mass, *inertia.lever, *inertia.inertia.flat]
        # Half the trace less a moment is how far the mass spreads along that axis, squared.
        spread = np.trace(inertia.inertia) / 2 - np.linalg.eigvalsh(np.nan_to_num(inertia.inertia))
        if not (np.isfinite(parts).all() and inertia.mass > 0 and spread[-1] >= -1e-9 * spread[0]):
            raise InvalidInput(
                f"joint {name!r} moves an unsound inertia (mass {inertia.mass:g} kg): mass must be "
                "above 0, and the principal moments must satisfy the triangle inequality"
            )
    for name, placement in zip(names, list(model.jointPlacements)[1:], strict=True):
        turn = placement.rotation
        square = turn @ turn.T - np.eye(3)  # NaN where the placement has one
        if not (np.abs(square).max() < 1e-9 and np.isfinite(placement.translation).all()):
            raise InvalidInput(f"joint {name!r} is placed by what is no rigid motion")
    for frame in model.frames:
        if not np.isfinite(frame.placement.homogeneous).all():
            raise InvalidInput(f"frame {frame.name!r} is placed by what is not finite")
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
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
