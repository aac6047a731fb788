"""A kick in MuJoCo: a contact of finite stiffness, integrated in time, where it is installed.

`scene` writes leg and ball as an MJCF model, `MujocoKick` runs it.
"""

import math
from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

from kickdyn.core import validation
from kickdyn.core.mechanics import rotation_between
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.approach import Approach
from kickdyn.robot.mjcf_file import quiet_mujoco
from kickdyn.robot.mjcf_model import mujoco_state

IMPEDANCE = 0.9999
"""MuJoCo's largest impedance, with which a contact is a spring and a damper alone."""

COMPILER = '<compiler angle="radian" boundmass="1e-9" boundinertia="1e-12"/>'
"""MJCF element that comes before bodies of `write_bodies`, some of which may have no mass."""

TIME_LIMIT = 1.0
"""Time after which leg and ball count as not separating [s]."""


class MujocoContact(NamedTuple):
    """Parameters of a contact, as MuJoCo's `<pair>` has them and `MujocoTuning` describes them.

    `solref` may also be time constant [s] and damping ratio, and a `solreffriction` of (0, 0) means
    `solref`. MuJoCo applies a force halfway between the two surfaces, `collide` at the foot's; with
    the mean deflection as margin both act at the same point on average.
    """

    solref: tuple[float, float] = (0.02, 1.0)
    solimp: tuple[float, float, float, float, float] = (0.9, 0.95, 0.001, 0.5, 2.0)
    friction: float = 0.0
    solreffriction: tuple[float, float] = (0.0, 0.0)
    margin: float = 0.0

    @property
    def condim(self) -> int:
        """Directions in which the contact has forces: 1 without friction, else 3."""
        return 3 if self.friction else 1


def load_mujoco() -> Any:
    """Return the module `mujoco`; raise `InvalidInput` if it is not installed."""
    validation.check_installed("mujoco", "mjcf", "kicks in MuJoCo")
    return import_module("mujoco")


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio, 0 to 0.9, of a linear contact that does not pull, by e."""
    if restitution == 1.0:
        return 0.0

    def excess(ratio: float) -> float:
        returned = math.exp(-ratio / math.sqrt(1.0 - ratio * ratio) * release_phase(ratio))
        return returned - restitution

    return float(brentq(excess, 1e-9, 0.9))


def release_phase(ratio: float) -> float:
    """Return the phase at which a damped spring of a damping ratio stops to push [rad]."""
    swing = math.sqrt(1.0 - ratio * ratio)
    return math.atan2(2.0 * ratio * swing, 2.0 * ratio * ratio - 1.0)


class SimulatedBall(NamedTuple):
    """What a simulated kick gives.

    Attributes:
        velocity: of the ball when the foot stops pushing it, shape `(3,)` [m/s, world frame].
        spin: then, shape `(3,)` [rad/s, world frame].
        contact_time: time steps in which foot and ball push each other [s].
    """

    velocity: Array
    spin: Array
    contact_time: float


class MujocoKick:
    """A kick as a compiled MuJoCo model, whose contact may be changed between runs."""

    def __init__(
        self,
        approach: Approach,
        timestep: float,
        contact: MujocoContact,
        integrator: str = "Euler",
        *,
        gravity: bool = False,
    ) -> None:
        """Compile the model; raise `InvalidInput` if MuJoCo refuses the leg."""
        self.mujoco = load_mujoco()
        self.approach, self.timestep, self.margin = approach, timestep, contact.margin
        text = scene(approach, timestep, contact, integrator, gravity=gravity)
        try:
            with quiet_mujoco():
                self.model = self.mujoco.MjModel.from_xml_string(text)
        except ValueError as error:
            raise InvalidInput(f"MuJoCo refuses {approach.posture.leg.name}: {error}") from None
        self.data = self.mujoco.MjData(self.model)

    def set_contact(self, contact: MujocoContact) -> None:
        """Replace the contact's parameters; its margin, and a lack of friction, stay."""
        self.model.pair_solref[0] = contact.solref
        self.model.pair_solimp[0] = contact.solimp
        self.model.pair_solreffriction[0] = contact.solreffriction
        self.model.pair_friction[0, :2] = contact.friction

    @quiet_mujoco()
    def run(self, phase: float = 0.0, longest: float = TIME_LIMIT) -> SimulatedBall:
        """Return the ball of one simulated kick; MuJoCo writes no warnings.

        The simulation begins a share `phase` of a time step before the first contact, and ends as
        an error where leg and ball have not parted after the time `longest` [s].

        Raises:
            KickdynError: the foot pushes the ball for longer, or the simulation diverges.
        """
        data, step, pushed = self.data, self.timestep, 0
        self.start(phase * step)
        for _ in range(math.ceil(longest / step) + 4):
            self.mujoco.mj_step(self.model, data)
            if self.pushes():
                pushed += 1
            elif pushed:
                break
        else:
            raise KickdynError(f"leg and ball did not separate within {longest:g} s")
        velocity = data.qvel[-6:-3].copy()
        if not np.isfinite(velocity).all():
            raise KickdynError("the simulation of leg and ball diverged")
        return SimulatedBall(velocity, ball_spin(data), pushed * step)

    def pushes(self) -> bool:
        """Return whether foot and ball pushed each other in the last step."""
        data = self.data
        address = int(data.contact.efc_address[0]) if data.ncon else -1
        return address >= 0 and bool(data.efc_force[address] > 0.0)

    def start(self, before: float) -> None:
        """Set the state at a time [s] before the first contact."""
        mujoco, model, data = self.mujoco, self.model, self.data
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_integratePos(model, data.qpos, data.qvel, -before)
        mujoco.mj_forward(model, data)
        data.qvel -= before * data.qacc


