"""Kinematics, inertia and Newton-Euler of any tree of hinges and slides, `BATCH` postures at once.

All vectors have the contact's axes (first and second tangent, normal). Moments are about the
joint's own origin, so that a light foot far from the hip loses no digits. Every joint turns about,
or slides along, the z axis of its own frame. The algorithms are from Featherstone, Rigid Body
Dynamics Algorithms, 2008, written for batches, see `kickdyn.core.lanes`.

Machine code has no fused multiply-adds: which of them the compiler finds depends on what it
inlines, and a resumed sweep must have the same bits as one that ran at once.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kickdyn.core.lanes import BATCH, choose, inlined, jitable, larger, magnitude, spread
from kickdyn.core.mechanics import rotation_between
from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg

JOINT = np.dtype(
    [
        ("parent", np.int64),  # the joint that carries this one, 0 for the base
        ("slides", np.bool_),  # whether the joint is prismatic
        ("carries_foot", np.bool_),  # whether the foot moves with the joint
        ("aligned", np.bool_),  # whether `rotation` is the identity
        ("rotation", float, (3, 3)),  # from the parent's frame to this one's, the joint at 0
        ("origin", float, 3),  # in the parent's frame [m]
        ("mass", float),  # of the joint's body [kg]
        ("moment", float, 3),  # first moment of mass of the body about the joint's origin [kg m]
        ("inertia", float, 6),  # second moment xx, xy, xz, yy, yz, zz [kg m2]
        ("carried_mass", float),  # of all bodies that the joint carries [kg]
        ("armature", float),  # inertia of the rotor [kg m2; kg]
        ("speed_limit", float),  # [rad/s; m/s]
    ],
    align=True,
)
"""The constants of a joint and its body, in a frame whose z axis is the joint's.

