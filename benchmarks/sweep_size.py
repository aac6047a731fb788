"""Time a sweep as it grows: cost per posture, two processes beside one, memory of a huge grid.

    python benchmarks/sweep_size.py

Cost per posture is that of the impulse alone, one thread, the best of thirty runs below 1e8. The
processes fill a store with flight distances; the time of a small sweep is subtracted, so that their
start does not count. The store is in memory (/dev/shm) where the system has that, for they would
share one disk. Beside them stands what two reach that share nothing, the impulse alone without a
store: more this machine does not give. The grid of 1e9 postures keeps none of them and is stopped
on its way, so that only its memory counts.
"""

from __future__ import annotations

import math
import resource
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from shutil import rmtree

import numpy as np

import kickdyn as kd
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel_model import KernelModel
from kickdyn.sweeps.kernels import Kernel
from kickdyn.sweeps.sweep import sweep_chunks
from kickdyn.sweeps.sweep_kick import Kick

LEG, KICK = kd.Leg.human(), Kick(speed=12.0)
RANGES = ((-0.5, 1.5), (0.0, 2.4), (-0.3, 0.8))
CHUNK, SECONDS = 131_072, 20.0
WARM, STORED, ALONE = 1e6, 3e7, 1e7
MEMORY = Path("/dev/shm")


def grid(most: float) -> Grid:
    """Return a grid of about so many postures."""
    each = round(most ** (1 / 3))
    spans = zip(LEG.joint_names, RANGES, strict=True)
    return Grid({name: np.linspace(low, high, each) for name, (low, high) in spans})


def repeats(most: float) -> int:
    """Return how often a grid of that size is swept: small ones are soon over."""
    return min(30, max(1, int(3e7 / most)))


def per_posture(most: float) -> float:
    """Return the cost of a posture of a grid of that size [us]."""
    model, postures = KernelModel.of(LEG, KICK), grid(most)
    assert model is not None
    kernel, times = Kernel(model, LEG, postures), []
    for _ in range(repeats(most)):
        begin = time.process_time()
        for first in range(0, postures.size, CHUNK):
            kernel(first, min(CHUNK, postures.size - first), full=False)
        times.append((time.process_time() - begin) / postures.size * 1e6)
    return min(times)


def with_processes(count: int, folder: Path) -> tuple[float, float]:
    """Return postures per second of so many processes: into a store, and without one."""
    rates = []
    for size in (WARM, STORED):  # the difference does not count the start of the processes
        begin = time.perf_counter()
        kd.sweep(LEG, grid(size).axes, KICK, store=folder / f"{count}.zarr", workers=count)
        rates.append((time.perf_counter() - begin, grid(size).size))
        rmtree(folder / f"{count}.zarr")
    (short, few), (long, many) = rates
    with ProcessPoolExecutor(count, get_context("spawn")) as pool:
        list(pool.map(per_posture, [1e6] * count))
        begin = time.perf_counter()
        list(pool.map(per_posture, [ALONE] * count))
        alone = count * repeats(ALONE) * grid(ALONE).size / (time.perf_counter() - begin)
    return (many - few) / (long - short), alone


def huge() -> None:
    """Sweep a part of 1e9 postures and print what it took."""
    done, begin = 0, math.inf
    for chunk in sweep_chunks(LEG, grid(1e9).axes, KICK):
        begin = min(begin, time.monotonic())  # compiling does not count
        done += chunk.status.size
        if time.monotonic() - begin > SECONDS:
            break
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(
        f"grid of {grid(1e9).size:.0e}: {done / 1e6:.0f} million postures in, {most:.0f} MB at most"
    )


def main() -> None:
    """Print the figures."""
    per_posture(1e4)
    sizes = (1e4, 1e6, 1e8)
    costs = [per_posture(most) for most in sizes]
    print("postures  " + "  ".join(f"{most:.0e}" for most in sizes))
    print("us each   " + "  ".join(f"{cost:.4f}" for cost in costs)
          + f"   largest over smallest {max(costs) / min(costs):.2f}")  # fmt: skip
    subprocess.run([sys.executable, __file__, "huge"], check=True)
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        rates = [with_processes(count, Path(folder)) for count in (1, 2)]
    for what, one, two in zip(("stored", "alone"), *rates, strict=True):
        print(f"{what}: 1 process {one / 1e6:.2f}, 2 processes {two / 1e6:.2f} million postures/s, "
              f"ratio {two / one:.2f}")  # fmt: skip


if __name__ == "__main__":
    huge() if sys.argv[1:] == ["huge"] else main()
