import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import psutil
import pytest
import xarray as xr
import zarr

import kickdyn as kd
from kickdyn.errors import Unfinished
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.dataset import VARIABLES, describe
from kickdyn.sweeps.grid import Grid, read_postures
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


def as_stored(data):
    """The dataset with 7 digits, as files have it; joints and status as they are."""
    return data.assign({name: data[name].astype("f4") for name in VARIABLES if name in data})


def computed(path):
    with kd.open_sweep(path) as data:
        return int((data.status != -1).sum())


def test_a_store_is_the_dataset_in_memory(tmp_path):
    data, small = stored(tmp_path / "s.zarr", threads=2), kd.sweep(LEG, POSTURES, KICK)
    assert dict(data.sizes) == dict(small.sizes)
    assert data.ball_speed.encoding["compressors"]
    xr.testing.assert_identical(data.load(), as_stored(small))
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("chunks", ["auto", None])
def test_plain_xarray_opens_a_store_without_a_warning(tmp_path, chunks):
    path, whole = tmp_path / "s.zarr", kd.sweep(LEG, POSTURES, KICK)

    def stop(count):
        if count:
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
        assert (plain.carry.values[done] == as_stored(whole).carry.values[done]).all()
        stored(path, resume=True)


def test_dask_reduces_a_store(tmp_path):
    data = stored(tmp_path / "s.zarr")
    lazy = data.chunk()
    assert lazy.ball_speed.chunks is not None
    plain = xr.open_zarr(tmp_path / "s.zarr")  # `chunks` raises where coordinates have others
    assert plain.chunks == plain.ball_speed.chunksizes
    best = lazy.ball_speed.where(lazy.status == 0).max("hip")
    xr.testing.assert_equal(best.compute(), data.ball_speed.where(data.status == 0).max("hip"))


