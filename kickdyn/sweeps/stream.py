"""Sweeps larger than memory: chunk by chunk to the disk, with what is to be said of the whole."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.interrupt import held
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, Unfinished
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.chunk_job import TOGETHER, Job, chunk_summary, merged
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kick import CARRY_ERROR, Kick
from kickdyn.sweeps.outcomes import Outcomes
from kickdyn.sweeps.zarr_store import Store, cut

Progress = Callable[[int], None]
See = Callable[[int, Array, NDArray[np.int8]], None]


def stream(
    path: str | os.PathLike[str] | None,
    leg: Leg,
    grid: Grid,
    kick: Kick,
    *,
    resume: bool = False,
    threads: int | None = None,
    workers: int = 0,
    cluster: str | None = None,
    carry_error: float = CARRY_ERROR,
    progress: Progress | None = None,
    see: See | None = None,
) -> dict[str, Any]:
    """Kick from every posture of a grid, into a Zarr store that `xarray.open_zarr` reads.

    However it ends, what is done stays; at most the chunks under way are lost, and `resume` gives
    the same store, bit by bit, as a sweep that nothing had stopped.

    Args:
        path: a folder ending in `.zarr`; None keeps no posture.
        leg: the leg.
        grid: the postures.
        kick: what they share.
        resume: go on with what is there.
        threads: in this process; None takes every core there is.
        workers: processes on this machine instead of threads (dask.distributed).
        cluster: address of a scheduler of dask.distributed whose workers do it; they must see
            `path` and have the same versions.
        carry_error: that carries may have where they are read off polynomials, see `Outcomes` [m].
        progress: told the number of postures done, chunk by chunk.
        see: where there is no path, shown every chunk, one at a time and in no fixed order: number
            of the first posture, rows in the order of `VARIABLES`, status.

    Returns:
        `counts` by status; `best` and `worst` possible posture by ball speed, `[m/s, number]`, or
        None; `front`, the postures that no other beats in both ball speed and worst joint impulse,
        `[m/s, N s, number]`, fastest first; `residual`, the largest. Numbers count the grid with
        its last axis running fastest.

    Raises:
        InvalidInput: as `Store`, and as `kick_from`; threads beside workers, or none; a cluster
            that cannot be reached, or whose workers cannot do it.
        Unfinished: interrupted, the disk is full, or the cluster is gone; what is done stays.
    """
    carry_error = validation.number("carry error", carry_error, at_least=0, unit="m")
    if sum((threads is not None, workers > 0, cluster is not None)) > 1:
        raise InvalidInput("threads, workers and cluster exclude each other: give one of them")
    threads = cores() if threads is None else int(validation.number("threads", threads, at_least=1))
    if path is None:
        if resume or workers or cluster is not None:
            raise InvalidInput("workers and clusters fill a store, and a store is resumed: name it")
        return _unkept(leg, grid, kick, carry_error, threads, progress, see)
    if see is not None:
        raise InvalidInput("chunks that go to a store are looked at there")
    store = Store(path, leg, grid, kick, carry_error, resume=resume)
    if store.summary is not None:
        return store.summary
    missing = store.missing()
    if progress is not None:
        progress(grid.size - sum(store.cut.span(k)[1] for k in missing))
    job = Job(str(Path(path).absolute()), leg, grid, kick, carry_error)
    try:
        if workers or cluster is not None:
            from kickdyn.sweeps.cluster import spread

            spread(job, missing, workers if cluster is None else cluster, progress)
        else:
            job.prepare()
            run(job, missing, threads, progress)
        with held():
            return store.finish(merged(store.chunk_summary()))
    except InvalidInput:
        store.abandon()
        raise
    except (KeyboardInterrupt, OSError) as error:
        why = "interrupted" if isinstance(error, KeyboardInterrupt) else error.strerror or error
        done = len(store.cut) - len(store.missing())
        raise Unfinished(
            f"{why}: {done} of {len(store.cut)} chunks are in {path}, --resume goes on from there"
        ) from None


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _unkept(
    leg: Leg,
    grid: Grid,
    kick: Kick,
    carry_error: float,
    threads: int,
    progress: Progress | None,
    see: See | None,
) -> dict[str, Any]:
    chunks, outcomes = cut(leg, grid, kick, parts=4), Outcomes(leg, grid, kick, carry_error)
    so_far: list[dict[str, Any]] = []
    turn = Lock()

    def one(k: int) -> int:
        first, count = chunks.span(k)
        rows, status = outcomes(first, count)
        part = chunk_summary(first, rows, status)
        with turn:
            so_far.append(part)
            if len(so_far) == TOGETHER:
                so_far[:] = [merged(so_far)]
            if see is not None:
                see(first, rows, status)
        return count

    try:
        run(one, range(len(chunks)), threads, progress)
    except KeyboardInterrupt:
        raise Unfinished("interrupted: without a store nothing is kept") from None
    return merged(so_far)


def run(
    one: Callable[[int], int], numbers: Iterable[int], threads: int, progress: Progress | None
) -> None:
    """Run the chunks in threads, never more waiting than work."""
    pool, under_way = ThreadPoolExecutor(threads), set[Future[int]]()
    left = iter(numbers)
    try:
        while True:
            with suppress(StopIteration):
                while len(under_way) < 2 * threads:
                    under_way.add(pool.submit(one, next(left)))
            if not under_way:
                return
            ended, under_way = wait(under_way, return_when=FIRST_COMPLETED)
            for each in ended:
                if progress is not None:
                    progress(each.result())
                each.result()
    finally:
        with held():
            pool.shutdown(cancel_futures=True)
