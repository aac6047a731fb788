"""Kill a sweep at random moments, and let two processes fill one store: is anything lost or wrong?

    python benchmarks/store_faults.py [KILLS]

A child fills a store of 343,000 postures and is killed (SIGKILL) after a random time, 50 times
unless another number is given; the next child resumes. A store that is finished is compared byte by
byte with one that was never interrupted, and the next one is begun. After each kill the store is
opened with plain xarray, and every posture whose status is not `not-computed` is compared with the
uninterrupted store. The last lines are about two children that start at the same moment, with and
without `resume`.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections import Counter
from multiprocessing import get_context
from multiprocessing.context import ForkProcess
from pathlib import Path
from shutil import rmtree

import numpy as np
import xarray as xr

import kickdyn as kd
from kickdyn.sweeps import chunk_solver

LEG, KICK = kd.Leg.human(), kd.Kick(speed=4.0)
SPANS = {"hip": (-0.5, 1.5), "knee": (0.0, 2.4), "ankle": (-0.3, 0.8)}
SIDE = 70
POSTURES = {joint: np.linspace(*span, SIDE) for joint, span in SPANS.items()}
CHUNK = 5_000
"""Postures of a chunk: about seventy chunks, so that many moments differ."""

FORK = get_context("fork")  # the child need not import and compile


def fill(path: Path, resume: bool) -> None:
    """Fill a store in a child; exit with 3 where that is refused."""
    try:
        kd.sweep(LEG, POSTURES, KICK, store=path, resume=resume, threads=1).close()
    except kd.InvalidInput as error:
        print(f"  refused: {str(error).replace(str(path), path.name)}", flush=True)
        sys.exit(3)


def started(path: Path, resume: bool) -> ForkProcess:
    """Return a child that fills a store."""
    child = FORK.Process(target=fill, args=(path, resume))
    child.start()
    return child


def files(folder: Path) -> dict[Path, bytes]:
    """Return the contents of all files in a folder."""
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def check(path: Path, whole: xr.Dataset, before: int) -> int:
    """Return how many postures of a store are computed; raise where one is wrong or lost."""
    with xr.open_zarr(path, chunks=None) as data:
        done = data.status.values != -1
        for name in data.data_vars:
            right = whole[name].values[done]
            assert np.array_equal(data[name].values[done], right, equal_nan=True), name
        count = int(done.sum())
        assert count >= before, f"{before - count} postures are lost"
        assert data.attrs["finished"] == 0 or count == done.size, "wrongly complete"
    return count


def killed(folder: Path, kills: int, seconds: float) -> None:
    """Kill that many children, each after a random share of the time that a sweep takes."""
    random, path = np.random.default_rng(23), folder / "s.zarr"
    whole = xr.open_zarr(folder / "whole.zarr", chunks=None).load()
    tally, before, shares = Counter[str](), 0, []
    while tally["killed"] < kills:
        child = started(path, resume=path.exists())
        time.sleep(random.uniform(0, seconds))
        child.kill()
        child.join()
        tally["killed"] += child.exitcode == -9
        if not path.exists():
            tally["before the store was there"] += 1
            continue
        before = check(path, whole, before)
        shares.append(before / whole.status.size)
        if child.exitcode == 0:
            assert files(path) == files(folder / "whole.zarr"), "not the same bytes"
            tally["finished, byte by byte the same"] += 1
            rmtree(path)
            before = 0
    rest = started(path, resume=path.exists())
    rest.join()
    assert files(path) == files(folder / "whole.zarr"), "not the same bytes"
    assert {each.name for each in folder.iterdir()} == {"s.zarr", "whole.zarr"}, "left over"
    rmtree(path)
    print(", ".join(f"{name} {number}" for name, number in tally.items()))
    partly = sum(0 < share < 1 for share in shares)
    print(f"stores found partly filled after a kill: {partly}; postures lost or wrong: 0")


def main() -> None:
    """Print what happened."""
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    chunk_solver.CHUNK = CHUNK
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        seconds = math.inf
        for _ in range(2):  # the first may compile
            rmtree(folder / "whole.zarr", ignore_errors=True)
            begin = time.perf_counter()
            fill(folder / "whole.zarr", resume=False)
            seconds = min(seconds, time.perf_counter() - begin)
        each = sum(map(len, files(folder / "whole.zarr").values())) / SIDE**3
        print(f"{SIDE**3:,} postures in {seconds:.1f} s, {each:.1f} bytes each")
        killed(folder, kills, seconds)
        for resume in (False, True):
            pair = [started(folder / "s.zarr", resume) for _ in range(2)]
            for child in pair:
                child.join()
            codes = sorted(child.exitcode or 0 for child in pair)
            assert codes in ([0, 0], [0, 3]), codes
            same = files(folder / "s.zarr") == files(folder / "whole.zarr")
            print(f"two at once, resume={resume}: exit codes {codes}, the same bytes: {same}")
            rmtree(folder / "s.zarr")


if __name__ == "__main__":
    main()
