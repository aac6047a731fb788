"""Impact: error of the impulse against time, for each method to compute it.

MuJoCo is among them where it is installed.
"""

import math
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import Any

import numpy as np
import pinocchio as pin
from measurement import Measurement, mark_front, shortest_time
from mujoco_comparison import mujoco_kick

from kickdyn.ball import Ball
from kickdyn.cli.function_costs import EXACT, impulse_dynamics, kick
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.impact.approach import AT_REST, find_approach
from kickdyn.impact.collide import collide
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.robot.leg import Posture

CONTACT_TIMES = (1e-2, 1e-3, 1e-4, 1e-5)  # s
MUJOCO = {1e5: (2e-3, 1e-3, 1e-4, 1e-5), 1e6: (1e-4, 1e-5), 1e7: (1e-4, 1e-5, 1e-6)}
"""Stiffness [N/m] to time steps [s]."""
CONE_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)

KICKS = {
    f"friction {friction:g}" if friction else "frictionless": (friction, exact)
    for friction, exact in EXACT.items()
}
"""Friction of each kick, and its impulse on the ball [N s]; the test of this file computes it
anew with 50 digits."""

HALF_ULP = 0.5 * float(np.finfo(float).eps)
"""Least relative error that is distinguished from rounding."""

Method = tuple[str, str, Callable[[], Array]]
"""Name, setting, and the function that returns the impulse."""


def measure_impacts(report: Callable[[str], None] = lambda _: None) -> list[Measurement]:
    """Measure every method on the same two kicks, in one run, against 50 digits.

    Times are per evaluation, from posture and velocity on; for MuJoCo, only its steps are timed.
    The measurements on a kick's Pareto front are marked; `report` is called with each method's
    name.
    """
    rows = []
    for name, (friction, exact) in KICKS.items():
        impact = kick(friction)
        measured = []
        for method, setting, run in _methods(impact):
            report(f"{name}: {method} {setting}")
            try:
                gap = float(np.linalg.norm(run() - np.array(exact)))
            except KickdynError:  # MuJoCo at a step too long for its contact
                continue
            error = max(gap / math.hypot(*exact), HALF_ULP)
            measured.append(Measurement(name, method, setting, error, shortest_time(run)))
        rows += mark_front(measured)
    return rows


def _methods(impact: Impact) -> Iterator[Method]:
    """Yield name, setting and function of every method that applies to a kick."""
    leg, q, v = impact.posture.leg, impact.posture.q, impact.v_before
    ball, contact = impact.ball, impact.contact

    def applied(solve: Callable[..., Any], **options: Any) -> Callable[[], Array]:
        return lambda: solve(leg.posture(q), v, ball, contact, **options)

    def struck(solve: Callable[..., Any], **options: Any) -> Callable[[], Array]:
        return lambda: np.asarray(solve(leg.posture(q), v, ball, contact, **options).impulse)

    yield "closed form", "", struck(strike)
    if contact.friction == 0.0:
        yield "Pinocchio impulseDynamics", "", impulse_dynamics(impact)
        for seconds in CONTACT_TIMES:  # with friction it tends to another law
            yield (
                "compliant contact",
                f"{1e3 * seconds:g} ms",
                struck(collide, contact_time=seconds),
            )
    yield "dense KKT system", "", applied(solve_kkt)
    if contact.friction > 0.0:
        for name in ("ADMM", "PGS"):
            for tol in CONE_TOLERANCES:
                yield f"Pinocchio {name}", f"tol {tol:g}", applied(in_cone, name=name, tol=tol)
    if find_spec("mujoco") is None:  # optional
        return
    for stiffness, steps in MUJOCO.items():
        for dt in steps:
            yield "MuJoCo", f"{stiffness:.0e} N/m, dt {dt:g} s", mujoco_kick(impact, stiffness, dt)


def solve_kkt(posture: Posture, v: Array, ball: Ball, contact: Contact) -> Array:
    r"""Return the impulse from one linear system for all velocities after; friction sticks.

    .. math::
        \begin{pmatrix} M & -J^T \\ J & 0 \end{pmatrix} \begin{pmatrix} v^+ \\ p \end{pmatrix}
        = \begin{pmatrix} M v^- \\ b \end{pmatrix}

    with the leg and the ball in M and v, and the velocity b of separation at the contact.
    """
    n, nv = contact.normal, posture.leg.nv
    size = nv + 6
    rows = n[None] if contact.friction == 0.0 else np.eye(3)
    across = pin.skew(ball.radius * n)  # velocity at the contact per spin: -w x r n
    jacobian = rows @ np.hstack([-posture.jacobian, np.eye(3), across])
    mass = np.zeros((size, size))
    mass[:nv, :nv] = posture.inertia
    mass[range(nv, size), range(nv, size)] = [ball.mass] * 3 + [ball.inertia] * 3
    before = np.concatenate([v, np.zeros(6)])
    closing = float(n @ posture.jacobian @ v)
    bounce = closing * contact.restitution_at(closing) * (rows @ n)
    matrix = np.block([[mass, -jacobian.T], [jacobian, np.zeros((len(rows), len(rows)))]])
    after = np.linalg.solve(matrix, np.concatenate([mass @ before, bounce]))
    return np.asarray(rows.T @ after[size:])


def in_cone(
    posture: Posture, v: Array, ball: Ball, contact: Contact, name: str, tol: float
) -> Array:
    """Return the impulse by one of Pinocchio's cone solvers, `ADMM` or `PGS`, at a tolerance."""
    problem = find_approach(posture, v, ball, contact, AT_REST, AT_REST).contact_problem()
    axes, free = problem.in_contact_axes()
    free[2] *= 1.0 + problem.contacts[0].restitution
    solver = getattr(pin, f"{name}ConstraintSolver")(3)
    settings, result = (
        getattr(pin, f"{name}Solver{record}")() for record in ("Settings", "Result")
    )
    settings.max_iterations = 10_000
    for kind in ("feasibility", "complementarity"):
        setattr(settings, f"absolute_{kind}_tol", tol)
        setattr(settings, f"relative_{kind}_tol", tol)
    models, data = _point(contact.friction)
    operator = pin.DelassusOperatorDense(np.asfortranarray(problem.delassus(axes)))
    solver.solve(operator, np.array(free), models, data, settings, result)
    return np.asarray(axes[0] @ result.retrieveConstraintImpulses())


def _point(friction: float) -> tuple[object, object]:
    """Return models and data of a point contact; the cone solvers use only its friction cone."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "any")
    origin = pin.SE3.Identity()
    point = pin.PointContactConstraintModel(model, 1, origin, 0, origin)
    point.setFriction(friction)
    models, data = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    models.append(pin.ConstraintModel(point))
    data.append(models[0].createData())
    return models, data
