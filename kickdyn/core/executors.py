"""Results of an executor, of this process, of others or of a cluster, and why it has stopped."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, wait
from itertools import islice
from typing import TypeVar

LISTEN_INTERVAL = 5.0
"""Time between looks at whether the scheduler of a cluster still runs [s]."""

STOPPED = (KeyboardInterrupt, OSError, BrokenExecutor, CancelledError)
"""Errors with which a computation that is stored can be continued."""

A = TypeVar("A")
T = TypeVar("T")


def in_order(
    executor: Executor | None, function: Callable[[A], T], arguments: Iterable[A], ahead: int = 64
) -> Iterator[T]:
    """Yield the results of a function, in the order of arguments; `ahead` are submitted ahead.

    Without an executor, they are computed in this thread.
    """
    if executor is None:
        yield from map(function, arguments)
        return
    waiting, submitted = iter(arguments), deque[Future[T]]()
    try:
        while True:
            for argument in islice(waiting, ahead - len(submitted)):
                submitted.append(executor.submit(function, argument))
            if not submitted:
                return
            future = submitted.popleft()
            # `wait` alone never ends for a future that was cancelled before it ran
            while not (future.done() or wait([future], timeout=LISTEN_INTERVAL).done):
                _check_connection(executor)
            yield future.result()
    finally:
        for future in submitted:
            future.cancel()


def _check_connection(executor: Executor) -> None:
    """Raise `CancelledError` if the scheduler of a dask.distributed executor has closed.

    A client that its scheduler informs of this neither cancels its futures nor closes itself
    (distributed 2026.8): nothing else would end the wait for a result.
    """
    client = getattr(executor, "_client", None)
    if client is None:
        return
    stream = getattr(client, "scheduler_comm", None)
    connected = stream is not None and not stream.closed()
    if client.status not in ("running", "connecting") or not connected:
        raise CancelledError("the scheduler has closed")


def reason_of_stop(error: BaseException) -> str:
    """Return why a computation has stopped with one of `STOPPED`, in a few words."""
    reason = getattr(error, "strerror", None) or " ".join(str(error).split())
    if isinstance(error, KeyboardInterrupt):
        return "interrupted"
    if isinstance(error, CancelledError):
        return reason or "the executor has cancelled the computation"
    return str(reason)
