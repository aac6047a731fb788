"""Solvers of problems made of terms, by name.

A solver is a function of a problem and of the unknowns to start from, which returns unknowns. It
need not say whether it succeeded: `solve` judges the terms at what it returns.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import minimize
from threadpoolctl import ThreadpoolController

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.problem import Kind, Problem

Solver = Callable[[Problem[Any], Array], Array]


def slsqp(problem: Problem[Any], start: Array) -> Array:
    """Solve by sequential least squares (SLSQP of SciPy), the objective scaled to 1 at the start.

    Source: D. Kraft, A software package for sequential quadratic programming, DFVLR-FB 88-28, 1988.
    """
    scale = abs(float(problem.values(Kind.OBJECTIVE, start)[0])) or 1.0
    lower, upper = problem.bounds
    constraints = [
        {
            "type": name,
            "fun": lambda x, kind=kind: problem.values(kind, x),
            "jac": lambda x, kind=kind: problem.slopes(kind, x),
        }
        for name, kind in (("eq", Kind.EQUALITY), ("ineq", Kind.INEQUALITY))
        if problem.functions(kind)
    ]
    with one_blas_thread():
        result = minimize(
            lambda x: float(problem.values(Kind.OBJECTIVE, x)[0]) / scale,
            np.clip(start, lower, upper),
            jac=lambda x: problem.slopes(Kind.OBJECTIVE, x)[0] / scale,
            method="SLSQP",
            bounds=list(zip(lower, upper, strict=True)),
            constraints=constraints,
            options={"maxiter": 80, "ftol": 1e-7},
        )
    return np.asarray(result.x)


SOLVERS: dict[str, Solver] = {"slsqp": slsqp}
"""Solvers of nonlinear problems, by name."""


def solve(problem: Problem[Any], start: Array, solver: str = "slsqp") -> Array | None:
    """Return unknowns that solve a problem, near some to start from; None where none is found.

    Args:
        problem: the problem.
        start: unknowns, shape `(n,)`, within the bounds or not.
        solver: name of a solver, see `SOLVERS`.

    Raises:
        InvalidInput: an unknown solver.
    """
    if solver not in SOLVERS:
        raise InvalidInput(f"solver is {solver!r}: it must be one of {', '.join(SOLVERS)}")
    x = np.clip(SOLVERS[solver](problem, start), *problem.bounds)
    return x if problem.is_solved(x) else None


def one_blas_thread() -> Any:
    """Return a context in which BLAS computes in one thread.

    For matrices of 100 rows, several threads take 5 times as long on a free machine, and wait for
    each other on a busy one.
    """
    return _blas().limit(limits=1, user_api="blas")


@cache
def _blas() -> ThreadpoolController:
    """Return the controller of the libraries that are loaded; to look for them takes a while."""
    return ThreadpoolController()
