"""Random scenes to a tolerance against everything modelled: within it, and how much faster.

    python benchmarks/simulate.py [number of scenes]

Each scene is timed at every tolerance right after everything, in one thread.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import kickdyn as kd
from kickdyn.accuracy.random_scenes import random_scene

TOLERANCES = (0.01, 0.05, 0.2, 1.0)


def timed(scene: kd.Scene, tolerance: float | None) -> tuple[kd.Simulation, float]:
    """Return the answer and the seconds it took: where those are few, the best of three."""
    best = float("inf")
    for _ in range(3):
        began = time.perf_counter()
        answer = kd.simulate(scene, tolerance)
        best = min(best, time.perf_counter() - began)
        if best > 0.05:
            break
    return answer, best


def main(number: int = 300) -> None:
    """Print the table."""
    rng, rows, refused = np.random.default_rng(6), [], 0
    timed(random_scene(rng, contact_time=None), 1.0)  # loads what is loaded late
    while len(rows) < number:
        scene = random_scene(rng)
        try:
            reference, all_seconds = timed(scene, None)
        except kd.KickdynError:  # no impact, or a ball that is pressed into the ground
            refused += 1
            continue
        slow = scene.contact_time is not None
        row: list[float] = [slow, all_seconds, reference.evaluations]
        for tolerance in TOLERANCES:
            answer, seconds = timed(scene, tolerance)
            moved = float(np.linalg.norm(answer.end.position - reference.end.position))
            bound = answer.error + reference.numerical_error + 1e-12  # rounding
            row += [moved / tolerance, moved / bound, all_seconds / seconds]
            row += [reference.evaluations / max(answer.evaluations, 1)]
        rows.append(row)
    table = np.array(rows)
    slow = table[:, 0] == 1
    print(f"{number} scenes ({refused} refused), {slow.sum()} with a contact that takes time\n")
    print("| tolerance [m] | within it | within its error | largest error / tolerance |", end="")
    print(" times as fast, median | an instant | takes time | evaluations, median |")
    print("|---:|---:|---:|---:|---:|---:|---:|---:|")
    for i, tolerance in enumerate(TOLERANCES):
        used, claimed, faster, fewer = table[:, 3 + 4 * i : 7 + 4 * i].T
        cells = [f"{tolerance:g}", f"{(used <= 1).mean():.1%}", f"{(claimed <= 1).mean():.1%}"]
        cells += [f"{used.max():.2f}"]
        cells += [f"{np.median(part):.1f}" for part in (faster, faster[~slow], faster[slow])]
        cells.append(f"1/{np.median(fewer[fewer > 0]):.1f}")
        print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
