"""The force of an inflated ball on a plate: pressure, and momentum of the shell that it stops."""

import math
from dataclasses import dataclass

from kickdyn.ball import Ball
from kickdyn.impact.force_model import Load
from kickdyn.restitution import SHELL_RESTITUTION

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

    Attributes:
        mass: mass m of the ball [kg].
        radius: radius R [m].
        pressure: gauge pressure p of the ball that touches nothing [Pa].
        shell_share: s, 0 to 1.
        shell_restitution: :math:`e_s`, see `kickdyn.restitution.SHELL_RESTITUTION`.
        gas_exponent: :math:`\gamma`; with 0 the pressure stays p.
    """

    mass: float
    radius: float
    pressure: float
    shell_share: float = 1.0
    shell_restitution: float = SHELL_RESTITUTION
    gas_exponent: float = GAS_EXPONENT

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
