r"""Lift (Magnus) coefficients :math:`C_L(Re, Sp)` of soccer balls.

:math:`F_L = \frac{1}{2} \rho A C_L v^2`, along :math:`\omega \times v`, with v relative to the air
(Eq. 13). A new model is one function and one entry in `MODELS` below, as for drag.
"""

import math

from kickdyn.aerodynamics.coefficient_model import CoefficientModel, registry
from kickdyn.aerodynamics.drag import BALLS, without_spin

_BALL = BALLS["brazuca"]
_PLATEAU = _BALL.a
LEAST_DRAG = 0.1748588996
"""Of the Brazuca without spin, at 17.75 m/s."""

_PER_DROP = 1.0 / (_PLATEAU - LEAST_DRAG)

_without_spin = without_spin(_BALL)


def saturating(reynolds: float, spin_parameter: float) -> float:
    r"""Return :math:`0.47\, Sp / (0.135 + Sp)`, faded out below the drag crisis.

    A fit to the formula of Kiratidis & Leinweber 2018 that stays bounded beyond it: within 20 % of
    it for the Brazuca, Tango 12 and Teamgeist from Re 2.2e5 to 5.1e5 and Sp 0.05 to 0.30, and
    within 0.04 for 20-32 m/s. Not for the Jabulani below 22 m/s, whose crisis comes later. The
    formula was fitted to the Teamgeist, at Sp 0.06 to 0.31; for the other balls its authors give it
    as an estimate.

    Outside it is extrapolated: with faster spin it levels off at 0.47; below Re 2.2e5 it fades with
    the C_D of a Brazuca without spin, because trajectories show lift and drag in crisis together
    (Goff et al. 2017, Eur. J. Phys. 38). No coefficients measured there are behind it, and the
    models here differ by a factor: at Re 1.46e5 and Sp 0.3 it has 0.018, `nathan` (baseballs) 0.26.
    """
    drop = (_PLATEAU - _without_spin(reynolds)) * _PER_DROP
    return drop * 0.47 * spin_parameter / (0.135 + spin_parameter)


def wang(reynolds: float, spin_parameter: float) -> float:
    r"""Return :math:`Sp^{0.4}/2` (Wang 2015, on data of Goff & Carre 2009), Sp 0.1 to 0.4."""
    return 0.5 * math.pow(spin_parameter, 0.4)


def nathan(reynolds: float, spin_parameter: float) -> float:
    r"""Return :math:`1.12\, Sp/(0.583 + 2.333\, Sp)`, Nathan's calculator for baseballs."""
    return 1.12 * spin_parameter / (0.583 + 2.333 * spin_parameter)


MODELS = registry(
    CoefficientModel(
        "lift", "saturating", saturating, reynolds=(2.2e5, 5.1e5), spin=(0.0, 0.3),
        source="fit to Kiratidis & Leinweber 2018, Eur. J. Phys. 39:034001, Eqs. 8-9; below its "
        "range it fades with the drag crisis, as in Goff et al. 2017, Eur. J. Phys. 38",
    ),
    CoefficientModel(
        "lift", "wang", wang, reynolds=(2e5, 5e5), spin=(0.1, 0.4),
        source="Wang 2015, on Goff & Carre 2009, AJP 77:1020",
    ),
    CoefficientModel(
        "lift", "nathan", nathan, reynolds=(1e5, 3e5), spin=(0.0, 1.0),
        source="Nathan's trajectory calculator (baseball), as in pybaseball's parameters.py",
    ),
)  # fmt: skip
"""Every lift model by name; `Air(lift=name)` takes one."""
