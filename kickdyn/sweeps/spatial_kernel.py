"""Kinematics, inertia and Newton-Euler of any tree of hinges and slides, `LANES` postures at once.

All vectors have the contact's axes (first and second tangent, normal). Moments are about the
joint's own origin, so that a light foot far from the hip loses no digits. Every joint turns about,
or slides along, the z axis of its own frame. The algorithms are those of Featherstone, Rigid Body
Dynamics Algorithms, 2008, written out in components: loops over lanes become vector instructions
only where no small matrices are allocated.
"""

import math

from kickdyn.core.lanes import LANES
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
 WX, WY, WZ, VX, VY, VZ, FX, FY, FZ, NX, NY, NZ) = (row * LANES for row in range(44))  # fmt: skip
"""Rows of a joint: rotation of its body (R); origin from the parent's (O); cosine and sine of the
joint's own angle (a slide's value first); first and second moment of mass of the body (B), and of
all bodies the joint carries (H, I); jump of angular (W) and linear velocity (V); linear (F) and
angular (N) impulse that the parent transmits."""

ROWS = 44

AXES = 3
"""Axes of the contact: rows of the Jacobian."""

UNIT = R00, R11, R22
"""Rows that are 1 where a body is not rotated."""

TX, TY, TZ, SIZE, DX, DY, DZ = (row * LANES for row in range(7))
"""Rows of the contact point: its position from the foot's joint, the sum of squares of its
Jacobian, its position from one joint after the other."""


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
        slide = slides[k]
        for r in range(0, 9 * LANES, 3 * LANES):
            o = OX + r // 3
            for i in range(LANES):
                u, v, w = above[r + i], above[r + LANES + i], above[r + 2 * LANES + i]
                first = u * q00 + v * q10 + w * q20
                second = u * q01 + v * q11 + w * q21
                third = u * q02 + v * q12 + w * q22
                cos, sin = (1.0, 0.0) if slide else (own[COS + i], own[SIN + i])
                along = own[COS + i] if slide else 0.0
                own[r + i] = first * cos + second * sin
                own[r + LANES + i] = second * cos - first * sin
                own[r + 2 * LANES + i] = third
                own[o + i] = (u * a + v * b + w * c) + along * third
        _mass(own, p)


@njit
def _mass(x, p):  # type: ignore[no-untyped-def]
    r"""Fill in a body's moments of mass in the contact's axes, :math:`R h` and :math:`R I R^T`."""
    a, b, c = p[MOMENT], p[MOMENT + 1], p[MOMENT + 2]
    xx, xy, xz = p[SPATIAL_INERTIA], p[SPATIAL_INERTIA + 1], p[SPATIAL_INERTIA + 2]
    yy, yz, zz = p[SPATIAL_INERTIA + 3], p[SPATIAL_INERTIA + 4], p[SPATIAL_INERTIA + 5]
    for i in range(LANES):
        r00, r01, r02 = x[R00 + i], x[R01 + i], x[R02 + i]
        r10, r11, r12 = x[R10 + i], x[R11 + i], x[R12 + i]
        r20, r21, r22 = x[R20 + i], x[R21 + i], x[R22 + i]
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
        x[BX + i], x[BY + i], x[BZ + i] = hx, hy, hz
        x[HX + i], x[HY + i], x[HZ + i] = hx, hy, hz
        ixx, ixy = u0 * r00 + u1 * r01 + u2 * r02, u0 * r10 + u1 * r11 + u2 * r12
        ixz, iyy = u0 * r20 + u1 * r21 + u2 * r22, v0 * r10 + v1 * r11 + v2 * r12
        iyz, izz = v0 * r20 + v1 * r21 + v2 * r22, w0 * r20 + w1 * r21 + w2 * r22
        x[BXX + i], x[BXY + i], x[BXZ + i] = ixx, ixy, ixz
        x[BYY + i], x[BYZ + i], x[BZZ + i] = iyy, iyz, izz
        x[IXX + i], x[IXY + i], x[IXZ + i] = ixx, ixy, ixz
        x[IYY + i], x[IYZ + i], x[IZZ + i] = iyy, iyz, izz


