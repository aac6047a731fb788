"""What keeps the bodies of a robot out of the ball and out of each other, as terms of a kick."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.planning.kick_terms import KickTerm, KickVariables
from kickdyn.planning.problem import TOLERANCE, Kind
from kickdyn.robot.collisions import TOUCHING, Body, Placed, Proximity
from kickdyn.robot.ground_clearance import LARGEST_MESH, body_frames
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.standing import rest_configuration

RESERVE = 1e-3
"""What is left of `TOUCHING` [m]: the solver keeps its conditions within a tolerance."""


class BodyClearance(KickTerm):
    r"""Bodies are outside the ball or outside each other: their distances [m].

    A body with the point p nearest to another body, or to the ball, has the distance d with
    :math:`\dot d = n_p \cdot (\dot x - \dot p)`, where :math:`n_p` points from p to the other's
    nearest point x; for the ball, x is the contact point, which carries it.

    Args:
        robot: with the shapes of its file.
        variables: of the kick; their leg has the robot's frames by name.
        pairs: of bodies; None is the ball.
    """

    kind, margin, required = Kind.INEQUALITY, 2 * TOLERANCE, False
    rates_starts = False

    def __init__(
        self, robot: Leg, variables: KickVariables, pairs: Sequence[tuple[Body, Body | None]]
    ) -> None:
        contact, ball = variables.target.contact, variables.target.ball
        self._robot, self.scale, self._pairs = robot, ball.radius, pairs
        self._from_contact = ball.radius * contact.normal
        self._posture: Posture | None = None
        self._known: list[Proximity] = []
        bodies = (body for pair in self._pairs for body in pair if body is not None)
        self._frames = {body.frame: variables.frames[body.frame] for body in bodies}

    def residual(self, posture: Posture, v: Array) -> Array:
        return TOUCHING - RESERVE - np.array([x.depth for x in self._contacts(posture)])

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, None]:
        contacts = self._contacts(posture)
        model, data = posture.leg.workspace.model, posture.leg.workspace.data
        pin.computeJointJacobians(model, data, posture.q)
        pin.updateFramePlacements(model, data)

        def moved(body: Body | None, point: Array) -> Array:
            if body is None:
                return posture.jacobian
            number = self._frames[body.frame]
            jacobian = pin.getFrameJacobian(model, data, number, pin.LOCAL_WORLD_ALIGNED)
            arm = point - data.oMf[number].translation
            return np.asarray(jacobian[:3] - pin.skew(arm) @ jacobian[3:])

        slopes = [
            contact.normal @ (moved(other, contact.point) - moved(body, contact.point))
            for (body, other), contact in zip(self._pairs, contacts, strict=True)
        ]
        return np.array(slopes).reshape(len(contacts), posture.leg.nv), None

    def _contacts(self, posture: Posture) -> list[Proximity]:
        if posture is not self._posture:  # value and slope are of one posture
            space, centre = posture.leg.workspace, posture.contact_point + self._from_contact
            placed = Placed(self._robot, self._frames, space.model, space.data, posture.q)
            ball = placed.place_ball(centre, self.scale)
            self._posture = posture
            self._known = [placed.proximity(body, other or ball) for body, other in self._pairs]
        return self._known


def bodies_near_ball(robot: Leg) -> list[tuple[Body, None]]:
    """Return the bodies that can come near the ball, each with it; none without shapes."""
    posture, space = robot.posture(rest_configuration(robot)), robot.workspace
    placed = Placed(robot, body_frames(robot), space.model, space.data, posture.q)
    return [(body, None) for body in placed.bodies_near(posture.contact_point, LARGEST_MESH)]
