"""Many frictional contacts at once: impulses in Coulomb's cones, and how far they miss the laws."""

from __future__ import annotations

import math

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.impact.cone_newton import Cones, polished
from kickdyn.impact.newton_law import slip_angles

GOOD = 1e-11
"""`cone_residual` at which the search ends."""

SWEEPS = (20, 20, 20, 20, 100, 100, 100, 100)
"""Rounds of contact after contact, before each further start of Newton's method."""

THROWS = 30
"""Starts thrown at random, the same every time, where all that fails."""

LIGHTEST = 1e-14
"""Share of the largest mobility that a contact counts as having at least."""


def solve_cones(delassus: Array, free: Array, frictions: Array) -> tuple[Array, float]:
    """Return impulses that satisfy Signorini's and Coulomb's laws at every contact.

    With u = G p + g, at each contact: u_n >= 0, p_n >= 0, one of them 0; |p_t| <= mu p_n; where the
    contact slides, p_t is mu p_n against the sliding. Tangential axes first, normal last.

    Each contact is scaled to its own mobility, and its normal impulse by mu where that is above 1,
    so that no cone is wider than 45 degrees. Newton's method starts from sticking everywhere, then
    from rest; where both miss, from what contacts solved one after the other come to (nonlinear
    Gauss-Seidel; Jourdan, Alart & Jean 1998), and from starts thrown at random. Under strong
    friction there can be several answers: this is the first found, thus sticking where everything
    can stick.

    Args:
        delassus: G, positive semidefinite, shape `(3 k, 3 k)` [1/kg].
        free: g, shape `(3 k,)` [m/s].
        frictions: mu, shape `(k,)`.

    Returns:
        p, shape `(3 k,)` [N s], and `cone_residual` of it: the best found, be it good or not.
    """
    wide = np.maximum(frictions, 1.0)
    scale = np.repeat(1.0 / np.sqrt(_mobilities(delassus).max(axis=1)), 3)
    scale[2::3] /= wide
    speed = float(np.abs(scale * free).max()) or 1.0
    cones = Cones(delassus * scale * scale[:, None], scale * free / speed, np.minimum(frictions, 1))
    steps = 1.0 / _mobilities(cones.delassus)
    eager = steps.copy()  # in the plane's own measure: what friction holds up needs the longer one
    eager[:, 1] /= wide
    best, least = np.zeros(len(free)), math.inf

    def tried(start: Array, lengths: Array | None) -> Array:
        nonlocal best, least
        found = start if lengths is None else polished(cones, start, lengths)
        residual = cone_residual(delassus, free, frictions, found * scale * speed)
        if residual < least:
            best, least = found, residual
        return found

    stick = -np.linalg.pinv(cones.delassus, rcond=1e-12, hermitian=True) @ cones.free
    for start in (stick, np.zeros(len(free))):
        for lengths in (steps, eager):
            tried(start, lengths)
            if least <= GOOD:
                return best * scale * speed, least
    turn = np.zeros(len(free))
    for rounds in SWEEPS:
        turn = _swept(cones, turn, rounds)
        for step in (None, steps, eager):
            tried(turn, step)
            if least <= GOOD:
                return best * scale * speed, least
    rng = np.random.default_rng(0)
    for _ in range(THROWS):
        thrown = np.abs(rng.normal(size=len(free)))
        thrown[::3], thrown[1::3] = rng.normal(size=(2, len(frictions)))
        for step in (steps, eager):
            tried(thrown, step)
            if least <= GOOD:
                return best * scale * speed, least
    return best * scale * speed, least


def cone_residual(delassus: Array, free: Array, frictions: Array, impulses: Array) -> float:
    """Return how far impulses are from a solution; infinite for no numbers.

    At a solution, p_n = max(0, p_n - r u_n) = a and p_t is the point of the disc of radius mu a
    nearest to p_t - s u_t, for any r, s > 0 (Alart & Curnier 1991). What is missed counts in shares
    of the largest impulse, and, times the contact's mobility, of the largest velocity.
    """
    velocities = (delassus @ impulses + free).reshape(-1, 3)
    largest, fastest = float(np.abs(impulses).max()) or 1.0, float(np.abs(free).max()) or 1.0
    farthest = 0.0
    for p, u, mu, (across, along) in zip(
        impulses.reshape(-1, 3), velocities, frictions, _mobilities(delassus), strict=True
    ):
        pressing = max(0.0, p[2] - u[2] / along)
        aim = p[:2] - u[:2] / across
        size = math.hypot(*aim)
        held = aim if size <= mu * pressing else mu * pressing / size * aim
        for missed, whitened_jacobian in (
            (abs(p[2] - pressing), along),
            (float(np.abs(p[:2] - held).max()), across),
        ):
            if not math.isfinite(missed):
                return math.inf
            farthest = max(farthest, missed / largest, missed * whitened_jacobian / fastest)
    return farthest


def _mobilities(delassus: Array) -> Array:
    """Return the largest of each contact's own block, across and along the normal, `(k, 2)`."""
    blocks = delassus.reshape(-1, 3, len(delassus) // 3, 3)
    own = np.array([blocks[i, :, i] for i in range(len(blocks))])
    across = np.linalg.eigvalsh(own[:, :2, :2])[:, 1]
    found = np.column_stack([across, own[:, 2, 2]])
    return np.asarray(np.maximum(found, LIGHTEST * found.max()))


def _swept(cones: Cones, start: Array, rounds: int) -> Array:
    """Return what solving contact after contact, the others held, comes to."""
    p = start.copy()
    for _ in range(rounds):
        before = p.copy()
        for i, mu in enumerate(cones.frictions):
            at = slice(3 * i, 3 * i + 3)
            block = cones.delassus[at, at]
            alone = cones.free[at] + cones.delassus[at] @ p - block @ p[at]
            found = _one(block, alone, float(mu))
            if found is not None:
                p[at] = found
        if np.abs(p - before).max() <= 1e-15 * np.abs(p).max():
            break
    return p


def _one(block: Array, free: Array, mu: float) -> Array | None:
    """Return the exact impulse of one contact, as law `newton` finds it; None if it is lost."""
    if free[2] >= 0.0:
        return np.zeros(3)
    try:
        stick = -np.linalg.solve(block, free)
        angles = slip_angles(block, free, mu) if mu else []
    except np.linalg.LinAlgError:
        return None
    if math.hypot(stick[0], stick[1]) <= mu * stick[2]:
        return np.asarray(stick)
    if mu == 0.0:
        return np.array([0.0, 0.0, -free[2] / block[2, 2]])
    best, most = None, -math.inf
    for angle in angles:
        along = np.array([mu * math.cos(angle), mu * math.sin(angle), 1.0])
        resistance = float(block[2] @ along)
        if resistance <= 0.0:
            continue
        slip = -free[2] / resistance * along
        lost = -float(slip[:2] @ (block @ slip + free)[:2])
        if lost >= 0.0 and lost > most:
            best, most = slip, lost
    return best
