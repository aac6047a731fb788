import numpy as np
import pytest
import trimesh

import kickdyn as kd
from kickdyn.view.urdf_visuals import PLAIN, urdf_visuals


def lowered(visual):
    data = {}
    visual.shape.lower_in_object(data)
    return data["geometries"][0]


def thigh(leg):
    return [visual for visual in urdf_visuals(leg.urdf) if visual.link == "thigh"]


@pytest.mark.parametrize(
    ("tag", "shape"),
    [
        ('<box size="1 2 3"/>', {"type": "BoxGeometry", "width": 1, "height": 2, "depth": 3}),
        ('<sphere radius="0.5"/>', {"type": "SphereGeometry", "radius": 0.5}),
        (
            '<cylinder radius="0.5" length="2"/>',
            {"type": "CylinderGeometry", "radiusTop": 0.5, "radiusBottom": 0.5, "height": 2},
        ),
    ],
)
def test_shapes(leg_looking_like, tag, shape):
    leg = leg_looking_like(
        f'<visual><origin xyz="1 2 3"/><geometry><!-- -->{tag}</geometry></visual>'
    )
    (visual,) = thigh(leg)
    assert lowered(visual).items() >= shape.items()
    np.testing.assert_allclose(visual.place[:3, 3], (1, 2, 3))


def test_a_cylinder_stands_along_z(leg_looking_like):
    (visual,) = thigh(
        leg_looking_like('<visual><geometry><cylinder radius="1" length="2"/></geometry></visual>')
    )
    np.testing.assert_allclose(visual.place[:3, :3] @ (0, 1, 0), (0, 0, 1), atol=1e-15)


def test_several_visuals_keep_their_order(leg_looking_like):
    one = '<visual><geometry><sphere radius="{}"/></geometry></visual>'
    found = thigh(leg_looking_like(one.format(1) + one.format(2)))
    assert [lowered(visual)["radius"] for visual in found] == [1, 2]


SPHERE = "<visual><geometry><sphere radius='1'/></geometry>{}</visual>"


@pytest.mark.parametrize(
    ("material", "rgba"),
    [
        ("", PLAIN),
        ('<material name="a"><color rgba="0.1 0.2 0.3 0.4"/></material>', (0.1, 0.2, 0.3, 0.4)),
        ('<material name="nowhere"><texture filename="/etc/passwd"/></material>', PLAIN),
    ],
)
def test_colours(leg_looking_like, material, rgba):
    (visual,) = thigh(leg_looking_like(SPHERE.format(material)))
    assert visual.rgba == pytest.approx(rgba)


def test_a_colour_is_found_by_its_name():
    visuals = urdf_visuals(kd.Leg.human().urdf)
    assert {visual.rgba for visual in visuals} == {(0.85, 0.64, 0.49, 1), (0.25, 0.27, 0.31, 1)}


def test_a_colour_named_in_another_visual(leg_looking_like):
    first = SPHERE.format('<material name="a"><color rgba="1 0 0 1"/></material>')
    found = thigh(leg_looking_like(first + SPHERE.format('<material name="a"/>')))
    assert [visual.rgba for visual in found] == [(1, 0, 0, 1)] * 2


def test_the_file_is_not_read_again(leg_looking_like, tmp_path):
    leg = leg_looking_like(SPHERE.format(""))
    (tmp_path / "leg.urdf").write_text("changed meanwhile")
    assert len(thigh(leg)) == 1


def test_a_mesh_of_the_folder(leg_looking_like, tmp_path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    mesh = '<visual><geometry><mesh filename="box.stl" scale="2 2 2"/></geometry></visual>'
    (visual,) = thigh(leg_looking_like(mesh))
    np.testing.assert_allclose(np.ptp(visual.shape.vertices, axis=0), 2)
    assert visual.rgba == PLAIN


@pytest.mark.parametrize("name", ["../box.stl", "/box.stl", "box.stl", "file:///box.stl"])
def test_a_refused_mesh_is_named(leg_looking_like, name):
    leg = leg_looking_like(f'<visual><geometry><mesh filename="{name}"/></geometry></visual>')
    with pytest.raises(kd.InvalidInput, match=f"mesh '{name}' "):
        urdf_visuals(leg.urdf)


def test_what_yourdfpy_cannot_read_is_one_line(leg_looking_like, monkeypatch):
    def fail(*_, **__):
        raise KeyError("radius")

    leg = leg_looking_like(SPHERE.format(""))
    monkeypatch.setattr("yourdfpy.URDF.load", fail)
    with pytest.raises(kd.InvalidInput, match=r"leg.urdf: its visuals cannot be read \('radius'\)"):
        urdf_visuals(leg.urdf)
