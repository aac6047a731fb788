"""How far the ball lands from where it was meant to, for errors of the foot, the contact, the air.

To first order by the strike's and the flight's derivatives, and by drawing kicks: they agree for
small errors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.core.vectors import cross
from kickdyn.errors import InvalidInput
from kickdyn.flight.fly import fly
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.newton_law import solve_newton
from kickdyn.planning.shooting import ShootingProblem

UNITS = {"speed": "1", "angle": "rad", "contact": "m", "restitution": "1", "drag": "1"}
"""Sources of error: foot speed, relative; direction of the foot's velocity, upwards and sideways;
place of the contact on the ball, upwards and sideways; restitution; drag coefficient, relative."""

DRAG_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class Scatter:
    """Where the ball comes down to the height it lay at.

    Attributes:
        mean: shape `(2,)` [m], x and y from the start.
        covariance: shape `(2, 2)` [m2].
        by_source: to first order, what the covariance would be if the source were the only one;
            empty for drawn kicks.
        kicks: how many were drawn; 0 to first order.
    """

    mean: Array
    covariance: Array
    by_source: Mapping[str, Array]
    kicks: int

    @property
    def radius(self) -> float:
        """Root mean square distance from the mean [m]."""
        return math.sqrt(float(np.trace(self.covariance)))


def scatter(hit: Impact, air: Air | None = None, **spread: float) -> Scatter:
    """Carry standard deviations through strike and flight, to first order.

    Args:
        hit: a strike, law `newton`, of a ball that flies up.
        air: None is the vacuum.
        **spread: standard deviation by source, see `UNITS`; angle and contact for either
            direction. Sources are independent.

    Raises:
        InvalidInput: no source or an unknown one, a value below 0, another law, or a ball that
            does not land.
    """
    sizes = checked_spread(spread)
    landing, slopes = landing_slopes(hit.ball_after, hit.ball, air)
    parts = of_launch(hit, slopes, sizes)
    if "drag" in sizes:
        moved = _drag_slope(hit, air)
        parts["drag"] = sizes["drag"] ** 2 * np.outer(moved, moved)
    return Scatter(landing, np.sum(list(parts.values()), axis=0), MappingProxyType(parts), 0)


def drawn_scatter(
    hit: Impact, air: Air | None = None, *, kicks: int = 2000, seed: int = 0, **spread: float
) -> Scatter:
    """Draw kicks with normal errors, strike and fly them with `fly_many`; else as `scatter`.

    Each drag coefficient is an air of its own, so that it takes three values, with the weights of
    Gauss and Hermite: the moments of a normal distribution up to the fifth.

    Args:
        hit: as for `scatter`.
        air: as for `scatter`.
        kicks: how many, 100 at least.
        seed: of the draw.
        **spread: as for `scatter`.
    """
    from kickdyn.flight.batch import fly_many

    sizes = checked_spread(spread)
    if not isinstance(kicks, int) or kicks < 100:
        raise InvalidInput(f"kicks is {kicks!r}: it must be a whole number, 100 or more")
    draw = np.random.default_rng(seed)
    errors = draw.normal(size=(kicks, 6)) * np.array(
        [
            sizes.get(name, 0.0)
            for name in ("speed", *2 * ["angle"], *2 * ["contact"], "restitution")
        ]
    )
    struck = [_struck(hit, row) for row in errors]
    velocity, spin = (np.array([one[i] for one in struck]) for i in (0, 1))
    group, factors = np.zeros(kicks, int), [0.0]
    if "drag" in sizes and air is not None:
        group = np.array([0, 1, 1, 1, 1, 2])[np.arange(kicks) % 6]
        factors = [-math.sqrt(3) * sizes["drag"], 0.0, math.sqrt(3) * sizes["drag"]]
    landed = np.zeros((kicks, 2))
    for number, factor in enumerate(factors):
        rows = np.flatnonzero(group == number)
        states = BallState(
            np.zeros((len(rows), 3)), velocity[rows], spin[rows], np.zeros(len(rows))
        )
        flown = fly_many(states, hit.ball, _with_drag(air, float(factor)))
        landed[rows] = flown.landing_position.values[:, :2]
    good = np.isfinite(landed).all(axis=1)
    if not good.all():
        raise InvalidInput(f"{int((~good).sum())} of {kicks} drawn kicks do not land")
    return Scatter(
        landed.mean(axis=0), np.cov(landed.T), MappingProxyType(dict[str, Array]()), kicks
    )


def landing_slopes(state: BallState, ball: Ball, air: Air | None) -> tuple[Array, Array]:
    """Return where a ball comes back to its height, `(2,)`, and derivatives by velocity and spin.

    Shape `(2, 6)` [m per m/s, m per rad/s].
    """
    path = fly(state, ball, air, tol=1e-11)
    if path.status != "landed" or not path.duration > 0.0:
        raise InvalidInput("the ball does not fly up and come down: there is no landing to scatter")
    shot = ShootingProblem(ball, air, state.spin).shoot(state.velocity, path.duration)
    assert shot is not None
    going = shot.place(path.duration)[1]
    moved = np.zeros((3, 6))
    moved[:, :3] = shot.slope(path.duration)
    step = 1e-3 * max(10.0, float(np.linalg.norm(state.spin)))
    for axis in range(3) if air is not None else ():
        turned = [
            ShootingProblem(ball, air, state.spin + sign * step * np.eye(3)[axis]).shoot(
                state.velocity, path.duration
            )
            for sign in (1, -1)
        ]
        ends = [one.place(path.duration)[0] for one in turned if one is not None]
        moved[:, 3 + axis] = (ends[0] - ends[1]) / (2 * step)
    level = moved[:2] - np.outer(going[:2], moved[2] / going[2])  # it lands so much sooner
    return (path.landing.position - state.position)[:2], level


def of_launch(hit: Impact, slopes: Array, sizes: Mapping[str, float]) -> dict[str, Array]:
    """Return the landing's covariance by source of the launch, each of shape `(2, 2)` [m2].

    Args:
        hit: the strike.
        slopes: of the landing, as `landing_slopes` gives them.
        sizes: standard deviation by source; that of the drag is left out.
    """
    launch = _launch_slopes(hit)
    moved = {name: size * slopes @ launch[name] for name, size in sizes.items() if name in launch}
    return {name: one @ one.T for name, one in moved.items()}


def _launch_slopes(hit: Impact) -> dict[str, Array]:
    """Return derivatives of velocity and spin by each source's components, shape `(6, k)`."""
    slopes, ball = hit.sensitivity(of_leg=False), hit.ball
    # the foot faster is the ball slower; only their relative velocity makes the impulse
    by_foot = -np.vstack(
        [slopes.impulse["ball_velocity"] / ball.mass, slopes.spin["ball_velocity"]]
    )
    by_normal = np.vstack([slopes.velocity["normal"], slopes.spin["normal"]])
    by_e = np.vstack([slopes.velocity["restitution"], slopes.spin["restitution"]])
    up, left = _across(hit.foot_velocity)
    high, aside = _across(hit.contact.normal)
    speed = math.hypot(*hit.foot_velocity)
    return {
        "speed": by_foot @ hit.foot_velocity[:, None],
        "angle": by_foot @ (speed * np.column_stack([up, left])),
        "contact": by_normal @ (-np.column_stack([high, aside]) / ball.radius),
        "restitution": by_e,
    }


