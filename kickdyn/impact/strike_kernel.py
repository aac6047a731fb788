"""The impact of many strikes in machine code, by the law `newton`.

`BATCH` strikes go side by side, each with its own posture, velocity, contact and ball, see
`kickdyn.core.simd`. What is not computed to full precision is marked as doubtful.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np

from kickdyn.core import simd
from kickdyn.core.compilation import compiled, named
from kickdyn.core.simd import (
    BATCH,
    LARGEST_ANGLE,
    batches,
    choose,
    sine_and_cosine,
    spread,
)
from kickdyn.impact import newton_law
from kickdyn.robot import tree_kernel
from kickdyn.robot.tree_kernel import (
    BODY,
    D11,
    D12,
    D13,
    D22,
    D23,
    D33,
    JOINT,
    OPTIONS,
    STATE,
    contact_jacobian,
    delassus_matrix,
    factorize,
    inlined,
    joint_impulses,
    joint_space_inertia,
    njit,
    place_bodies,
    solve_velocity,
    whiten,
)

TASK = np.dtype([("foot", np.int64), ("planar", np.bool_)], align=True)
"""The joint that carries the contact point; motion is never taken to be in a plane."""

LANE = np.dtype(
    [
        ("axes", float, (9, BATCH)),  # two tangents and the normal, one after the other
        ("lever", float, (3, BATCH)),  # of the contact point, in the frame of the foot's joint [m]
        ("ball", float, (3, BATCH)),  # velocity of the ball's contact point, the ball alone [m/s]
        ("restitution", float, BATCH),
        ("friction", float, BATCH),
        ("tangent_mobility", float, BATCH),  # what the ball adds to the Delassus matrix [1/kg]
        ("normal_mobility", float, BATCH),
        ("velocity", float, (3, BATCH)),  # of the ball over the foot, in the contact's axes [m/s]
    ]
)
"""What is given of each strike, and the relative velocity that is computed."""

IMPULSE, POINT, SPEED, DOUBT, STICKS, LOST, FIRST = 0, 3, 6, 7, 8, 9, 10
"""Rows of an answer: impulse on the ball [N s], contact point from the first joint [m], speed
of approach [m/s], 1 where the strike is doubtful, 1 where the points stick, energy lost [J]; jump
of each joint's velocity, and the linear and angular impulse in each joint, in its frame."""

LEAST_SHARE = 1e-6
"""Share that a pivot or a resistance must keep of its terms, or the strike is doubtful."""

LEAST_RESISTANCE = 1e-3
"""Share of its mobility along the normal that a contact must resist with, or it is doubtful."""

_stick_impulse = njit(newton_law.stick_impulse)
_slip_impulse = njit(newton_law.slip_impulse)
_slip_conic = njit(newton_law.slip_conic)
_meet_circle = njit(newton_law.meet_circle)
_energy_lost = inlined(newton_law.energy_lost)


@njit
def _solve(floats, lane, i):  # type: ignore[no-untyped-def]
    """Fill in the impulse of lane i by the law `newton`; return 1 where the points stick, or 0."""
    delassus, mobility = floats.delassus, lane.tangent_mobility[i]
    g33 = delassus[D33, i] + lane.normal_mobility[i]
    g = (
        delassus[D11, i] + mobility, delassus[D12, i], delassus[D22, i] + mobility,
        delassus[D13, i], delassus[D23, i], g33,
    )  # fmt: skip
    u = lane.velocity[0, i], lane.velocity[1, i], lane.velocity[2, i]
    e, mu = lane.restitution[i], lane.friction[i]
    sticks = 0.0
    f3 = (1.0 + e) * u[2]
    impulse = 0.0, 0.0, -f3 / g33
    lost = -0.5 * (1.0 - e) * u[2] * impulse[2]
    if mu > 0.0:
        stick, _, (h22, h33) = _stick_impulse(g, u, e)
        p1, p2, p3 = stick
        if not (h22 > LEAST_SHARE * g[2] and h33 > LEAST_SHARE * g33):
            floats.doubt[i] = 1.0
        elif p1 * p1 + p2 * p2 <= (mu * p3) * (mu * p3) and p3 >= 0.0:
            sticks, impulse, lost = 1.0, stick, _energy_lost(stick, u, (0.0, 0.0), e)
        else:
            directions = _meet_circle(_slip_conic(g, u, e, mu))
            impulse, lost = _slip_impulse(g, u, e, mu, directions)
            if not 0.0 < impulse[2] * (LEAST_RESISTANCE * g33) < -f3:
                floats.doubt[i] = 1.0
    floats.impulse[0, i], floats.impulse[1, i], floats.impulse[2, i] = impulse
    floats.energy_lost[i] = lost
    return sticks


