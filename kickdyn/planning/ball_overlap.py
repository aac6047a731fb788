"""How deep the ball would be inside the bodies of a kicking leg, by the shapes of its file."""

import numpy as np
import pinocchio as pin

from kickdyn.impact.impact_result import Impact
from kickdyn.robot.ground_clearance import LARGEST_MESH, body_frames, shapes_of

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
        shapes = shapes_of(leg, name, meshes=away < LARGEST_MESH + radius)
        bodies = [shape.moved(pose.homogeneous) for shape in shapes]
        found[name] = max((radius + body.depth_of(centre) for body in bodies), default=0.0)
        if model.frames[frame].parentJoint == leg.contact_joint and found[name] > TOLERANCE:
            touching.append(name)
            own = max(body.depth_of(posture.contact_point) for body in bodies)
            allowed = max(allowed, TOLERANCE + own)
    limits = {name: allowed if name in touching else TOLERANCE for name in found}
    deep = {name: depth for name, depth in found.items() if depth > limits[name]}
    return dict(sorted(deep.items(), key=lambda one: -one[1]))
