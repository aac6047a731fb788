"""Floor, robot and ball as a model of MuJoCo, whose drives follow a motion.

The robot and its surroundings may differ from the model for which a kick was planned.
"""

import math
from dataclasses import dataclass, fields
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.impact_result import Impact
from kickdyn.motion.motion import Motion
from kickdyn.robot.ground_clearance import Spheres, extreme_spheres
from kickdyn.robot.leg import Leg
from kickdyn.robot.mjcf_file import quiet_mujoco
from kickdyn.robot.mjcf_model import mujoco_state
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.standing import StandingRobot, joint_spheres
from kickdyn.simulators.mujoco_kick import (
    COMPILER,
    ball_spin,
    load_mujoco,
    pair,
    row,
    write_bodies,
)
from kickdyn.simulators.striking_foot import StrikingFoot, plate
from kickdyn.simulators.tune_mujoco import MujocoTuning


class Disturbance(NamedTuple):
    """One difference of a simulated kick from its plan.

    Attributes:
        masses: factors of mass and inertia of the bodies of the robot, shape `(n,)`.
        ground_friction, ball_friction: factors of the coefficients of friction.
        delay: time by which commands reach the drives late [s].
        place: displacement of the ball along x and y, shape `(2,)` [m, world frame].
    """

    masses: Array
    ground_friction: float
    ball_friction: float
    delay: float
    place: Array


@dataclass(frozen=True)
class KickNoise:
    """How much simulated kicks differ from their plan, see `run_in_mujoco`.

    All but the delay are normal, cut off at three standard deviations. The default values are
    choices of ours, not measurements.

    Attributes:
        mass: standard deviation of the mass of each body of the robot, relative, at most 0.3.
        friction: that of the coefficients of friction of ground and ball, relative, at most 0.3.
        delay: largest time by which all commands of a kick reach the drives late, uniform from 0
            on [s], at most 0.1.
        place: standard deviation of the position of the ball along x, and along y [m], at most 0.1.

    Raises:
        InvalidInput: a value out of range.
    """

    mass: float = 0.02
    friction: float = 0.1
    delay: float = 0.005
    place: float = 0.005

    def __post_init__(self) -> None:
        for entry in fields(self):
            most = 0.3 if entry.name in ("mass", "friction") else 0.1
            validation.number(entry.name, getattr(self, entry.name), at_least=0, at_most=most)


def draw(noise: KickNoise, seed: int, bodies: int) -> Disturbance:
    """Return the disturbance of a seed, for a robot of so many bodies."""
    random = np.random.default_rng(seed)
    delay = noise.delay * float(random.uniform())
    normal = np.clip(random.normal(size=bodies + 4), -3.0, 3.0)
    ground, ball = (1.0 + noise.friction * normal[:2]).tolist()
    return Disturbance(
        masses=1.0 + noise.mass * normal[4:],
        ground_friction=ground,
        ball_friction=ball,
        delay=delay,
        place=noise.place * normal[2:4],
    )


POSITION_GAIN = 8.0
"""Stiffness of the controller over a joint's torque limit [1/rad; 1/m]."""

DAMPING_RATIO = 0.3
"""Of a joint with this stiffness and its inertia in the planned posture of the impact. With 1 the
controller pushes the foot on while the ball brakes it, and the ball gets up to 8 % more speed."""

LARGEST_TILT, LEAST_HEIGHT = math.radians(45.0), 0.7
"""Tilt of the trunk [rad], and height of the base over its planned one, of an upright robot."""

PARKING_HEIGHT = 100.0
"""Height at which an untouchable ball is [m]."""

CORNER_RADIUS = 5e-3
"""Radius of the spheres at the corners of the sole [m]."""

BURIED = 5e-3
"""Depth under the ground at which the kicking foot may begin [m]: more would throw the robot up."""

PRESSED = 1e-9
"""Depth of the sole in the floor at first [m]: with less, rounding decides which corners touch."""

LEAST_RADIUS = 1e-4
"""Radius of the spheres that stand for corners of the kicking foot [m]."""

FLOOR = 'solref="0.005 1" solimp="0.99 0.999 0.001 0.5 2"'
"""Contact of floor and feet: stiff and without rebound, as MuJoCo's attributes."""