The frame of the base has the axes in which all vectors are, and the origin of the first joint.
"""

BODY = np.dtype(
    [
        ("cosine", float, BATCH),  # of the joint's angle; the value of a slide [m]
        ("sine", float, BATCH),  # of the joint's angle
        ("rotation", float, (3, 3, BATCH)),  # of the body
        ("origin", float, (3, BATCH)),  # from the parent's origin [m]
        ("carried_moment", float, (3, BATCH)),  # moments of mass of all bodies that the joint
        ("carried_inertia", float, (6, BATCH)),  # carries, in the order of `JOINT`
        ("moment", float, (3, BATCH)),  # moments of the joint's body alone
        ("inertia", float, (6, BATCH)),
        ("jacobian", float, (3, BATCH)),  # velocity of the contact point per velocity of the joint
        ("jump", float, BATCH),  # of the joint's velocity [rad/s; m/s]
        ("turn", float, (3, BATCH)),  # jump of the body's angular velocity [rad/s]
        ("velocity", float, (3, BATCH)),  # jump of its origin's velocity [m/s]
        ("force", float, (3, BATCH)),  # linear impulse that the parent transmits [N s]
        ("torque", float, (3, BATCH)),  # angular impulse that the parent transmits [N m s]
    ]
)
"""What is computed of each joint and its body; cosine and sine are given."""


MOTION = np.dtype(
    [
        ("speed", float, BATCH),  # of the joint [rad/s; m/s]; given
        ("acceleration", float, (3, BATCH)),  # of the body's origin, if no joint accelerates [m/s2]
        ("turning", float, (3, BATCH)),  # angular acceleration of the body, likewise [rad/s2]
        ("free", float, BATCH),  # torque that accelerates the joint [N m; N], then whitened
    ]
)
"""How joints and bodies move, beside `BODY`, whose `turn` and `velocity` are then no jumps."""

STATE = np.dtype(
    [
        ("point", float, (3, BATCH)),  # contact point from the origin of the foot's joint [m]
        ("from_base", float, (3, BATCH)),  # contact point from the origin of the first joint [m]
        ("velocity", float, (3, BATCH)),  # of the ball over the foot [m/s]
        ("needed", float, (3, BATCH)),  # velocity that the joints must give the contact point [m/s]
        ("jacobian_square", float, BATCH),  # sum of squares of the contact point's Jacobian
        ("delassus", float, (6, BATCH)),  # Delassus matrix of the foot [1/kg]
        ("impulse", float, (3, BATCH)),  # on the ball along both tangents and the normal [N s]
        ("energy_lost", float, BATCH),  # [J]
        ("slips", float, BATCH),  # 1 where the direction of a slip is to be found
        ("speed_use", float, BATCH),  # least possible largest joint speed over its limit
        ("doubt", float, BATCH),  # 1 where digits are lost, else 0
        ("foot_jump", float, BATCH),  # of the foot's velocity along the normal [m/s]
        ("largest_square", float, BATCH),  # of the linear impulse in a joint [N2 s2]
        ("momentum_error", float, BATCH),  # largest residual of the momentum balance
    ]
)
"""What is computed of each posture."""

D11, D12, D22, D13, D23, D33 = range(6)
"""Entries of the Delassus matrix along first tangent (1), second tangent (2) and normal (3)."""

LEAST_PIVOT = 1e-12
"""Share that a pivot must keep of its diagonal entry of M, or it has lost its digits."""


class TreeJoints(NamedTuple):
    """The joints of a fixed-base tree of hinges and slides, at q = 0."""

    slides: NDArray[np.bool_]  # which are prismatic
    axes: list[Array]  # in the axes of each joint
    world_axes: list[Array]


def hinges_and_slides(leg: Leg) -> TreeJoints | None:
    """Return the joints of a leg; None with a floating base, constraints, or other joints."""
    model = leg.workspace.model
    if leg.constraints is not None or any(nv != 1 for nv in list(model.nvs)[1:]):
        return None
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    columns = [np.ravel(data.joints[k].S) for k in range(1, model.njoints)]
    if any(column[:3].any() and column[3:].any() for column in columns):
        return None  # helical
    slides = np.array([not column[3:].any() for column in columns])
    axes = [column[:3] + column[3:] for column in columns]
    world_axes = [data.oMi[k].rotation @ axis for k, axis in enumerate(axes, 1)]
    return TreeJoints(slides, axes, world_axes)


def joint_tree(
    leg: Leg, joints: TreeJoints, base_axes: Array
) -> tuple[NDArray[Any], list[Array], Array]:
    """Return geometry and inertia of joints, dtype `JOINT`, shape `(n + 1,)`; their frames; senses.

    A frame has the axes in which a joint is described as columns, z along the joint; that of the
    base comes first. The sense is -1 for each joint whose axis is reversed in its frame, because
    its largest component is negative, else 1: parallel joints have aligned frames.
    """
    model = leg.workspace.model
    senses = np.array([1.0, *(np.sign(axis[np.argmax(np.abs(axis))]) for axis in joints.axes)])
    z = np.array([0.0, 0.0, 1.0])
    frames = [base_axes, *(rotation_between(z, axis) for axis in senses[1:, None] * joints.axes)]
    data, v = model.createData(), [model.idx_vs[k] for k in range(1, model.njoints)]
    pin.computeSubtreeMasses(model, data)
    tree = np.zeros(model.njoints, JOINT)
    tree["parent"], tree["slides"][1:] = list(model.parents), joints.slides
    tree["carries_foot"][list(model.supports[leg.contact_joint])[1:]] = True
    tree["carried_mass"][1:] = list(data.mass)[1:]
    tree["armature"][1:], tree["speed_limit"][1:] = model.armature[v], leg.velocity_limit[v]
    of_base = model.jointPlacements[1].translation
    for k in range(1, model.njoints):
        joint, placement, inertia = tree[k], model.jointPlacements[k], model.inertias[k]
        parent, frame = frames[model.parents[k]], frames[k]
        rotation = parent.T @ placement.rotation @ frame
        # largest entry of a rotation minus the identity that is taken for rounding
        joint["aligned"] = np.abs(rotation - np.eye(3)).max() < 1e-15
        joint["rotation"] = rotation
        joint["origin"] = parent.T @ (placement.translation - (0 if model.parents[k] else of_base))
        joint["mass"] = inertia.mass
        joint["moment"] = frame.T @ (inertia.mass * inertia.lever)
        second = inertia.matrix()[3:, 3:]
        joint["inertia"] = (frame.T @ second @ frame)[np.triu_indices(3)]
    return tree, frames, senses


@lru_cache(maxsize=8)
def tree_in_world_axes(leg: Leg) -> tuple[NDArray[Any], list[Array], Array] | None:
    """Return the `joint_tree` of a leg on the axes of the world; None as `hinges_and_slides`."""
    joints = hinges_and_slides(leg)
    return None if joints is None else joint_tree(leg, joints, np.eye(3))


@inlined
def vector(rows):  # type: ignore[no-untyped-def]
    """Return the three rows of an array as a tuple."""
    return rows[0], rows[1], rows[2]


@inlined
def put(rows, v):  # type: ignore[no-untyped-def]
    """Put a vector into three rows of an array."""
    rows[0], rows[1], rows[2] = v


@inlined
def add(a, b):  # type: ignore[no-untyped-def]
    """Return the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def scale(s, v):  # type: ignore[no-untyped-def]
    """Return a vector times a number."""
    return s * v[0], s * v[1], s * v[2]


