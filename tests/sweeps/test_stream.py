import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import kickdyn as kd
from kickdyn.sweeps import outcomes, zarr_store
from kickdyn.sweeps.grid import Grid, grid
from kickdyn.sweeps.kick import CARRY_ERROR, Kick
from kickdyn.sweeps.run import VARIABLES, sweep
from kickdyn.sweeps.stream import stream

LEG = kd.Leg.human()
KICK = Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
POSTURES = grid(LEG, ["hip=0:90:15", "knee=0:30:5", "ankle=0:50:10"])

SCRIPT = (
    "import kickdyn as kd\n"
    "from kickdyn.sweeps import stream as s, zarr_store\n"
    "from kickdyn.sweeps.grid import grid\n"
    "from kickdyn.sweeps.kick import Kick\n"
    "zarr_store.CHUNK = 50\n"
    "leg = kd.Leg.human()\n"
    "postures = grid(leg, ['hip=0:90:15', 'knee=0:30:5', 'ankle=0:50:10'])\n"
    "kick = Kick(speed=4.0, attack=0.0, friction=0.1, air=None)\n"
)
"""The same sweep, to begin in another process."""


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr(zarr_store, "CHUNK", 50)


def files(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_store_is_the_dataset_in_memory(tmp_path):
    chunk_summary = stream(tmp_path / "s.zarr", LEG, POSTURES, KICK, threads=2)
    whole = zarr_store.Store(tmp_path / "s.zarr", LEG, POSTURES, KICK, CARRY_ERROR, resume=True)
    assert whole.missing() == []
    small = sweep(LEG, POSTURES, KICK)
    with xr.open_zarr(tmp_path / "s.zarr", consolidated=False) as data:
        assert dict(data.sizes) == dict(small.sizes)
        for name in ("hip", "knee", "ankle", "status"):
            assert (data[name].values == small[name].values).all()
        for name in VARIABLES:
            size = 10.0 if "residual" in name else np.abs(small[name].values).max()
            np.testing.assert_allclose(data[name], small[name], rtol=1e-11, atol=1e-13 * size)
            assert data[name].attrs == small[name].attrs
        speed, load = data.ball_speed.values.ravel(), data.worst_joint_impulse.values.ravel()
    possible = small.status.values.ravel() == 0
    assert chunk_summary["counts"]["ok"] == possible.sum()
    assert chunk_summary["best"] == [speed[possible].max(), np.where(possible, speed, -1).argmax()]
    front = {number for _, _, number in chunk_summary["front"]}
    for i in np.flatnonzero(possible):
        beaten = possible & (speed >= speed[i]) & (load <= load[i])
        beaten &= (speed > speed[i]) | (load < load[i])
        assert (i in front) != beaten.any()


def test_killed_and_resumed_it_is_the_same_bit_by_bit(tmp_path):
    stream(tmp_path / "whole.zarr", LEG, POSTURES, KICK)
    script = SCRIPT + (
        "told = []\n"
        "def wait(count):\n"
        "    told.append(count)\n"
        "    if len(told) == 3: print('two chunks are done', flush=True), input()\n"
        "s.stream('s.zarr', leg, postures, kick, threads=1, progress=wait)\n"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", script], cwd=tmp_path, **pipes) as killed:
        assert killed.stdout.readline() == b"two chunks are done\n"
        os.kill(killed.pid, signal.SIGKILL)
    progress = tmp_path / "s.zarr" / "progress"
    done = {file.name for file in progress.glob("*.json")}
    assert 2 <= len(done) < 7
    computed = []
    stream(tmp_path / "s.zarr", LEG, POSTURES, KICK, resume=True, progress=computed.append)
    assert len(computed) == 1 + 7 - len(done)
    assert sum(computed) == POSTURES.size
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")
    again = stream(tmp_path / "s.zarr", LEG, POSTURES, KICK, resume=True)
    assert again["counts"]["ok"] > 0


def test_a_full_disk_or_ctrl_c_leaves_what_can_be_resumed(tmp_path, monkeypatch):
    stream(tmp_path / "whole.zarr", LEG, POSTURES, KICK)
    write, troubles = zarr_store.Store.write, []

    def fail(self, k, *args):
        trouble = troubles.pop() if troubles else None  # a thread may be at the next chunk already
        if trouble is not None:
            raise trouble
        write(self, k, *args)

    monkeypatch.setattr(zarr_store.Store, "write", fail)
    troubles[:] = [OSError(28, "No space left on device"), None, None]
    with pytest.raises(kd.KickdynError, match=r"No space left on device: \d of 7 chunks"):
        stream(tmp_path / "s.zarr", LEG, POSTURES, KICK)
    troubles[:] = [KeyboardInterrupt()]
    with pytest.raises(kd.KickdynError, match=r"interrupted: \d of 7 chunks"):
        stream(tmp_path / "s.zarr", LEG, POSTURES, KICK, resume=True)
    stream(tmp_path / "s.zarr", LEG, POSTURES, KICK, resume=True)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_what_is_there_is_not_overwritten(tmp_path):
    path = tmp_path / "s.zarr"
    stream(path, LEG, POSTURES, KICK)
    with pytest.raises(kd.InvalidInput, match="exists: --resume goes on"):
        stream(path, LEG, POSTURES, KICK)
    with pytest.raises(kd.InvalidInput, match=r"its foot_speed_m_s is 4\.0, this one's 5\.0"):
        stream(path, LEG, POSTURES, Kick(speed=5.0, air=None), resume=True)
    turned = Grid(dict(reversed(POSTURES.axes.items())))  # the same joints, numbered otherwise
    with pytest.raises(kd.InvalidInput, match="this one's ankle, knee, hip"):
        stream(path, LEG, turned, KICK, resume=True)
    with pytest.raises(kd.InvalidInput, match="its joints are hip, knee, ankle, this"):
        stream(path, LEG, grid(LEG, ["hip=0:90:15"]), KICK, resume=True)
    inside = POSTURES.axes | {"knee": POSTURES.axes["knee"] ** 1.01}
    inside["knee"][-1] = POSTURES.axes["knee"][-1]
    others = {
        "its ball_inertia_factor is": (
            LEG,
            POSTURES,
            replace(KICK, ball=kd.Ball(inertia_factor=0.4)),
        ),
        "its leg's model is not": (LEG.with_armature({"hip": 0.5}), POSTURES, KICK),
        "its attack_rad is": (LEG, POSTURES, replace(KICK, attack=KICK.attack + 1e-13)),
        "knee has 7 values from 0 to 30 deg there as here, but": (LEG, Grid(inside), KICK),
    }
    for said, (leg, postures, kick) in others.items():
        with pytest.raises(kd.InvalidInput, match=f"is of another sweep: {said}"):
            stream(path, leg, postures, kick, resume=True)
    attributes = json.loads((path / "zarr.json").read_text())
    attributes["attributes"]["source"] = "kickdyn 0.0"
    (path / "zarr.json").write_text(json.dumps(attributes))
    with pytest.raises(kd.InvalidInput, match=r"its source is 'kickdyn 0\.0'"):
        stream(path, LEG, POSTURES, KICK, resume=True)
    (tmp_path / "other.zarr").mkdir()
    with pytest.raises(kd.InvalidInput, match="is no sweep"):
        stream(tmp_path / "other.zarr", LEG, POSTURES, KICK, resume=True)
    with pytest.raises(kd.InvalidInput, match="cannot be written"):
        stream(tmp_path / "no" / "where.zarr", LEG, POSTURES, KICK)


def test_a_kernel_that_disagrees_stops_the_sweep(tmp_path, monkeypatch):
    monkeypatch.setattr(outcomes, "AGREEMENT", -1.0)
    with pytest.raises(kd.KickdynError, match="the sweep has effective_mass"):
        stream(tmp_path / "s.zarr", LEG, POSTURES, KICK)


def test_legs_without_a_kernel_are_swept_one_by_one(tmp_path):
    robot = kd.Leg.from_robot("bolt", base="floating")
    leg = robot.with_supports(kd.Support("FL_FOOT", point=True))
    postures, kick = grid(leg, ["FR_HFE=-30:30:30"]), Kick(speed=2.0, air=None)
    stream(tmp_path / "s.zarr", leg, postures, kick)
    with xr.open_zarr(tmp_path / "s.zarr", consolidated=False) as data:
        assert (data.impulse.values == sweep(leg, postures, kick).impulse.values).all()


def test_without_a_store_only_the_summary_is_kept(tmp_path):
    kept = stream(tmp_path / "s.zarr", LEG, POSTURES, KICK)
    seen = {}
    chunk_summary = stream(
        None, LEG, POSTURES, KICK, threads=2,
        see=lambda first, rows, status: seen.update({first: (rows, status)}),
    )  # fmt: skip
    assert chunk_summary == kept
    rows = np.concatenate([seen[first][0] for first in sorted(seen)], axis=1)
    with xr.open_zarr(tmp_path / "s.zarr", consolidated=False) as data:
        for row, name in zip(rows, VARIABLES, strict=True):
            assert (data[name].values.ravel() == row).all()
    with pytest.raises(kd.InvalidInput, match="fill a store"):
        stream(None, LEG, POSTURES, KICK, workers=2)
    with pytest.raises(kd.InvalidInput, match="looked at there"):
        stream(tmp_path / "t.zarr", LEG, POSTURES, KICK, see=lambda *_: None)
    with pytest.raises(kd.InvalidInput, match="exclude each other"):
        stream(tmp_path / "t.zarr", LEG, POSTURES, KICK, threads=2, workers=2)
    with pytest.raises(kd.InvalidInput, match="threads is 0"):
        stream(tmp_path / "t.zarr", LEG, POSTURES, KICK, threads=0)
    assert not (tmp_path / "t.zarr").exists()


def test_other_carries_are_another_sweep(tmp_path):
    kick = Kick()
    stream(tmp_path / "s.zarr", LEG, grid(LEG, ["hip=0:20:5"]), kick)
    with pytest.raises(kd.InvalidInput, match=r"its carry_error_m is 1e-06, this one's 0\.0"):
        stream(
            tmp_path / "s.zarr", LEG, grid(LEG, ["hip=0:20:5"]), kick, carry_error=0, resume=True
        )


def test_a_file_that_may_not_grow_ends_in_one_line_and_is_resumed(tmp_path):
    stream(tmp_path / "whole.zarr", LEG, POSTURES, KICK)
    script = SCRIPT + (
        "import resource\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (300, resource.RLIM_INFINITY))\n"
        "s.stream('s.zarr', leg, postures, kick, resume=True)\n"
    )
    zarr_store.Store(tmp_path / "s.zarr", LEG, POSTURES, KICK, resume=False)
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert re.search(r"File too large: 0 of 7 chunks are in s\.zarr, --resume", ended.stderr)
    stream(tmp_path / "s.zarr", LEG, POSTURES, KICK, resume=True)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")
