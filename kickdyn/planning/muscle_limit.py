"""The torque limit of joints that muscles move: it falls with the speed."""

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.planning.kick_terms import KickPoint, KickVariables, TorqueLimit
from kickdyn.robot.leg import Posture
from kickdyn.robot.muscle_torque import muscle_share, muscle_share_slope


class MuscleTorqueLimit(TorqueLimit):
    """The torque that keeps the joints' speed is within what muscles have at this speed.

    Speed limits are those without torque. Rows are the distances from the limits in the positive
    and in the negative direction, shape `(2n,)`.
    """

    def __init__(self, variables: KickVariables) -> None:
        super().__init__(variables)
        limit = variables.leg.velocity_limit[self._vs]
        self._speed_limit = np.where(limit > 0.0, limit, np.inf)

    def _speed(self, v: Array) -> tuple[Array, Array]:
        """Return the signs of the directions, `(2, 1)`, and shortening speeds, shape `(2, n)`."""
        signs = np.array([[1.0], [-1.0]])
        return signs, np.clip(signs * v[self._vs] / self._speed_limit, 0.0, 1.0)

    def use(self, point: KickPoint) -> Array:
        torque = self.torque(point.posture, point.v) / self.limit
        _, speed = self._speed(point.v)
        most = np.where(torque > 0.0, *muscle_share(speed))
        return np.asarray(np.abs(torque) / np.maximum(most, 1e-9))

    def residual(self, posture: Posture, v: Array) -> Array:
        signs, speed = self._speed(v)
        distances = muscle_share(speed) - signs * self.torque(posture, v) / self.limit
        return np.asarray(distances.ravel())

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, Array]:
        by_q, by_v = self.torque_derivatives(posture, v)
        signs, speed = self._speed(v)
        fall = signs * muscle_share_slope(speed) * (speed > 0.0) / self._speed_limit
        rows_q = -signs[:, :, None] * (by_q / self.limit[:, None])
        rows_v = -signs[:, :, None] * (by_v / self.limit[:, None])
        columns = np.arange(len(self._vs))
        rows_v[:, columns, self._vs] += fall
        return rows_q.reshape(-1, len(v)), rows_v.reshape(-1, len(v))