@inlined
def dot(a, b):  # type: ignore[no-untyped-def]
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):  # type: ignore[no-untyped-def]
    """Return the vector product of two vectors as a tuple."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def _times(matrix, v):  # type: ignore[no-untyped-def]
    return dot(matrix[0], v), dot(matrix[1], v), dot(matrix[2], v)


@inlined
def _symmetric(rows):  # type: ignore[no-untyped-def]
    """Return the symmetric matrix whose entries xx, xy, xz, yy, yz, zz an array has."""
    xx, xy, xz, yy, yz, zz = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


@inlined
def _axis(body):  # type: ignore[no-untyped-def]
    return body.rotation[0, 2], body.rotation[1, 2], body.rotation[2, 2]


@jitable
def place_bodies(tree, bodies):  # type: ignore[no-untyped-def]
    r"""Fill in rotation, origin and carried moments of every body, from the base to the tips.

    :math:`R_k = R_{parent} Q_k R_z(q_k)` with the constant rotation :math:`Q_k`; the origin of a
    slide moves along its z axis instead. The carried moments are the moments of the body alone,
    until `joint_space_inertia` adds the others.
    """
    for k in range(1, len(tree)):
        joint, body, parent = tree[k], bodies[k], bodies[tree[k].parent]
        q = joint.rotation
        for i in range(3):
            if joint.parent == 0:
                row = spread(q[i, 0]), spread(q[i, 1]), spread(q[i, 2])
                _place_row(joint, body, i, row, spread(joint.origin[i]))
                continue
            above = parent.rotation[i, 0], parent.rotation[i, 1], parent.rotation[i, 2]
            origin = dot(above, joint.origin)
            if joint.aligned:
                _place_row(joint, body, i, above, origin)
            else:
                row = dot(above, q[:, 0]), dot(above, q[:, 1]), dot(above, q[:, 2])
                _place_row(joint, body, i, row, origin)
        _place_moments(joint, body)


@inlined
def _place_row(joint, body, i, row, origin):  # type: ignore[no-untyped-def]
    """Fill in row i of a body's rotation and origin, given those with the joint at 0."""
    x, y, z = row
    body.rotation[i, 2] = z
    if joint.slides:
        body.rotation[i, 0], body.rotation[i, 1] = x, y
        body.origin[i] = origin + body.cosine * z
    else:
        body.rotation[i, 0] = x * body.cosine + y * body.sine
        body.rotation[i, 1] = y * body.cosine - x * body.sine
        body.origin[i] = origin


