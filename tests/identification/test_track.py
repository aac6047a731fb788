"""Tracks of a ball: slices, files with gaps and units, and what is refused."""

import csv
import struct
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.core.mechanics import GRAVITY
from kickdyn.errors import FaultyFile
from kickdyn.identification.track import (
    _arrays_of,
    _frames_of_header,
    _send_c3d,
    _within_reach,
    check_samples,
    doubts_of_track,
    refuse_units,
)

C3D = Path(__file__).resolve().parents[2] / "data" / "kick_instep.c3d"


def test_a_slice_is_a_track():
    times = np.arange(10) / 50
    track = kd.Track(times, np.column_stack([times, 2 * times, 1 + times]))
    part = track[2:5]
    assert part == kd.Track(track.times[2:5], track.positions[2:5])
    assert (len(part), part.duration) == (3, pytest.approx(0.04))
    with pytest.raises(ValueError, match="read-only"):
        part.times[0] = 1.0
    for index, message in ((3, r"track\[3\]"), (slice(3, 3), "at least one sample")):
        with pytest.raises(kd.InvalidInput, match=message):
            track[index]


def test_the_first_sample_that_is_no_number_is_named():
    positions = np.ones((5, 3))
    positions[2, 1], positions[4] = np.inf, np.nan
    with pytest.raises(kd.InvalidInput, match=r"positions\[2\] is \[1\.0, inf, 1\.0\]"):
        kd.Track(np.arange(5.0), positions)


def test_a_csv_file_with_gaps_other_names_and_a_long_cell(tmp_path):
    file, limit = tmp_path / "track.csv", csv.field_size_limit()
    file.write_text(
        f"frame, time ,X,Y,Z\n1,0.0,1,2,{3:.200000f}\n2,0.1,,,\n3,0.2,4,5,6\n4,0.3,NaN,5,6\n"
    )
    track = kd.Track.from_csv(file, columns=("time", "X", "Y", "Z"))
    assert track == kd.Track([0.0, 0.2], [[1, 2, 3], [4, 5, 6]])
    assert csv.field_size_limit() == limit


@pytest.mark.parametrize(("number", "start", "gaps"), [
    (0, 0.0, ()), (0, 50.0, (0, 3, 8, 9, 11)), (-9999, 0.0, (0, 3, 8, 9, 11))])  # fmt: skip
def test_rows_of_one_number_where_no_ball_could_be_are_gaps(tmp_path, number, start, gaps):
    """A ball that moves slowly near the origin may be there."""
    file = tmp_path / "track.csv"
    rows = [[k / 10, start + k / 5, k / 8, 1 + k / 8] for k in range(12)]
    for k in (0, 3, 8, 9, 11):
        rows[k][1:] = [number] * 3
    file.write_text("t,x,y,z\n" + "\n".join(",".join(map(repr, row)) for row in rows))
    track = kd.Track.from_csv(file)
    seen = [row for k, row in enumerate(rows) if k not in gaps]
    assert np.column_stack([track.times, track.positions]).tolist() == seen
    assert [f"5 rows of {number}" in line for line in track.warnings] == [True] * bool(gaps)


@pytest.mark.parametrize("order", [1, -1])
def test_a_ball_at_the_origin_comes_from_the_last_sample_and_goes_to_the_next(order):
    times, x = np.array([0.0, 0.1, 0.6, 0.7, 0.8]), np.array([20.0, 0.0, 4.0, 3.0, 2.0])
    rows = order * times, np.outer(x, (1.0, 0.0, 0.0)), x == 0.0
    within = _within_reach(*(values[::order] for values in rows))
    assert within[::order].tolist() == [True, False, True, True, True]  # 200 m/s to the second


NAMES, ROWS = "t,x,y,z\n", np.array([[0.5, 1.25, 2, -3], [0.52, 1.5, 2.5, 4]])
PLAIN = "\n".join(",".join(map(str, row)) for row in ROWS.tolist())
SEMICOLONS = PLAIN.replace(",", ";").replace(".", ",")


def written(sizes, mark=","):
    """Return the rows in other units, a size for the time and one for the coordinates."""
    return "\n".join(
        mark.join(map(repr, row)) for row in (ROWS * np.repeat(sizes, (1, 3))).tolist()
    )


