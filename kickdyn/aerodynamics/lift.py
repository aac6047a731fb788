"""Lift (Magnus) coefficients C_L(Re, Sp) of soccer balls.

`F_L = 1/2 rho A C_L v^2`, along omega x v, with v relative to the air (Eq. 13). Sp is
`r |omega_perp| / v`, with the spin component perpendicular to v only.
"""

from __future__ import annotations

import math

from kickdyn.aerodynamics.drag import BALLS, SoccerBall
from kickdyn.aerodynamics.model import CoefficientModel

_GATE = BALLS["brazuca"]
_LEAST_DRAG = 0.1748588996
"""Of `_GATE` without spin, at 17.75 m/s."""


def saturating(reynolds: float, spin_parameter: float) -> float:
    """Return 0.47 Sp / (0.135 + Sp), faded out below the drag crisis.

    A fit to Kiratidis & Leinweber 2018 (within 0.04 for 20-32 m/s and Sp 0.05-0.30, but for the
    Jabulani) that stays bounded beyond their data; expect +-20 %. The fade follows the C_D of a
    ball without spin: lift and drag have their crisis together (Goff et al. 2017, Eur. J. Phys.
    38).
    """
    return _gate(_GATE, reynolds) * 0.47 * spin_parameter / (0.135 + spin_parameter)


def _gate(ball: SoccerBall, reynolds: float) -> float:
    drop = (ball.a - ball.not_spinning(reynolds)) / (ball.a - _LEAST_DRAG)
    return min(max(drop, 0.0), 1.0)


def wang(reynolds: float, spin_parameter: float) -> float:
    """Return 1/2 Sp^0.4 (Wang 2015, on data of Goff & Carre 2009), Sp about 0.1 to 0.4."""
    return 0.5 * math.pow(spin_parameter, 0.4)


MODELS = {
    model.name: model
    for model in (
        CoefficientModel(
            "saturating",
            saturating,
            (0.0, 5.1e5),
            (0.0, 1.0),
            "fit to Kiratidis & Leinweber 2018, Eur. J. Phys. 39:034001, Eqs. 8-9, "
            "gated as in Goff et al. 2017, Eur. J. Phys. 38",
        ),
        CoefficientModel(
            "wang", wang, (2e5, 5e5), (0.1, 0.4), "Wang 2015, on Goff & Carre 2009, AJP 77:1020"
        ),
    )
}
"""Every lift model by name."""
