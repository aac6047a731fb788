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
    slopes_at,
)
from kickdyn.sweeps.store import save_netcdf
from kickdyn.sweeps.sweep_kick import kick_from

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


def bowl(hip, slide):
    return 5 - 0.5 * (hip - 7) ** 2 + 3 * (hip - 7) * (slide - 0.3) - 8 * (slide - 0.3) ** 2


@pytest.fixture
def bowls():
    """A height over two joints and a third that has one value; a variable tells where to look."""
    hip, slide = np.arange(0.0, 20.0, 2.0), np.arange(0.0, 1.0, 0.25)
    heights = bowl(hip[:, None, None], slide[None, :, None])
    dims = ("hip", "slide", "held")
    data = xr.Dataset(dict.fromkeys(VARIABLES, (dims, heights)))
    data["status"] = (dims, np.zeros(heights.shape, np.int8))
    units = {"hip": "m", "slide": "m", "held": "m"}
    return data.assign_coords(
        {name: (name, values, {"units": units[name]})
         for name, values in {"hip": hip, "slide": slide, "held": [0.0]}.items()}
    )  # fmt: skip


def test_a_bowl_has_its_own_derivatives(bowls):
    found = slopes_at(bowls, bowls.isel(hip=4, slide=1, held=0))
    assert found.slope.values[:2] == pytest.approx([-1 + 3 * -0.05, 3 + 0.8])
    assert found.slope_error.values[0] == pytest.approx(0, abs=1e-12)
    assert found.curvature.values[:2, :2] == pytest.approx(np.array([[-1, 3], [3, -16]]))
    assert np.isnan(found.curvature.sel(joint="held").values).all()
    assert np.isnan(found.slope.sel(joint="held"))


@pytest.mark.parametrize(("hip", "slide"), [(0.0, 0.0), (18.0, 0.75)])
def test_at_an_end_the_slope_is_one_sided_and_of_second_order(bowls, hip, slide):
    found = slopes_at(bowls, bowls.sel(hip=hip, slide=slide, held=0))
    assert found.slope.values[:2] == pytest.approx(
        [7 - hip + 3 * (slide - 0.3), 3 * (hip - 7) - 16 * (slide - 0.3)]
    )
    assert found.curvature.values[:2, :2] == pytest.approx(np.array([[-1, 3], [3, -16]]))


def line(x, f, lost=()):
    """A sweep of one joint at x whose ball speed is f; postures in `lost` are too fast."""
    data = xr.Dataset(dict.fromkeys(VARIABLES, ("hip", f)), {"hip": ("hip", x, {"units": "m"})})
    return data.assign(status=("hip", np.isin(np.arange(len(x)), lost).astype(np.int8)))


def test_the_error_of_the_slope_of_a_cubic_is_exact():
    x = 0.5 * np.arange(9.0)
    data = line(x, x**3 - 90.0 * x)
    found = slopes_at(data, data.sel(hip=2.0))
    assert found.slope.values == pytest.approx([3 * 2.0**2 - 90 + 0.25])  # h^2 f_xxx / 6
    assert found.slope_error.values == pytest.approx([0.25])
    assert found.curvature.values == pytest.approx(6 * 2.0)


def test_joints_may_have_uneven_values():
    x = np.array([0.0, 0.5, 0.7, 1.5, 1.6])
    data = line(x, x**2)
    found = slopes_at(data, data.isel(hip=2))
    assert found.slope.values == pytest.approx([1.4])
    assert found.curvature.values == pytest.approx(2.0)


@pytest.mark.parametrize(("lost", "slope", "error"), [
    ((5,), 3 * 4.0 - 0.5, 0.5), ((3,), 3 * 4.0 - 0.5, 0.5), ((3, 5), np.nan, np.nan),
    ((2, 6), 12.25, np.nan), ((0, 8), 12.25, 0.25),
])  # fmt: skip
def test_postures_that_are_not_ok_are_no_neighbours(lost, slope, error):
    x = 0.5 * np.arange(9.0)
    data = line(x, x**3, lost)
    found = slopes_at(data, data.sel(hip=2.0))
    assert found.slope.values == pytest.approx([slope], nan_ok=True)
    assert found.slope_error.values == pytest.approx([error], nan_ok=True)
    assert np.isnan(found.curvature.values).all() == bool({3, 5} & set(lost))


def test_slopes_of_a_kick_are_within_their_errors():
    kick = kd.Kick(speed=3.0, air=None)
    data = kd.sweep(LEG, read_postures(LEG, ["hip=20:28:2", "knee=5:13:2", "ankle=-14:-6:2"]), kick)
    found = slopes_at(data, data.isel(hip=2, knee=2, ankle=2))

    def speed(change):
        q = np.radians([24.0, 9.0, -10.0]) + change
        return kick_from(LEG.posture(q), kick).impact.ball_after.speed

    for i, h in enumerate(1e-4 * np.eye(3)):
        exact = (speed(h) - speed(-h)) / 2e-4
        error = float(found.slope_error[i])
        assert abs(float(found.slope[i]) - exact) < 2 * error < 0.04 * abs(exact)


def test_no_posture_for_slopes_or_a_front(data):
    for wrong in (data, data.isel(hip=0), data.isel(hip=0, knee=0, ankle=0).assign_coords(hip=9.0)):
        with pytest.raises(kd.InvalidInput, match="posture is not one posture of the dataset"):
            slopes_at(data, wrong)
    with pytest.raises(kd.InvalidInput, match="names 'speed', which is unknown"):
        slopes_at(data, data.isel(hip=0, knee=0, ankle=0), of="speed")
    assert pareto_front(data, where="hip < 0").sizes["posture"] == 0
    with pytest.raises(kd.InvalidInput, match="names 'speed', which is unknown"):
        pareto_front(data, more="speed")


def test_the_error_of_a_slope_counts_the_digits_and_its_unit_has_a_name():
    x = 0.5 * np.arange(9.0)
    data = line(x, (x**3 - 90.0 * x).astype("f4"))  # exact in seven digits, which is not known
    data.ball_speed.attrs["units"] = "m/s"
    found = slopes_at(data, data.sel(hip=2.0))
    rounding = 2.0**-23 * 172.0 / 0.5
    assert found.slope_error.values == pytest.approx([0.25 + rounding], rel=1e-9)
    assert found.joint_unit.values.tolist() == ["m"]
    assert found.attrs == {"variable": "ball_speed", "units": "m/s"}


def test_what_xarray_selects_can_be_queried(data):
    part = data.isel(knee=1)
    front, speed = pareto_front(part), part.ball_speed.where(possible(part))
    assert float(front.ball_speed[0]) == float(speed.max())
    turned = pareto_front(data.transpose("ankle", "hip", "knee")).ball_speed.values
    assert turned.tolist() == pareto_front(data).ball_speed.values.tolist()
