"""Measurements: the front of time and error, and what counts as a time."""

from types import SimpleNamespace

import measurement
import pytest
from measurement import Measurement, front_figure, mark_front, shortest_time


def test_the_front_has_what_no_other_beats_in_time_and_error():
    pairs = [(1e-3, 1.0), (1e-6, 2.0), (1e-6, 3.0), (1e-5, 2.5), (1e-9, 9.0), (1e-2, 1.0)]
    rows = mark_front([Measurement("full", "", "", error, time) for error, time in pairs])
    assert [row.pareto for row in rows] == [True, True, False, False, True, False]


def test_a_panel_has_the_front_and_the_times_of_every_method():
    impacts = [
        Measurement("frictionless", "Pinocchio impulseDynamics", "", 1e-16, 2e-4, pareto=True),
        Measurement("frictionless", "MuJoCo", "a", 1e-2, 1e-4, pareto=True),
        Measurement("frictionless", "MuJoCo", "b", 1e-2, 3e-4),
    ]
    flights = [Measurement("full", str(i), "", 1e-3, 1e-3, 9, True) for i in range(9)]
    left, right = front_figure(impacts, flights).axes
    front, *methods = left.lines
    assert front.get_xdata().tolist() == [1e-4, 2e-4]
    times = {line.get_label(): line.get_xdata().tolist() for line in methods}
    assert times == {"Pinocchio impulseDynamics": [2e-4], "MuJoCo": [1e-4, 3e-4]}
    looks = {(line.get_marker(), line.get_color()) for line in right.lines[1:]}
    assert len(looks) == 9


@pytest.mark.parametrize(
    ("ticks", "shortest"),
    [
        ([0.0, 1e-4, 1.0, 1.02, 2.0, 2.01, 3.0, 3.03], 0.01 / 200),
        ([0.0, 5.0, 5.0, 6.0, 6.0, 9.0], 1.0),
    ],
    ids=["0.1 ms for the first call, then three timings of 200 calls", "three timings of a call"],
)
def test_the_shortest_mean_of_several_timings_counts(ticks, shortest, monkeypatch):
    clock = SimpleNamespace(process_time=lambda ticks=iter(ticks): next(ticks))
    monkeypatch.setattr(measurement, "time", clock)
    assert shortest_time(lambda: None) == pytest.approx(shortest)
