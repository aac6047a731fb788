"""Coverage of the drag coefficient of a whole track: `python benchmarks/track_drag.py`.

Each synthetic track has six kicks of 9 to 26 m/s with spins up to 60 rad/s, each with a bounce,
sampled at 50 Hz with noise of 3 to 15 mm. It is cut by `kd.segments`, and its flights are fitted,
as by `kickdyn identify`. Printed is how often the true mean lies in the 95 % interval of Student's
t distribution about the mean over the flights: for one drag coefficient of 0.2 in all flights; for
the same with smoothed noise; and for coefficients with a standard deviation of 0.03, where each
of twelve kicks ends before its bounce, so that no two flights share a coefficient. Arguments: the
number of tracks of each kind, 24 without it, and the first seed.
"""

import sys

import numpy as np
from scipy.stats import t as student

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.cli.identify_command import SHORTEST
from kickdyn.identification.identification_result import mean_over_flights

BALL = kd.Ball()
GROUND = kd.Ground(surface=kd.Surface("test", 0.7, 0.4, 0.8))
DRAG, RATE, SMOOTHED = 0.2, 50.0, 5


def synthetic_track(seed: int, scatter: float, smoothed: bool) -> kd.Track:
    """Return a noisy track of kicks; with a scatter of the drag coefficient without bounces."""
    rng = np.random.default_rng(seed)
    start, position = 0.0, np.array([0.0, 0.0, BALL.radius])
    times, points = [], []
    for _ in range(12 if scatter else 6):
        speed, up, aside = rng.uniform(9, 26), rng.uniform(0.15, 0.7), rng.uniform(0, 6.3)
        level = speed * np.cos(up)
        velocity = (level * np.cos(aside), level * np.sin(aside), speed * np.sin(up))
        spin = rng.normal(size=3)
        spin *= rng.uniform(0, 60) / np.linalg.norm(spin)
        kick = kd.BallState(position, velocity, spin)
        course = kd.follow(kick, BALL, kd.Air(drag=constant(rng.normal(DRAG, scatter))), GROUND)
        share, more = rng.uniform(0.7, 0.95), rng.uniform(0.3, 1.2)
        bounce = float(course.bounces[0].time)
        end = share * bounce if scatter else min(bounce + more, course.duration)
        moments = np.arange(0.0, end, 1.0 / RATE)
        times.append(start + moments)
        points.append(course.sample(moments).position)
        position = np.maximum(points[-1][-1], (-np.inf, -np.inf, BALL.radius))
        start = times[-1][-1] + 1.0 / RATE
    true = np.concatenate(points)
    noise = rng.normal(0.0, rng.uniform(0.003, 0.015), true.shape)
    if smoothed:
        kernel = np.ones(SMOOTHED) / SMOOTHED**0.5
        noise = np.apply_along_axis(lambda column: np.convolve(column, kernel, "same"), 0, noise)
    return kd.Track(np.concatenate(times), true + noise)


def main(count: int = 24, seed: int = 0) -> None:
    """Print the shares."""
    kinds = {"one coefficient": (0.0, False), "smoothed": (0.0, True), "scatter": (0.03, False)}
    for name, (scatter, smoothed) in kinds.items():
        rows = []
        for number in range(seed, seed + count):
            track = synthetic_track(number, scatter, smoothed)
            flights = kd.segments(track, BALL, GROUND).flights
            fits = [kd.identify(one, BALL) for one in flights if one.duration >= SHORTEST]
            found = mean_over_flights(fits, "drag")
            if found is None:
                continue
            reach = float(student.ppf(0.975, found.flights - 1)) * found.deviation
            rows.append((found.mean - DRAG, reach, found.deviation, found.scatter, found.flights))
            print(f"\r{name}: {number - seed + 1} of {count}", end="", file=sys.stderr, flush=True)
        miss, reach, deviation, spread, flights = np.array(rows).T
        print(
            f"\n{name}: in the interval {np.mean(np.abs(miss) < reach):.2f} of {len(rows)} tracks, "
            f"rms error {np.sqrt(np.mean(miss**2)):.4f}, "
            f"root mean square of the standard error {np.sqrt(np.mean(deviation**2)):.4f}, "
            f"median scatter {np.median(spread):.4f}, flights {flights.mean():.1f}"
        )


if __name__ == "__main__":
    main(*(int(text) for text in sys.argv[1:3]))
