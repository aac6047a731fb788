"""Compare `strike` with `collide`, and contact models with measurements.

The tables of docs/explanation/compliance.md.

    python benchmarks/compliance.py

prints the tables of that page. The leg of Table 1, hip flexed by 40, knee by 30 and foot raised by
20 deg, its toe at 14 m/s along the normal, 30 deg up: the hip flexes, and the knee extends at 90 %
of its speed limit.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from scipy.integrate import quad, solve_ivp
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


def through_time(milliseconds: float, leg: kd.Leg = LEG, **options: object) -> kd.Collision:
    """Return the same kick with a contact time of so many milliseconds."""
    seconds = 1e-3 * milliseconds
    return kd.collide(
        leg.posture(POSTURE.q), V, BALL, CONTACT, contact_time=seconds, tol=1e-11, **options
    )  # type: ignore[arg-type]


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
    for milliseconds in 10.0 / 4.0 ** np.arange(7):
        hit = through_time(milliseconds)
        apart = math.hypot(*(hit.impulse - INSTANT.impulse))
        slope = f"{math.log(apart / last, 32):.3f}" if last else ""
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
        "energy lost",
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


def causes() -> None:
    """Print the effect of gravity and of joint torques, at the stiffness of 10 ms."""
    model = LEG.model
    model.gravity = pin.Motion.Zero()
    still = kd.Leg.from_model(model, LEG.frame)
    usual = through_time(10.0)
    pushed = through_time(10.0, torque=0.1 * np.sign(V) * LEG.effort_limit)
    print(
        "| during the contact | contact [ms] | impulse | ball speed |\n| --- | ---: | ---: | ---: |"
    )
    for name, hit in (
        ("no joint torque", usual),
        ("no joint torque, no gravity", through_time(10.0, still)),
        ("every joint with a tenth of its torque limit, along its motion", pushed),
    ):
        impulse = math.hypot(*hit.impulse) / math.hypot(*INSTANT.impulse) - 1
        speed = float(hit.ball_after.speed) / float(INSTANT.ball_after.speed) - 1
        print(f"| {name} | {1e3 * hit.contact_time:.1f} | {impulse:+.1%} | {speed:+.1%} |")


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


def head_on(foot_speed: float, restitution: float = RESTITUTION, **options: object) -> kd.Collision:
    """Return the collision of the sliding foot with the inflated ball at rest."""
    contact = kd.Contact((1, 0, 0), restitution)
    return kd.collide(FOOT.posture([0.0]), [foot_speed], INFLATED, contact, **options)  # type: ignore[arg-type]


def peak_over_mean(hit: kd.Collision) -> float:
    """Return the peak of the force over its mean while it acts."""
    return hit.peak_force * hit.contact_time / math.hypot(*hit.impulse)


def by_pressure(foot_speed: float) -> dict[str, float]:
    """Return what the stiffness from pressure gives at a foot speed [m/s], in SI units."""
    hit = head_on(foot_speed, stiffness="pressure")
    after = hit.visible_contact_time - hit.contact_time
    return {
        "ball speed": float(hit.ball_after.speed),
        "contact time": hit.contact_time,
        "visible contact time": hit.visible_contact_time,
        "peak force": hit.peak_force,
        "deflection": hit.deflection,
        "contact distance": float(foot_displacement(hit)[0] + after * hit.v_after[0]),
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
    heading += ("contact distance [cm]",)
    print("| " + " | ".join(heading) + " |\n|" + " ---: |" * len(heading))
    for speed in (5.0, 10.0, 15.0, 20.0, 25.0, 30.0):
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
            f"{1e2 * row['contact distance']:.1f}",
        )
        print("| " + " | ".join(cells) + " |")


def against_measurements() -> None:
    """Print measured features of the contact beside both springs, with both dissipations."""
    kinds = [
        {"stiffness": "pressure"}, {"stiffness": "pressure", "dissipation": "hunt-crossley"},
        {}, {"dissipation": "hunt-crossley"},
    ]  # fmt: skip
    print("| feature | measured | pressure | pressure, `hunt-crossley` ", end="")
    print("| Hertz | Hertz, `hunt-crossley` |\n|" + " --- |" * 2 + " ---: |" * 4)
    rows: dict[tuple[str, str], list[str]] = {}
    for options in kinds:
        if "stiffness" not in options:  # the spring of a contact of 10 ms at 15 m/s
            usual = head_on(15.0, **options)
            options["stiffness"] = usual.force_model.stiffness
        slow, fast = (head_on(speed, **options) for speed in (9.1, 21.2))
        gain = float(fast.ball_after.speed) / 21.2
        peaks = [head_on(speed / gain, **options).peak_force for speed in MAXIMAL]
        found = {
            ("change of visible contact time, foot at 9.1 to 21.2 m/s", "-20 % (M1)"):
                f"{fast.visible_contact_time / slow.visible_contact_time - 1:z.0%}",
            ("change of contact distance, foot at 9.1 to 21.2 m/s", "+89 % (M1)"):
                f"{distance(fast) / distance(slow) - 1:+.0%}",
            ("visible contact time at 15 m/s [ms]", "9 to 14 (review in M3)"):
                f"{1e3 * head_on(15.0, **options).visible_contact_time:.1f}",
            ("peak over mean force, mean while the force acts", "1.97 (M3)"):
                f"{peak_over_mean(fast):.2f}",
            ("peak over mean force, mean of the visible contact", "1.97 (M3)"):
                f"{peak_over_mean(fast) * fast.visible_contact_time / fast.contact_time:.2f}",
            ("peak force, ball at 25.6 to 34.5 m/s [N]", "1610 to 2926 (M4)"):
                f"{peaks[0]:.0f} to {peaks[1]:.0f}",
            ("time of acceleration over visible contact", "about 0.75 (M5)"):
                f"{fast.contact_time / fast.visible_contact_time:.2f}",
        }  # fmt: skip
        for key, value in found.items():
            rows.setdefault(key, []).append(value)
    for (feature, measured), values in rows.items():
        print(f"| {feature} | {measured} | " + " | ".join(values) + " |")


def distance(hit: kd.Collision) -> float:
    """Return how far the foot moves while the contact is visible [m]."""
    return float(
        foot_displacement(hit)[0] + (hit.visible_contact_time - hit.contact_time) * hit.v_after[0]
    )


def two_masses(force: object, end: object) -> tuple[float, float, float]:
    """Return restitution, peak over mean force and share of the visible contact of a force.

    The force is a function of deflection and rate, for unit mass, stiffness and approach speed; the
    contact ends where the function `end` of them falls to 0.
    """

    def stop(_: float, y: Array) -> float:
        """Return what falls to 0 at separation."""
        return end(*y)  # type: ignore[operator,no-any-return]

    stop.terminal, stop.direction = True, -1  # type: ignore[attr-defined]
    found = solve_ivp(
        lambda _, y: [y[1], -force(*y)], (0.0, 60.0), [0.0, 1.0], events=stop,  # type: ignore[operator]
        rtol=1e-8, atol=1e-10, dense_output=True,
    )  # fmt: skip
    time, (left, rate) = found.t[-1], found.y[:, -1]
    forces = [force(*y) for y in found.sol(np.linspace(0.0, time, 801)).T]  # type: ignore[operator]
    share = time / (time + max(left, 0.0) / -rate)
    return -rate, max(forces) * time / (1.0 - rate), share


def dashpot(damping: float) -> tuple[float, float, float]:
    """Return `two_masses` of a linear spring and dashpot, until the force vanishes."""

    def force(d: float, rate: float) -> float:
        """Return the force."""
        return d + damping * rate

    return two_masses(force, force)


def viscoelastic(damping: float) -> tuple[float, float, float]:
    """Return `two_masses` of viscoelastic spheres, until the force vanishes."""

    def bracket(d: float, rate: float) -> float:
        """Return the force over the square root of the deflection."""
        return d + damping * rate

    return two_masses(lambda d, rate: math.sqrt(max(d, 0.0)) * bracket(d, rate), bracket)


def flores(restitution: float) -> tuple[float, float, float]:
    """Return `two_masses` of the damping of Flores et al. for a restitution."""
    damping = 1.6 * (1.0 - restitution) / restitution

    def force(d: float, rate: float) -> float:
        """Return the force."""
        return max(d, 0.0) ** 1.5 * max(1.0 + damping * rate, 0.0)

    return two_masses(force, lambda d, _: d + 1e-9)


def pulses() -> None:
    """Print peak over mean force and share of the visible contact, per dissipation and e."""
    restitutions = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    print("| spring and dissipation | " + " | ".join(f"e = {e}" for e in restitutions) + " |")
    print("| --- |" + " ---: |" * len(restitutions))
    for spring, stiffness in (("Hertz", 1e6), ("linear", "pressure")):
        for kind in ("walton-braun", "hunt-crossley"):
            cells = []
            for e in restitutions:
                hit = head_on(15.0, e, stiffness=stiffness, dissipation=kind)
                share = hit.contact_time / hit.visible_contact_time
                cells.append(f"{peak_over_mean(hit):.2f}, {share:.2f}")
            print(f"| {spring}, `{kind}` | " + " | ".join(cells) + " |")
    for name, model in (("Hertz, viscoelastic", viscoelastic), ("linear, dashpot", dashpot)):
        cells = []
        for e in restitutions:
            damping = brentq(lambda c, e=e, model=model: model(c)[0] - e, 1e-3, 3.0, xtol=1e-5)
            cells.append("{:.2f}, {:.2f}".format(*model(damping)[1:]))
        print(f"| {name} | " + " | ".join(cells) + " |")
    cells = ["{1:.2f}, {2:.2f} (e = {0:.2f})".format(*flores(e)) for e in restitutions]
    print("| Hertz, Flores | " + " | ".join(cells) + " |")


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
    print_random_kicks()
    print()
    causes()
    for table in (pulses, pressures, against_measurements):
        print()
        table()


if __name__ == "__main__":
    main()
