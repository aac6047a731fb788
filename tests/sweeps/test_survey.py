import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps import survey, zarr_store
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.opened import open_sweep
from kickdyn.sweeps.stream import stream
from kickdyn.sweeps.survey import Survey

LEG = kd.Leg.human()
KICK = Kick(speed=4.0, attack=0.0, friction=0.1, air=None)
POSTURES = grid(LEG, ["hip=0:90:15", "knee=0:30:5", "ankle=0:50:10"])
WHERE = "knee > 5 and ball_speed < 6.5"


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(zarr_store, "CHUNK", 50)
    monkeypatch.setattr(survey, "SAMPLE", 7)


@pytest.mark.parametrize("where", [None, WHERE])
def test_it_says_what_a_store_would(tmp_path, where):
    stream(tmp_path / "s.zarr", LEG, POSTURES, KICK)
    kept = open_sweep(tmp_path / "s.zarr")
    chosen = kept if where is None else kept.where(where)
    seen, progress = Survey(LEG, POSTURES, KICK, where), []
    seen.run(threads=2, progress=lambda *chunk_summary: progress.append(chunk_summary))
    assert seen.counts == kept.counts()
    assert seen.chosen == chosen.count() > 20
    assert sum(count for count, _ in progress) == POSTURES.size
    best = chosen.top(survey.BEST)
    assert progress[-1][1] == (best.ball_speed[0], best.number[0])
    assert seen.top.numbers.tolist() == best.number.values.tolist()
    assert seen.top.rows[:, 3 + 3].tolist() == best.ball_speed.values.tolist()
    angles = seen.lines()[0].angles
    assert angles["hip"] == pytest.approx(float(best.hip[0]))
    assert seen.lines()[1].numbers["ball_speed"] == pytest.approx(
        float(chosen.best("-ball_speed").ball_speed)
    )
    said = seen.as_json()
    front = chosen.front()
    for name in ("hip", "knee", "ankle", "ball_speed", "worst_joint_impulse"):
        assert said["front"][name] == front[name].values.tolist()
    for name in ("hip", "knee", "ankle"):
        expected = chosen.marginal(name)
        for key in ("best", "mean", "count"):
            found = np.array(said["marginals"][name][key], float)
            assert np.array_equal(found, expected[key].values.astype(float), equal_nan=True)
    drawn = chosen.sample(7)
    assert sorted(said["sample"]["carry"]) == sorted(drawn.carry.values.tolist())


def test_nothing_to_choose_from():
    seen = Survey(LEG, POSTURES, KICK, "knee > 100")
    seen.run(threads=1)
    assert (seen.lines(), seen.chosen, seen.counts["ok"] > 0) == ([], 0, True)
    assert seen.as_json()["marginals"]["hip"]["best"] == [None] * 7


def test_what_is_not_finite_is_none():
    assert survey._plain(np.array([1.5, np.nan, np.inf])) == [1.5, None, None]


def test_it_draws_what_a_sweep_draws(tmp_path):
    stream(tmp_path / "s.zarr", LEG, POSTURES, KICK)
    seen = Survey(LEG, POSTURES, KICK, WHERE, draws=True)
    seen.run(threads=2)
    one = seen.plot(lines=seen.lines())
    other = open_sweep(tmp_path / "s.zarr").where(WHERE).plot()
    assert one.get_suptitle() == other.get_suptitle()
    for ours, theirs in zip(one.axes[:3], other.axes[:3], strict=True):
        maps = [np.ma.filled(each.collections[0].get_array(), -1.0) for each in (ours, theirs)]
        assert np.array_equal(*maps, equal_nan=True)


def test_bad_input():
    with pytest.raises(kd.InvalidInput, match="names 'kne'"):
        Survey(LEG, POSTURES, KICK, "kne < 30")
