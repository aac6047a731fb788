"""A leg at a posture with 50 digits: kinematics, inertia and momenta, by the definitions.

None of Pinocchio's algorithms is used: placements are composed joint by joint, and the inertia is
the sum over bodies of their momenta about the world's origin per joint velocity, a choice that 50
digits forgive. Vectors and matrices are numpy arrays of mpmath's numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg

DIGITS = 50


def context(digits: int) -> Any:
    """Return mpmath's arithmetic with so many digits, apart from mpmath's own state."""
    found = mpmath.MPContext()
    found.dps = digits
    return found


mp = context(DIGITS)
"""The arithmetic."""

UPPER = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Where the entries of a symmetric matrix stand in its upper triangle."""

Exact = NDArray[np.object_]
"""An array of numbers with 50 digits."""


def numbers(values: Any) -> Any:
    """Return an array of numbers with 50 digits, each exactly what its float was."""
    return mapped(lambda value: mp.mpf(float(value)), values)


def mapped(function: Callable[[Any], Any], values: Any) -> Any:
    """Return an array with a function applied to every number."""
    return np.frompyfunc(function, 1, 1)(np.asarray(values))


def length(vector: Exact) -> Any:
    """Return the Euclidean norm of a vector."""
    return mp.sqrt(mp.fdot(vector, vector))


def leg_numbers(leg: Leg) -> tuple[dict[str, Any], dict[str, Exact]]:
    """Return all that an impact needs of a leg: its structure, and its numbers by name."""
    model = leg.model
    if leg.constraints is not None:
        raise InvalidInput(f"{leg.name} has constraints: the reference is for free legs only")
    axes, prismatic = [], []
    for joint in list(model.joints)[1:]:
        if joint.nq != 1:
            raise InvalidInput(
                f"joint {joint.shortname()}: the reference is for joints of one angle"
            )
        data = joint.createData()
        joint.calc(data, np.zeros(1))
        axis = np.array(data.S).ravel()
        prismatic.append(bool(axis[:3].any()))
        axes.append(axis[:3] if prismatic[-1] else axis[3:])
    placements, inertias = list(model.jointPlacements)[1:], list(model.inertias)[1:]
    structure = {"parents": [int(parent) - 1 for parent in list(model.parents)[1:]],
        "prismatic": prismatic, "contact_joint": leg.contact_joint - 1}  # fmt: skip
    return structure, {"axes": numbers(axes),
        "rotations": numbers([place.rotation for place in placements]),
        "offsets": numbers([place.translation for place in placements]),
        "masses": numbers([inertia.mass for inertia in inertias]),
        "levers": numbers([inertia.lever for inertia in inertias]),
        "moments": numbers([inertia.inertia[np.triu_indices(3)] for inertia in inertias]),
        "armature": numbers(model.armature), "contact_lever": numbers(leg.contact_lever),
        }  # fmt: skip


