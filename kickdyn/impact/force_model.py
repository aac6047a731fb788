"""The force of a compliant contact over deflection and rate, and how long it lasts."""

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import OdeSolution, solve_ivp
from scipy.optimize import brentq

from kickdyn.core import validation
from kickdyn.core.validation import Array

SHORTEST_CONTACT = 1e-9
"""Contact time below which the deflection has too few digits beside the leg's size [s]."""

LONGEST_CONTACT = 0.1
"""Longest contact time [s]: a larger number is usually in milliseconds."""

HERTZ, LINEAR = 1.5, 1.0
"""Exponents n of the deflection: of elastic bodies, and of an inflated ball (`Ball.stiffness`)."""


class Dissipation(StrEnum):
    """Models of the energy that a compliant contact loses, by name.

    `walton-braun` returns e^2 of the work of compression along a steeper curve (hysteresis);
    `hunt-crossley` damps in proportion to the spring's force and the rate.
    """

    WALTON_BRAUN = "walton-braun"
    HUNT_CROSSLEY = "hunt-crossley"


@dataclass(frozen=True)
class ForceModel:
    r"""Contact force at a deflection d and its rate, never below 0.

    With D, the largest deflection so far,

    .. math::
        F = k \left(\frac{d - d_0}{e^2}\right)^n (1 + c\, \dot d), \qquad d_0 = (1 - e^2) D,

    which is :math:`k d^n (1 + c\, \dot d)` in compression, while D = d. With c = 0 it is the
    hysteretic spring of Walton & Braun (J. Rheology 30, 1986; there n = 1): restitution returns
    :math:`e^2` of the work of compression whatever the masses, and foot and ball separate at
    :math:`d_0`. With e = 1 it is the damped spring of Hunt & Crossley (J. Applied Mechanics 42,
    1975), whose c follows from a restitution.

    Attributes:
        stiffness: k [N/m^n]; of two elastic bodies (n = 3/2) it is :math:`\frac43 E^* \sqrt{R}`
            (Johnson 1985, Eq. 4.23), of an inflated ball (n = 1) see `Ball.stiffness`.
        damping: c [s/m].
        restitution: e of the hysteresis, 0.01 to 1; with 1 there is no hysteresis.
        exponent: n, 1 to 2.
    """

    stiffness: float
    damping: float = 0.0
    restitution: float = 1.0
    exponent: float = HERTZ

    def __post_init__(self) -> None:
        """Check the values and store them as floats."""
        values = {
            "exponent": validation.number("exponent", self.exponent, at_least=1, at_most=2),
            "stiffness": validation.number("stiffness", self.stiffness, at_least=0, unit="N/m^n"),
            "damping": validation.number("damping", self.damping, at_least=0, unit="s/m"),
            "restitution": _restitution(self.restitution),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def force(self, deflection: float, rate: float, largest: float = 0.0) -> float:
        """Return the normal force [N] for a deflection [m] and its rate [m/s], not checked.

        With a largest deflection so far [m] that is below d, the contact is being compressed.
        """
        spring, _ = self._spring(deflection, largest)
        return max(spring * (1.0 + self.damping * rate), 0.0)

    def returned(self, deflection: float, largest: float = 0.0) -> float:
        """Return the part of the spring's force whose work restitution gives back [N]."""
        spring, _ = self._spring(deflection, largest)
        return spring if deflection < largest else self.restitution**2 * spring

    def stored(self, deflection: float, largest: float = 0.0) -> float:
        """Return the energy that restitution will give back [J]."""
        spring, recovered = self._spring(deflection, largest)
        return spring * recovered / (self.exponent + 1.0)

    def separation(self, largest: float) -> float:
        """Return the deflection at which the force vanishes [m] after a largest one [m]."""
        return (1.0 - self.restitution**2) * largest

    def _spring(self, deflection: float, largest: float) -> tuple[float, float]:
        """Return the spring's force [N] and how far it can recover [m], both 0 or more."""
        share = self.restitution**2
        if deflection < largest:
            recovered = max(deflection - self.separation(largest), 0.0)
            size = recovered / share
        else:
            size = max(deflection, 0.0)
            recovered = share * size
        # its power as a product, which may be inf but raises nothing
        return self.stiffness * (size * size ** (self.exponent - 1.0)), recovered


def matched_damping(restitution: float) -> float:
    r"""Return s = c times the approach speed, for which two masses separate with restitution e.

    Integrating :math:`m w\, dw = -k d^n (1 + c w)\, dd` over compression and restitution gives

    .. math:: (1 + e)\, s = \ln \frac{1 + s}{1 - e s},

    whatever the masses, the stiffness and the exponent (Gonthier et al. 2004). The damping grows as
    1/e, and so does a peak of force at first contact that no ball has.
    """
    e = _restitution(restitution)
    first = 1.5 * (1.0 - e * e) / (1.0 + e**3)  # the limit for e near 1, and always below s
    if 1.0 - e < 1e-5:
        return first

    def excess(w: float) -> float:  # in w = -ln(1 - e s), for s comes very close to 1/e
        s = -math.expm1(-w) / e
        return (1.0 + e) * s - math.log1p(s) - w

    w = brentq(excess, -math.log1p(-0.5 * e * first), (1.0 + e) / e, xtol=1e-15, rtol=1e-14)
    return -math.expm1(-w) / e


def contact_stiffness(
    contact_time: float,
    mass: float,
    approach_speed: float,
    restitution: float = 1.0,
    dissipation: str = Dissipation.WALTON_BRAUN,
) -> float:
    r"""Return the stiffness k of Hertz's spring at which two masses touch for a time T [N/m^1.5].

    .. math:: k = \frac{m}{\sqrt{u}} \left(\frac{\tau(e)}{T}\right)^{5/2},

    with the approach speed u and :math:`\tau(1) = 3.218` (Johnson 1985, Eq. 11.24); of
    `walton-braun` :math:`\tau(e) = (1 + e)/2\; \tau(1)`.

    Args:
        contact_time: duration T of the contact [s], above 0 and at most 0.1.
        mass: reduced mass m = 1 / (1/m1 + 1/m2) of the two bodies [kg], above 0.
        approach_speed: u [m/s], above 0. The contact time of Hertz falls with its fifth root.
        restitution: coefficient e, 0.01 to 1.
        dissipation: `walton-braun` or `hunt-crossley`, see `Dissipation`.

    Raises:
        InvalidInput: a value outside its range, or an unknown dissipation.
    """
    time = validation.number(
        "contact time", contact_time, above=0, at_most=LONGEST_CONTACT, unit="s"
    )
    m = validation.number("mass", mass, above=0, unit="kg")
    speed = validation.number("approach speed", approach_speed, above=0, unit="m/s")
    kind = validation.choice("dissipation", dissipation, Dissipation)
    unit = contact_time_of(make_force_model(1.0, HERTZ, 1.0, restitution, kind), 1.0, 1.0)
    with np.errstate(over="ignore"):
        stiffness = m / math.sqrt(speed) * float(np.float64(unit / time) ** 2.5)
    return validation.number("stiffness for that contact time", stiffness, above=0, unit="N/m^1.5")


def make_force_model(
    stiffness: float,
    exponent: float,
    approach_speed: float,
    restitution: float,
    dissipation: Dissipation,
) -> ForceModel:
    """Return the force model of a stiffness that has a restitution at an approach speed [m/s]."""
    if dissipation is Dissipation.WALTON_BRAUN:
        return ForceModel(stiffness, 0.0, restitution, exponent)
    return ForceModel(stiffness, matched_damping(restitution) / approach_speed, 1.0, exponent)


def contact_time_of(model: ForceModel, mass: float, approach_speed: float) -> float:
    r"""Return for how long two bodies of a reduced mass m [kg] touch [s].

    .. math:: T = \tau(e, c\, u) \left(\frac{m}{k}\right)^{1/(n+1)} u^{-(n-1)/(n+1)},

    with the approach speed u [m/s].
    """
    power = 1.0 / (model.exponent + 1.0)
    scale = (mass / model.stiffness) ** power
    scale *= approach_speed ** (-(model.exponent - 1.0) * power)
    damping = model.damping * approach_speed
    return float(scale * _unit_contact_time(model.restitution, damping, model.exponent))


@lru_cache(maxsize=256)
def _unit_contact_time(restitution: float, damping: float, exponent: float) -> float:
    r"""Return the contact time for unit mass, stiffness and speed; for e = 1 pi or 3.218.

    Compression of a spring without damping lasts

    .. math:: D \int_0^1 \frac{dx}{\sqrt{1 - x^{n+1}}}
        = D\, \frac{\sqrt\pi}{n + 1}\, \frac{\Gamma(p)}{\Gamma(p + 1/2)},
        \qquad D = \left(\frac{n + 1}{2}\right)^p, \quad p = \frac{1}{n + 1},

    and restitution along the curve of Walton & Braun e times as long. With damping the motion is
    integrated.
    """
    if damping == 0.0:
        power = 1.0 / (exponent + 1.0)
        largest = (0.5 * (exponent + 1.0)) ** power
        beta = math.sqrt(math.pi) * power * math.gamma(power) / math.gamma(power + 0.5)
        return float((1.0 + restitution) * largest * beta)
    contact = ForceModel(1.0, damping, exponent=exponent)

    def rates(_: float, y: Array) -> list[float]:
        deflection, rate = y
        return [rate, -contact.force(deflection, rate)]

    start = [0.0, 1.0]
    apart = integrate_until(lambda _, y: y[0], rates, start, 1e3, 1e-12, 1e-13, step=0.1)
    return float(apart.t[-1])


def _restitution(value: object) -> float:
    """Return a restitution that a contact of finite duration can have, or raise `InvalidInput`."""
    return validation.number("restitution", value, at_least=0.01, at_most=1)


def integrate_until(
    event: Any,
    rates: Any,
    start: ArrayLike,
    limit: float,
    rtol: float,
    atol: Any,
    step: float,
    begin: float = 0.0,
) -> Any:
    """Run scipy's DOP853 until an event of (t, y) falls to 0; return what `solve_ivp` returns.

    States at an event are an interpolant's, which is far less exact than the step. So the last step
    is taken anew, to just beyond the event.
    """

    def falling(t: float, y: Array) -> float:
        return float(event(t, y))

    falling.terminal, falling.direction = True, -1  # type: ignore[attr-defined]
    run = partial(solve_ivp, rates, method="DOP853", rtol=rtol, atol=atol, max_step=step,
                  events=falling, dense_output=True)  # fmt: skip
    solution = run((begin, limit), np.asarray(start, np.float64))
    if solution.status != 1:
        return solution
    began, ended = solution.t[-2:]
    if ended <= began:
        return solution
    beyond = ended + 0.01 * (ended - began)
    last = run((began, beyond), solution.y[:, -2], first_step=beyond - began)
    times = np.concatenate([solution.t[:-1], last.t[1:]])
    solution.sol = OdeSolution(times, [*solution.sol.interpolants[:-1], *last.sol.interpolants])
    solution.t, solution.y = times, np.hstack([solution.y[:, :-1], last.y[:, 1:]])
    return solution
