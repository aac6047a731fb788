"""Many frictional contacts at once: impulses in Coulomb's cones, by Pinocchio's ADMM, checked."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from kickdyn.checks import Array

TOLERANCE = 1e-13
MAX_ITERATIONS = 100_000


def solve_cones(delassus: Array, free: Array, frictions: Array) -> tuple[Array, float]:
    """Return impulses that satisfy Signorini's and Coulomb's laws at every contact.

    With u = G p + g, at each contact: u_n >= 0, p_n >= 0, one of them 0; |p_t| <= mu p_n; where the
    contact slides, p_t is mu p_n against the sliding. Tangential axes first, normal last.

    Args:
        delassus: G, positive semidefinite, shape `(3 k, 3 k)` [1/kg].
        free: g, shape `(3 k,)` [m/s].
        frictions: mu, shape `(k,)`.

    Returns:
        p, shape `(3 k,)` [N s], and `cone_residual` of it.
    """
    heft, speed = 3.0 / float(np.trace(delassus[:3, :3])), float(np.abs(free).max())
    models, data = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    any_model = _one_joint()
    for friction in frictions:  # the solver takes but the cones from them
        point = pin.PointContactConstraintModel(
            any_model, 1, pin.SE3.Identity(), 0, pin.SE3.Identity()
        )
        point.setFriction(float(friction))
        models.append(pin.ConstraintModel(point))
    for model in models:
        data.append(model.createData())
    settings, result = pin.ADMMSolverSettings(), pin.ADMMSolverResult()
    settings.max_iterations = MAX_ITERATIONS
    for kind in ("feasibility", "complementarity"):
        setattr(settings, f"absolute_{kind}_tol", TOLERANCE)
        setattr(settings, f"relative_{kind}_tol", TOLERANCE)
    # In units of the first contact: the tolerances are absolute. The operator must be a new one.
    operator = pin.DelassusOperatorDense(np.asfortranarray(heft * delassus))
    solver = pin.ADMMConstraintSolver(len(free))
    solver.solve(operator, free / speed, models, data, settings, result)
    impulses = heft * speed * np.asarray(result.retrieveConstraintImpulses())
    return impulses, cone_residual(delassus, free, frictions, impulses)


def cone_residual(delassus: Array, free: Array, frictions: Array, impulses: Array) -> float:
    """Return how far impulses are from a solution, relative to the largest; NaN for no numbers.

    At a solution, p is the nearest point of the cone to p - r (u + mu |u_t| e_n), for any r > 0
    (De Saxce and Feng 1998, Math. Comput. Modelling 28:225).
    """
    velocities = (delassus @ impulses + free).reshape(-1, 3)
    farthest = 0.0
    for i, (p, u, mu) in enumerate(
        zip(impulses.reshape(-1, 3), velocities, frictions, strict=True)
    ):
        block = delassus[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        dual = np.array([u[0], u[1], u[2] + mu * np.hypot(u[0], u[1])])
        aim = p - dual / np.trace(block)
        farthest = np.maximum(farthest, np.abs(p - _nearest(aim, mu)).max())
    largest = float(np.abs(impulses).max())
    return float(farthest) / largest if largest else float(farthest)


def _nearest(p: Array, mu: float) -> Array:
    """Return the point of Coulomb's cone nearest to p."""
    across = float(np.hypot(p[0], p[1]))
    if across <= mu * p[2]:
        return p
    if mu * across <= -p[2]:
        return np.zeros(3)
    normal = (mu * across + p[2]) / (mu * mu + 1.0)
    return np.array([*(mu * normal / across * p[:2]), normal])


def _one_joint() -> pin.Model:
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "any")
    return model
