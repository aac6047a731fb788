"""How deep the ball would be inside the bodies of a kicking leg, by the shapes of its file."""

from contextlib import suppress

import numpy as np
import pinocchio as pin
from scipy.optimize import nnls
from scipy.spatial import ConvexHull, QhullError

from kickdyn.core.validation import Array
from kickdyn.impact.impact_result import Impact
from kickdyn.robot.ground_clearance import NEAR, Spheres, body_frames, shapes_of

TOLERANCE = 5e-3
"""Depth up to which a body counts as touching the ball [m].

It is a choice: shapes are simpler than real feet, and a ball is pressed in by more than this.
"""


def find_overlaps(impact: Impact) -> dict[str, float]:
    """Return how deep bodies are inside the ball at an impact [m], by frame, the deepest first.

    Bodies of the contact joint count where they are deeper in it than the contact point is in them.
    """
    posture, leg, radius = impact.posture, impact.posture.leg, impact.ball.radius
    model, data, centre = leg.workspace.model, leg.workspace.data, impact.ball_before.position
    pin.forwardKinematics(model, data, posture.q)
    found, touching, allowed = dict[str, float](), list[str](), TOLERANCE
    for name, frame in body_frames(leg).items():
        pose = pin.updateFramePlacement(model, data, frame)
        away = float(np.linalg.norm(pose.translation - centre))
        shapes = shapes_of(leg, name, meshes=away < NEAR + radius)
        bodies = [shape.moved(pose.homogeneous) for shape in shapes]
        found[name] = max((radius + _depth_of(centre, body) for body in bodies), default=0.0)
        if model.frames[frame].parentJoint == leg.contact_joint and found[name] > TOLERANCE:
            touching.append(name)
            own = max(_depth_of(posture.contact_point, body) for body in bodies)
            allowed = max(allowed, TOLERANCE + own)
    limits = {name: allowed if name in touching else TOLERANCE for name in found}
    deep = {name: depth for name, depth in found.items() if depth > limits[name]}
    return dict(sorted(deep.items(), key=lambda one: -one[1]))


def _depth_of(point: Array, body: Spheres) -> float:
    r"""Return how deep a point is in a convex body whose spheres are equal [m]; below 0 is outside.

    With the centres :math:`c_i` as seen from the point, those :math:`\lambda \ge 0` that minimize
    :math:`|\sum \lambda_i c_i|^2 + (1 - \sum \lambda_i)^2` are proportional to the weights of the
    nearest point of their convex hull.
    """
    corners = body.centres - point
    weights, _ = nnls(np.vstack([corners.T, np.ones(len(corners))]), np.array([0.0, 0.0, 0.0, 1.0]))
    outside = float(np.linalg.norm(weights @ corners) / weights.sum())
    inside = 0.0
    if outside < 1e-9:
        with suppress(QhullError, ValueError):  # flat
            inside = -float(ConvexHull(corners).equations[:, -1].max())
    return float(body.radii[0]) + inside - outside
