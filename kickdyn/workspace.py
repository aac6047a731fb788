"""Scratch space for Pinocchio's calls."""

from __future__ import annotations

import threading
from typing import Any

import pinocchio as pin


class Workspace(threading.local):
    """Scratch space per thread: two threads in one `pin.Data` would mix their kinematics.

    Attributes:
        model: the leg's model, without gravity; read only.
        data: `pin.Data` of that model.
        external: one zero `pin.Force` per joint.
        placements: views of `data.oMi`, the universe included.
        forces: views of linear and angular part of `data.f`, the universe left out.
    """

    def __init__(self, model: Any) -> None:
        self.model = model
        self.data = model.createData()
        self.external = pin.StdVec_Force()
        self.external.extend([pin.Force.Zero() for _ in range(model.njoints)])
        self.placements = list(self.data.oMi)  # taking one out of oMi costs a copy of what it is
        self.forces = [force.vector for force in list(self.data.f)[1:]]
