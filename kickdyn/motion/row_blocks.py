"""A nonlinear program of rows that are the same at several points, for Ipopt.

The Hessian of the Lagrangian is assembled from those at single points, which takes a fifth of the
time of automatic differentiation through the maps from the unknowns to the points.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import scipy.sparse as sp

from kickdyn.core.validation import Array

OPTIONS = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-3,
    "dual_inf_tol": 0.1,
    "nlp_scaling_method": "none",
    "compl_inf_tol": 1e-3,
    "linear_solver": "mumps",
    "mumps_permuting_scaling": 0,
    "mumps_pivot_order": 0,
}
"""Options of Ipopt that all solutions have. Without a permutation and with an ordering by least
degree, factorizations take a third to a half of the time."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of symbols with their bounds, and functions of their values and derivatives.

    Attributes:
        lower, upper: bounds, shape `(k,)`.
        values: of rows and cost for unknowns z and parameters p.
        jacobian: of the rows by z.
        slope: of the cost by z.
        hessian: by z, of the product of the rows with multipliers and of a weight of the cost.
    """

    lower: Array
    upper: Array
    values: Any
    jacobian: Any
    slope: Any
    hessian: Any


def make_rows(z: Any, p: Any, rows: Sequence[tuple[Any, float, float]], cost: Any) -> Rows:
    """Return the functions of rows, each with the bounds of all its entries, and of a cost."""
    stacked = ca.vertcat(*(row for row, _, _ in rows))
    sizes = [row.numel() for row, _, _ in rows]
    multipliers, weight = ca.SX.sym("multipliers", sum(sizes)), ca.SX.sym("weight")
    lagrangian = ca.dot(multipliers, stacked) + weight * cost
    return Rows(
        np.repeat([low for _, low, _ in rows], sizes),
        np.repeat([high for _, _, high in rows], sizes),
        ca.Function("values", [z, p], [stacked, cost]),
        ca.Function("jacobian", [z, p], [ca.jacobian(stacked, z)]),
        ca.Function("slope", [z, p], [ca.densify(ca.gradient(cost, z))]),
        ca.Function("hessian", [z, p, multipliers, weight], [ca.hessian(lagrangian, z)[0]]),
    )


class Block(NamedTuple):
    """Rows at several points.

    Attributes:
        rows: of one point.
        matrix: sparse map to the unknowns of all points, stacked.
        parameters: of the points, shape `(m, points)`.
        weights: of the costs of the points, shape `(points,)`.
    """

    rows: Rows
    matrix: Any
    parameters: Array
    weights: Array


class Cost(NamedTuple):
    r"""A cost :math:`\frac12 (x - c)^T Q (x - c) + s^T x` of the unknowns x.

    Attributes:
        quadratic: Q, sparse, of the first unknowns; the others have none.
        centre: c, shape `(k,)`.
        slope: s, shape `(k,)`.
    """

    quadratic: Any
    centre: Array
    slope: Array


def block_solver(
    blocks: Sequence[Block], linear: Any, cost: Cost, columns: int, options: dict[str, Any]
) -> Any:
    """Return Ipopt's solver for rows that are linear, and for blocks of rows.

    Args:
        blocks: rows at points, with costs of the points.
        linear: sparse matrix of the linear rows, which are the first ones.
        cost: the other part of the cost.
        columns: number of unknowns.
        options: of Ipopt, besides `OPTIONS`.
    """
    quadratic, to_linear = _matrix(cost.quadratic, columns, columns), _matrix(linear, columns)
    centre, slope = (_matrix(part[:, None], 1, columns) for part in (cost.centre, cost.slope))
    sizes = [to_linear.size1(), *(len(block.rows.lower) * len(block.weights) for block in blocks)]
    x, p, cost_weight = ca.MX.sym("x", columns), ca.MX.sym("p", 0), ca.MX.sym("weight")
    multipliers = ca.MX.sym("multipliers", sum(sizes))
    parts = ca.vertsplit(multipliers, np.cumsum([0, *sizes]).tolist())
    total = 0.5 * ca.dot(x - centre, quadratic @ (x - centre)) + ca.dot(slope, x)
    gradient, hessian = quadratic @ (x - centre) + slope, cost_weight * quadratic
    constraints, jacobian = [to_linear @ x], [ca.MX(to_linear)]
    for (rows, matrix, parameters, weights), part in zip(blocks, parts[1:], strict=True):
        count, to_points = len(weights), _matrix(matrix, columns)
        m = matrix.shape[0] // count
        z, p_given, weight = (
            ca.reshape(to_points @ x, m, count), ca.DM(parameters), ca.DM(weights).T
        )  # fmt: skip
        values, costs = rows.values.map(count)(z, p_given)
        total += ca.dot(weight, costs)
        slopes = rows.slope.map(count)(z, p_given) * ca.repmat(weight, m, 1)
        gradient += to_points.T @ ca.vec(slopes)
        constraints.append(ca.vec(values))
        jacobians = ca.horzsplit(rows.jacobian.map(count)(z, p_given), m)
        jacobian.append(ca.diagcat(*jacobians) @ to_points)
        by_row = ca.reshape(part, len(rows.lower), count)
        hessians = rows.hessian.map(count)(z, p_given, by_row, weight * cost_weight)
        hessian += to_points.T @ (ca.diagcat(*ca.horzsplit(hessians, m)) @ to_points)
    functions = {
        "grad_f": ca.Function(
            "nlp_grad_f", [x, p], [total, ca.densify(gradient)], ["x", "p"], ["f", "grad_f_x"]
        ),
        "jac_g": ca.Function(
            "nlp_jac_g", [x, p], [ca.densify(ca.vertcat(*constraints)), ca.vertcat(*jacobian)],
            ["x", "p"], ["g", "jac_g_x"],
        ),
        "hess_lag": ca.Function(
            "nlp_hess_l", [x, p, cost_weight, multipliers], [ca.triu(hessian)],
            ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"],
        ),
    }  # fmt: skip
    problem = {"x": x, "p": p, "f": total, "g": ca.vertcat(*constraints)}
    return ca.nlpsol("motion", "ipopt", problem, {
        **functions, "print_time": False, "error_on_fail": False, "calc_lam_p": False,
        "ipopt": {**OPTIONS, **options},
    })  # fmt: skip


def _matrix(matrix: Any, columns: int, rows: int | None = None) -> Any:
    """Return a sparse matrix of scipy, with zeros added to its size, as one of CasADi."""
    larger = sp.csc_matrix(matrix, copy=True)
    larger.resize(rows or matrix.shape[0], columns)
    return ca.DM(larger)
