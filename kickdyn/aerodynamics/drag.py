r"""Drag coefficients :math:`C_D(Re, Sp)` of spheres and soccer balls.

:math:`F_D = \frac{1}{2} \rho A C_D v^2`, against the velocity relative to the air (Eq. 12).

A new model is a function `(reynolds, spin_parameter) -> float` with floats and `math` only, and an
entry in `MODELS` at the end of this file. Tests require its formula in
`tests/extremes/exact_coefficients.py`; the table of `docs/explanation/theory.md` follows.
"""

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass
from functools import cache

from kickdyn.aerodynamics.coefficient_model import (
    Coefficient,
    CoefficientModel,
    ConstantCoefficient,
    registry,
    smoothstep,
)

REYNOLDS_PER_SPEED = 333_793 / 22.97
"""Re per m/s in the wind tunnel of Kiratidis & Leinweber [s/m]: puts their fit in terms of Re."""

SPIN_DRAG = 0.514
"""Slope of C_D with the spin parameter (Kiratidis & Leinweber 2018, Teamgeist tunnel line)."""

SPIN_DRAG_LIMIT = 0.4
"""Spin parameter around which the growth of C_D levels off, at 0.2056 more than without spin; the
data behind `SPIN_DRAG` end near 0.3."""

_PER_LIMIT = 1.0 / SPIN_DRAG_LIMIT
_ENDLESS = 1e6  # limits beyond which the eighth power would overflow


def stokes(reynolds: float, spin_parameter: float = 0.0) -> float:
    r"""Return :math:`24/Re`, creeping flow (Stokes 1851, Eq. 14): :math:`F_D = 6 \pi \mu r v`."""
    return 24.0 / reynolds


def brown_lawler(reynolds: float, spin_parameter: float = 0.0) -> float:
    r"""Return C_D of a smooth sphere before its drag crisis, Re < 2e5.

    .. math:: C_D = \frac{24}{Re} (1 + 0.150 Re^{0.681}) + \frac{0.407}{1 + 8710 / Re}

    Brown & Lawler 2003, J. Environ. Eng. 129:222.
    """
    correction = 1.0 + 0.150 * math.exp(0.681 * math.log(reynolds))
    return 24.0 / reynolds * correction + 0.407 / (1.0 + 8710.0 / reynolds)


def sphere(reynolds: float, spin_parameter: float = 0.0) -> float:
    """Return C_D of a smooth sphere, exactly Stokes' for Re < 1 as in Eq. (14).

    The correction of Brown & Lawler fades in between Re 1 and 10 (C3). Near Re = 2 this is up to
    17 % below their correlation; `brown_lawler` alone has no such join.
    """
    weight = smoothstep(reynolds, 1.0, 10.0)
    # not below 1, where it does not count, and both would overflow
    rising = brown_lawler(max(reynolds, 1.0))
    return (1.0 - weight) * stokes(reynolds) + weight * rising


FAST = 7e4
"""Reynolds number above which a soccer ball's own drag holds alone."""


@dataclass(frozen=True)
class SoccerBall:
    """Constants of Kiratidis & Leinweber 2018 (Eur. J. Phys. 39:034001), Eq. 5 and Table 1.

    `a` is the plateau below the drag crisis, `v_c` and `v_s` its middle and width [m/s]. Above it
    C_D settles on a line from `b_min` at `v_min` to `b_max` at `v_max` [m/s], and stays there.
    """

    a: float
    v_c: float
    v_s: float
    b_min: float
    b_max: float
    v_min: float
    v_max: float = 35.0


@cache
def without_spin(ball: SoccerBall) -> Callable[[float], float]:
    r"""Return C_D(Re) of a ball that does not spin, for Re above 7e4.

    .. math:: C_D = \frac{a - b_{min}}{1 + e^{(v - v_c)/v_s}} + b_{min}
        + \frac{b_{max} - b_{min}}{v_{max} - v_{min}} \frac{v - v_{min}}{1 + e^{-(v - v_{min})/v_s}}

    Beyond `v_max`, where the data end, the line is bent level within about 1 m/s (C4).
    """
    a, v_c, v_s, b_min, b_max, v_min, v_max = (float(parameter) for parameter in astuple(ball))
    slope = (b_max - b_min) / (v_max - v_min)
    speed, steep = 1.0 / REYNOLDS_PER_SPEED, 1.0 / v_s  # divisions take longest

    def coefficient(reynolds: float) -> float:
        v = speed * reynolds
        over = min(max(v - v_max, 0.0), 20.0)
        series = over * (1.0 + over * (1 / 2 + over * (1 / 3 + over * (1 / 4))))
        v = min(v, v_max) + (1.0 - math.exp(-series))  # over less its fifth power and so on
        beyond = v - v_min
        crisis = (a - b_min) / (1.0 + math.exp(steep * (v - v_c)))
        return crisis + b_min + slope * beyond / (1.0 + math.exp(-steep * beyond))

    return coefficient


@cache
def spinning(ball: SoccerBall) -> Coefficient:
    r"""Return C_D(Re, Sp) of a ball for Re above 7e4.

    Spin adds :math:`0.514\, Sp\, (1 + (Sp/0.4)^8)^{-1/8}`: linear in Sp within 0.05 % up to 0.2 and
    1.2 % up to 0.3, where the data end, then level, without a kink that would cost integrators
    their order.
    """
    level = without_spin(ball)

    def coefficient(reynolds: float, spin_parameter: float) -> float:
        ratio = min(_PER_LIMIT * spin_parameter, _ENDLESS)
        square = ratio * ratio
        eighth = math.sqrt(math.sqrt(math.sqrt(1.0 + square * square * square * square)))
        return level(reynolds) + SPIN_DRAG * SPIN_DRAG_LIMIT * ratio / eighth

    return coefficient


