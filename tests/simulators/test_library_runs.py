"""Kicks of a library that was carried out in MuJoCo meet their goals there."""

import math

import numpy as np
import pytest

import kickdyn as kd

pytest.importorskip("mujoco")


@pytest.mark.slow
def test_kicks_are_corrected_once_every_motion_was_carried_out_if_not_in_one_go(tmp_path):
    ranges, runs = {"speed": (12, 12.4), "elevation": (math.radians(10), math.radians(12))}, []
    library = kd.kick_library(kd.Leg.human(), tmp_path / "one.npz", **ranges, height=-0.7042)

    def stop(*counts):
        runs.append(counts)
        if len(runs) == 1:
            raise KeyboardInterrupt

    with pytest.raises(kd.KickdynError, match=r"1 runs are stored in .*one\.npz"):
        kd.correct_library(library, progress=stop)
    library = kd.correct_library(kd.kick_library(library.robot, library.file), progress=stop)
    assert runs == [("runs", 1, 4), *(("runs", k, 3) for k in (1, 2, 3))]
    launches = library.reader.arrays["simulated"]
    assert np.abs(launches[:, 0] / library.reader.node_points[:, 0] - 1.0).max() > 0.02
    speed, elevation, _ = launches.mean(axis=0)
    goal = kd.Goal(speed**2 * math.sin(2.0 * elevation) / 9.81, speed=speed)
    run = kd.run_in_mujoco(library.plan(goal))
    assert abs(run.speed_error) < 0.01
    assert run.direction_error < math.radians(0.5)
