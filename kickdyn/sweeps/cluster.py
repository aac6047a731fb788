"""The chunks of a sweep on dask.distributed: processes of this machine, or of many."""

from __future__ import annotations

import logging
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from itertools import islice
from multiprocessing import resource_tracker
from time import monotonic
from typing import TYPE_CHECKING, Any

from kickdyn.core.interrupt import held
from kickdyn.errors import InvalidInput, KickdynError

if TYPE_CHECKING:
    from kickdyn.sweeps.chunk_job import Job

PATIENCE = 5.0
"""How long an answer of a cluster is waited for [s]."""

AHEAD = 3
"""Tasks per worker that a scheduler holds: it never waits, and never has them all."""

CHUNKS, LONG = 8, 0.3
"""Most chunks of a task; those not begun after so long are handed back [s]. A task costs the
scheduler some 6 ms, an eighth of a chunk."""

STOPPING = 0.5
"""How long workers of this machine that are at work in the end may take to stop [s]."""

_LOOPBACK = "127.0.0.1"


def spread(
    job: Job, numbers: list[int], where: str | int, progress: Callable[[int], None] | None
) -> None:
    """Run chunks on the workers of a cluster; what one that dies had under way, another does.

    Args:
        job: what a worker does.
        numbers: of the chunks.
        where: address of a scheduler, or how many processes to start on this machine.
        progress: told the number of postures done, task by task.

    Raises:
        InvalidInput: dask.distributed is not installed; no such cluster, or its workers do not see
            the store or have other versions.
        OSError: of a worker, as it is; workers died again and again, or the scheduler is gone.
    """
    try:
        import distributed
    except ImportError:
        raise InvalidInput(
            'workers and clusters need dask.distributed: pip install "kickdyn[cluster]"'
        ) from None
    dask: Any = distributed
    task = pickle.dumps(job)
    with _there(where) if isinstance(where, str) else _here(where) as client:
        workers = _ready(client, task)
        size = min(CHUNKS, -(-len(numbers) // (AHEAD * workers)))
        left = iter(numbers)
        under_way = dask.as_completed(loop=client.loop)

        def more(some: list[int]) -> None:
            if some:
                under_way.add(client.submit(_some, task, some, pure=False))

        for _ in range(AHEAD * workers):
            more(list(islice(left, size)))
        try:
            for each in under_way:
                done, rest = each.result()
                each.release()
                more(rest or list(islice(left, size)))
                if progress is not None:
                    progress(done)
        except dask.KilledWorker as error:
            raise ChildProcessError(f"workers died again and again ({error})") from None
        except (dask.client.FutureCancelledError, dask.comm.CommClosedError):
            raise ConnectionError(f"lost the scheduler at {where}") from None


@contextmanager
def _there(address: str) -> Iterator[Any]:
    """Give the client of a cluster that runs."""
    import distributed

    dask: Any = distributed
    try:
        dask.comm.get_address_host_port(address, strict=True)  # a client would ask for 10 s more
        client = dask.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InvalidInput(f"no cluster answers at {address} ({_why(error)})") from None
    known = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    loggers = [logging.getLogger(name) for name in known]  # several have levels of their own
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)  # of a scheduler that is lost they print tracebacks
    try:
        with client:
            yield client
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextmanager
def _here(count: int) -> Iterator[Any]:
    """Give the client of a cluster of so many processes, which end with it."""
    import distributed

    dask: Any = distributed
    nowhere = f"{_LOOPBACK}:0"  # what a dashboard would be; None would listen to everyone
    started = ExitStack()
    try:
        with _safe_path():
            resource_tracker.ensure_running()  # which would unblock Ctrl-C, as it starts
        with _safe_path(), held():
            cluster = started.enter_context(dask.LocalCluster(
                n_workers=count, threads_per_worker=1, processes=True, host=_LOOPBACK,
                dashboard_address=nowhere, worker_dashboard_address=nowhere,
                scheduler_kwargs={"dashboard": False}, memory_limit=0,
                silence_logs=logging.CRITICAL,
            ))  # fmt: skip
            for nanny in cluster.workers.values():
                started.callback(cluster.sync, nanny.close, timeout=STOPPING)
            client = started.enter_context(dask.Client(cluster, set_as_default=False))
        yield client
    finally:
        with held():
            started.close()


@contextmanager
def _safe_path() -> Iterator[None]:
    """Keep processes that are started from importing what lies in the working directory.

    multiprocessing starts them by `python -c`, which looks there first, for its own modules too.
    What this process may import, they may: they are given its path next.
    """
    before = os.environ.get("PYTHONSAFEPATH", "")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        os.environ["PYTHONSAFEPATH"] = before  # empty is as good as none


def _ready(client: Any, task: bytes) -> int:
    """Return how many workers there are; raise `InvalidInput` where one of them cannot do it."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise InvalidInput("the cluster has no workers") from None
    found = client.run(_look, task, on_error="return")
    for address, answer in found.items():
        if answer is not None:
            said = _why(answer) if isinstance(answer, Exception) else answer
            raise InvalidInput(f"worker {address} cannot do this sweep: {said}")
    return len(found)


def _why(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


@lru_cache(maxsize=1)
def _job(task: bytes) -> Job:
    """Return the job in this worker, ready for all of its chunks."""
    job: Job = pickle.loads(task)
    job.prepare()
    return job


def _look(task: bytes) -> str | None:
    """Return why this worker cannot do the job, if so."""
    job: Job = pickle.loads(task)
    try:
        _ = job.store
    except KickdynError as error:
        return str(error)
    return None


def _some(task: bytes, numbers: list[int]) -> tuple[int, list[int]]:
    """Run chunks for a while; return their postures, and which are left."""
    job, end, done = _job(task), monotonic() + LONG, 0
    for begun, k in enumerate(numbers, 1):
        done += job(k)
        if monotonic() > end:
            return done, numbers[begun:]
    return done, []
