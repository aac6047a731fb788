import numpy as np

from kickdyn.sweeps import columns
from kickdyn.sweeps.columns import fill
from kickdyn.sweeps.run import VARIABLES


def test_rows_are_in_the_order_of_the_variables():
    names = ["MASS", "IMPULSE", "IMMOVABLE", "BALL_SPEED", "SPEED_RATIO", "LAUNCH_ANGLE",
             "BACK_SPIN", "WORST_JOINT", "ENERGY_LOST", "SPEED_USE", "CARRY", "RESTITUTION",
             "MOMENTUM"]  # fmt: skip
    for name, (row, variable) in zip(names, enumerate(VARIABLES), strict=True):
        assert getattr(columns, name) == row
        assert name.split("_")[0].lower() in variable


def test_what_is_not_finite_is_doubted():
    found = np.ones((10, 12))
    found[4] = 0.0
    for row in range(10):
        found[row, row] = np.inf if row % 2 else np.nan
    found[6, 11] = 2.0
    rows, status, doubt = np.zeros((13, 12)), np.zeros(12, np.int8), np.zeros(12, bool)
    fill(found, np.eye(3), (1.0, 0.5, 0.4, 2.0), rows, status, doubt)
    assert doubt.tolist() == [True] * 10 + [False] * 2
    assert status[10:].tolist() == [0, 1]
    assert rows[:7, 10].tolist() == [1, 3**0.5, 1.5, 3**0.5 / 0.4, 3**0.5 / 0.4,
                                     np.arctan2(1, 2**0.5), 2.0]  # fmt: skip
