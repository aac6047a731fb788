"""The check that a leg is held by its joints alone."""

from __future__ import annotations

import numpy as np

from kickdyn.errors import InvalidInput
from kickdyn.posture import Posture

FREE = 1e-9
"""Share of an impulse that may come from elsewhere, for rounding."""


def check_free(posture: Posture, what: str) -> None:
    """Refuse a leg that answers an impulse on its foot with more than its own inertia.

    Args:
        posture: of the leg.
        what: for the message: what is derived for legs that nothing else holds.

    Raises:
        InvalidInput: supports or loops take part in the impact.
    """
    for row in posture.jacobian:
        response = posture.solve(row)
        elsewhere = np.abs(posture.inertia @ response - row)
        scale = np.abs(posture.inertia) @ np.abs(response) + np.abs(row).max()
        if (elsewhere > FREE * scale).any():
            raise InvalidInput(
                f"{posture.leg.name} is held by more than its joints: {what} for legs without "
                "supports and loops only"
            )
