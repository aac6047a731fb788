"""Grids, lists and samples of postures, and their chunks."""

import math
import re

import numpy as np
import pytest
from chains import fourbar
from scipy.stats import qmc
from tolerances import closed_form

import kickdyn as kd
from kickdyn.sweeps.grid import IN_MEMORY, LARGEST, Chunks, Grid, check_size, read_postures

LEG = kd.Leg.human()


@pytest.mark.parametrize(("text", "degrees"), [
    ("hip=-10:60:5", np.arange(-10, 61, 5)), ("knee=0:1:0.1", np.arange(11) / 10),
    ("knee=0:10:4", [0, 4, 8]), ("ankle=7", [7]), ("hip=0:0.3:0.1", [0, 0.1, 0.2, 0.3])
])  # fmt: skip
def test_a_text_is_read_in_degrees_with_its_ends(text, degrees):
    (values,) = read_postures(LEG, [text]).values()
    assert np.degrees(values) == pytest.approx(np.asarray(degrees, float))


def test_configurations_run_the_last_joint_fastest():
    grid = Grid.of(LEG, read_postures(LEG, ["hip=0:10:10", "ankle=0:20:20"]))
    degrees = [np.degrees(grid.configuration(LEG, number)) for number in range(grid.size)]
    right = [[0, 0, 0], [0, 0, 20], [10, 0, 0], [10, 0, 20]]
    assert np.array(degrees) == pytest.approx(np.array(right))
    assert Grid.of(LEG, {"hip": 0.2, "knee": [0.1, 0.3]}).shape == (1, 2)
    listed = Grid.of(LEG, {"hip": [0.3, 0.1], "knee": [0.4, 0.2]}, "list")
    assert (listed.size, listed.dims) == (2, ("posture",))
    assert listed.configuration(LEG, 1).tolist() == [0.1, 0.2, 0.0]


def test_a_sample_is_the_sobol_sequence_between_the_bounds():
    grid = Grid.of(LEG, {"hip": (-0.1, 0.7), "knee": (0.1, 0.9)}, 8)
    right = qmc.scale(qmc.Sobol(2, scramble=False).random(8), [-0.1, 0.1], [0.7, 0.9])
    assert np.column_stack(list(grid.axes.values())) == pytest.approx(right)


@pytest.mark.parametrize(("joints", "words"), [
    ([], "--joint hip"), (["hip"], "'hip'.*LOW:HIGH:STEP"), (["knee=30 deg"], "plain numbers"),
    (["hip=nan"], "joint hip is nan"), (["toe=1"], "'toe'.*hip, knee, ankle"),
    (["hip=0:10:0"], "STEP"), (["hip=10:0:1"], "hip=0:10:1"),
    (["hip=-40:20:10"], "-40 deg.*-30 to 125 deg"), (["hip=1", "hip=2"], "'hip'.*twice"),
    (["hip=0:100:1e-9"], "larger step"),
    (["hip=5:0:1", "knee=x", "ankle=0", "ankle=1"], "hip=5:0:1.*knee=x.*'ankle'")])  # fmt: skip
def test_bad_texts_are_refused(joints, words):
    with pytest.raises(kd.InvalidInput, match=words):
        read_postures(LEG, joints)


BOUNDS = {"hip": (-0.1, 0.7), "knee": (0.1, 0.9)}


@pytest.mark.parametrize(("postures", "samples", "word"), [
    ({}, None, "joint names"), ({"toe": 0.0}, None, "'toe'"),
    ({"hip": [0.2, 0.1]}, None, "ascending"), ({"hip": [[0.1, 0.2]]}, None, "ascending"),
    ({"hip": [0.1, math.nan]}, None, "hip"),
    ({"knee": [0.0, 30.0]}, None, r"1718\.87 deg.*0 to 140 deg"),
    ({"hipp": [0], "knee": [0, 9.0], "ankle": [1, 0]}, None, "hipp.*knee.*ankle"),
    (BOUNDS, "rows", "'rows'.*'list'"), (BOUNDS, 1.5, r"1\.5.*whole"),
    ({"hip": [0, 0.1, 0.2]}, 8, "hip has 3 values"),
    ({"hip": [0.2, 0.1], "knee": [0.1]}, "list", "hip 2, knee 1"),
    ({"knee": [0.2, -9.0]}, "list", r"-515\.662 deg")])  # fmt: skip
