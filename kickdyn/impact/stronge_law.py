"""Stronge's law: energetic restitution, with the sliding followed through the contact."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from operator import mul

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.impact.contact_phases import slip_direction
from kickdyn.impact.contact_problem import (
    ContactProblem,
    ImpactLaw,
    Solution,
    frictionless,
    solution_in_world,
)

ORDER = 24
"""Order of the Taylor series of a step."""

LOCKED = 1e-14
"""Growth of the normal velocity, relative to its terms, up to which it is rounding, and then the
normal velocity, relative to the largest one before, that is rounding, too."""

MAX_STEPS = 2000
"""Steps after which the sliding counts as one that does not end."""


def solve_stronge(problem: ContactProblem) -> Solution:
    r"""Return the impulse in which restitution returns e^2 of the work of compression.

    While the normal impulse grows by :math:`dp` and the points slide along the unit vector
    :math:`r`, the relative velocity changes by :math:`du = G\,(-\mu r, 1)\,dp` (Darboux, Keller).
    In the variable :math:`\tau` with :math:`d\tau = dp / |s|` the sliding velocity :math:`s`
    follows

    .. math:: s' = |s|\, b - \mu A s,

    with A and b the tangential block and column of G. This is smooth up to the end of the sliding,
    at :math:`\tau \to \infty`, and steps by Taylor series of order 24 lose nothing to truncation;
    for mu above 1 they are in :math:`\mu \tau`. Once the direction of sliding has settled, what
    follows has a closed form, and so has all that comes after the end of the sliding.

    Where the foot's inertia turns sliding into compression (jamming), the speed of approach grows
    at first; compression still ends, because kinetic energy cannot grow. The work of a second
    compression, during restitution, is added to what restitution returns. The energy lost is
    (1 - e^2) of the work of compression plus the work of friction: never negative.

    Sources: Keller 1986, J Appl Mech 53:1; Stronge, Impact Mechanics, 2000, chapters 3 and 4;
    Batlle 1996, J Appl Mech 63:10 (directions that a slip can keep); Elkaranshawy et al. 2017.
    """
    (contact,) = problem.contacts
    e, friction = contact.restitution, contact.friction
    if friction == 0.0:
        return frictionless(problem)
    axes, velocity = problem.in_contact_axes()
    before, speed = np.array(velocity), max(map(abs, velocity))
    g_matrix = problem.delassus(axes)
    mobility = float(g_matrix.diagonal().max())
    mu = min(friction, 1e50)  # more changes no digit, and its work would overflow
    course = _Course(g_matrix / mobility, mu, e, before / speed)
    sticking = course.run()
    scale = speed / mobility
    lost = (1.0 - e**2) * course.compression_work + course.friction_work
    return solution_in_world(
        axes, (scale * course.impulse).tolist(), (sticking,), scale * speed * lost
    )


class _Course:
    """An impact in progress, in contact axes with the normal last; velocities and G of order 1.

    Attributes:
        pace: factor from the series' variable to tau.
        slip, x, y: speed and direction of the sliding.
        normal: velocity along the normal; negative while the points approach.
    """

    def __init__(self, g: Array, mu: float, e: float, before: Array) -> None:
        (self.a11, self.a12, self.b1), (_, self.a22, self.b2), (*_, self.g33) = g.tolist()
        self.mu, self.share, self.pace = mu, e * e, 1.0 / max(mu, 1.0)
        u1, u2, self.normal = before.tolist()
        self.slip = math.hypot(u1, u2)
        self.x: float = u1 / self.slip if self.slip else 1.0
        self.y: float = u2 / self.slip if self.slip else 0.0
        self.impulse = np.zeros(3)
        self.compression_work = self.restitution_work = self.friction_work = 0.0

    def run(self) -> bool:
        """Run compression and restitution; return whether the points stick as they separate."""
        for _ in range(MAX_STEPS):
            if self.slip == 0.0:
                return self._after_sliding()
            turning, gain = self._turning()
            if turning:
                if self._curve():
                    return False
            else:
                end = -self.slip / gain if gain < 0.0 else math.inf
                if self._line(-self.mu * self.x, -self.mu * self.y, gain, end):
                    return False
                self.slip = 0.0
        raise KickdynError(f"the sliding did not end in {MAX_STEPS} steps (mu = {self.mu:g})")

    def _turning(self) -> tuple[float, float]:
        """Return the rate at which the slip turns, 0 if that is negligible, and its growth rate."""
        x, y, mu = self.x, self.y, self.mu
        f1 = self.b1 - mu * (self.a11 * x + self.a12 * y)
        f2 = self.b2 - mu * (self.a12 * x + self.a22 * y)
        turning, gain = x * f2 - y * f1, x * f1 + y * f2
        rounding = abs(self.b1) + abs(self.b2) + mu * (self.a11 + self.a22)
        settled = abs(turning) <= 1e-15 * rounding
        ending = gain < 0.0 and self.slip * abs(turning) <= -1e-17 * gain
        return (0.0 if settled or ending else turning), gain

    def _after_sliding(self) -> bool:
        """Stick to the end if friction suffices, else slide in the one possible direction."""
        stick1, stick2 = _solve(self.a11, self.a12, self.a22, -self.b1, -self.b2)
        sticks, gain = math.hypot(stick1, stick2) <= self.mu, 0.0
        if not sticks:
            a11, a12, a22 = (self.mu * entry for entry in (self.a11, self.a12, self.a22))
            x, y, gain = slip_direction(a11, a12, a22, self.b1, self.b2)
            stick1, stick2 = self.mu * x, self.mu * y
        self._line(stick1, stick2, gain, math.inf)
        return sticks

    def _line(self, f1: float, f2: float, gain: float, end: float) -> bool:
        """Advance with constant friction; return whether the impact ended before impulse `end`."""
        rate = self.g33 + self.b1 * f1 + self.b2 * f2
        terms = self.g33 + abs(self.b1 * f1) + abs(self.b2 * f2)
        if abs(rate) <= LOCKED * terms:
            rate = 0.0
            self.normal = self.normal if abs(self.normal) > LOCKED else 0.0
        while True:
            compressing = self.normal < 0.0 or (self.normal == 0.0 and rate < 0.0)
            due = 0.0 if compressing else self._work_due()
            square = self.normal**2 + 2.0 * rate * due
            complete = not compressing and square >= 0.0  # restitution returns all work due
            if complete:
                parting = self.normal + math.sqrt(square)
                stop = 2.0 * due / parting if parting else math.inf if due else 0.0
            else:
                stop = -self.normal / rate if rate * self.normal < 0.0 else math.inf
            p = min(stop, end)
            if not p < math.inf:  # no impulse parts the points: `solve_contacts` refuses it
                self.friction_work = math.inf
                return True
            work = p * (self.normal + 0.5 * rate * p)
            if compressing:
                self.compression_work -= work
            else:
                self.restitution_work += work
            self.impulse += (f1 * p, f2 * p, p)
            self.friction_work += self.mu * p * (self.slip + 0.5 * gain * p)
            self.slip += gain * p
            self.normal = self.normal + rate * p if complete or stop > end else 0.0
            if complete or stop > end:
                return stop <= end
            end -= p

    def _work_due(self) -> float:
        return max(0.0, self.share * self.compression_work - self.restitution_work)

    def _curve(self) -> bool:
        """Take one step while the slip turns; return whether the impact ended in it."""
        xs, ys, ss = self._series()
        tail = max(abs(c) for series in (xs, ys, ss) for c in series[-2:])
        h = (1e-17 / max(tail, 1e-300)) ** (1.0 / ORDER)
        mu, slip = self.mu * self.pace, self.slip  # mu dp is of order 1 where dp is not
        rates = [
            self.pace * self.g33 * s + mu * -(self.b1 * x + self.b2 * y)
            for x, y, s in zip(xs, ys, ss, strict=True)
        ]
        h = self._monotone(h, xs, ys, rates)
        normal = _integral(rates, slip, self.normal)
        ended = False
        if self.normal * _value(normal, h) < 0.0:
            h = _root(partial(_value, normal), h)
            last = 0.0
        else:
            last = _value(normal, h)
        # Products are kept to twice the order: the square of a series converges more slowly.
        work = _integral(np.convolve(ss, normal).tolist(), slip * self.pace)
        friction = _integral(np.convolve(ss, ss).tolist(), mu * slip * slip)
        if self.normal < 0.0 or last < 0.0:
            self.compression_work -= _value(work, h)
            ended = last == 0.0 and self.share == 0.0
        else:
            due = self._work_due()
            if _value(work, h) >= due:
                h = _root(lambda t: _value(work, t) - due, h)
                last, ended = _value(normal, h), True
            self.restitution_work += _value(work, h)
        self.impulse += (
            -mu * _value(_integral(xs, slip), h),
            -mu * _value(_integral(ys, slip), h),
            _value(_integral(ss, slip * self.pace), h),
        )
        self.friction_work += _value(friction, h)
        x, y = _value(xs, h), _value(ys, h)
        size = math.hypot(x, y)
        self.x, self.y, self.slip, self.normal = x / size, y / size, slip * size, last
        return ended

    def _series(self) -> tuple[list[float], list[float], list[float]]:
        """Return Taylor coefficients of the slip (x, y) and of its speed, over the speed now."""
        mu, b1, b2 = self.mu * self.pace, self.b1 * self.pace, self.b2 * self.pace
        m11, m12, m22 = mu * self.a11, mu * self.a12, mu * self.a22
        xs, ys, ss = [self.x], [self.y], [1.0]
        for k in range(1, ORDER + 1):
            x, y, s = xs[-1], ys[-1], ss[-1]
            xs.append((b1 * s - m11 * x - m12 * y) / k)
            ys.append((b2 * s - m12 * x - m22 * y) / k)
            ss.append(0.5 * (_square(xs) + _square(ys) - _square(ss[1:])))
        return xs, ys, ss

    def _monotone(self, h: float, xs: list[float], ys: list[float], rates: list[float]) -> float:
        """Return the step, cut where the normal acceleration may change sign, if it can at all."""
        steepest = math.hypot(self.b1, self.b2)
        if self.g33 > self.mu * steepest:
            return h
        crossing = [(self.b1 * y - self.b2 * x) / steepest for x, y in zip(xs, ys, strict=True)]
        for series in (crossing, rates):
            begin = 1e-6 * h  # where the last step was cut, the sign is rounding
            if _value(series, begin) * _value(series, h) < 0.0:
                h = _root(partial(_value, series), h, begin)
        return h


def _square(series: list[float]) -> float:
    return sum(map(mul, series, reversed(series)), 0.0)


def _integral(series: Sequence[float], factor: float, start: float = 0.0) -> list[float]:
    """Return the coefficients of a series' integral times a factor."""
    return [start, *(factor * c / k for k, c in enumerate(series, 1))]


def _value(series: Sequence[float], t: float) -> float:
    """Return the value of a series at t, by Horner's rule."""
    total = 0.0
    for c in reversed(series):
        total = total * t + c
    return total


def _root(function: Callable[[float], float], high: float, low: float = 0.0) -> float:
    """Return the point between two others at which a function changes sign, to rounding."""
    from scipy.optimize import brentq  # here, because it takes long to import

    return float(brentq(function, low, high, xtol=1e-300))


def _solve(m11: float, m12: float, m22: float, c1: float, c2: float) -> tuple[float, float]:
    """Return the solution of a symmetric 2 x 2 system, the least one if its rank is 1."""
    determinant = m11 * m22 - m12 * m12
    if determinant <= 1e-15 * m11 * m22:
        square = (m11 + m22) ** 2 or 1.0
        return (m11 * c1 + m12 * c2) / square, (m12 * c1 + m22 * c2) / square
    return (m22 * c1 - m12 * c2) / determinant, (m11 * c2 - m12 * c1) / determinant


STRONGE = ImpactLaw("stronge", solve_stronge)
