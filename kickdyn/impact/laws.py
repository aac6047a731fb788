"""Impact laws: from the velocities before to the impulse on the ball, with friction, in 3-D."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kickdyn import checks
from kickdyn.ball import Ball
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput, KickdynError


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """One contact point, just before the impact; world frame.

    Attributes:
        normal: unit vector from the foot into the ball, shape `(3,)`.
        leg_delassus: J M^-1 J^T of the leg, shape `(3, 3)` [1/kg].
        ball: the ball, a rigid shell.
        centre_velocity: of the ball's centre relative to the foot's contact point [m/s].
        spin: of the ball [rad/s].
        restitution: coefficient e.
        friction: coefficient mu.
    """

    normal: Array
    leg_delassus: Array
    ball: Ball
    centre_velocity: Array
    spin: Array
    restitution: float
    friction: float

    @property
    def velocity(self) -> Array:
        """Velocity of the ball's contact point relative to the foot's, shape `(3,)` [m/s]."""
        return self.centre_velocity - self.ball.radius * _cross(self.spin, self.normal)

    def delassus(self) -> Array:
        """Return leg and ball together, shape `(3, 3)` [1/kg]; the shell may turn."""
        turn = self.ball.radius**2 / self.ball.inertia
        ball = (1.0 / self.ball.mass + turn) * np.eye(3) - turn * np.outer(self.normal, self.normal)
        return self.leg_delassus + ball


class Solution(NamedTuple):
    """What a law decides.

    Attributes:
        impulse: on the ball, shape `(3,)` [N s, world frame].
        sticking: whether the contact points stay together while they touch.
        energy_lost: kinetic energy that leaves leg and ball [J].
    """

    impulse: Array
    sticking: bool
    energy_lost: float


Law = Callable[[ContactProblem], Solution]


def normal_impulse(
    approach_speed: float, restitution: float, leg_mass: float, ball_mass: float = math.inf
) -> float:
    """Return the frictionless impulse of Eq. (10) [N s].

    Args:
        approach_speed: of the foot towards the ball along the normal [m/s], 0 or more.
        restitution: coefficient e, 0 to 1.
        leg_mass: the leg's effective mass along the normal [kg], above 0; inf is immovable.
        ball_mass: [kg], above 0; inf, when not named, is an obstacle that does not move: the case
            of Table 2.

    Raises:
        InvalidInput: a value outside its range, or two immovable bodies.
    """
    speed = checks.number("approach speed", approach_speed, at_least=0, unit="m/s")
    e = checks.number("restitution", restitution, at_least=0, at_most=1)
    give = 0.0
    for name, mass in (("leg mass", leg_mass), ("ball mass", ball_mass)):
        if mass != math.inf:
            give += 1.0 / checks.number(name, mass, above=0, unit="kg")
    if give == 0.0:
        raise InvalidInput("leg mass and ball mass are both inf: one of them must move")
    return (1.0 + e) * speed / give


def newton(problem: ContactProblem) -> Solution:
    """Newton's restitution along the normal, Coulomb's cone across it, solved exactly.

    The normal velocity after is -e times that before. The contact points stick if the impulse that
    stops them from sliding lies inside the cone; else the impulse lies on the cone, against the
    direction of the sliding that remains. Where several such directions exist (strong friction, a
    lopsided leg), the one that loses most energy is returned.
    """
    n, u, e, mu = problem.normal, problem.velocity, problem.restitution, problem.friction
    delassus = problem.delassus()
    approach = -float(n @ u)
    if mu == 0.0:
        p = (1.0 + e) * approach / float(n @ delassus @ n)
        return Solution(p * n, False, 0.5 * p * (1.0 - e) * approach)

    axes = _contact_axes(n, u)
    g_matrix = axes.T @ delassus @ axes
    before = axes.T @ u
    before[2] = -approach
    free = before + np.array([0.0, 0.0, -e * approach])  # what an impulse must bring to rest
    stick = -np.linalg.solve(g_matrix, free)
    if math.hypot(stick[0], stick[1]) <= mu * stick[2]:
        return Solution(axes @ stick, True, _lost(stick, before, np.zeros(2), e))

    best: tuple[Array, float] | None = None
    for angle in _slip_angles(g_matrix, free, mu):
        along = np.array([mu * math.cos(angle), mu * math.sin(angle), 1.0])
        resistance = float(g_matrix[2] @ along)
        if resistance <= 0.0:
            continue
        slip = -free[2] / resistance * along
        sliding = (g_matrix @ slip + free)[:2]
        if float(sliding @ along[:2]) > 0.0:  # friction would push, not resist
            continue
        lost = _lost(slip, before, sliding, e)
        if best is None or lost > best[1]:
            best = slip, lost
    if best is None:
        raise KickdynError(
            f"no impulse found on the friction cone (mu = {mu:g}, e = {e:g}, "
            f"relative velocity {u.tolist()} m/s)"
        )
    return Solution(axes @ best[0], False, best[1])


def paper(problem: ContactProblem) -> Solution:
    """Return the impulse of the paper's Eqs. (15)-(21).

    Eq. (10) with a particle for a ball gives the impulse F along the attack direction, the foot's
    velocity relative to the ball. Its part across the normal is transmitted in full if it lies
    inside the friction cone (stick, Eq. 18); else mu times the normal part is (slip, Eq. 19),
    along T, the direction in the plane of F and n (Eqs. 15-17).

    The turning of the ball takes no part in finding F, so restitution holds along the attack
    direction and not along the normal, and the spin can hold energy that nothing paid for:
    `energy_lost` is then below what a passive law gives, even negative.
    """
    n, u, e, mu = problem.normal, problem.centre_velocity, problem.restitution, problem.friction
    speed = math.hypot(*u)
    attack = -u / speed
    leg_give = float(attack @ problem.leg_delassus @ attack)
    full = (1.0 + e) * speed / (leg_give + 1.0 / problem.ball.mass) * attack
    normal = float(full @ n)
    across = full - normal * n
    size = math.hypot(*across)
    sticking = size <= mu * normal
    impulse = full if sticking else normal * n + mu * normal / size * across
    after = problem.velocity + problem.delassus() @ impulse
    return Solution(impulse, sticking, -0.5 * float(impulse @ (problem.velocity + after)))


LAWS: dict[str, Law] = {"newton": newton, "paper": paper}
"""Every impact law by name."""


def _lost(impulse: Array, before: Array, sliding: Array, e: float) -> float:
    """Return the energy lost: minus the impulse times the mean velocity at the contact."""
    normal = -impulse[2] * before[2] * (1.0 - e)
    return 0.5 * float(normal - impulse[:2] @ (before[:2] + sliding))


def _slip_angles(g: Array, free: Array, mu: float) -> list[float]:
    """Return every direction in which friction and sliding can be opposite.

    With the impulse p (mu cos, mu sin, 1) and p from the normal row, "sliding is parallel to
    friction" is a trigonometric polynomial of degree 2, thus a quartic in exp(i angle).
    """
    x, y = (
        np.array(
            [
                mu * (free[i] * g[2, 0] - free[2] * g[i, 0]),
                mu * (free[i] * g[2, 1] - free[2] * g[i, 1]),
                free[i] * g[2, 2] - free[2] * g[i, 2],
            ]
        )
        for i in (0, 1)
    )  # sliding times a positive number: x and y, as coefficients of cos, sin and 1
    mean, cos1, sin1 = (x[1] - y[0]) / 2, -y[2], x[2]
    cos2, sin2 = -(x[1] + y[0]) / 2, (x[0] - y[1]) / 2
    roots = np.roots(
        [
            (cos2 - 1j * sin2) / 2,
            (cos1 - 1j * sin1) / 2,
            mean,
            (cos1 + 1j * sin1) / 2,
            (cos2 + 1j * sin2) / 2,
        ]
    )
    angles = []
    for root in roots[np.abs(np.abs(roots) - 1.0) < 1e-4]:
        angle = float(np.angle(root))
        for _ in range(3):  # Newton's method takes the root to the last digit
            c, s = math.cos(angle), math.sin(angle)
            c2, s2 = c * c - s * s, 2 * c * s
            value = mean + cos1 * c + sin1 * s + cos2 * c2 + sin2 * s2
            slope = -cos1 * s + sin1 * c + 2 * (sin2 * c2 - cos2 * s2)
            angle -= value / slope if slope else 0.0
        angles.append(angle)
    return angles


def _contact_axes(n: Array, u: Array) -> Array:
    """Return a rotation whose third column is n and whose first is along the sliding, if any."""
    across = u - (n @ u) * n
    if np.abs(across).max() <= 1e-12 * np.abs(u).max():
        across = np.zeros(3)
        across[int(np.argmin(np.abs(n)))] = 1.0
        across -= (n @ across) * n
    first = across / math.hypot(*across)
    return np.column_stack([first, _cross(n, first), n])


def _cross(a: Array, b: Array) -> Array:
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
