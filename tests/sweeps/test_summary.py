import json

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps import chunk_solver, summary
from kickdyn.sweeps.dataset import describe
from kickdyn.sweeps.grid import Grid, read_postures
from kickdyn.sweeps.queries import condition, pareto_front, possible
from kickdyn.sweeps.summary import Summary, joint_values_by_unit, summarize
from kickdyn.sweeps.sweep import sweep_chunks

LEG = kd.Leg.human()
KICK = kd.Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
POSTURES = read_postures(LEG, ["hip=0:90:15", "knee=0:30:5", "ankle=0:50:10"])
WHERE = "knee > 5 and ball_speed < 6.1"


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(chunk_solver, "SLOW_CHUNK", 50)
    monkeypatch.setattr(summary, "SAMPLE_SIZE", 7)


@pytest.fixture(scope="module")
def data():
    return kd.sweep(LEG, POSTURES, KICK)


def by_chunks(where=None):
    found = Summary(describe(LEG, Grid.of(LEG, POSTURES), KICK, 0.0), where)
    for chunk in sweep_chunks(LEG, POSTURES, KICK):
        found.add(chunk)
    return found


@pytest.mark.parametrize("where", [None, WHERE, "hip > 20"])
def test_chunks_give_what_the_whole_dataset_gives(data, where):
    for found in (by_chunks(where), summarize(data, where)):
        chosen = possible(data) if where is None else possible(data) & condition(data, where)
        speed = data.ball_speed.where(chosen)
        assert found.counts["ok"] == int(possible(data).sum()) < found.postures == 294
        assert found.counts["too-fast"] == int((data.status == 1).sum())
        residuals = data.restitution_residual.max(), data.momentum_residual.max()
        assert found.residual == max(residuals)
        assert found.chosen == int(chosen.sum()) > 20
        ordered = np.sort(speed.values[chosen.values])[::-1]
        assert found.best[:, 0].tolist() == ordered[:10].tolist()
        for column, name in enumerate(("ball_speed", "worst_joint_impulse")):
            at = data[name].values.ravel()[found.best[:, 2].astype(int)]
            assert at.tolist() == found.best[:, column].tolist()
        assert data.ball_speed.values.ravel()[found.worst] == ordered[-1]
        pairs = {("hip", "knee"): "ankle", ("hip", "ankle"): "knee", ("knee", "ankle"): "hip"}
        assert set(found.maps) == set(pairs)
        for names, other in pairs.items():
            assert found.maps[names].best == pytest.approx(speed.max(other).values, nan_ok=True)
            for name, values in found.maps[names].values.items():
                assert values == pytest.approx(data[f"{name}_deg"].values, rel=1e-15)
        front = pareto_front(data, where=where)
        assert found.front[:, 0].tolist() == front.ball_speed.values.tolist()
        names = ("worst_joint_impulse", "ball_speed", "speed_use")
        rows = np.column_stack([data[name].values[chosen.values] for name in names])
        assert len(found.sample) == 7
        assert {*map(tuple, found.sample)} <= {*map(tuple, rows)}


def test_the_sample_is_random_and_repeatable(data):
    sample = summarize(data).sample
    assert (by_chunks().sample == by_chunks().sample).all()
    assert (by_chunks().sample == sample).all()
    names, counts = ("worst_joint_impulse", "ball_speed", "speed_use"), possible(data).values
    rows = np.column_stack([data[name].values[counts] for name in names])
    numbers = [int(np.flatnonzero((rows == row).all(axis=1))[0]) for row in sample]
    assert len(set(numbers)) == 7
    assert np.ptp(numbers) > len(rows) / 2
    assert np.ptp(np.diff(numbers)) > 1


def test_nothing_to_choose_from(data):
    found = summarize(data, "knee > 100")
    assert (found.chosen, found.worst, len(found.best), found.counts["ok"] > 0) == (0, -1, 0, True)
    assert found.as_json()["best"] == found.as_json()["front"]
    empty = found.as_json()["best"]
    assert empty["angles_deg"]["hip"] == empty["ball_speed"] == empty["worst_joint_impulse"] == []


def test_what_is_kept_is_plain(data):
    kept = json.loads(json.dumps(summarize(data).as_json()))
    assert set(kept) == {"best", "front"}
    for rows in kept.values():
        for i, speed in enumerate(rows["ball_speed"]):
            place = {name: np.radians(rows["angles_deg"][name][i]) for name in POSTURES}
            at = data.sel(place, method="nearest")
            assert float(at.ball_speed) == speed
            assert float(at.worst_joint_impulse) == rows["worst_joint_impulse"][i]
    assert len(kept["best"]["angles_deg"]["hip"]) == 10


def test_values_of_joints_are_named_by_their_unit():
    values, units = {"hip": 30.0, "rail": 0.2}, {"hip": "deg", "rail": "m"}
    by_unit = joint_values_by_unit(values, units)
    assert by_unit == {"angles_deg": {"hip": 30.0}, "positions_m": {"rail": 0.2}}


def test_neighbours_go_together(data, monkeypatch):
    monkeypatch.setattr(summary, "BINS", 2)
    speed = data.ball_speed.where(possible(data)).max("hip").values
    quarters = [speed[a, b].max() for a in (slice(4), slice(4, 7)) for b in (slice(3), slice(3, 6))]
    for found in (summarize(data), by_chunks()):
        binned = found.maps["knee", "ankle"]
        assert binned.values["ankle"] == pytest.approx([10.0, 40.0])
        assert binned.values["knee"] == pytest.approx([7.5, 25.0])
        assert binned.best.ravel() == pytest.approx(quarters)


def test_a_single_joint_has_a_line():
    data = kd.sweep(LEG, {"hip": [0.3], "knee": np.linspace(0.0, 0.5, 4)}, KICK)
    (line,) = summarize(data).maps.values()
    assert list(line.values) == ["knee"]
    assert line.best.tolist() == data.ball_speed.values.ravel().tolist()


def test_bad_conditions_are_refused_before_anything_is_computed():
    described = describe(LEG, Grid.of(LEG, POSTURES), KICK, 0.0)
    with pytest.raises(kd.InvalidInput, match=r"names 'kne', .* carry \[m\]"):
        Summary(described, "kne < 30")


def test_what_is_kept_must_suffice(data):
    few = data.drop_vars(["restitution_residual", "momentum_residual", "carry"])
    assert np.isnan(summarize(few).residual)
    assert summarize(few).best.tolist() == summarize(data).best.tolist()
    with pytest.raises(kd.InvalidInput, match="'carry', which this sweep does not keep: there are"):
        summarize(few, "carry > 1")
    with pytest.raises(kd.InvalidInput, match="does not keep speed_use: its summary needs it"):
        summarize(data.drop_vars("speed_use"))
