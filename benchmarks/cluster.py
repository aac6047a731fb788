"""Time a sweep on one and on two processes of dask.distributed, and work out larger ones.

    python benchmarks/cluster.py [number of postures]

prints what the section "On a cluster" of docs/how-to/sweeps.md has. The processes are started, and
have compiled or loaded the kernel, before the time is taken. Times are of the clock: nothing else
may run.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from distributed import Client, LocalCluster

import kickdyn as kd
from kickdyn.sweeps.chunk_solver import CHUNK

LEG, KICK = kd.Leg.human(), kd.Kick(speed=7.0)
KEPT = ["ball_speed", "carry"]


def grid(count: int) -> dict[str, np.ndarray]:
    """Return about `count` postures."""
    side = round(count ** (1 / 3))
    bounds = {"hip": (-10, 40), "knee": (0, 60), "ankle": (-20, 50)}
    return {name: np.radians(np.linspace(*ends, side)) for name, ends in bounds.items()}


def measure(workers: int, count: int, folder: Path) -> tuple[float, int, int, int]:
    """Return seconds, postures, bytes and files of a sweep by so many processes."""
    options = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(**options) as cluster, Client(cluster) as client:
        executor = client.get_executor()
        for k in range(2):  # every process loads the kernel
            kd.sweep(LEG, grid(4e6), KICK, store=folder / f"{workers}-{k}.zarr",
                     variables=KEPT, executor=executor)  # fmt: skip
        store, began = folder / f"{workers}.zarr", time.perf_counter()
        data = kd.sweep(LEG, grid(count), KICK, store=store, variables=KEPT, executor=executor)
        seconds = time.perf_counter() - began
    sizes = [file.stat().st_size for file in store.rglob("*") if file.is_file()]
    return seconds, data.status.size, sum(sizes), len(sizes)


def main(count: float = 6e7) -> None:
    """Print the times and what larger sweeps cost."""
    with tempfile.TemporaryDirectory() as folder:
        times = []
        for workers in (1, 2):
            seconds, size, volume, files = measure(workers, count, Path(folder))
            times.append(seconds / size)
            print(f"{workers} workers: {size:,} postures in {seconds:.1f} s, {files} files, "
                  f"{volume / size:.2f} bytes a posture")  # fmt: skip
    print(f"two workers are {times[0] / times[1]:.2f} times as fast as one")
    for postures in (1e10, 1e12):
        chunks = postures / CHUNK
        print(f"{postures:g} postures: {postures * times[0] / 3600:,.1f} hours of one worker, "
              f"{postures * volume / size / 1e9:,.0f} GB, {chunks * (len(KEPT) + 1):,.0f} files in "
              f"{chunks:,.0f} chunks")  # fmt: skip


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
