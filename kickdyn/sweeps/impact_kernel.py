"""The impact of many postures: law `newton` for a ball at rest and a foot that comes centrally.

Of the Delassus matrix of leg and ball, along tangents and normal, the last column is the free
impulse's direction; friction then cuts it to the cone.
"""

from __future__ import annotations

import math

import numpy as np

from kickdyn.flight.lanes import LANES
from kickdyn.sweeps.arithmetic import njit

KEPT = 1e-3
"""Share that a difference must keep of its terms: below, a posture is doubted."""

NEAR = 1e-6
"""The same of the square of a direction that is made orthogonal to others."""

D11, D12, D22, D13, D23, D33 = (row * LANES for row in range(6))
"""Rows of J M^-1 J^T."""


@njit
def gather(carries, rows, delassus):  # type: ignore[no-untyped-def]
    """Fill in the Delassus matrix from weighed rows, two or three columns each."""
    delassus[:] = 0.0
    for k in range(1, len(carries)):
        if not carries[k]:
            continue
        row = rows[k]
        if rows.shape[1] == 2 * LANES:
            for i in range(LANES):
                t, n = row[i], row[LANES + i]
                delassus[D11 + i] += t * t
                delassus[D13 + i] += t * n
                delassus[D33 + i] += n * n
        else:
            for i in range(LANES):
                s, t, n = row[i], row[LANES + i], row[2 * LANES + i]
                delassus[D11 + i] += s * s
                delassus[D12 + i] += s * t
                delassus[D22 + i] += t * t
                delassus[D13 + i] += s * n
                delassus[D23 + i] += t * n
                delassus[D33 + i] += n * n


@njit
def strike(delassus, across, along, speed, e, mu, impulse, lost, doubt):  # type: ignore[no-untyped-def]
    """Fill in the impulse on the ball, flat, and the energy lost, with the ball's give.

    Doubt what cancels: a foot much lighter than the ball that gives way along one direction. What
    slips out of a plane is left to `slide`.
    """
    push = (1.0 + e) * speed
    for i in range(LANES):
        g11, g12, g22 = delassus[D11 + i] + across, delassus[D12 + i], delassus[D22 + i] + across
        g13, g23, g33 = delassus[D13 + i], delassus[D23 + i], delassus[D33 + i] + along
        share = g12 / g11  # Cholesky's order: Cramer's rule would lose digits twice
        h22, h23 = g22 - share * g12, g23 - share * g13
        t = -h23 / h22
        s = -(g13 + g12 * t) / g11
        sticks = s * s + t * t <= mu * mu
        flat = g12 == 0.0 and g23 == 0.0
        s = min(max(s, -mu), mu) if flat or mu == 0.0 else s
        t = 0.0 if flat or mu == 0.0 else t
        resistance = g33 + (g13 * s + g23 * t)
        sound = resistance > KEPT * g33 and (flat or mu == 0.0 or h22 > KEPT * g22)
        doubt[i] = doubt[i] if sound else 1.0
        p = push / resistance
        sliding = 0.0 if sticks else (g11 * s + g13) * p
        impulse[i], impulse[LANES + i], impulse[2 * LANES + i] = s * p, t * p, p
        lost[i] = 0.5 * p * (speed * (1.0 - e) - s * sliding)


@njit
def slide(delassus, across, along, speed, e, mu, impulse, lost, doubt):  # type: ignore[no-untyped-def]
    """Put the impulses of `strike` that leave the cone on it, where they are not flat."""
    for i in range(LANES):
        g12, g23 = delassus[D12 + i], delassus[D23 + i]
        s, t, most = impulse[i], impulse[LANES + i], mu * impulse[2 * LANES + i]
        if s * s + t * t <= most * most or (g12 == 0.0 and g23 == 0.0) or doubt[i] > 0.0:
            continue
        g11, g22 = delassus[D11 + i] + across, delassus[D22 + i] + across
        g13, g33 = delassus[D13 + i], delassus[D33 + i] + along
        found = _slip(g11, g12, g22, g13, g23, g33, (1.0 + e) * speed, mu, speed * (1.0 - e))
        impulse[i], impulse[LANES + i], impulse[2 * LANES + i], lost[i] = found


@njit
def _slip(g11, g12, g22, g13, g23, g33, push, mu, parting):  # type: ignore[no-untyped-def]
    """Return impulse and energy lost on the cone: `kickdyn.impact.newton_law`, number by number."""
    cos1, sin1, cos2, sin2 = -g23, g13, -mu * g12, 0.5 * mu * (g11 - g22)
    best = (math.nan, math.nan, math.nan, -math.inf)
    for angle in _opposed(cos1, sin1, cos2, sin2):
        for _ in range(3):
            c, s = math.cos(angle), math.sin(angle)
            c2, s2 = c * c - s * s, 2.0 * c * s
            value = cos1 * c + sin1 * s + cos2 * c2 + sin2 * s2
            slope = -cos1 * s + sin1 * c + 2.0 * (sin2 * c2 - cos2 * s2)
            angle -= value / slope if slope != 0.0 else 0.0
        s, t = mu * math.cos(angle), mu * math.sin(angle)
        resistance = g13 * s + g23 * t + g33
        p = push / resistance
        slide_s, slide_t = (g11 * s + g12 * t + g13) * p, (g12 * s + g22 * t + g23) * p
        if resistance <= 0.0 or slide_s * s + slide_t * t > 0.0:
            continue
        lost = 0.5 * p * (parting - (s * slide_s + t * slide_t))
        if lost > best[3]:
            best = (s * p, t * p, p, lost)
    return best


@njit
def _opposed(cos1, sin1, cos2, sin2):  # type: ignore[no-untyped-def]
    """Return every angle at which the sum of these waves, of angle and double angle, is about 0.

    The roots on the unit circle of a quartic in exp(i angle): eigenvalues of its companion matrix,
    as `np.roots` finds them, which takes seconds to compile.
    """
    angles, count = np.empty(4), 0
    if max(abs(cos2), abs(sin2)) <= 1e-17 * max(abs(cos1), abs(sin1)):
        angles[0], angles[1] = math.atan2(-cos1, sin1), math.atan2(cos1, -sin1)
        return angles[:2]
    first, companion = complex(cos2, -sin2), np.zeros((4, 4), np.complex128)
    companion[0, 0], companion[0, 2] = -complex(cos1, -sin1) / first, -complex(cos1, sin1) / first
    companion[0, 3] = -complex(cos2, sin2) / first
    companion[1, 0] = companion[2, 1] = companion[3, 2] = 1.0
    for root in np.linalg.eigvals(companion):
        if abs(abs(root) - 1.0) < 1e-4:
            angles[count] = math.atan2(root.imag, root.real)
            count += 1
    return angles[:count]


@njit
def movable(delassus, flat, doubt):  # type: ignore[no-untyped-def]
    """Doubt where the foot can hardly move along the normal alone, or across it."""
    for i in range(LANES):
        d11, d12, d22 = delassus[D11 + i], delassus[D12 + i], delassus[D22 + i]
        d13, d23, d33 = delassus[D13 + i], delassus[D23 + i], delassus[D33 + i]
        share = d12 / d11
        h22, h23 = d22 - share * d12, d23 - share * d13
        square = d33 - d13 / d11 * d13 - (0.0 if flat else h23 / h22 * h23)
        apart = flat or (d22 > NEAR * d33 and h22 > NEAR * d22)
        sound = d11 > NEAR * d33 and apart and square > NEAR * max(max(d11, d22), d33)
        doubt[i] = doubt[i] if sound else 1.0
