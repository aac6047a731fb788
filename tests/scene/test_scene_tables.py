"""The tables of scene files agree with the constructors that they name."""

import math
import re

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.impact.sensitivity import UNITS
from kickdyn.scene.scene_tables import TABLES

BY_NAME = {table.name: table for table in TABLES}
LIMITED = [
    (table, key)
    for table in TABLES
    for key in table.keys
    if isinstance(key.takes, str) and key.takes.startswith("number, ")
]


def construct(table, key, value):
    """Return what a table makes of one key, beside those that it must have."""
    groups = [group for group in table.required if key.name not in group]
    content = {name: example for group in groups for name, example in [*group.items()][:1]}
    arguments = {
        other.argument: content[other.name] for other in table.keys if other.name in content
    }
    return table.constructor(**{**arguments, key.argument: value})


@pytest.mark.parametrize(("table", "key"), LIMITED, ids=lambda entry: entry.name)
def test_limits_on_the_page_are_those_of_the_constructor(table, key):
    limits = re.findall(r"(above|at least|at most) (-?[\d.e]+(?:/\d)?)", key.takes)
    assert limits
    for kind, text in limits:
        limit = 2.0 / 3.0 if text == "2/3" else float(text)
        beyond = limit + (1.0 if kind == "at most" else -1.0) * max(1e-9, 1e-9 * abs(limit))
        outside = limit if kind == "above" else beyond
        with pytest.raises(kd.InvalidInput):
            construct(table, key, outside)
        if kind != "above" and abs(limit) < 1000:  # beyond these another value may be at fault
            construct(table, key, limit)


VECTORS = [
    (table, key)
    for table in TABLES
    for key in table.keys
    if isinstance(key.takes, str) and key.takes.startswith("vector")
]


@pytest.mark.parametrize(("table", "key"), VECTORS, ids=lambda entry: entry.name)
def test_a_vector_has_three_numbers(table, key):
    check = key.check or (lambda value: construct(table, key, value))
    check([1.0, 0.0, 0.5])
    for bad in ([1.0, 0.0], [1.0, 0.0, "x"], 5.0, [1.0, 0.0, True]):
        with pytest.raises(kd.InvalidInput):
            check(bad)


def test_needed_and_required_keys_are_keys_of_their_table():
    for table in TABLES:
        names = [key.name for key in table.keys]
        assert len(set(names)) == len(names)
        assert {needed for key in table.keys for needed in key.needs} <= set(names)
        assert {name for group in table.required for name in group} <= set(names)


def test_names_that_a_key_takes_are_valid():
    for table in TABLES:
        for key in table.keys:
            if not isinstance(key.takes, str):
                for name in key.takes:
                    construct(table, key, name)


def test_the_air_of_the_paper_refuses_what_it_cannot_take():
    for argument in ("altitude", "humidity"):
        with pytest.raises(kd.InvalidInput, match=f"leave out the model, or {argument}$"):
            BY_NAME["air"].constructor(model="paper", **{argument: 0.5})
    assert BY_NAME["air"].constructor(model="paper", wind=(1, 0, 0)).density == 1.22


def test_uncertainty_is_in_the_units_of_its_sources():
    table = BY_NAME["uncertainty"]
    assert {key.argument for key in table.keys} <= set(UNITS)
    made = table.constructor(**{key.argument: 180.0 for key in table.keys})
    for key in table.keys:
        in_degrees = key.name.endswith("_deg")
        assert made[key.argument] == pytest.approx(math.pi if in_degrees else 180.0)


def test_the_base_of_a_leg_can_move():
    keys = {key.name: key.argument for key in BY_NAME["leg"].keys}
    table = BY_NAME["leg"].constructor(
        model="human",
        **{
            keys["base_velocity_m_s"]: (4, 0, 1),
            keys["base_angular_velocity_rad_s"]: (0, -2, 0),
        },
    )
    assert table.change(kd.Leg.human()).base_velocity.tolist() == [4, 0, 1, 0, -2, 0]


def test_a_scene_with_a_base_that_moves_is_one_in_another_frame(tmp_path):
    """In a vacuum; seen from the hip, the ball comes with the opposite velocity."""
    hip = np.array([3.0, 0.2, 0.5])
    scene = "\n".join([
        "[leg]", "model = 'human'", "{}", "[posture]",
        "angles_deg = {{ hip = 40, knee = 30, ankle = -20 }}",
        "joint_velocity_rad_s = {{ hip = 6.6, knee = -14.5, ankle = 6.6 }}",
        "[ball]", "velocity_m_s = {}", "spin_rad_s = [1, -20, 3]",
        "[contact]", "normal = [2, 0.2, 1]", "restitution = 0.8", "friction = 0.4",
    ])  # fmt: skip
    ball = np.array([-2.0, 0.3, 0.1])
    impacts = []
    for base, velocity in ((f"base_velocity_m_s = {hip.tolist()}", ball), ("", ball - hip)):
        file = tmp_path / f"{len(impacts)}.toml"
        file.write_text(scene.format(base, velocity.tolist()))
        impacts.append(kd.simulate(kd.load_scene(file)).impact)
    here, there = impacts
    after = there.ball_after.velocity + hip
    assert here.ball_after.velocity == pytest.approx(after, rel=1e-13, abs=1e-13)
    assert here.ball_after.spin == pytest.approx(there.ball_after.spin, rel=1e-13, abs=1e-12)
    assert here.impulse == pytest.approx(there.impulse, rel=1e-13, abs=1e-13)
    assert here.joint_impulses == pytest.approx(there.joint_impulses, rel=1e-13, abs=1e-13)
