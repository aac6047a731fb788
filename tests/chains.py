"""Legs for tests: random chains of 1 to 7 joints, bodies on rails; momentum and energy."""

from pathlib import Path

import numpy as np
import pinocchio as pin

import kickdyn as kd
from kickdyn.robot.robot_file import RobotFile
from kickdyn.robot.urdf_file import shipped_urdf


def random_rotation(rng):
    q = rng.normal(size=4)
    return pin.Quaternion(q / np.linalg.norm(q)).matrix()


def random_inertia(rng, share=1.0):
    a, b, c = rng.uniform(0.001, 0.05, size=3)  # sums of pairs keep the triangle inequality
    turn = random_rotation(rng)
    moments = turn @ np.diag([a + b, b + c, c + a]) @ turn.T
    mass, lever = rng.uniform(0.2, 8.0), rng.uniform(-0.2, 0.2, size=3)
    return pin.Inertia(share * mass, share * lever, share**3 * moments)


def shapes(touching=(), drawn=()):
    """A robot's file of shapes for contacts, and of those that it draws."""
    file = RobotFile("", Path(), "leg")
    vars(file).update(collisions=lambda: touching, visuals=lambda: drawn)
    return file


def at(x, y, z):
    """A place without a turn."""
    return pin.SE3(np.eye(3), np.array([x, y, z], float))


def serial(joints, toe, name="chain"):
    """A pin.Model of joints one after the other, with a frame `toe` on the last one.

    Each is its name, its joint, its place on the one before, and its body.
    """
    model, parent = pin.Model(), 0
    model.name = name
    for joint, kind, place, body in joints:
        parent = model.addJoint(parent, kind, place, joint)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", parent, 0, toe, pin.FrameType.OP_FRAME))
    return model


def fourbar():
    """A knee of two crossed rockers between thigh and shank, closed."""
    tree = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
    return tree.with_loops(("shank_pin", "rocker_b_tip"))


def random_leg(rng, joints=None, last=1.0):
    """A leg of revolute joints about any axis, now and then a prismatic one.

    The last body's mass and lengths are `last` times what they would be.
    """
    links, count = [], joints or rng.integers(1, 8)
    for k in range(count):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        kind = pin.JointModelPrismaticUnaligned if rng.random() < 0.15 else None
        kind = kind or pin.JointModelRevoluteUnaligned
        offset = pin.SE3(random_rotation(rng), rng.uniform(-0.4, 0.4, size=3))
        body = random_inertia(rng, last if k == count - 1 else 1.0)
        links.append((f"joint{k + 1}", kind(axis), offset, body))
    tip = pin.SE3(random_rotation(rng), last * rng.uniform(0.1, 0.4, size=3))
    return kd.Leg.from_model(serial(links, tip), "toe")


def random_kick(rng, leg, **contact):
    """A posture, joint velocity, ball and contact that approach each other."""
    q = rng.uniform(-2, 2, size=leg.nq)
    v = rng.normal(size=leg.nv) * 3
    ball = kd.Ball(mass=rng.uniform(0.05, 2), radius=rng.uniform(0.02, 0.2))
    ball_velocity, ball_spin = rng.normal(size=3), rng.normal(size=3) * 20
    posture = leg.posture(q)
    closing = posture.point_velocity(v) - ball_velocity
    normal = closing / np.linalg.norm(closing) + rng.uniform(-0.55, 0.55, size=3)
    contact = kd.Contact(normal, **{"restitution": rng.uniform(0, 1), **contact})
    return (posture, v, ball, contact), {"ball_velocity": ball_velocity, "ball_spin": ball_spin}


def any_kick(rng, leg, **contact):
    """As `random_kick`, for legs with a floating base, supports or loops."""
    model = leg.model
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-0.7, 0.7, size=leg.nv))
    posture = leg.posture(leg.close_loops(q) if leg.constraints else q)
    v = posture.admissible(rng.normal(size=leg.nv) * 2)
    ball_velocity, ball_spin = rng.normal(size=3) * 0.3, rng.normal(size=3) * 20
    closing = posture.point_velocity(v) - ball_velocity
    normal = closing / np.linalg.norm(closing) + rng.uniform(-0.3, 0.3, size=3)
    contact = kd.Contact(normal, **{"restitution": rng.uniform(0, 1), **contact})
    motion = {"ball_velocity": ball_velocity, "ball_spin": ball_spin}
    return (posture, v, kd.Ball(), contact), motion


