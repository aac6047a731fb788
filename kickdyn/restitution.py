r"""The coefficient of restitution e: a number, a table over the speed of approach, or a model.

A table has rows (speed [m/s], e). Between its rows e is linear in the speed u of approach along the
normal; outside them the nearest row applies. A model is a table with a name; the rows of
`inflated` follow from the ball, so that a contact has them once it is the contact of a ball
(`restitution_for`).
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np

from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.core.validation import ArrayLike
from kickdyn.errors import InvalidInput

Table = tuple[tuple[float, float], ...]
"""Rows (speed of approach [m/s], e), speeds increasing."""

Restitution = float | str | Table
"""What `Contact.restitution` holds: a number, the name of one of `MODELS`, or a table."""

SHELL_RESTITUTION = 0.899
"""Factor of e in the model `inflated`, for what the shell loses as it bends. It is fitted: a ball
of 80 kPa that falls 2 m onto steel rebounds to 1.45 m, the middle of the 1.35 to 1.55 m that the
FIFA Quality Programme (2016, FIFA Quality Pro, 20 degrees Celsius) allows; the ends of this range
give 0.867 and 0.929."""

LARGEST_DEFLECTION = 0.6
"""Deflection over radius where the rows of `inflated` end. There the compression of the air, which
the model neglects, would raise e by about 2 % at 60 to 110 kPa."""


def inflated(ball: Ball) -> Table:
    r"""Return the rows of an inflated ball, from its mass m, radius R and gauge pressure p.

    .. math:: e = e_s \sqrt{1 - \tfrac23 U + \tfrac18 U^2}, \qquad
              U = \frac{u}{R} \sqrt{\frac{m}{2 \pi R p}},

    with `SHELL_RESTITUTION` :math:`e_s` and the largest deflection :math:`U R` at the speed u of
    approach. With a share s of the mass in the shell, `Ball.shell_share`, it is

    .. math:: \frac{e^2}{e_s^2} = \frac{\int_0^U x (2 - x)(1 - s x / 2)\,dx}{W(U)}, \qquad
              W(U) = \int_0^U \frac{x (2 - x)}{1 - s x / 2}\,dx = \frac{m u^2}{2 \pi p R^3} .

    The pressure pushes the flat circle of a thin shell against a wall; the flat part of
    the shell comes to rest, and its momentum is lost. `docs/explanation/inflated-ball.md` derives
    it. The rows are 0.02 R apart, between which linear e differs from the formula by less than
    2e-6.

    Raises:
        InvalidInput: the pressure is unknown, or the mass infinite.
    """
    ball.check_movable("the restitution 'inflated'")
    speed = ball.radius * math.sqrt(ball.stiffness) / math.sqrt(ball.mass)
    deflection = np.linspace(0.0, LARGEST_DEFLECTION, 31)
    nodes, weights = np.polynomial.legendre.leggauss(12)  # exact to rounding
    x = 0.5 * deflection[1:, None] * (1.0 + nodes)
    moving = 1.0 - 0.5 * ball.shell_share * x
    push = 0.5 * deflection[1:, None] * weights * x * (2.0 - x)
    work, gained = (push / moving).sum(axis=1), (push * moving).sum(axis=1)
    speeds = speed * np.sqrt(work)
    e = SHELL_RESTITUTION * np.sqrt(gained / work)
    return ((0.0, SHELL_RESTITUTION), *zip(speeds.tolist(), e.tolist(), strict=True))


MODELS: dict[str, Table | Callable[[Ball], Table]] = {
    "peacock-ball": ((9.1, 0.729), (21.2, 0.696)),
    "inflated": inflated,
}
"""The table of every model by name, or what computes it from the ball.

`Contact(restitution=name)` takes a name.

