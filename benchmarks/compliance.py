"""Compare `strike` with `collide`, and contact models with measurements.

    python benchmarks/compliance.py

prints the tables of docs/explanation/compliance.md. The leg of Table 1, hip flexed by 40, knee by
30 and foot raised by 20 deg, its toe at 14 m/s along the normal, 30 deg up: the hip flexes, and the
knee extends at 90 % of its speed limit.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from scipy.integrate import quad
from scipy.optimize import brentq

import kickdyn as kd
from kickdyn.core.validation import Array

LEG, BALL = kd.Leg.human(), kd.Ball()
POSTURE = LEG.posture(np.radians([40.0, 30.0, -20.0]))
ATTACK = np.array([math.cos(math.radians(30)), 0.0, math.sin(math.radians(30))])
CONTACT = kd.Contact(ATTACK, restitution=0.7)
V = np.array([8.25, -18.15, 2.48])
INSTANT = kd.strike(POSTURE, V, BALL, CONTACT)


def angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors [deg]."""
    return math.degrees(math.atan2(np.linalg.norm(np.cross(a, b)), a @ b))


def through_time(milliseconds: float, **options: object) -> kd.Collision:
    """Return the same kick with a contact time of so many milliseconds."""
    seconds = 1e-3 * milliseconds
    return kd.collide(POSTURE, V, BALL, CONTACT, contact_time=seconds, tol=1e-11, **options)  # type: ignore[arg-type]


def foot_displacement(hit: kd.Collision) -> Array:
    """Return how far the contact point of the foot moves in the contact time [m, world frame]."""
    end = hit.posture.leg.posture(hit.q_after).with_contact_offset(hit.contact.offset)
    return end.contact_point - hit.posture.contact_point


def order() -> None:
    """Print the convergence to the instantaneous impact."""
    print(
        "| stiffness [N/m^1.5] | contact [ms] | impulse difference [N s] | relative | order in k |"
    )
    print("| ---: | ---: | ---: | ---: | ---: |")
    size, last = math.hypot(*INSTANT.impulse), None
    for milliseconds in 10.0 / 16.0 ** np.arange(4):
        hit = through_time(milliseconds)
        apart = math.hypot(*(hit.impulse - INSTANT.impulse))
        slope = f"{math.log(apart / last, 1024):.3f}" if last else ""
        print(
            f"| {hit.force_model.stiffness:.2e} | {1e3 * hit.contact_time:.4g} | {apart:.2e} "
            f"| {apart / size:.3%} | {slope} |"
        )
        last = apart


def differences() -> None:
    """Print the difference at the contact times of real balls."""
    heading = ("contact [ms]", "stiffness [N/m^1.5]", "peak force [N]", "deflection [mm]")
    heading += (
        "foot moves [mm]",
        "impulse",
        "ball speed",
        "direction difference [deg]",
    )
    print("| " + " | ".join(heading) + " |\n|" + " ---: |" * len(heading))
    for milliseconds in (8.0, 10.0, 12.0):
        hit = through_time(milliseconds)
        cells = (
            f"{1e3 * hit.contact_time:.1f}",
            f"{hit.force_model.stiffness:.2e}",
            f"{hit.peak_force:.0f}",
            f"{1e3 * hit.deflection:.1f}",
            f"{1e3 * math.hypot(*foot_displacement(hit)):.0f}",
            f"{math.hypot(*hit.impulse) / math.hypot(*INSTANT.impulse) - 1:+.1%}",
            f"{float(hit.ball_after.speed) / float(INSTANT.ball_after.speed) - 1:+.1%}",
            f"{angle(hit.ball_after.velocity, INSTANT.ball_after.velocity):.1f}",
        )
        print("| " + " | ".join(cells) + " |")


def random_kicks(count: int = 60) -> list[tuple[float, float]]:
    """Return what an instant neglects in kicks of 10 ms: share of the impulse, direction [deg].

    The foot moves at 14 m/s, the hip flexes, the knee extends, all within their speed limits. Hip
    flexion is -30 to 50, knee flexion 5 to 80, plantar flexion -20 to 20 deg, and the normal is
    within 15 deg of the foot's velocity.
    """
    rng, neglected = np.random.default_rng(60), []
    while len(neglected) < count:
        posture = LEG.posture(np.radians(rng.uniform([-30, 5, -20], [50, 80, 20])))
        v = rng.uniform([0, -1, -1], [1, 0, 1]) * LEG.velocity_limit
        foot = posture.jacobian @ v
        v *= 14.0 / math.hypot(*foot)
        tilt = math.atan2(foot[2], foot[0])
        if np.abs(v / LEG.velocity_limit).max() > 1.0 or not 0.0 < tilt < math.pi / 3:
            continue
        tilt += math.radians(rng.uniform(-15, 15))
        contact = kd.Contact((math.cos(tilt), 0.0, math.sin(tilt)), 0.7)
        hit = kd.collide(posture, v, BALL, contact, contact_time=0.01)
        instant = kd.strike(posture, v, BALL, contact)
        size = abs(math.hypot(*hit.impulse) / math.hypot(*instant.impulse) - 1)
        neglected.append((size, angle(hit.ball_after.velocity, instant.ball_after.velocity)))
    return neglected