@jitable
def _place_moments(joint, body):  # type: ignore[no-untyped-def]
    r"""Fill in a body's moments of mass in the contact's axes, :math:`R h` and :math:`R I R^T`."""
    r = body.rotation
    rows = (r[0, 0], r[0, 1], r[0, 2]), (r[1, 0], r[1, 1], r[1, 2]), (r[2, 0], r[2, 1], r[2, 2])
    put(body.carried_moment, _times(rows, joint.moment))
    inertia, carried = _symmetric(joint.inertia), body.carried_inertia
    x, y, z = _times(inertia, rows[0]), _times(inertia, rows[1]), _times(inertia, rows[2])
    carried[0], carried[1], carried[2] = dot(x, rows[0]), dot(x, rows[1]), dot(x, rows[2])
    carried[3], carried[4], carried[5] = dot(y, rows[1]), dot(y, rows[2]), dot(z, rows[2])
    for i in range(3):
        body.moment[i] = body.carried_moment[i]
    for i in range(6):
        body.inertia[i] = carried[i]


@jitable
def joint_space_inertia(tree, bodies, inertia):  # type: ignore[no-untyped-def]
    """Fill in the joint-space inertia M, each joint's row up to the base.

    The composite rigid body algorithm (Featherstone 2008, table 6.2): the momentum that a unit
    velocity of a joint gives to all bodies it carries is passed to the joints below, whose axes it
    is projected on.
    """
    for k in range(len(tree) - 1, 0, -1):
        joint, body = tree[k], bodies[k]
        axis, moment = _axis(body), vector(body.carried_moment)
        if joint.slides:
            torque = cross(moment, axis)
            inertia[k, k] = joint.carried_mass + joint.armature
        else:
            torque = _times(_symmetric(body.carried_inertia), axis)
            inertia[k, k] = dot(axis, torque) + joint.armature
        if joint.parent == 0:
            continue
        force = scale(joint.carried_mass, axis) if joint.slides else cross(axis, moment)
        a, below = joint.parent, body
        while a > 0:
            torque = add(torque, cross(vector(below.origin), force))
            inertia[k, a] = dot(_axis(bodies[a]), force if tree[a].slides else torque)
            a, below = tree[a].parent, bodies[a]
        _carry(body, bodies[joint.parent], joint.carried_mass)


@jitable
def _carry(body, parent, mass):  # type: ignore[no-untyped-def]
    dx, dy, dz = d = vector(body.origin)
    hx, hy, hz = h = vector(body.carried_moment)
    ex, ey, ez = e = add(h, scale(mass, d))
    put(parent.carried_moment, add(vector(parent.carried_moment), e))
    xs, ys, zs = dx * (hx + ex), dy * (hy + ey), dz * (hz + ez)
    carried, total = body.carried_inertia, parent.carried_inertia
    total[0] += carried[0] + (ys + zs)
    total[1] += carried[1] - (dx * hy + dy * ex)
    total[2] += carried[2] - (dx * hz + dz * ex)
    total[3] += carried[3] + (xs + zs)
    total[4] += carried[4] - (dy * hz + dz * ey)
    total[5] += carried[5] + (xs + ys)


@jitable
def contact_jacobian(tree, bodies, task, lever, state):  # type: ignore[no-untyped-def]
    r"""Fill in the contact point and the columns of its Jacobian.

    A hinge with axis :math:`a` at distance :math:`d` from the contact point moves it with
    :math:`a \times d`, a slide with :math:`a`. Nothing moves across the plane of planar motion.
    """
    distance = _times(bodies[task.foot].rotation, lever)
    put(state.point, distance)
    k, square = task.foot, spread(0.0)
    while k > 0:
        body = bodies[k]
        column = _axis(body) if tree[k].slides else cross(_axis(body), distance)
        put(body.jacobian, column)
        if task.planar:
            body.jacobian[1] = 0.0
        square += dot(column, column)
        distance = add(distance, vector(body.origin))
        k = tree[k].parent
    state.jacobian_square = square
    put(state.from_base, distance)


