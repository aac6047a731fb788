"""The memory that Pinocchio computes in, one for each thread."""

import threading
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import as_strided

from kickdyn.core.validation import Array


class Workspace(threading.local):
    """Scratch space per thread: two threads in one `pin.Data` would mix their kinematics.

    Attributes:
        model: the leg's model, for an impact without gravity; read only.
        data: `pin.Data` of that model.
        external: one `pin.Force` per joint, for `pin.rnea`; a caller sets all of them.
        external_wrenches: view of `external`, shape `(njoints, 6)`, the universe included.
        placements, velocities, accelerations: views of `data.oMi`, `data.v` and `data.a`, the
            universe included.
        forces: view of `data.f`, linear then angular, shape `(njoints, 6)`, without the universe.
        zero_velocity: of all joints, shape `(nv,)`.
    """

    def __init__(self, model: Any) -> None:
        self.model = model = model.copy()
        model.gravity = pin.Motion.Zero()  # an impact is too short for gravity
        self.data = pin.Data(model)  # createData makes two for a while, n^3 numbers each
        self.external = pin.StdVec_Force()
        self.external.extend([pin.Force.Zero() for _ in range(model.njoints)])
        self.external_wrenches = _stacked(self.external)
        self.placements = list(self.data.oMi)  # each access to oMi would copy its entry
        self.velocities, self.accelerations = list(self.data.v), list(self.data.a)
        self.forces = _stacked(self.data.f)[1:]
        self.zero_velocity: Array = np.zeros(model.nv)


def _stacked(forces: Any) -> Array:
    """Return a view of a vector of `pin.Force`, one row each: one copy then takes all of them."""
    rows = [force.vector for force in list(forces)]
    address = rows[0].__array_interface__["data"][0]
    step = 6 * rows[0].itemsize
    for k, row in enumerate(rows):
        if row.__array_interface__["data"][0] != address + k * step:
            raise RuntimeError("Pinocchio no longer keeps forces side by side")
    return as_strided(rows[0], shape=(len(rows), 6), strides=(step, rows[0].itemsize))
