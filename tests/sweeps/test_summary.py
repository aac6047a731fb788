import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps import chunk_solver, summary
from kickdyn.sweeps.dataset import describe
from kickdyn.sweeps.grid import Grid, read_postures
from kickdyn.sweeps.queries import condition, pareto_front, possible
from kickdyn.sweeps.summary import Summary, summarize
from kickdyn.sweeps.sweep import sweep_chunks

LEG = kd.Leg.human()
KICK = kd.Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
POSTURES = read_postures(LEG, ["hip=0:90:15", "knee=0:30:5", "ankle=0:50:10"])
WHERE = "knee > 5 and ball_speed < 6.1"


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(chunk_solver, "SLOW_CHUNK", 50)
    monkeypatch.setattr(summary, "SAMPLE", 7)


@pytest.fixture(scope="module")
def data():
    return kd.sweep(LEG, POSTURES, KICK)


def by_chunks(where=None):
    found = Summary(describe(LEG, Grid.of(LEG, POSTURES), KICK, 0.0), where)
    for chunk in sweep_chunks(LEG, POSTURES, KICK):
        found.add(chunk)
    return found


@pytest.mark.parametrize("where", [None, WHERE])
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
        best = dict(zip(found.columns, found.best.T, strict=True))
        assert best["ball_speed"].tolist() == ordered[:10].tolist()
        assert data.ball_speed.values.ravel()[found.best_numbers].tolist() == ordered[:10].tolist()
        assert data.ball_speed.values.ravel()[found.worst] == ordered[-1]
        for values, knee in zip(data.knee_deg.values[[0, 3]], (0, 3), strict=True):
            assert found.marginals["knee",].values["knee"][knee] == values
        for name in ("hip", "knee", "ankle"):
            others = [each for each in POSTURES if each != name]
            marginal = found.marginals[name,]
            assert marginal.best == pytest.approx(speed.max(others).values, nan_ok=True)
            assert marginal.mean == pytest.approx(speed.mean(others).values, nan_ok=True)
            assert marginal.count.tolist() == chosen.sum(others).values.tolist()
        pair = found.marginals["hip", "ankle"]
        assert pair.best == pytest.approx(speed.max("knee").values, nan_ok=True)
        front = pareto_front(data, where=where)
        assert found.front[:, 0].tolist() == front.ball_speed.values.tolist()
        sample = dict(zip(found.columns, found.sample.T, strict=True))
        assert len(sample["carry"]) == 7
        assert set(sample["carry"]) <= set(data.carry.values[chosen.values])


def test_the_sample_is_random_and_repeatable():
    assert (by_chunks().sample == by_chunks().sample).all()
    assert len(np.unique(by_chunks().sample, axis=0)) == 7


def test_nothing_to_choose_from(data):
    found = summarize(data, "knee > 100")
    assert (found.chosen, found.worst, len(found.best), found.counts["ok"] > 0) == (0, -1, 0, True)
    assert found.as_json()["marginals"]["hip"]["best"] == [None] * 7


def test_what_is_kept_is_plain(data):
    kept = summarize(data).as_json()
    assert set(kept) == {"best", "front", "marginals", "sample"}
    assert kept["best"]["hip"][0] in data.hip_deg.values
    assert len(kept["front"]["knee"]) == len(kept["front"]["ball_speed"])
    assert set(kept["marginals"]["knee"]) == {"knee", "best", "mean", "count"}


def test_without_details_nothing_is_drawn_or_kept(data):
    found = Summary(data, detailed=False)
    found.add(data)
    assert (found.marginals, len(found.sample), len(found.best)) == ({}, 0, 10)


def test_neighbours_go_together(data, monkeypatch):
    monkeypatch.setattr(summary, "BINS", 2)
    marginal = summarize(data).marginals["ankle",]
    assert marginal.values["ankle"] == pytest.approx([10.0, 40.0])
    speed = data.ball_speed.where(possible(data)).max(("hip", "knee")).values
    assert marginal.best == pytest.approx([speed[:3].max(), speed[3:].max()])


def test_bad_conditions_are_refused_before_anything_is_computed():
    described = describe(LEG, Grid.of(LEG, POSTURES), KICK, 0.0)
    with pytest.raises(kd.InvalidInput, match=r"names 'kne', .* carry \[m\]"):
        Summary(described, "kne < 30")
