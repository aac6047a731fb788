"""Kinematics, inertia and Newton-Euler of any tree of hinges and slides, `BATCH` postures at once.

All vectors have the contact's axes (first and second tangent, normal). Moments are about the
joint's own origin, so that a light foot far from the hip loses no digits. Every joint turns about,
or slides along, the z axis of its own frame. The algorithms are those of Featherstone, Rigid Body
Dynamics Algorithms, 2008, written out in components, each a batch of `kickdyn.core.simd`.
"""

import math

from kickdyn.core.simd import spread
from kickdyn.sweeps.impact_kernel import njit
from kickdyn.sweeps.kernel_model import (
    ARMATURE,
    CARRIED,
    MASS,
    MOMENT,
    SPATIAL_INERTIA,
    SPATIAL_PLACE,
    SPATIAL_TURN,
)

(R00, R01, R02, R10, R11, R12, R20, R21, R22, OX, OY, OZ, COS, SIN,
 BX, BY, BZ, BXX, BXY, BXZ, BYY, BYZ, BZZ,
 HX, HY, HZ, IXX, IXY, IXZ, IYY, IYZ, IZZ,
 WX, WY, WZ, VX, VY, VZ, FX, FY, FZ, NX, NY, NZ) = range(44)  # fmt: skip
"""Rows of a joint: rotation of its body (R); origin from the parent's (O); cosine and sine of the
joint's own angle (a slide's value first); first and second moment of mass of the body (B), and of
all bodies the joint carries (H, I); jump of angular (W) and linear velocity (V); linear (F) and
angular (N) impulse that the parent transmits."""

ROWS = 44

AXES = 3
"""Axes of the contact: rows of the Jacobian."""

UNIT = R00, R11, R22
"""Rows that are 1 where a body is not rotated."""

TX, TY, TZ, SIZE = range(4)
"""Rows of the contact point: its position from the foot's joint, the sum of squares of its
Jacobian."""


@njit
def place_bodies(parent, slides, constants, x):  # type: ignore[no-untyped-def]
    r"""Fill in rotation, origin and moments of mass of every body, from the base to the tips.

    :math:`R_k = R_{parent} Q_k R_z(q_k)` with the constant rotation :math:`Q_k`; of a slide, the
    origin moves along its z axis instead.
    """
    for k in range(1, len(parent)):
        own, above, p = x[k], x[parent[k]], constants[k]
        a, b, c = p[SPATIAL_PLACE], p[SPATIAL_PLACE + 1], p[SPATIAL_PLACE + 2]
        q00, q01, q02 = p[SPATIAL_TURN], p[SPATIAL_TURN + 1], p[SPATIAL_TURN + 2]
        q10, q11, q12 = p[SPATIAL_TURN + 3], p[SPATIAL_TURN + 4], p[SPATIAL_TURN + 5]
        q20, q21, q22 = p[SPATIAL_TURN + 6], p[SPATIAL_TURN + 7], p[SPATIAL_TURN + 8]
        for row in range(3):
            u, v, w = above[3 * row], above[3 * row + 1], above[3 * row + 2]
            first = u * q00 + v * q10 + w * q20
            second = u * q01 + v * q11 + w * q21
            third = u * q02 + v * q12 + w * q22
            origin = u * a + v * b + w * c
            if slides[k]:
                origin = origin + own[COS] * third
            else:
                cos, sin = own[COS], own[SIN]
                first, second = first * cos + second * sin, second * cos - first * sin
            own[3 * row], own[3 * row + 1], own[3 * row + 2] = first, second, third
            own[OX + row] = origin
        _mass(own, p)