def test_bad_postures_are_refused(postures, samples, word):
    with pytest.raises(kd.InvalidInput, match=word):
        Grid.of(LEG, postures, samples)


@pytest.mark.parametrize("kind", [np.array, list])
def test_rows_of_configurations_are_a_list_as_the_refusal_says(kind):
    rows = np.array([[0.3, 0.4, 0.1], [0.1, 0.2, -0.2]])
    with pytest.raises(kd.InvalidInput, match=r"such as \{'hip': \[0.0, 0.1\]\}") as refused:
        kd.sweep(LEG, kind(rows), kd.Kick())
    advice = re.search(r"rows of q, (.*) with samples='list'", str(refused.value))[1]
    listed = Grid.of(LEG, eval(advice, {"rows": rows}), "list")
    assert [listed.configuration(LEG, k).tolist() for k in range(2)] == rows.tolist()


def test_a_joint_that_is_not_named_must_allow_0():
    model = LEG.model
    model.lowerPositionLimit = np.array([0.1, 0.0, 0.0])
    with pytest.raises(kd.InvalidInput, match="hip is not named"):
        Grid.of(kd.Leg.from_model(model, "toe"), {"knee": 0.2})


def test_ranges_hold_for_joints_that_others_move(leg_with_arm):
    """The elbow follows the shoulder 0.3 rad ahead, up to 1 rad; a rocker follows the other."""
    leg = kd.Leg.from_urdf(leg_with_arm, "toe")
    assert Grid.of(leg, {"shoulder": [-1.0, 0.7]}).size == 2
    model = fourbar().model
    model.upperPositionLimit[1] = 0.1
    closed = fourbar().with_model(model)
    grid = Grid.of(closed, {"rocker_b": [0.0, 0.4]})
    assert np.abs(grid.configuration(closed, 0)).max() < closed_form(10)
    for refused, said in (
        (lambda: Grid.of(leg, {"shoulder": [0.0, 0.71]}), "elbow .* moved by shoulder.* 57.8"),
        (lambda: Grid.of(leg, {"elbow": 0.3}), "elbow mimics shoulder: sweep shoulder"),
        (lambda: grid.configuration(closed, 1), "with the loops closed, rocker_a at"),
    ):
        with pytest.raises(kd.InvalidInput, match=said):
            refused()


@pytest.mark.parametrize(("largest", "steps", "word"), [
    (IN_MEMORY, 1001, "store"), (LARGEST, 100_001, "640.0 GB")])  # fmt: skip
def test_too_many_postures_are_refused_with_their_size(largest, steps, word):
    check_size((largest // 2, 2), largest)
    with pytest.raises(kd.InvalidInput, match=f"{2 * steps**2:,} .*{word}"):
        check_size((steps, steps, 2), largest)


@pytest.mark.parametrize(("shape", "chunk"), [
    ((7, 7, 6), (1, 7, 6)), ((10, 10, 300), (1, 1, 50)), ((3, 4), (3, 4)), ((100,), (50,)),
    ((51,), (26,)), ((9, 30), (1, 30)), ((5, 12), (3, 12))])  # fmt: skip
def test_chunks_are_consecutive_postures_of_like_size(shape, chunk):
    chunks, number, visited = Chunks.of(shape, 50), np.arange(np.prod(shape)).reshape(shape), []
    assert chunks.shape == chunk
    for k in range(len(chunks)):
        first, count = chunks.span(k)
        numbers = number[chunks.region(k)].ravel().tolist()
        assert numbers == list(range(first, first + count))
        visited += numbers
    assert visited == list(range(number.size))