@jitable
def joint_impulses(tree, bodies, task, state):  # type: ignore[no-untyped-def]
    """Compute the impulses inside the joints from the jump of the joints' velocity.

    The recursive Newton-Euler algorithm (Featherstone 2008, table 5.1) for jumps: velocities from
    the base to the tips, impulses back. What remains along a joint's axis, where nothing but the
    rotor's inertia can take it, is the residual of the momentum balance.
    """
    for k in range(1, len(tree)):
        joint, body, parent = tree[k], bodies[k], bodies[tree[k].parent]
        axis, turn = _axis(body), vector(parent.turn)
        velocity = add(vector(parent.velocity), cross(turn, vector(body.origin)))
        if joint.slides:
            velocity = add(velocity, scale(body.jump, axis))
        else:
            turn = add(turn, scale(body.jump, axis))
        moment = vector(body.moment)
        put(body.velocity, velocity)
        put(body.turn, turn)
        put(body.force, add(scale(joint.mass, velocity), cross(turn, moment)))
        put(body.torque, add(_times(_symmetric(body.inertia), turn), cross(moment, velocity)))
    foot, point, impulse = bodies[task.foot], vector(state.point), vector(state.impulse)
    put(foot.force, add(vector(foot.force), impulse))
    put(foot.torque, add(vector(foot.torque), cross(point, impulse)))
    state.foot_jump = foot.velocity[2] + (foot.turn[0] * point[1] - foot.turn[1] * point[0])
    largest, residual = spread(0.0), spread(0.0)
    for k in range(len(tree) - 1, 0, -1):
        joint, body = tree[k], bodies[k]
        force, torque = vector(body.force), vector(body.torque)
        along = dot(_axis(body), force if joint.slides else torque)
        largest = larger(largest, dot(force, force))
        residual = larger(residual, magnitude(along + joint.armature * body.jump))
        if joint.parent > 0:
            parent = bodies[joint.parent]
            torque = add(torque, cross(vector(body.origin), force))
            put(parent.force, add(vector(parent.force), force))
            put(parent.torque, add(vector(parent.torque), torque))
    state.largest_square, state.momentum_error = largest, residual


@jitable
def velocity_torques(tree, bodies, motion):  # type: ignore[no-untyped-def]
    """Subtract from the torques `free` what gravity and the products of velocities take.

    The recursive Newton-Euler algorithm (Featherstone 2008, table 5.1) with joints that do not
    accelerate. The origin of the base accelerates against gravity, which is in `motion[0]`.
    """
    for k in range(1, len(tree)):
        joint, body, moves, parent = tree[k], bodies[k], motion[k], bodies[tree[k].parent]
        axis, turn, lever = _axis(body), vector(parent.turn), vector(body.origin)
        carried = cross(turn, lever)
        velocity = add(vector(parent.velocity), carried)
        turning = vector(motion[joint.parent].turning)
        acceleration = add(vector(motion[joint.parent].acceleration), cross(turning, lever))
        acceleration = add(acceleration, cross(turn, carried))
        along = scale(moves.speed, axis)
        if joint.slides:
            velocity = add(velocity, along)
            acceleration = add(acceleration, scale(2.0, cross(turn, along)))
        else:
            turning = add(turning, cross(turn, along))
            turn = add(turn, along)
        inertia, moment = _symmetric(body.inertia), vector(body.moment)
        put(body.velocity, velocity)
        put(body.turn, turn)
        put(moves.acceleration, acceleration)
        put(moves.turning, turning)
        force = add(cross(turning, moment), cross(turn, cross(turn, moment)))
        put(body.force, add(scale(joint.mass, acceleration), force))
        torque = add(_times(inertia, turning), cross(turn, _times(inertia, turn)))
        put(body.torque, add(torque, cross(moment, acceleration)))
    for k in range(len(tree) - 1, 0, -1):
        joint, body, parent = tree[k], bodies[k], bodies[tree[k].parent]
        force, torque = vector(body.force), vector(body.torque)
        motion[k].free -= dot(_axis(body), force if joint.slides else torque)
        if joint.parent > 0:
            torque = add(torque, cross(vector(body.origin), force))
            put(parent.force, add(vector(parent.force), force))
            put(parent.torque, add(vector(parent.torque), torque))


