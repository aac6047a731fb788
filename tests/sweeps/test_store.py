"""Stores and files of sweeps: interrupted, killed, damaged or resumed, they lose no posture."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from itertools import chain, repeat
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr

import kickdyn as kd
from kickdyn.errors import Unfinished
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.dataset import VARIABLES, describe
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.store import SweepStore, save_netcdf

LEG = kd.Leg.human()
KICK = kd.Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
POSTURES = {"hip": [0.0, 0.4, 0.8, 1.2], "knee": [0.0, 0.3, 0.6], "ankle": [0.0, 0.5]}
CHUNKS, COUNT = 4, 24


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr(chunk_solver, "CHUNK", 6)


def stored(path, postures=POSTURES, kick=KICK, leg=LEG, **options):
    return kd.sweep(leg, postures, kick, store=path, **options)


def files(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def as_stored(data):
    """The dataset with 7 digits, as files have it; joints and status as they are."""
    return data.assign({name: data[name].astype("f4") for name in VARIABLES if name in data})


def computed(path):
    with kd.open_sweep(path) as data:
        return int((data.status != -1).sum())


def stop(count):
    """Interrupt a sweep after a chunk."""
    if count:
        raise KeyboardInterrupt


@pytest.fixture(scope="module")
def small():
    return kd.sweep(LEG, POSTURES, KICK)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished store, not to be changed."""
    path = tmp_path_factory.mktemp("whole") / "whole.zarr"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunk_solver, "CHUNK", 6)
        stored(path, threads=2)
    return path


@pytest.fixture
def copied(whole, tmp_path):
    """A finished store that may be damaged."""
    return Path(shutil.copytree(whole, tmp_path / "s.zarr"))


def test_a_store_is_the_dataset_in_memory(whole, small):
    xr.testing.assert_identical(kd.open_sweep(whole).load(), as_stored(small))
    assert not list(whole.parent.glob(".*"))
    lazy = kd.open_sweep(whole).chunk()
    best = lazy.ball_speed.where(lazy.status == 0).max("hip").compute()
    right = small.ball_speed.astype("f4").where(small.status == 0).max("hip")
    xr.testing.assert_equal(best, right)