def test_killed_and_resumed_it_is_the_same_bit_by_bit(tmp_path):
    stored(tmp_path / "whole.zarr")
    script = SCRIPT + (
        "from kickdyn.sweeps.store import SweepStore\n"
        "write = SweepStore.write\n"
        "def wait(store, k, *values):\n"
        "    if k == 2: print('two chunks are done', flush=True), input()\n"
        "    write(store, k, *values)\n"
        "SweepStore.write = wait\n"
        "kd.sweep(leg, postures, kick, store='s.zarr', threads=1)\n"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", script], cwd=tmp_path, **pipes) as killed:
        assert killed.stdout.readline() == b"two chunks are done\n"
        os.kill(killed.pid, signal.SIGKILL)
    done = computed(tmp_path / "s.zarr")
    with kd.open_sweep(tmp_path / "s.zarr") as half:
        assert half.attrs["finished"] == 0
        assert np.isnan(half.carry.values[half.status.values == -1]).all()
    assert done == 2 * 42
    calls = []
    stored(tmp_path / "s.zarr", resume=True, progress=calls.append)
    assert calls == [done, *5 * [42]]
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
    with pytest.raises(kd.KickdynError, match=r"^No space left on device: \d+ of 294 postures"):
        stored(tmp_path / "s.zarr")
    troubles[:] = [KeyboardInterrupt()]
    with pytest.raises(
        kd.KickdynError, match=r"^interrupted: [\d,]+ of [\d,]+ postures are stored .*resume=True"
    ):
        stored(tmp_path / "s.zarr", resume=True)
    stored(tmp_path / "s.zarr", resume=True)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_what_is_there_is_not_overwritten(tmp_path):
    path = tmp_path / "s.zarr"
    stored(path)
    with pytest.raises(kd.InvalidInput, match="exists and is not replaced: add --resume"):
        stored(path)
    inside = POSTURES["knee"] ** 1.01
    inside[-1] = POSTURES["knee"][-1]
    others = {
        r"its foot_speed_m_s is 4\.0, this one's 5\.0": {"kick": replace(KICK, speed=5.0)},
        "its joints are hip, knee, ankle, this one's ankle, knee, hip": {
            "postures": dict(reversed(POSTURES.items()))
        },
        "its joints are hip, knee, ankle, this one's hip": {"postures": {"hip": [0.0, 0.1]}},
        "its values of hip are not all the same": {"postures": POSTURES | {"hip": 0.0}},
        "its values of knee are not all the same": {"postures": POSTURES | {"knee": inside}},
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


def test_a_file_that_may_not_grow_ends_in_one_line_and_is_resumed(tmp_path):
    stored(tmp_path / "whole.zarr")
    script = SCRIPT + (
        "from kickdyn.sweeps.store import SweepStore, save_netcdf\n"
        "from kickdyn.sweeps.dataset import VARIABLES, describe\n"
        "from kickdyn.sweeps.grid import Grid\n"
        "described = describe(leg, Grid.of(leg, postures), kick, 0.0)\n"
        "SweepStore('s.zarr', described, list(VARIABLES), 50, resume=False)\n"
        "import resource\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))\n"
        "try: save_netcdf(kd.sweep(leg, postures, kick), 's.nc')\n"
        "except kd.InvalidInput as error: print(error)\n"
        "kd.sweep(leg, postures, kick, store='s.zarr', resume=True)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ended.stdout == "s.nc cannot be written (File too large)\n"
    assert ended.returncode == 1
    assert re.search(r"File too large: 0 of [\d,]+ postures are stored in s\.zarr", ended.stderr)
    stored(tmp_path / "s.zarr", resume=True)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def processes(number):
    return ProcessPoolExecutor(number, get_context("spawn"))


def test_processes_fill_the_same_store(tmp_path):
    stored(tmp_path / "whole.zarr", LARGE, threads=1)
    with processes(2) as executor:
        stored(tmp_path / "s.zarr", LARGE, executor=executor)
    assert sum(map(len, files(tmp_path / "s.zarr").values())) < 45 * 3 * 521 * 281
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_a_worker_that_is_killed_leaves_what_can_be_resumed(tmp_path):
    calls = []

    def kill_one():
        while not list(tmp_path.glob("s.zarr/status/c/*")):
            time.sleep(0.01)
        family = psutil.Process().children(recursive=True)
        workers = [one for one in family if "spawn_main" in " ".join(one.cmdline())]
        os.kill(workers[0].pid, signal.SIGKILL)

    killer = threading.Thread(target=kill_one, daemon=True)
    killer.start()
    stops = pytest.raises(kd.KickdynError, match=r"of [\d,]+ postures are stored in .*resume=True")
    with processes(2) as executor, stops:
        stored(tmp_path / "s.zarr", LARGE, replace(KICK, air=kd.Air()), tolerance=0,
               executor=executor, progress=calls.append)  # fmt: skip
    killer.join(5)
    done = computed(tmp_path / "s.zarr")
    assert done > 0
    calls.clear()
    stored(tmp_path / "s.zarr", LARGE, replace(KICK, air=kd.Air()), tolerance=0, resume=True,
           progress=calls.append)  # fmt: skip
    assert calls[0] >= done
    assert sum(calls) == computed(tmp_path / "s.zarr") == 3 * 521 * 281


def test_what_cannot_be_sent_to_a_worker_is_one_line(tmp_path):
    windy = kd.Kick(air=kd.Air(wind=lambda height: np.array([1.0, 0.0, 0.0])))
    refused = pytest.raises(kd.InvalidInput, match="cannot be sent to other processes")
    with processes(1) as executor, refused:
        stored(tmp_path / "s.zarr", kick=windy, executor=executor)
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
    unseen = pytest.raises(kd.InvalidInput, match=r"a worker has no access to .*s\.zarr")
    with Blind(1) as executor, unseen:
        stored(tmp_path / "s.zarr", executor=executor)
    assert computed(tmp_path / "s.zarr") == 0


def test_what_is_stopped_leaves_nothing_to_an_executor_of_the_caller(tmp_path):
    def stop(count):
        if count:
            raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as executor:
        with pytest.raises(Unfinished, match=r"^interrupted: \d+ of 294 postures"):
            stored(tmp_path / "s.zarr", executor=executor, progress=stop)
        done = computed(tmp_path / "s.zarr")
    assert computed(tmp_path / "s.zarr") <= done + 42 < 294


def test_only_named_variables_are_kept_in_their_order(tmp_path):
    whole = kd.sweep(LEG, POSTURES, KICK)
    for path in (tmp_path / "s.zarr", None):
        few = kd.sweep(LEG, POSTURES, KICK, store=path, variables=["carry", "impulse", "status"])
        assert list(few.data_vars) == ["impulse", "carry", "status"]
        xr.testing.assert_identical(
            as_stored(few.load()), as_stored(whole[["impulse", "carry", "status"]])
        )
    with pytest.raises(kd.InvalidInput, match="its variables are impulse, carry, this one's effec"):
        stored(tmp_path / "s.zarr", resume=True)
    stored(tmp_path / "s.zarr", resume=True, variables=("impulse", "carry"))
    stored(tmp_path / "status.zarr", variables=["status"])
    assert list(kd.open_sweep(tmp_path / "status.zarr")) == ["status"]


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["ball_sped"], "variable 'ball_sped' is unknown: did you mean 'ball_speed'"),
        (["carry", "x"], "variable 'x' is unknown: a sweep has effective_mass, .*, status"),
        (["carry", 5], "variable 5 is unknown"),
        ([], r"variables is \[\]: it must be a list of effective_mass"),
        ("carry", "variables is 'carry': it must be a list"),
        (5, "variables is 5: it must be"),
    ],
)
def test_variables_that_there_are_not(tmp_path, names, words):
    with pytest.raises(kd.InvalidInput, match=words):
        stored(tmp_path / "s.zarr", variables=names)
    assert not list(tmp_path.iterdir())


