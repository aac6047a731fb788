"""Joints that move with another, as a gear or a belt between the two makes them.

A gear acts on each of its two joints along the joint's axis, between parent and child; forces on
other bodies, as of the bearings of a belt, are left out. It is one more row of the constraints
A v = 0, and its work is 0.
"""

from collections.abc import Container, Sequence
from typing import Any, NamedTuple

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput

MIMIC_TOLERANCE = 1e-9
"""By how much a mimic joint may be off the value that its driver gives it [rad; m]."""


class Mimic(NamedTuple):
    r"""A joint that moves with another, its driver: :math:`q = a\,q_\mathrm{driver} + b`.

    Attributes:
        joint, driver: names of joints of one degree of freedom with a range.
        multiplier: a [rad or m of the joint, per rad or m of the driver].
        offset: b [rad or m].
    """

    joint: str
    driver: str
    multiplier: float
    offset: float


class Gears:
    r"""The mimic joints of a model.

    Attributes:
        mimics: as given; no driver is a mimic joint itself.
        rows: one row :math:`\dot q - a\,\dot q_\mathrm{driver} = 0` each, shape `(n, nv)`.
    """

    def __init__(self, model: Any, mimics: Sequence[Mimic]) -> None:
        self.mimics = tuple(mimics)
        names = list(model.names)
        pairs = [(names.index(m.joint), names.index(m.driver)) for m in self.mimics]
        self._places = [model.idx_qs[joint] for joint, _ in pairs]
        self._drivers = [model.idx_qs[driver] for _, driver in pairs]
        self._multipliers = np.array([m.multiplier for m in self.mimics])
        self._offsets = np.array([m.offset for m in self.mimics])
        self.rows = np.zeros((len(pairs), model.nv))
        for row, (joint, driver), mimic in zip(self.rows, pairs, self.mimics, strict=True):
            row[model.idx_vs[joint]] = 1.0
            row[model.idx_vs[driver]] -= mimic.multiplier
        self.rows.setflags(write=False)

    def follow(self, q: Array) -> Array:
        """Return q with the mimic joints where their drivers put them, shape `(nq,)`."""
        followed = np.array(q)
        followed[self._places] = self._multipliers * q[self._drivers] + self._offsets
        return followed

    def check(self, q: Array, named: Container[str] | None = None) -> Array:
        """Return `follow(q)`; raise `InvalidInput` where a mimic joint is elsewhere in q.

        With `named`, joints that are not among these may be elsewhere.
        """
        followed = self.follow(q)
        for mimic, place in zip(self.mimics, self._places, strict=True):
            slack = MIMIC_TOLERANCE * max(1.0, abs(followed[place]))
            checked = named is None or mimic.joint in named
            if checked and not abs(q[place] - followed[place]) <= slack:
                raise InvalidInput(
                    f"joint {mimic.joint} is {q[place]:g}: it mimics {mimic.driver}, which puts it "
                    f"at {followed[place]:g} (leave mimic joints out of q)"
                )
        return followed
