"""A leg at a posture with 50 digits: kinematics, inertia and momenta, by the definitions.

Nothing of Pinocchio's algorithms: placements joint by joint, the inertia as the sum over bodies of
what their momenta about the world's origin are per joint speed. 50 digits forgive that choice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mpmath
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg

DIGITS = 50

mp: Any = mpmath.MPContext()
"""The arithmetic, apart from mpmath's own state."""
mp.dps = DIGITS

Vector = list[Any]
"""Numbers of 50 digits, mostly three of them."""


def numbers(values: Any) -> Any:
    """Return an array as nested lists of numbers with 50 digits, each exactly what it was."""
    if isinstance(values, (list, tuple, np.ndarray)):
        return [numbers(value) for value in values]
    return mp.mpf(float(values))


def mapped(leaf: Callable[[Any], Any], nested: Any) -> Any:
    """Return nested lists with a function applied to every number in them."""
    return [mapped(leaf, one) for one in nested] if isinstance(nested, list) else leaf(nested)


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Return the scalar product."""
    return mp.fdot(a, b)


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus(a: Vector, b: Vector, times: Any = 1) -> Vector:
    """Return a + times b."""
    return [x + times * y for x, y in zip(a, b, strict=True)]


def length(a: Vector) -> Any:
    """Return the Euclidean norm."""
    return mp.sqrt(dot(a, a))


def turned(rows: list[Vector], a: Vector) -> Vector:
    """Return the product of a matrix, given by rows, and a vector."""
    return [dot(row, a) for row in rows]


def transposed(rows: list[Vector]) -> list[Vector]:
    """Return the columns."""
    return [list(column) for column in zip(*rows, strict=True)]


def product(a: list[Vector], b: list[Vector]) -> list[Vector]:
    """Return the matrix product."""
    columns = transposed(b)
    return [[dot(row, column) for column in columns] for row in a]


def described(leg: Leg) -> dict[str, Any]:
    """Return every number of a leg that an impact rests on, as nested lists.

    Raises:
        InvalidInput: a joint that is neither revolute with one angle nor prismatic, or constraints.
    """
    model = leg.model
    if leg.constraints is not None:
        raise InvalidInput(f"{leg.name} is held: the reference knows free legs only")
    axes, slides = [], []
    for joint in list(model.joints)[1:]:
        if joint.nq != 1:
            raise InvalidInput(
                f"joint {joint.shortname()}: the reference knows joints of one angle"
            )
        axis = np.array(_axis(joint)).ravel()
        slides.append(bool(axis[:3].any()))
        axes.append(axis[:3] if slides[-1] else axis[3:])
    placements, inertias = list(model.jointPlacements)[1:], list(model.inertias)[1:]
    return {
        "parents": [int(parent) - 1 for parent in list(model.parents)[1:]],
        "slides": slides,
        "tip_joint": leg.contact_joint - 1,
        "values": {
            "axes": numbers(axes),
            "turns": numbers([place.rotation for place in placements]),
            "offsets": numbers([place.translation for place in placements]),
            "masses": numbers([inertia.mass for inertia in inertias]),
            "levers": numbers([inertia.lever for inertia in inertias]),
            "moments": numbers([inertia.inertia[np.triu_indices(3)] for inertia in inertias]),
            "armature": numbers(model.armature),
            "tip": numbers(leg.contact_lever),
        },
    }


def _axis(joint: Any) -> Array:
    data = joint.createData()
    joint.calc(data, np.zeros(1))
    return np.asarray(data.S)


class ExactPosture:
    """A leg at a configuration, as `Posture`, with 50 digits.

    Args:
        structure: `parents`, `slides` and `tip_joint`, as `described` gives them.
        values: the leg's numbers.
        q: configuration.

    Attributes:
        origins, turns: of the joints in the world.
        contact_point: of the leg.
        jacobian: rows x, y, z.
        inertia: M, as rows.
    """

    def __init__(self, structure: dict[str, Any], values: dict[str, Any], q: Vector) -> None:
        self.parents, self.slides = structure["parents"], structure["slides"]
        self.tip_joint, self.n = structure["tip_joint"], len(q)
        self.origins: list[Vector] = []
        self.turns: list[list[Vector]] = []
        self.twists: list[Vector] = []  # per joint speed: velocity at the world's origin, turning
        for i in range(self.n):
            self._place(i, values, q[i])
        self._own = [self._body(i, values) for i in range(self.n)]
        tip = self.tip_joint
        self.contact_point = plus(self.origins[tip], turned(self.turns[tip], values["tip"]))
        above = self._ancestors(tip)
        columns = [
            plus(self.twists[i][:3], cross(self.twists[i][3:], self.contact_point))
            if i in above
            else [mp.zero] * 3
            for i in range(self.n)
        ]
        self.jacobian = transposed(columns)
        self.inertia = self._inertia(values["armature"])
        self._factor = cholesky_with_condition(self.inertia)

    def _place(self, i: int, values: dict[str, Any], q: Any) -> None:
        parent = self.parents[i]
        turn, origin = values["turns"][i], values["offsets"][i]
        if parent >= 0:
            origin = plus(self.origins[parent], turned(self.turns[parent], origin))
            turn = product(self.turns[parent], turn)
        size = length(values["axes"][i])
        axis = [part / size for part in values["axes"][i]]
        along = turned(turn, axis)
        if self.slides[i]:
            origin = plus(origin, along, q)
            self.twists.append([*along, mp.zero, mp.zero, mp.zero])
        else:
            turn = product(turn, rotation(axis, q))
            self.twists.append([*cross(origin, along), *along])
        self.origins.append(origin)
        self.turns.append(turn)

    def _ancestors(self, i: int) -> set[int]:
        found = set()
        while i >= 0:
            found.add(i)
            i = self.parents[i]
        return found

    def _body(self, i: int, values: dict[str, Any]) -> list[Vector]:
        """Return a body's 6 x 6 inertia about the world's origin, linear first."""
        m = values["masses"][i]
        c = plus(self.origins[i], turned(self.turns[i], values["levers"][i]))
        xx, xy, xz, yy, yz, zz = values["moments"][i]
        local = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        about = product(product(self.turns[i], local), transposed(self.turns[i]))
        square = dot(c, c)
        rows = []
        for k in range(3):  # m (v + w x c)
            unit = [mp.mpf(j == k) for j in range(3)]
            rows.append([m * part for part in [*unit, *cross(c, unit)]])
        for k in range(3):
            unit = [mp.mpf(j == k) for j in range(3)]
            steiner = [about[k][j] + m * (square * unit[j] - c[k] * c[j]) for j in range(3)]
            rows.append([*[m * part for part in cross(unit, c)], *steiner])
        return rows

    def _inertia(self, armature: Vector) -> list[Vector]:
        moved = [[list(row) for row in body] for body in self._own]
        for i in reversed(range(self.n)):
            parent = self.parents[i]
            if parent >= 0:
                moved[parent] = [plus(a, b) for a, b in zip(moved[parent], moved[i], strict=True)]
        rows = [[mp.zero] * self.n for _ in range(self.n)]
        for i in range(self.n):
            momentum = turned(moved[i], self.twists[i])
            for j in self._ancestors(i):
                rows[i][j] = rows[j][i] = dot(momentum, self.twists[j])
            rows[i][i] += armature[i]
        return rows

    def weighed(self, row: Vector) -> Vector:
        """Return L^-1 times a row of a Jacobian, with M = L L^T."""
        found: Vector = []
        for line, value in zip(self._factor, row, strict=True):
            found.append((value - dot(line[: len(found)], found)) / line[len(found)])
        return found

    def unweighed(self, row: Vector) -> Vector:
        """Return L^-T times a vector."""
        found = [mp.zero] * self.n
        columns = transposed([[*line, *[mp.zero] * (self.n - len(line))] for line in self._factor])
        for i in reversed(range(self.n)):
            found[i] = (row[i] - dot(columns[i][i + 1 :], found[i + 1 :])) / columns[i][i]
        return found

    def joint_impulses(self, jump: Vector, impulse: Vector) -> list[Vector]:
        """Return what `Impact.joint_impulses` is: each subtree's momentum less what acts on it.

        Args:
            jump: of the joint velocity.
            impulse: on the foot, at the contact point.
        """
        twists: list[Vector] = []
        for i in range(self.n):
            own = [jump[i] * part for part in self.twists[i]]
            twists.append(plus(twists[self.parents[i]], own) if self.parents[i] >= 0 else own)
        taken = [turned(body, twist) for body, twist in zip(self._own, twists, strict=True)]
        given = [*impulse, *cross(self.contact_point, impulse)]
        taken[self.tip_joint] = plus(taken[self.tip_joint], given, -1)
        for i in reversed(range(self.n)):
            if self.parents[i] >= 0:
                taken[self.parents[i]] = plus(taken[self.parents[i]], taken[i])
        found = []
        for i, wrench in enumerate(taken):
            moment = plus(wrench[3:], cross(self.origins[i], wrench[:3]), -1)
            back = transposed(self.turns[i])
            found.append([*turned(back, wrench[:3]), *turned(back, moment)])
        return found


def rotation(axis: Vector, angle: Any) -> list[Vector]:
    """Return the rotation about a unit vector, by Rodrigues' formula."""
    c, s = mp.cos(angle), mp.sin(angle)
    x, y, z = axis
    skew = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    return [
        [c * (i == j) + s * skew[i][j] + (1 - c) * axis[i] * axis[j] for j in range(3)]
        for i in range(3)
    ]


def cholesky_with_condition(rows: list[Vector]) -> list[Vector]:
    """Return the rows of L up to their diagonal, with L L^T the matrix.

    Raises:
        InvalidInput: it is not positive definite.
    """
    found: list[Vector] = []
    for row in rows:
        line: Vector = []
        for j, above in enumerate(found):
            line.append((row[j] - dot(line, above[:j])) / above[j])
        rest = row[len(found)] - dot(line, line)
        if not rest > 0:
            raise InvalidInput(f"pivot {len(found)} of the inertia is {mp.nstr(rest, 3)}")
        found.append([*line, mp.sqrt(rest)])
    return found