@njit
def joint_space_inertia(parent, slides, constants, x, inertia):  # type: ignore[no-untyped-def]
    """Fill in the joint-space inertia M, each joint's row up to the base.

    The composite rigid body algorithm (Featherstone 2008, table 6.2): the moment of momentum that a
    unit velocity of a joint gives to all bodies it carries is passed to the joints below, whose
    axes it is projected on.
    """
    for k in range(len(parent) - 1, 0, -1):
        own, entry, mass = x[k], inertia[k, k], constants[k, CARRIED]
        armature, slide = constants[k, ARMATURE], slides[k]
        for i in range(LANES):
            ax, ay, az = own[R02 + i], own[R12 + i], own[R22 + i]
            hx, hy, hz = own[HX + i], own[HY + i], own[HZ + i]
            if slide:
                fx, fy, fz = mass * ax, mass * ay, mass * az
                nx, ny, nz = hy * az - hz * ay, hz * ax - hx * az, hx * ay - hy * ax
                own_inertia = mass
            else:
                fx, fy, fz = ay * hz - az * hy, az * hx - ax * hz, ax * hy - ay * hx
                nx = own[IXX + i] * ax + own[IXY + i] * ay + own[IXZ + i] * az
                ny = own[IXY + i] * ax + own[IYY + i] * ay + own[IYZ + i] * az
                nz = own[IXZ + i] * ax + own[IYZ + i] * ay + own[IZZ + i] * az
                own_inertia = ax * nx + ay * ny + az * nz
            entry[i] = own_inertia + armature
            own[FX + i], own[FY + i], own[FZ + i] = fx, fy, fz
            own[NX + i], own[NY + i], own[NZ + i] = nx, ny, nz
        a, below = parent[k], own
        while a > 0:
            _couple(own, below, x[a], slides[a], inertia[k, a])
            a, below = parent[a], x[a]
        if parent[k] > 0:
            _carry(own, x[parent[k]], mass)


@njit
def _couple(own, below, above, slide, entry):  # type: ignore[no-untyped-def]
    """Fill in one entry of M, and move the momentum of a joint's motion to the joint below."""
    for i in range(LANES):
        fx, fy, fz = own[FX + i], own[FY + i], own[FZ + i]
        dx, dy, dz = below[OX + i], below[OY + i], below[OZ + i]
        ax, ay, az = above[R02 + i], above[R12 + i], above[R22 + i]
        nx = own[NX + i] + (dy * fz - dz * fy)
        ny = own[NY + i] + (dz * fx - dx * fz)
        nz = own[NZ + i] + (dx * fy - dy * fx)
        own[NX + i], own[NY + i], own[NZ + i] = nx, ny, nz
        entry[i] = ax * fx + ay * fy + az * fz if slide else ax * nx + ay * ny + az * nz


@njit
def _carry(own, above, m):  # type: ignore[no-untyped-def]
    """Add a joint's moments of mass to its parent's, about the parent's origin."""
    for i in range(LANES):
        dx, dy, dz = own[OX + i], own[OY + i], own[OZ + i]
        hx, hy, hz = own[HX + i], own[HY + i], own[HZ + i]
        ex, ey, ez = hx + m * dx, hy + m * dy, hz + m * dz
        above[HX + i] += ex
        above[HY + i] += ey
        above[HZ + i] += ez
        xs, ys, zs = dx * (hx + ex), dy * (hy + ey), dz * (hz + ez)
        above[IXX + i] += own[IXX + i] + (ys + zs)
        above[IYY + i] += own[IYY + i] + (xs + zs)
        above[IZZ + i] += own[IZZ + i] + (xs + ys)
        above[IXY + i] += own[IXY + i] - (dx * hy + dy * ex)
        above[IXZ + i] += own[IXZ + i] - (dx * hz + dz * ex)
        above[IYZ + i] += own[IYZ + i] - (dy * hz + dz * ey)


@njit
def contact_jacobian(parent, slides, carries, constants, foot, lever, x, rows, point):  # type: ignore[no-untyped-def]
    r"""Fill in the contact point and the columns of its Jacobian.

    A hinge with axis :math:`a` at distance :math:`d` from the contact point moves it with
    :math:`a \times d`, a slide with :math:`a`.
    """
    a, b, c = lever
    own = x[foot]
    for i in range(LANES):
        dx = own[R00 + i] * a + own[R01 + i] * b + own[R02 + i] * c
        dy = own[R10 + i] * a + own[R11 + i] * b + own[R12 + i] * c
        dz = own[R20 + i] * a + own[R21 + i] * b + own[R22 + i] * c
        point[TX + i], point[TY + i], point[TZ + i] = dx, dy, dz
        point[DX + i], point[DY + i], point[DZ + i] = dx, dy, dz
        point[SIZE + i] = 0.0
    for k in range(1, len(parent)):
        if not carries[k]:
            for i in range(rows.shape[1]):
                rows[k, i] = 0.0
    k = foot
    while k > 0:
        own, row, slide = x[k], rows[k], slides[k]
        for i in range(LANES):
            ax, ay, az = own[R02 + i], own[R12 + i], own[R22 + i]
            dx, dy, dz = point[DX + i], point[DY + i], point[DZ + i]
            jx = ax if slide else ay * dz - az * dy
            jy = ay if slide else az * dx - ax * dz
            jz = az if slide else ax * dy - ay * dx
            row[i], row[LANES + i], row[2 * LANES + i] = jx, jy, jz
            point[DX + i] = dx + own[OX + i]
            point[DY + i] = dy + own[OY + i]
            point[DZ + i] = dz + own[OZ + i]
        for i in range(LANES):
            jx, jy, jz = row[i], row[LANES + i], row[2 * LANES + i]
            point[SIZE + i] += jx * jx + jy * jy + jz * jz
        k = parent[k]


