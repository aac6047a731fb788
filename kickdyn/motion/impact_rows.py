r"""Rows of the impact in a motion: momentum, restitution, no sliding, the ball's place, the ground.

The unknowns are q, v before, the jump of v, the share s of the launch, and the jump w that the
whole launch takes, of all joints: joints at rest give way in the impact. With the impulse
:math:`s\,p` on the ball, they keep

.. math::
    M w + J^T p = 0, \quad \Delta v = s\, w, \quad
    n \cdot (s\,u_b - J v^+) = e\, n \cdot J v^-, \quad x + r n = x_{ball}

and no sliding, with the velocity :math:`u_b` of the ball's contact point. The ground's impulse is
limited for the whole launch: then its limits depend on the posture alone, not on the share.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.motion.kick_task import KickTask, limited_speed
from kickdyn.motion.limits import Impulse, Sample
from kickdyn.motion.row_blocks import Rows, make_rows
from kickdyn.motion.symbolic_tree import SymbolicTree
from kickdyn.restitution import rows_of

LARGEST_TURN = 1.5
"""Largest angular velocity of a standing robot's foot across the normal, before the impact [rad/s]:
during the contact, a foot that turns faster sends the ball aside."""

TURN_SCALE = 10.0
"""Scale of that angular velocity [rad/s]."""


class ImpactRows(NamedTuple):
    """Rows of the impact.

    Attributes:
        every: of q, v before, the jump of v, s, and w; all but w are of the joints that move.
        posture: of q alone.
        margins: CasADi's function of q and w: margins of the ground's limits.
        jump: likewise of q: matrix and right side of the equations for w.
        ball_centre: likewise of q: the centre of the ball that the foot touches.
    """

    every: Rows
    posture: Rows
    margins: Any
    jump: Any
    ball_centre: Any


def impact_rows(
    task: KickTask, tree: SymbolicTree, at_rest: Any, limits: Sequence[Impulse]
) -> ImpactRows:
    """Return the rows of the impact of a kick.

    Args:
        task: the kick.
        tree: the joints that move.
        at_rest: q of all joints, in which those that move have the symbols of the tree.
        limits: of the ground's impulse.
    """
    target, leg, model = task.target, task.leg, task.whole.model
    ball, normal, impulse = target.ball, target.contact.normal, target.impulse
    q, v, jump = tree.q, tree.v, ca.SX.sym("jump", tree.model.nv)
    of_whole = ca.SX.sym("of_whole", model.nv)
    share, none = ca.SX.sym("share"), ca.SX(0, 1)
    every = SymbolicTree(model, (at_rest, ca.SX(model.nv, 1), of_whole))
    needed, reaction = every.inverse_dynamics(gravity=False)
    moving = [task.whole.velocity_index(name) for name in leg.joint_names]
    lever = leg.posture(leg.configuration()).with_contact_offset(target.contact.offset)
    point = tree.point(leg.contact_joint, lever.contact_lever)
    jacobian = ca.jacobian(point, q)
    inertia = np.diag(pin.crba(model, model.createData(), pin.neutral(model)))
    momentum = 0.3 * np.maximum(inertia, 0.02) * limited_speed(task.whole)
    force = ca.SX(model.nv, 1)  # of the ball on the joints, for its impulse
    force[moving] = -jacobian.T @ ca.DM(impulse)
    tangential = impulse - (normal @ impulse) * normal
    ball_point = impulse / ball.mass + ball.turning * tangential
    speed = float(np.linalg.norm(ball_point))
    apart = share * ca.DM(ball_point) - jacobian @ (v + jump)
    approach = ca.dot(ca.DM(normal), jacobian @ v)
    rebound = ca.dot(ca.DM(normal), apart) - _restitution(target, approach) * approach
    slip = ca.DM(_directions_across(task.foot_directions, normal))
    posture_rows = [
        (ca.DM(task.ball_rows) @ (point + ca.DM(ball.radius * normal - task.ball_centre))
         / ball.radius, 0.0, 0.0),
        (ca.DM(task.facing) @ (tree.rotation(leg.contact_joint).T @ ca.DM(normal)),
         0.0, np.inf),
    ]  # fmt: skip
    rows = [
        ((needed - force) / ca.DM(momentum), 0.0, 0.0),
        ((jump - share * of_whole[moving]) / ca.DM(0.3 * task.speed_limit), 0.0, 0.0),
        (rebound / speed, 0.0, 0.0),
        *posture_rows,
    ]
    if target.contact.friction > 0.0 and slip.numel():
        rows.append((slip @ apart / speed, 0.0, 0.0))
    if task.standing is not None:
        most = LARGEST_TURN / TURN_SCALE
        turning = slip @ tree.angular_velocity(leg.contact_joint) / TURN_SCALE
        rows.append((turning, -most, most))
    moment = ca.cross(point, ca.DM(impulse))
    wrench = reaction + ca.vertcat(ca.DM(impulse), moment)
    sample = Sample(tree, torque=None, wrench=wrench, size=float(np.linalg.norm(impulse)))
    rows += [limit.rows(sample) for limit in limits]
    z = ca.vertcat(q, v, jump, share, of_whole)
    margins = [limit.margins(sample) for limit in limits]
    function = ca.Function("impulse_margins", [q, of_whole], [ca.vertcat(none, *margins)])
    of_jump = ca.Function("jump", [q], [ca.jacobian(needed, of_whole), force])
    centre = ca.Function("ball", [q], [point + ca.DM(ball.radius * normal)])
    posture = make_rows(q, none, posture_rows, ca.SX(0.0))
    return ImpactRows(make_rows(z, none, rows, ca.SX(0.0)), posture, function, of_jump, centre)


def _restitution(target: ImpactTarget, approach: Any) -> Any:
    """Return e for a speed of approach: a number, or a piecewise linear expression."""
    restitution = target.contact.restitution
    if isinstance(restitution, float):
        return restitution
    rows = rows_of(restitution)
    e = rows[0][1]
    for (low, before), (high, after) in pairwise(rows):
        slope = (after - before) / (high - low)
        e += slope * (ca.fmin(ca.fmax(approach, low), high) - low)
    return e


def _directions_across(directions: Array, normal: Array) -> Array:
    """Return directions across the normal that the foot can move in, as rows."""
    _, gains, rows = np.linalg.svd(directions - np.outer(directions @ normal, normal))
    return np.asarray(rows[: len(gains)][gains > 1e-6])