@jitable
def whiten_torques(tree, motion, factors):  # type: ignore[no-untyped-def]
    r"""Replace the torques `free` by :math:`L^{-T}` times them."""
    for k in range(len(tree) - 1, 0, -1):
        torque, a = motion[k].free, tree[k].parent
        while a > 0:
            motion[a].free -= factors[k, a] * torque
            a = tree[a].parent


@jitable
def factorize(tree, inertia, state):  # type: ignore[no-untyped-def]
    r"""Factorize the joint-space inertia in place, :math:`M = L^T D L` with unit triangular L.

    In this order, from the tip to the base, L has an entry only where one joint carries the other:
    the branches of a tree cost nothing to each other (Featherstone, Rigid Body Dynamics Algorithms,
    2008, table 6.3). L is left in `inertia`, with :math:`D^{-1}` on its diagonal; row 0, of the
    base, becomes the diagonal of M.
    """
    diagonal = inertia[0]  # of no joint: free to keep M's diagonal
    for k in range(1, len(tree)):
        diagonal[k] = inertia[k, k]
    for k in range(len(tree) - 1, 0, -1):
        pivot = inertia[k, k]
        state.doubt = choose(pivot > LEAST_PIVOT * diagonal[k], state.doubt, 1.0)
        inverse = 1.0 / pivot
        inertia[k, k] = inverse
        a = tree[k].parent
        while a > 0:
            entry, b = inertia[k, a] * inverse, a
            while b > 0:
                inertia[a, b] -= entry * inertia[k, b]
                b = tree[b].parent
            inertia[k, a] = entry
            a = tree[a].parent


@jitable
def whiten(tree, bodies, factors, task):  # type: ignore[no-untyped-def]
    r"""Replace the rows of :math:`J^T` by the rows of :math:`W = L^{-T} J^T`.

    Then :math:`W^T D^{-1} W = J M^{-1} J^T` is the Delassus matrix; `factors` are L and
    :math:`D^{-1}` of `factorize`.
    """
    for k in range(len(tree) - 1, 0, -1):
        if not tree[k].carries_foot:
            continue
        row = bodies[k].jacobian
        for i in range(0, 3, 2 if task.planar else 1):
            a = tree[k].parent
            while a > 0:
                bodies[a].jacobian[i] -= factors[k, a] * row[i]
                a = tree[a].parent


@jitable
def delassus_matrix(tree, bodies, factors, state):  # type: ignore[no-untyped-def]
    """Fill in the Delassus matrix of the foot from whitened rows."""
    d11, d12, d22 = spread(0.0), spread(0.0), spread(0.0)
    d13, d23, d33 = spread(0.0), spread(0.0), spread(0.0)
    for k in range(1, len(tree)):
        if not tree[k].carries_foot:
            continue
        row, inverse = bodies[k].jacobian, factors[k, k]
        s, t, n = row[0], row[1], row[2]
        scaled_s, scaled_t = inverse * s, inverse * t
        d11 += scaled_s * s
        d12 += scaled_s * t
        d13 += scaled_s * n
        d22 += scaled_t * t
        d23 += scaled_t * n
        d33 += inverse * n * n
    delassus = state.delassus
    delassus[D11], delassus[D12], delassus[D22] = d11, d12, d22
    delassus[D13], delassus[D23], delassus[D33] = d13, d23, d33


@jitable
def solve_velocity(tree, bodies, factors, state):  # type: ignore[no-untyped-def]
    """Fill in the jump of the joints' velocity, :math:`v = L^{-1} z` with :math:`D z = -W p`."""
    impulse = state.impulse
    for k in range(1, len(tree)):
        row = bodies[k].jacobian
        v, a = -dot(row, impulse) * factors[k, k], tree[k].parent
        while a > 0:
            v = v - factors[k, a] * bodies[a].jump
            a = tree[a].parent
        bodies[k].jump = v
