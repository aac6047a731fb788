r"""Coefficients :math:`\beta(Re, Sp)` of the torque by which the air brakes a ball's spin.

:math:`I \dot\omega = -(\rho A r^2 \beta v + 8 \pi \mu r^3)\, \omega`. The first term is the moment
:math:`C_M = \beta\, Sp` of Nathan's notes; the second is for creeping flow. Nobody measured
beta for soccer balls: golf's stands in, uncertain by a factor of 2.
"""

import math

from kickdyn.aerodynamics.coefficient_model import CoefficientModel, registry


def smits_smith(reynolds: float, spin_parameter: float) -> float:
    """Return 0.010: golf balls in a tunnel (Smits & Smith 1994), as read by Nathan."""
    return 0.010


def tavares(reynolds: float, spin_parameter: float) -> float:
    """Return 0.012: golf balls by radar (Tavares et al. 1999), as read by Nathan."""
    return 0.012


MODELS = registry(
    CoefficientModel(
        "torque", "smits-smith", smits_smith, reynolds=(1e5, 2.5e5), spin=(0.0, math.inf),
        source="Smits & Smith 1994 through Nathan's note on spin decay; golf",
    ),
    CoefficientModel(
        "torque", "tavares", tavares, reynolds=(1e5, 2.5e5), spin=(0.0, math.inf),
        source="Tavares et al. 1999 through Nathan's note on spin decay; golf",
    ),
)  # fmt: skip
"""Every model of the spin's decay by name; `Air(torque=name)` takes one."""
