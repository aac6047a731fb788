import math

import numpy as np
import pytest
import xarray as xr

import kickdyn as kd
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kick import Kick, kick_from
from kickdyn.sweeps.netcdf_file import save
from kickdyn.sweeps.run import VARIABLES, sweep

LEG = kd.Leg.human()
KICK = Kick(attack=0.0)


@pytest.fixture(scope="module")
def swept():
    return sweep(LEG, grid(LEG, ["hip=0:90:45", "knee=0:30:15", "ankle=0:50:50"]), KICK)


def test_every_cell_is_the_posture_it_says(swept):
    for hip in range(3):
        for ankle in range(2):
            cell = swept.isel(hip=hip, knee=1, ankle=ankle)
            q = [float(cell.hip), float(cell.knee), float(cell.ankle)]
            outcome = kick_from(LEG.posture(q), KICK)
            assert float(cell.speed_ratio) == outcome.hit.speed_ratio
            assert float(cell.effective_mass) == outcome.hit.effective_mass
            assert float(cell.carry) == outcome.carry
            assert float(cell.worst_joint_impulse) == outcome.hit.worst_joint[1]


def test_many_are_what_each_is(monkeypatch):
    kick, postures = (
        Kick(attack=0.0, speed=9.0),
        ["hip=-20:100:8", "knee=0:130:13", "ankle=-20:50:7"],
    )
    chunk_summary = []
    one_by_one = sweep(LEG, grid(LEG, postures), kick, lambda *done: chunk_summary.append(done))
    assert [count for count, _ in chunk_summary] == [1] * one_by_one.status.size
    best = max(each for _, each in chunk_summary if each is not None)
    monkeypatch.setattr("kickdyn.sweeps.run.KERNEL_FROM", 1)
    chunk_summary.clear()
    kicked = []
    monkeypatch.setattr("kickdyn.sweeps.run.kick_from", lambda *_: kicked.append(1))
    together = sweep(LEG, grid(LEG, postures), kick, lambda *done: chunk_summary.append(done))
    assert not kicked
    assert sum(count for count, _ in chunk_summary) == one_by_one.status.size
    assert max(each for _, each in chunk_summary if each is not None) == pytest.approx(
        best, rel=1e-12
    )
    assert set(np.unique(one_by_one.status)) == {0, 1}
    for name in {*VARIABLES, "status"} - {"restitution_residual", "momentum_residual"}:
        slack = 1e-8 if name == "carry" else 1e-12
        assert together[name].values == pytest.approx(one_by_one[name].values, rel=slack, abs=1e-12)


def test_units_and_provenance(swept):
    assert {name: swept[name].attrs["units"] for name in VARIABLES} == {
        name: unit for name, (unit, _) in VARIABLES.items()
    }
    assert swept.hip.attrs["units"] == "rad"
    assert swept.hip_deg.values == pytest.approx([0, 45, 90])
    assert swept.attrs["source"].startswith(f"kickdyn {kd.__version__} (pin 4.")
    assert len(swept.attrs["leg_sha256"]) == 64
    assert swept.attrs["attack_deg"] == 0.0


def test_nan_only_where_the_status_says_out_of_reach():
    model = LEG.model
    model.upperPositionLimit = np.array([2.0, 2.0, 2.0])
    leg = kd.Leg.from_model(model, "toe")
    slow = Kick(attack=0.0, speed=0.1)
    data = sweep(leg, grid(leg, ["hip=90", "knee=0", "ankle=80:90:10"]), slow)
    assert data.status.values.ravel().tolist() == [0, 2]
    for name in VARIABLES:
        assert np.isnan(data[name].values.ravel()).tolist() == [False, True]


def test_residuals_stay_at_rounding(swept):
    assert float(swept.restitution_residual.max()) < 1e-12
    assert float(swept.momentum_residual.max()) < 1e-12


def test_progress_is_told_each_posture():
    chunk_summary = []
    sweep(LEG, grid(LEG, ["knee=0:20:10"]), KICK, lambda *one: chunk_summary.append(one))
    assert [count for count, _ in chunk_summary] == [1, 1, 1]
    assert chunk_summary[2][1][1] == 2


def test_netcdf_keeps_everything(swept, tmp_path):
    save(swept, tmp_path / "sweep.nc")
    with xr.open_dataset(tmp_path / "sweep.nc") as back:
        xr.testing.assert_identical(back.load(), swept)


@pytest.mark.parametrize(
    ("name", "words"),
    [("sweep.csv", "written as .nc"), ("no/where.nc", "cannot be written"), (".nc", "ending")],
)
def test_bad_files(swept, tmp_path, name, words):
    with pytest.raises(kd.InvalidInput, match=words):
        save(swept, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file(swept, tmp_path, monkeypatch):
    (tmp_path / "sweep.nc").write_text("old")

    def fail(self, *args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", fail)
    with pytest.raises(kd.InvalidInput, match="No space left"):
        save(swept, tmp_path / "sweep.nc")
    assert [(f.name, f.read_text()) for f in tmp_path.iterdir()] == [("sweep.nc", "old")]


def test_attack_down_does_not_carry():
    data = sweep(LEG, grid(LEG, ["knee=10"]), Kick(attack=math.radians(-40)))
    assert float(data.carry[0]) == 0.0
