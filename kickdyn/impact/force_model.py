"""The force of a compliant contact over the deflection, and how long it lasts."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.restitution import SHELL_RESTITUTION

SHORTEST_CONTACT = 1e-9
"""Contact time below which the deflection has too few digits beside the leg's size [s]."""

LONGEST_CONTACT = 0.1
"""Longest contact time [s]: a larger number is usually in milliseconds."""

HERTZ, LINEAR = 1.5, 1.0
"""Exponents n of the deflection: of elastic bodies, and of an inflated ball (`Ball.stiffness`)."""


class Load(NamedTuple):
    """What a foot and a ball that touch do to each other, along the normal."""

    force: float  # on a foot that does not accelerate [N]
    carried: float  # mass of the ball that moves with the foot [kg]; its inertia adds to the force
    lost: float  # power, to hysteresis [W]


class NormalForce(Protocol):
    """A law of the force along the normal.

    It depends on the travel of the ball's centre of mass, by which it is nearer to the plane of the
    foot than a radius [m], on its rate [m/s], and on the largest deflection so far [m], which is 0
    while the deflection exceeds every one before.
    """

    def deflection(self, travel: float) -> float:
        """Return the deflection at a travel [m]."""

    def load(self, travel: float, rate: float, largest: float = 0.0) -> Load:
        """Return force, carried mass and power lost."""

    def energy(self, travel: float, rate: float, largest: float = 0.0) -> float:
        """Return the energy that is not lost, of the spring and of the deformation [J]."""

    def separation(self, largest: float) -> float:
        """Return the deflection at which the force vanishes [m] after a largest one [m]."""


@dataclass(frozen=True)
class ForceModel:
    r"""Contact force at a deflection d, never below 0.

    With D, the largest deflection so far,

    .. math::
        F = k \left(\frac{d - d_0}{e^2}\right)^n, \qquad d_0 = (1 - e^2) D,

    which is :math:`k d^n` in compression, while D = d. This is the hysteretic spring of Walton and
    Braun (J. Rheology 30, 1986; there n = 1): restitution returns :math:`e^2` of the work of
    compression whatever the masses, and foot and ball separate at :math:`d_0`.

    Attributes:
        stiffness: k [N/m^n]; of two elastic bodies (n = 3/2) it is :math:`\frac43 E^* \sqrt{R}`
            (Johnson 1985, Eq. 4.23), of an inflated ball (n = 1) see `Ball.stiffness`.
        restitution: e, 0.01 to 1; with 1 there is no hysteresis.
        exponent: n, 1 to 2.
    """

    stiffness: float
    restitution: float = 1.0
    exponent: float = HERTZ

    def __post_init__(self) -> None:
        """Check the values and store them as floats."""
        e = self.restitution
        self.__dict__.update(
            exponent=validation.number("exponent", self.exponent, at_least=1, at_most=2),
            stiffness=validation.number("stiffness", self.stiffness, at_least=0, unit="N/m^n"),
            restitution=validation.number("restitution", e, at_least=0.01, at_most=1),
        )

    def force(self, deflection: float, largest: float = 0.0) -> float:
        """Return the normal force [N] for a deflection [m], not checked.

        With a largest deflection so far [m] that is below d, the contact is being compressed.
        """
        spring, _ = self._spring(deflection, largest)
        return spring

    def returned(self, deflection: float, largest: float = 0.0) -> float:
        """Return the part of the spring's force whose work restitution gives back [N]."""
        spring, _ = self._spring(deflection, largest)
        return spring if deflection < largest else self.restitution**2 * spring

    def stored(self, deflection: float, largest: float = 0.0) -> float:
        """Return the energy that restitution will give back [J]."""
        spring, recovered = self._spring(deflection, largest)
        return spring * recovered / (self.exponent + 1.0)

    def deflection(self, travel: float) -> float:
        """Return the deflection, which is the travel of the centre of mass [m], not checked."""
        return travel

    def load(self, travel: float, rate: float, largest: float = 0.0) -> Load:
        """Return force and power lost, of values not checked; no mass is carried."""
        force = self.force(travel, largest)
        return Load(force, 0.0, (force - self.returned(travel, largest)) * rate)

    def energy(self, travel: float, rate: float, largest: float = 0.0) -> float:
        """Return the energy that restitution will give back [J], of values not checked."""
        return self.stored(travel, largest)

    def separation(self, largest: float) -> float:
        """Return the deflection at which the force vanishes [m] after a largest one [m]."""
        return (1.0 - self.restitution**2) * largest

    def _spring(self, deflection: float, largest: float) -> tuple[float, float]:
        """Return the spring's force [N] and how far it can recover [m], both 0 or more."""
        share = self.restitution**2
        return hysteretic_spring(deflection, largest, share, self.stiffness, self.exponent)


