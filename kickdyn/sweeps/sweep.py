"""The sweep: one kick from every posture of a grid.

A grid is cut into chunks, a `ChunkSolver` computes each, and the chunks make a dataset, in memory
or in a Zarr store. Threads or an executor of the caller compute chunks side by side.
"""

import hashlib
import os
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from functools import lru_cache, partial
from pathlib import Path
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.executors import STOPPED, in_order, reason_of_stop
from kickdyn.core.files import FileName, replacing
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput, Unfinished
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.chunk_solver import ChunkSolver
from kickdyn.sweeps.dataset import check_identified, select_variables, with_variables
from kickdyn.sweeps.grid import IN_MEMORY, Chunks, Grid, check_size
from kickdyn.sweeps.store import SweepStore, open_sweep
from kickdyn.sweeps.sweep_kick import Kick

CARRY_TOLERANCE = 1e-6
"""Largest error of an interpolated carry unless another is asked for [m]."""

CHUNKS_AHEAD = 1000
"""Chunks of a store that are given to an executor before the first of them is computed."""

Progress = Callable[[int], None]
"""Is called with the number of postures computed since the last call."""


@validation.check_arguments
def sweep(
    leg: Leg,
    postures: Mapping[str, ArrayLike],
    kick: Kick,
    *,
    samples: int | Literal["list"] | None = None,
    store: FileName | None = None,
    variables: Iterable[str] | None = None,
    resume: bool = False,
    tolerance: float = CARRY_TOLERANCE,
    threads: int | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    r"""Compute a kick, impact and flight, from every posture of a grid.

    From each posture the foot moves with the velocity of the kick. The impulse on the ball follows
    from the leg's effective mass along the contact normal, :math:`1 / (n^T J M^{-1} J^T n)`,
    Newton's restitution and Coulomb's friction; the ball then flies through the air. The values
    agree with `kickdyn.strike` and `kickdyn.fly` to 1e-9; the carry of a ball that is flown, and
    not interpolated, agrees with `kickdyn.fly` with `tol=1e-11` to 1e-8.

    Args:
        leg: the leg.
        postures: a value or ascending values of each joint by its name, shape `(k,)`
            [rad; m for prismatic joints]. Every combination is a posture. Joints that are not named
            stay at 0, or move to close the loops of the leg.
        samples: None for the grid; a number of postures of a Sobol sequence (`scipy.stats.qmc`)
            between two bounds of each joint, of which 1e7 are allowed and powers of two are best;
            or `"list"`: `postures` has n values of each joint, and value i of all is posture i.
        kick: foot velocity, contact, ball and air.
        store: folder that ends in `.zarr`, into which the sweep is written in chunks, so that
            memory does not grow with the grid. None returns up to a million postures in memory.
        variables: names of the variables to keep beside `status`, such as
            `["ball_speed", "carry"]`; None keeps all, about 30 bytes a posture in a store.
        resume: whether to compute only the chunks that `store` lacks.
        tolerance: largest error of `carry` [m] where balls fly through air in the plane of the leg,
            whose carries are interpolated between flights; 0 flies every ball, to 1e-8 of its
            carry.
        threads: number of threads of this process; None takes one per core.
        executor: an executor with the interface of `concurrent.futures`, such as a
            `ProcessPoolExecutor` or one of a cluster, instead of threads. Its workers must see
            `store` and have the same versions; it is not shut down, and its own errors are not
            changed.
        progress: function that is called as postures are computed, with their number since the last
            call.

    Returns:
        A dataset with one dimension per joint, or `posture` with `samples`, the variables of
        `dataset.VARIABLES` and `status`, a `PostureStatus` by its flag. Units, provenance and
        warnings are in the attributes. Variables are nan where the posture is out of reach or the
        loops cannot be closed. With
        `store`, the dataset is the opened store, whose variables have 7 digits (float32).

    Raises:
        InvalidInput: postures that the leg does not have, more postures than fit into memory, an
            unknown variable, a store that exists while `resume` is False, is of another sweep or is
            being filled by another process.
        Unfinished: interrupted by Ctrl-C, a full disk or lost workers; the store can be resumed.

    Example:
        >>> import kickdyn as kd
        >>> postures = {"hip": [0.0, 0.5], "knee": [0.2, 0.4, 0.6]}
        >>> table = kd.sweep(kd.Leg.human(), postures, kd.Kick(speed=5.0))
        >>> table.ball_speed.sel(hip=0.5).values.round(2).tolist()
        [7.15, 6.66, 6.01]
    """
    if threads is not None and executor is not None:
        raise InvalidInput("threads and executor exclude each other: give one of them")
    if store is None and (resume or executor is not None):
        raise InvalidInput("resume and executor need a store: name it with store=")
    selected = select_variables(variables)
    stored = store is not None
    solver = ChunkSolver(leg, Grid.of(leg, postures, samples), kick, tolerance, stored=stored)
    described = solver.describe()
    if store is None:
        check_size(solver.grid.shape, IN_MEMORY)
        chunks = zip(*_solved(solver, threads, progress), strict=True)
        rows, status = (np.hstack(arrays) for arrays in chunks)
        return with_variables(described.assign_attrs(finished=1), rows, status, selected)
    sent = None if executor is None else _pickled(Path(store).absolute(), selected, solver)
    filled = SweepStore(store, described, selected, solver.chunk, resume=resume)
    if not filled.created:
        check_identified(kick)
    writing = nullcontext(partial(_write_chunk, filled, solver))
    sending = writing if sent is None else _put_beside(filled.path.absolute(), sent)
    computing = _pool(threads) if executor is None else nullcontext(executor)
    with filled.locked(), _resumable(filled), computing as pool, sending as write:
        _fill(filled, solver, pool, write, progress)
    return open_sweep(store)


def sweep_chunks(
    leg: Leg,
    postures: Mapping[str, ArrayLike],
    kick: Kick,
    *,
    tolerance: float = CARRY_TOLERANCE,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Iterator[xr.Dataset]:
    """Yield a sweep of any size chunk by chunk, each as the dataset of its postures; none is kept.

    It has the arguments and errors of `sweep`. The chunks come in the order of the grid.
    """
    solver = ChunkSolver(leg, Grid.of(leg, postures), kick, tolerance)
    described, chunks = solver.describe(), Chunks.of(solver.grid.shape, solver.chunk)
    for k, solved in enumerate(_solved(solver, threads, progress)):
        region = dict(zip(solver.grid.dims, chunks.region(k), strict=True))
        yield with_variables(described.isel(region), *solved)


def _solved(
    solver: ChunkSolver, threads: int | None, progress: Progress | None
) -> Iterator[tuple[Array, NDArray[np.int8]]]:
    """Yield the results of each chunk of a grid, in order."""
    solver.prepare()
    chunks = Chunks.of(solver.grid.shape, solver.chunk)
    with _pool(threads) as pool:
        ahead = 1 + int(threads or _cores())
        for solved in in_order(pool, lambda k: solver(*chunks.span(k)), range(len(chunks)), ahead):
            if progress is not None:
                progress(len(solved[1]))
            yield solved


def _fill(
    store: SweepStore,
    solver: ChunkSolver,
    pool: Executor,
    write: Callable[[int], int],
    progress: Progress | None,
) -> None:
    """Compute and write the missing chunks of a store, in this process or in those of the pool."""
    missing = store.missing()
    if progress is not None:
        progress(store.size - store.count(missing))
    if missing:
        solver.prepare()  # for other processes too: what is compiled once, they read from the disk
    for count in in_order(pool, write, missing, CHUNKS_AHEAD):
        if progress is not None:
            progress(count)
    if missing or not store.finished:
        store.finish()


def _write_chunk(store: SweepStore, solver: ChunkSolver, k: int) -> int:
    """Compute and write a chunk by a solver that is prepared; return its number of postures."""
    rows, status = solver(*store.chunks.span(k))
    store.write(k, rows, status)
    return len(status)


def _pickled(path: Path, variables: Sequence[str], solver: ChunkSolver) -> bytes:
    """Return the pickle that `_received` takes in another process."""
    arguments = solver.leg, solver.grid, solver.kick, solver.tolerance
    try:
        return pickle.dumps((path, variables, arguments))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InvalidInput(f"the sweep cannot be sent to other processes ({error})") from None


@contextmanager
def _put_beside(store: Path, sent: bytes) -> Iterator[Callable[[int], int]]:
    """Put a sweep into a file beside its store, which workers read once: tasks stay small."""
    digest = hashlib.sha256(sent).hexdigest()
    file = _file_beside(str(store), digest)
    with replacing(file) as draft:
        draft.write_bytes(sent)
    try:
        yield partial(_write_sent, str(store), digest)
    finally:
        file.unlink(missing_ok=True)


def _file_beside(store: str, digest: str) -> Path:
    return Path(store).with_name(f".{Path(store).name}-{digest[:16]}.sweep")


def _write_sent(store: str, digest: str, k: int) -> int:
    """Compute and write a chunk in another process."""
    return _write_chunk(*_received(store, digest), k)


@lru_cache(maxsize=1)
def _received(folder: str, digest: str) -> tuple[SweepStore, ChunkSolver]:
    """Return store and solver in a process that sees the file beside the store.

    What a pickle runs is only what was sent: its digest is part of the task.
    """
    file = _file_beside(folder, digest)
    if not Path(folder).is_dir() or not file.exists():
        raise InvalidInput(f"a worker has no access to {folder}")
    sent = file.read_bytes()
    if hashlib.sha256(sent).hexdigest() != digest:
        raise InvalidInput(f"{file} is not the sweep that was sent: run it again")
    path, variables, arguments = pickle.loads(sent)
    solver = ChunkSolver(*arguments, stored=True)
    store = SweepStore(path, solver.describe(), variables, solver.chunk, resume=True)
    solver.prepare()
    return store, solver


@contextmanager
def _pool(threads: int | None) -> Iterator[Executor]:
    """Give threads; on leaving, chunks under way are completed and others dropped."""
    size = _cores() if threads is None else validation.number("threads", threads, at_least=1)
    executor = ThreadPoolExecutor(int(size))
    try:
        yield executor
    finally:
        executor.shutdown(cancel_futures=True)


@contextmanager
def _resumable(store: SweepStore) -> Iterator[None]:
    """Raise `Unfinished` where a sweep is stopped."""
    try:
        yield
    except STOPPED as error:
        raise Unfinished(
            f"{reason_of_stop(error)}: {store.computed:,} of {store.size:,} postures are stored in "
            f"{store.path}; to continue, run it again with --resume (resume=True in Python)"
        ) from None


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
