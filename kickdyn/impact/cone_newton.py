"""Newton's method on contact laws written as equations that are smooth but for their kinks."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kickdyn.core.validation import Array

STEPS = 60
SHORTEST = 1e-3
"""Share of a Newton step below which it is taken as it is."""


class Cones(NamedTuple):
    """Contacts, tangential axes first and normal last, in any units.

    Attributes:
        delassus: G, shape `(3 k, 3 k)`.
        free: velocities without impulses, shape `(3 k,)`.
        frictions: shape `(k,)`.
    """

    delassus: Array
    free: Array
    frictions: Array


def polished(cones: Cones, start: Array, lengths: Array) -> Array:
    """Return the best impulses on a damped Newton's way from a start, shape `(3 k,)`.

    The equations are p_n = max(0, p_n - r u_n) = a and p_t the point of the disc of radius mu a
    nearest to p_t - s u_t (Alart & Curnier 1991). Where G is singular, steps are the least.

    Args:
        cones: the contacts.
        start: impulses, shape `(3 k,)`.
        lengths: s and r of each contact, shape `(k, 2)`.
    """
    p = best = start
    missed, slope = _equations(cones, p, lengths)
    size = least = float(np.linalg.norm(missed))
    for _ in range(STEPS):
        row = _evening(slope, 1)
        even = slope * row[:, None]
        column = _evening(even, 0)
        try:
            step = column * np.linalg.lstsq(even * column, -missed * row, rcond=1e-14)[0]
        except np.linalg.LinAlgError:
            break
        share = 1.0
        while True:
            there = p + share * step
            missed, slope = _equations(cones, there, lengths)
            now = float(np.linalg.norm(missed))
            if now < (1.0 - 1e-4 * share) * size or share < SHORTEST or not math.isfinite(now):
                break
            share /= 2.0
        if now < least:
            best, least = there, now
        whole = float(np.linalg.norm(best))
        if not now > 1e-17 * whole or (now >= size and size < 1e-12 * whole):
            break
        p, size = there, now
    return best


def _evening(slope: Array, axis: int) -> Array:
    """Return what makes the largest entry of each row (axis 1) or column 1, where there is any."""
    largest = np.abs(slope).max(axis=axis)
    return np.asarray(1.0 / np.where(largest > 0.0, largest, 1.0))


def _equations(cones: Cones, p: Array, lengths: Array) -> tuple[Array, Array]:
    """Return what the equations miss, shape `(3 k,)`, and its derivative."""
    n = len(p)
    unit = np.eye(n)
    velocities = cones.delassus @ p + cones.free
    missed, slope = p.copy(), np.eye(n)
    for i, (mu, (s, r)) in enumerate(zip(cones.frictions, lengths, strict=True)):
        plane, normal = slice(3 * i, 3 * i + 2), 3 * i + 2
        pressing = p[normal] - r * velocities[normal]
        if pressing <= 0.0:  # apart: no impulse
            continue
        missed[normal], slope[normal] = r * velocities[normal], r * cones.delassus[normal]
        aim = p[plane] - s * velocities[plane]
        size = math.hypot(*aim)
        if size <= mu * pressing:  # sticks
            missed[plane], slope[plane] = s * velocities[plane], s * cones.delassus[plane]
            continue
        way = aim / size
        pressing_p = unit[normal] - r * cones.delassus[normal]
        aim_p = unit[plane] - s * cones.delassus[plane]
        turning = (np.eye(2) - np.outer(way, way)) * (mu * pressing / size)
        missed[plane] -= mu * pressing * way
        slope[plane] -= mu * np.outer(way, pressing_p) + turning @ aim_p
    return missed, slope
