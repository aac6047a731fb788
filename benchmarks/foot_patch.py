"""Kicks beside the centre of a ball with a strip of a foot, and a model of them that was given up.

    python benchmarks/foot_patch.py [FOLDER]

prints the table of docs/explanation/inflated-ball.md on spin over the offset, and draws its figure
into a folder. A strip of a foot of 1.95 kg moves at 17 m/s along its normal and does not turn.
"""

import math
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
from compliance import FOOT_MASS, INFLATED
from scipy.integrate import solve_ivp

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.impact.patch_contact import STIFFNESS_RATIO, FootPatch, overlap

SPEED, WIDTH = 17.0, 0.08
"""Of the foot [m/s], and of the strip [m]."""

OFFSETS = (0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06)
"""Of the ball's centre from the middle of the strip [m]; beyond, the plane of the strip comes near
the centre of the ball."""


def sliding_foot(mass: float = FOOT_MASS) -> kd.Posture:
    """Return a foot of a mass [kg] that only translates."""
    model, parent = pin.Model(), 0
    for kind in (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ()):
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), f"rail{parent}")
        body = pin.Inertia(mass if parent == 3 else 1e-6, np.zeros(3), 1e-3 * np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return kd.Leg.from_model(model, "toe").posture(np.zeros(3))


FOOT = sliding_foot()


def kicked(
    offset: float,
    friction: float,
    width: float = WIDTH,
    angle: float = 0.0,
    grip: float = STIFFNESS_RATIO,
) -> kd.Collision:
    """Return a kick whose path is at an angle to the normal of the strip [rad]."""
    v = SPEED * np.array([math.cos(angle), math.sin(angle), 0.0])
    contact = kd.Contact((1, 0, 0), "inflated", friction)
    patch = FootPatch(width, offset, grip=grip)
    return kd.collide(FOOT, v, INFLATED, contact, model=patch, tol=1e-7)


def spin(offset: float, friction: float, width: float = WIDTH, **options: float) -> float:
    """Return the size of the ball's spin [rad/s]."""
    return math.hypot(*kicked(offset, friction, width, **options).ball_after.spin)


def given_up(offset: float) -> tuple[float, float]:
    """Return spin [rad/s] and created energy over the energy before, of the model given up.

    The pressure on the patch turns the ball about its centre, as if it acted on a rigid body at the
    middle of the patch. There is no friction, no loss, and the pressure is constant.
    """
    m, radius, half = INFLATED.mass, INFLATED.radius, 0.5 * WIDTH

    def rates(_: float, y: Array) -> list[float]:
        deflection, beside, _, foot, foot_across, ball, across, _ = y
        shape = overlap(deflection, beside, radius, half)
        force, edge = 80e3 * shape.area, -80e3 * shape.across
        # the middle of the patch: the integral of x over it, from the half chords at its edges
        square = deflection * (2.0 * radius - deflection)
        low, high = (min(max(side * half - beside, -1.0), 1.0) for side in (-1.0, 1.0))
        cubes = [max(square - x * x, 0.0) ** 1.5 for x in (low, high)]
        torque = -80e3 * (2.0 / 3.0) * (cubes[0] - cubes[1])
        return [foot - ball, across - foot_across, 0.0, -force / FOOT_MASS, -edge / FOOT_MASS,
                force / m, edge / m, torque / INFLATED.inertia]  # fmt: skip

    def apart(_: float, y: Array) -> float:
        return float(overlap(y[0], y[1], radius, half).volume - 1e-12)

    apart.terminal, apart.direction = True, -1  # type: ignore[attr-defined]
    start = (1e-6, offset, 0.0, SPEED, 0.0, 0.0, 0.0, 0.0)
    end = solve_ivp(rates, (0.0, 0.1), start, events=apart, rtol=1e-8, atol=1e-10, max_step=1e-4).y[
        :, -1
    ]
    *_, foot, foot_across, ball, across, turn = end
    energy = 0.5 * FOOT_MASS * (foot**2 + foot_across**2) + 0.5 * m * (ball**2 + across**2)
    energy += 0.5 * INFLATED.inertia * turn**2
    return abs(turn), energy / (0.5 * FOOT_MASS * SPEED**2) - 1.0


def print_table() -> None:
    """Print spins over the offset in Markdown."""
    heading = ("offset [mm]", "mu = 0", "mu = 0.4", "mu = 1", "ball, mu = 0", "deflection")
    heading += ("given up, mu = 0", "energy created")
    print("| " + " | ".join(heading) + " |\n|" + " ---: |" * len(heading))
    for offset in OFFSETS:
        hit = kicked(offset, 0.0)
        tried, created = given_up(offset)
        row = [f"{1e3 * offset:.0f}", *(f"{spin(offset, mu):.0f} rad/s" for mu in (0.0, 0.4, 1.0))]
        row += [f"{hit.ball_after.speed:.1f} m/s", f"{hit.flattening / INFLATED.radius:.2f} R"]
        row += [f"{tried:.0f} rad/s", f"{abs(created):.0%}"]
        print("| " + " | ".join(row) + " |")


def draw(file: Path) -> None:
    """Draw the spin over the offset."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
    offsets = np.linspace(0.0, OFFSETS[-1], 25)
    for k, mu in enumerate((0.0, 0.4, 1.0)):
        axes.plot(1e3 * offsets, [spin(x, mu) for x in offsets], f"C{k}", label=f"mu = {mu:g}")
    for width, style in ((0.06, ":"), (0.1, "--")):
        axes.plot(
            1e3 * offsets, [spin(x, 0.0, width) for x in offsets], "C0" + style,
            label=f"mu = 0, strip of {1e3 * width:.0f} mm",
        )  # fmt: skip
    axes.plot(
        1e3 * offsets, [given_up(x)[0] for x in offsets], "0.6",
        label="given up, creates energy, mu = 0",
    )  # fmt: skip
    axes.set(xlabel="offset [mm]", ylabel="spin [rad/s]", xlim=(0, None), ylim=(0, None))
    axes.legend(frameon=False)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def main() -> None:
    """Print the table and draw the figure."""
    print_table()
    if len(sys.argv) > 1:
        draw(Path(sys.argv[1]) / "inflated-spin.png")


if __name__ == "__main__":
    main()
