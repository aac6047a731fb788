"""Conditions and Pareto fronts over datasets in memory and in stores."""

import numpy as np
import pytest
import xarray as xr

import kickdyn as kd
from kickdyn.sweeps import chunk_solver
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.grid import read_postures
from kickdyn.sweeps.queries import condition, front_of, outcome_at, pareto_front, possible

LEG, KICK = kd.Leg.human(), kd.Kick(speed=6.5, attack=0.0, air=None)
POSTURES = read_postures(LEG, ["hip=0:90:30", "knee=0:30:10", "ankle=0:50:25"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("sweeps")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunk_solver, "CHUNK", 12)
        kd.sweep(LEG, POSTURES, KICK, store=path / "s.zarr")
    return path


@pytest.fixture(params=["store", "memory"])
def data(folder, request):
    stored = kd.open_sweep(folder / "s.zarr")
    return stored if request.param == "store" else stored.load()


def dominated(points, row):
    """Whether another row beats this one in both, or comes before its equal."""
    more, less, number = row
    better = (points[:, 0] >= more) & (points[:, 1] <= less)
    better &= (points[:, 0] > more) | (points[:, 1] < less) | (points[:, 2] < number)
    return better.any()


@pytest.mark.parametrize("where", [None, "knee < 25 and worst_joint_impulse <= 2.4"])
def test_the_front_is_that_of_all_postures(data, where):
    front = pareto_front(data, where=where)
    counts = possible(data) if where is None else possible(data) & condition(data, where)
    assert 3 < int(counts.sum()) < data.status.size
    columns = [data[name].values[counts.values] for name in ("ball_speed", "worst_joint_impulse")]
    points = np.column_stack([*columns, np.arange(len(columns[0]))])
    right = sorted((row[0] for row in points if not dominated(points, row)), reverse=True)
    assert front.ball_speed.values.tolist() == right
    at = data.sel(hip=front.hip, knee=front.knee, ankle=front.ankle)
    for name in VARIABLES:
        assert (at[name].values == front[name].values).all()


def test_fronts_of_random_points():
    random = np.random.default_rng(0)
    for _ in range(30):
        points = np.column_stack([random.integers(0, 9, (40, 2)), np.arange(40)]).astype(float)
        front = front_of(points)
        for row in points:
            assert (row[2] in front[:, 2]) != dominated(points, row)
    assert front_of(np.empty((0, 3))).shape == (0, 3)


def test_the_outcome_of_a_posture_is_its_impact(data):
    cell = data.isel(hip=2, knee=3, ankle=1)
    for posture in (pareto_front(data).isel(posture=0), cell):
        outcome = outcome_at(LEG, KICK, posture)
        speed, carry = outcome.impact.ball_after.speed, outcome.carry
        right = float(posture.ball_speed), float(posture.carry)
        assert (speed, carry) == pytest.approx(right, rel=1.2e-7)  # of float32


DEGREES = {"hip": [0.0, 10.0, 20.0, 30.0], "launch_angle": [5.0, 5.5, 40.0, 0.0]}
CARRY = [0.1, np.nan, 0.3, 0.4]


@pytest.fixture(scope="module")
def made_up():
    """Four postures of a joint, one with a carry of nan."""
    columns = {name: ("hip", np.zeros(4)) for name in VARIABLES}
    columns["launch_angle"] = ("hip", np.radians(DEGREES["launch_angle"]), {"units": "rad"})
    columns["carry"] = ("hip", CARRY, {"units": "m"})
    columns["status"] = ("hip", np.zeros(4, np.int8))
    hip = np.radians(DEGREES["hip"])
    return xr.Dataset(columns, {"hip": ("hip", hip, {"units": "rad"}), "hip_deg": (
        "hip", DEGREES["hip"], {"units": "deg"})})  # fmt: skip


@pytest.mark.parametrize("text", [
    "hip<30", "launch_angle < 30 and hip >= 10", "not launch_angle > 5.2 or hip == 0",
    "0 < hip <= 20", "0 < hip < launch_angle", "hip - 2*launch_angle < -2", "-hip/10 + 1 > +0",
    "'hip' > 15", "carry > 0", "carry != 0.1", " hip > 5", "not hip > carry", "1 < 2",
    "(hip > 5) and (hip < 25 or carry < 1) and not hip == 20"])  # fmt: skip
def test_a_condition_is_true_where_python_says_so(made_up, text):
    rows = zip(DEGREES["hip"], DEGREES["launch_angle"], CARRY, strict=True)
    plain = text.strip().replace("'hip'", "hip")
    right = [eval(plain, {"hip": h, "launch_angle": a, "carry": c}) for h, a, c in rows]
    assert np.broadcast_to(condition(made_up, text).values, 4).tolist() == right


@pytest.mark.parametrize(("text", "word"), [
    ("kneee<30", r"'kneee'.*hip \[deg\]"), ("hip", "number"), ("carry and hip", "comparisons"),
    ("not hip", "comparisons"), ("hip = 30", "comparisons"), ("", "read"), ("hip <", "read"),
    ("hip\0<3", "read"), ("__import__('os').system('true') < 1", "consists of"),
    ("hip.real < 1", "'hip.real'"), ("hip[0] < 1", r"'hip\[0\]'"), ("hip ** 9 < 1", "read"),
    ("hip in (1, 2)", r"'\(1, 2\)'"), ("(lambda: hip)() < 1", "consists of"),
    ("(hip := 3) < 1", "consists of"), ("True", "'True'"), ("hip < 1j", "'1j'"),
    ("hip < 1" + "0" * 400, "read"), ("hip < " + "-" * 990 + "1", "condition"),
    ("(" * 300 + "hip" + ")" * 300 + " < 1", "read"), ("hip < " + "1 + " * 400 + "1", "1000"),
    (7, "1000")], ids=lambda value: str(value)[:20])  # fmt: skip
def test_other_texts_are_refused_in_one_line(made_up, text, word):
    with pytest.raises(kd.InvalidInput, match=word):
        condition(made_up, text)
