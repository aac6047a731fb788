import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
import xarray as xr

import kickdyn as kd
from kickdyn.errors import Unfinished
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.grid import read_postures
from kickdyn.sweeps.store import SweepStore, save_netcdf

LEG = kd.Leg.human()
KICK = kd.Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
POSTURES = read_postures(LEG, ["hip=0:90:15", "knee=0:30:5", "ankle=0:50:10"])
LARGE = read_postures(LEG, ["hip=0:20:10", "knee=0:130:0.25", "ankle=-20:50:0.25"])
"""Six chunks of the kernel."""

SCRIPT = """
import kickdyn as kd
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.grid import read_postures
chunk_solver.SLOW_CHUNK = 50
leg = kd.Leg.human()
postures = read_postures(leg, ["hip=0:90:15", "knee=0:30:5", "ankle=0:50:10"])
kick = kd.Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
"""
"""The same sweep in another process."""


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr(chunk_solver, "SLOW_CHUNK", 50)


def stored(path, postures=POSTURES, kick=KICK, leg=LEG, **how):
    return kd.sweep(leg, postures, kick, store=path, **how)


def files(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def computed(path):
    with kd.open_sweep(path) as data:
        return int((data.status != -1).sum())


def test_a_store_is_the_dataset_in_memory(tmp_path):
    data, small = stored(tmp_path / "s.zarr", threads=2), kd.sweep(LEG, POSTURES, KICK)
    assert dict(data.sizes) == dict(small.sizes)
    xr.testing.assert_identical(data.load(), small)
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("chunks", ["auto", None])
def test_plain_xarray_opens_a_store_without_a_warning(tmp_path, chunks):
    path, whole = tmp_path / "s.zarr", kd.sweep(LEG, POSTURES, KICK)

    def stop(count, speed):
        if math.isfinite(speed):
            raise KeyboardInterrupt

    with pytest.raises(Unfinished):
        stored(path, threads=1, progress=stop)
    for finished in (0, 1):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            plain = xr.open_zarr(path, chunks=chunks)
            done = plain.status.values != -1
            assert done.all() == finished
            assert done.any()
        assert (plain.attrs["finished"], plain.status.dtype) == (finished, np.int8)
        assert plain.status.attrs["flag_values"] == [0, 1, 2, 3, -1]
        assert plain.carry.attrs == {"units": "m", "long_name": whole.carry.attrs["long_name"]}
        assert np.isnan(plain.carry.values).tolist() == (~done).tolist()
        assert (plain.carry.values[done] == whole.carry.values[done]).all()
        stored(path, resume=True)


def test_dask_reduces_a_store(tmp_path):
    data = stored(tmp_path / "s.zarr")
    lazy = data.chunk()
    assert lazy.ball_speed.chunks is not None
    best = lazy.ball_speed.where(lazy.status == 0).max("hip")
    xr.testing.assert_equal(best.compute(), data.ball_speed.where(data.status == 0).max("hip"))


def test_killed_and_resumed_it_is_the_same_bit_by_bit(tmp_path):
    stored(tmp_path / "whole.zarr")
    script = SCRIPT + (
        "def wait(count, speed):\n"
        "    calls.append(count)\n"
        "    if len(calls) == 3: print('two chunks are done', flush=True), input()\n"
        "calls = []\n"
        "kd.sweep(leg, postures, kick, store='s.zarr', threads=1, progress=wait)\n"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", script], cwd=tmp_path, **pipes) as killed:
        assert killed.stdout.readline() == b"two chunks are done\n"
        os.kill(killed.pid, signal.SIGKILL)
    done = computed(tmp_path / "s.zarr")
    with kd.open_sweep(tmp_path / "s.zarr") as half:
        assert half.attrs["finished"] == 0
        assert np.isnan(half.carry.values[half.status.values == -1]).all()
    assert 2 * 42 <= done < 294
    calls = []
    stored(tmp_path / "s.zarr", resume=True, progress=lambda count, _: calls.append(count))
    assert calls[0] >= done
    assert len(calls) == 1 + (294 - calls[0]) // 42
    assert sum(calls) == 294
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")
    again = stored(tmp_path / "s.zarr", resume=True)
    assert again.attrs["finished"] == 1


def test_a_full_disk_or_ctrl_c_leaves_what_can_be_resumed(tmp_path, monkeypatch):
    stored(tmp_path / "whole.zarr")
    write, troubles = SweepStore.write, []

    def fail(self, k, *args):
        trouble = troubles.pop() if troubles else None  # a thread may be at the next chunk already
        if trouble is not None:
            raise trouble
        write(self, k, *args)

    monkeypatch.setattr(SweepStore, "write", fail)
    troubles[:] = [OSError(28, "No space left on device"), None, None]
    with pytest.raises(kd.KickdynError, match=r"^No space left on device: \d of 7 chunks"):
        stored(tmp_path / "s.zarr")
    troubles[:] = [KeyboardInterrupt()]
    with pytest.raises(kd.KickdynError, match=r"^interrupted: \d of 7 chunks .* --resume goes on"):
        stored(tmp_path / "s.zarr", resume=True)
    stored(tmp_path / "s.zarr", resume=True)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_what_is_there_is_not_overwritten(tmp_path):
    path = tmp_path / "s.zarr"
    stored(path)
    with pytest.raises(kd.InvalidInput, match="exists: --resume goes on"):
        stored(path)
    inside = POSTURES["knee"] ** 1.01
    inside[-1] = POSTURES["knee"][-1]
    others = {
        r"its foot_speed_m_s is 4\.0, this one's 5\.0": {"kick": replace(KICK, speed=5.0)},
        "its joints are hip, knee, ankle, this one's ankle, knee, hip": {
            "postures": dict(reversed(POSTURES.items()))
        },
        "its joints are hip, knee, ankle, this one's hip": {"postures": {"hip": [0.0, 0.1]}},
        "its hip has 7 values from 0 to 1.5708, this one's 1 from 0 to 0": {
            "postures": POSTURES | {"hip": 0.0}
        },
        "its knee has 7 values from 0 to 0.523599, this one's .* not all the same": {
            "postures": POSTURES | {"knee": inside}
        },
        "its ball_inertia_factor is": {"kick": replace(KICK, ball=kd.Ball(inertia_factor=0.4))},
        "its leg's model is not": {"leg": LEG.with_armature({"hip": 0.5})},
        "its attack_rad is": {"kick": replace(KICK, attack=KICK.attack + 1e-13)},
    }
    for words, change in others.items():
        with pytest.raises(kd.InvalidInput, match=f"is of another sweep: {words}"):
            stored(path, resume=True, **change)
    attributes = json.loads((path / "zarr.json").read_text())
    attributes["attributes"]["source"] = "kickdyn 0.0"
    (path / "zarr.json").write_text(json.dumps(attributes))
    with pytest.raises(kd.InvalidInput, match=r"its source is 'kickdyn 0\.0'"):
        stored(path, resume=True)
    (tmp_path / "other.zarr").mkdir()
    with pytest.raises(kd.InvalidInput, match="cannot be read as a sweep"):
        stored(tmp_path / "other.zarr", resume=True)
    with pytest.raises(kd.InvalidInput, match="cannot be written"):
        stored(tmp_path / "no" / "where.zarr")


def test_another_tolerance_is_another_sweep(tmp_path):
    kick = kd.Kick(speed=2.0)
    postures = LARGE | {"ankle": LARGE["ankle"][:10]}
    stored(tmp_path / "s.zarr", postures, kick)
    with pytest.raises(kd.InvalidInput, match=r"its carry_tolerance_m is 1e-06, this one's 0\.0"):
        stored(tmp_path / "s.zarr", postures, kick, tolerance=0, resume=True)


def test_a_kernel_that_disagrees_stops_the_sweep(tmp_path, monkeypatch):
    monkeypatch.setattr(chunk_solver, "AGREEMENT", -1.0)
    monkeypatch.setattr(chunk_solver, "KERNEL_FROM", 1)
    with pytest.raises(kd.KickdynError, match="the sweep has effective_mass"):
        stored(tmp_path / "s.zarr")


def test_a_file_that_may_not_grow_ends_in_one_line_and_is_resumed(tmp_path):
    stored(tmp_path / "whole.zarr")
    script = SCRIPT + (
        "from kickdyn.sweeps.store import SweepStore\n"
        "from kickdyn.sweeps.dataset import describe\n"
        "from kickdyn.sweeps.grid import Grid\n"
        "described = describe(leg, Grid.of(leg, postures), kick, 0.0)\n"
        "SweepStore('s.zarr', described, 50, resume=False)\n"
        "import resource\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (300, resource.RLIM_INFINITY))\n"
        "kd.sweep(leg, postures, kick, store='s.zarr', resume=True)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert re.search(r"File too large: 0 of 7 chunks are in s\.zarr, --resume", ended.stderr)
    stored(tmp_path / "s.zarr", resume=True)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_worker_processes_fill_the_same_store(tmp_path):
    """No process listens: whoever can connect to a scheduler could run code as its owner."""
    family, listening = set(), set()

    def look(count, speed):
        for each in (psutil.Process(), *psutil.Process().children(recursive=True)):
            family.add(each.pid)
            for one in each.net_connections("all"):
                if one.status == psutil.CONN_LISTEN:
                    listening.add(one.laddr)

    stored(tmp_path / "whole.zarr", LARGE, threads=1, progress=look)
    before = listening.copy()
    stored(tmp_path / "s.zarr", LARGE, workers=2, progress=look)
    assert len(family) >= 3
    assert listening <= before
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_a_worker_that_is_killed_leaves_what_can_be_resumed(tmp_path):
    calls = []

    def kill_one():
        while len(calls) < 2:
            time.sleep(0.01)
        family = psutil.Process().children(recursive=True)
        workers = [one for one in family if "spawn_main" in " ".join(one.cmdline())]
        os.kill(workers[0].pid, signal.SIGKILL)

    killer = threading.Thread(target=kill_one, daemon=True)
    killer.start()
    with pytest.raises(kd.KickdynError, match=r"of \d+ chunks are in .*, --resume goes on"):
        stored(tmp_path / "s.zarr", LARGE, replace(KICK, air=kd.Air()), tolerance=0, workers=2,
               progress=lambda count, _: calls.append(count))  # fmt: skip
    killer.join(5)
    done = computed(tmp_path / "s.zarr")
    assert done > 0
    calls.clear()
    stored(tmp_path / "s.zarr", LARGE, replace(KICK, air=kd.Air()), tolerance=0, resume=True,
           progress=lambda count, _: calls.append(count))  # fmt: skip
    assert calls[0] >= done
    assert sum(calls) == computed(tmp_path / "s.zarr") == 3 * 521 * 281


def test_what_cannot_be_sent_to_a_worker_is_one_line(tmp_path):
    windy = kd.Kick(air=kd.Air(wind=lambda height: np.array([1.0, 0.0, 0.0])))
    with pytest.raises(kd.InvalidInput, match="cannot be sent to other processes"):
        stored(tmp_path / "s.zarr", kick=windy, workers=1)
    assert not list(tmp_path.iterdir())


def test_an_executor_of_the_caller_fills_the_same_store(tmp_path):
    stored(tmp_path / "whole.zarr")
    with ThreadPoolExecutor(2) as executor:
        stored(tmp_path / "s.zarr", executor=executor)
        assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")
        assert executor.submit(int, "3").result() == 3  # it is not shut down


class Blind(ThreadPoolExecutor):
    """Workers that do not see the store."""

    def submit(self, function, *args):
        def blind():
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(Path, "is_dir", lambda self: False)
                return function(*args)

        return super().submit(blind)


def test_workers_must_see_the_store(tmp_path):
    unseen = pytest.raises(kd.InvalidInput, match=r"a worker does not see .*s\.zarr")
    with Blind(1) as executor, unseen:
        stored(tmp_path / "s.zarr", executor=executor)
    assert not list(tmp_path.iterdir())  # nothing that is in the next attempt's way


def test_what_is_stopped_leaves_nothing_to_an_executor_of_the_caller(tmp_path):
    def stop(count, speed):
        if math.isfinite(speed):
            raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as executor:
        with pytest.raises(Unfinished, match=r"^interrupted: [12] of 7 chunks"):
            stored(tmp_path / "s.zarr", executor=executor, progress=stop)
        done = computed(tmp_path / "s.zarr")
    assert computed(tmp_path / "s.zarr") <= done + 42 < 294


@pytest.mark.parametrize("path", [5, "a\0b.zarr", ["s.zarr"]])
def test_what_cannot_be_a_path(path):
    with pytest.raises(kd.InvalidInput, match=r"path is .*: it must be "):
        kd.open_sweep(path)
    with pytest.raises(kd.InvalidInput, match=r"(path|store) is .*: it must be "):
        kd.sweep(LEG, {"hip": 0.1}, KICK, store=path)


def test_without_zarr_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(kd.InvalidInput, match=r'pip install "kickdyn\[store\]"'):
        stored(tmp_path / "s.zarr")


def test_files_that_are_not_sweeps(tmp_path):
    with pytest.raises(kd.InvalidInput, match=r"no\.zarr: there is no such sweep"):
        kd.open_sweep(tmp_path / "no.zarr")
    (tmp_path / "text.nc").write_text("no netCDF")
    (tmp_path / "empty.zarr").mkdir()
    for name in ("text.nc", "empty.zarr"):
        with pytest.raises(kd.InvalidInput, match=f"{name} cannot be read as a sweep"):
            kd.open_sweep(tmp_path / name)
    kd.sweep(LEG, POSTURES, KICK).drop_vars("carry").to_netcdf(tmp_path / "less.nc")
    with pytest.raises(kd.InvalidInput, match=r"less\.nc is not a sweep: it has no carry"):
        kd.open_sweep(tmp_path / "less.nc")


@pytest.fixture(scope="module")
def small():
    return kd.sweep(LEG, {"hip": [0.0, 0.3], "knee": 0.2}, KICK)


def test_netcdf_keeps_everything(small, tmp_path):
    save_netcdf(small, tmp_path / "sweep.nc")
    with kd.open_sweep(tmp_path / "sweep.nc") as back:
        xr.testing.assert_identical(back.load(), small)


@pytest.mark.parametrize(
    ("name", "words"),
    [("sweep.csv", "written as .nc"), ("no/where.nc", "cannot be written"), (".nc", "ending")],
)
def test_bad_files(small, tmp_path, name, words):
    with pytest.raises(kd.InvalidInput, match=words):
        save_netcdf(small, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file(small, tmp_path, monkeypatch):
    (tmp_path / "sweep.nc").write_text("old")

    def fail(self, *args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", fail)
    with pytest.raises(kd.InvalidInput, match="No space left"):
        save_netcdf(small, tmp_path / "sweep.nc")
    assert [(f.name, f.read_text()) for f in tmp_path.iterdir()] == [("sweep.nc", "old")]