class MujocoField:
    """The compiled model of floor, robot and ball, and the motion as its drives' references."""

    def __init__(
        self,
        motion: Motion,
        impact: Impact,
        standing: StandingRobot | None,
        tuning: MujocoTuning,
        disturbance: Disturbance,
        foot: StrikingFoot | None = None,
    ) -> None:
        self.disturbance, self.warnings = disturbance, list[str]()
        self.foot, self.sole = plate(impact) if foot is None else foot, range(0)
        self.mujoco, self.motion, self.impact = load_mujoco(), motion, impact
        self.standing, self.timestep = standing, tuning.timestep
        robot = motion.robot
        self.joints = robot.single_joints
        self.columns = [robot.velocity_index(name) for name in self.joints]
        self.limits = robot.effort_limit[self.columns]
        for name, limit in zip(self.joints, self.limits, strict=True):
            if not 0.0 < limit < math.inf:
                raise InvalidInput(
                    f"joint {name!r} has the torque limit {limit:g}: a controller in MuJoCo needs "
                    "one above 0, as <limit effort=...> of a URDF"
                )
        with quiet_mujoco():
            self.model = self.mujoco.MjModel.from_xml_string(self._text(tuning))
        self.data = self.mujoco.MjData(self.model)
        bodies = [self.model.body(str(name)).id for name in robot.model.names[1:]]
        self.model.body_mass[bodies] *= disturbance.masses
        self.model.body_inertia[bodies] *= disturbance.masses[:, None]
        self.mujoco.mj_setConst(self.model, self.data)
        self.addresses = [int(self.model.joint(name).qposadr[0]) for name in self.joints]
        self.rates = [int(self.model.joint(name).dofadr[0]) for name in self.joints]
        self.striking = {self.model.geom(name).id for name in self.foot.geoms}
        if standing is not None:
            index = self.model.geom("sole 0").id
            self.sole = range(index, index + len(self.corners))

    def set_gains(self, rooted: Leg, q: Array) -> None:
        """Set stiffness and damping of the drives by the inertias of joints in a posture.

        The inertias are of the robot on its supporting foot.
        """
        inertia = np.diag(pin.crba(rooted.model, rooted.model.createData(), q))
        inertia = inertia[[rooted.velocity_index(name) for name in self.joints]]
        self.stiffness = POSITION_GAIN * self.limits
        self.damping = 2.0 * DAMPING_RATIO * np.sqrt(self.stiffness * inertia)
        self.model.actuator_biasprm[:, 1] = -self.stiffness
        self.model.actuator_biasprm[:, 2] = -self.damping

    def _text(self, tuning: MujocoTuning) -> str:
        """Return the model in MJCF."""
        robot, ball, contact = self.motion.robot, self.impact.ball, tuning.contact
        contact = contact._replace(friction=self.disturbance.ball_friction * contact.friction)
        model, geoms = robot.model, {robot.contact_joint: "".join(self.foot.geoms.values())}
        pairs, floor = "".join(pair(contact, name) for name in self.foot.geoms), ""
        if self.standing is not None:
            floor = '<geom name="floor" type="plane" size="9 9 1"/>'
            support, level = self.standing.support, self.standing.placement.rotation[2]
            frame = model.frames[frame_id(model, support.frame)]
            corners = [frame.placement.act(c + CORNER_RADIUS * level) for c in self.corners]
            radii = np.full(len(corners), CORNER_RADIUS)
            mu = self.friction
            for name, joint, body in (
                ("sole", int(frame.parentJoint), Spheres(np.array(corners), radii)),
                ("foot", robot.contact_joint, self._foot_on_floor()),
            ):
                for number, centre in enumerate(body.centres):
                    radius = max(float(body.radii[number]), LEAST_RADIUS)
                    geoms[joint] = geoms.get(joint, "") + (
                        f'<geom name="{name} {number}" type="sphere" size="{radius!r}" '
                        f'pos="{row(centre)}"/>'
                    )
                    pairs += (
                        f'<pair geom1="floor" geom2="{name} {number}" condim="3" {FLOOR} '
                        f'friction="{mu!r} {mu!r} 0 0 0"/>'
                    )
        motors = "".join(
            f'<general joint={quoteattr(name)} gainprm="1" biastype="affine" biasprm="0 0 0" '
            f'forcelimited="true" forcerange="{-limit!r} {limit!r}"/>'
            for name, limit in zip(self.joints, self.limits.tolist(), strict=True)
        )
        return f"""<mujoco>
  {COMPILER}
  <default><geom contype="0" conaffinity="0"/></default>
  <asset>{self.foot.assets}</asset>
  <option gravity="{row(model.gravity.linear)}" timestep="{self.timestep!r}" \
integrator="{tuning.integrator}" cone="elliptic" impratio="100" tolerance="1e-10"/>
  <worldbody>
    {floor}{write_bodies(model, geoms, limits=True)}<body name="ball"><freejoint/>
      <inertial pos="0 0 0" mass="{ball.mass!r}" diaginertia="{row([ball.inertia] * 3)}"/>
      <geom name="ball" type="sphere" size="{ball.radius - contact.margin!r}"/>
    </body>
  </worldbody>
  <contact>{pairs}</contact>
  <actuator>{motors}</actuator>
</mujoco>"""

    def _foot_on_floor(self) -> Spheres:
        """Return the spheres of the kicking foot that the floor holds up, in its joint's axes."""
        robot, motion = self.motion.robot, self.motion
        foot = joint_spheres(robot, robot.contact_joint)
        extremes, _ = extreme_spheres(foot)
        foot, data = Spheres(foot.centres[extremes], foot.radii[extremes]), robot.model.createData()
        pin.forwardKinematics(robot.model, data, motion.q(motion.begin))
        depth = -foot.moved(data.oMi[robot.contact_joint].homogeneous).lowest
        if depth <= BURIED:
            return foot
        self.warnings.append(
            f"the kicking foot begins {1e3 * depth:.0f} mm under the ground: the floor does not "
            "hold it up"
        )
        return Spheres(foot.centres[:0], foot.radii[:0])

    @property
    def corners(self) -> Array:
        """Corners of the sole, shape `(k, 3)` [m, support frame]; none on a fixed base."""
        sole = None if self.standing is None else self.standing.support.sole
        return np.zeros((0, 3)) if sole is None else sole

    @property
    def friction(self) -> float:
        """Coefficient of friction of floor and sole, of 1 where the support has none."""
        friction = None if self.standing is None else self.standing.support.friction
        return self.disturbance.ground_friction * (1.0 if friction is None else friction)

    def reference(self, t: float, *, feed_forward: bool) -> Array:
        """Return the drives' controls for the motion at a time [s]; late ones for one at 0."""
        state = self.motion.state(t)
        values = self.motion.robot.joint_values(state.q)
        position = np.array([values[name] for name in self.joints])
        control = self.stiffness * position + self.damping * state.v[self.columns]
        if feed_forward:
            control += state.torque[self.columns]
        return np.asarray(control)

    def place(self) -> None:
        """Set the state in which the motion begins, and the ball where it lies."""
        motion, data = self.motion, self.data
        q = motion.q(motion.begin)
        self.mujoco.mj_resetData(self.model, data)
        data.qpos[:-7] = mujoco_state(motion.robot.model, q, np.zeros(motion.robot.nv))[0]
        if self.standing is not None:
            data.qpos[2] -= PRESSED

    def set_ball(self, t: float) -> Array:
        """Put the ball where it is at a time [s] before the contact; return this place, `(3,)`.

        It is out of reach until the foot can touch it.
        """
        before, data = self.impact.ball_before, self.data
        place = before.position + t * before.velocity
        place[:2] += self.disturbance.place
        data.qpos[-7:] = [*place, 1.0, 0.0, 0.0, 0.0]
        if t < -self.foot.touchable:
            data.qpos[-5] += PARKING_HEIGHT
        data.qvel[-6:] = [*before.velocity, *before.spin]
        return place

    def ball(self, t: float) -> BallState:
        """Return the ball at a time [s]."""
        data = self.data
        return BallState(data.qpos[-7:-4].copy(), data.qvel[-6:-3].copy(), ball_spin(data), t)

    def pushes(self) -> bool:
        """Return whether the foot pushed the ball in the last step."""
        contacts = self.data.contact
        rows = zip(contacts.geom.tolist(), contacts.efc_address.tolist(), strict=True)
        return any(
            row >= 0 and self.data.efc_force[row] > 0.0
            for geoms, row in rows
            if not self.striking.isdisjoint(geoms)
        )

    def sole_load(self) -> Array:
        """Return the force of the floor on the sole, and the moment of its normal force, `(5,)`.

        The force is along the normal, then across it [N]. The moment is the normal force times x
        and y [N m] of the corners on which it acts, with the sole at its planned place.
        """
        load, force = np.zeros(5), np.zeros(6)
        if self.standing is None:
            return load
        for number, pair_of_geoms in enumerate(self.data.contact.geom):
            for corner in set(pair_of_geoms.tolist()) & {*self.sole}:
                self.mujoco.mj_contactForce(self.model, self.data, number, force)
                load[:3] += force[:3]
                load[3:] += force[0] * self.standing.sole[corner - self.sole.start]
        return load

    def is_upright(self, planned: Array) -> bool:
        """Return whether the base is as high and upright as in a planned configuration."""
        if self.standing is None:
            return True
        model = self.motion.robot.model
        data = model.createData()
        pin.forwardKinematics(model, data, planned)
        body, pose = self.data.body(str(model.names[1])), data.oMi[1]
        cosine = float(body.xmat.reshape(3, 3)[2] @ pose.rotation[2])  # of the two vertical axes
        height = float(body.xpos[2] / pose.translation[2])
        return cosine > math.cos(LARGEST_TILT) and height > LEAST_HEIGHT