@njit
def _mass(x, p):  # type: ignore[no-untyped-def]
    r"""Fill in a body's moments of mass in the contact's axes, :math:`R h` and :math:`R I R^T`."""
    a, b, c = p[MOMENT], p[MOMENT + 1], p[MOMENT + 2]
    xx, xy, xz = p[SPATIAL_INERTIA], p[SPATIAL_INERTIA + 1], p[SPATIAL_INERTIA + 2]
    yy, yz, zz = p[SPATIAL_INERTIA + 3], p[SPATIAL_INERTIA + 4], p[SPATIAL_INERTIA + 5]
    r00, r01, r02 = x[R00], x[R01], x[R02]
    r10, r11, r12 = x[R10], x[R11], x[R12]
    r20, r21, r22 = x[R20], x[R21], x[R22]
    hx = r00 * a + r01 * b + r02 * c
    hy = r10 * a + r11 * b + r12 * c
    hz = r20 * a + r21 * b + r22 * c
    u0 = r00 * xx + r01 * xy + r02 * xz
    u1 = r00 * xy + r01 * yy + r02 * yz
    u2 = r00 * xz + r01 * yz + r02 * zz
    v0 = r10 * xx + r11 * xy + r12 * xz
    v1 = r10 * xy + r11 * yy + r12 * yz
    v2 = r10 * xz + r11 * yz + r12 * zz
    w0 = r20 * xx + r21 * xy + r22 * xz
    w1 = r20 * xy + r21 * yy + r22 * yz
    w2 = r20 * xz + r21 * yz + r22 * zz
    x[BX], x[BY], x[BZ] = hx, hy, hz
    x[HX], x[HY], x[HZ] = hx, hy, hz
    ixx, ixy = u0 * r00 + u1 * r01 + u2 * r02, u0 * r10 + u1 * r11 + u2 * r12
    ixz, iyy = u0 * r20 + u1 * r21 + u2 * r22, v0 * r10 + v1 * r11 + v2 * r12
    iyz, izz = v0 * r20 + v1 * r21 + v2 * r22, w0 * r20 + w1 * r21 + w2 * r22
    x[BXX], x[BXY], x[BXZ] = ixx, ixy, ixz
    x[BYY], x[BYZ], x[BZZ] = iyy, iyz, izz
    x[IXX], x[IXY], x[IXZ] = ixx, ixy, ixz
    x[IYY], x[IYZ], x[IZZ] = iyy, iyz, izz


@njit
def joint_space_inertia(parent, slides, constants, x, inertia):  # type: ignore[no-untyped-def]
    """Fill in the joint-space inertia M, each joint's row up to the base.

    The composite rigid body algorithm (Featherstone 2008, table 6.2): the moment of momentum that a
    unit velocity of a joint gives to all bodies it carries is passed to the joints below, whose
    axes it is projected on.
    """
    for k in range(len(parent) - 1, 0, -1):
        own, mass, armature = x[k], constants[k, CARRIED], constants[k, ARMATURE]
        ax, ay, az = own[R02], own[R12], own[R22]
        hx, hy, hz = own[HX], own[HY], own[HZ]
        if slides[k]:
            fx, fy, fz = mass * ax, mass * ay, mass * az
            nx, ny, nz = hy * az - hz * ay, hz * ax - hx * az, hx * ay - hy * ax
            inertia[k, k] = mass + armature
        else:
            fx, fy, fz = ay * hz - az * hy, az * hx - ax * hz, ax * hy - ay * hx
            nx = own[IXX] * ax + own[IXY] * ay + own[IXZ] * az
            ny = own[IXY] * ax + own[IYY] * ay + own[IYZ] * az
            nz = own[IXZ] * ax + own[IYZ] * ay + own[IZZ] * az
            inertia[k, k] = (ax * nx + ay * ny + az * nz) + armature
        a, below = parent[k], own
        while a > 0:
            above = x[a]
            dx, dy, dz = below[OX], below[OY], below[OZ]
            ax, ay, az = above[R02], above[R12], above[R22]
            nx = nx + (dy * fz - dz * fy)
            ny = ny + (dz * fx - dx * fz)
            nz = nz + (dx * fy - dy * fx)
            if slides[a]:
                inertia[k, a] = ax * fx + ay * fy + az * fz
            else:
                inertia[k, a] = ax * nx + ay * ny + az * nz
            a, below = parent[a], above
        if parent[k] > 0:
            _carry(own, x[parent[k]], mass)


@njit
def _carry(own, above, m):  # type: ignore[no-untyped-def]
    """Add a joint's moments of mass to its parent's, about the parent's origin."""
    dx, dy, dz = own[OX], own[OY], own[OZ]
    hx, hy, hz = own[HX], own[HY], own[HZ]
    ex, ey, ez = hx + m * dx, hy + m * dy, hz + m * dz
    above[HX] += ex
    above[HY] += ey
    above[HZ] += ez
    xs, ys, zs = dx * (hx + ex), dy * (hy + ey), dz * (hz + ez)
    above[IXX] += own[IXX] + (ys + zs)
    above[IYY] += own[IYY] + (xs + zs)
    above[IZZ] += own[IZZ] + (xs + ys)
    above[IXY] += own[IXY] - (dx * hy + dy * ex)
    above[IXZ] += own[IXZ] - (dx * hz + dz * ex)
    above[IYZ] += own[IYZ] - (dy * hz + dz * ey)