@pytest.mark.parametrize("text", [
    NAMES + PLAIN, "\ufeff" + NAMES + PLAIN, (NAMES + PLAIN).replace("\n", "\r\n"),
    (NAMES + PLAIN).replace("\n", "\r"), "t;x;y;z\n" + SEMICOLONS,
    "t;x;y;z\n" + written((1, 1), ";"), "t\tx\ty\tz\n" + SEMICOLONS.replace(";", "\t"),
    "T   X Y  Z\n" + written((1, 1), "   "),
    "t [s],x [m],y [m],z [m]\n" + PLAIN, "t_s;x_m;y_m;z_m\n" + SEMICOLONS,
    "Time (ms);X (cm);Y (cm);Z (cm)\n" + written((1e3, 1e2), ";"),
    "t,x,y,z\n[s],[m],[m],[m]\n" + PLAIN,
    NAMES + "ms,mm,mm,mm\n" + written((1e3, 1e3)), "a ball\n\n" + NAMES + PLAIN,
    "# a ball\n" + NAMES + "# here\n" + PLAIN + "\n# end", "# t,x,y,z\n" + PLAIN,
    '"t", "x", "y", "z"\n' + "\n".join(f'"{line}"' for line in written((1, 1), '","').split("\n")),
    "t,x,y,z,\n" + PLAIN.replace("\n", ",\n") + ",", "i,t,y,x,z\n"
    + "\n".join(f"{k},{t},{y},{x},{z}" for k, (t, x, y, z) in enumerate(ROWS.tolist())),
    NAMES + PLAIN + "\n0.6,NA,-nan,-\n\n",
], ids=range(20))  # fmt: skip
def test_csv_files_of_all_dialects_are_one_track(tmp_path, text):
    file = tmp_path / "track.csv"
    file.write_bytes(text.encode())
    track = kd.Track.from_csv(file)
    agrees(np.column_stack([track.times, track.positions]), ROWS, closed_form())


@pytest.mark.parametrize("kind", ["datetime64[ns]", "timedelta64[ns]"])
def test_times_of_a_table_that_are_no_seconds_are_refused(kind):
    table = pd.DataFrame(ROWS, columns=list("txyz")).assign(t=np.arange(len(ROWS)).astype(kind))
    with pytest.raises(kd.InvalidInput, match=r"column t .*64.*numbers, times in seconds"):
        kd.Track(table)


def test_times_of_a_clock_in_milliseconds_are_read(tmp_path):
    file = tmp_path / "track.csv"
    file.write_text("t [ms],x,y,z\n1700000000000,0,0,1\n1700000000100,1,0,1\n")
    agrees(np.diff(kd.Track.from_csv(file).times), [0.1], closed_form(1e10))


@pytest.mark.parametrize(("text", "message", "columns", "remedy"), [
    ("t,x,y\n0,1,2\n", r"\['t', 'x', 'y'\].*'z'", "txyy", ()),
    ("t,x,y,x,z\n0,1,2,1,3\n", "once each", "tyyz", ()),
    ("when,x,y,z\n" + PLAIN, "'t'.*columns", ("when", "x", "y", "z"), ()),
    ("t,x [ft],y,z\n" + PLAIN, r"x \[ft\].*columns", ("t", "x [ft]", "y", "z"), ()),
    (NAMES, "no row of numbers", "txyz", (NAMES, NAMES + PLAIN)),
    (NAMES + written((1, 1), ";"), "no row of numbers.*separated", "txyz", (",", ";")),
    (NAMES + "0,1,2,three", "row 2", "txyz", ("three", "3")),
    (NAMES + "0,1,2,inf", "row 2", "txyz", ("inf", "3")),
    (NAMES + "0:01.5,1,2,3", "row 2.*seconds", "txyz", ("0:01.5", "1.5")),
    (NAMES + "0,02,1,0,2,0,3", "row 2 has 7.*a point", "txyz", ("0,02,1,0,2,0", "0.02,1,2")),
    (NAMES + '"0,02","1,0",2,3', "row 2.*a point", "txyz", ('"0,02","1,0"', "0.02,1.0")),
    ("t;x;y;z\n0,5;1.5;2;3", "row 2.*a point", "txyz", ("0,5", "0.5")),
    (NAMES + "0,1,2,3\n0,1,2,3", "row 3.*increase", "txyz", ("\n0,1,2,3\n0", "\n0,1,2,3\n1")),
], ids=range(13))  # fmt: skip
def test_a_csv_file_is_refused_with_advice_that_helps(tmp_path, text, message, columns, remedy):
    file = tmp_path / "track.csv"
    file.write_text(text)
    with pytest.raises(FaultyFile, match=message) as refused:
        kd.Track.from_csv(file)
    assert str(refused.value).isprintable()
    file.write_text(text.replace(*remedy) if remedy else text)
    assert len(kd.Track.from_csv(file, columns=tuple(columns))) > 0