`peacock-ball` is a line of our own through the ends of the measurements of Peacock & Ball (ISBS
2016, article 7117): a rigid mechanical limb kicked an Australian football at 9.1 to 21.2 m/s, and
the ball left at 13.0 to 29.7 m/s. With the effective mass M of the limb, ball over foot speed is
(1 + e) M / (M + m); m / M = 0.21 follows from the middles of the published ranges, 1.37 to 1.48 of
that ratio and 0.66 to 0.79 of e. `docs/explanation/impact.md` derives it.
"""


class RestitutionOfBall(str):
    """The name of a model whose rows follow from the ball, with the rows of one ball."""

    rows: Table


def restitution_for(restitution: Restitution, ball: Ball) -> Restitution:
    """Return a restitution with its rows for a ball; unchanged where the ball has no effect."""
    if isinstance(restitution, str) and callable(MODELS[restitution]):
        return _restitution_of_ball(restitution, ball)
    return restitution


@lru_cache(maxsize=256)
def _restitution_of_ball(name: str, ball: Ball) -> RestitutionOfBall:
    restitution, model = RestitutionOfBall(name), MODELS[name]
    restitution.rows = model(ball) if callable(model) else model
    return restitution


def checked_restitution(value: float | str | ArrayLike, what: str = "restitution") -> Restitution:
    """Return a restitution from outside: a float, a model's name or a table; else raise."""
    choices = ", ".join(MODELS)
    if isinstance(value, str):
        if value in MODELS:
            return value
        raise InvalidInput(
            f"{what} is {validation.brief(value)}: it must be a finite number at least 0 and "
            f"at most 1, a table of rows (speed [m/s], e), or a model's name: {choices}"
        )
    if not hasattr(value, "__len__") or getattr(value, "ndim", 1) == 0:
        if hasattr(value, "table"):
            raise InvalidInput(
                f"{what} is a {type(value).__name__}: it must be a number, a model's name or "
                "a table of rows (speed [m/s], e), such as its attribute `table`"
            )
        return validation.number(what, value, at_least=0, at_most=1)
    table = validation.floats(what, value)
    if table.ndim != 2 or table.shape[1] != 2 or not len(table):
        raise InvalidInput(
            f"{what} has shape {table.shape}: it must be a number at least 0 and at most 1, "
            f"a table of rows (speed [m/s], e), shape (n, 2), or a model's name: {choices}"
        )
    for speed, e in table.tolist():
        validation.number(f"{what}'s speed", speed, at_least=0, unit="m/s")
        validation.number(f"{what} at {speed:g} m/s", e, at_least=0, at_most=1)
    if (np.diff(table[:, 0]) <= 0.0).any():
        raise InvalidInput(f"{what}'s speeds are {table[:, 0].tolist()} m/s: they must increase")
    return tuple((speed, e) for speed, e in table.tolist())


def read_restitution(text: str) -> Restitution:
    """Return the restitution that a command names: `0.7`, a model's name or `5:0.8,20:0.65`."""
    if text in MODELS:
        return text
    try:
        rows = [[float(number) for number in row.split(":")] for row in text.split(",")]
        if rows != [rows[0][:1]] and any(len(row) != 2 for row in rows):
            raise ValueError
    except ValueError:
        raise InvalidInput(
            f"restitution is {validation.brief(text)}: it must be a number such as 0.7, a table "
            f"such as 5:0.8,20:0.65 [m/s:e], or a model's name: {', '.join(MODELS)}"
        ) from None
    return checked_restitution(rows[0][0] if len(rows[0]) == 1 else rows)


def rows_of(restitution: Restitution) -> Table:
    """Return the rows of a table or of a named model; of a number one, at any speed."""
    if isinstance(restitution, float):
        return ((0.0, restitution),)
    if isinstance(restitution, RestitutionOfBall):
        return restitution.rows
    rows = MODELS[restitution] if isinstance(restitution, str) else restitution
    if callable(rows):
        raise InvalidInput(f"restitution is {restitution!r}: its value needs the ball, too")
    return rows


def restitution_at(restitution: Restitution, speed: float) -> float:
    """Return e at a speed of approach [m/s]."""
    if isinstance(restitution, float):
        return restitution
    low, e, slope = _segment(rows_of(restitution), speed)
    return e + slope * (speed - low)


