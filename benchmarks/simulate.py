"""Random scenes to a tolerance against everything modelled: within it, and how much faster.

    python benchmarks/simulate.py [number of scenes of each kind]

Usual scenes are soccer balls; wide ones have balloons and beach balls, every drag and lift model,
brief contacts, planes in the way of what bounces, and wind. An answer is within its error if its
end is no farther from the reference than the errors of both add up to. Paths without an end
(`blown`, `aloft`) have an infinite error and are counted apart. Each scene is timed without and at
every tolerance in turn, in one thread, by the processor's time.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import kickdyn as kd

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from random_scenes import random_scene, wide_scene

TOLERANCES = (0.01, 0.1, 1.0)


def in_turn(scene: kd.Scene) -> tuple[list[kd.Simulation], list[float]]:
    """Return the answers without and at every tolerance, and their least times [s].

    Answers that take little time are computed up to 15 times, in turn, because what else the
    machine does only adds.
    """
    asked, least, done = (None, *TOLERANCES), [math.inf] * 4, 0
    answers: list[kd.Simulation] = []
    while done < 3 or (done < 15 and done * sum(least) < 0.2):
        answers, done = [], done + 1
        for k, tolerance in enumerate(asked):
            began = time.process_time()
            answers.append(kd.simulate(scene, tolerance))
            least[k] = min(least[k], time.process_time() - began)
            if math.isinf(answers[0].numerical_error):
                return answers, least
    return answers, least


def measure(made: Callable[[np.random.Generator], kd.Scene], number: int) -> None:
    """Print the table of one kind of scenes."""
    rng, rows, refused, endless = np.random.default_rng(6), [], 0, 0
    while len(rows) < number:
        scene = made(rng)
        try:
            (reference, *answers), (all_seconds, *times) = in_turn(scene)
        except kd.KickdynError:  # no impact, or a ball that is pressed into the ground
            refused += 1
            continue
        known = reference.numerical_error
        if math.isinf(known):
            answers = [kd.simulate(scene, tolerance) for tolerance in TOLERANCES]
            assert all(answer.status == reference.status for answer in answers)
            endless += 1
            continue
        row: list[float] = [scene.is_compliant]
        for tolerance, answer, seconds in zip(TOLERANCES, answers, times, strict=True):
            moved = float(np.linalg.norm(answer.end.position - reference.end.position))
            bound = answer.error + known + 1e-12  # rounding
            row += [moved / tolerance, moved / bound, all_seconds / seconds]
            row += [reference.evaluations / max(answer.evaluations, 1)]
        rows.append(row)
    table = np.array(rows)
    slow = table[:, 0] == 1
    print(f"{number} {made.__name__}s, {slow.sum()} with a contact that takes time; besides,")
    print(f"{refused} refused and {endless} without an end\n")
    print("| tolerance [m] | within it | within its error | largest error / tolerance |", end="")
    print(" times as fast, an instant | takes time | slowest of all | evaluations, takes time |")
    print("|---:|---:|---:|---:|---:|---:|---:|---:|")
    for i, tolerance in enumerate(TOLERANCES):
        used, claimed, faster, fewer = table[:, 1 + 4 * i : 5 + 4 * i].T
        cells = [f"{tolerance:g}", f"{(used <= 1).mean():.1%}", f"{(claimed <= 1).mean():.1%}"]
        cells += [f"{used.max():.2f}"]
        cells += [f"{np.median(part):.1f}" for part in (faster[~slow], faster[slow])]
        cells += [f"{faster.min():.2f}", f"1/{np.median(fewer[slow]):.1f}"]
        print("| " + " | ".join(cells) + " |")
    print(flush=True)


def main(number: int = 300) -> None:
    """Print both tables."""
    in_turn(random_scene(np.random.default_rng(0), contact_time=None))  # loads what is late
    for made in (random_scene, wide_scene):
        measure(made, number)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