def hysteretic_spring(
    deflection: float, largest: float, share: float, stiffness: float, exponent: float
) -> tuple[float, float]:
    """Return the force [N] and how far the spring can recover [m], both 0 or more.

    It has floats alone and can be compiled. `share` is the square of the restitution.
    """
    if deflection < largest:
        recovered = max(deflection - (1.0 - share) * largest, 0.0)
        size = recovered / share
    else:
        size = max(deflection, 0.0)
        recovered = share * size
    # its power as a product, which may be inf but raises nothing
    power = math.sqrt(size) if exponent == HERTZ else size ** (exponent - 1.0)
    return stiffness * (size * power), recovered


def hertz_stiffness(time: Any, mass: Any, speed: Any, restitution: Any) -> Any:
    r"""Return the stiffness k of Hertz's spring at which two masses touch for a time T [N/m^1.5].

    .. math:: k = \frac{m}{\sqrt{u}} \left(\frac{\tau(e)}{T}\right)^{5/2},

    with the reduced mass m [kg], the approach speed u [m/s], :math:`\tau(1) = 3.218` (Johnson 1985,
    Eq. 11.24) and :math:`\tau(e) = (1 + e)/2\; \tau(1)`; floats, or arrays.
    """
    unit = spring_time(1.0, 1.0, HERTZ, 1.0, 1.0)
    return mass / np.sqrt(speed) * (np.float64(0.5 * (1.0 + restitution) * unit) / time) ** 2.5


def spring_time(stiffness: Any, restitution: Any, n: float, mass: Any, speed: Any) -> Any:
    r"""Return for how long two bodies of a reduced mass m [kg] touch [s]; floats, or arrays.

    .. math:: T = (1 + e) \frac{\sqrt\pi}{n + 1}\, \frac{\Gamma(p)}{\Gamma(p + 1/2)}
        \left(\frac{(n + 1)\, m}{2 k}\right)^p u^{-(n-1)\,p}, \qquad p = \frac{1}{n + 1},

    with the approach speed u [m/s]: restitution lasts e times as long as compression.
    """
    power = 1.0 / (n + 1.0)
    beta = math.sqrt(math.pi) * power * math.gamma(power) / math.gamma(power + 0.5)
    scale = (0.5 * (n + 1.0) * mass / stiffness) ** power
    return (1.0 + restitution) * beta * scale * speed ** ((1.0 - n) * power)


CONTACT_TIME = 0.010
"""[s] for which the force acts. With it, the visible contact takes 12.9 ms at e = 0.7; 9 to 14 ms
were seen in soccer, Australian football and rugby league (review in Ball, Ingleton, Peacock &
Nunome, Ball impact dynamics in the punt kick, ISBS 2013)."""


def chosen_spring(
    options: tuple[float | None, Any], ball_stiffness: Any, mass: Any, speed: Any, restitution: Any
) -> tuple[Any, float, Any]:
    """Return stiffness, exponent and contact time [s] of a spring; floats, or arrays.

    `options` are contact time and stiffness, as `collide` takes them; the stiffness `"pressure"` is
    `Ball.stiffness`. The mass is the reduced one [kg].
    """
    time, stiffness = options
    if stiffness is None:
        time = CONTACT_TIME if time is None else time
        return hertz_stiffness(time, mass, speed, restitution), HERTZ, time
    exponent = HERTZ
    if isinstance(stiffness, str):
        stiffness, exponent = ball_stiffness, LINEAR
    return stiffness, exponent, spring_time(stiffness, restitution, exponent, mass, speed)


OUTSIDE_PRESSURE = 101_325.0
"""Pressure of the air outside, of the standard atmosphere at sea level [Pa]."""

GAS_EXPONENT = 1.4
"""Exponent of the adiabatic compression of air; 0 keeps the gauge pressure constant."""


