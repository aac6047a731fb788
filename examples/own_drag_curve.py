"""A drag coefficient of your own, as a function of Reynolds number and spin parameter."""

import kickdyn as kd

ball = kd.Ball()
launch = kd.BallState(velocity=(24, 0, 9), spin=(0, -30, 0))


def rough_ball(reynolds: float, spin_parameter: float) -> float:
    """Return a coefficient that falls from 0.5 to 0.25 around Re = 1e5 and grows with the spin."""
    crisis = 1 / (1 + (reynolds / 1.0e5) ** 6)
    return 0.25 + 0.25 * crisis + 0.1 * spin_parameter


flights = {
    "vacuum": kd.fly(launch, ball),
    "shipped model": kd.fly(launch, ball, kd.Air()),
    "own curve": kd.fly(launch, ball, kd.Air(drag=rough_ball)),
    "constant 0.47": kd.fly(launch, ball, kd.Air(drag=0.47)),
}
for name, flight in flights.items():
    print(f"{name:15} {flight.range:6.2f} m, {flight.duration:.2f} s")
    for warning in flight.warnings:
        print(f"  {warning}")

kd.page(flights, caption="24 m/s ahead, 9 m/s up, back spin").save("own_drag_curve.html")
