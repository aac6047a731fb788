"""Sweeps larger than memory: chunk by chunk to the disk, with what is to be said of the whole."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.checks import Array
from kickdyn.errors import Unfinished
from kickdyn.leg import Leg
from kickdyn.sweep.grid import Grid
from kickdyn.sweep.kick import STATUSES, Kick
from kickdyn.sweep.outcomes import Outcomes
from kickdyn.sweep.run import VARIABLES
from kickdyn.sweep.zarr_store import Store

_NAMES = list(VARIABLES)
_SPEED, _WORST = _NAMES.index("ball_speed"), _NAMES.index("worst_joint_impulse")
_RESIDUALS = [_NAMES.index("restitution_residual"), _NAMES.index("momentum_residual")]


def stream(
    path: str | os.PathLike[str],
    leg: Leg,
    grid: Grid,
    kick: Kick,
    *,
    resume: bool = False,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> dict[str, Any]:
    """Kick from every posture of a grid, into a Zarr store that `xarray.open_zarr` reads.

    However it ends, what is done stays; at most the chunks under way are lost, and `resume` gives
    the same store, bit by bit, as a sweep that nothing had stopped.

    Args:
        path: a folder ending in `.zarr`.
        leg: the leg.
        grid: the postures.
        kick: what they share.
        resume: go on with what is there.
        workers: threads.
        progress: told the number of postures done, chunk by chunk.

    Returns:
        `counts` by status; `best` and `worst` possible posture by ball speed, `[m/s, number]`, or
        None; `front`, the postures that no other beats in both ball speed and worst joint impulse,
        `[m/s, N s, number]`, fastest first; `residual`, the largest. Numbers count the grid with
        its last axis running fastest.

    Raises:
        InvalidInput: as `Store`, and as `kick_from`.
        Unfinished: interrupted, or the disk is full; what is done stays.
    """
    store = Store(path, leg, grid, kick, resume=resume)
    if store.summary is not None:
        return store.summary
    missing = store.missing()
    if progress is not None:
        progress(grid.size - sum(store.span(k)[1] for k in missing))
    outcomes = Outcomes(leg, grid, kick)

    def one(k: int) -> int:
        first, count = store.span(k)
        rows, status = outcomes(first, count)
        store.write(k, rows, status, told(first, rows, status))
        return count

    try:
        _run(one, missing, workers, progress)
    except (KeyboardInterrupt, OSError) as error:
        why = "interrupted" if isinstance(error, KeyboardInterrupt) else error.strerror or error
        done = store.chunks - len(store.missing())
        raise Unfinished(
            f"{why}: {done} of {store.chunks} chunks are in {path}, --resume goes on from there"
        ) from None
    return store.finish(merged(store.told()))


def _run(
    one: Callable[[int], int],
    numbers: list[int],
    workers: int,
    progress: Callable[[int], None] | None,
) -> None:
    """Run the chunks in threads, never more waiting than work."""
    pool, under_way = ThreadPoolExecutor(workers), set[Future[int]]()
    left = iter(numbers)
    try:
        while True:
            with suppress(StopIteration):
                while len(under_way) < 2 * workers:
                    under_way.add(pool.submit(one, next(left)))
            if not under_way:
                return
            ended, under_way = wait(under_way, return_when=FIRST_COMPLETED)
            for each in ended:
                if progress is not None:
                    progress(each.result())
                each.result()
    finally:
        pool.shutdown(cancel_futures=True)


def told(first: int, rows: Array, status: NDArray[np.int8]) -> dict[str, Any]:
    """Return what is to be known of a chunk that begins with posture `first`, as plain values."""
    counts = np.bincount(status, minlength=len(STATUSES)).tolist()
    residuals = rows[_RESIDUALS][:, status < STATUSES.index("out of reach")]
    about: dict[str, Any] = {
        "counts": dict(zip(STATUSES, counts, strict=True)),
        "residual": float(residuals.max(initial=0.0)),
        "best": None,
        "worst": None,
        "front": [],
    }
    possible = np.flatnonzero(status == STATUSES.index("ok"))
    if possible.size:
        speed, load = rows[_SPEED, possible], rows[_WORST, possible]
        for name, i in (("best", int(speed.argmax())), ("worst", int(speed.argmin()))):
            about[name] = [float(speed[i]), first + int(possible[i])]
        about["front"] = _front(np.column_stack([speed, load, first + possible])).tolist()
    return about


def merged(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what is to be known of chunks together; of equals, the first posture."""
    best = [part["best"] for part in parts if part["best"]]
    worst = [part["worst"] for part in parts if part["worst"]]
    points = [point for part in parts for point in part["front"]]
    front = _front(np.array(points)).tolist() if points else []
    return {
        "counts": {name: sum(part["counts"][name] for part in parts) for name in STATUSES},
        "residual": max(part["residual"] for part in parts),
        "best": max(best, key=lambda one: (one[0], -one[1]), default=None),
        "worst": min(worst, default=None),
        "front": [[speed, load, int(number)] for speed, load, number in front],
    }


def _front(points: Array) -> Array:
    """Return the rows (speed, load, number) that no other beats in both, fastest first."""
    ordered = points[np.lexsort((points[:, 2], points[:, 1], -points[:, 0]))]
    lightest = np.minimum.accumulate(ordered[:, 1])
    kept = np.concatenate([[True], lightest[1:] < lightest[:-1]])
    return np.asarray(ordered[kept])
