"""Measurements: the front of time and error, and what counts as a time."""

from types import SimpleNamespace

import measurement
import pytest
from measurement import Measurement, mark_front, shortest_time


def test_the_front_has_what_no_other_beats_in_time_and_error():
    pairs = [(1e-3, 1.0), (1e-6, 2.0), (1e-6, 3.0), (1e-5, 2.5), (1e-9, 9.0), (1e-2, 1.0)]
    rows = mark_front([Measurement("full", "", "", error, time) for error, time in pairs])
    assert [row.pareto for row in rows] == [True, True, False, False, True, False]


@pytest.mark.parametrize(
    ("ticks", "shortest"),
    [
        ([0.0, 1e-4, 1.0, 1.02, 2.0, 2.01, 3.0, 3.03], 0.01 / 200),
        ([0.0, 5.0, 5.0, 6.0, 6.0, 9.0], 1.0),
    ],
    ids=["0.1 ms for the first call, then three timings of 200 calls", "three timings of a call"],
)
def test_the_shortest_mean_of_several_timings_counts(ticks, shortest, monkeypatch):
    clock = iter(ticks)
    monkeypatch.setattr(measurement, "time", SimpleNamespace(process_time=lambda: next(clock)))
    assert shortest_time(lambda: None) == pytest.approx(shortest)