def ball_spin(data: Any) -> Array:
    """Return the spin of the ball, which is MuJoCo's last body [rad/s, world frame]."""
    w, x, y, z = data.qpos[-4:]
    return np.asarray(pin.Quaternion(w, x, y, z).matrix() @ data.qvel[-3:])  # in the ball's axes


def scene(
    approach: Approach,
    timestep: float,
    contact: MujocoContact,
    integrator: str = "Euler",
    *,
    gravity: bool = False,
) -> str:
    """Return an MJCF model of the leg, with a flat face at its toe, and the ball before it.

    The bodies have the names of the leg's joints; the keyframe is the state at first contact.
    Raises `InvalidInput` for a leg with supports, loops, mimic or stiff joints, or with joints of
    a kind that URDF and MJCF files do not have.
    """
    posture, ball = approach.posture, approach.ball
    posture.leg.check_base_at_rest("MuJoCo")
    if posture.leg.constraints is not None:
        raise InvalidInput(
            f"{posture.leg.name} has supports, loops, mimic joints or stiff joints: a kick in "
            "MuJoCo is simulated for a leg without any"
        )
    ball.check_movable("a kick in MuJoCo")
    model = posture.leg.model
    normal = posture.rotation_world_joint.T @ approach.contact.normal
    face = rotation_between(np.array([0.0, 0.0, 1.0]), normal)
    foot = (
        f'<geom name="foot" type="box" size="1 1 0.1" quat="{quaternion(face)}" '
        f'pos="{row(posture.contact_lever - 0.1 * normal)}" contype="0" conaffinity="0" '
        'rgba="0.5 0.5 0.5 0.3"/>'
    )
    foot += _link(posture.contact_lever)
    bodies = write_bodies(model, {posture.leg.contact_joint: foot})
    weight = row(model.gravity.linear) if gravity else "0 0 0"
    centre = posture.contact_point + ball.radius * approach.contact.normal
    before = approach.ball_before
    q, v = mujoco_state(model, posture.q, approach.v)
    qpos = row([*q, *centre, 1.0, 0.0, 0.0, 0.0])
    qvel = row([*v, *before.velocity, *before.spin])
    return f"""<mujoco>
  {COMPILER}
  <option gravity="{weight}" timestep="{timestep!r}" integrator="{integrator}" cone="elliptic" \
impratio="100" tolerance="1e-14"/>
  <worldbody>
    {bodies}<body name="ball" pos="{row(centre)}"><freejoint/>
      <inertial pos="0 0 0" mass="{ball.mass!r}" diaginertia="{row([ball.inertia] * 3)}"/>
      <geom name="ball" type="sphere" size="{ball.radius - contact.margin!r}" \
contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <contact>
    {pair(contact, "foot")}
  </contact>
  <keyframe><key name="first contact" qpos="{qpos}" qvel="{qvel}"/></keyframe>
</mujoco>"""


