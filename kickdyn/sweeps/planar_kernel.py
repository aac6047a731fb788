"""What `spatial_kernel` computes, for legs that move in one plane, in a quarter of the time.

The plane contains the contact normal. Coordinates are (u, w), along the normal and along the
tangent in the plane; angles are positive from u to w. While all joints are at 0, the axes of every
body are those of the contact. The functions have the names and arguments of those of
`spatial_kernel`.
"""

import math

from kickdyn.core.lanes import LANES
from kickdyn.sweeps.impact_kernel import njit
from kickdyn.sweeps.kernel_model import (
    ARMATURE,
    CARRIED,
    MASS,
    MOMENT,
    PLANAR_AXIS,
    PLANAR_INERTIA,
    PLANAR_PLACE,
    PLANAR_SENSE,
)

(C, S, OU, OW, COS, SIN, AU, AW, BU, BW, HU, HW, TURNED, TURN, VU, VW, FU, FW, N) = (
    row * LANES for row in range(19)
)
"""Rows of a joint: cosine and sine of its body's rotation; origin from the parent's; cosine and
sine of the joint's own angle (a slide's value first); axis of a slide; first moment of mass of the
body (B), and of all bodies the joint carries (H) with their second moment (TURNED); jump of angular
(TURN) and linear velocity (V); linear (F) and angular (N) impulse that the parent transmits."""

ROWS = 19

AXES = 2
"""Axes of the contact: rows of the Jacobian."""

UNIT = (C,)
"""Rows that are 1 where a body is not rotated."""

TU, TW, SIZE, DU, DW = 0, LANES, 3 * LANES, 4 * LANES, 5 * LANES
"""Rows of the contact point: its position from the foot's joint, the sum of squares of its
Jacobian, its position from one joint after the other."""


@njit
def place_bodies(parent, slides, constants, x):  # type: ignore[no-untyped-def]
    """Fill in rotation, origin and moments of mass of every body; see `spatial_kernel`."""
    for k in range(1, len(parent)):
        own, above, p, slide = x[k], x[parent[k]], constants[k], slides[k]
        a, b, sense = p[PLANAR_PLACE], p[PLANAR_PLACE + 1], p[PLANAR_SENSE]
        hu, hw, inertia = p[MOMENT], p[MOMENT + 1], p[PLANAR_INERTIA]
        axis_u, axis_w = p[PLANAR_AXIS], p[PLANAR_AXIS + 1]
        for i in range(LANES):
            c, s = above[C + i], above[S + i]
            cos, sin = (1.0, 0.0) if slide else (own[COS + i], sense * own[SIN + i])
            along = own[COS + i] if slide else 0.0
            au, aw = c * axis_u - s * axis_w, s * axis_u + c * axis_w
            own[OU + i], own[OW + i] = (c * a - s * b) + along * au, (s * a + c * b) + along * aw
            own[AU + i], own[AW + i] = au, aw
            c, s = c * cos - s * sin, s * cos + c * sin
            own[C + i], own[S + i] = c, s
            u, w = c * hu - s * hw, s * hu + c * hw
            own[BU + i], own[BW + i] = u, w
            own[HU + i], own[HW + i], own[TURNED + i] = u, w, inertia


@njit
def joint_space_inertia(parent, slides, constants, x, inertia):  # type: ignore[no-untyped-def]
    """Fill in the joint-space inertia; see `spatial_kernel`."""
    for k in range(len(parent) - 1, 0, -1):
        own, entry, mass, slide = x[k], inertia[k, k], constants[k, CARRIED], slides[k]
        armature, sense = constants[k, ARMATURE], constants[k, PLANAR_SENSE]
        for i in range(LANES):
            hu, hw = own[HU + i], own[HW + i]
            au, aw = own[AU + i], own[AW + i]
            entry[i] = (mass if slide else own[TURNED + i]) + armature
            own[FU + i] = mass * au if slide else -sense * hw
            own[FW + i] = mass * aw if slide else sense * hu
            own[N + i] = hu * aw - hw * au if slide else sense * own[TURNED + i]
        a, below = parent[k], own
        while a > 0:
            above, coupled, sense = x[a], inertia[k, a], constants[a, PLANAR_SENSE]
            slide = slides[a]
            for i in range(LANES):
                fu, fw = own[FU + i], own[FW + i]
                about = own[N + i] + (below[OU + i] * fw - below[OW + i] * fu)
                own[N + i] = about
                coupled[i] = above[AU + i] * fu + above[AW + i] * fw if slide else sense * about
            a, below = parent[a], above
        if parent[k] > 0:
            above = x[parent[k]]
            for i in range(LANES):
                du, dw = own[OU + i], own[OW + i]
                hu, hw = own[HU + i], own[HW + i]
                eu, ew = hu + mass * du, hw + mass * dw
                above[HU + i] += eu
                above[HW + i] += ew
                above[TURNED + i] += own[TURNED + i] + (du * (hu + eu) + dw * (hw + ew))