def _strike(tree, frames, task, given, motion, memory, answer):  # type: ignore[no-untyped-def]
    """Fill in the answers of strikes, `BATCH` at a time.

    `motion` has angle (or slide) and velocity of every joint, `given` the fields of
    `LANE` that are, in their order, of one batch where all strikes share them. `memory` is what it
    works in: a `LANE`, the bodies, the matrix of inertia and a `STATE`.
    """
    lanes, bodies, inertia, state = memory
    task, floats, lane_floats = task[0], state[0], lanes[0]
    bodies, inertia, state = batches(bodies), batches(inertia), batches(state)[0]
    lanes, given, motion, answer = (
        batches(lanes)[0],
        batches(given),
        batches(motion),
        batches(answer),
    )
    n = len(tree)
    for c in range(answer.shape[1]):
        g = c if given.shape[1] > 1 else 0
        doubt = spread(0.0)
        for k in range(1, n):
            angle = motion[2 * k - 2, c]
            if tree[k].slides:
                bodies[k].cosine = angle
            else:
                bodies[k].sine, bodies[k].cosine = sine_and_cosine(angle)
                doubt = choose(math.fabs(angle) < LARGEST_ANGLE, doubt, 1.0)
        for r in range(9):
            lanes.axes[r] = given[r, g]
        for r in range(3):
            lanes.lever[r], lanes.ball[r] = given[9 + r, g], given[12 + r, g]
        lanes.restitution, lanes.friction = given[15, g], given[16, g]
        lanes.tangent_mobility, lanes.normal_mobility = given[17, g], given[18, g]
        state.doubt = doubt
        place_bodies(tree, bodies)
        joint_space_inertia(tree, bodies, inertia)
        contact_jacobian(tree, bodies, task, lanes.lever, state)
        a, ball = lanes.axes, lanes.ball
        for r in range(3):
            lanes.velocity[r] = a[3 * r] * ball[0] + a[3 * r + 1] * ball[1] + a[3 * r + 2] * ball[2]
        for k in range(1, n):
            row = bodies[k].jacobian
            if not tree[k].carries_foot:
                row[0], row[1], row[2] = 0.0, 0.0, 0.0
                continue
            x, y, z = row[0], row[1], row[2]
            for r in range(3):
                row[r] = a[3 * r] * x + a[3 * r + 1] * y + a[3 * r + 2] * z
                lanes.velocity[r] -= row[r] * motion[2 * k - 1, c]
        factorize(tree, inertia, state)
        whiten(tree, bodies, inertia, task)
        delassus_matrix(tree, bodies, inertia, state)
        for i in range(BATCH):
            floats.speed_use[i] = _solve(floats, lane_floats, i)  # 1 where it sticks
        solve_velocity(tree, bodies, inertia, state)
        s, t, p = state.impulse[0], state.impulse[1], state.impulse[2]
        for r in range(3):
            state.impulse[r] = a[r] * s + a[3 + r] * t + a[6 + r] * p
            answer[IMPULSE + r, c] = state.impulse[r]
        joint_impulses(tree, bodies, task, state)
        x, y, z = state.point[0], state.point[1], state.point[2]
        k = task.foot
        while k > 0:
            origin = bodies[k].origin
            x, y, z = x + origin[0], y + origin[1], z + origin[2]
            k = tree[k].parent
        answer[POINT, c], answer[POINT + 1, c], answer[POINT + 2, c] = x, y, z
        answer[SPEED, c], answer[DOUBT, c] = 0.0 - lanes.velocity[2], state.doubt
        answer[STICKS, c], answer[LOST, c] = state.speed_use, state.energy_lost
        for k in range(1, n):
            answer[FIRST + k - 1, c] = bodies[k].jump
            first = FIRST + n - 1 + 6 * (k - 1)
            _write(bodies[k].rotation, frames[k], bodies[k].force, answer, first, c)
            _write(bodies[k].rotation, frames[k], bodies[k].torque, answer, first + 3, c)


@njit
def _write(rotation, frame, vector, answer, first, c):  # type: ignore[no-untyped-def]
    """Write a vector in the axes of its joint to batch c of an answer."""
    x, y, z = vector[0], vector[1], vector[2]
    u = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
    v = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
    w = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
    for r in range(3):
        answer[first + r, c] = frame[r, 0] * u + frame[r, 1] * v + frame[r, 2] * w


named(_strike, "strike", simd, newton_law, tree_kernel)


@cache
def compiled_kernel() -> Callable[..., None]:
    """Return the kernel, from the disk where it is kept there."""
    typeof: Any = numba.typeof
    tree, task, lanes, bodies, state = (
        typeof(np.zeros(1, dtype)) for dtype in (JOINT, TASK, LANE, BODY, STATE)
    )
    cube = numba.float64[:, :, ::1]
    tuple_of: Any = numba.types.Tuple
    memory = tuple_of((lanes, bodies, cube, state))
    signature = numba.void(tree, cube, task, cube, cube, memory, cube)
    return compiled(_strike, signature, "the kernel of strikes", **OPTIONS)
