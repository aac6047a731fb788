"""Sweeps in other processes: pools and clusters, of which workers and schedulers end."""

import os
import signal
import threading
import time
from concurrent.futures import Executor, Future
from itertools import chain, repeat

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.errors import Unfinished
from kickdyn.sweeps import chunk_solver

LEG = kd.Leg.human()
KICK = kd.Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
POSTURES = {"hip": np.linspace(0.0, 1.5, 6), "knee": np.linspace(0.0, 0.9, 12)}


def files(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def stored(path, postures=POSTURES, **options):
    return kd.sweep(LEG, postures, KICK, store=path, variables=["ball_speed", "impulse"], **options)


def slowed(executor, first, others):
    """Return an executor whose tasks last, the first and the others [s], so that workers end."""
    submit, times = executor.submit, chain([first], repeat(others))

    def slow(function, *arguments):
        wait = next(times)
        return submit(lambda: (time.sleep(wait), function(*arguments))[1])

    executor.submit = slow
    return executor


class ClosedClient:
    """A client of dask.distributed to which its scheduler has announced its end."""

    status = "running"

    class scheduler_comm:  # noqa: N801
        @staticmethod
        def closed():
            return True


class SilentExecutor(Executor):
    """An executor that never answers, as the one of that client."""

    _client = ClosedClient()

    def submit(self, function, *arguments):
        return Future()


def test_a_scheduler_that_closes_without_a_word_ends_the_wait(tmp_path, monkeypatch):
    monkeypatch.setattr("kickdyn.core.executors.LISTEN_INTERVAL", 0.01)
    with pytest.raises(Unfinished, match=r"0 of 72 .*resume=True"):
        stored(tmp_path / "silent.zarr", executor=SilentExecutor())
    stored(tmp_path / "silent.zarr", resume=True)
    stored(tmp_path / "whole.zarr")
    assert files(tmp_path / "silent.zarr") == files(tmp_path / "whole.zarr")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of dask, about what the test does to its workers
def test_a_cluster_that_loses_workers_and_scheduler_fills_the_same_store(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(chunk_solver, "CHUNK", 8)
    stored(tmp_path / "whole.zarr")
    right = files(tmp_path / "whole.zarr")
    options = {"processes": True, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(n_workers=2, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        workers = list(client.run(os.getpid).values())

        def kill_one():
            while not list(tmp_path.glob("killed.zarr/status/c/*/*")):
                time.sleep(0.001)
            os.kill(workers[0], signal.SIGKILL)

        killer = threading.Thread(target=kill_one, daemon=True)
        killer.start()
        stored(tmp_path / "killed.zarr", executor=slowed(client.get_executor(), 0.2, 0.2))
        killer.join(5)
        assert files(tmp_path / "killed.zarr") == right
        with pytest.raises(Unfinished, match=r"of 72 .*resume=True"):
            stored(tmp_path / "closed.zarr", executor=slowed(client.get_executor(), 0.0, 5.0),
                   progress=lambda count: cluster.close() if count else None)  # fmt: skip
    stored(tmp_path / "closed.zarr", resume=True)
    assert files(tmp_path / "closed.zarr") == right
