"""What keeps the bodies of a robot out of the ball, as a term of a kick."""

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.planning.kick_terms import KickTerm, KickVariables
from kickdyn.planning.problem import TOLERANCE, Kind
from kickdyn.robot.collisions import TOUCHING, Placed, Proximity
from kickdyn.robot.ground_clearance import LARGEST_MESH, body_frames
from kickdyn.robot.kicking_chain import rest_configuration
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.model_validation import frames_by_name

RESERVE = 1e-3
"""What is left of `TOUCHING` [m]: the solver keeps its conditions within a tolerance."""


class BallClearance(KickTerm):
    r"""The bodies near the contact point are outside the ball: their distances from it [m].

    A body whose point p is nearest to the ball has the distance d with
    :math:`\dot d = n_p \cdot (\dot x - \dot p)`, where x is the contact point, which carries the
    ball, and :math:`n_p` points from p into the ball.

    Args:
        robot: with the shapes of its file.
        variables: of the kick; their leg has the robot's frames by name.

    Attributes:
        bodies: that can come near the ball; none where the file has no shapes.
    """

    kind, margin, required = Kind.INEQUALITY, 2 * TOLERANCE, False
    rates_starts = False

    def __init__(self, robot: Leg, variables: KickVariables) -> None:
        contact, ball = variables.target.contact, variables.target.ball
        self._robot, self.scale = robot, ball.radius
        self._radius, self._from_contact = ball.radius, ball.radius * contact.normal
        rest = robot.posture(rest_configuration(robot))
        space = robot.workspace
        placed = Placed(robot, body_frames(robot), space.model, space.data, rest.q)
        self.bodies = placed.bodies_near(rest.contact_point, LARGEST_MESH)
        self._posture: Posture | None = None
        self._known: list[Proximity] = []
        numbers = frames_by_name(variables.leg.workspace.model)
        self._frames = {body.frame: numbers[body.frame] for body in self.bodies}

    def residual(self, posture: Posture, v: Array) -> Array:
        return TOUCHING - RESERVE - np.array([x.depth for x in self._contacts(posture)])

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, None]:
        contacts = self._contacts(posture)
        model, data = posture.leg.workspace.model, posture.leg.workspace.data
        pin.computeJointJacobians(model, data, posture.q)
        pin.updateFramePlacements(model, data)
        slopes = []
        for body, contact in zip(self.bodies, contacts, strict=True):
            number = self._frames[body.frame]
            jacobian = pin.getFrameJacobian(model, data, number, pin.LOCAL_WORLD_ALIGNED)
            arm = contact.point - data.oMf[number].translation
            point = jacobian[:3] - pin.skew(arm) @ jacobian[3:]
            slopes.append(contact.normal @ (posture.jacobian - point))
        return np.array(slopes).reshape(len(contacts), posture.leg.nv), None

    def _contacts(self, posture: Posture) -> list[Proximity]:
        if posture is not self._posture:  # value and slope are of one posture
            space, centre = posture.leg.workspace, posture.contact_point + self._from_contact
            placed = Placed(self._robot, self._frames, space.model, space.data, posture.q)
            self._posture = posture
            self._known = [placed.proximity(body, centre, self._radius) for body in self.bodies]
        return self._known
