"""Coverage of the regions of `kd.identify`: `python benchmarks/identification_coverage.py`.

Each synthetic flight (5 to 35 m/s, spins up to 100 rad/s, 25 to 240 Hz, noise of 2 mm to 3 cm, a
gap, 5 % outliers) is fitted with spin and drag unknown. Printed is the share of flights whose truth
lies in the 95 % region of all ten unknowns: that in which the sum of squares, that of the spin's
usual size included, exceeds the least one by less than the 95 % quantile of chi-squared. Arguments:
the number of flights, 300 without it, and the first seed.
"""

import sys

import numpy as np
from scipy.stats import chi2

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.identification.identify import SPIN_SPREAD

BALL = kd.Ball()


def flight(seed: int) -> "tuple[kd.Track, np.ndarray, np.ndarray, float]":
    """Return a noisy track, its true positions, the true spin and the true drag coefficient."""
    rng = np.random.default_rng(seed)
    speed, up, aside = rng.uniform(5, 35), rng.uniform(0.1, 0.8), rng.uniform(0, 6.3)
    level = speed * np.cos(up)
    velocity = (level * np.cos(aside), level * np.sin(aside), speed * np.sin(up))
    spin = rng.normal(size=3)
    spin *= rng.uniform(0, 100) / np.linalg.norm(spin)
    cd = rng.uniform(0.15, 0.4)
    path = kd.fly(kd.BallState(velocity=velocity, spin=spin), BALL, kd.Air(drag=constant(cd)))
    times = np.arange(0.0, min(path.duration, 2.0), 1 / rng.uniform(25, 240))
    kept = np.ones(len(times), dtype=bool)
    first = rng.integers(1, max(len(times) // 2, 2))
    kept[first : first + len(times) // 10] = False  # a gap
    times = times[kept]
    true = path.sample(times).position
    noisy = true + rng.normal(0.0, rng.uniform(0.002, 0.03), true.shape)
    wrong = rng.random(len(times)) < 0.05
    noisy[wrong] += rng.normal(0.0, 0.5, (int(wrong.sum()), 3))
    return kd.Track(times, noisy), true, spin, cd


def main(count: int = 300, seed: int = 0) -> None:
    """Print the shares."""
    inside, intervals = [], []
    for number in range(seed, seed + count):
        track, true, spin, cd = flight(number)
        if len(track) < 12:
            continue
        found = kd.identify(track, BALL)
        miss = (true - track.positions)[found.used]
        excess = float((miss**2).sum() - (found.residuals[found.used] ** 2).sum())
        usual = float(spin @ spin - found.launch.spin @ found.launch.spin) / SPIN_SPREAD**2
        inside.append(excess / found.noise**2 + usual < chi2.ppf(0.95, len(found.names)))
        if "drag" in found.values:
            intervals.append(abs(found.values["drag"] - cd) < 1.96 * found.deviations["drag"])
        print(f"\r{number - seed + 1} of {count}", end="", file=sys.stderr, flush=True)
    print(f"\ntruth in the 95 % region: {np.mean(inside):.3f} of {len(inside)} flights")
    print(f"drag within 1.96 deviations: {np.mean(intervals):.3f} of {len(intervals)}")


if __name__ == "__main__":
    main(*(int(text) for text in sys.argv[1:3]))