class ExactPosture:
    r"""A leg at a configuration, as `Posture`, with 50 digits.

    With the twists :math:`S_i` of the joints and the inertias :math:`I_b` of the bodies about the
    world's origin, :math:`M_{ij} = \sum_b S_i^T I_b S_j` over the bodies that both joints move.

    Args:
        structure: as `leg_numbers` returns it.
        values: the leg's numbers, likewise.
        q: configuration.

    Attributes:
        origins, rotations: of the joints in the world.
        contact_point: of the leg, shape `(3,)`.
        jacobian: of the contact point, shape `(3, nv)`.
        inertia: M, shape `(nv, nv)`.
    """

    def __init__(self, structure: dict[str, Any], values: dict[str, Exact], q: Exact) -> None:
        self.parents, self.contact_joint = structure["parents"], structure["contact_joint"]
        self.n = len(q)
        self.origins: list[Exact] = []
        self.rotations: list[Exact] = []
        self.twists: list[Exact] = []  # velocity at the world's origin, angular velocity
        for i in range(self.n):
            self._place(i, values, q[i], structure["prismatic"][i])
        self._bodies = [self._body(i, values) for i in range(self.n)]
        tip = self.contact_joint
        self.contact_point = self.origins[tip] + self.rotations[tip] @ values["contact_lever"]
        self.jacobian = numbers(np.zeros((3, self.n)))
        for i in self._ancestors(tip):
            linear, angular = self.twists[i][:3], self.twists[i][3:]
            self.jacobian[:, i] = linear + np.cross(angular, self.contact_point)
        self.inertia = self._inertia(values["armature"])
        self._factor = cholesky(self.inertia)

    def _place(self, i: int, values: dict[str, Exact], q: Any, prismatic: bool) -> None:
        """Append origin [m], rotation and twist of joint i, at its coordinate q, to their lists."""
        parent = self.parents[i]
        turn, origin = values["rotations"][i], values["offsets"][i]
        if parent >= 0:
            origin = self.origins[parent] + self.rotations[parent] @ origin
            turn = self.rotations[parent] @ turn
        axis = values["axes"][i] / length(values["axes"][i])
        along = turn @ axis
        if prismatic:
            origin = origin + q * along
            self.twists.append(np.concatenate([along, 0 * along]))
        else:
            turn = turn @ rotation(axis, q)
            self.twists.append(np.concatenate([np.cross(origin, along), along]))
        self.origins.append(origin)
        self.rotations.append(turn)

    def _ancestors(self, i: int) -> list[int]:
        """Return the indices of joint i and of the joints that move it, towards the base."""
        found = []
        while i >= 0:
            found.append(i)
            i = self.parents[i]
        return found

    def _body(self, i: int, values: dict[str, Exact]) -> Exact:
        """Return a body's 6 x 6 inertia about the world's origin, linear part first."""
        mass, turn = values["masses"][i], self.rotations[i]
        cross = skew(self.origins[i] + turn @ values["levers"][i])
        moments = turn @ values["moments"][i][UPPER] @ turn.T - mass * cross @ cross
        return np.block([[mass * np.eye(3), -mass * cross], [mass * cross, moments]])

    def _inertia(self, armature: Exact) -> Exact:
        """Return M, shape `(nv, nv)`, from the inertias of subtrees (composite rigid bodies)."""
        subtrees = list(self._bodies)
        for i in reversed(range(self.n)):
            if self.parents[i] >= 0:
                subtrees[self.parents[i]] = subtrees[self.parents[i]] + subtrees[i]
        inertia = np.diag(armature)
        for i in range(self.n):
            momentum = subtrees[i] @ self.twists[i]
            for j in self._ancestors(i):
                inertia[i, j] += momentum @ self.twists[j]
                inertia[j, i] = inertia[i, j]
        return inertia

    def whiten(self, row: Exact) -> Exact:
        r"""Return :math:`L^{-1} r` of a row r of a Jacobian, with :math:`M = L L^T`."""
        found: list[Any] = []
        for line, value in zip(self._factor, row, strict=True):
            found.append((value - mp.fdot(line[: len(found)], found)) / line[len(found)])
        return np.array(found)

    def unwhiten(self, row: Exact) -> Exact:
        r"""Return :math:`L^{-T} r` of a vector r, with :math:`M = L L^T`."""
        left = list(row)
        for i in reversed(range(self.n)):
            left[i] /= self._factor[i][i]
            for j, entry in enumerate(self._factor[i][:i]):
                left[j] -= entry * left[i]
        return np.array(left)

    def joint_impulses(self, jump: Exact, impulse: Exact) -> list[Exact]:
        """Return `Impact.joint_impulses`: changes of momentum less the impulses on each."""
        twists: list[Exact] = []
        for i in range(self.n):
            own = jump[i] * self.twists[i]
            twists.append(own + twists[self.parents[i]] if self.parents[i] >= 0 else own)
        wrenches = [body @ twist for body, twist in zip(self._bodies, twists, strict=True)]
        acting = np.concatenate([impulse, np.cross(self.contact_point, impulse)])
        wrenches[self.contact_joint] = wrenches[self.contact_joint] - acting
        for i in reversed(range(self.n)):
            if self.parents[i] >= 0:
                wrenches[self.parents[i]] = wrenches[self.parents[i]] + wrenches[i]
        found = []
        for wrench, origin, turn in zip(wrenches, self.origins, self.rotations, strict=True):
            moment = wrench[3:] - np.cross(origin, wrench[:3])
            found.append(np.concatenate([turn.T @ wrench[:3], turn.T @ moment]))
        return found


def skew(a: Exact) -> Exact:
    r"""Return the matrix :math:`[a]_\times` of the cross product with a, shape `(3, 3)`."""
    x, y, z = a
    return np.array([[mp.zero, -z, y], [z, mp.zero, -x], [-y, x, mp.zero]])


def rotation(axis: Exact, angle: Any) -> Exact:
    r"""Return :math:`I + \sin\varphi [a]_\times + (1 - \cos\varphi) [a]_\times^2` (Rodrigues)."""
    cross = skew(axis)
    return np.asarray(np.eye(3) + mp.sin(angle) * cross + (1 - mp.cos(angle)) * cross @ cross)


def cholesky(matrix: Exact) -> list[list[Any]]:
    r"""Return the rows of L up to their diagonal, where :math:`L L^T` is the matrix."""
    found: list[list[Any]] = []
    for row in matrix:
        line: list[Any] = []
        for j, above in enumerate(found):
            line.append((row[j] - mp.fdot(line, above[:j])) / above[j])
        rest = row[len(found)] - mp.fdot(line, line)
        if not rest > 0:
            raise InvalidInput(f"pivot {len(found)} of the inertia is {mp.nstr(rest, 3)}")
        found.append([*line, mp.sqrt(rest)])
    return found