def pair(contact: MujocoContact, foot: str) -> str:
    """Return the MJCF element of the contact between the ball and a geom of the foot."""
    mu = float(contact.friction)
    return (
        f'<pair geom1="{foot}" geom2="ball" condim="{contact.condim}" '
        f'solref="{row(contact.solref)}" solimp="{row(contact.solimp)}" '
        f'friction="{mu!r} {mu!r} 0 0 0" margin="{contact.margin!r}" '
        f'solreffriction="{row(contact.solreffriction)}"/>'
    )


def write_bodies(model: Any, geoms: Mapping[int, str], *, limits: bool = False) -> str:
    """Return the MJCF elements of a `pin.Model`'s bodies, in the order of `mujoco_state`.

    Bodies and joints have the names of the model's joints. Links between joints are drawn and
    collide with nothing. `geoms` has further elements in the body of a joint, by its number; with
    `limits`, joints stop at the ends of their range.

    Raises:
        InvalidInput: a joint of a kind that MuJoCo does not have.
    """
    children = model.children

    def body(joint: int) -> str:
        ends = (model.jointPlacements[child].translation for child in children[joint])
        links = "".join(_link(end) for end in ends)
        inside = "".join(body(child) for child in children[joint])
        opening = _body(model, joint, limits=limits)
        return f"{opening}{geoms.get(joint, '')}{links}{inside}</body>\n    "

    return "".join(body(joint) for joint in children[0])


def _body(model: Any, joint: int, *, limits: bool) -> str:
    """Return the opening of a body: its place, inertia and joint."""
    placement, inertia = model.jointPlacements[joint], model.inertias[joint]
    moments = inertia.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    moments[:3] += 1e-12 * (inertia.mass == 0.0)  # a joint of several, without a body of its own
    kind, index, size = model.joints[joint].shortname(), model.idx_vs[joint], model.nvs[joint]
    armature, name = float(model.armature[index]), quoteattr(model.names[joint])
    if kind == "JointModelFreeFlyer":
        element = f"<freejoint name={name}/>"
    elif kind == "JointModelSpherical":
        element = f'<joint name={name} type="ball" armature="{armature!r}"/>'
    elif size == 1:
        columns = pin.computeJointJacobian(model, model.createData(), pin.neutral(model), joint)
        axis = columns.reshape(6, model.nv)[:, index]  # a vector where nv is 1
        slides = bool(axis[:3].any())
        along = row(axis[:3] if slides else axis[3:])
        motion = "slide" if slides else "hinge"
        element = f'<joint name={name} type="{motion}" axis="{along}" armature="{armature!r}"'
        number = model.idx_qs[joint]
        ends = model.lowerPositionLimit[number], model.upperPositionLimit[number]
        stops = limits and model.nqs[joint] == 1 and np.isfinite(ends).all()
        element += f' range="{row(ends)}"/>' if stops else "/>"
    else:
        raise InvalidInput(f"joint {name} is a {kind}: MuJoCo has no joint of this kind")
    return (
        f'<body name={name} pos="{row(placement.translation)}" '
        f'quat="{quaternion(placement.rotation)}">'
        f'<inertial pos="{row(inertia.lever)}" mass="{inertia.mass!r}" '
        f'fullinertia="{row(moments)}"/>{element}'
    )


def _link(end: Array) -> str:
    """Return a geom from the origin of a body to a point, which is seen but collides with nothing.

    Empty for a point near the origin, to which MuJoCo draws none.
    """
    if np.linalg.norm(end) < 1e-3:
        return ""
    fixed = 'size="0.02" contype="0" conaffinity="0"'
    return f'<geom type="capsule" fromto="0 0 0 {row(end)}" {fixed}/>'


def row(values: Any) -> str:
    """Return numbers as the text of an MJCF attribute, with all their digits."""
    return " ".join(repr(float(value)) for value in values)


def quaternion(rotation: Array) -> str:
    """Return a rotation matrix as the quaternion of an MJCF attribute, the real part first."""
    q = pin.Quaternion(rotation)
    return row([q.w, q.x, q.y, q.z])
