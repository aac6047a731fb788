"""Joint-space inertias side by side: Featherstone's L^T L of a tree, `LANES` postures at once.

M = L^T L with L lower triangular has an entry only where one joint carries the other (Featherstone
2008, Table 6.3), so that the branches of a tree cost nothing to each other. Joints count from 1, as
Pinocchio's do. Matrices have one row of `LANES` numbers per entry; see `kickdyn.flight.lanes`.
"""

from __future__ import annotations

import math

from kickdyn.flight.lanes import LANES
from kickdyn.sweeps.arithmetic import njit

PIVOT = 1e-9
"""Share of its diagonal that a pivot must keep, else the posture is computed with more care."""

LOSS = 300.0
"""By how many times M's rounding may be seen in the energy of a joint velocity, for 1e-12 to be
kept; legs have about 10, and some hundreds a link before one ten times as long."""


@njit
def factor(parent, inertia, doubt):  # type: ignore[no-untyped-def]
    """Replace M, shape `(n + 1, n + 1, LANES)`, by L, its diagonal inverted; doubt small pivots."""
    diagonal = inertia[0]  # of no joint: free to keep M's diagonal
    for k in range(1, len(parent)):
        kept, entry = diagonal[k], inertia[k, k]
        for i in range(LANES):
            kept[i] = entry[i]
    for k in range(len(parent) - 1, 0, -1):
        pivot, kept = inertia[k, k], diagonal[k]
        for i in range(LANES):
            doubt[i] = doubt[i] if pivot[i] > PIVOT * kept[i] else 1.0
            pivot[i] = 1.0 / math.sqrt(pivot[i])
        a = parent[k]
        while a > 0:
            entry = inertia[k, a]
            for i in range(LANES):
                entry[i] *= pivot[i]
            a = parent[a]
        a = parent[k]
        while a > 0:
            left, b = inertia[k, a], a
            while b > 0:
                right, entry = inertia[k, b], inertia[a, b]
                for i in range(LANES):
                    entry[i] -= left[i] * right[i]
                b = parent[b]
            a = parent[a]


@njit
def weigh(parent, carries, lower, rows):  # type: ignore[no-untyped-def]
    """Replace the columns of J^T by L^-T J^T: `rows[k]` is flat, `LANES` numbers per column."""
    width = rows.shape[1]
    for k in range(len(parent) - 1, 0, -1):
        if not carries[k]:
            continue
        own, pivot = rows[k], lower[k, k]
        for c in range(0, width, LANES):
            for i in range(LANES):
                own[c + i] *= pivot[i]
        a = parent[k]
        while a > 0:
            entry, above = lower[k, a], rows[a]
            for c in range(0, width, LANES):
                for i in range(LANES):
                    above[c + i] -= entry[i] * own[c + i]
            a = parent[a]


@njit
def unweigh(parent, lower, v, doubt):  # type: ignore[no-untyped-def]
    """Replace z, shape `(n + 1, LANES)`, by L^-1 z; doubt what M's rounding is seen in.

    An error of M by e of its diagonal changes v^T M v = z^T z by e sum M_ii v_i^2, about: see
    `kickdyn.robot.leg.Posture.rounding_gain`.
    """
    whole, parts = v[0], lower[0, 0]  # of no joint
    whole[:] = 0.0
    parts[:] = 0.0
    for k in range(1, len(parent)):
        own, pivot, diagonal, a = v[k], lower[k, k], lower[0, k], parent[k]
        for i in range(LANES):
            whole[i] += own[i] * own[i]
        while a > 0:
            entry, above = lower[k, a], v[a]
            for i in range(LANES):
                own[i] -= entry[i] * above[i]
            a = parent[a]
        for i in range(LANES):
            own[i] *= pivot[i]
            parts[i] += diagonal[i] * (own[i] * own[i])
    for i in range(LANES):
        doubt[i] = doubt[i] if parts[i] <= LOSS * whole[i] else 1.0
