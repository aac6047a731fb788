import numpy as np
import pytest
import xarray as xr

import kickdyn as kd
from kickdyn.sweeps import chunk_solver, queries
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.grid import read_postures
from kickdyn.sweeps.queries import (
    blocks,
    condition,
    front_of,
    outcome_at,
    pareto_front,
    possible,
)
from kickdyn.sweeps.store import save_netcdf

LEG, KICK = kd.Leg.human(), kd.Kick(speed=6.0, attack=0.0, air=None)
POSTURES = read_postures(LEG, ["hip=0:90:15", "knee=0:30:5", "ankle=0:50:10"])
WHERE = "knee < 25 and worst_joint_impulse <= 1.8"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A sweep as a store of seven chunks and as a file."""
    path = tmp_path_factory.mktemp("sweeps")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunk_solver, "SLOW_CHUNK", 50)
        kd.sweep(LEG, POSTURES, KICK, store=path / "s.zarr")
    save_netcdf(kd.sweep(LEG, POSTURES, KICK), path / "s.nc")
    return path


@pytest.fixture(params=["s.zarr", "s.nc"])
def data(folder, request):
    return kd.open_sweep(folder / request.param)


@pytest.mark.parametrize("where", [None, WHERE])
def test_the_front_is_that_of_all_postures(data, where):
    front = pareto_front(data, where=where)
    counts = possible(data) if where is None else possible(data) & condition(data, where)
    assert 5 < int(counts.sum()) < data.status.size
    speed, load = (
        data[name].values[counts.values] for name in ("ball_speed", "worst_joint_impulse")
    )
    best = []
    for i in range(len(speed)):
        beaten = (speed >= speed[i]) & (load <= load[i]) & ((speed > speed[i]) | (load < load[i]))
        if not beaten.any():
            best.append(speed[i])
    assert front.ball_speed.values.tolist() == sorted(best, reverse=True)
    at = data.sel(hip=front.hip, knee=front.knee, ankle=front.ankle)
    for name in VARIABLES:
        assert (at[name].values == front[name].values).all()


def test_fronts_of_random_points():
    random = np.random.default_rng(0)
    for _ in range(30):
        points = np.column_stack([random.integers(0, 9, (40, 2)), np.arange(40)]).astype(float)
        front = front_of(points)
        for more, less, number in points:
            beats = (points[:, 0] >= more) & (points[:, 1] <= less)
            beats &= (points[:, 0] > more) | (points[:, 1] < less) | (points[:, 2] < number)
            assert (number in front[:, 2]) != beats.any()
    assert front_of(np.empty((0, 3))).shape == (0, 3)


def test_blocks_are_consecutive_and_small(data, monkeypatch):
    monkeypatch.setattr(queries, "BLOCK", 50)
    numbers, speeds = [], []
    for first, block in blocks(data):
        numbers += range(first, first + block.status.size)
        speeds += block.ball_speed.values.ravel().tolist()
        assert block.status.size <= 50
    assert numbers == list(range(data.status.size))
    assert speeds == data.ball_speed.values.ravel().tolist()


def test_the_outcome_of_a_posture_is_its_impact(data):
    best = pareto_front(data).isel(posture=0)
    outcome = outcome_at(LEG, KICK, best)
    assert outcome.impact.ball_after.speed == pytest.approx(float(best.ball_speed), rel=6e-8)
    assert outcome.impact.joint_impulses.shape[1] == 6
    cell = data.isel(hip=2, knee=3, ankle=1)
    assert outcome_at(LEG, KICK, cell).carry == pytest.approx(float(cell.carry), rel=6e-8)


DEGREES = {"hip": [0.0, 10.0, 20.0, 30.0], "knee": [5.0, 5.5, 40.0, 0.0]}


@pytest.fixture(scope="module")
def made_up():
    """Four postures of a joint, with a name that Python would not take and a nan."""
    hip = np.radians(DEGREES["hip"])
    columns = {name: ("hip", np.zeros(4)) for name in VARIABLES}
    columns["launch_angle"] = ("hip", np.radians(DEGREES["knee"]), {"units": "rad"})
    columns["carry"] = ("hip", [0.1, np.nan, 0.3, 0.4], {"units": "m"})
    columns["status"] = ("hip", np.zeros(4, np.int8))
    return xr.Dataset(columns, {"hip": ("hip", hip, {"units": "rad"}), "hip_deg": (
        "hip", DEGREES["hip"], {"units": "deg"})})  # fmt: skip


def test_angles_are_compared_to_a_billionth_of_a_degree(made_up):
    degrees = np.array([10.0, 10.003, 10.0039999, 10.005])
    shifted = made_up.assign_coords(hip=("hip", np.radians(degrees), {"units": "rad"}))
    assert condition(shifted, "hip < 10.004").values.tolist() == [True, True, True, False]
    assert condition(shifted, "hip == 10").values.tolist() == [True, False, False, False]
    assert condition(shifted, "hip < 10.0039998").values.tolist() == [True, True, False, False]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("hip<30", [1, 1, 1, 0]),
        ("launch_angle < 30 and hip >= 10", [0, 1, 0, 1]),
        ("not launch_angle > 5.2 or hip == 0", [1, 0, 0, 1]),
        ("0 < hip <= 20", [0, 1, 1, 0]),
        ("0 < hip < launch_angle", [0, 0, 1, 0]),
        ("hip - 2*launch_angle < -2", [1, 0, 1, 0]),
        ("-hip/10 + 1 > +0", [1, 0, 0, 0]),
        ("'hip' > 15", [0, 0, 1, 1]),
        ("carry > 0", [1, 0, 1, 1]),
        ("carry != 0.1", [0, 1, 1, 1]),
        ("hip / impulse > 1e299", [0, 1, 1, 1]),
        ("(hip > 5) and (hip < 25 or carry < 1) and not hip == 20", [0, 1, 0, 1]),
        (" hip > 5", [0, 1, 1, 1]),
    ],
)
def test_conditions(made_up, text, expected):
    assert condition(made_up, text).values.tolist() == [bool(each) for each in expected]


def test_a_condition_of_constants(made_up):
    assert bool(condition(made_up, "1 < 2"))


def test_comparisons_are_pythons(made_up):
    random = np.random.default_rng(3)
    for _ in range(100):
        a, b, c = random.choice(["<", "<=", ">", ">=", "!="], 3)
        join, no = random.choice(["and", "or"]), random.choice(["", "not "])
        text = f"{no}hip {a} carry {b} 15.5 {join} hip - carry {c} {random.integers(30)}"
        carry = made_up.carry.values.tolist()
        pairs = zip(DEGREES["hip"], carry, strict=True)
        expected = [eval(text, {"hip": h, "carry": k}) for h, k in pairs]
        assert condition(made_up, text).values.tolist() == expected, text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("kneee<30", r"names 'kneee', which is unknown: there are hip \[deg\], effective_mass"),
        ("hip", "is a number: compare it"),
        ("carry and hip", "'carry and hip' cannot be read: it consists of comparisons"),
        ("not hip", "cannot be read"),
        ("hip = 30", "cannot be read: it consists of comparisons"),
        ("", "cannot be read"),
        ("hip <", "cannot be read"),
        ("hip\0<3", "cannot be read"),
        ("__import__('os').system('true') < 1", "in it: it consists of"),
        ("hip.real < 1", "has 'hip.real' in it"),
        ("hip[0] < 1", r"has 'hip\[0\]' in it"),
        ("hip ** 9 < 1", "cannot be read"),
        ("hip % 9 < 1", "cannot be read"),
        ("hip in (1, 2)", r"has '\(1, 2\)' in it"),
        ("(lambda: hip)() < 1", "in it: it consists of"),
        ("hip if hip else hip < 1", "in it: it consists of"),
        ("f'{hip}' < 1", "in it: it consists of"),
        ("(hip := 3) < 1", "in it: it consists of"),
        ("True", "has 'True' in it"),
        ("hip < 1j", "has '1j' in it"),
        ("hip < 1" + "0" * 400, "cannot be read"),
        ("hip < " + "-" * 990 + "1", "cannot be read|condition"),
        ("(" * 300 + "hip" + ")" * 300 + " < 1", "cannot be read"),
        ("hip < " + "1 + " * 400 + "1", "text of up to 1000 characters"),
        (7, "text of up to 1000 characters"),
    ],
)
def test_what_is_refused_in_one_line(made_up, text, words):
    with pytest.raises(kd.InvalidInput, match=words) as refused:
        condition(made_up, text)
    assert "\n" not in str(refused.value)


def test_a_front_of_no_posture_or_of_an_unknown_variable(data):
    assert pareto_front(data, where="hip < 0").sizes["posture"] == 0
    with pytest.raises(kd.InvalidInput, match="names 'speed', which is unknown"):
        pareto_front(data, more="speed")


def test_what_xarray_selects_can_be_queried(data):
    part = data.isel(knee=1)
    front, speed = pareto_front(part), part.ball_speed.where(possible(part))
    assert float(front.ball_speed[0]) == float(speed.max())
    turned = pareto_front(data.transpose("ankle", "hip", "knee")).ball_speed.values
    assert turned.tolist() == pareto_front(data).ball_speed.values.tolist()