@njit
def contact_jacobian(parent, slides, carries, constants, foot, lever, x, rows, point):  # type: ignore[no-untyped-def]
    r"""Fill in the contact point and the columns of its Jacobian.

    A hinge with axis :math:`a` at distance :math:`d` from the contact point moves it with
    :math:`a \times d`, a slide with :math:`a`.
    """
    a, b, c = lever
    own = x[foot]
    dx = own[R00] * a + own[R01] * b + own[R02] * c
    dy = own[R10] * a + own[R11] * b + own[R12] * c
    dz = own[R20] * a + own[R21] * b + own[R22] * c
    point[TX], point[TY], point[TZ] = dx, dy, dz
    for k in range(1, len(parent)):
        if not carries[k]:
            rows[k, 0], rows[k, 1], rows[k, 2] = 0.0, 0.0, 0.0
    k, square = foot, spread(0.0)
    while k > 0:
        own = x[k]
        jx, jy, jz = own[R02], own[R12], own[R22]
        if not slides[k]:
            jx, jy, jz = jy * dz - jz * dy, jz * dx - jx * dz, jx * dy - jy * dx
        rows[k, 0], rows[k, 1], rows[k, 2] = jx, jy, jz
        square += jx * jx + jy * jy + jz * jz
        dx, dy, dz = dx + own[OX], dy + own[OY], dz + own[OZ]
        k = parent[k]
    point[SIZE] = square


@njit
def joint_impulses(parent, slides, constants, foot, impulse, jump, x, point, answer):  # type: ignore[no-untyped-def]
    """Compute the impulses inside the joints from the jump of the joints' velocity.

    The recursive Newton-Euler algorithm (Featherstone 2008, table 5.1) for jumps: velocities from
    the base to the tips, impulses back. What remains along a joint's axis, where nothing but the
    rotor's inertia can take it, is the residual of the momentum balance. `jump` is that of the
    joints' velocity, `n + 1` batches [rad/s; m/s]; the answer has three: square of the largest
    linear impulse in a joint, largest residual, jump of the foot's velocity along the normal.
    """
    for k in range(1, len(parent)):
        own, above, dv, mass = x[k], x[parent[k]], jump[k], constants[k, MASS]
        ax, ay, az = own[R02], own[R12], own[R22]
        wx, wy, wz = above[WX], above[WY], above[WZ]
        dx, dy, dz = own[OX], own[OY], own[OZ]
        vx = above[VX] + (wy * dz - wz * dy)
        vy = above[VY] + (wz * dx - wx * dz)
        vz = above[VZ] + (wx * dy - wy * dx)
        if slides[k]:
            vx, vy, vz = vx + ax * dv, vy + ay * dv, vz + az * dv
        else:
            wx, wy, wz = wx + ax * dv, wy + ay * dv, wz + az * dv
        own[VX], own[VY], own[VZ] = vx, vy, vz
        own[WX], own[WY], own[WZ] = wx, wy, wz
        hx, hy, hz = own[BX], own[BY], own[BZ]
        own[FX] = mass * vx + (wy * hz - wz * hy)
        own[FY] = mass * vy + (wz * hx - wx * hz)
        own[FZ] = mass * vz + (wx * hy - wy * hx)
        ixx, ixy, ixz, iyy, iyz, izz = own[BXX], own[BXY], own[BXZ], own[BYY], own[BYZ], own[BZZ]
        own[NX] = ixx * wx + ixy * wy + ixz * wz + (hy * vz - hz * vy)
        own[NY] = ixy * wx + iyy * wy + iyz * wz + (hz * vx - hx * vz)
        own[NZ] = ixz * wx + iyz * wy + izz * wz + (hx * vy - hy * vx)
    own, px, py, pz = x[foot], impulse[0], impulse[1], impulse[2]
    dx, dy, dz = point[TX], point[TY], point[TZ]
    own[FX] += px
    own[FY] += py
    own[FZ] += pz
    own[NX] += dy * pz - dz * py
    own[NY] += dz * px - dx * pz
    own[NZ] += dx * py - dy * px
    worst, left = spread(0.0), spread(0.0)
    answer[2] = own[VZ] + (own[WX] * dy - own[WY] * dx)
    for k in range(len(parent) - 1, 0, -1):
        own, dv, armature = x[k], jump[k], constants[k, ARMATURE]
        fx, fy, fz, nx, ny, nz = own[FX], own[FY], own[FZ], own[NX], own[NY], own[NZ]
        ax, ay, az = own[R02], own[R12], own[R22]
        along = ax * fx + ay * fy + az * fz if slides[k] else ax * nx + ay * ny + az * nz
        worst = max(worst, fx * fx + fy * fy + fz * fz)
        left = max(left, math.fabs(along + armature * dv))
        if parent[k] > 0:
            above, dx, dy, dz = x[parent[k]], own[OX], own[OY], own[OZ]
            above[FX] += fx
            above[FY] += fy
            above[FZ] += fz
            above[NX] += nx + (dy * fz - dz * fy)
            above[NY] += ny + (dz * fx - dx * fz)
            above[NZ] += nz + (dx * fy - dy * fx)
    answer[0], answer[1] = worst, left