def test_a_damaged_netcdf_file_is_refused_in_a_line(tmp_path):
    """Where only values are damaged, a file that is read later ends later."""
    file = tmp_path / "sweep.nc"
    save_netcdf(kd.sweep(LEG, POSTURES, KICK), file)
    content = bytearray(file.read_bytes())
    place = content.rindex(b"x\x01") + 4  # of compressed values
    content[place : place + 8] = bytes(8)
    file.write_bytes(content)
    with pytest.raises(kd.InvalidInput, match="cannot be read as a sweep"):
        kd.open_sweep(file)


def test_without_kickdyn_xarray_opens_every_file(tmp_path):
    """By two functions, and with the attributes of CF."""
    stored(tmp_path / "whole.zarr")
    save_netcdf(kd.sweep(LEG, POSTURES, KICK), tmp_path / "whole.nc")
    described = describe(LEG, Grid.of(LEG, POSTURES), KICK, 0.0)
    begun = SweepStore(tmp_path / "begun.zarr", described, list(VARIABLES), 50, resume=False)
    begun.write(2, np.ones((len(VARIABLES), 42)), np.zeros(42, np.int8))
    script = (
        "import sys, xarray as xr\n"
        "def show(data):\n"
        "    flags = dict(zip(data.status.attrs['flag_meanings'].split(), "
        "map(int, data.status.attrs['flag_values'])))\n"
        "    print(*data.data_vars, *data.coords, data.attrs['Conventions'], "
        "data.attrs['finished'], data.status.dtype, data.carry.dtype, data.knee.dtype, "
        "flags['not-computed'], int((data.status == -1).sum()), int(data.carry.isnull().sum()))\n"
        "    for name, each in data.variables.items():\n"
        "        assert each.attrs['long_name'] and ('units' in each.attrs) == (name != 'status')\n"
        "for name in ('whole.zarr', 'begun.zarr'): show(xr.open_zarr(name))\n"
        "for name in ('whole.zarr', 'begun.zarr', 'whole.nc'): show(xr.open_dataset(name))\n"
        "assert not any('kickdyn' in name for name in sys.modules)\n"
    )
    command = [sys.executable, "-W", "error", "-c", script]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.stderr == ""
    variables, joints = [*VARIABLES, "status"], [n for j in POSTURES for n in (j, f"{j}_deg")]
    orders = {"zarr": [*sorted(variables), *sorted(joints)], "nc": [*variables, *joints]}
    ends = {1: "1 int8 float32 float64 -1 0 0", 0: "0 int8 float32 float64 -1 252 252"}
    cases = ("zarr", 1), ("zarr", 0), ("zarr", 1), ("zarr", 0), ("nc", 1)
    expected = [f"{' '.join(orders[kind])} CF-1.11 {ends[k]}" for kind, k in cases]
    assert ended.stdout.splitlines() == expected
    text = (Path(__file__).parents[2] / "docs" / "reference" / "dataset.md").read_text()
    table = re.search(r"\| variable \|.*?\n\n", text, re.DOTALL)[0]
    assert re.findall(r"`(\w+)`(?=[^|]*\| [a-zA-Z0-9])", table) == [*VARIABLES, "status"]


