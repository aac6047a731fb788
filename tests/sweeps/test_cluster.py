"""A sweep on a cluster of dask.distributed: two processes, one of them killed, and its end."""

import os
import pickle
import signal
import threading
import time
from concurrent.futures import Executor, Future

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.errors import Unfinished
from kickdyn.sweeps import chunk_solver

distributed = pytest.importorskip("distributed")

LEG = kd.Leg.human()
KICK = kd.Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
POSTURES = {"hip": np.linspace(0.0, 1.5, 10), "knee": np.linspace(0.0, 0.9, 20)}
"""200 postures, each by `strike`: workers compile nothing."""


def files(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def stored(path, **how):
    return kd.sweep(LEG, POSTURES, KICK, store=path, variables=["ball_speed", "impulse"], **how)


def watched(executor, sizes):
    """Return an executor that notes the sizes of its tasks."""
    submit = executor.submit

    def noted(function, *arguments):
        sizes.append(len(pickle.dumps((function, arguments))))
        return submit(function, *arguments)

    executor.submit = noted
    return executor


def slowed(executor):
    """Return an executor whose tasks last, so that what happens to it comes before their end."""
    submit = executor.submit

    def later(function, *arguments):
        def slow():
            time.sleep(0.2)
            return function(*arguments)

        return submit(slow)

    executor.submit = later
    return executor


class ClosedClient:
    """What a client of dask.distributed is once its scheduler has told it that it closes."""

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
    monkeypatch.setattr("kickdyn.sweeps.sweep.LISTEN_INTERVAL", 0.01)
    words = r"the scheduler has closed: 0 of 200 postures are stored in .*resume=True"
    with pytest.raises(Unfinished, match=words):
        stored(tmp_path / "silent.zarr", executor=SilentExecutor())
    stored(tmp_path / "silent.zarr", resume=True)
    stored(tmp_path / "whole.zarr")
    assert files(tmp_path / "silent.zarr") == files(tmp_path / "whole.zarr")


@pytest.mark.filterwarnings("ignore")  # of dask, about what the test does to its workers
def test_a_cluster_fills_the_same_store_whatever_becomes_of_it(tmp_path, monkeypatch):
    monkeypatch.setattr(chunk_solver, "SLOW_CHUNK", 8)
    stored(tmp_path / "whole.zarr")
    expected, sizes = files(tmp_path / "whole.zarr"), []
    options = {"processes": True, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(n_workers=2, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        executor = watched(client.get_executor(), sizes)
        stored(tmp_path / "plain.zarr", executor=executor)
        assert files(tmp_path / "plain.zarr") == expected
        workers, seen = list(client.run(os.getpid).values()), []
        executor = slowed(client.get_executor())

        def chunks(name):
            return len(list(tmp_path.glob(f"{name}.zarr/status/c/*/*")))

        def kill_one():
            while not chunks("killed"):
                time.sleep(0.001)
            seen.append(chunks("killed"))
            os.kill(workers[0], signal.SIGKILL)

        killer = threading.Thread(target=kill_one, daemon=True)
        killer.start()
        stored(tmp_path / "killed.zarr", executor=executor)
        killer.join(5)
        assert 0 < seen[0] < chunks("whole")
        assert files(tmp_path / "killed.zarr") == expected

        def close(count):
            if count:
                cluster.close()

        with pytest.raises(Unfinished, match=r"of 200 postures are stored in .*resume=True"):
            stored(tmp_path / "closed.zarr", executor=executor, progress=close)
    stored(tmp_path / "closed.zarr", resume=True)
    assert files(tmp_path / "closed.zarr") == expected
    assert 0 < max(sizes) < 1000
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "closed.zarr", "killed.zarr", "plain.zarr", "whole.zarr"
    ]  # fmt: skip
