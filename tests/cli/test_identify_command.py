"""`kickdyn identify`: flights of a measured track, their fits, and files."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from kickdyn.cli.identify_command import identify
from kickdyn.errors import InvalidInput

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
    assert names["png"].read_bytes()[1:4] == b"PNG"
    assert "measured" in names["html"].read_text()


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
        (("--start", "0", "--end", "4"), "4 positions: at least 5"),
        (("--columns", "time,x,y,z"), "there is no column 'time'"),
        (("--columns", "t,x"), "four columns"),
        (("--marker", "ball"), "--marker is 'ball': it is for a C3D file"),
        (("--drag", "golf"), "--drag is 'golf': it must be a number such as 0.25, or"),
        (("--drag", "-0.1"), "drag coefficient is -0.1: it must be a finite number at least 0"),
        (("--plot", "flight.txt"), "flight.txt has no known ending"),
        (("--ground-height", "9"), "under the ground at 9 m"),
    ],
)
def test_wrong_options_are_refused(track, options, message):
    ended = CliRunner().invoke(identify, [str(track), *options])
    assert isinstance(ended.exception, InvalidInput)
    assert message in str(ended.exception)
