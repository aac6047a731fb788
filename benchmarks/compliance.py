"""Compare `strike` with `collide` for the human leg; prints the tables of docs/compliance.md.

    python benchmarks/compliance.py

The leg of Table 1, hip flexed by 40, knee by 30 and foot raised by 20 deg, its toe at 14 m/s along
the normal, 30 deg up: the hip flexes, and the knee extends at 90 % of its speed limit.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

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


def through_time(milliseconds: float, leg: kd.Leg = LEG, **options: object) -> kd.Collision:
    """Return the same kick with a contact time of so many milliseconds."""
    seconds = 1e-3 * milliseconds
    return kd.collide(
        leg.posture(POSTURE.q), V, BALL, CONTACT, contact_time=seconds, tol=1e-11, **options
    )  # type: ignore[arg-type]


def order() -> None:
    """Print the convergence to the instantaneous impact."""
    print(
        "| stiffness [N/m^1.5] | contact [ms] | impulse difference [N s] | relative | order in k |"
    )
    print("| ---: | ---: | ---: | ---: | ---: |")
    size, last = math.hypot(*INSTANT.impulse), None
    for milliseconds in 10.0 / 4.0 ** np.arange(7):
        hit = through_time(milliseconds)
        apart = math.hypot(*(hit.impulse - INSTANT.impulse))
        slope = f"{math.log(apart / last, 32):.3f}" if last else ""
        print(
            f"| {hit.hertz.stiffness:.2e} | {1e3 * hit.contact_time:.4g} | {apart:.2e} "
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
        "energy lost",
    )
    print("| " + " | ".join(heading) + " |\n|" + " ---: |" * len(heading))
    for milliseconds in (8.0, 10.0, 12.0):
        hit = through_time(milliseconds)
        cells = (
            f"{1e3 * hit.contact_time:.1f}",
            f"{hit.hertz.stiffness:.2e}",
            f"{hit.peak_force:.0f}",
            f"{1e3 * hit.deflection:.1f}",
            f"{1e3 * math.hypot(*hit.foot_displacement):.0f}",
            f"{math.hypot(*hit.impulse) / math.hypot(*INSTANT.impulse) - 1:+.1%}",
            f"{float(hit.ball_after.speed) / float(INSTANT.ball_after.speed) - 1:+.1%}",
            f"{angle(hit.ball_after.velocity, INSTANT.ball_after.velocity):.1f}",
            f"{hit.energy_lost / INSTANT.energy_lost - 1:+.1%}",
        )
        print("| " + " | ".join(cells) + " |")


def motions() -> None:
    """Print the difference for other joint velocities of the same foot velocity, at 10 ms."""
    print(
        "| hip, knee, ankle [deg] | v [rad/s] | share of the speed limits | impulse | ball speed |",
        end="",
    )
    print(" direction difference [deg] |\n|" + " ---: |" * 6)
    upright = LEG.posture(np.radians([5.0, 10.0, -5.0]))
    for posture, v in (
        (POSTURE, V),
        (POSTURE, POSTURE.joint_velocity(14.0 * ATTACK)),
        (upright, upright.joint_velocity(14.0 * ATTACK)),
    ):
        hit = kd.collide(posture, v, BALL, CONTACT, contact_time=0.01, tol=1e-11)
        instant = kd.strike(posture, v, BALL, CONTACT)
        cells = (
            ", ".join(f"{value:.0f}" for value in LEG.angles_deg(posture.q).values()),
            ", ".join(f"{value:.1f}" for value in v),
            f"{np.abs(v / LEG.velocity_limit).max():.0%}",
            f"{math.hypot(*hit.impulse) / math.hypot(*instant.impulse) - 1:+.1%}",
            f"{float(hit.ball_after.speed) / float(instant.ball_after.speed) - 1:+.1%}",
            f"{angle(hit.ball_after.velocity, instant.ball_after.velocity):.1f}",
        )
        print("| " + " | ".join(cells) + " |")


def causes() -> None:
    """Print the effect of gravity and of joint torques, at the stiffness of 10 ms."""
    model = LEG.model
    model.gravity = pin.Motion.Zero()
    still = kd.Leg.from_model(model, LEG.frame)
    usual = through_time(10.0)
    pushed = through_time(10.0, torque=0.1 * np.sign(V) * LEG.effort_limit)
    print("| 10 ms | contact [ms] | impulse | ball speed |\n| --- | ---: | ---: | ---: |")
    for name, hit in (
        ("no joint torque", usual),
        ("no joint torque, no gravity", through_time(10.0, still)),
        ("every joint with a tenth of its torque limit, along its motion", pushed),
    ):
        impulse = math.hypot(*hit.impulse) / math.hypot(*INSTANT.impulse) - 1
        speed = float(hit.ball_after.speed) / float(INSTANT.ball_after.speed) - 1
        print(f"| {name} | {1e3 * hit.contact_time:.1f} | {impulse:+.1%} | {speed:+.1%} |")


def main() -> None:
    """Print the tables."""
    print(
        f"instant: impulse {math.hypot(*INSTANT.impulse):.3f} N s, "
        f"ball {INSTANT.ball_after.speed:.2f} m/s, energy lost {INSTANT.energy_lost:.2f} J\n"
    )
    order()
    print()
    differences()
    print()
    motions()
    print()
    causes()


if __name__ == "__main__":
    main()
