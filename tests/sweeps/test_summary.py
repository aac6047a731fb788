"""A summary by chunks is that of the whole dataset."""

import json

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps import chunk_solver, summary
from kickdyn.sweeps.dataset import describe
from kickdyn.sweeps.grid import Grid, read_postures
from kickdyn.sweeps.queries import condition, pareto_front, possible
from kickdyn.sweeps.summary import (
    KEPT_POSTURES,
    SpeedMap,
    Summary,
    joint_values_by_unit,
    summarize,
)
from kickdyn.sweeps.sweep import sweep_chunks

LEG, KICK = kd.Leg.human(), kd.Kick(speed=6.5, attack=0.0, friction=0.1, air=None)
G1 = kd.Leg.from_robot("g1", base="fixed", legs_only=True)
POSTURES = read_postures(LEG, ["hip=0:90:30", "knee=0:30:10", "ankle=0:50:25"])
NAMES = ("worst_joint_impulse", "ball_speed", "speed_use")


@pytest.fixture(autouse=True)
def small_samples(monkeypatch):
    monkeypatch.setattr(summary, "SAMPLE_SIZE", 7)


@pytest.fixture(scope="module")
def data():
    return kd.sweep(LEG, POSTURES, KICK)


@pytest.fixture(scope="module")
def chunks():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunk_solver, "CHUNK", 12)
        return list(sweep_chunks(LEG, POSTURES, KICK))


def by_chunks(chunks, where=None):
    result = Summary(describe(LEG, Grid.of(LEG, POSTURES), KICK, 0.0), where)
    for chunk in chunks:
        result.add(chunk)
    return result


@pytest.mark.parametrize("where", [None, "knee > 5 and ball_speed < 10.5", "hip > 20"])
def test_chunks_give_the_summary_of_the_whole_dataset(data, chunks, where):
    assert len(chunks) > 3
    for result in (by_chunks(chunks, where), summarize(data, where)):
        chosen = possible(data) if where is None else possible(data) & condition(data, where)
        speed = data.ball_speed.where(chosen)
        assert result.counts["ok"] == int(possible(data).sum()) < result.postures == 48
        assert result.counts["too-fast"] == int((data.status == 1).sum()) > 0
        residuals = data.restitution_residual.max(), data.momentum_residual.max()
        assert result.residual == max(residuals)
        assert result.chosen == int(chosen.sum()) > 2
        ordered = np.sort(speed.values[chosen.values])[::-1]
        assert result.best[:, 0].tolist() == ordered[:KEPT_POSTURES].tolist()
        places = result.best[:, 2].astype(int)
        for column, name in enumerate(("ball_speed", "worst_joint_impulse")):
            assert data[name].values.ravel()[places].tolist() == result.best[:, column].tolist()
        assert data.ball_speed.values.ravel()[result.worst] == ordered[-1]
        front = pareto_front(data, where=where)
        assert result.front[:, 0].tolist() == front.ball_speed.values.tolist()
        pairs = {("hip", "knee"): "ankle", ("hip", "ankle"): "knee", ("knee", "ankle"): "hip"}
        assert set(result.maps) == set(pairs)
        for names, other in pairs.items():
            assert result.maps[names].best == pytest.approx(speed.max(other).values, nan_ok=True)
            for name, values in result.maps[names].values.items():
                assert values == pytest.approx(data[f"{name}_deg"].values)


def test_maps_are_over_pairs_of_the_three_longest_axes():
    names = G1.joint_names[-4:]
    for sizes, pairs in (((2, 5, 3, 4), {(1, 2), (1, 3), (2, 3)}), ((3, 1, 2, 1), {(0, 2)})):
        axes = {name: np.linspace(0.1, 0.2, k) for name, k in zip(names, sizes, strict=True)}
        maps = Summary(describe(G1, Grid.of(G1, axes), KICK, 0.0)).maps
        assert {tuple(map(names.index, pair)) for pair in maps} == pairs


def test_a_map_of_long_axes_joins_neighbours(monkeypatch):
    """Seven values in three bins, in two blocks; nan where there is no posture."""
    monkeypatch.setattr(summary, "BINS", 3)
    axes = {"hip": np.arange(7.0) ** 2, "knee": np.array([0.1, 0.5])}
    speeds = np.random.default_rng(0).normal(size=(7, 2))
    speeds[3:5, 1] = np.nan
    speed_map = SpeedMap(axes, ("hip", "knee"))
    for begin, end in ((0, 4), (4, 7)):
        speed_map.add({"hip": begin, "knee": 0}, speeds[begin:end])
    bins = [slice(0, 3), slice(3, 5), slice(5, 7)]
    assert speed_map.values["hip"].tolist() == [axes["hip"][k].mean() for k in bins]
    best = [np.fmax.reduce(speeds[k]) for k in bins]
    np.testing.assert_array_equal(speed_map.best, best)


def test_the_sample_is_random_repeatable_and_of_chosen_postures(data, chunks):
    sample = summarize(data).sample
    assert (by_chunks(chunks).sample == sample).all()
    rows = np.column_stack([data[name].values[possible(data).values] for name in NAMES])
    numbers = [int(np.flatnonzero((rows == row).all(axis=1))[0]) for row in sample]
    assert len(set(numbers)) == 7
    assert np.ptp(numbers) > len(rows) / 3
    assert np.ptp(np.diff(numbers)) > 1


def test_the_best_and_the_front_are_written_as_plain_values(data):
    kept = json.loads(json.dumps(summarize(data).as_json()))
    for rows in (kept["best"], kept["front"]):
        for i, speed in enumerate(rows["ball_speed"]):
            place = {name: np.radians(rows["angles_deg"][name][i]) for name in POSTURES}
            at = data.sel(place, method="nearest")
            assert float(at.ball_speed) == speed
            assert float(at.worst_joint_impulse) == rows["worst_joint_impulse"][i]
    assert len(kept["best"]["angles_deg"]["hip"]) == KEPT_POSTURES
    values, units = {"hip": 30.0, "rail": 0.2}, {"hip": "deg", "rail": "m"}
    by_unit = {"angles_deg": {"hip": 30.0}, "positions_m": {"rail": 0.2}}
    assert joint_values_by_unit(values, units) == by_unit
