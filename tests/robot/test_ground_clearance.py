"""Depths under the ground, against shapes whose lowest points are known."""

import numpy as np
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.robot.ground_clearance import Spheres, extreme_spheres, find_depths, sphere_directions

URDF = """<robot name="arm">
<link name="base"/>
<joint name="hinge" type="revolute"><parent link="base"/><child link="body"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<link name="body"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
iyz="0"/></inertial>
<visual><origin xyz="0.1 0 -0.3" rpy="{turn} 0 0"/><geometry>{shape}</geometry></visual></link>
</robot>"""

SHAPES = {  # the lowest point below the shape's centre, upright and turned by 90 degrees about x
    '<box size="0.2 0.4 0.6"/>': (0.3, 0.2),
    '<sphere radius="0.25"/>': (0.25, 0.25),
    '<cylinder length="0.5" radius="0.1"/>': (0.25, 0.1),
    '<mesh filename="wedge.obj" scale="0.05 0.05 0.05"/>': (0.15, 0.1),
}


def arm(folder, shape, turn=0.0):
    """A hinge about y at the origin, whose body has its shape 0.3 m below and 0.1 m ahead."""
    wedge = "v 0 0 -3\nv 1 2 1\nv -1 2 1\nv 0 -2 1\nf 1 2 3\nf 1 3 4\nf 2 3 4\nf 1 2 4\n"
    (folder / "wedge.obj").write_text(wedge)
    (folder / "arm.urdf").write_text(URDF.format(shape=shape, turn=turn))
    return kd.Leg.from_urdf(folder / "arm.urdf", "body")


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turned", [0, 1])
def test_the_lowest_point_of_each_shape(tmp_path, shape, turned):
    leg = arm(tmp_path, shape, turned * np.pi / 2)
    lowest = SHAPES[shape][turned]
    depths = find_depths(leg, np.zeros(1), -0.3)
    assert depths.get("body", 0.0) == pytest.approx(lowest, abs=closed_form(10))
    assert find_depths(leg, np.zeros(1), 0.9)["body"] == pytest.approx(1.2 + lowest)
    for depth in (1.99e-3, 2.01e-3):  # soles give way by 2 mm
        assert ("body" in find_depths(leg, np.zeros(1), -0.3 - lowest + depth)) == (depth > 2e-3)


@pytest.mark.parametrize(("kind", "size", "lowest"), [
    ("capsule", "0.1 0.3", 0.4), ("ellipsoid", "0.1 0.2 0.3", 0.3), ("box", "0.1 0.2 0.3", 0.3),
])  # fmt: skip
def test_the_lowest_point_of_shapes_of_an_mjcf(tmp_path, kind, size, lowest):
    (tmp_path / "arm.xml").write_text(
        f'<mujoco><worldbody><body name="body"><joint name="j" axis="0 1 0"/><geom type="{kind}" '
        f'size="{size}" pos="0 0 -1"/></body></worldbody></mujoco>'
    )
    leg = kd.Leg.from_mjcf(tmp_path / "arm.xml", "body")
    assert find_depths(leg, np.zeros(1), -1.0) == {"body": pytest.approx(lowest, abs=closed_form())}


def test_the_deepest_body_comes_first():
    g1 = kd.Leg.from_robot("g1", legs_only=True)
    feet = find_depths(g1, g1.configuration(), -0.76)
    assert set(list(feet)[:2]) == {"left_ankle_roll_link", "right_ankle_roll_link"}
    assert list(feet.values()) == sorted(feet.values(), reverse=True)


@pytest.mark.parametrize(("mesh", "lowest"), [("wedge.obj", 0.15), ("missing.obj", 0.45)])
def test_shapes_for_contacts_count_where_a_drawn_mesh_is_missing(tmp_path, mesh, lowest):
    arm(tmp_path, f'<mesh filename="{mesh}" scale="0.05 0.05 0.05"/>')
    ball = '<collision><origin xyz="0.1 0 -0.3"/><geometry><sphere radius="0.45"/></geometry>'
    file = tmp_path / "arm.urdf"
    file.write_text(file.read_text().replace("<visual>", f"{ball}</collision><visual>"))
    depths = find_depths(kd.Leg.from_urdf(file, "body"), np.zeros(1), -0.3)
    assert depths == {"body": pytest.approx(lowest)}


@pytest.mark.parametrize(("towards", "cosine"), [
    ((0.0, 0.0, 0.0), 0.0), ((0.0, 0.0, -1.0), 0.0), ((0.0, 0.6, 0.8), 0.5)])  # fmt: skip
def test_extreme_spheres_miss_what_they_say(towards, cosine):
    """A body reaches beyond the chosen spheres by the second result, in the given directions."""
    rng = np.random.default_rng(0)
    body = Spheres(rng.normal(size=(60, 3)), rng.uniform(0.1, 0.5, 60))
    directions = sphere_directions()
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=closed_form(10))
    directions = directions[directions @ towards >= cosine]
    reach = body.centres @ directions.T + body.radii[:, None]
    misses = []
    for count in (3, 6):
        chosen, miss = extreme_spheres(body, count, towards, cosine)
        assert len(chosen) == count
        beyond = reach.max(axis=0) - reach[chosen].max(axis=0)
        assert miss == pytest.approx(beyond.max(), abs=closed_form(10))
        misses.append(miss)
    assert misses[0] > misses[1] > 0.0
    every, miss = extreme_spheres(body, 60, towards, cosine)
    assert miss < closed_form(10)
    assert len(set(every.tolist())) == len(every)
