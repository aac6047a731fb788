"""Lists of postures and Sobol samples instead of grids."""

import math

import numpy as np
import pytest
from scipy.stats import qmc

import kickdyn as kd
from kickdyn.sweeps.queries import condition, outcome_at, pareto_front

LEG, KICK = kd.Leg.human(), kd.Kick(speed=5.0)
BOUNDS = {"hip": (-0.1, 0.7), "knee": (0.1, 0.9), "ankle": (-0.3, 0.4)}


@pytest.mark.parametrize("n", [300, 4096])  # one by one, and by the kernel
def test_a_list_has_the_answers_of_a_grid_in_its_order(n):
    values = {name: np.linspace(*bounds, 18) for name, bounds in BOUNDS.items()}
    grid = kd.sweep(LEG, values, KICK)
    places = np.random.default_rng(2).integers(0, 18, (3, n))
    rows = {name: values[name][k] for name, k in zip(values, places, strict=True)}
    table = kd.sweep(LEG, rows, KICK, samples="list")
    assert dict(table.sizes) == {"posture": n}
    for name in ("ball_speed", "worst_joint_impulse", "carry"):
        expected = grid[name].values[tuple(places)]
        np.testing.assert_allclose(table[name].values, expected, rtol=1e-9, atol=2e-6)
    np.testing.assert_array_equal(table.status.values, grid.status.values[tuple(places)])


def test_a_sample_is_the_sobol_sequence_between_the_bounds():
    table = kd.sweep(LEG, BOUNDS, KICK, samples=4096)
    points = qmc.scale(
        qmc.Sobol(3, scramble=False).random(4096), *np.transpose(list(BOUNDS.values()))
    )
    for name, expected in zip(BOUNDS, points.T, strict=True):
        np.testing.assert_allclose(table[name].values, expected, rtol=1e-14, atol=1e-15)
    for i in (0, 1234, 4095):
        impact = outcome_at(LEG, KICK, table.isel(posture=i)).impact
        assert float(impact.ball_after.speed) == pytest.approx(float(table.ball_speed[i]), 1e-10)
    share = float(condition(table, "20 < knee").mean())
    assert share == pytest.approx((0.9 - math.radians(20)) / 0.8, abs=2e-3)
    front = pareto_front(table)
    assert (np.diff(front.ball_speed) < 0).all()
    assert (np.diff(front.worst_joint_impulse) < 0).all()


def test_a_sample_in_a_store_is_resumed_and_known(tmp_path):
    path = tmp_path / "s.zarr"
    stored = kd.sweep(LEG, BOUNDS, KICK, samples=3000, store=path, variables=["ball_speed"])
    table = kd.sweep(LEG, BOUNDS, KICK, samples=3000)
    np.testing.assert_array_equal(stored.ball_speed, table.ball_speed.astype("f4"))
    np.testing.assert_array_equal(stored.knee, table.knee)
    again = {"store": path, "variables": ["ball_speed"], "resume": True}
    kd.sweep(LEG, BOUNDS, KICK, samples=3000, **again)
    other = {**BOUNDS, "knee": (0.1, 0.8)}
    with pytest.raises(kd.InvalidInput, match="its values of knee are not all the same"):
        kd.sweep(LEG, other, KICK, samples=3000, **again)


@pytest.mark.parametrize(
    ("postures", "samples", "message"),
    [
        (BOUNDS, "rows", "samples is 'rows': it must be 'list' or the number of postures"),
        (BOUNDS, 1.5, r"samples is 1\.5: it must be a whole number"),
        (BOUNDS, 0, "samples is 0.*: it must be a finite number at least 1 and at most 1e"),
        ({"hip": [0, 0.1, 0.2]}, 8, "joint hip has 3 values: a sample needs two, its bounds"),
        ({"hip": (0.5, 0.1)}, 8, "joint hip has .*: its values must be ascending"),
        (
            {"hip": [0.2, 0.1], "knee": [0.1]},
            "list",
            "joints have different numbers of values, hip 2, knee 1",
        ),
        ({"knee": [0.2, -9.0]}, "list", "joint knee is swept -515.662 deg: its range"),
    ],
)
def test_bad_samples_are_refused(postures, samples, message):
    with pytest.raises(kd.InvalidInput, match=message):
        kd.sweep(LEG, postures, KICK, samples=samples)