def _across(way: Array) -> tuple[Array, Array]:
    """Return unit vectors across a direction: upwards, and to the left."""
    along = way / math.hypot(*way)
    left = np.array([-along[1], along[0], 0.0])  # across the vertical
    if np.linalg.norm(left) < 1e-9:
        left = np.array([0.0, 1.0, 0.0])
    left /= np.linalg.norm(left)
    return cross(along, left), left


def _struck(hit: Impact, errors: Array) -> tuple[Array, Array]:
    """Return velocity and spin of the ball for errors of the foot and of the contact."""
    speed, rise, aside, high, over, e = errors.tolist()
    up, left = _across(hit.foot_velocity)
    foot = hit.foot_velocity + math.hypot(*hit.foot_velocity) * (rise * up + aside * left)
    foot = foot + speed * hit.foot_velocity
    n, ball = hit.contact.normal, hit.ball
    upper, lefter = _across(n)
    normal = n - (high * upper + over * lefter) / ball.radius
    normal /= math.hypot(*normal)
    problem = hit.approach.contact_problem()._replace(
        normal=normal,
        centre_velocity=hit.ball_before.velocity - foot,
        restitution=min(max(hit.contact.restitution + e, 0.0), 1.0),
    )
    impulse, _, _, tangential_impulse = solve_newton(problem)
    spin = hit.ball_before.spin - cross(normal, tangential_impulse) * (ball.radius / ball.inertia)
    return hit.ball_before.velocity + impulse / ball.mass, spin


def _drag_slope(hit: Impact, air: Air | None) -> Array:
    """Return the derivative of the landing by the relative drag coefficient, shape `(2,)` [m]."""
    ends = [
        fly(hit.ball_after, hit.ball, _with_drag(air, sign * DRAG_STEP), tol=1e-11).landing.position
        for sign in (1, -1)
    ]
    return np.asarray((ends[0] - ends[1])[:2] / (2 * DRAG_STEP))


def _with_drag(air: Air | None, change: float) -> Air | None:
    """Return the air with all its drag coefficients changed by a share."""
    if air is None or air.drag is None or change == 0.0:
        return air
    function: Any = getattr(air.drag, "function", air.drag)
    factor = 1.0 + change

    def scaled(reynolds: float, spin: float) -> float:
        return factor * function(reynolds, spin)  # type: ignore[no-any-return]

    return replace(air, drag=scaled)


def checked_spread(spread: Mapping[str, float]) -> dict[str, float]:
    """Return standard deviations by source, or raise `InvalidInput`."""
    if not spread:
        raise InvalidInput(f"no source is named: choose among {', '.join(UNITS)}")
    for name in spread:
        if name not in UNITS:
            raise InvalidInput(f"source {name!r} is unknown: choose among {', '.join(UNITS)}")
    return {
        name: validation.number(f"spread of {name}", value, at_least=0, at_most=1, unit=UNITS[name])
        for name, value in spread.items()
    }
