"""The leg: a Pinocchio model with a contact frame, checked before it is used."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from os import PathLike
from typing import Any

import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.read_only import read_only
from kickdyn.core.representation import ReprMixin, Row, format_value
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.constraints import Constraints, Support
from kickdyn.robot.example_robots import robot, robot_file, robot_model
from kickdyn.robot.joint_table import JointTable
from kickdyn.robot.loop_closure import closed_configuration
from kickdyn.robot.model_validation import check_model, frame_id
from kickdyn.robot.posture import Posture
from kickdyn.robot.urdf_file import UrdfFile, read_urdf, shipped_urdf
from kickdyn.robot.urdf_model import build_model, reduced_model
from kickdyn.robot.workspace import Workspace


class Leg(JointTable, ReprMixin):
    """A leg, or a whole robot, with the frame that touches the ball.

    A leg does not change: `locked`, `with_armature`, `with_supports` and `with_loops` return
    another.
    It can be pickled and shared between threads.

    Attributes:
        name: of the robot.
        frame: name of the contact frame.
        urdf: the checked file it came from, None for `from_model`.
        joint_names: without the universe, in the model's order.
        nq, nv: sizes of configuration and velocity.
        lower, upper: joint range, shape `(nq,)` [rad; m for prismatic joints].
        velocity_limit, effort_limit: of speed and torque (`effort` in a URDF), shape `(nv,)`
            [rad/s, N m; m/s, N for prismatic joints].
        constraints: supports and loops; None without any.
        contact_normal_cone: of the contact normals n, in the contact frame's axes, those with
        which the foot
            can meet a ball: where `contact_normal_cone @ n >= 0`, shape `(k, 3)`; None where that
            is unknown.
    """

    def __init__(
        self,
        model: Any,
        frame: str,
        urdf: UrdfFile | None = None,
        supports: tuple[Support, ...] = (),
        loops: tuple[tuple[str, str], ...] = (),
        contact_normal_cone: Array | None = None,
    ) -> None:
        super().__init__(model.copy())
        self._model.gravity = pin.Motion.Zero()  # an impact is too short for gravity
        self._gravity = model.gravity.copy()
        self.frame = frame
        self.urdf = urdf
        self.frame_id = frame_id(self._model, frame)
        self.contact_joint = int(self._model.frames[self.frame_id].parentJoint)
        if self.contact_joint == 0:
            raise InvalidInput(f"frame {frame!r} is fixed to the base: a kick must move it")
        self.contact_lever = read_only(self._model.frames[self.frame_id].placement.translation)
        self.contact_normal_cone = (
            None if contact_normal_cone is None else read_only(contact_normal_cone)
        )
        self._held = {
            "supports": supports,
            "loops": loops,
            "contact_normal_cone": contact_normal_cone,
        }
        self.constraints: Constraints | None = None
        if supports or loops:
            self.constraints = Constraints(self._model, self.contact_joint, supports, loops)
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
    def from_urdf(
        cls, path: str | PathLike[str], frame: str = "toe", *, base: str = "fixed"
    ) -> Leg:
        """Load a URDF file.

        Args:
            path: the file; it is read once and checked before Pinocchio sees it.
            frame: link or joint of the file whose origin touches the ball.
            base: `fixed`, the root link welded to the world, or `floating`: then the first joint,
                `root_joint`, has position and quaternion (xyzw) in q, and linear and angular
                velocity, in the root link's axes, in v.

        Raises:
            UrdfError: the file is refused, with all its faults in one message.
            InvalidInput: there is no such frame or base.
        """
        urdf = read_urdf(path)
        return cls(build_model(urdf.text, urdf.source, base), frame, urdf)

    @classmethod
    def from_robot(
        cls, name: str, frame: str | None = None, *, base: str = "fixed", legs_only: bool = False
    ) -> Leg:
        """Load a robot of the package example-robot-data, `pip install "kickdyn[robots]"`.

        Its base is turned so that it faces x with z up (`human` is drawn with y up, `icub` facing
        -x). All else is the file's own, zero configuration and joint directions included.

        Args:
            name: bolt, g1, human, icub, icub_reduced, romeo, simple_humanoid, talos.
            frame: what touches the ball; if not named, `toe`, on the front of the right foot
                (`simple_humanoid`, whose file shows no foot: the ankle).
            base: `fixed` or `floating`, as for `from_urdf`.
            legs_only: lock all joints but the legs' at 0.

        Raises:
            InvalidInput: no such robot, frame or base, the package is not installed, or a mass
                matrix that is singular (`icub`, `romeo`), with the joints at fault.
        """
        model, known = robot_model(name, base, legs_only=legs_only), robot(name)
        frame, front = known.contact(frame)
        frame_id(model, frame)
        try:
            leg = cls.from_model(model, known.foot)
            leg.posture(leg.configuration())  # singular there is singular everywhere
        except InvalidInput as error:
            if legs_only:
                raise
            raise InvalidInput(f"{error} (legs_only=True keeps the legs' joints)") from None
        return cls(model, frame, robot_file(name), contact_normal_cone=front)

    @classmethod
    def from_model(cls, model: Any, frame: str) -> Leg:
        """Take a copy of a `pin.Model` built elsewhere, `armature` and all.

        Args:
            model: with sound inertias, and mass that moves with every joint; on a fixed base, or
                with a `JointModelFreeFlyer` as its first joint.
            frame: name of one of its frames.

        Raises:
            InvalidInput: not a model, an unsound inertia or placement, or no such frame.
        """
        if not isinstance(model, pin.Model):
            raise InvalidInput(f"model is a {type(model).__name__}: it must be a pinocchio.Model")
        check_model(model)
        return cls(model, frame)

    def locked(self, joints: Mapping[str, float]) -> Leg:
        """Return the leg with joints locked at their values [rad; m for prismatic joints].

        Raises:
            InvalidInput: no such joint, a value that is not finite, or all of the foot's locked.
        """
        joints = validation.mapping("joints", joints)
        q = self.configuration(joints)
        if len(joints) == len(self.joint_names):
            raise InvalidInput(f"all joints of {self.name} are locked: a kick must move one")
        return self._with(reduced_model(self.model, joints, q))

    def with_armature(self, rotors: Mapping[str, float]) -> Leg:
        """Return the leg with rotors behind its joints.

        Args:
            rotors: joint name to rotor inertia times gear ratio squared, 0 or more [kg m2; kg for
                prismatic joints]; it replaces what the joint had.

        Raises:
            InvalidInput: no such joint, or a value below 0.
        """
        model, armature = self.model, self._model.armature.copy()
        for name, value in validation.mapping("rotors", rotors).items():
            armature[self.velocity_index(name)] = validation.number(
                f"armature of {name}", value, at_least=0, unit="kg m2"
            )
        model.armature = armature
        return self._with(model)

    def with_supports(self, *supports: str | Support) -> Leg:
        """Return the leg with frames that stand and are held while the ball is struck.

        Args:
            supports: frames' names, held as flat feet, or `Support`s; they replace any before.

        Raises:
            InvalidInput: no such frame, or one of the kicking limb or of the fixed base.
        """
        held = tuple(Support(s) if isinstance(s, str) else s for s in supports)
        for support in held:
            if not isinstance(support, Support):
                raise InvalidInput(f"support is {support!r}: it must be a frame's name or Support")
        return self._with(self.model, supports=held)

    def with_loops(self, *loops: tuple[str, str]) -> Leg:
        """Return the leg with closed loops: pairs of frames whose origins stay together.

        Each joins two bodies by a ball joint: in a plane, a pin. They replace any before.

        Raises:
            InvalidInput: no such frame, or both on one body.
        """
        for loop in loops:
            if not isinstance(loop, tuple | list) or len(loop) != 2:
                raise InvalidInput(f"loop is {loop!r}: it must be a pair of frames' names")
        return self._with(self.model, loops=tuple((a, b) for a, b in loops))

    def with_model(self, model: Any) -> Leg:
        """Return the leg with another `pin.Model`, which has its frames: a changed copy of its own.

        Raises:
            InvalidInput: a frame of this leg is missing or no joint moves the contact frame.
        """
        return self._with(model)

    def _with(self, model: Any, **changed: Any) -> Leg:
        return Leg(model, self.frame, self.urdf, **(self._held | changed))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the model with the frame's name; the workspace is made anew."""
        return (Leg, (self.model, self.frame, self.urdf, *self._held.values()))

    def __repr__(self) -> str:
        """Name the leg, its joints and its contact frame."""
        return f"Leg({self.name!r}, joints={list(self.joint_names)}, frame={self.frame!r})"

    def _rows(self) -> Iterable[Row]:
        yield "robot", self.name, ""
        yield "contact frame", self.frame, ""
        yield "mass", float(pin.computeTotalMass(self._model)), "kg"
        for name in self._single():
            low, high = (format_value(end) for end in self.joint_range(name))
            yield f"joint {name}", f"{low} to {high}", self.joint_unit(name)

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

    def close_loops(self, q: ArrayLike, keep: Iterable[str] = ()) -> Array:
        """Return a configuration near `q` with all loops closed, by Newton's method.

        Only joints between a loop's ends move, in their ranges or not. Where that fails, it starts
        with these at 0, and leads the kept ones to their values in small steps.

        Args:
            q: to start from, shape `(nq,)` [rad; m for prismatic joints].
            keep: joints that stay as they are.

        Raises:
            InvalidInput: it cannot be closed from there; the gap that is left, and the rank.
        """
        return closed_configuration(self, q, keep)