def test_a_table_is_a_track_and_other_arguments_are_answered_with_how_to_make_one():
    """Rows with a gap are left out, and units read, as of a file."""
    columns = {"frame": [1, 2, 3], "z": np.zeros(3), "t [ms]": [0, 20, 40], "Y_mm": [0, 10, 20]}
    table = pd.DataFrame(columns | {"x": [1, np.nan, 3]})
    track = kd.Track(table)
    assert track == kd.Track([0, 0.04], [[1, 0, 0], [3, 0.02, 0]])
    assert kd.Track(table.astype({"x": "Float64", "z": object})) == track
    ball = kd.Ball()
    for refused, message in (
        (lambda: kd.Track(table.drop(columns="z")), r"t, x, y, z.*\['frame', .*from_csv"),
        (lambda: kd.Track([0, 1]), "positions is missing.*from_csv"),
        (lambda: kd.Track(table.assign(z="three")), "column z .*real numbers"),
        (lambda: kd.Track(table.iloc[:0]), "no row"),
        (lambda: kd.identify(table, ball), r"track is .*DataFrame.*kd\.Track\(table\)"),
        (lambda: kd.segments("track.csv"), "from_csv reads"),
    ):
        with pytest.raises(kd.InvalidInput, match=message) as error:
            refused()
        assert str(error.value).isprintable()


@pytest.mark.parametrize("share", [0.5, 0.95, 1.0, 1.05, 1.9])
def test_a_ball_that_falls_as_in_another_unit_is_refused(share):
    """Drag and lift halve or double gravity; in feet, lift alone can make a ball fall as fast."""
    t = np.arange(50) / 50
    path = np.column_stack([10 * t, 0 * t, 5 * t - share * GRAVITY * t**2 / 2])
    in_yards = doubts_of_track(kd.Track(t, path), GRAVITY * share / 0.9144)
    assert any("yards" in line for line in in_yards) == (abs(share - 1.0) < 0.02)
    units = {"millimetres": 1e3, "centimetres": 1e2, "inches": 1 / 0.0254, "feet": 1 / 0.3048}
    for unit, size in units.items():
        if unit != "feet" or abs(share - 1.0) < 0.1:
            with pytest.raises(kd.InvalidInput, match=unit):
                refuse_units(kd.Track(t, size * path), size * share * GRAVITY)
    refuse_units(kd.Track(t, path), share * GRAVITY)


@pytest.mark.parametrize(("speed", "unit"), [(350.0, "centimetres"), (7e3, "in millimetres: ")])
def test_a_ball_faster_than_sound_is_refused(speed, unit):
    t = np.arange(10) / 50
    slow, fast = (kd.Track(t, np.outer(v * t, (1, 0, 0))) for v in (330.0, speed))
    refuse_units(slow, 0.0)
    with pytest.raises(kd.InvalidInput, match=f"sound.*{unit}"):
        refuse_units(fast, 0.0)


def test_five_samples_less_than_a_second_apart_are_enough():
    check_samples(kd.Track(0.9 * np.arange(5), np.zeros((5, 3))))
    for interval, count, message in ((0.1, 4, "4 samples"), (1.1, 5, r"1\.1 s apart")):
        with pytest.raises(kd.InvalidInput, match=message):
            check_samples(kd.Track(interval * np.arange(count), np.zeros((count, 3))))


