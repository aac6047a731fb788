"""Print the spin of kicks beside the ball's centre by two models without fitted parameters.

    python benchmarks/spin_offset.py

prints the table of "Spin without friction" in docs/explanation/impact.md. A foot of 1.95 kg
(Peacock, Ball & Taylor 2017, by momentum) moves along x at 17 m/s, which gives the ball the 24 m/s
of measured free kicks (Passmore et al. 2012); the offset is that of its path from the ball's
centre.
"""

import math

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import kickdyn as kd

BALL = kd.Ball(pressure=80e3)
FOOT, SPEED, RESTITUTION = 1.95, 17.0, 0.7


def sliding_foot() -> kd.Leg:
    """Return a foot that only translates."""
    model, parent = pin.Model(), 0
    for kind in (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ()):
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), f"rail{parent}")
        mass = FOOT if parent == 3 else 1e-6
        body = pin.Inertia(mass, np.zeros(3), 1e-3 * np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return kd.Leg.from_model(model, "toe")


def rigid_impact(offset: float, friction: float) -> kd.Impact:
    """Return the impact at one point of a rigid ball, law `stronge`."""
    across = offset / BALL.radius
    contact = kd.Contact((math.sqrt(1.0 - across**2), -across, 0.0), RESTITUTION, friction)
    posture = sliding_foot().posture(np.zeros(3))
    return kd.strike(posture, [SPEED, 0.0, 0.0], BALL, contact, law="stronge")


def rigid_spin(offset: float, friction: float) -> float:
    """Return the spin by one point of contact on a rigid ball [rad/s]."""
    return math.hypot(*rigid_impact(offset, friction).ball_after.spin)


def patch(radius: float, low: float, high: float) -> tuple[float, float]:
    """Return area and centroid of a disc between two parallel lines."""
    low, high = (min(max(edge, -radius), radius) for edge in (low, high))
    if high <= low:
        return 0.0, 0.0
    halves = [math.sqrt(max(radius**2 - y * y, 0.0)) for y in (low, high)]
    areas = [
        y * half + radius**2 * math.asin(y / radius)
        for y, half in zip((low, high), halves, strict=True)
    ]
    area = areas[1] - areas[0]
    return area, 2.0 / 3.0 * (halves[0] ** 3 - halves[1] ** 3) / area if area else 0.0


def patch_spin(offset: float, width: float, friction: float = 0.0) -> tuple[float, float]:
    """Return spin [rad/s] and largest deflection over radius, by pressure on part of the circle.

    The foot is a flat strip of a width [m] across its path. The gauge pressure acts on that part of
    the flattened circle that the strip covers, at its centroid; no energy is lost.
    """
    radius, ball, pressure = BALL.radius, BALL, BALL.pressure
    assert pressure is not None
    near = max(offset - 0.5 * width, 0.0)
    first = radius - math.sqrt(radius**2 - near**2)

    def rates(_: float, y: np.ndarray) -> list[float]:
        """Return rates of deflection, of speeds of foot and ball, and of the ball's spin."""
        deflection, foot, along, across, spin = y
        circle = math.sqrt(max(2.0 * radius * deflection - deflection**2, 0.0))
        area, centroid = patch(circle, offset - 0.5 * width, offset + 0.5 * width)
        force, lever = pressure * area, radius - deflection
        rub = -friction * force * math.tanh((across - spin * lever) / 0.05)
        turn = (-lever * rub - centroid * force) / ball.inertia
        return [foot - along, -force / FOOT, force / ball.mass, rub / ball.mass, turn]

    def apart(_: float, y: np.ndarray) -> float:
        """Return what falls to 0 at separation."""
        return float(y[0] - first)

    apart.terminal, apart.direction = True, -1  # type: ignore[attr-defined]
    start = [first, SPEED, 0.0, 0.0, 0.0]
    found = solve_ivp(rates, (0.0, 0.2), start, events=apart, rtol=1e-8, atol=1e-9, max_step=1e-3)
    return abs(float(found.y[4, -1])), float(found.y[0].max()) / radius


def main() -> None:
    """Print the table."""
    heading = ("offset [mm]", "rigid, mu = 0", "mu = 0.4", "mu = 1")
    heading += ("strip of 60 mm, mu = 0", "80 mm", "100 mm", "100 mm, mu = 1")
    print("| " + " | ".join(heading) + " |\n|" + " ---: |" * len(heading))
    for offset in (0.02, 0.04, 0.06, 0.08, 0.1):
        cells = [f"{1e3 * offset:.0f}"]
        cells += [f"{rigid_spin(offset, friction):.0f}" for friction in (0.0, 0.4, 1.0)]
        for width, friction in ((0.06, 0.0), (0.08, 0.0), (0.1, 0.0), (0.1, 1.0)):
            spin, deepest = patch_spin(offset, width, friction)
            cells.append(f"{spin:.0f} ({deepest:.1f} R)")
        print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
