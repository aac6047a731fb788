"""The provenance of a sweep names every difference of leg and kick, and no rounding."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.sweeps.dataset import VARIABLES, describe, difference, provenance, with_variables
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.sweep_kick import Kick

LEG, KICK = kd.Leg.human(), Kick(attack=0.3)
AXES = {"hip": np.radians([-30.0, 0.0, 90.0]), "knee": np.radians([10.0, 20.0])}


def heavier(share):
    model = LEG.model
    shank = model.inertias[3]
    model.inertias[3] = pin.Inertia(share * shank.mass, shank.lever, share * shank.inertia)
    return kd.Leg.from_model(model, "toe")


def drag(level):
    return lambda reynolds, spin_parameter: level


def airy(**options):
    return replace(KICK, air=kd.Air(**options))


def stored(leg=LEG, kick=KICK, axes=AXES):
    """Return a dataset of zeros, as a store has it."""
    described = describe(leg, Grid(axes), kick, 0.0)
    count = int(np.prod(list(described.sizes.values())))
    return with_variables(described, np.zeros((len(VARIABLES), count)), np.zeros(count, np.int8))


@pytest.mark.parametrize(("leg", "kick", "names"), [
    (heavier(1.0), Kick(attack=0.3), set()), (heavier(1 + 1e-14), KICK, set()),
    (heavier(1 + 1e-10), KICK, {"model_sha256"}),
    (LEG.with_armature({"hip": 0.1}), KICK, {"model_sha256"}),
    (LEG, replace(KICK, ball=kd.Ball(inertia_factor=0.4)), {"ball_inertia_factor"}),
    (LEG, replace(KICK, attack=np.nextafter(0.3, 1.0)), {"attack_rad"}),
    (LEG, airy(density=kd.Air().density * (1 + 1e-14)), set()),
    (LEG, airy(density=kd.Air().density * (1 + 1e-10)), {"air_sha256"}),
    (LEG, airy(drag=0.2), {"air", "air_sha256"})])  # fmt: skip
def test_provenance_differs_where_leg_or_kick_do(leg, kick, names):
    one, other = provenance(heavier(1.0), KICK), provenance(leg, kick)
    texts = {"leg_sha256", "leg", "title", "warnings"}  # of a file, or without one
    assert {name for name in one if other[name] != one[name]} - texts == names


def test_every_property_of_a_leg_that_changes_an_impact_makes_it_another_leg(leg_with_arm):
    geared, feet = kd.Leg.from_urdf(leg_with_arm, "toe"), kd.Leg.from_robot("bolt", base="floating")
    leg_with_arm.write_text(leg_with_arm.read_text().replace('offset="0.3"', 'offset="0.2"'))
    fourbar = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
    foot = "FL_FOOT"
    legs = [
        LEG, LEG.with_base_velocity((3, 0, 0)), LEG.with_base_velocity((2, 0, 0)),
        LEG.with_stiff_joints("ankle"), LEG.with_stiff_joints("knee"),
        LEG.with_armature({"knee": 0.01}), LEG.locked({"ankle": 0.0}), LEG.locked({"ankle": 0.5}),
        geared, kd.Leg.from_urdf(leg_with_arm, "toe"), feet, feet.with_supports(foot),
        feet.with_supports(kd.Support(foot, point=True)), fourbar,
        fourbar.with_loops(("shank_pin", "rocker_b_tip")),
    ]  # fmt: skip
    hashes = [provenance(leg, KICK)["model_sha256"] for leg in legs]
    assert len(set(hashes)) == len(legs)


@pytest.mark.parametrize(("sweep", "words"), [
    ({}, None), ({"leg": heavier(1.1)}, ["model", "masses"]),
    ({"kick": replace(KICK, speed=2.0)}, ["foot_speed_m_s", "1.0", "2.0"]),
    ({"kick": airy(drag=drag(0.2))}, ["air"]),
    ({"kick": airy(density=kd.Air().density + 1e-9)}, ["air", "functions"]),
    ({"kick": replace(KICK, restitution=0.8 + 1e-14)}, None),
    ({"kick": replace(KICK, restitution=0.8 + 1e-9)}, ["restitution"]),
], ids=lambda value: str(value)[:40])  # fmt: skip
def test_the_difference_of_two_sweeps_is_named(sweep, words):
    """Of leg and kick; a restitution given as a number is compared as it was given, too."""
    described = describe(heavier(1.0), Grid(AXES), KICK, 0.0)
    other = stored(**{"leg": heavier(1.0), **sweep})
    if sweep.get("kick") == replace(KICK, restitution=0.8 + 1e-14):
        other.attrs["restitution_given"] = 0.8
    result = difference(other, described)
    if words is None:
        assert result is None
    else:
        assert all(word in result for word in words), result


def test_coordinates_and_variables_have_units():
    data = stored()
    assert {name: data[name].attrs["units"] for name in VARIABLES} == {
        name: unit for name, (unit, _) in VARIABLES.items()
    }
    assert (data.hip.attrs["units"], data.hip_deg.attrs["units"]) == ("rad", "degree")
    assert data.hip_deg.values.tolist() == [-30.0, 0.0, 90.0]
    flags = zip(data.status.attrs["flag_meanings"].split(), data.status.attrs["flag_values"],
                strict=True)  # fmt: skip
    assert dict(flags)["ok"] == 0
    assert dict(data.sizes) == {"hip": 3, "knee": 2}


def test_the_numbers_of_the_kick_are_attributes():
    kick = Kick(speed=7.5, attack=0.3, restitution=[[5, 0.8], [10, 0.7]], friction=0.2,
                ball=kd.Ball(0.4, 0.1, 0.5))  # fmt: skip
    attributes = provenance(LEG, kick)
    right = {"foot_speed_m_s": 7.5, "attack_rad": 0.3, "attack_deg": 54 / np.pi, "friction": 0.2,
             "restitution": 0.75, "ball_mass_kg": 0.4, "ball_radius_m": 0.1,
             "ball_inertia_factor": 0.5}  # fmt: skip
    assert {name: attributes[name] for name in right} == pytest.approx(right, abs=1e-10)
    assert attributes["restitution_given"] == "[[5, 0.8], [10, 0.7]]"
