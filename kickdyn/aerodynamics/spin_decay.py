"""How the air brakes a ball's spin: I omega' = -(rho A R^2 beta v + 8 pi mu R^3) omega.

The first part is the moment C_M = beta Sp of Nathan's notes; the second is that of creeping flow.
Nobody measured beta for soccer balls: golf's stands in, uncertain by a factor of 2.
"""

from __future__ import annotations

import math

from kickdyn.aerodynamics.coefficient_model import CoefficientModel


def smits_smith(reynolds: float, spin_parameter: float) -> float:
    """Return 0.010: golf balls in a tunnel (Smits & Smith 1994), as read by Nathan."""
    return 0.010


def tavares(reynolds: float, spin_parameter: float) -> float:
    """Return 0.012: golf balls by radar (Tavares et al. 1999), as read by Nathan."""
    return 0.012


MODELS = {
    model.name: model
    for model in (
        CoefficientModel(
            "torque",
            "smits-smith",
            smits_smith,
            (1e5, 2.5e5),
            (0.0, math.inf),
            "Smits & Smith 1994 through Nathan's note on spin decay; golf",
        ),
        CoefficientModel(
            "torque",
            "tavares",
            tavares,
            (1e5, 2.5e5),
            (0.0, math.inf),
            "Tavares et al. 1999 through Nathan's note on spin decay; golf",
        ),
    )
}
"""Every spin torque model by name."""