def print_random_kicks() -> None:
    """Print what an instant neglects of half and of nine tenths of random kicks, at most."""
    sizes, angles = (np.quantile(column, (0.5, 0.9)) for column in np.transpose(random_kicks()))
    print(
        f"60 random kicks: impulse {sizes[0]:.1%}, direction {angles[0]:.1f} deg at most in half, "
        f"{sizes[1]:.1%} and {angles[1]:.1f} deg at most in nine tenths"
    )


def sliding_foot(mass: float) -> kd.Leg:
    """Return a foot of a mass [kg] that slides along x, without gravity."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
    body = pin.Inertia(mass, np.zeros(3), 0.01 * np.eye(3))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.gravity = pin.Motion.Zero()
    return kd.Leg.from_model(model, "toe")


INFLATED = kd.Ball(pressure=80e3)
"""Of a pressure in the middle of what Law 2 allows, 0.6 to 1.1 atmospheres."""

FOOT_MASS = 22.7 / 5.0 * INFLATED.mass
"""Effective mass of a foot [kg], from what foot and ball lose and gain [m/s] (Peacock, Ball &
Taylor, J. Sports Sci. 35, 2017), by momentum."""

FOOT = sliding_foot(FOOT_MASS)

RESTITUTION = 0.7
"""Of a mechanical limb 0.66 to 0.79 (Peacock & Ball, ISBS 2016)."""

MAXIMAL = 25.64, 34.48
"""Least and largest ball speed of maximal instep kicks [m/s] (Andersen & Dorge 2011)."""


def head_on(
    foot_speed: float, restitution: float | str = RESTITUTION, **options: object
) -> kd.Collision:
    """Return the collision of the sliding foot with the inflated ball at rest."""
    contact = kd.Contact((1, 0, 0), restitution)
    return kd.collide(FOOT.posture([0.0]), [foot_speed], INFLATED, contact, **options)  # type: ignore[arg-type]


def peak_over_mean(hit: kd.Collision) -> float:
    """Return the peak of the force over its mean while it acts."""
    return hit.peak_force * hit.contact_time / math.hypot(*hit.impulse)


def by_pressure(foot_speed: float) -> dict[str, float]:
    """Return what the stiffness from pressure gives at a foot speed [m/s], in SI units."""
    hit = head_on(foot_speed, stiffness="pressure")
    return {
        "ball speed": float(hit.ball_after.speed),
        "contact time": hit.contact_time,
        "visible contact time": hit.visible_contact_time,
        "peak force": hit.peak_force,
        "deflection": hit.deflection,
        "next terms": peak_with_next_terms(foot_speed),
    }


def peak_with_next_terms(foot_speed: float) -> float:
    """Return the peak force of two masses [N] without the approximations of `Ball.stiffness`.

    The circle has the area of the cut through the sphere, and the air is compressed adiabatically
    by the volume of the missing cap, at sea level.
    """
    radius, outside = INFLATED.radius, 101_325.0
    assert INFLATED.pressure is not None
    absolute = INFLATED.pressure + outside

    def force(d: float) -> float:
        """Return the force at a deflection [N]."""
        missing = math.pi * d * d * (radius - d / 3.0) / INFLATED.volume
        circle = math.pi * (2.0 * radius * d - d * d)
        return circle * (absolute * (1.0 - missing) ** -1.4 - outside)

    mass = 1.0 / (1.0 / INFLATED.mass + 1.0 / FOOT_MASS)
    energy = 0.5 * mass * foot_speed**2
    return force(brentq(lambda d: quad(force, 0.0, d)[0] - energy, 0.0, radius, xtol=1e-9))


def pressures() -> None:
    """Print contact time, force and deflection of the stiffness from pressure over foot speed."""
    heading = ("foot [m/s]", "ball [m/s]", "force acts [ms]", "visible contact [ms]")
    heading += ("peak force [N]", "with the next terms [N]", "deflection [mm]", "of the radius")
    print("| " + " | ".join(heading) + " |\n|" + " ---: |" * len(heading))
    for speed in (5.0, 10.0, 15.0, 20.0, 30.0):
        row = by_pressure(speed)
        cells = (
            f"{speed:.0f}",
            f"{row['ball speed']:.1f}",
            f"{1e3 * row['contact time']:.1f}",
            f"{1e3 * row['visible contact time']:.1f}",
            f"{row['peak force']:.0f}",
            f"{row['next terms']:.0f} ({row['next terms'] / row['peak force'] - 1:+.0%})",
            f"{1e3 * row['deflection']:.0f}",
            f"{row['deflection'] / INFLATED.radius:.0%}",
        )
        print("| " + " | ".join(cells) + " |")


def distance(hit: kd.Collision) -> float:
    """Return how far the foot moves while the contact is visible [m]."""
    return float(
        foot_displacement(hit)[0] + (hit.visible_contact_time - hit.contact_time) * hit.v_after[0]
    )


def main() -> None:
    """Print the tables."""
    print(
        f"instant: impulse {math.hypot(*INSTANT.impulse):.3f} N s, "
        f"ball {INSTANT.ball_after.speed:.2f} m/s\n"
    )
    order()
    print()
    differences()
    print()
    print_random_kicks()
    print()
    pressures()


if __name__ == "__main__":
    main()