@njit
def joint_impulses(parent, slides, constants, foot, impulse, jump, x, point, answer):  # type: ignore[no-untyped-def]
    """Compute the impulses inside the joints from the jump of the joints' velocity.

    The recursive Newton-Euler algorithm (Featherstone 2008, table 5.1) for jumps: velocities from
    the base to the tips, impulses back. What remains along a joint's axis, where nothing but the
    rotor's inertia can take it, is the residual of the momentum balance. `jump` is that of the
    joints' velocity, shape `(n + 1, LANES)` [rad/s; m/s]; the answer has three rows: square of the
    largest linear impulse in a joint, largest residual, jump of the foot's velocity along the
    normal.
    """
    for k in range(1, len(parent)):
        own, above, dv = x[k], x[parent[k]], jump[k]
        slide, mass = slides[k], constants[k, MASS]
        for i in range(LANES):
            ax, ay, az = own[R02 + i], own[R12 + i], own[R22 + i]
            wx, wy, wz = above[WX + i], above[WY + i], above[WZ + i]
            dx, dy, dz = own[OX + i], own[OY + i], own[OZ + i]
            turned, slid = (0.0, dv[i]) if slide else (dv[i], 0.0)
            own[VX + i] = above[VX + i] + (wy * dz - wz * dy) + ax * slid
            own[VY + i] = above[VY + i] + (wz * dx - wx * dz) + ay * slid
            own[VZ + i] = above[VZ + i] + (wx * dy - wy * dx) + az * slid
            own[WX + i] = wx + ax * turned
            own[WY + i] = wy + ay * turned
            own[WZ + i] = wz + az * turned
        for i in range(LANES):
            wx, wy, wz = own[WX + i], own[WY + i], own[WZ + i]
            vx, vy, vz = own[VX + i], own[VY + i], own[VZ + i]
            hx, hy, hz = own[BX + i], own[BY + i], own[BZ + i]
            own[FX + i] = mass * vx + (wy * hz - wz * hy)
            own[FY + i] = mass * vy + (wz * hx - wx * hz)
            own[FZ + i] = mass * vz + (wx * hy - wy * hx)
            own[NX + i] = (
                own[BXX + i] * wx + own[BXY + i] * wy + own[BXZ + i] * wz + (hy * vz - hz * vy)
            )
            own[NY + i] = (
                own[BXY + i] * wx + own[BYY + i] * wy + own[BYZ + i] * wz + (hz * vx - hx * vz)
            )
            own[NZ + i] = (
                own[BXZ + i] * wx + own[BYZ + i] * wy + own[BZZ + i] * wz + (hx * vy - hy * vx)
            )
    own = x[foot]
    for i in range(LANES):
        px, py, pz = impulse[i], impulse[LANES + i], impulse[2 * LANES + i]
        dx, dy, dz = point[TX + i], point[TY + i], point[TZ + i]
        own[FX + i] += px
        own[FY + i] += py
        own[FZ + i] += pz
        own[NX + i] += dy * pz - dz * py
        own[NY + i] += dz * px - dx * pz
        own[NZ + i] += dx * py - dy * px
        answer[i], answer[LANES + i] = 0.0, 0.0
        answer[2 * LANES + i] = own[VZ + i] + (own[WX + i] * dy - own[WY + i] * dx)
    for k in range(len(parent) - 1, 0, -1):
        own, dv, slide, armature = x[k], jump[k], slides[k], constants[k, ARMATURE]
        for i in range(LANES):
            fx, fy, fz = own[FX + i], own[FY + i], own[FZ + i]
            ax, ay, az = own[R02 + i], own[R12 + i], own[R22 + i]
            about = ax * own[NX + i] + ay * own[NY + i] + az * own[NZ + i]
            left = (ax * fx + ay * fy + az * fz if slide else about) + armature * dv[i]
            answer[i] = max(answer[i], fx * fx + fy * fy + fz * fz)
            answer[LANES + i] = max(answer[LANES + i], math.fabs(left))
        if parent[k] > 0:
            above = x[parent[k]]
            for i in range(LANES):
                fx, fy, fz = own[FX + i], own[FY + i], own[FZ + i]
                dx, dy, dz = own[OX + i], own[OY + i], own[OZ + i]
                above[FX + i] += fx
                above[FY + i] += fy
                above[FZ + i] += fz
                above[NX + i] += own[NX + i] + (dy * fz - dz * fy)
                above[NY + i] += own[NY + i] + (dz * fx - dx * fz)
                above[NZ + i] += own[NZ + i] + (dx * fy - dy * fx)
