"""Kinematics, inertia and Newton-Euler of any tree of hinges and slides, `BATCH` postures at once.

All vectors have the contact's axes (first and second tangent, normal). Moments are about the
joint's own origin, so that a light foot far from the hip loses no digits. Every joint turns about,
or slides along, the z axis of its own frame. The algorithms are from Featherstone, Rigid Body
Dynamics Algorithms, 2008, written for batches, see `kickdyn.core.simd`.

`njit` allows no fused multiply-adds: which of them the compiler finds depends on what it inlines,
and a resumed sweep must have the same bits as one that ran at once.
"""

import math
from typing import Any

import numba
import numpy as np

from kickdyn.core.compilation import WITHIN
from kickdyn.core.simd import BATCH, spread

OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
"""How the kernel is compiled: without memory management, since all arrays are the caller's."""

njit: Any = numba.njit(**OPTIONS, **WITHIN)
inlined: Any = numba.njit(**OPTIONS, **WITHIN, forceinline=True)

BODY = np.dtype(
    [
        ("cosine", float, BATCH),  # of the joint's angle; the value of a slide [m]
        ("sine", float, BATCH),  # of the joint's angle
        ("rotation", float, (3, 3, BATCH)),  # of the body
        ("origin", float, (3, BATCH)),  # from the parent's origin [m]
        ("carried_moment", float, (3, BATCH)),  # moments of mass of all bodies that the joint
        ("carried_inertia", float, (6, BATCH)),  # carries, in the order of `kernel.JOINT`
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


@inlined
def _vector(rows):  # type: ignore[no-untyped-def]
    return rows[0], rows[1], rows[2]


@inlined
def _put(rows, v):  # type: ignore[no-untyped-def]
    rows[0], rows[1], rows[2] = v


@inlined
def _add(a, b):  # type: ignore[no-untyped-def]
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def _scale(s, v):  # type: ignore[no-untyped-def]
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


@njit
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


@njit
def _place_moments(joint, body):  # type: ignore[no-untyped-def]
    r"""Fill in a body's moments of mass in the contact's axes, :math:`R h` and :math:`R I R^T`."""
    r = body.rotation
    rows = (r[0, 0], r[0, 1], r[0, 2]), (r[1, 0], r[1, 1], r[1, 2]), (r[2, 0], r[2, 1], r[2, 2])
    _put(body.carried_moment, _times(rows, joint.moment))
    inertia, carried = _symmetric(joint.inertia), body.carried_inertia
    x, y, z = _times(inertia, rows[0]), _times(inertia, rows[1]), _times(inertia, rows[2])
    carried[0], carried[1], carried[2] = dot(x, rows[0]), dot(x, rows[1]), dot(x, rows[2])
    carried[3], carried[4], carried[5] = dot(y, rows[1]), dot(y, rows[2]), dot(z, rows[2])
    for i in range(3):
        body.moment[i] = body.carried_moment[i]
    for i in range(6):
        body.inertia[i] = carried[i]


@njit
def joint_space_inertia(tree, bodies, inertia):  # type: ignore[no-untyped-def]
    """Fill in the joint-space inertia M, each joint's row up to the base.

    The composite rigid body algorithm (Featherstone 2008, table 6.2): the momentum that a unit
    velocity of a joint gives to all bodies it carries is passed to the joints below, whose axes it
    is projected on.
    """
    for k in range(len(tree) - 1, 0, -1):
        joint, body = tree[k], bodies[k]
        axis, moment = _axis(body), _vector(body.carried_moment)
        if joint.slides:
            torque = cross(moment, axis)
            inertia[k, k] = joint.carried_mass + joint.armature
        else:
            torque = _times(_symmetric(body.carried_inertia), axis)
            inertia[k, k] = dot(axis, torque) + joint.armature
        if joint.parent == 0:
            continue
        force = _scale(joint.carried_mass, axis) if joint.slides else cross(axis, moment)
        a, below = joint.parent, body
        while a > 0:
            torque = _add(torque, cross(_vector(below.origin), force))
            inertia[k, a] = dot(_axis(bodies[a]), force if tree[a].slides else torque)
            a, below = tree[a].parent, bodies[a]
        _carry(body, bodies[joint.parent], joint.carried_mass)


@njit
def _carry(body, parent, mass):  # type: ignore[no-untyped-def]
    dx, dy, dz = d = _vector(body.origin)
    hx, hy, hz = h = _vector(body.carried_moment)
    ex, ey, ez = e = _add(h, _scale(mass, d))
    _put(parent.carried_moment, _add(_vector(parent.carried_moment), e))
    xs, ys, zs = dx * (hx + ex), dy * (hy + ey), dz * (hz + ez)
    carried, total = body.carried_inertia, parent.carried_inertia
    total[0] += carried[0] + (ys + zs)
    total[1] += carried[1] - (dx * hy + dy * ex)
    total[2] += carried[2] - (dx * hz + dz * ex)
    total[3] += carried[3] + (xs + zs)
    total[4] += carried[4] - (dy * hz + dz * ey)
    total[5] += carried[5] + (xs + ys)


@njit
def contact_jacobian(tree, bodies, task, state):  # type: ignore[no-untyped-def]
    r"""Fill in the contact point and the columns of its Jacobian.

    A hinge with axis :math:`a` at distance :math:`d` from the contact point moves it with
    :math:`a \times d`, a slide with :math:`a`. Nothing moves across the plane of planar motion.
    """
    distance = _times(bodies[task.foot].rotation, task.lever)
    _put(state.point, distance)
    k, square = task.foot, spread(0.0)
    while k > 0:
        body = bodies[k]
        column = _axis(body) if tree[k].slides else cross(_axis(body), distance)
        _put(body.jacobian, column)
        if task.planar:
            body.jacobian[1] = 0.0
        square += dot(column, column)
        distance = _add(distance, _vector(body.origin))
        k = tree[k].parent
    state.jacobian_square = square


@njit
def joint_impulses(tree, bodies, task, state):  # type: ignore[no-untyped-def]
    """Compute the impulses inside the joints from the jump of the joints' velocity.

    The recursive Newton-Euler algorithm (Featherstone 2008, table 5.1) for jumps: velocities from
    the base to the tips, impulses back. What remains along a joint's axis, where nothing but the
    rotor's inertia can take it, is the residual of the momentum balance.
    """
    for k in range(1, len(tree)):
        joint, body, parent = tree[k], bodies[k], bodies[tree[k].parent]
        axis, turn = _axis(body), _vector(parent.turn)
        velocity = _add(_vector(parent.velocity), cross(turn, _vector(body.origin)))
        if joint.slides:
            velocity = _add(velocity, _scale(body.jump, axis))
        else:
            turn = _add(turn, _scale(body.jump, axis))
        moment = _vector(body.moment)
        _put(body.velocity, velocity)
        _put(body.turn, turn)
        _put(body.force, _add(_scale(joint.mass, velocity), cross(turn, moment)))
        _put(body.torque, _add(_times(_symmetric(body.inertia), turn), cross(moment, velocity)))
    foot, point, impulse = bodies[task.foot], _vector(state.point), _vector(state.impulse)
    _put(foot.force, _add(_vector(foot.force), impulse))
    _put(foot.torque, _add(_vector(foot.torque), cross(point, impulse)))
    state.foot_jump = foot.velocity[2] + (foot.turn[0] * point[1] - foot.turn[1] * point[0])
    largest, residual = spread(0.0), spread(0.0)
    for k in range(len(tree) - 1, 0, -1):
        joint, body = tree[k], bodies[k]
        force, torque = _vector(body.force), _vector(body.torque)
        along = dot(_axis(body), force if joint.slides else torque)
        largest = max(largest, dot(force, force))
        residual = max(residual, math.fabs(along + joint.armature * body.jump))
        if joint.parent > 0:
            parent = bodies[joint.parent]
            torque = _add(torque, cross(_vector(body.origin), force))
            _put(parent.force, _add(_vector(parent.force), force))
            _put(parent.torque, _add(_vector(parent.torque), torque))
    state.largest_square, state.momentum_error = largest, residual