@njit
def contact_jacobian(parent, slides, carries, constants, foot, lever, x, rows, point):  # type: ignore[no-untyped-def]
    """Fill in the contact point and the columns of its Jacobian, tangent and normal."""
    a, b, _ = lever
    own = x[foot]
    for i in range(LANES):
        point[TU + i] = own[C + i] * a - own[S + i] * b
        point[TW + i] = own[S + i] * a + own[C + i] * b
        point[DU + i], point[DW + i], point[SIZE + i] = point[TU + i], point[TW + i], 0.0
    for k in range(1, len(parent)):
        if not carries[k]:
            for i in range(rows.shape[1]):
                rows[k, i] = 0.0
    k = foot
    while k > 0:
        own, row, slide, sense = x[k], rows[k], slides[k], constants[k, PLANAR_SENSE]
        for i in range(LANES):
            du, dw = point[DU + i], point[DW + i]
            row[i] = own[AW + i] if slide else sense * du
            row[LANES + i] = own[AU + i] if slide else -sense * dw
            point[DU + i], point[DW + i] = du + own[OU + i], dw + own[OW + i]
        for i in range(LANES):
            t, n = row[i], row[LANES + i]
            point[SIZE + i] += t * t + n * n
        k = parent[k]


@njit
def joint_impulses(parent, slides, constants, foot, impulse, jump, x, point, answer):  # type: ignore[no-untyped-def]
    """Compute the impulses inside the joints from their jump of velocity; see `spatial_kernel`."""
    for k in range(1, len(parent)):
        own, above, dv = x[k], x[parent[k]], jump[k]
        slide, sense, mass = slides[k], constants[k, PLANAR_SENSE], constants[k, MASS]
        inertia = constants[k, PLANAR_INERTIA]
        for i in range(LANES):
            du, dw = own[OU + i], own[OW + i]
            turned, slid = (0.0, dv[i]) if slide else (sense * dv[i], 0.0)
            vu = above[VU + i] - above[TURN + i] * dw + own[AU + i] * slid
            vw = above[VW + i] + above[TURN + i] * du + own[AW + i] * slid
            turn = above[TURN + i] + turned
            own[TURN + i], own[VU + i], own[VW + i] = turn, vu, vw
            own[FU + i] = mass * vu - turn * own[BW + i]
            own[FW + i] = mass * vw + turn * own[BU + i]
            own[N + i] = inertia * turn + (own[BU + i] * vw - own[BW + i] * vu)
    own = x[foot]
    for i in range(LANES):
        pw, pu = impulse[i], impulse[2 * LANES + i]
        du, dw = point[TU + i], point[TW + i]
        own[FU + i] += pu
        own[FW + i] += pw
        own[N + i] += du * pw - dw * pu
        answer[i], answer[LANES + i] = 0.0, 0.0
        answer[2 * LANES + i] = own[VU + i] - own[TURN + i] * dw
    for k in range(len(parent) - 1, 0, -1):
        own, dv, slide = x[k], jump[k], slides[k]
        armature, sense = constants[k, ARMATURE], constants[k, PLANAR_SENSE]
        for i in range(LANES):
            fu, fw = own[FU + i], own[FW + i]
            along = own[AU + i] * fu + own[AW + i] * fw
            left = (along if slide else sense * own[N + i]) + armature * dv[i]
            answer[i] = max(answer[i], fu * fu + fw * fw)
            answer[LANES + i] = max(answer[LANES + i], math.fabs(left))
        if parent[k] > 0:
            above = x[parent[k]]
            for i in range(LANES):
                fu, fw = own[FU + i], own[FW + i]
                du, dw = own[OU + i], own[OW + i]
                above[FU + i] += fu
                above[FW + i] += fw
                above[N + i] += own[N + i] + (du * fw - dw * fu)
