import pickle

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps.chunk_job import Job, chunk_summary, merged
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.zarr_store import Store


def test_nothing_possible_has_neither_best_nor_front():
    empty = {"counts": {"ok": 0, "too fast": 2, "out of reach": 1}, "residual": 0.0}
    found = merged([{**empty, "best": None, "worst": None, "front": []}] * 2)
    assert found["best"] is found["worst"] is None
    assert found["front"] == []
    assert found["counts"]["too fast"] == 4


@pytest.mark.parametrize("seed", range(4))
def test_the_front_is_what_nothing_beats(seed):
    draw, n = np.random.default_rng(seed), 3000
    rows, status = draw.normal(size=(13, n)), draw.integers(0, 2, n).astype(np.int8)
    rows[[3, 7]] = np.round(draw.gamma(3.0, size=(2, n)), 2)  # with ties
    rows[7] += rows[3]
    parts = [chunk_summary(i, rows[:, i : i + 70], status[i : i + 70]) for i in range(0, n, 70)]
    found = merged(parts)
    speed, load = rows[3], rows[7]
    front = {number for _, _, number in found["front"]}
    for i in np.flatnonzero(status == 0):
        better = (status == 0) & (speed >= speed[i]) & (load <= load[i])
        beaten = (better & ((speed > speed[i]) | (load < load[i]))).any()
        twin = (better & (np.arange(n) < i)).any()
        assert (i in front) == (not beaten and not twin)
    assert found["best"][0] == speed[status == 0].max()
    assert found["worst"][0] == speed[status == 0].min()
    assert merged(parts[::-1])["front"] == found["front"]


def test_a_job_goes_where_it_is_sent(tmp_path):
    leg, kick = kd.Leg.human(), Kick(air=None)
    postures = grid(leg, ["hip=0:40:10"])
    job = Job(str(tmp_path / "s.zarr"), leg, postures, kick, 0.0)
    with pytest.raises(kd.InvalidInput, match=r"s\.zarr is not there"):
        job.prepare()
    store = Store(tmp_path / "s.zarr", leg, postures, kick, resume=False)
    assert pickle.loads(pickle.dumps(job))(0) == 5
    assert store.missing() == []
