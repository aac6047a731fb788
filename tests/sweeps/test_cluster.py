import json
import os
import pickle
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest
from distributed import Client, LocalCluster

import kickdyn as kd
from kickdyn.sweeps import cluster, zarr_store
from kickdyn.sweeps.chunk_job import Job
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.stream import stream

LEG = kd.Leg.human()
KICK = Kick(speed=4.0, air=None)
JOINTS = ["hip=0:20:10", "knee=0:130:0.25", "ankle=-20:50:0.25"]
POSTURES = grid(LEG, JOINTS, 10**7)
"""Six chunks."""


def files(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def kill_one(seen):
    """Kill a worker of this process once a chunk is done; note who listened beyond loopback."""
    while len(seen["done"]) < 2:
        time.sleep(0.01)
    here = psutil.Process()
    family = [here, *here.children(recursive=True)]
    for one in family:
        seen["open"] += [c.laddr.ip for c in one.net_connections() if c.status == "LISTEN"]
    workers = [one for one in family[1:] if not one.children() and _works(one)]
    os.kill(workers[0].pid, signal.SIGKILL)
    seen["killed"] = workers[0].pid


def _works(process):
    return any(
        c.laddr.ip == "127.0.0.1" and c.status == "LISTEN" for c in process.net_connections()
    )


def test_a_worker_that_is_killed_costs_time_only(tmp_path):
    """On a fresh machine the kernel is compiled here, and read from the disk by the workers."""
    whole = stream(tmp_path / "whole.zarr", LEG, POSTURES, KICK, threads=1)
    seen = {"done": [], "open": [], "killed": None}
    killer = threading.Thread(target=kill_one, args=(seen,), daemon=True)
    killer.start()
    chunk_summary = stream(
        tmp_path / "s.zarr", LEG, POSTURES, KICK, workers=2, progress=seen["done"].append
    )
    killer.join(5)
    assert seen["killed"] is not None
    assert set(seen["open"]) == {"127.0.0.1"}
    assert chunk_summary == whole
    assert sum(seen["done"]) == POSTURES.size
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_a_task_hands_back_what_it_does_not_begin_in_time(tmp_path, monkeypatch):
    store = zarr_store.Store(tmp_path / "s.zarr", LEG, POSTURES, KICK, resume=False)
    task = pickle.dumps(Job(str(store.path), LEG, POSTURES, KICK, 0.0))
    monkeypatch.setattr(cluster, "LONG", 0.0)
    assert cluster._some(task, [4, 1, 2]) == (store.cut.span(4)[1], [1, 2])
    monkeypatch.setattr(cluster, "LONG", 100.0)
    assert cluster._some(task, [1, 2]) == (sum(store.cut.span(k)[1] for k in (1, 2)), [])
    assert store.missing() == [0, 3, 5]


def test_workers_do_not_hear_ctrl_c():
    with cluster._here(1) as client:
        client.wait_for_workers(1, timeout=30)
        (deaf,) = client.run(lambda: signal.pthread_sigmask(signal.SIG_BLOCK, [])).values()
    assert signal.SIGINT in deaf


def test_workers_do_not_import_from_the_working_directory(tmp_path, monkeypatch):
    for name in ("multiprocessing", "signal", "pickle", "distributed", "kickdyn"):
        hostile = f"from pathlib import Path; Path({str(tmp_path)!r}, '{name} ran').touch()"
        (tmp_path / f"{name}.py").write_text(hostile)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    with cluster._here(1) as client:
        client.wait_for_workers(1, timeout=30)
        ((there, path),) = client.run(lambda: (str(Path.cwd()), sys.path)).values()
    assert there == str(tmp_path)
    assert {"", there}.isdisjoint(path)
    assert not os.environ.get("PYTHONSAFEPATH")
    assert not list(tmp_path.glob("* ran"))


def test_a_cluster_that_does_not_answer_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{nobody.getsockname()[1]}"
        with pytest.raises(kd.InvalidInput, match=f"no cluster answers at {address}"):
            stream(tmp_path / "s.zarr", LEG, POSTURES, KICK, cluster=address)
    monkeypatch.setattr("distributed.Client", None)  # what has no port is not even tried
    for wrong in ("nowhere", "", "tcp://", "tcp://localhost", "udp://127.0.0.1:1"):
        with pytest.raises(kd.InvalidInput, match=f"no cluster answers at {wrong} "):
            stream(tmp_path / "s.zarr", LEG, POSTURES, KICK, cluster=wrong)
    assert not list(tmp_path.iterdir())  # nothing that is in the next attempt's way


def test_a_scheduler_that_dies_leaves_what_can_be_resumed(tmp_path):
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard"]
    command += ["--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(tmp_path / "where")]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as scheduler:
        while not (tmp_path / "where").exists():
            time.sleep(0.05)
        where = json.loads((tmp_path / "where").read_text())["address"]
        work = [sys.executable, "-m", "distributed.cli.dask_worker", where, "--nthreads", "1"]
        work += ["--no-dashboard", "--no-nanny", "--death-timeout", "2"]
        with subprocess.Popen(work, stderr=subprocess.DEVNULL, cwd=tmp_path) as worker:
            with Client(where, set_as_default=False) as client:
                client.wait_for_workers(1, timeout=60)
            path, kick = tmp_path / "s.zarr", Kick(speed=4.0)
            sweep = [sys.executable, "-m", "kickdyn.posture_sweep", "--cluster", where]
            sweep += ["--speed", "4", "--carry-error", "0", "--out", str(path)]
            sweep += [part for joint in JOINTS for part in ("--joint", joint)]
            with subprocess.Popen(sweep, stderr=subprocess.PIPE, text=True) as lost:
                while lost.poll() is None and not list(path.glob("progress/*.json")):
                    time.sleep(0.01)
                scheduler.kill()
                (said,) = lost.communicate()[1].splitlines()
            assert re.search(r"lost the scheduler at .*: \d of 6 chunks .* --resume", said)
            worker.kill()
    chunk_summary = stream(path, LEG, POSTURES, kick, carry_error=0.0, resume=True)
    assert chunk_summary["counts"]["ok"] > 0


def test_without_the_extra_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(kd.InvalidInput, match=r'pip install "kickdyn\[cluster\]"'):
        stream(tmp_path / "s.zarr", LEG, POSTURES, KICK, workers=2)
    assert not (tmp_path / "s.zarr").exists()


def test_workers_must_be_there_see_the_store_and_be_alike(tmp_path, monkeypatch):
    monkeypatch.setattr(zarr_store, "SLOW_CHUNK", 100)
    few = grid(LEG, ["hip=0:40:5"])
    here = "127.0.0.1:0"
    with LocalCluster(
        n_workers=0, threads_per_worker=1, processes=False, protocol="tcp",
        host="127.0.0.1",
        dashboard_address=here, worker_dashboard_address=here,
    ) as started:  # fmt: skip
        monkeypatch.setattr(cluster, "PATIENCE", 0.5)
        where = started.scheduler_address
        with pytest.raises(kd.InvalidInput, match="the cluster has no workers"):
            stream(tmp_path / "a.zarr", LEG, few, KICK, cluster=where)
        monkeypatch.setattr(cluster, "PATIENCE", 20)
        started.scale(1)
        stream(tmp_path / "b.zarr", LEG, few, KICK, cluster=where)
        monkeypatch.setattr(pickle, "dumps", lambda job: _moved(job, dumps))
        with pytest.raises(
            kd.InvalidInput, match=r"worker .* cannot do this sweep: .*is not there"
        ):
            stream(tmp_path / "c.zarr", LEG, few, KICK, cluster=where)


dumps = pickle.dumps


def _moved(job, dumps):
    object.__setattr__(job, "path", job.path + "-elsewhere")
    return dumps(job)
