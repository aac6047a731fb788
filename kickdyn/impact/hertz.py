"""A compliant contact: Hertz's spring with the damping of Hunt and Crossley."""

import math
from dataclasses import dataclass
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


@dataclass(frozen=True)
class HertzContact:
    r"""Contact force :math:`k\, d^{3/2} (1 + c\, \dot d)` at the deflection d, never below 0.

    From Hunt & Crossley 1975. `matched_damping` gives the damping for a restitution, exactly for
    two masses on which no other force acts.

    Attributes:
        stiffness: k [N/m^1.5]; of two elastic bodies, 4/3 E* sqrt(R) (Johnson 1985, Eq. 4.23).
        damping: c [s/m].
    """

    stiffness: float
    damping: float

    def __post_init__(self) -> None:
        """Check the values and store them as floats."""
        stiffness = validation.number("stiffness", self.stiffness, at_least=0, unit="N/m^1.5")
        object.__setattr__(self, "stiffness", stiffness)
        damping = validation.number("damping", self.damping, at_least=0, unit="s/m")
        object.__setattr__(self, "damping", damping)

    def force(self, deflection: float, rate: float) -> float:
        """Return the normal force [N] at a deflection [m] that grows at a rate [m/s], unchecked."""
        if deflection <= 0.0:
            return 0.0
        return max(self.spring(deflection) * (1.0 + self.damping * rate), 0.0)

    def spring(self, deflection: float) -> float:
        """Return the elastic part of the force [N], 0 or more, at an unchecked deflection [m]."""
        size = max(deflection, 0.0)  # its power as a product, which may be inf but raises nothing
        return float(self.stiffness * size * math.sqrt(size))


def matched_damping(restitution: float) -> float:
    r"""Return s = c times the approach speed, for which two masses separate with restitution e.

    Integrating :math:`m w\, dw = -k d^{3/2} (1 + c w)\, dd` over compression and restitution gives

    .. math:: (1 + e)\, s = \ln \frac{1 + s}{1 - e s},

    whatever the masses, the stiffness and the exponent (Gonthier et al. 2004).

    Args:
        restitution: coefficient e, 0.01 to 1. The damping grows as 1/e, and so does a peak of force
            at first contact that no ball has: the law is meant for e well above 0.01.

    Raises:
        InvalidInput: a value outside its range.
    """
    e = validation.number("restitution", restitution, at_least=0.01, at_most=1)
    first = 1.5 * (1.0 - e * e) / (1.0 + e**3)  # the limit for e near 1, and always below s
    if 1.0 - e < 1e-5:
        return first

    def excess(w: float) -> float:  # in w = -ln(1 - e s), for s comes very close to 1/e
        """Return by how much energy is not balanced, 0 at the root."""
        s = -math.expm1(-w) / e
        return (1.0 + e) * s - math.log1p(s) - w

    w = brentq(excess, -math.log1p(-0.5 * e * first), (1.0 + e) / e, xtol=1e-15, rtol=1e-14)
    return -math.expm1(-w) / e


def contact_stiffness(
    contact_time: float, mass: float, approach_speed: float, restitution: float = 1.0
) -> float:
    """Return the stiffness at which two masses stay in contact for a given time [N/m^1.5].

    Args:
        contact_time: desired [s], above 0.
        mass: 1 / (1/m1 + 1/m2) [kg], above 0.
        approach_speed: [m/s], above 0. Hertz's contact time falls with its fifth root.
        restitution: coefficient e, 0.01 to 1.

    Raises:
        InvalidInput: a value outside its range.
    """
    time = validation.number("contact time", contact_time, above=0, unit="s")
    m = validation.number("mass", mass, above=0, unit="kg")
    speed = validation.number("approach speed", approach_speed, above=0, unit="m/s")
    e = validation.number("restitution", restitution, at_least=0.01, at_most=1)
    with np.errstate(over="ignore"):
        stiffness = m / math.sqrt(speed) * float(np.float64(_unit_contact_time(e) / time) ** 2.5)
    return validation.number("stiffness for that contact time", stiffness, above=0, unit="N/m^1.5")


def expected_contact_time(
    stiffness: float, mass: float, approach_speed: float, restitution: float = 1.0
) -> float:
    """Return for how long two masses stay in contact [s]: the inverse of `contact_stiffness`."""
    scale = (mass / stiffness) ** 0.4 * approach_speed**-0.2
    return float(scale * _unit_contact_time(restitution))


@lru_cache(maxsize=256)
def _unit_contact_time(restitution: float) -> float:
    """Return the contact time for unit mass, stiffness and speed; 3.218 for e = 1."""
    contact = HertzContact(1.0, matched_damping(restitution))

    def rates(_: float, y: Array) -> list[float]:
        """Return the rates of deflection and its speed, per unit of mass."""
        deflection, rate = y
        return [rate, -contact.force(deflection, rate)]

    start = [0.0, 1.0]
    apart = integrate_until(lambda _, y: y[0], rates, start, 1e3, 1e-12, 1e-13, step=0.1)
    return float(apart.t[-1])


def integrate_until(
    event: Any, rates: Any, start: ArrayLike, limit: float, rtol: float, atol: Any, step: float
) -> Any:
    """Run scipy's DOP853 until an event of (t, y) falls to 0; return what `solve_ivp` returns.

    States at an event are an interpolant's, which is far less exact than the step. So the last step
    is taken anew, to just beyond the event.
    """

    def falling(t: float, y: Array) -> float:
        """Return the event's function."""
        return float(event(t, y))

    falling.terminal, falling.direction = True, -1  # type: ignore[attr-defined]
    run = partial(solve_ivp, rates, method="DOP853", rtol=rtol, atol=atol, max_step=step,
                  events=falling, dense_output=True)  # fmt: skip
    found = run((0.0, limit), np.asarray(start, np.float64))
    if found.status != 1:
        return found
    began, ended = found.t[-2:]
    beyond = ended + 0.01 * (ended - began)
    last = run((began, beyond), found.y[:, -2], first_step=beyond - began)
    times = np.concatenate([found.t[:-1], last.t[1:]])
    found.sol = OdeSolution(times, [*found.sol.interpolants[:-1], *last.sol.interpolants])
    found.t, found.y = times, np.hstack([found.y[:, :-1], last.y[:, 1:]])
    return found
