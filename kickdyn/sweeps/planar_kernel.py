"""What `spatial_kernel` computes, for legs that move in one plane, in two fifths of the time.

The plane contains the contact normal. Coordinates are (u, w), along the normal and along the
tangent in the plane; angles are positive from u to w. While all joints are at 0, the axes of every
body are those of the contact. The functions have the names and arguments of those of
`spatial_kernel`.
"""

import math

from kickdyn.core.simd import spread
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

(C, S, OU, OW, COS, SIN, AU, AW, BU, BW, HU, HW, TURNED, TURN, VU, VW, FU, FW, N) = range(19)
"""Rows of a joint: cosine and sine of its body's rotation; origin from the parent's; cosine and
sine of the joint's own angle (a slide's value first); axis of a slide; first moment of mass of the
body (B), and of all bodies the joint carries (H) with their second moment (TURNED); jump of angular
(TURN) and linear velocity (V); linear (F) and angular (N) impulse that the parent transmits."""

ROWS = 19

AXES = 2
"""Axes of the contact: rows of the Jacobian."""

UNIT = (C,)
"""Rows that are 1 where a body is not rotated."""

TU, TW, SIZE = 0, 1, 3
"""Rows of the contact point: its position from the foot's joint, the sum of squares of its
Jacobian."""


@njit
def place_bodies(parent, slides, constants, x):  # type: ignore[no-untyped-def]
    """Fill in rotation, origin and moments of mass of every body; see `spatial_kernel`."""
    for k in range(1, len(parent)):
        own, above, p = x[k], x[parent[k]], constants[k]
        a, b, sense = p[PLANAR_PLACE], p[PLANAR_PLACE + 1], p[PLANAR_SENSE]
        hu, hw, inertia = p[MOMENT], p[MOMENT + 1], p[PLANAR_INERTIA]
        c, s = above[C], above[S]
        ou, ow = c * a - s * b, s * a + c * b
        if slides[k]:
            axis_u, axis_w, along = p[PLANAR_AXIS], p[PLANAR_AXIS + 1], own[COS]
            au, aw = c * axis_u - s * axis_w, s * axis_u + c * axis_w
            ou, ow = ou + along * au, ow + along * aw
            own[AU], own[AW] = au, aw
        else:
            cos, sin = own[COS], sense * own[SIN]
            c, s = c * cos - s * sin, s * cos + c * sin
        own[OU], own[OW], own[C], own[S] = ou, ow, c, s
        u, w = c * hu - s * hw, s * hu + c * hw
        own[BU], own[BW] = u, w
        own[HU], own[HW], own[TURNED] = u, w, inertia


@njit
def joint_space_inertia(parent, slides, constants, x, inertia):  # type: ignore[no-untyped-def]
    """Fill in the joint-space inertia; see `spatial_kernel`."""
    for k in range(len(parent) - 1, 0, -1):
        own, mass, sense = x[k], constants[k, CARRIED], constants[k, PLANAR_SENSE]
        hu, hw, turned, armature = own[HU], own[HW], own[TURNED], constants[k, ARMATURE]
        if slides[k]:
            au, aw = own[AU], own[AW]
            fu, fw, about = mass * au, mass * aw, hu * aw - hw * au
            inertia[k, k] = mass + armature
        else:
            fu, fw, about = -sense * hw, sense * hu, sense * turned
            inertia[k, k] = turned + armature
        a, below = parent[k], own
        while a > 0:
            above = x[a]
            about = about + (below[OU] * fw - below[OW] * fu)
            if slides[a]:
                inertia[k, a] = above[AU] * fu + above[AW] * fw
            else:
                inertia[k, a] = constants[a, PLANAR_SENSE] * about
            a, below = parent[a], above
        if parent[k] > 0:
            above, du, dw = x[parent[k]], own[OU], own[OW]
            eu, ew = hu + mass * du, hw + mass * dw
            above[HU] += eu
            above[HW] += ew
            above[TURNED] += turned + (du * (hu + eu) + dw * (hw + ew))


@njit
def contact_jacobian(parent, slides, carries, constants, foot, lever, x, rows, point):  # type: ignore[no-untyped-def]
    """Fill in the contact point and the columns of its Jacobian, tangent and normal."""
    a, b, _ = lever
    c, s = x[foot, C], x[foot, S]
    du, dw = c * a - s * b, s * a + c * b
    point[TU], point[TW] = du, dw
    for k in range(1, len(parent)):
        if not carries[k]:
            rows[k, 0], rows[k, 1] = 0.0, 0.0
    k, square = foot, spread(0.0)
    while k > 0:
        own, sense = x[k], constants[k, PLANAR_SENSE]
        if slides[k]:
            t, n = own[AW], own[AU]
        else:
            t, n = sense * du, -sense * dw
        rows[k, 0], rows[k, 1] = t, n
        du, dw = du + own[OU], dw + own[OW]
        square += t * t + n * n
        k = parent[k]
    point[SIZE] = square


@njit
def joint_impulses(parent, slides, constants, foot, impulse, jump, x, point, answer):  # type: ignore[no-untyped-def]
    """Compute the impulses inside the joints from their jump of velocity; see `spatial_kernel`."""
    for k in range(1, len(parent)):
        own, above, dv, mass = x[k], x[parent[k]], jump[k], constants[k, MASS]
        bu, bw, turn = own[BU], own[BW], above[TURN]
        vu, vw = above[VU] - turn * own[OW], above[VW] + turn * own[OU]
        if slides[k]:
            vu, vw = vu + own[AU] * dv, vw + own[AW] * dv
        else:
            turn = turn + constants[k, PLANAR_SENSE] * dv
        own[TURN], own[VU], own[VW] = turn, vu, vw
        own[FU] = mass * vu - turn * bw
        own[FW] = mass * vw + turn * bu
        own[N] = constants[k, PLANAR_INERTIA] * turn + (bu * vw - bw * vu)
    own, pw, pu, du, dw = x[foot], impulse[0], impulse[2], point[TU], point[TW]
    own[FU] += pu
    own[FW] += pw
    own[N] += du * pw - dw * pu
    worst, left = spread(0.0), spread(0.0)
    answer[2] = own[VU] - own[TURN] * dw
    for k in range(len(parent) - 1, 0, -1):
        own, dv, armature = x[k], jump[k], constants[k, ARMATURE]
        fu, fw, about = own[FU], own[FW], own[N]
        sense = constants[k, PLANAR_SENSE]
        along = own[AU] * fu + own[AW] * fw if slides[k] else sense * about
        worst = max(worst, fu * fu + fw * fw)
        left = max(left, math.fabs(along + armature * dv))
        if parent[k] > 0:
            above = x[parent[k]]
            above[FU] += fu
            above[FW] += fw
            above[N] += about + (own[OU] * fw - own[OW] * fu)
    answer[0], answer[1] = worst, left
