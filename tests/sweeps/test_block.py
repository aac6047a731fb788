import numpy as np
from blocks import SPACE, made_up

import kickdyn as kd
from kickdyn.sweeps.block import Space
from kickdyn.sweeps.grid import grid

LEG = kd.Leg.human()


def test_angles_are_what_was_typed():
    postures = grid(LEG, ["hip=0:120:0.1", "knee=0:3:1"])
    hip = Space.of_grid(LEG, postures).axes["hip"]
    assert hip.tolist() == [float(f"{k / 10:.1f}") for k in range(1201)]
    assert np.degrees(postures.axes["hip"]).tolist() != hip.tolist()


def test_postures_count_as_the_grid_does():
    postures = grid(LEG, ["hip=0:20:10", "knee=0:30:10", "ankle=5"])
    space = Space.of_grid(LEG, postures)
    for number, q in enumerate(postures.configurations(LEG)):
        assert space.angles(number) == {k: round(v, 9) for k, v in LEG.angles_deg(q).items()}
        at = {
            name: values[space.index(name, np.int64(number))] for name, values in space.axes.items()
        }
        assert at == space.angles(number)
    assert space.text(11) == "hip 20 deg, knee 30 deg, ankle 5 deg"
    assert (space.shape, space.size) == ((3, 4, 1), 12)


def test_results_come_in_degrees_and_picked():
    block = made_up(1)
    mask = block("hip") > 3
    assert (block.pick(mask)("launch_angle") == np.degrees(block("ball_speed"))[mask]).all()
    assert (block.pick(mask).numbers == np.flatnonzero(mask)).all()
    assert (block.pick(mask)("slide") == np.tile([0.0, 1.0, 2.0], 15)).all()
    assert SPACE.units["launch_angle"] == SPACE.units["hip"] == "deg"
    assert SPACE.units["slide"] == "m"
