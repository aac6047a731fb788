"""Measurements: what is timed, and the plot of errors."""

from types import SimpleNamespace

import measurement
import pytest
from measurement import (
    Measurement,
    front_figure,
    mark_front,
    shortest_time,
)


def test_the_front_has_what_no_other_beats_in_time_and_error():
    pairs = [(1e-3, 1.0), (1e-6, 2.0), (1e-6, 3.0), (1e-5, 2.5), (1e-9, 9.0), (1e-2, 1.0)]
    rows = mark_front([Measurement("full", "", "", error, time) for error, time in pairs])
    assert [row.pareto for row in rows] == [True, True, False, False, True, False]


def test_a_panel_per_scene_with_every_row_and_the_front():
    impacts = [
        Measurement("frictionless", "Pinocchio impulseDynamics", "", 1e-16, 2e-4, pareto=True),
        Measurement("frictionless", "MuJoCo", "a", 1e-2, 1e-4, pareto=True),
        Measurement("frictionless", "MuJoCo", "b", 1e-2, 3e-4),
    ]
    flights = [Measurement("vacuum", "closed form", "", 1e-15, 1e-4, 0, True)]
    flights += [Measurement("full", name, "", 1e-3, 1e-3, 9, True) for name in ("RK45", "heyoka")]
    left, right = front_figure(impacts, flights).axes
    assert left.get_title() == "impact, frictionless"
    assert right.get_title() == "flight, full"
    front, *methods = left.lines
    assert front.get_xdata().tolist() == [1e-4, 2e-4]
    assert [line.get_label() for line in methods] == ["Pinocchio impulseDynamics", "MuJoCo"]
    assert methods[1].get_xdata().tolist() == [1e-4, 3e-4]


def test_no_two_methods_of_one_panel_look_alike():
    rows = [Measurement("full", str(i), "", 1e-3, 1e-3, pareto=True) for i in range(9)]
    other = Measurement("drag only", "8", "", 1e-3, 1e-3, pareto=True)
    full, drag = front_figure([], [*rows, other, other]).axes
    looks = [(line.get_marker(), line.get_color()) for line in full.lines[1:]]
    assert len(set(looks)) == len(looks) == 9
    assert (drag.lines[1].get_marker(), drag.lines[1].get_color()) == looks[8]


def test_a_quick_call_is_timed_many_times_at_once(monkeypatch):
    """0.1 ms for the first call, then three timings of 200 calls, whose means count."""
    ticks = iter([0.0, 1e-4, 1.0, 1.02, 2.0, 2.01, 3.0, 3.03])
    monkeypatch.setattr(measurement, "time", SimpleNamespace(process_time=lambda: next(ticks)))
    calls = []
    assert shortest_time(lambda: calls.append(1)) == pytest.approx(0.01 / 200)
    assert len(calls) == 1 + 3 * 200


def test_the_shortest_of_several_timings_counts(monkeypatch):
    ticks = iter([0.0, 5.0, 5.0, 6.0, 6.0, 9.0])
    monkeypatch.setattr(measurement, "time", SimpleNamespace(process_time=lambda: next(ticks)))
    assert shortest_time(lambda: None) == 1.0