@dataclass(frozen=True)
class InflatedForce:
    r"""The force of a thin shell under pressure that a plane flattens by :math:`d = R u`.

    With the share s of the mass in the shell, the flat part has the mass :math:`m_f = s m u / 2`
    and moves with the foot, whose acceleration along the normal is :math:`a_f`:

    .. math::

        F = p(u)\, \pi R^2 u (2 - u) + \frac{s m}{2 R} \max(\dot d, 0)^2 + m_f (a_f - g_n),
        \qquad
        p(u) = (p + p_0) \left(1 - \tfrac14 u^2 (3 - u)\right)^{-\gamma} - p_0 .

    The second term is the momentum of the shell that comes to rest. While the deflection is below
    the largest one, the pressure pushes with :math:`e_s^2` of its force, for what the shell loses
    as it bends. The energy of the shell that stops, and of that which the ball sets in motion
    again, is lost at the rate :math:`s m |\dot d|^3 / (4 R)`. The centre of mass is at the height
    :math:`R (1 - u + s u^2 / 4)` over the plane, at which F acts on the mass m.
    `docs/explanation/inflated-ball.md` derives it, and e from it; the derivation is our own.
    """

    mass: float  # m, of the ball [kg]
    radius: float  # R [m]
    pressure: float  # gauge pressure p of the ball that touches nothing [Pa]
    shell_share: float = 1.0  # s, 0 to 1
    shell_restitution: float = SHELL_RESTITUTION  # e_s
    gas_exponent: float = GAS_EXPONENT  # gamma; with 0 the pressure stays p

    @classmethod
    def of(cls, ball: Ball) -> "InflatedForce":
        """Return the force of a ball whose pressure is known."""
        _ = ball.stiffness  # raises where it is not
        return cls(ball.mass, ball.radius, float(ball.pressure or 0.0), ball.shell_share)

    def deflection(self, travel: float) -> float:
        """Return the deflection at a travel of the centre of mass [m]."""
        return deflection_of(travel, self.radius, self.shell_share)

    def load(self, travel: float, rate: float, largest: float = 0.0) -> Load:
        """Return the force on a foot that does not accelerate, the flat mass and the power lost."""
        deflection = self.deflection(travel)
        if deflection <= 0.0:
            return Load(0.0, 0.0, 0.0)
        u, returned = deflection / self.radius, self.shell_restitution**2
        pressed = gauge_pressure(missing_share(u), self.pressure, self.gas_exponent)
        push = pressed * math.pi * self.radius**2 * u * (2.0 - u)
        per_length = 0.5 * self.shell_share * self.mass / self.radius
        speed = rate / (1.0 - 0.5 * self.shell_share * u)
        lost = 0.5 * per_length * abs(speed) ** 3
        if largest > 0.0:
            push *= returned
        else:
            lost += (1.0 - returned) * push * speed
        force = push + per_length * max(speed, 0.0) ** 2
        return Load(force, per_length * deflection, lost)

    def energy(self, travel: float, rate: float, largest: float = 0.0) -> float:
        r"""Return the energy of the air that comes back, and of the motion of the shell [J].

        The flat part and the rest move against each other with the energy
        :math:`\tfrac12 m_f (1 - m_f / m)\, \dot d^2`.
        """
        u = max(self.deflection(travel), 0.0) / self.radius
        carried = 0.5 * self.shell_share * u
        moving = 0.5 * self.mass * carried / (1.0 - carried) * rate * rate
        volume = 4.0 / 3.0 * math.pi * self.radius**3
        work = volume * compression_work(missing_share(u), self.pressure, self.gas_exponent)
        return self.shell_restitution**2 * work + moving

    def separation(self, largest: float) -> float:
        """Return 0: the ball keeps no dent."""
        return 0.0


def deflection_of(travel: float, radius: float, shell_share: float) -> float:
    """Return the deflection [m] whose centre of mass has come nearer to the plane by a travel [m].

    It is the smaller root of :math:`u - s u^2 / 4`.
    """
    root = math.sqrt(max(1.0 - shell_share * travel / radius, 0.0))
    return 2.0 * travel / (1.0 + root)


def missing_share(u: float) -> float:
    """Return the share of the volume of a ball in a cap whose height is u radii."""
    return 0.25 * u * u * (3.0 - u)


def gauge_pressure(missing: float, pressure: float, gas_exponent: float) -> float:
    """Return the gauge pressure [Pa] of a ball that lacks a share of its volume."""
    compressed = math.pow(1.0 - missing, -gas_exponent)
    return (pressure + OUTSIDE_PRESSURE) * compressed - OUTSIDE_PRESSURE


def compression_work(missing: float, pressure: float, gas_exponent: float) -> float:
    """Return the work of the pressure over the volume of the ball, for a missing share of it.

    The exponent is not 1 [J/m3].
    """
    power = gas_exponent - 1.0
    air = math.expm1(-power * math.log1p(-missing)) / power
    return (pressure + OUTSIDE_PRESSURE) * air - OUTSIDE_PRESSURE * missing