def restitution_slope(restitution: Restitution, speed: float) -> float:
    """Return de/du at a speed of approach [1 / (m/s)]; in a row, the slope above it.

    It is 0 for a number and outside the table.
    """
    return _segment(rows_of(restitution), speed)[2]


def ball_slopes(restitution: Restitution, ball: Ball, speed: float) -> tuple[float, float]:
    r"""Return de/dm [1/kg] and de/dR [1/m] at a speed of approach [m/s], by mass and radius.

    They are 0 unless the rows follow from the ball; the speeds of `inflated` are proportional to
    :math:`m^{-1/2} R^{3/2}`.
    """
    if not isinstance(restitution, RestitutionOfBall):
        return 0.0, 0.0
    turn = restitution_slope(restitution, speed) * speed
    return 0.5 * turn / ball.mass, -1.5 * turn / ball.radius


def least_restitution(restitution: Restitution) -> float:
    """Return the least e that a restitution can take."""
    return min(e for _, e in rows_of(restitution))


def range_warnings(restitution: Restitution, speed: float) -> tuple[str, ...]:
    """Return a line if the speed of approach [m/s] is outside the table; one row has no range."""
    rows = rows_of(restitution)
    low, high = rows[0][0], rows[-1][0]
    if len(rows) == 1 or low * (1.0 - 1e-9) <= speed <= high * (1.0 + 1e-9):
        return ()
    name = f" {restitution!r}" if isinstance(restitution, str) else ""
    e = restitution_at(restitution, speed)
    return (
        f"restitution{name} is known from {low:g} to {high:g} m/s, and the foot approaches at "
        f"{speed:.4g} m/s: {e:.4g} is used, the value at the nearer end",
    )


def format_restitution(restitution: Restitution) -> str:
    """Return a restitution as short text."""
    if isinstance(restitution, float):
        return f"{restitution:g}"
    if isinstance(restitution, str):
        return repr(restitution)
    return f"[{', '.join(f'[{speed:g}, {e:g}]' for speed, e in restitution)}]"


def check_invertible(restitution: Restitution) -> None:
    r"""Raise `InvalidInput` unless :math:`u\,(1 + e(u))` increases with the speed u of approach.

    Only then is there one foot speed for each speed of the ball. In an interval the derivative,
    :math:`1 + e + u\,de/du`, is linear in u, so that it is enough to look at both ends.
    """
    for (low, e), (high, other) in pairwise(rows_of(restitution)):
        slope = (other - e) / (high - low)
        if not min(1.0 + e + low * slope, 1.0 + other + high * slope) > 0.0:
            raise InvalidInput(
                f"restitution falls from {e:g} at {low:g} m/s to {other:g} at {high:g} m/s, so fast"
                " that a faster foot would kick a slower ball: a plan needs u (1 + e) to increase"
            )


def approach_speed(restitution: Restitution, change: float) -> float:
    r"""Return the speed u of approach for which the normal velocity changes by u (1 + e(u)) [m/s].

    In a segment in which :math:`e = e_0 + k\,(u - u_0)`, with the change w and :math:`b = 1 + e_0 -
    k u_0`, it is :math:`u = 2 w / (b + \sqrt{b^2 + 4 k w})`.
    """
    changes = [(speed * (1.0 + e), e) for speed, e in rows_of(restitution)]
    low, e, slope = _segment(rows_of(restitution), change, changes)
    if slope == 0.0:
        return change / (1.0 + e)
    b = 1.0 + e - slope * low
    root = math.sqrt(max(b * b + 4.0 * slope * change, 0.0))
    return 2.0 * change / (b + root)


def _segment(
    rows: Table, value: float, keys: Sequence[tuple[float, float]] | None = None
) -> tuple[float, float, float]:
    """Return speed, e and de/du where the segment begins that holds a value; outside, de/du is 0.

    The value is a speed, or what the keys have in place of the speeds.
    """
    i = bisect_right(keys or rows, value, key=lambda row: row[0]) - 1
    low, e = rows[max(i, 0)]
    if i < 0 or i == len(rows) - 1:
        return low, e, 0.0
    high, other = rows[i + 1]
    return low, e, (other - e) / (high - low)