def test_xarray_opens_stores_finished_or_not_without_a_warning(tmp_path, small):
    path = tmp_path / "s.zarr"
    with pytest.raises(Unfinished, match=rf"interrupted: \d+ of {COUNT} .*resume=True"):
        stored(path, threads=1, progress=stop)
    for finished in (0, 1):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            plain = xr.open_zarr(path, chunks="auto")
            done = plain.status.values != -1
        assert plain.attrs["finished"] == finished  # the last chunk may be done before the stop
        assert done.all() if finished else done.any()
        assert (plain.status.dtype, plain.carry.dtype, plain.knee.dtype) == ("i1", "f4", "f8")
        np.testing.assert_array_equal(np.isnan(plain.carry.values), ~done)
        right = as_stored(small).carry.values[done]
        np.testing.assert_array_equal(plain.carry.values[done], right)
        calls = []
        stored(path, resume=True, progress=calls.append)
        assert calls == [done.sum(), *(COUNT - done.sum()) // 6 * [6]]


@pytest.mark.parametrize("trouble", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_full_disk_or_ctrl_c_leaves_a_store_that_can_be_resumed(
    tmp_path, monkeypatch, whole, trouble
):
    write, troubles = SweepStore.write, [trouble, None]

    def fail(self, k, *arguments):
        if troubles and (error := troubles.pop()) is not None:
            raise error
        write(self, k, *arguments)

    monkeypatch.setattr(SweepStore, "write", fail)
    with pytest.raises(Unfinished, match=rf"^(No space|interrupted).*of {COUNT} "):
        stored(tmp_path / "s.zarr", threads=1)
    assert 0 < computed(tmp_path / "s.zarr") < COUNT
    stored(tmp_path / "s.zarr", resume=True)
    assert files(tmp_path / "s.zarr") == files(whole)


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2, 30, 56, 57])
def test_killed_at_any_file_nothing_is_lost_or_wrongly_complete(tmp_path, whole, small, n):
    """The process is killed when it is about to put its n-th file in its place."""
    script = f"""
import os, signal
from pathlib import Path
import kickdyn as kd
from kickdyn.sweeps import chunk_solver
chunk_solver.CHUNK = 6
replace, calls = Path.replace, []
def count(draft, target):
    if target.name.isdigit() and "draft" not in str(target): calls.append(target)
    if len(calls) == {n}: os.kill(os.getpid(), signal.SIGKILL)
    return replace(draft, target)
Path.replace = count
kick = kd.Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
kd.sweep(kd.Leg.human(), {POSTURES}, kick, store="s.zarr", threads=1)
"""
    ended = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=False)
    assert ended.returncode == (0 if n > CHUNKS * 14 else -9)
    with kd.open_sweep(tmp_path / "s.zarr") as data:
        done = data.status.values != -1
        assert done.sum() == min((n - 1) // 14, CHUNKS) * 6
        assert data.attrs["finished"] == (n > CHUNKS * 14)
        for name in VARIABLES:
            right = as_stored(small)[name].values[done]
            np.testing.assert_array_equal(data[name].values[done], right)
    stored(tmp_path / "s.zarr", resume=True)
    assert files(tmp_path / "s.zarr") == files(whole)
    assert [entry.name for entry in tmp_path.iterdir()] == ["s.zarr"]


@pytest.mark.parametrize(("change", "word"), [
    ({"kick": replace(KICK, speed=5.0)}, "foot_speed_m_s"),
    ({"kick": replace(KICK, attack=1e-13)}, "attack_rad"),
    ({"kick": replace(KICK, ball=kd.Ball(inertia_factor=0.4))}, "ball_inertia_factor"),
    ({"postures": dict(reversed(POSTURES.items()))}, "ankle, knee, hip"),
    ({"postures": {"hip": [0.0, 0.1]}}, "joints"),
    ({"postures": POSTURES | {"knee": [0.0, 0.3 + 1e-15, 0.6]}}, "knee"),
    ({"leg": LEG.with_armature({"hip": 0.5})}, "model"), ({"variables": ["carry"]}, "variables")
])  # fmt: skip
def test_a_store_of_another_sweep_is_left_alone(whole, change, word):
    before = files(whole)
    with pytest.raises(kd.InvalidInput, match=f"another sweep.*{word}"):
        stored(whole, resume=True, **change)
    with pytest.raises(kd.InvalidInput, match="--resume"):
        stored(whole)
    assert files(whole) == before


def drag(reynolds, spin_parameter):
    return 0.2


def test_a_sweep_with_a_function_of_ones_own_is_resumed_by_its_text(tmp_path):
    path, postures = tmp_path / "s.zarr", {"hip": [0.0, 0.1]}
    stored(path, postures, kd.Kick(air=kd.Air(drag=drag)))
    copy = kd.Kick(air=kd.Air(drag=type(drag)(drag.__code__.replace(co_flags=3), {}, "drag")))
    stored(path, postures, copy, resume=True)
    namespace = {}
    exec("def drag(reynolds, spin_parameter): return 0.2", namespace)
    typed = kd.Kick(air=kd.Air(drag=namespace["drag"]))
    with pytest.raises(kd.InvalidInput, match="air"):
        stored(path, postures, typed, resume=True)
    stored(tmp_path / "t.zarr", postures, typed)
    with pytest.raises(kd.InvalidInput, match="'drag'"):
        stored(tmp_path / "t.zarr", postures, typed, resume=True)


class Cancelling(ThreadPoolExecutor):
    """A cluster whose scheduler is closed after two chunks."""

    def submit(self, function, k):
        if k < 2:
            return super().submit(function, k)
        future = Future()
        future.cancel()
        return future


def test_an_executor_of_the_caller_fills_the_same_store(tmp_path, whole):
    with ThreadPoolExecutor(2) as executor:
        with pytest.raises(Unfinished, match="interrupted"):
            stored(tmp_path / "s.zarr", executor=executor, progress=stop)
        stored(tmp_path / "s.zarr", executor=executor, resume=True)
        assert executor.submit(int, "3").result() == 3  # it is not shut down
    with Cancelling(1) as executor, pytest.raises(Unfinished, match="cancelled"):
        stored(tmp_path / "t.zarr", executor=executor)
    assert computed(tmp_path / "t.zarr") == 12
    stored(tmp_path / "t.zarr", resume=True)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "t.zarr") == files(whole)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["s.zarr", "t.zarr"]


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


def test_a_scheduler_that_closes_without_a_word_ends_the_wait(tmp_path, monkeypatch, whole):
    monkeypatch.setattr("kickdyn.core.executors.LISTEN_INTERVAL", 0.01)
    with pytest.raises(Unfinished, match=rf"0 of {COUNT} .*resume=True"):
        stored(tmp_path / "silent.zarr", executor=SilentExecutor())
    stored(tmp_path / "silent.zarr", resume=True)
    assert files(tmp_path / "silent.zarr") == files(whole)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of dask, about what the test does to its workers
