"""`kickdyn identify`: flights of a measured track, their fits, and files."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

import kickdyn as kd
from kickdyn.cli.identify_command import identify
from kickdyn.errors import InvalidInput
from kickdyn.identification.identification_result import Identification, mean_over_flights

ROWS = (Path(__file__).resolve().parents[2] / "data" / "match_ball.csv").read_text().splitlines()


@pytest.fixture
def track(tmp_path):
    """Return a file with a flight of 1.9 s, its bounce and the next one."""
    file = tmp_path / "track.csv"
    file.write_text("\n".join([ROWS[0], *ROWS[2808:2924]]) + "\n")
    return file


def run(*arguments):
    """Return what the command prints; it must end without an error."""
    ended = CliRunner().invoke(identify, [str(word) for word in arguments])
    assert ended.exception is None, ended.exception
    return ended.output


def test_flights_are_found_and_fitted(track, tmp_path):
    names = {kind: tmp_path / f"out.{kind}" for kind in ("json", "png", "html")}
    text = run(
        track, "--json", names["json"], "--plot", names["png"], "--view", names["html"]
    )  # fmt: skip
    assert "restitution: 0.8" in text
    assert f"wrote {names['html']}" in text
    document = json.loads(names["json"].read_text())
    (flight,) = document["flights"]  # the second is shorter than 0.4 s
    assert flight["rms"] < 0.04
    assert flight["values"]["drag"] == pytest.approx(0.15, abs=0.01)
    assert [part["kind"] for part in document["segments"]] == ["flight", "flight"]
    assert document["restitution"]["deviation"] > 0.0
    assert document["drag"] is None  # one flight has no mean
    assert document["too_short"] == 1
    assert "1 of 2 flights are shorter than 0.4 s" in text
    assert f"{document['samples_at_ends']} samples within 0.1 s" in text
    assert names["png"].read_bytes()[1:4] == b"PNG"
    assert "measured" in names["html"].read_text()


@pytest.fixture
def two_flights(tmp_path):
    """Return a track of two flights, 0.8 s and 1.2 s long, with noise and two samples far off."""
    ball, rng = kd.Ball(), np.random.default_rng(3)
    rows = ["t,x,y,z"]
    for start, speed, duration in ((0.0, 20.0, 0.8), (5.0, 14.0, 1.2)):
        times = np.arange(0.0, duration, 0.02)
        launch = kd.BallState((0, 0, 0.3), (speed, 3, 7))
        points = kd.fly(launch, ball, kd.Air(drag=0.25)).sample(times).position
        points = points + 0.004 * rng.normal(size=points.shape)
        points[[12, 20] if start == 0.0 else [25], 2] += 0.3
        rows += [f"{start + t},{x},{y},{z}" for t, (x, y, z) in zip(times, points, strict=True)]
    file = tmp_path / "two.csv"
    file.write_text("\n".join(rows))
    return file


def test_the_table_and_the_json_have_the_numbers_of_the_fits(two_flights):
    track = kd.Track.from_csv(two_flights)
    ball = kd.Ball()
    split = kd.segments(track, ball)
    text = run(two_flights)
    document = json.loads(run(two_flights, "--json", "-"))
    lines = [line for line in text.splitlines() if re.match(r"\d+-|samples ", line)]
    heads, *rows = [re.split(r"  +", line) for line in lines]
    assert heads[:4] == ["samples", "speed [m/s]", "left out", "rms [cm]"]
    assert len(rows) == len(document["flights"]) == len(split.flights) == 2
    outliers, fits = [], []
    for cells, flight, part in zip(rows, document["flights"], split.flights, strict=True):
        first, last = map(int, cells[0].split("-"))
        assert (flight["first"], flight["last"]) == (first, last)
        assert track[first:last] == part
        fit = kd.identify(part, ball, kd.Air(), free=["spin", "drag"])
        fits.append(fit)
        outliers.append(fit.outliers)
        assert flight["outliers"] == int(cells[2]) == len(part) - fit.used.sum()
        speed = np.linalg.norm(fit.launch.velocity)
        assert float(cells[1]) == pytest.approx(speed, abs=5e-3)
        assert float(cells[3]) == pytest.approx(100 * fit.rms, abs=5e-3)
        assert flight["rms"] == pytest.approx(fit.rms)
        assert flight["warnings"] == [*fit.warnings]
        for head, cell in zip(heads[4:], cells[4:], strict=True):
            name = head.split(" ")[0]
            if name in fit.undetermined:
                assert (cell, flight["values"][name]) == ("not determined", None)
                continue
            value, deviation = map(float, cell.split(" +- "))
            assert deviation == pytest.approx(fit.deviations[name], rel=0.05)
            assert value == pytest.approx(fit.values[name], abs=0.06 * deviation)
        for key, numbers in (("values", fit.values), ("deviations", fit.deviations)):
            given = {name: value for name, value in flight[key].items() if value is not None}
            assert given == pytest.approx(numbers)
    assert outliers == [2, 1]
    mean = mean_over_flights(fits, "drag")
    assert document["drag"] == pytest.approx(mean._asdict())
    assert f"over the whole track: {mean}" in text
    samples = sum(len(part) for part in split.parts if part.kind == "flight")
    at_ends = samples - sum(map(len, split.flights))
    assert document["samples_at_ends"] == at_ends > 0
    assert f"{at_ends} samples within 0.1 s" in text
    warned = next(i for i, fit in enumerate(fits) if fit.warnings)
    assert f"--start {rows[warned][0].replace('-', ' --end ')} prints" in text


def test_the_segments_have_the_numbers_of_the_track(tmp_path):
    path = kd.follow(
        kd.BallState((0, 0, 0.6), (9, 1, 4)), kd.Ball(), kd.Air(), kd.Ground(surface="carpet")
    )
    times, file = 2.0 + np.arange(0.0, path.duration, 0.02), tmp_path / "roll.csv"
    rows = np.column_stack([times, path.sample(times - 2.0).position])
    np.savetxt(file, rows, delimiter=",", header="t,x,y,z", comments="")
    split = kd.segments(kd.Track.from_csv(file), kd.Ball())
    text = run(file, "--json", tmp_path / "roll.json")
    document = json.loads((tmp_path / "roll.json").read_text())
    kinds = "flight|rolling|rest|other"
    lines = [line.split() for line in text.splitlines() if re.match(rf"({kinds}) +\d", line)]
    assert len(lines) == len(split.parts) == len(document["segments"])
    for words, part, entry in zip(lines, split.parts, document["segments"], strict=True):
        kind, samples, seconds, begins, speed = words
        assert (kind, begins) == (part.kind, part.begins) == (entry["kind"], entry["begins"])
        assert samples == f"{part.first}-{part.last}"
        assert (part.first, part.last) == (entry["first"], entry["last"])
        first, last = map(float, seconds.split("-"))
        span = split.track.times[[part.first, part.last - 1]]
        assert (first, last) == pytest.approx(span, abs=6e-3)
        assert float(speed) == pytest.approx(np.linalg.norm(part.velocity_after), abs=6e-3)
    for name in ("restitution", "friction", "rolling_deceleration"):
        measured = getattr(split, name)
        assert document[name] == measured._asdict()
        assert f"{name.replace('_', ' ')}: {measured}" in text
    low = split.friction.median - 2.0 * split.friction.deviation
    assert f"friction: at least {low:.2g} (of" in text
    assert document["warnings"] == [*split.warnings]


def test_the_longest_flight_is_plotted(two_flights, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        Identification, "plot", lambda fit: drawn.append(fit) or Figure(figsize=(1, 1))
    )
    run(two_flights, "--plot", tmp_path / "flight.png")
    assert len(drawn) == 1
    assert drawn[0].track.duration > 0.9


def test_the_hint_names_the_first_flight_with_a_warning(two_flights, monkeypatch):
    late = property(lambda fit: ("late",) if fit.track.times[0] > 4.0 else ())
    monkeypatch.setattr(Identification, "warnings", late)
    text = run(two_flights)
    last = [line.split()[0] for line in text.splitlines() if re.match(r"\d+-", line)][-1]
    assert (
        f"1 of 2 flights have warnings: --json FILE writes them, --start {last.split('-')[0]} "
        in text
    )


def test_several_flights_have_a_mean(two_flights, tmp_path):
    text = run(two_flights, "--json", tmp_path / "out.json")
    document = json.loads((tmp_path / "out.json").read_text())
    assert document["drag"]["flights"] == 2
    assert document["drag"]["mean"] == pytest.approx(0.25, rel=0.2)
    assert document["drag"]["slowest"] < 15.0 < document["drag"]["fastest"]
    assert "drag coefficient over the whole track: 0.2" in text
    assert "back_spin [rad/s]" in text


def test_a_track_without_a_flight_says_what_units_are_read(tmp_path):
    file = tmp_path / "kilometres.csv"
    file.write_text("t,x,y,z\n" + "".join(f"{t / 50},{t / 5000},0,0.001\n" for t in range(50)))
    assert "no flight of at least 0.4 s was found: times must be in seconds" in run(file)


def test_a_part_is_one_flight(track):
    document = json.loads(
        run(track, "--start", 5, "--end", 40, "--drag", "goff-carre", "--json", "-")
    )
    (flight,) = document["flights"]
    assert (flight["first"], flight["last"]) == (5, 40)
    assert 0.5 < flight["values"]["drag_scale"] < 1.5
    assert "segments" not in document


def test_a_drag_coefficient_can_be_kept(track):
    document = json.loads(run(track, "--start", 5, "--end", 90, "--drag", "0.15", "--json", "-"))
    (flight,) = document["flights"]
    assert not {"drag", "drag_scale"} & flight["values"].keys()
    assert flight["rms"] < 0.04


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--start", "50", "--end", "20"), "--start 50 --end 20: they must be from 0 to 116"),
        (("--start", "0", "--end", "4"), "4 samples: at least 5"),
        (("--columns", "time,x,y,z"), "it must name 'time', 'x', 'y', 'z' once each"),
        (("--columns", "t,x"), "four columns"),
        (("--marker", "ball"), "--marker is 'ball': it is for a C3D file"),
        (("--drag", "golf"), "--drag is 'golf': it must be a number such as 0.25, or"),
        (("--drag", "-0.1"), "--drag is -0.1: it must be a finite number at least 0"),
        (
            ("--drag", "1e300"),
            "--drag is 1e+300: it must be a finite number at least 0 and at most",
        ),
        (("--ball", "1e300:0.1"), "ball mass is 1e+300: it must be a finite number at least"),
        (("--ball", "0.4:0"), "ball radius is 0.0: it must be a finite number at least 0.001"),
        (("--plot", "flight.txt"), "flight.txt has no known extension"),
        (("--ground-height", "9"), "under the ground at 9 m"),
    ],
)
def test_wrong_options_are_refused(track, options, message):
    ended = CliRunner().invoke(identify, [str(track), *options])
    assert isinstance(ended.exception, InvalidInput)
    assert message in str(ended.exception)
