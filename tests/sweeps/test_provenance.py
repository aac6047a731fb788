import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.sweeps.grid import Grid, grid
from kickdyn.sweeps.kick import Kick
from kickdyn.sweeps.provenance import axes, difference, provenance

KICK = Kick(attack=0.3)


def human(mass=1.0):
    model = kd.Leg.human().model
    one = model.inertias[3]
    model.inertias[3] = pin.Inertia(mass * one.mass, one.lever, mass * one.inertia)
    return kd.Leg.from_model(model, "toe")


def drag(level):
    return lambda reynolds, spin_parameter: level


def chunk_summary(leg, kick):
    return json.loads(json.dumps(provenance(leg, kick)))


def different(one, other):
    return {name for name, value in one.items() if other[name] != value}


def test_the_same_again_is_the_same():
    assert chunk_summary(human(), KICK) == chunk_summary(human(), Kick(attack=0.3))
    kicks = [replace(KICK, air=kd.Air(drag=drag(0.2), wind=(1.0, 0.0, 0.0))) for _ in range(2)]
    assert chunk_summary(human(), kicks[0]) == chunk_summary(human(), kicks[1])


@pytest.mark.parametrize(
    ("leg", "kick", "names"),
    [
        (human(1 + 1e-15), KICK, {"model_sha256"}),
        (human().with_armature({"hip": 0.1}), KICK, {"model_sha256"}),
        (human(), replace(KICK, ball=kd.Ball(inertia_factor=0.4)), {"ball_inertia_factor"}),
        (human(), replace(KICK, attack=np.nextafter(0.3, 1.0)), {"attack_rad"}),
        (human(), replace(KICK, air=kd.Air(density=kd.Air().density + 1e-9)), {"air_sha256"}),
    ],
)
def test_the_least_difference_has_a_name(leg, kick, names):
    assert different(chunk_summary(human(), KICK), chunk_summary(leg, kick)) == names


def test_what_is_locked_where_and_what_holds_the_leg():
    one, other = (kd.Leg.human().locked({"ankle": angle}) for angle in (0.0, 0.5))
    assert different(chunk_summary(one, KICK), chunk_summary(other, KICK)) == {"model_sha256"}
    free = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
    closed = free.with_loops(("shank_pin", "rocker_b_tip"))
    assert different(chunk_summary(free, KICK), chunk_summary(closed, KICK)) == {"model_sha256"}


def test_functions_of_someones_own_count():
    one, other = (replace(KICK, air=kd.Air(drag=drag(level))) for level in (0.2, 0.3))
    assert different(chunk_summary(human(), one), chunk_summary(human(), other)) == {"air_sha256"}


def test_every_value_of_an_axis_counts():
    values = np.linspace(0.0, 1.0, 5)
    moved = values.copy()
    moved[2] = np.nextafter(0.5, 1.0)
    one, other = axes(Grid({"hip": values})), axes(Grid({"hip": moved}))
    assert one["hip"][:3] == other["hip"][:3] == [5, 0.0, 1.0]
    assert one != other


HERE = ("hip=-30:90:0.5", "knee=0:140:0.5")


@pytest.mark.parametrize(
    ("there", "said"),
    [
        (HERE, None),
        (HERE[:1], "its joints are hip, this one's hip, knee"),
        (HERE[::-1], "its joints are knee, hip, this one's hip, knee"),
        ((HERE[0], "knee=0:140:1"), "knee has 141 values from 0 to 140 deg there, 281 values here"),
        (
            ("hip=-30:0:0.3", "knee=20"),
            "hip has 101 values from -30 to 0 deg there, 241 values from -30 to 90 deg here; "
            "knee has 1 value of 20 deg there, 281 values from 0 to 140 deg here",
        ),
    ],
)
def test_another_grid_is_told_by_its_joints(there, said):
    leg = kd.Leg.human()
    found, wanted = ({"grid": axes(grid(leg, each))} for each in (there, HERE))
    assert difference(found, wanted, dict.fromkeys(("hip", "knee"), "rad")) == said


@pytest.mark.parametrize(
    "there", [None, [], {"hip": 3}, {"hip": [1, 0.0, 0.0]}, {"hip": ["1"] * 4}]
)
def test_a_grid_that_is_none_is_another(there):
    wanted = {"grid": axes(Grid({"hip": np.zeros(1)}))}
    assert difference({"grid": there}, wanted, {"hip": "rad"}).startswith(f"its grid is {there!r}")


def test_an_axis_that_looks_the_same_is_told_too():
    found, wanted = ({"grid": axes(Grid({"rail": np.array([0.0, end])}))} for end in (0.3, 0.1 * 3))
    said = "rail has 2 values from 0 to 0.3 m there as here, but not the same ones"
    assert difference(found, wanted, {"rail": "m"}) == said


@pytest.mark.parametrize(
    ("leg", "kick", "said"),
    [
        (human(1.1), KICK, "its leg's model is not this one's: masses"),
        (human(), replace(KICK, speed=2.0), "its foot_speed_m_s is 1.0, this one's 2.0"),
        (human(), replace(KICK, air=kd.Air(drag=drag(0.2))), "its air is"),
        (
            human(),
            replace(KICK, air=kd.Air(density=kd.Air().density + 1e-9)),
            "its air is not this one's: digits that are not shown",
        ),
    ],
)
def test_another_leg_or_kick_is_told_in_words(leg, kick, said):
    told_so = difference(chunk_summary(human(), KICK), chunk_summary(leg, kick), {})
    assert told_so.startswith(said)
    assert len(told_so) < 400
    assert "sha256" not in told_so
