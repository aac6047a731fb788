"""`kickdyn check-motion`: its numbers are those of `kd.check_motion`, its files, bad input."""

import numpy as np
import pytest

import kickdyn as kd

T = np.arange(30) / 50.0
SWING = np.column_stack([0.5 * np.sin(4 * T), 0.6 + 0.5 * np.cos(5 * T), -0.2 + 0.1 * np.cos(T)])


@pytest.fixture
def swing(written):
    return written("swing.csv", "\n".join(",".join(map(repr, row)) for row in SWING.tolist()))


def test_the_document_has_the_numbers_of_the_functions(swing, kickdyn):
    ended = kickdyn("check-motion swing.csv --rate 50 --friction 0.3 --json -")
    motion = kd.read_motion(swing, kd.Leg.human(), rate=50)
    check = kd.check_motion(motion, kd.Leg.human(), kd.Ball(), kd.Contact(friction=0.3))
    assert ended.json == check.to_json()
    assert ended.json["best"]["time"] == pytest.approx(T[check.best])
    assert ended.json["launches"]["ball_speed"].count(None) == 30 - sum(
        np.isfinite(check.launches.ball_speed.values)
    )


def test_plot_and_page_are_written_and_broken_limits_are_no_failure(swing, kickdyn, tmp_path):
    words = "--plot swing.png --view swing.html --json swing.json"
    ended = kickdyn(f"check-motion swing.csv --rate 200 {words}")
    assert "torque of hip is beyond its limit" in " ".join(ended.out.split())
    for file in ("swing.png", "swing.html", "swing.json"):
        assert f"wrote {file}" in ended.out
        assert (tmp_path / file).stat().st_size > 1000
    assert "0 to 0.145 s, 200 frames per second" in (tmp_path / "swing.html").read_text("utf-8")


@pytest.mark.parametrize(("words", "said"), [
    ("swing.csv", "rate is None"), ("none.csv --rate 50", "no such file"),
    ("swing.csv --rate 50 --leg testbed --joints hip,knee", "joints: lacks"),
    ("swing.csv --rate 50 --leg bolt", "3 columns"), ("swing.csv --rate -1", "rate is -1"),
])  # fmt: skip
def test_bad_input_is_one_line(words, said, swing, kickdyn):
    ended = kickdyn(f"check-motion {words}", code=2)
    lines = [line for line in ended.err.splitlines() if not line.startswith("warning: ")]
    assert len(lines) == 1
    assert said in lines[0]


@pytest.mark.slow
def test_a_robot_has_all_its_joints_and_a_floating_base(kickdyn, written):
    """G1 stands upright, 0.8 m above the ground."""
    robot = kd.Leg.from_robot("g1", base="floating")
    q = robot.configuration()
    q[2] = 0.8
    written("still.csv", "\n".join([",".join(map(repr, q.tolist()))] * 12))
    document = kickdyn("check-motion still.csv --leg g1 --rate 50 --json -").json
    assert document["best"] is None
    assert len(document["status"]) == 12
