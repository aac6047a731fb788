"""The pelvis of OpenSim as the floating base of a person's leg.

OpenSim's axes are x forward, y up and z to the right. The pelvis turns about z (tilt), then x
(list), then y (rotation) of its own axes; its origin is between the anterior superior iliac spines.
A floating base is at the hip instead. The place of the hip in the pelvis is that of Delp et al.
1990 (IEEE Trans Biomed Eng 37:757), scaled by the length of the leg.
"""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg

TRANSLATIONS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
"""Coordinates of the origin of the pelvis [m]."""

ROTATIONS = {"pelvis_tilt": "Z", "pelvis_list": "X", "pelvis_rotation": "Y"}
"""Coordinates of the turn of the pelvis and their axes, in their order [rad]."""

PELVIS = (*TRANSLATIONS, *ROTATIONS)
"""Names of all coordinates of the pelvis."""

HIP, LEG_LENGTH = (-0.0707, -0.0661, 0.0835), 0.396 + 0.43
"""Right hip from the origin of the pelvis, and distance from hip to ankle, of the model [m]."""

Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from OpenSim's axes to x forward, y left, z up."""


def base_configurations(leg: Leg, coordinates: Mapping[str, Array]) -> Array:
    """Return configurations of the floating base, shape `(n, 7)`, NaN where one is not known."""
    from scipy.spatial.transform import Rotation  # takes 0.1 s

    model = leg.workspace.model
    length = sum(np.linalg.norm(pose.translation) for pose in list(model.jointPlacements)[3:])
    right = np.sign(model.inertias[1].lever[1])  # the middle of the pelvis is on the left
    hip = Z_UP @ (HIP * np.array([1.0, 1.0, right])) * length / LEG_LENGTH
    origin = np.column_stack([coordinates[name] for name in TRANSLATIONS]) @ Z_UP.T
    angles = np.column_stack([coordinates[name] for name in ROTATIONS])
    complete = np.isfinite(np.hstack([origin, angles])).all(axis=1)
    q = np.full((len(complete), 7), np.nan)
    rotations = Rotation.from_euler("".join(ROTATIONS.values()), angles[complete]).as_matrix()
    for k, turn in zip(np.flatnonzero(complete), Z_UP @ rotations @ Z_UP.T, strict=True):
        q[k] = pin.SE3ToXYZQUAT(pin.SE3(turn, origin[k] + turn @ hip))
    return q
