"""Time a sweep as a user meets it: compiled for the first time, into stores, and as it grows.

    python benchmarks/sweep_size.py

The first sweep and the first flights run in new processes that find no machine code on the disk;
what the same takes once more is subtracted from the first sweep. Stores have 9,548,661 postures
with flights and all variables, and everything is compiled. Beside the store on the disk stands a
plain file of as many bytes; the times of both include their fsync. Cost per posture is that of the
impulse alone, one thread, the best of thirty runs below 1e8. The grid of 1e9 postures keeps none of
them and is stopped on its way, so that only its memory counts.
"""

from __future__ import annotations

import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

import kickdyn as kd
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel import Kernel, KernelModel
from kickdyn.sweeps.sweep import sweep_chunks
from kickdyn.sweeps.sweep_kick import Kick

LEG, KICK = kd.Leg.human(), Kick(speed=12.0)
RANGES = ((-0.5, 1.5), (0.0, 2.4), (-0.3, 0.8))
HALF_DEGREES = {"hip": (-30, 90), "knee": (0, 140), "ankle": (-20, 50)}
CHUNK, SECONDS, ROUNDS = 131_072, 20.0, 3
MEMORY = Path("/dev/shm")


def grid(most: float) -> Grid:
    """Return a grid of about so many postures."""
    each = round(most ** (1 / 3))
    spans = zip(LEG.joint_names, RANGES, strict=True)
    return Grid({name: np.linspace(low, high, each) for name, (low, high) in spans})


def seconds(function: Callable[[], object]) -> float:
    """Return what a call takes [s]."""
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def first_sweep() -> None:
    """Print what the first sweep of a million postures compiles [s]."""
    once, again = (seconds(lambda: kd.sweep(LEG, grid(1e6).axes, KICK)) for _ in range(2))
    print(f"first sweep of 1e6 postures: compiles for {once - again:.1f} s, then {again:.2f} s")


def first_flights() -> None:
    """Print what the first flights of a thousand balls take [s]."""
    draw = np.random.default_rng(0).uniform((5, -5, 5), (30, 5, 20), (1000, 3))
    once, again = (
        seconds(lambda: kd.fly_many(kd.BallState(velocity=draw), kd.Ball(), kd.Air()))
        for _ in range(2)
    )
    print(f"first flights of 1,000 balls: {once:.1f} s, then {again * 1e3:.1f} ms")


def synced(folder: Path) -> int:
    """Let every file of a folder reach the disk; return their size [bytes]."""

    def sync(file: Path) -> int:
        """Let a file reach the disk; return its size [bytes]."""
        with file.open("rb+") as opened:
            os.fsync(opened.fileno())
        return file.stat().st_size

    with ThreadPoolExecutor(16) as pool:  # one after the other, they take ten times as long
        return sum(pool.map(sync, (file for file in folder.rglob("*") if file.is_file())))


def stored(place: Path | None, **how: int) -> tuple[float, float, int, int]:
    """Return seconds, processor seconds, postures and bytes of a store, the best of `ROUNDS`."""
    axes = {
        name: np.radians(np.arange(2 * low, 2 * high + 1) / 2)
        for name, (low, high) in HALF_DEGREES.items()
    }
    best = math.inf, math.inf
    for _ in range(ROUNDS):
        with tempfile.TemporaryDirectory(dir=place) as folder:
            begin, used = time.perf_counter(), time.process_time()
            kd.sweep(LEG, axes, KICK, store=Path(folder) / "sweep.zarr", **how)
            size = synced(Path(folder))
            best = min(best, (time.perf_counter() - begin, time.process_time() - used))
    return *best, Grid(axes).size, size


def plain_write(size: int) -> float:
    """Return what a plain file of so many bytes takes on the disk, the best of `ROUNDS` [s]."""
    block, times = os.urandom(1 << 22), []
    for _ in range(ROUNDS):
        with tempfile.NamedTemporaryFile() as file:
            begin = time.perf_counter()
            for _ in range(-(-size // len(block))):
                file.write(block)
            file.flush()
            os.fsync(file.fileno())
            times.append(time.perf_counter() - begin)
    return min(times)


def stores() -> None:
    """Print rates of sweeps into stores in memory and on the disk."""
    kd.sweep(LEG, grid(1e6).axes, KICK)  # compiles, or reads what is compiled
    memory = MEMORY if MEMORY.is_dir() else None
    cases: tuple[dict[str, int], ...] = ({"threads": 1}, {"threads": 2}, {})
    for how in cases:
        took, used, postures, size = stored(memory, **how)
        name = " ".join(f"{count} {what}" for what, count in how.items()) or "default"
        print(f"store in memory, {name}: {took:.2f} s, {postures / took / 1e6:.2f} million "
              f"postures/s, processor {used:.2f} s, {size / postures:.1f} bytes each")  # fmt: skip
    on_disk, _, _, size = stored(None)
    plain = plain_write(size)
    print(f"store on the disk: {on_disk:.2f} s; in memory {took:.2f} s; a plain file of as many "
          f"bytes {plain:.2f} s ({size / plain / 1e6:.0f} MB/s); ratio to the longer of the two "
          f"{on_disk / max(took, plain):.2f}")  # fmt: skip


def per_posture(most: float) -> float:
    """Return the cost of a posture of a grid of that size [us]."""
    model, postures = KernelModel.of(LEG, KICK), grid(most)
    assert model is not None
    kernel, times = Kernel(model, LEG, postures, machine_code=True), []
    for _ in range(min(30, max(1, int(3e7 / most)))):  # small ones are soon over
        begin = time.process_time()
        for first in range(0, postures.size, CHUNK):
            kernel(first, min(CHUNK, postures.size - first), joint_impulses=False)
        times.append((time.process_time() - begin) / postures.size * 1e6)
    return min(times)


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
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start")
    for part in ("first_sweep", "first_flights"):
        with tempfile.TemporaryDirectory() as empty:
            cold = {**os.environ, "NUMBA_CACHE_DIR": empty}
            subprocess.run([sys.executable, __file__, part], check=True, env=cold)
    stores()
    per_posture(1e4)
    sizes = (1e4, 1e6, 1e8)
    costs = [per_posture(most) for most in sizes]
    print("postures  " + "  ".join(f"{most:.0e}" for most in sizes))
    print("us each   " + "  ".join(f"{cost:.4f}" for cost in costs)
          + f"   largest over smallest {max(costs) / min(costs):.2f}")  # fmt: skip
    subprocess.run([sys.executable, __file__, "huge"], check=True)
    print(f"load {os.getloadavg()[0]:.1f} at the end")


PARTS = {"first_sweep": first_sweep, "first_flights": first_flights, "stores": stores, "huge": huge}

if __name__ == "__main__":
    PARTS[sys.argv[1]]() if sys.argv[1:] else main()
