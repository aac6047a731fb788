"""Compute what the model of an inflated ball gives, and what it neglects.

    python benchmarks/inflated_ball.py [FOLDER]

prints the tables of docs/explanation/inflated-ball.md and draws its two figures into a folder. The
ball is of size 5 and hits a rigid wall, unless a foot is named. What the model neglects is computed
from the equations of motion: the compression of the air, and a foot that moves.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from compliance import FOOT_MASS, INFLATED
from scipy.integrate import cumulative_trapezoid, quad
from scipy.optimize import brentq

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.restitution import LARGEST_DEFLECTION, SHELL_RESTITUTION

Pressure = Callable[[float], float]

SPEEDS = (5.0, 10.0, 15.0, 20.0, 25.0)
PRESSURES = (60e3, 80e3, 110e3)
OUTSIDE = 101_325.0
"""Pressure of the air outside [Pa]."""

FEET = 2.0 * INFLATED.mass, FOOT_MASS
"""Effective masses of feet [kg], light and as in M2 of validation.md."""


def restitution(speed: float, pressure: float = 80e3) -> float:
    """Return e as kickdyn computes it, at a speed of approach [m/s] and a pressure [Pa]."""
    contact = kd.Contact((1, 0, 0), "inflated")
    return contact.restitution_at(speed, replace(INFLATED, pressure=pressure))


def speed_of(deflection: float, pressure: float = 80e3) -> float:
    """Return the speed of approach [m/s] of a largest deflection over radius."""
    ball = replace(INFLATED, pressure=pressure)
    return deflection * ball.radius * math.sqrt(ball.stiffness / ball.mass)


def constant(pressure: float) -> Pressure:
    """Return the pressure over the deflection of the model."""
    return lambda u: pressure


def compressed(pressure: float) -> Pressure:
    """Return the gauge pressure of air that the missing cap compresses adiabatically [Pa]."""
    return lambda u: (pressure + OUTSIDE) * (1.0 - u * u * (3.0 - u) / 4.0) ** -1.4 - OUTSIDE


def compression(pressure: Pressure, u: float) -> float:
    """Return the square of the speed that a deflection u R takes away [m2/s2]."""
    work = quad(lambda x: pressure(x) * x, 0.0, u)[0]
    return 4.0 * math.pi * INFLATED.radius**3 / INFLATED.mass * work


def deflection_at(pressure: Pressure, speed: float) -> float:
    """Return the largest deflection over the radius."""
    return brentq(lambda u: compression(pressure, u) - speed * speed, 1e-9, 1.9, xtol=1e-14)


def ratio_at(pressure: Pressure, speed: float) -> float:
    """Return the ratio of the speeds after and before, without the factor of the shell."""
    u = deflection_at(pressure, speed)
    returned = quad(lambda x: pressure(x) * x * (1.0 - 0.5 * x) ** 2, 0.0, u)[0]
    return math.sqrt(returned / quad(lambda x: pressure(x) * x, 0.0, u)[0])


def ratio_of_foot(mass: float, speed: float, pressure: float = 80e3) -> float:
    """Return the same ratio for a foot of a mass [kg] that moves, with constant pressure."""
    eta = INFLATED.mass / mass
    unit = 2.0 * math.pi * pressure * INFLATED.radius**3 / INFLATED.mass * (1.0 + eta)
    square = speed * speed / unit
    u = brentq(lambda x: x * x + eta * x**3 / 3.0 - square, 0.0, 2.0, xtol=1e-14)
    returned = quad(lambda x: x * (2.0 - x) ** 2 / (1.0 + 0.5 * eta * x), 0.0, u)[0]
    return math.sqrt(0.5 * returned / square)


def force_over_time(pressure: Pressure, speed: float, points: int = 4001) -> tuple[Array, Array]:
    """Return times [s] and force on the wall [N].

    The deflection is U sin(angle): the angle runs from 0 to pi, and each integrand is smooth.
    """
    m, radius = INFLATED.mass, INFLATED.radius
    largest = deflection_at(pressure, speed)
    angle = np.linspace(0.0, 0.5 * math.pi, points)
    u = largest * np.sin(angle)
    p = np.array([pressure(x) for x in u])
    push = p * math.pi * radius**2 * u * (2.0 - u)
    along = largest * np.cos(angle)  # du over dangle
    slowed = cumulative_trapezoid(p * u * along, angle, initial=0.0)
    square = 4.0 * math.pi * radius**3 / m * (slowed[-1] - slowed)
    gained = cumulative_trapezoid(p * u * (2.0 - u) ** 2 * along, angle, initial=0.0)
    momentum = np.sqrt(math.pi * radius**3 * m * (gained[-1] - gained))
    closing = along[:-1] * radius / np.sqrt(square[:-1])
    opening = along[:-1] * radius * m * (1.0 - 0.5 * u[:-1]) / momentum[:-1]
    closing, opening = (np.append(rate, rate[-1]) for rate in (closing, opening))  # at rest, 0/0
    times = cumulative_trapezoid(closing, angle, initial=0.0)
    back = times[-1] + cumulative_trapezoid(opening[::-1], angle, initial=0.0)
    force = push + m * square / (2.0 * radius)
    return np.array([*times, *back[1:]]), np.array([*force, *push[-2::-1]])


def peak_force(speed: float, ball: kd.Ball = INFLATED) -> float:
    """Return the peak force on a wall [N], which is at the largest deflection up to 0.5 R."""
    k = ball.stiffness
    largest = speed / ball.radius * math.sqrt(ball.mass / k)
    u = min(largest, 0.5)
    return k * ball.radius * (u - u * u + 0.5 * largest * largest)


def spring_force(speed: float, ball: kd.Ball = INFLATED) -> float:
    """Return the peak force of the spring from pressure on a wall [N]."""
    return speed * math.sqrt(ball.stiffness * ball.mass)


def print_table(heading: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    """Print a table in Markdown."""
    print("| " + " | ".join(heading) + " |\n|" + " ---: |" * len(heading))
    for row in rows:
        print("| " + " | ".join(row) + " |")


def restitutions() -> None:
    """Print e over the speed, and how much it changes by what is neglected."""
    heading = ("speed [m/s]", "deflection, 80 kPa", "60 kPa", "80 kPa", "110 kPa")
    heading += ("compressed air, 80 kPa", *(f"foot of {mass:.2f} kg, 80 kPa" for mass in FEET))
    rows = []
    for speed in SPEEDS:
        u = deflection_at(constant(80e3), speed)
        wall = ratio_at(constant(80e3), speed)
        row = [f"{speed:.0f}", f"{u:.2f} R"]
        for pressure in PRESSURES:
            inside = speed <= speed_of(LARGEST_DEFLECTION, pressure)
            row.append(f"{restitution(speed, pressure):.3f}" if inside else "beyond")
        row.append(f"{ratio_at(compressed(80e3), speed) / wall - 1.0:+.1%}")
        row += [f"{ratio_of_foot(mass, speed) / wall - 1.0:+.1%}" for mass in FEET]
        rows.append(tuple(row))
    print_table(heading, rows)


def forces() -> None:
    """Print peak force and duration of the contact with a wall at 80 kPa."""
    heading = ("speed [m/s]", "peak force [N]", "with compressed air [N]")
    heading += ("spring from pressure [N]", "contact [ms]", "of the spring [ms]")
    rows = []
    half = math.pi * math.sqrt(INFLATED.mass / INFLATED.stiffness)
    for speed in SPEEDS:
        peak = peak_force(speed)
        times, force = force_over_time(constant(80e3), speed)
        assert abs(force.max() / peak - 1.0) < 1e-6
        air = force_over_time(compressed(80e3), speed)[1].max()
        spring = spring_force(speed)
        rows.append((
            f"{speed:.0f}", f"{peak:.0f}", f"{air:.0f} ({air / peak - 1.0:+.0%})",
            f"{spring:.0f} ({spring / peak - 1.0:+.0%})", f"{1e3 * times[-1]:.2f}",
            f"{1e3 * half:.2f}",
        ))  # fmt: skip
    print_table(heading, rows)


def draw_restitution(file: Path) -> None:
    """Draw e over the speed of approach."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
    for pressure, colour in zip(PRESSURES, ("C0", "C1", "C2"), strict=True):
        speeds = np.linspace(0.1, speed_of(LARGEST_DEFLECTION, pressure), 60)
        e = [restitution(float(speed), pressure) for speed in speeds]
        axes.plot(speeds, e, colour, label=f"{1e-3 * pressure:.0f} kPa, wall")
    speeds = np.linspace(0.1, speed_of(LARGEST_DEFLECTION), 60)
    for mass, style in zip(FEET, (":", "--"), strict=True):
        e = [SHELL_RESTITUTION * ratio_of_foot(mass, float(speed)) for speed in speeds]
        axes.plot(speeds, e, "C1" + style, label=f"80 kPa, foot of {mass:.2f} kg")
    fall = math.sqrt(2.0 * 9.81 * 2.0)
    low, middle, high = (math.sqrt(height / 2.0) for height in (1.35, 1.45, 1.55))
    axes.errorbar(
        [fall], [middle], [[middle - low], [high - middle]], fmt="ko", capsize=3,
        label="FIFA Quality Pro, the fitted point",
    )  # fmt: skip
    axes.set(xlabel="speed of approach [m/s]", ylabel="restitution e", xlim=(0, None))
    axes.legend(frameon=False)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def draw_force(file: Path) -> None:
    """Draw the force on a wall over time at 20 m/s and 80 kPa."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
    for pressure, label in (
        (constant(80e3), "inflated ball"), (compressed(80e3), "with the compression of the air"),
    ):  # fmt: skip
        times, force = force_over_time(pressure, 20.0)
        axes.plot(1e3 * times, force, label=label)
    rate = math.sqrt(INFLATED.stiffness / INFLATED.mass)
    times = np.linspace(0.0, math.pi / rate, 200)
    axes.plot(1e3 * times, spring_force(20.0) * np.sin(rate * times), "--",
              label="spring from pressure, e = 1")  # fmt: skip
    axes.set(xlabel="time [ms]", ylabel="force on the wall [N]", xlim=(0, None), ylim=(0, None))
    axes.legend(frameon=False)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def main() -> None:
    """Print the tables and draw the figures."""
    restitutions()
    print()
    forces()
    if len(sys.argv) > 1:
        draw_restitution(Path(sys.argv[1]) / "inflated-restitution.png")
        draw_force(Path(sys.argv[1]) / "inflated-force.png")


if __name__ == "__main__":
    main()
