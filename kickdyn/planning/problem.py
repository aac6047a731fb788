r"""Problems made of terms, and their solution by SLSQP.

A `Problem` has unknowns :math:`x` and a list of terms. Its objective :math:`f`, equalities
:math:`h`, inequalities :math:`g` and bounds come from the terms alone:

.. math:: \min_x f(x) \quad\text{subject to}\quad h(x) = 0, \quad g(x) \ge 0, \quad
    x_{min} \le x \le x_{max}.

Neither a problem nor a solver knows what the unknowns mean. Terms know: the problem's `point` makes
from the unknowns what its terms evaluate, such as a posture and a joint velocity. A solver need not
say whether it succeeded, because `Problem.solve` judges the terms at what it returns.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, lru_cache
from typing import Generic, TypeVar

import numpy as np
from scipy.optimize import minimize

from kickdyn.core.validation import Array

TOLERANCE = 1e-4
"""Largest violation of a term at a solution, over the term's scale."""

REACHED, POLISHING_STEP, LARGEST_POLISH, POLISHINGS = 1e-6, 1e-6, 0.03, 4
"""Of `Problem.polish`: the distance from a bound, or of an inequality over its scale from 0, up to
which it is reached; step of differences; largest step, and number of steps."""

Point = TypeVar("Point")


def keep_last(function: Callable[[Array], Point]) -> Callable[[Array], Point]:
    """Return the function with a memory of its last result.

    Solvers of scipy ask for values and derivatives in two calls at the same place; a function that
    computes them together then does so once.
    """
    cached = lru_cache(maxsize=1)(lambda place: function(np.frombuffer(place).copy()))
    return lambda place: cached(place.tobytes())


class Kind(StrEnum):
    """What the value of a term is to a problem."""

    OBJECTIVE = "objective"
    """Least at the solution."""
    EQUALITY = "equality"
    """0 at the solution."""
    INEQUALITY = "inequality"
    """0 or more at the solution."""
    BOUND = "bound"
    """Bounds of the unknowns, which hold at every point that a solver evaluates."""


class Term(ABC, Generic[Point]):
    """An objective, a condition or bounds of a problem."""

    kind: Kind  # objective, equality, inequality or bound
    # whether the condition must be kept. One that is not required is left out where no solution
    # keeps it
    required: bool = True
    # end of the sentence "there is no solution; ...", where there is one without this term; empty
    # for a term without which the problem has no meaning. Terms with the same explanation are left
    # out together
    explanation: str = ""

    def binding(self, point: Point) -> list[str]:
        """Return the names of the limits that are reached at a point."""
        return []


class Function(Term[Point]):
    """A term with a value and a slope."""

    scale: float = 1.0  # size of a large violation, in the unit of the value
    margin: float = 0.0  # distance from 0 that solvers keep to an inequality, over the scale
    # whether its violation counts where points to start from are compared
    rates_starts: bool = True

    @abstractmethod
    def value(self, point: Point) -> Array:
        """Return the value, shape `(k,)`; of an objective, `(1,)`."""

    @abstractmethod
    def slope(self, point: Point) -> Array:
        """Return the derivatives of the value by the unknowns, shape `(k, n)`."""


class Bounds(Term[Point]):
    """A term that bounds unknowns."""

    kind = Kind.BOUND
    lower: Array  # bounds of all unknowns, shape `(n,)`, infinite where there is none
    upper: Array