def floating_leg(rng):
    """A free base, a continuous joint (cos, sin) and a hinge."""
    kinds = pin.JointModelFreeFlyer(), pin.JointModelRUBX(), pin.JointModelRY()
    places = [pin.SE3(random_rotation(rng), rng.uniform(-0.4, 0.4, size=3)) for _ in kinds]
    bodies = [random_inertia(rng) for _ in kinds]
    joints = zip(("base", "hip", "knee"), kinds, places, bodies, strict=True)
    return kd.Leg.from_model(serial(joints, at(0.1, 0.2, -0.3)), "toe")


def floating_kick(rng, **contact):
    """A kick by a `floating_leg`."""
    return any_kick(rng, floating_leg(rng), **contact)


def free_body(mass=1.95):
    """A body without support or gravity, whose contact frame is beside its centre of mass."""
    here = pin.SE3.Identity()
    body = pin.Inertia(mass, np.array([-0.05, 0.01, 0.02]), np.diag([0.01, 0.02, 0.015]))
    model = serial([("free", pin.JointModelFreeFlyer(), here, body)], here)
    model.gravity = pin.Motion.Zero()
    return kd.Leg.from_model(model, "toe").posture([0, 0, 0, 0, 0, 0, 1])


def rails(axes="x", mass=2.0, gravity=False):
    """A mass that slides along each of some axes; the carriages between hardly weigh anything."""
    joints, here = [], pin.SE3.Identity()
    for axis in axes:
        body = mass if axis == axes[-1] else 1e-9
        inertia = pin.Inertia(body, np.zeros(3), 0.01 * np.eye(3))
        joints.append((f"rail_{axis}", getattr(pin, f"JointModelP{axis.upper()}")(), here, inertia))
    model = serial(joints, here)
    if not gravity:
        model.gravity = pin.Motion.Zero()
    return kd.Leg.from_model(model, "toe")


def momentum(leg, q, v, ball=None, state=None):
    """Linear momentum, and angular about the world's origin, of a robot and a ball, `(6,)`."""
    model = leg.model
    data = model.createData()
    robot = pin.computeCentroidalMomentum(model, data, q, v)
    total = np.concatenate([robot.linear, robot.angular + np.cross(data.com[0], robot.linear)])
    if ball is None:
        return total
    linear = ball.mass * state.velocity
    turning = ball.inertia * state.spin + np.cross(state.position, linear)
    return total + np.concatenate([linear, turning])


def kinetic_energy(posture, v, ball, state):
    """Kinetic energy of leg and ball [J]."""
    model = posture.leg.workspace.model
    leg = v @ pin.crba(model, model.createData(), posture.q) @ v
    turning = ball.inertia * state.spin @ state.spin if ball.inertia < np.inf else 0.0
    return 0.5 * (leg + ball.mass * state.velocity @ state.velocity + turning)


def in_units(leg, metre, kilogram):
    """The same leg in units of which so many make a metre and a kilogram, without gravity."""
    model, sliding = leg.model, slides(leg)
    model.gravity = pin.Motion.Zero()
    for k in range(1, model.njoints):
        body = model.inertias[k]
        moments = kilogram * metre**2 * body.inertia
        model.inertias[k] = pin.Inertia(kilogram * body.mass, metre * body.lever, moments)
        model.jointPlacements[k].translation *= metre
    model.armature = model.armature * kilogram * metre ** (2 - 2 * sliding)
    for frame in model.frames:
        frame.placement.translation *= metre
    return kd.Leg.from_model(model, leg.frame)


def slides(leg):
    """1 for velocities along axes, 0 for those about axes; joints do not mix them."""
    model, data = leg.model, leg.model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    motions = [np.reshape(joint.S, (6, -1)) for joint in list(data.joints)[1:]]
    return np.concatenate([1.0 * axes[:3].any(axis=0) for axes in motions])


def constraint_speed(impact):
    """The largest velocity after an impact of what supports and loops hold [m/s, rad/s]."""
    projector = impact.posture.constraint_projector
    if projector is None or not projector.blocks:
        return 0.0
    held = projector.blocks[-1].rows.stop
    return np.abs(projector.rows[:held] @ impact.v_after).max()
