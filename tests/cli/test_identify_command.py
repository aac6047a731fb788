"""`kickdyn identify`: the flights of a measured track, their fits and their means."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from tolerances import optimized

import kickdyn as kd
from kickdyn.identification.identification_result import Identification, mean_over_flights

BALL, DRAG, NOISE = kd.Ball(), 0.25, 0.004


@pytest.fixture
def two_flights(written):
    """A track of two flights with drag 0.25, 0.8 s and 1.2 s long, with three samples far off."""
    rng, rows = np.random.default_rng(3), ["t,x,y,z"]
    for start, speed, duration in ((0.0, 20.0, 0.8), (5.0, 14.0, 1.2)):
        times = np.arange(0.0, duration, 0.02)
        launch = kd.BallState((0, 0, 0.3), (speed, 3, 7))
        points = kd.fly(launch, BALL, kd.Air(drag=DRAG)).sample(times).position
        points = points + NOISE * rng.normal(size=points.shape)
        points[[12, 20] if start == 0.0 else [25], 2] += 0.3
        rows += [f"{start + t},{x},{y},{z}" for t, (x, y, z) in zip(times, points, strict=True)]
    return written("two.csv", "\n".join(rows))


def test_the_fits_are_those_of_the_library_and_of_the_track(
    two_flights, kickdyn, tmp_path, monkeypatch
):
    """The table shows the numbers of the document, the plot the longest flight, the page all."""
    drawn, pages = [], []
    page = SimpleNamespace(save=lambda file: None, warnings=())
    monkeypatch.setattr("kickdyn.view.page.page", lambda shown: pages.append(shown) or page)
    monkeypatch.setattr(Identification, "plot", lambda fit: drawn.append(fit) or Figure())
    text = kickdyn("identify two.csv --json two.json --plot two.png --view two.html").out
    assert [fit.track.duration > 0.9 for fit in drawn] == [True]
    document = json.loads((tmp_path / "two.json").read_text())
    track = kd.Track.from_csv(two_flights)
    split, fits = kd.segments(track, BALL), []
    heads, *rows = (re.split(r"  +", line) for line in text.splitlines()
                    if re.match(r"\d+-|samples ", line))  # fmt: skip
    for cells, flight, segment in zip(rows, document["flights"], split.flights, strict=True):
        fit = kd.identify(segment, BALL, kd.Air(), free=["spin", "drag"])
        fits.append(fit)
        first, last = map(int, cells[0].split("-"))
        assert (flight["first"], flight["last"]) == (first, last)
        assert track[first:last] == segment
        assert flight["outliers"] == int(cells[2]) == fit.outliers
        assert float(cells[1]) == pytest.approx(fit.launch.speed, abs=5e-3)
        assert float(cells[3]) == pytest.approx(100 * fit.rms, abs=5e-3)
        assert flight["rms"] == pytest.approx(fit.rms)
        assert fit.rms == pytest.approx(np.sqrt(3) * NOISE, rel=0.3)
        for head, cell in zip(heads[4:], cells[4:], strict=True):
            name = head.split(" ")[0]
            assert flight["values"][name] == fit.values.get(name)
            assert flight["deviations"][name] == fit.deviations.get(name)
            if name in fit.values:
                value, deviation = map(float, cell.split(" +- "))
                assert deviation == pytest.approx(fit.deviations[name], rel=0.06)
                assert value == pytest.approx(fit.values[name], abs=0.06 * deviation)
    assert [fit.outliers for fit in fits] == [2, 1]
    shown = {f"samples {f['first']}-{f['last']}": f["rms"] for f in document["flights"]}
    assert {name: fit.rms for name, fit in pages[0].items()} == shown
    mean = mean_over_flights(fits, "drag")
    assert document["drag"] == pytest.approx(mean._asdict())
    assert document["drag"]["mean"] == pytest.approx(DRAG, rel=0.2)
    assert str(mean) in text
    used = sum(map(len, split.flights))
    assert document["too_short"] == 0
    assert document["samples_at_ends"] == len(track) - used
    assert f"{len(track) - used} samples" in text


def test_the_segments_are_those_of_the_library(kickdyn, written, tmp_path):
    """A ball that bounces and rolls on carpet."""
    course = kd.follow(kd.BallState((0, 0, 0.6), (9, 1, 4)), BALL, kd.Air(),
                       kd.Ground(surface="carpet"))  # fmt: skip
    times = np.arange(0.0, course.duration, 0.02)
    rows = np.column_stack([2.0 + times, course.sample(times).position]).tolist()
    file = written("roll.csv", "t,x,y,z\n" + "\n".join(",".join(map(str, row)) for row in rows))
    text = kickdyn("identify roll.csv --json roll.json").out
    document = json.loads((tmp_path / "roll.json").read_text())
    split = kd.segments(kd.Track.from_csv(file), BALL)
    lines = [line.split() for line in text.splitlines()
             if re.match(r"(flight|rolling|rest|other) +\d", line)]  # fmt: skip
    assert document["warnings"] == list(split.warnings) != []
    for words, segment, entry in zip(lines, split.parts, document["segments"], strict=True):
        assert words[0] == entry["kind"] == segment.kind
        assert words[3] == entry["begins"] == segment.begins
        assert words[1] == f"{segment.first}-{segment.last}" == f"{entry['first']}-{entry['last']}"
        ends = split.track.times[[segment.first, segment.last - 1]]
        assert [float(end) for end in words[2].split("-")] == pytest.approx(ends, abs=6e-3)
        speed = np.linalg.norm(segment.velocity_after)
        assert float(words[4]) == pytest.approx(speed, abs=6e-3)
    longer = sum(flight.duration >= 0.4 for flight in split.flights)
    assert len(document["flights"]) + len(document["not_fitted"]) == longer > 0
    assert document["too_short"] == len(split.flights) - longer > 0
    for name in ("restitution", "friction", "rolling_deceleration"):
        measured = getattr(split, name)
        assert document[name] == measured._asdict()
        assert str(measured) in text


@pytest.mark.parametrize(("drag", "fitted", "air"), [
    ("constant", "drag", kd.Air()), ("goff-carre", "drag_scale", kd.Air(drag="goff-carre")),
    ("0.15", None, kd.Air(drag=0.15))])  # fmt: skip
def test_the_drag_is_fitted_scaled_or_kept(drag, fitted, air, match_ball, kickdyn):
    file = match_ball(2808, 2924)
    line = f"identify match.csv --start 5 --end 60 --drag {drag} --ball 0.41:0.1 --json -"
    document = kickdyn(line).json
    free = ["spin"] if fitted is None else ["spin", fitted.replace("_", "-")]
    segment = kd.Track.from_csv(file)[5:60]
    right = kd.identify(segment, kd.Ball(0.41, 0.1), air, free=free)
    (flight,) = document["flights"]
    assert (flight["first"], flight["last"]) == (5, 60)
    assert flight["values"] == pytest.approx({name: right.values.get(name) for name in right.names})
    assert {"drag", "drag_scale"} & flight["values"].keys() == ({fitted} if fitted else set())


def test_columns_and_ground_are_those_of_the_options(match_ball, kickdyn, written):
    rows = match_ball(2808, 2924).read_text().splitlines()[1:]
    raised = [(t, x, y, float(z) + 2.0) for t, x, y, z in (row.split(",") for row in rows)]
    text = "\n".join(f"{z},{t},{y},{x}" for t, x, y, z in raised)
    written("raised.csv", f"up,s,left,ahead\n{text}\n")
    plain = kickdyn("identify match.csv --drag 0.15 --json -").json
    options = "--columns s,ahead,left,up --ground-height 2 --drag 0.15"
    shifted = kickdyn(f"identify raised.csv {options} --json -").json
    assert [segment["kind"] for segment in shifted["segments"]] == ["flight", "flight"]
    medians = [document["restitution"]["median"] for document in (plain, shifted)]
    assert medians[1] == pytest.approx(medians[0], rel=optimized(1e-7))
    errors = [document["flights"][0]["rms"] for document in (plain, shifted)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-3)
