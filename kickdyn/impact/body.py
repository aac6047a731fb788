r"""Bodies in an impact: their shares of the Delassus matrix, and their responses to impulses.

Two bodies touch at each contact. Its normal points from the first into the second, and its impulse
is the one on the second; the first takes the opposite. The side of a body is -1 where it is the
first body of a contact, 1 where it is the second, and 0 at a contact of other bodies.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np

from kickdyn.ball import Ball, BallState
from kickdyn.core.mechanics import cross3
from kickdyn.core.validation import Array, read_only
from kickdyn.robot.leg import Posture


class Body:
    """A body of an impact with k contacts: its share of the Delassus matrix.

    As it stands, it is an obstacle at rest that no impulse moves: the ground or a wall.

    Attributes:
        is_free: whether the body can move in every direction.
    """

    is_free = False

    def delassus(self, axes: Array) -> Array:
        """Return the share of the Delassus matrix in contact axes, shape `(3 k, 3 k)` [1/kg].

        The rotations from contact axes, with the normal last, to world axes are `(k, 3, 3)`.
        """
        return np.zeros((3 * len(axes), 3 * len(axes)))

    def inverse_mass(self, direction: Array) -> float:
        """Return the share of the inverse effective mass at a single contact [1/kg].

        The impulse acts along a unit vector, `(3,)`, without turning a ball.
        """
        return 0.0


@dataclass(eq=False)
class BallBody(Body):
    """A ball, which is touched on its surface.

    Attributes:
        ball: mass m, radius r and inertia I_b.
        before: its motion just before the impact.
        normals: of the contacts.
        sides: of the ball at the contacts, -1, 0 or 1.
    """

    ball: Ball
    before: BallState
    normals: tuple[Array, ...]
    sides: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
        self.is_free = self.ball.mass < np.inf

    def delassus(self, axes: Array) -> Array:
        r"""Return the share of the Delassus matrix in contact axes, shape `(3 k, 3 k)` [1/kg].

        Contacts i and j whose second body is the ball have the block

        .. math:: \frac1m I + \frac{r^2}{I_b} (n_i \cdot n_j\, I - n_j n_i^T) .

        It is diagonal for i = j: a ball that hardly resists turning takes no digits from the
        normal.
        """
        along, turning = 1.0 / self.ball.mass, self.ball.turning
        diagonal = _diagonal(along + turning, along)
        if len(axes) == 1:
            return diagonal
        matrix = np.kron(np.diag(np.abs(self.sides)), diagonal)
        inward = [side * rotation[:, 2] for side, rotation in zip(self.sides, axes, strict=True)]
        for i, j in combinations(range(len(axes)), 2):
            angular = inward[i].dot(inward[j]) * np.eye(3) - np.outer(inward[j], inward[i])
            block = self.sides[i] * self.sides[j] * (along * np.eye(3) + turning * angular)
            rows, columns = slice(3 * i, 3 * i + 3), slice(3 * j, 3 * j + 3)
            matrix[rows, columns] = axes[i].T @ block @ axes[j]
            matrix[columns, rows] = matrix[rows, columns].T
        return matrix

    def inverse_mass(self, direction: Array) -> float:
        return 1.0 / self.ball.mass

    def after(self, impulses: Array, tangential_impulses: Array) -> BallState:
        r"""Return the ball just after impulses at the contacts, shape `(k, 3)` [N s].

        Only their parts across the normals, of the same shape, turn it:

        .. math:: v^+ = v + \frac1m \sum \pm p_i, \qquad
                  \omega^+ = \omega - \frac{r}{I_b} \sum n_i \times p_i .
        """
        vx, vy, vz = self.before.velocity.tolist()
        wx, wy, wz = self.before.spin.tolist()
        mass, gain = self.ball.mass, self.ball.radius / self.ball.inertia
        for i, side in enumerate(self.sides):
            if side:
                px, py, pz = impulses[i].tolist()
                vx, vy, vz = vx + side * px / mass, vy + side * py / mass, vz + side * pz / mass
                tx, ty, tz = cross3(self.normals[i].tolist(), tangential_impulses[i].tolist())
                wx, wy, wz = wx - gain * tx, wy - gain * ty, wz - gain * tz
        velocity, spin = np.array((vx, vy, vz)), np.array((wx, wy, wz))
        return BallState.computed(self.before.position, velocity, spin)


@lru_cache
def _diagonal(across: float, along: float) -> Array:
    """Return a matrix in contact axes, stored because numpy takes longer to make it."""
    return read_only(np.diag((across, across, along)))


@dataclass(eq=False)
class LegBody(Body):
    """A leg, or another articulated body, in a posture; a planar one cannot leave its plane.

    Attributes:
        posture: its inertia, supports and loops.
        v: joint velocity just before, shape `(nv,)` [rad/s; m/s for prismatic joints].
        jacobian: of the contact points, shape `(3 k, nv)`.
        factor: F with :math:`F F^T = J M^{-1} J^T`, shape `(3 k, n)` [kg^-1/2, world frame]; the
            rows of a contact have the sign of its side, or all of them have the wrong sign.
        sides: of the leg at the contacts, -1 or 1.
    """

    posture: Posture
    v: Array
    jacobian: Array
    factor: Array
    sides: tuple[float, ...] = (-1.0,)

    def delassus(self, axes: Array) -> Array:
        # The rows of the factor are rotated, not their products: a foot that is much more mobile
        # across the normal takes no digits from the normal.
        if len(axes) == 1:  # several take 3 us more
            rows = axes[0].T.dot(self.factor)
        else:
            blocks = zip(axes, np.split(self.factor, len(axes)), strict=True)
            rows = np.concatenate([rotation.T.dot(block) for rotation, block in blocks])
        product: Array = rows.dot(rows.T)
        return product

    def inverse_mass(self, direction: Array) -> float:
        row = direction.dot(self.factor)
        return float(row.dot(row))

    def jump(self, impulses: Array) -> tuple[Array, Array]:
        """Return the jump of the joint velocity and the impulses of the leg's constraints."""
        pushes = np.array(self.sides)[:, None] * impulses
        return self.posture.respond(pushes.ravel() @ self.jacobian)
