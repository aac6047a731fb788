import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.sweeps.dataset import VARIABLES, describe, difference, provenance, with_variables
from kickdyn.sweeps.grid import Grid, read_postures
from kickdyn.sweeps.sweep_kick import Kick

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
        (human(1 + 1e-11), KICK, {"model_sha256"}),
        (human().with_armature({"hip": 0.1}), KICK, {"model_sha256"}),
        (human(), replace(KICK, ball=kd.Ball(inertia_factor=0.4)), {"ball_inertia_factor"}),
        (human(), replace(KICK, attack=np.nextafter(0.3, 1.0)), {"attack_rad"}),
        (human(), replace(KICK, air=kd.Air(density=kd.Air().density + 1e-9)), {"air_sha256"}),
    ],
)
def test_the_least_difference_has_a_name(leg, kick, names):
    assert different(chunk_summary(human(), KICK), chunk_summary(leg, kick)) == names


def test_rounding_of_a_model_makes_no_other_leg():
    leg, other = kd.Leg.human(), kd.Leg.human().model
    for place in other.jointPlacements:
        place.rotation = place.rotation @ pin.exp3(1e-15 * np.ones(3))
        place.translation = (1.0 + 1e-15) * place.translation + 1e-17
    legs = leg, kd.Leg.from_model(other, "toe")
    texts = [each.model.saveToString() for each in legs]
    assert texts[0] != texts[1]
    hashes = {provenance(each, KICK)["model_sha256"] for each in legs}
    assert len(hashes) == 1


def test_what_is_locked_where_and_what_holds_the_leg():
    one, other = (kd.Leg.human().locked({"ankle": angle}) for angle in (0.0, 0.5))
    assert different(chunk_summary(one, KICK), chunk_summary(other, KICK)) == {"model_sha256"}
    free = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
    closed = free.with_loops(("shank_pin", "rocker_b_tip"))
    changed = {"model_sha256", "warnings"}
    assert different(chunk_summary(free, KICK), chunk_summary(closed, KICK)) == changed


def test_functions_of_someones_own_count():
    one, other = (replace(KICK, air=kd.Air(drag=drag(level))) for level in (0.2, 0.3))
    assert different(chunk_summary(human(), one), chunk_summary(human(), other)) == {"air_sha256"}


def described(*joints, kick=KICK):
    leg = kd.Leg.human()
    return describe(leg, Grid.of(leg, read_postures(leg, joints)), kick, 0.0)


def stored(data):
    shape = tuple(data.sizes.values())
    rows = np.zeros((len(VARIABLES), int(np.prod(shape))))
    return with_variables(data, rows, np.zeros(rows.shape[1], np.int8))


HERE = ("hip=-30:90:0.5", "knee=0:140:10")


@pytest.mark.parametrize(
    ("there", "words"),
    [
        (HERE, None),
        (HERE[:1], "its joints are hip, this one's hip, knee"),
        (HERE[::-1], "its joints are knee, hip, this one's hip, knee"),
        ((HERE[0], "knee=0:140:20"), "its values of knee are not all the same"),
        ((HERE[0], "knee=20"), "its values of knee are not all the same"),
    ],
)
def test_another_grid_is_told_by_its_joints(there, words):
    found = difference(stored(described(*there)), described(*HERE))
    assert found is None if words is None else found.startswith(words)


def test_every_value_of_an_axis_counts():
    one, other = stored(described(*HERE)), described(*HERE)
    moved = one.knee.values.copy()
    moved[2] = np.nextafter(moved[2], 1.0)
    one = one.assign_coords(knee=("knee", moved, one.knee.attrs))
    found = difference(one, other)
    assert found == "its values of knee are not all the same"


@pytest.mark.parametrize(
    ("leg", "kick", "words"),
    [
        (human(1.1), KICK, "its leg's model is not this one's: masses"),
        (human(), replace(KICK, speed=2.0), "its foot_speed_m_s is 1.0, this one's 2.0"),
        (human(), replace(KICK, air=kd.Air(drag=drag(0.2))), "its air is"),
        (
            human(),
            replace(KICK, air=kd.Air(density=kd.Air().density + 1e-9)),
            "its air is not this one's: digits that are not printed",
        ),
    ],
)
def test_another_leg_or_kick_is_told_in_words(leg, kick, words):
    grid = Grid({"hip": np.zeros(1)})
    one, other = (describe(*each, 0.0) for each in ((human(), grid, KICK), (leg, grid, kick)))
    found = difference(stored(one), other)
    assert found.startswith(words)
    assert len(found) < 400
    assert "sha256" not in found


def test_every_property_of_a_leg_that_changes_an_impact_makes_it_another_leg(tmp_path):
    """A store of one is not resumed with the other."""
    leg, feet = kd.Leg.human(), kd.Leg.from_robot("g1", base="floating", legs_only=True)
    foot, shank = "left_ankle_roll_link", "left_knee_link"
    text = leg.file.text.replace(
        "</joint>", '<mimic joint="hip" multiplier="0.5"/></joint>', 2
    ).replace('<mimic joint="hip" multiplier="0.5"/></joint>', "</joint>", 1)
    geared = []
    for ratio in (0.5, 0.25):
        (tmp_path / "leg.urdf").write_text(text.replace('"0.5"/></joint>', f'"{ratio}"/></joint>'))
        geared.append(kd.Leg.from_urdf(tmp_path / "leg.urdf", "toe"))
    running = [each.with_base_velocity((3, 0, 0)) for each in (leg, leg.with_stiff_joints("ankle"))]
    legs = [
        leg, *running, leg.with_base_velocity((2, 0, 0)), leg.with_stiff_joints("ankle"),
        leg.with_stiff_joints("knee"),
        leg.with_armature({"knee": 0.01}), *geared, feet, feet.with_supports(foot),
        feet.with_supports(shank), feet.with_supports(kd.Support(foot, point=True)),
        feet.with_loops((foot, "pelvis")), feet.with_loops((shank, "pelvis")),
    ]  # fmt: skip
    hashes = [provenance(each, KICK)["model_sha256"] for each in legs]
    assert len(set(hashes)) == len(legs)
    assert hashes[0] == provenance(kd.Leg.human(), KICK)["model_sha256"]


def test_a_joint_must_not_have_the_name_of_a_variable():
    for name in ("carry", "status", "a/b", "."):
        with pytest.raises(kd.InvalidInput, match=f"joint '{name}' cannot be swept"):
            describe(human(), Grid({name: np.zeros(1)}), KICK, 0.0)
    with pytest.raises(kd.InvalidInput, match="joint 'hip_deg' cannot be swept"):
        describe(human(), Grid({"hip": np.zeros(1), "hip_deg": np.zeros(1)}), KICK, 0.0)
