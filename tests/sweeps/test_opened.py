import json
import shutil

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps import zarr_store
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.netcdf_file import save
from kickdyn.sweeps.opened import Sweep
from kickdyn.sweeps.run import VARIABLES, sweep
from kickdyn.sweeps.stream import stream

LEG, KICK = kd.Leg.human(), Kick(speed=6.0, attack=0.0, air=None)
POSTURES = grid(LEG, ["hip=0:90:15", "knee=0:30:5", "ankle=0:50:10"])
WHERE = "knee < 25 and worst_joint_impulse <= 1.8"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A sweep as a store of seven chunks, the same half done, and as a file."""
    path = tmp_path_factory.mktemp("sweeps")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(zarr_store, "CHUNK", 50)
        stream(path / "s.zarr", LEG, POSTURES, KICK)
        half = []

        def stop(done):
            half.append(done)
            if len(half) == 4:
                raise KeyboardInterrupt

        with pytest.raises(kd.KickdynError, match="interrupted"):
            stream(path / "half.zarr", LEG, POSTURES, KICK, progress=stop)
    save(sweep(LEG, POSTURES, KICK), path / "s.nc")
    return path


@pytest.fixture(params=["s.zarr", "s.nc"])
def opened(folder, request):
    return kd.open_sweep(folder / request.param)


def by_force(found, condition=lambda column: True):
    """Return the postures that count, with all their numbers, from the whole dataset."""
    data = found.data[[*VARIABLES, "status"]].load()
    columns = {name: data[name].values.ravel() for name in (*VARIABLES, "status")}
    mesh = np.meshgrid(*(data[name].values for name in found.space.axes), indexing="ij")
    columns |= {n: np.degrees(m).ravel() for n, m in zip(found.space.axes, mesh, strict=True)}
    columns["number"] = np.arange(found.space.size)
    mask = (columns["status"] == 0) & condition(columns)
    return {name: values[mask] for name, values in columns.items()}


def meant(columns):
    return (columns["knee"] < 24.9) & (columns["worst_joint_impulse"] <= 1.8)


def test_best_top_and_front_are_those_of_the_whole_dataset(opened):
    for where, condition in ((None, lambda _: True), (WHERE, meant)):
        rows = by_force(opened, condition)
        assert 5 < len(rows["number"]) < POSTURES.size
        order = np.argsort(-rows["ball_speed"], kind="stable")
        top = opened.top(5, where=where)
        assert top.number.values.tolist() == rows["number"][order[:5]].tolist()
        best = opened.best(where=where)
        for name in (*VARIABLES, *opened.space.axes):
            assert float(best[name]) == pytest.approx(rows[name][order[0]], rel=1e-12)
        front = set(opened.front(where=where).number.values)
        speed, load = rows["ball_speed"], rows["worst_joint_impulse"]
        for i, number in enumerate(rows["number"]):
            beaten = (
                (speed >= speed[i]) & (load <= load[i]) & ((speed > speed[i]) | (load < load[i]))
            )
            assert (number in front) != beaten.any()
        assert opened.where(where or "1 < 2").count() == len(rows["number"])


def test_the_cheapest_posture_that_is_fast_enough(opened):
    best = opened.best("-worst_joint_impulse", where="ball_speed >= 7")
    rows = by_force(opened, lambda columns: columns["ball_speed"] >= 7)
    assert float(best.worst_joint_impulse) == rows["worst_joint_impulse"].min()


def test_marginals_and_samples_are_of_what_counts(opened):
    chosen, rows = opened.where(WHERE), by_force(opened, meant)
    knee = chosen.marginal("knee", of="launch_angle")
    for value, group in knee.groupby("knee"):
        angles = np.degrees(rows["launch_angle"][np.isclose(rows["knee"], value)])
        assert int(group["count"].squeeze()) == len(angles)
        if len(angles):
            assert float(group["mean"].squeeze()) == pytest.approx(angles.mean(), rel=1e-12)
    sample = chosen.sample(10, seed=1)
    assert sample.sizes["posture"] == 10
    assert set(sample.number.values) <= set(rows["number"])
    assert opened.marginal("hip", "ankle").best.shape == (7, 6)


def test_counts_are_of_all(opened):
    status = opened.data.status.values
    assert opened.counts() == {
        "ok": (status == 0).sum(), "too fast": (status == 1).sum(), "out of reach": 0,
    }  # fmt: skip
    assert opened.counts()["too fast"] > 0


def test_only_what_is_needed_is_read(opened, monkeypatch):
    read = []
    block = Sweep._block

    def watched(self, part):
        found = block(self, part)
        return type(found)(
            found.space, found.numbers, lambda name: (read.append(name), found.read(name))[1]
        )

    monkeypatch.setattr(Sweep, "_block", watched)
    opened.marginal("knee", where="carry > 0.1")
    assert set(read) == {"carry", "ball_speed"}


def test_a_sweep_says_what_it_is(folder):
    whole = kd.open_sweep(folder / "s.zarr")
    assert repr(whole.where("knee<30")).splitlines()[1:] == [
        "  hip: 0 to 90 deg, 7 values each 15",
        "  knee: 0 to 30 deg, 7 values each 5",
        "  ankle: 0 to 50 deg, 6 values each 10",
        "  where knee<30",
    ]
    assert "s.zarr: leg_human, foot 6 m/s at 0 deg, 294 postures>" in repr(whole)
    assert whole.finished


def test_an_unfinished_store_answers_for_what_is_done(folder):
    half, whole = kd.open_sweep(folder / "half.zarr"), kd.open_sweep(folder / "s.zarr")
    assert not half.finished
    chunks = len(list((folder / "half.zarr" / "progress").glob("*.json")))
    assert 3 <= chunks < 7
    done = 42 * chunks
    assert f"unfinished: {done} of 294 postures, {done / 294:.1%}>" in repr(half)
    same = half.where("1 < 2").blocks()
    for one, two in zip(same, whole.blocks(), strict=False):
        assert (one("ball_speed") == two("ball_speed")).all()
    assert sum(half.counts().values()) == half.postures == done


def test_nothing_that_fulfils_is_said(opened):
    with pytest.raises(kd.InvalidInput, match=r"fulfils \(hip < 0\) and \(knee > 1\): there is"):
        opened.where("hip < 0").best(where="knee > 1")
    assert opened.front(where="hip < 0").sizes["posture"] == 0
    assert opened.sample(where="hip < 0").sizes["posture"] == 0


def test_what_is_no_sweep(folder, tmp_path):
    with pytest.raises(kd.InvalidInput, match=r"no\.zarr: there is no such sweep"):
        kd.open_sweep(tmp_path / "no.zarr")
    (tmp_path / "text.nc").write_text("no netCDF")
    (tmp_path / "empty.zarr").mkdir()
    for name in ("text.nc", "empty.zarr"):
        with pytest.raises(kd.InvalidInput, match=f"{name} cannot be read as a sweep"):
            kd.open_sweep(tmp_path / name)
    shutil.copytree(folder / "s.zarr", tmp_path / "less.zarr")
    shutil.rmtree(tmp_path / "less.zarr" / "carry")
    with pytest.raises(kd.InvalidInput, match=r"less\.zarr is no sweep: it has no carry"):
        kd.open_sweep(tmp_path / "less.zarr")


def test_provenance_comes_along(opened):
    best = opened.best()
    assert best.attrs["leg"] == "leg_human"
    assert json.dumps({k: str(v) for k, v in best.attrs.items()})
    assert best.carry.attrs["units"] == "m"
    assert best.hip.attrs["units"] == "deg"