def test_one_process_fills_a_store_at_a_time(tmp_path):
    path = tmp_path / "s.zarr"
    described = describe(LEG, Grid.of(LEG, POSTURES), KICK, 0.0)
    other = SweepStore(path, described, list(VARIABLES), 50, resume=False)
    with (
        other.locked(),
        pytest.raises(kd.InvalidInput, match=r"s\.zarr is being filled by another process: wait"),
    ):
        stored(path, resume=True)
    assert computed(path) == 0
    stored(path, resume=True)
    assert computed(path) == 294


def test_a_store_that_another_process_makes_meanwhile_is_kept(tmp_path, monkeypatch):
    path, consolidate = tmp_path / "s.zarr", zarr.consolidate_metadata

    def overtaken(*args):
        monkeypatch.setattr(zarr, "consolidate_metadata", consolidate)
        monkeypatch.setattr(os, "getpid", lambda: 7)
        stored(path)
        return consolidate(*args)

    monkeypatch.setattr(zarr, "consolidate_metadata", overtaken)
    with pytest.raises(kd.InvalidInput, match=r"another process has made it meanwhile"):
        stored(path)
    assert [each.name for each in tmp_path.iterdir()] == ["s.zarr"]
    assert computed(path) == 294


def test_killed_at_any_file_nothing_is_lost_or_wrongly_complete(tmp_path):
    """Each child is killed when it is about to put its n-th file in its place."""
    script = SCRIPT + (
        "import os, signal\n"
        "from pathlib import Path\n"
        "import numpy as np\n"
        "whole, replace, done, rounds = kd.sweep(leg, postures, kick), Path.replace, 0, 0\n"
        "def killed_at(n):\n"
        "    calls = []\n"
        "    def count(draft, target):\n"
        "        calls.append(target)\n"
        "        if len(calls) == n: os.kill(os.getpid(), signal.SIGKILL)\n"
        "        return replace(draft, target)\n"
        "    Path.replace = count\n"
        "    kd.sweep(leg, postures, kick, store='s.zarr', threads=1, resume=True)\n"
        "for n in (1, 60, 2, 29, None, 10**9):\n"
        "    n = n or (294 - done) // 42 * 14 + 1  # when all is computed and nothing says so\n"
        "    child = os.fork()\n"
        "    if child == 0:\n"
        "        killed_at(n)\n"
        "        os._exit(0)\n"
        "    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])\n"
        "    if not Path('s.zarr').exists(): continue\n"
        "    with kd.open_sweep('s.zarr') as data:\n"
        "        here = data.status.values != -1\n"
        "        assert (data.status.values[here] == whole.status.values[here]).all()\n"
        "        for name in set(data.data_vars) - {'status'}:\n"
        "            right = whole[name].values.astype('f4')[here]\n"
        "            assert np.array_equal(data[name].values[here], right, equal_nan=True)\n"
        "        assert here.sum() >= done and here.all() >= data.attrs['finished'], (n, done)\n"
        "        done, rounds = here.sum(), rounds + 1\n"
        "        assert (code == 0) == data.attrs['finished'], (n, code)\n"
        "print(done, rounds, code)\n"
    )
    command = [sys.executable, "-c", script]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.stdout.split()[::2] == ["294", "0"], ended.stderr
    assert int(ended.stdout.split()[1]) >= 4
    stored(tmp_path / "whole.zarr")
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")
    assert {each.name for each in tmp_path.iterdir()} == {"s.zarr", "whole.zarr"}


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
    kd.sweep(LEG, POSTURES, KICK).drop_vars("status").to_netcdf(tmp_path / "less.nc")
    with pytest.raises(kd.InvalidInput, match=r"less\.nc is not a sweep: it has no status"):
        kd.open_sweep(tmp_path / "less.nc")