@dataclass(frozen=True, eq=False)
class Problem(Generic[Point]):
    """Unknowns and the terms on them."""

    size: int  # number of unknowns n
    point: Callable[[Array], Point]  # makes from unknowns, shape `(n,)`, what the terms evaluate
    terms: tuple[Term[Point], ...]  # one objective, conditions and bounds, in any order

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the unknowns, shape `(n,)` each."""
        bounds = [term for term in self.terms if isinstance(term, Bounds)]
        lower, upper = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        return (
            np.max([lower, *(term.lower for term in bounds)], axis=0),
            np.min([upper, *(term.upper for term in bounds)], axis=0),
        )

    def functions(self, kind: Kind) -> list[Function[Point]]:
        """Return the terms of a kind."""
        return [term for term in self.terms if isinstance(term, Function) and term.kind == kind]

    def values(self, kind: Kind, x: Array) -> Array:
        """Return the values of all terms of a kind over their scales, less their margins."""
        point = self._point(x)
        values = [f.value(point) / f.scale - f.margin for f in self.functions(kind)]
        return np.concatenate([np.zeros(0), *values])

    def slopes(self, kind: Kind, x: Array) -> Array:
        """Return the derivatives of `values`, shape `(k, n)`."""
        point = self._point(x)
        return np.concatenate([f.slope(point) / f.scale for f in self.functions(kind)])

    def solve(self, start: Array) -> Array | None:
        """Return unknowns that solve the problem, near some to start from; None without any.

        By sequential least squares (SLSQP of SciPy), the objective scaled to 1 at the start; D.
        Kraft, A software package for sequential quadratic programming, DFVLR-FB 88-28, 1988.
        """
        scale, bounds = abs(float(self.values(Kind.OBJECTIVE, start)[0])) or 1.0, self.bounds
        constraints = [
            {
                "type": name,
                "fun": lambda x, kind=kind: self.values(kind, x),
                "jac": lambda x, kind=kind: self.slopes(kind, x),
            }
            for name, kind in (("eq", Kind.EQUALITY), ("ineq", Kind.INEQUALITY))
            if self.functions(kind)
        ]
        result = minimize(
            lambda x: float(self.values(Kind.OBJECTIVE, x)[0]) / scale,
            np.clip(start, *bounds),
            jac=lambda x: self.slopes(Kind.OBJECTIVE, x)[0] / scale,
            method="SLSQP",
            bounds=list(zip(*bounds, strict=True)),
            constraints=constraints,
            options={"maxiter": 80, "ftol": 1e-7},
        )
        x = np.clip(result.x, *bounds)
        return x if self._is_solved(x) else None

    def polish(self, x: Array) -> Array:
        r"""Return a solution in all digits, by Newton's method on the Kuhn-Tucker conditions.

        The inequalities and bounds that are reached stay so. With the Hessian H of the Lagrangian,
        by differences of its gradient, and the derivatives C of the equalities and of these
        inequalities c, a step :math:`\delta` and multipliers :math:`\lambda` solve

        .. math:: H \delta - C^T \lambda = -\nabla f, \qquad C \delta = -c.

        Solvers stop where the objective hardly falls, at unknowns that depend on rounding.
        Where the method leads elsewhere, x is returned as it is.
        """
        lower, upper = self.bounds
        at_lower, at_upper = x <= lower + REACHED, x >= upper - REACHED
        y = np.where(at_upper, upper, np.where(at_lower, lower, x))
        free = np.flatnonzero(~(at_lower | at_upper))
        kinds = [kind for kind in (Kind.EQUALITY, Kind.INEQUALITY) if self.functions(kind)]
        active = [(self.values(kind, y) <= REACHED) | (kind == Kind.EQUALITY) for kind in kinds]
        if not len(free) or not any(keep.any() for keep in active):
            return x

        def evaluate(z: Array) -> tuple[Array, Array, Array]:
            keep = np.concatenate(active)
            values = np.concatenate([self.values(kind, z) for kind in kinds])[keep]
            slopes = np.concatenate([self.slopes(kind, z) for kind in kinds])[keep][:, free]
            return values, slopes, self.slopes(Kind.OBJECTIVE, z)[0, free]

        values, slopes, gradient = evaluate(y)
        count, multipliers = len(free), np.linalg.lstsq(slopes.T, gradient, rcond=None)[0]
        hessian = np.zeros((count, count))
        for column, index in enumerate(free):
            shifted = y.copy()
            shifted[index] += POLISHING_STEP
            _, other, steeper = evaluate(shifted)
            change = steeper - gradient - (other - slopes).T @ multipliers
            hessian[column] = change / POLISHING_STEP
        for _ in range(POLISHINGS):
            rows = len(values)
            system = np.zeros((count + rows, count + rows))
            system[:count, :count] = 0.5 * (hessian + hessian.T)
            system[:count, count:], system[count:, :count] = -slopes.T, slopes
            step = np.linalg.lstsq(system, -np.append(gradient, values), rcond=1e-12)[0][:count]
            y[free] += step
            size = float(np.abs(step).max())
            if not size < LARGEST_POLISH:
                return x
            if size < 1e-14:
                break
            values, slopes, gradient = evaluate(y)
        falls = self.values(Kind.OBJECTIVE, y)[0] <= self.values(Kind.OBJECTIVE, x)[0] + TOLERANCE
        inside = bool(((y >= lower) & (y <= upper)).all())
        return y if falls and inside and self._is_solved(y) else x

    def _is_solved(self, x: Array) -> bool:
        if not np.isfinite(x).all():
            return False
        equal, margins = self.values(Kind.EQUALITY, x), self.values(Kind.INEQUALITY, x)
        return bool((np.abs(equal) <= TOLERANCE).all() and (margins >= -TOLERANCE).all())

    @cached_property
    def _point(self) -> Callable[[Array], Point]:
        return keep_last(self.point)