def soccer(ball: SoccerBall) -> Coefficient:
    """Return C_D(Re, Sp) of a ball: the sphere's at low Re, joined (C3) between Re 2e4 and 7e4."""
    fast = spinning(ball)

    def coefficient(reynolds: float, spin_parameter: float) -> float:
        if reynolds >= FAST:
            return fast(reynolds, spin_parameter)
        weight = smoothstep(reynolds, 2e4, FAST)
        return sphere(reynolds) * (1 - weight) + fast(reynolds, spin_parameter) * weight

    return coefficient


BALLS = {
    "brazuca": SoccerBall(0.4740, 12.92, 1.000, 0.1657, 0.2112, 14.61),
    "tango12": SoccerBall(0.5452, 12.86, 1.304, 0.1657, 0.1953, 16.22),
    "teamgeist": SoccerBall(0.4927, 12.58, 1.071, 0.1440, 0.1540, 23.17),
    "jabulani": SoccerBall(0.4839, 18.69, 1.377, 0.1413, 0.1780, 23.29),
}


def goff_carre(reynolds: float, spin_parameter: float = 0.0) -> float:
    r"""Return C_D of Goff & Carre 2010, Eur. J. Phys. 31:775 (Teamgeist).

    :math:`0.155 + 0.346/(1 + e^{(v - 12.19)/1.309})` without spin; :math:`0.4127\, Sp^{0.3056}`
    above 12.19 m/s and Sp 0.05. The paper switches there; here both are joined (C3) within 10 %
    and 20 % of that.
    """
    v = reynolds / REYNOLDS_PER_SPEED
    level = 0.155 + 0.346 / (1.0 + math.exp(min((v - 12.19) / 1.309, 700.0)))
    weight = smoothstep(v, 0.9 * 12.19, 1.1 * 12.19) * smoothstep(spin_parameter, 0.04, 0.06)
    if weight == 0.0:
        return level
    return level + weight * (0.4127 * math.pow(spin_parameter, 0.3056) - level)


BEYOND_CRISIS = 0.2
"""C_D of a soccer ball beyond its drag crisis (Goff & Carre 2009, Am. J. Phys. 77:1020)."""


def supercritical(reynolds: float, spin_parameter: float = 0.0) -> float:
    r"""Return 0.2, the C_D of a soccer ball beyond its drag crisis, above Re 7e4 (4.8 m/s).

    Goff & Carre 2009 found it from the range of trajectories without spin, Am. J. Phys. 77:1020.
    Its range is that of flights in two minutes of a match (docs/explanation/verification.md): 8 to
    27 m/s, and spin parameters up to 0.3, which are fitted, not measured. In wind tunnels, new
    balls that do not spin have their crisis between 10 and 19 m/s. Below Re 7e4 it is joined
    (C3) to the sphere's, which it reaches at Re 2e4.
    """
    if reynolds >= FAST:
        return BEYOND_CRISIS
    weight = smoothstep(reynolds, 2e4, FAST)
    return sphere(reynolds) * (1.0 - weight) + BEYOND_CRISIS * weight


def constant(value: float) -> ConstantCoefficient:
    """Return a model that is `value` everywhere, for comparison with textbooks."""
    return ConstantCoefficient(value)


MODELS = registry(
    CoefficientModel(
        "drag", "stokes", stokes, reynolds=(0.0, 1.0), spin=(0.0, math.inf),
        source="Stokes 1851; Eq. (14)",
    ),
    CoefficientModel(
        "drag", "brown-lawler", brown_lawler, reynolds=(0.0, 2e5), spin=(0.0, 0.0),
        source="Brown & Lawler 2003, J. Environ. Eng. 129:222",
    ),
    CoefficientModel(
        "drag", "sphere", sphere, reynolds=(0.0, 2e5), spin=(0.0, 0.0),
        source="Eq. (14) below Re 1, then Brown & Lawler 2003",
    ),
    *(
        CoefficientModel(
            "drag", name, soccer(ball),
            reynolds=(0.0, REYNOLDS_PER_SPEED * ball.v_max), spin=(0.0, SPIN_DRAG_LIMIT),
            source="Kiratidis & Leinweber 2018, Eur. J. Phys. 39:034001, Eq. 5, Table 1; "
            "sphere below Re 2e4",
            branch_free=(FAST, spinning(ball)),
        )
        for name, ball in BALLS.items()
    ),
    CoefficientModel(
        "drag", "supercritical", supercritical,
        reynolds=(REYNOLDS_PER_SPEED * 8.0, REYNOLDS_PER_SPEED * 27.0), spin=(0.0, 0.3),
        source="Goff & Carre 2009 (value), flights of a match (range); Am. J. Phys. 77:1020, "
        "data/match_ball.csv; sphere below Re 2e4",
        branch_free=(FAST, constant(BEYOND_CRISIS)),
    ),
    CoefficientModel(
        "drag", "goff-carre", goff_carre, reynolds=(7e4, 5e5), spin=(0.0, 0.4),
        source="Goff & Carre 2010, Eur. J. Phys. 31:775",
    ),
)  # fmt: skip
"""Every drag model by name; `Air(drag=name)` takes one."""