@pytest.fixture(scope="module")
def small():
    return kd.sweep(LEG, {"hip": [0.0, 0.3], "knee": 0.2}, KICK)


def test_netcdf_keeps_everything(small, tmp_path):
    save_netcdf(small, tmp_path / "sweep.nc")
    with kd.open_sweep(tmp_path / "sweep.nc") as back:
        xr.testing.assert_identical(back.load(), as_stored(small))


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


@pytest.mark.parametrize("fault", ["flipped", "missing", "half", "empty"])
def test_a_damaged_chunk_is_named_and_computed_again(tmp_path, fault):
    stored(tmp_path / "whole.zarr")
    data = stored(tmp_path / "s.zarr")
    file = tmp_path / "s.zarr" / "carry" / "c" / "3" / "0" / "0"
    content = file.read_bytes()
    if fault == "missing":
        file.unlink()
    else:
        flipped = content[:9] + bytes([content[9] ^ 4]) + content[10:]
        file.write_bytes({"flipped": flipped, "half": content[: len(content) // 2]}.get(fault, b""))
    words = "is missing" if fault == "missing" else "is damaged"
    with pytest.raises(kd.InvalidInput, match=rf"s\.zarr: chunk carry/c/3/0/0 {words}: compute it"):
        data.carry.load()
    calls = []
    stored(tmp_path / "s.zarr", resume=True, progress=calls.append)
    assert calls == [294 - 42, 42]
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_a_damaged_coordinate_is_not_advised_to_be_resumed(tmp_path):
    """Resuming computes chunks of variables: it refuses such a store, too."""
    stored(tmp_path / "s.zarr")
    (file,) = (tmp_path / "s.zarr" / "hip" / "c").iterdir()
    file.write_bytes(bytes([file.read_bytes()[0] ^ 4]) + file.read_bytes()[1:])
    words = r"s\.zarr: chunk hip/c/0 is damaged: only the whole sweep, computed anew, replaces it$"
    for open_it in (kd.open_sweep, lambda path: stored(path, resume=True)):
        with pytest.raises(kd.InvalidInput, match=words):
            open_it(tmp_path / "s.zarr").load()


def test_every_flipped_bit_of_a_chunk_is_noticed(tmp_path):
    path, draw = tmp_path / "s.zarr", np.random.default_rng(0)
    stored(path)
    chunks = sorted(file for file in path.rglob("*") if file.is_file() and file.name != "zarr.json")
    for file in draw.choice(chunks, 40):
        content = bytearray(file.read_bytes())
        content[draw.integers(len(content))] ^= 1 << int(draw.integers(8))
        before = file.read_bytes()
        file.write_bytes(content)
        with pytest.raises(kd.InvalidInput, match=r"chunk \w+/c/[\d/]+ is damaged"):
            kd.open_sweep(path).load()
        file.write_bytes(before)
    kd.open_sweep(path).load()


def test_a_damaged_netcdf_file_is_one_line(tmp_path):
    draw, unnoticed = np.random.default_rng(1), 0
    save_netcdf(kd.sweep(LEG, POSTURES, KICK), tmp_path / "whole.nc")
    content, whole = (tmp_path / "whole.nc").read_bytes(), kd.open_sweep(tmp_path / "whole.nc")
    for k in range(60):
        damaged = bytearray(content)
        if k % 3:
            damaged[draw.integers(len(damaged))] ^= 1 << int(draw.integers(8))
        else:
            damaged = damaged[: draw.integers(len(damaged))]
        (tmp_path / "s.nc").write_bytes(damaged)
        with suppress(kd.InvalidInput):
            unnoticed += not kd.open_sweep(tmp_path / "s.nc").equals(whole)
    assert unnoticed == 0


@pytest.mark.parametrize("name", ["zarr.json", "carry/zarr.json"])
@pytest.mark.parametrize(
    "text", [b"[]", b"", b"{}", b"null", b'{"attri', b'{"codecs": 5}', b"\xff"]
)
def test_damaged_metadata_of_a_store_are_one_line(tmp_path, name, text):
    stored(tmp_path / "s.zarr", {"hip": [0.1, 0.2]})
    (tmp_path / "s.zarr" / name).write_bytes(text)
    for read in (kd.open_sweep, lambda path: stored(path, {"hip": [0.1, 0.2]}, resume=True)):
        with pytest.raises(kd.InvalidInput, match=r"s\.zarr (cannot be read|is not)") as refused:
            read(tmp_path / "s.zarr")
        assert "\n" not in str(refused.value)


def test_a_store_that_could_run_code_is_refused(tmp_path):
    old = zarr.open_group(tmp_path / "old.zarr", mode="w", zarr_format=2)
    old.create_array("status", shape=(3,), dtype="i1")
    with pytest.raises(kd.InvalidInput, match=r"no zarr\.json, of Zarr 3"):
        kd.open_sweep(tmp_path / "old.zarr")
    stored(tmp_path / "s.zarr")
    file = tmp_path / "s.zarr" / "carry" / "zarr.json"
    text = json.loads(file.read_text())
    text["codecs"].append({"name": "numcodecs.pickle", "configuration": {}})
    file.write_text(json.dumps(text))
    with pytest.raises(kd.InvalidInput, match=r"carry has the codec 'numcodecs\.pickle'"):
        kd.open_sweep(tmp_path / "s.zarr")


def test_links_are_not_followed(tmp_path):
    """Someone who may write to the folder has put links there."""
    elsewhere, folder = tmp_path / "elsewhere", tmp_path / "shared"
    elsewhere.mkdir()
    folder.mkdir()
    for name in (f".s.zarr-draft-{os.getpid()}", ".s.zarr-draft-x", "dangling.zarr"):
        (folder / name).symlink_to(elsewhere if "draft" in name else elsewhere / "new")
    (folder / "link.zarr").symlink_to(elsewhere)
    stored(folder / "s.zarr")
    assert computed(folder / "s.zarr") == 294
    for name in ("link.zarr", "dangling.zarr"):
        for resume in (True, False):
            with pytest.raises(kd.InvalidInput, match=f"{name} cannot be written \\(it is a link"):
                stored(folder / name, resume=resume)
    shutil.rmtree(folder / "s.zarr" / "carry" / "c")
    (folder / "s.zarr" / "carry" / "c").symlink_to(elsewhere)
    with pytest.raises(kd.InvalidInput, match=r"s\.zarr cannot be written \(a folder in it is a"):
        stored(folder / "s.zarr", resume=True)
    assert not list(elsewhere.iterdir())


class Cancelling(ThreadPoolExecutor):
    """A cluster whose scheduler is closed after a few chunks."""

    def submit(self, function, k):
        if k < 3:
            return super().submit(function, k)
        future = Future()
        future.cancel()
        return future


def test_a_scheduler_that_is_closed_leaves_what_can_be_resumed(tmp_path):
    said = r"^the executor has cancelled the computation: [\d,]+ of 294 .* with --resume"
    with Cancelling(1) as executor, pytest.raises(Unfinished, match=said):
        stored(tmp_path / "s.zarr", executor=executor)
    assert 0 < computed(tmp_path / "s.zarr") < 294
    stored(tmp_path / "s.zarr", resume=True)
    assert computed(tmp_path / "s.zarr") == 294


def test_a_name_that_is_too_long_is_one_line(tmp_path):
    for call in (kd.open_sweep, stored):
        with pytest.raises(kd.InvalidInput, match=r"File name too long"):
            call(tmp_path / ("x" * 5000 + ".zarr"))