def test_a_cluster_that_loses_workers_and_scheduler_fills_the_same_store(tmp_path, whole):
    distributed, right = pytest.importorskip("distributed"), files(whole)
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
        with pytest.raises(Unfinished, match=rf"of {COUNT} .*resume=True"):
            stored(tmp_path / "closed.zarr", executor=slowed(client.get_executor(), 0.0, 5.0),
                   progress=lambda count: cluster.close() if count else None)  # fmt: skip
    stored(tmp_path / "closed.zarr", resume=True)
    assert files(tmp_path / "closed.zarr") == right


def test_one_process_fills_a_store_at_a_time(tmp_path):
    path, described = tmp_path / "s.zarr", describe(LEG, Grid.of(LEG, POSTURES), KICK, 0.0)
    other = SweepStore(path, described, list(VARIABLES), 6, resume=False)
    with other.locked(), pytest.raises(kd.InvalidInput, match=r"s\.zarr .*another process"):
        stored(path, resume=True)
    assert computed(path) == 0


@pytest.mark.parametrize("fault", ["flipped", "missing", "half", "empty"])
def test_a_damaged_chunk_is_named_and_computed_again(copied, whole, fault):
    data, file = kd.open_sweep(copied), copied / "carry" / "c" / "3" / "0" / "0"
    content = file.read_bytes()
    flipped = content[:9] + bytes([content[9] ^ 4]) + content[10:]
    contents = {"flipped": flipped, "half": content[: len(content) // 2], "empty": b""}
    file.write_bytes(contents[fault]) if fault in contents else file.unlink()
    with pytest.raises(kd.InvalidInput, match=r"carry/c/3/0/0 is (missing|damaged).*--resume"):
        data.carry.load()
    calls = []
    stored(copied, resume=True, progress=calls.append)
    assert calls == [COUNT - 6, 6]
    assert files(copied) == files(whole)


def test_a_store_that_could_run_code_is_refused(copied, tmp_path):
    old = zarr.open_group(tmp_path / "old.zarr", mode="w", zarr_format=2)
    old.create_array("status", shape=(3,), dtype="i1")
    with pytest.raises(kd.InvalidInput, match="Zarr 3"):
        kd.open_sweep(tmp_path / "old.zarr")
    file = copied / "carry" / "zarr.json"
    text = json.loads(file.read_text())
    text["codecs"].append({"name": "numcodecs.pickle", "configuration": {}})
    file.write_text(json.dumps(text))
    with pytest.raises(kd.InvalidInput, match=r"carry.*'numcodecs\.pickle'"):
        kd.open_sweep(copied)


def test_links_are_not_followed(copied, tmp_path):
    """Others who may write to the folder could have made them."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / "link.zarr").symlink_to(elsewhere)
    (tmp_path / "dangling.zarr").symlink_to(elsewhere / "new")
    for name in ("link.zarr", "dangling.zarr"):
        for resume in (True, False):
            with pytest.raises(kd.InvalidInput, match=f"{name} .*link"):
                stored(tmp_path / name, resume=resume)
    shutil.rmtree(copied / "carry" / "c")
    (copied / "carry" / "c").symlink_to(elsewhere)
    with pytest.raises(kd.InvalidInput, match=r"s\.zarr .*link"):
        stored(copied, resume=True)
    assert not list(elsewhere.iterdir())


@pytest.mark.parametrize(("name", "content", "word"), [
    (5, None, "is 5"), ("a\0b.zarr", None, "is 'a"), ("x" * 5000, None, "too long"),
    ("no.zarr", None, "no such sweep"), ("text.nc", "no netCDF", "text.nc"),
], ids=lambda value: str(value)[:9])  # fmt: skip
def test_files_that_are_no_sweep_are_refused(tmp_path, monkeypatch, small, name, content, word):
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path(name).write_text(content)
    with pytest.raises(kd.InvalidInput, match=word):
        kd.open_sweep(name)
    small.drop_vars("status").to_netcdf("less.nc")
    with pytest.raises(kd.InvalidInput, match=r"less\.nc .*status"):
        kd.open_sweep("less.nc")
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(kd.InvalidInput, match=r"kickdyn\[store\]"):
        stored("s.zarr")


def test_netcdf_keeps_everything_and_a_failure_the_old_file(small, tmp_path, monkeypatch):
    file = tmp_path / "sweep.nc"
    save_netcdf(small, file)
    with kd.open_sweep(file) as back:
        xr.testing.assert_identical(back.load(), as_stored(small))
    before = files(tmp_path)
    for name in ("sweep.csv", "no/where.nc", ".nc"):
        with pytest.raises(kd.InvalidInput, match=name):
            save_netcdf(small, tmp_path / name)
    monkeypatch.setattr(Path, "write_bytes", lambda *_: (_ for _ in ()).throw(OSError(28, "full")))
    with pytest.raises(kd.InvalidInput, match="No space left"):
        save_netcdf(small, file)
    assert files(tmp_path) == before