def test_times_count_from_the_first_frame_of_the_measurement(tmp_path):
    """A file at 500 Hz whose first frame is 101, not 1, begins 0.2 s after the measurement."""
    pytest.importorskip("ezc3d")
    content, cut = bytearray(C3D.read_bytes()), tmp_path / "cut.c3d"
    first, last = struct.unpack_from("<HH", content, 6)
    struct.pack_into("<HH", content, 6, first + 100, last + 100)
    cut.write_bytes(content)
    whole, later = (kd.Track.from_c3d(file, "ball").times for file in (C3D, cut))
    assert (first, whole[0]) == (1, 0.0)
    assert later == pytest.approx(whole + 0.2, abs=closed_form(1e4))


@pytest.mark.parametrize(("order", "processor"), [("<", 0x54), (">", 0x56)])
def test_the_frames_of_a_header_are_in_the_order_of_its_processor(tmp_path, order, processor):
    """Words 4 and 5 are the first and the last frame; block 3 has the parameters."""
    file = tmp_path / "kick.c3d"
    header = struct.pack(f"{order}BBHHHH", 3, 0x50, 9, 0, 259, 1024).ljust(1024, b"\0")
    file.write_bytes(header + bytes([1, 80, 2, processor]))
    assert _frames_of_header(str(file)) == 1024 - 259 + 1


@pytest.mark.parametrize(("lists", "labels"), [
    ([["a", "b ", "c", "d"]], ["a", "b", "c"]), ([["a", "b"]], ["a", "b"]),
    ([["a", "b"], ["c"]], ["a", "b", "c"]), ([["a"], ["b"], ["c", "d"]], ["a", "b", "c"])],
    ids=["more", "fewer", "two lists", "three lists"])  # fmt: skip
def test_the_first_labels_of_a_c3d_file_name_its_points(lists, labels):
    lists = {f"LABELS{k + 1 if k else ''}": {"value": names} for k, names in enumerate(lists)}
    content = {"parameters": {"POINT": {"RATE": {"value": [500.0]}, **lists}},
               "header": {"points": {"first_frame": 4}},
               "data": {"points": np.arange(24.0).reshape(4, 3, 2)}}  # fmt: skip
    read = _arrays_of(content)
    assert read["labels"].tolist() == labels
    assert read["data"][1].tolist() == [[2, 8, 14], [3, 9, 15]]  # frames of the second point
    assert (read["unit"].tolist(), read["rate"], read["first"]) == ([""], 500.0, 4)


@pytest.mark.parametrize("damage", ["half", "garbage", "missing"])
def test_a_damaged_c3d_file_is_refused_in_one_line(tmp_path, damage):
    pytest.importorskip("ezc3d")
    file, content = tmp_path / "kick.c3d", C3D.read_bytes()
    if damage != "missing":
        file.write_bytes({"half": content[: len(content) // 2], "garbage": b"t,x,y"}[damage])
    word = "no such file" if damage == "missing" else "C3D"
    with pytest.raises(FaultyFile, match=rf"kick\.c3d.*{word}") as refused:
        kd.Track.from_c3d(file, "ball")
    assert "\n" not in str(refused.value).strip()


def test_a_c3d_file_is_read_without_modules_of_the_working_directory(tmp_path, monkeypatch):
    pytest.importorskip("ezc3d")
    (tmp_path / "numpy.py").write_text('raise SystemExit("planted")')
    monkeypatch.chdir(tmp_path)
    assert len(kd.Track.from_c3d(C3D, "ball")) > 5


def test_the_process_that_reads_a_c3d_file_is_limited(monkeypatch):
    resource, limits = pytest.importorskip("resource"), {}
    monkeypatch.setattr(resource, "setrlimit", limits.__setitem__)
    monkeypatch.setattr("sys.argv", ["", "none.c3d", "2000", "7"])
    monkeypatch.setitem(sys.modules, "ezc3d", None)  # what it may cost is limited before
    with pytest.raises(ImportError):
        _send_c3d()
    assert limits == {resource.RLIMIT_AS: (2000, 2000), resource.RLIMIT_CPU: (7, 7)}
