"""MJCF files that are refused before MuJoCo sees them, and files that are read with them."""

import pickle

import numpy as np
import pytest
import trimesh

import kickdyn as kd
from kickdyn.robot.mjcf_file import read_mjcf
from kickdyn.robot.robot_file import Shape

BODY = '<body name="arm"><joint name="j" axis="0 1 0"/><geom size="0.1"/></body>'
MODEL = f"<mujoco><worldbody>{BODY}</worldbody></mujoco>"


def write(folder, **texts):
    """Write files by their names; return the path of the first."""
    paths = []
    for name, text in texts.items():
        paths.append(folder / f"{name}.xml")
        paths[-1].write_text(text)
    return paths[0]


def box(folder, name="box.stl", size=(0.2, 0.4, 0.6)):
    path = folder / name
    path.parent.mkdir(exist_ok=True, parents=True)
    trimesh.creation.box(size).export(path)
    return path


BAD = {
    "empty": ("", "is empty"), "a URDF": ('<robot name="r"/>', "Leg.from_urdf"),
    "composite": (MODEL.replace("</w", "<composite/></w"), "<composite>"),
    "plugins": (MODEL.replace("<geom", "<plugin/><geom"), "<plugin>"),
    "universe": (MODEL.replace('"arm"', '"universe"'), "body name 'universe'"),
    "line end": (MODEL.replace('"arm"', '"a&#10;b"'), r"body name 'a\\nb' .*printable"),
    "99 copies of 99 of 99": (
        MODEL.replace(BODY, 3 * '<replicate count="99">' + BODY + 3 * "</replicate>"),
        "[0-9]+ elements",
    ),
    "nan": (MODEL.replace('"0.1"', '"nan"'), "MuJoCo refuses"),
    "far away": (MODEL.replace('"arm"', '"arm" pos="1e101 0 0"'), "'arm' has a mass, moment"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_with_one_line(tmp_path, name):
    text, said = BAD[name]
    with pytest.raises(kd.MjcfError, match=f"^[^\n]{{,600}}{said}[^\n]{{,400}}$"):
        kd.Leg.from_mjcf(write(tmp_path, robot=text), "arm")


@pytest.mark.parametrize(("name", "said"), [
    ("none.xml", "'none.xml' is missing"), ("", "'', which: is not a regular file"),
    ("robot.xml", "'robot.xml' twice"), ("other.xml", "'other.xml' twice"),  # it includes itself
    ("../secret.xml", "refused: it lies outside"), ("link.xml", "'link.xml' is refused"),
    ("m0.xml", "deeper than 64"),  # which includes m1.xml, and so on
])  # fmt: skip
def test_a_file_that_cannot_be_included_is_named(tmp_path, name, said):
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "secret.xml").write_text("<mujoco/>")
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")

    def including(file):
        return f'<mujoco><include file="{file}"/></mujoco>'

    file = write(
        folder, robot=including(name), other=including("other.xml"), empty="",
        **{f"m{k}": including(f"m{k + 1}.xml") for k in range(70)},
    )  # fmt: skip
    with pytest.raises(kd.MjcfError, match=f"^[^\n]*{said}[^\n]*$"):
        kd.Leg.from_mjcf(file, "arm")


def test_an_included_file_stands_where_it_is_included(tmp_path):
    joint = '<joint name="{}" type="slide" axis="{}"/>'
    include, last = '<include file="more.xml"/>', joint.format("d", "0 1 0")
    body = BODY.replace("<geom", f"{include}{last}<geom")
    more = joint.format("b", "1 0 0") + joint.format("c", "0 0 1")
    file = write(
        tmp_path, robot=f"<mujoco><worldbody>{body}</worldbody></mujoco>",
        more=f"<mujoco>{more}</mujoco>",
    )  # fmt: skip
    assert kd.Leg.from_mjcf(file, "arm").joint_names == ("j", "b", "c", "d")


def test_no_other_file_is_named_to_mujoco(tmp_path):
    """Textures, height fields, skins and models are not passed on; a mesh is, by a number."""
    box(tmp_path, "meshes/box.STL")
    asset = (
        '<texture name="t" type="2d" file="/etc/passwd"/><hfield name="h" file="/etc/passwd"/>'
        '<skin file="/etc/passwd"/><model name="m" file="/etc/passwd"/>'
        '<material name="paint" texture="t" rgba="1 0 0 1"/>'
        '<mesh name="box" file="box.STL" content_type="image/png"/>'
    )
    body = BODY.replace("<geom", '<geom type="mesh" mesh="box" material="paint"/><geom')
    file = write(
        tmp_path,
        robot=f'<mujoco><compiler meshdir="meshes" texturedir="/etc"/><asset>{asset}</asset>'
        f'<worldbody><geom type="hfield" hfield="h"/>{body}</worldbody></mujoco>',
    )
    read = read_mjcf(file)
    assert list(read.meshes) == ["0.stl"]
    assert "passwd" not in read.text
    assert "dir=" not in read.text
    leg = kd.Leg.from_mjcf(file, "arm")
    assert leg.file.visuals()[0].rgba == (1, 0, 0, 1)
    assert leg.model.inertias[1].mass == pytest.approx(1000 * (0.048 + 4e-3 / 3 * np.pi))


MESH = (
    '<mujoco><compiler {}/><asset><mesh {}/></asset><worldbody><body name="arm"><joint/>'
    '<geom type="mesh" mesh="box"/></body></worldbody></mujoco>'
)


@pytest.mark.parametrize(("compiler", "mesh", "name"), [
    ("", 'file="box.stl"', "box.stl"), ("", 'name="box" file="a/b/box.stl"', "a/b/box.stl"),
    ('meshdir="a/b"', 'file="box.stl"', "a/b/box.stl"),
    ('assetdir="c" meshdir="a/b/"', 'file="box.stl"', "a/b/box.stl"),
    ('strippath="true"', 'file="c/d/box.stl"', "box.stl"),
    ("", 'file="a\\b\\box.stl"', "a/b/box.stl")])  # fmt: skip
def test_a_mesh_is_where_mujoco_looks_for_it(tmp_path, compiler, mesh, name):
    box(tmp_path, name)
    leg = kd.Leg.from_mjcf(write(tmp_path, robot=MESH.format(compiler, mesh)), "arm")
    assert leg.model.inertias[1].mass == pytest.approx(48.0)  # 1000 kg/m3


@pytest.mark.parametrize(("compiler", "name"), [
    ("", "box.stl"), ("", "b/box.stl"), ('meshdir="b"', "box.stl"),
    ('strippath="true"', "c/box.stl")])  # fmt: skip
def test_meshes_and_included_files_may_lie_in_named_folders(tmp_path, compiler, name):
    """Where neither is, the folder that was searched is named, and the option."""
    text = MESH.format(compiler, f'file="{name}"')
    file = write(tmp_path, robot=text.replace("<asset>", '<include file="d.xml"/><asset>'))
    far, told = tmp_path / "far", []
    for make in (
        lambda: (far / "d.xml").write_text("<mujoco><option/></mujoco>"),
        lambda: box(far, "box.stl" if compiler else name),
    ):
        with pytest.raises(kd.MjcfError, match="--package-dir") as error:
            kd.Leg.from_mjcf(file, "arm", package_dirs=[far] if far.exists() else [])
        told.append(str(error.value))
        far.mkdir(exist_ok=True)
        make()
    assert f"missing from {tmp_path}" in told[0]
    assert f"missing from {tmp_path / 'b' if 'meshdir' in compiler else tmp_path};" in told[1]
    file.write_text(file.read_text().replace('meshdir="b"', 'meshdir="../b"'))
    leg = kd.Leg.from_mjcf(file, "arm", package_dirs=[far])
    assert leg.model.inertias[1].mass == pytest.approx(48.0)


GEOMS = """<mujoco><option><flag sensornoise="enable"/></option>
<asset><mesh name="box" file="box.stl" scale="2 2 2"/><mesh name="flat" file="flat.stl"/></asset>
<worldbody><geom type="plane" size="1 1 1"/><body name="object"><freejoint/><geom size="1"/></body>
<body name="arm" pos="0 0 1"><joint name="j" axis="0 1 0" ref="90"/>
<geom type="sphere" size="0.1" pos="1 0 0"/>
<geom type="capsule" size="0.1" fromto="0 0 0 0 1 0"/>
<geom type="cylinder" size="0.1 0.3" rgba="1 0 0 0.5"/>
<geom type="box" size="0.1 0.2 0.3" euler="0 0 90" group="2"/>
<geom type="ellipsoid" size="0.1 0.2 0.3"/>
<geom type="mesh" mesh="flat"/>
<geom type="mesh" mesh="box" pos="1 0 0"/>
<geom type="sphere" size="5" group="3"/>
<geom type="sphere" size="6" rgba="1 1 1 0"/>
</body></worldbody></mujoco>"""


def test_geoms_are_drawn(tmp_path):
    """Those of MuJoCo's first three groups that are not transparent, with full lengths."""
    box(tmp_path)
    box(tmp_path, "flat.stl", (0.3, 0.3, 0.1))
    leg = kd.Leg.from_mjcf(write(tmp_path, robot=GEOMS), "arm")
    leg = pickle.loads(pickle.dumps(leg))
    meshes = [visual for visual in leg.file.visuals() if visual.shape == Shape.MESH]
    solids = [trimesh.Trimesh(mesh.vertices, mesh.faces) for mesh in meshes]
    assert [solid.volume for solid in solids] == pytest.approx([0.3 * 0.3 * 0.1, 0.4 * 0.8 * 1.2])
    shapes = {visual.shape: visual for visual in leg.file.visuals() if visual.frame == "arm"}
    sizes = {shape: visual.size for shape, visual in shapes.items()}
    assert sizes == {
        Shape.SPHERE: (0.1,), Shape.CAPSULE: pytest.approx((1.0, 0.1)), Shape.MESH: (1.0,),
        Shape.CYLINDER: (0.6, 0.1), Shape.BOX: (0.2, 0.4, 0.6), Shape.ELLIPSOID: (0.1, 0.2, 0.3),
    }  # fmt: skip
    kinds = [shape.size for shape in leg.file.collisions() if shape.shape == Shape.SPHERE]
    assert kinds == [(1.0,), (0.1,), (5.0,)]
    assert shapes[Shape.SPHERE].pose[:3, 3] == pytest.approx([1, 0, 0])
    assert abs(shapes[Shape.CAPSULE].pose[:3, 2]) == pytest.approx([0, 1, 0])
    assert shapes[Shape.CAPSULE].pose[:3, 3] == pytest.approx([0, 0.5, 0])
    assert shapes[Shape.CYLINDER].rgba == (1, 0, 0, 0.5)
    assert shapes[Shape.BOX].pose[:3, 0] == pytest.approx([0, 1, 0])
    mesh = shapes[Shape.MESH]
    corners = mesh.vertices @ mesh.pose[:3, :3].T + mesh.pose[:3, 3]
    assert corners.min(axis=0) == pytest.approx([0.8, -0.4, -0.6])
    assert corners.max(axis=0) == pytest.approx([1.2, 0.4, 0.6])


def test_geoms_for_contacts_are_those_of_masks_and_of_hidden_groups(tmp_path):
    """Masks may be those of a class; settings that kickdyn uses in their place mean nothing."""
    geoms = (
        ("", True), ('class="v"', False), ('class="v" contype="2"', True),
        ('contype="0" conaffinity="0" priority="5" solmix="3"', False),
        ('contype="0"', True), ('class="v" group="3"', True),
    )  # fmt: skip
    bodies = "".join(f'<geom size="{k + 1}" {what}/>' for k, (what, _) in enumerate(geoms))
    text = (
        '<mujoco><default><default class="v"><geom contype="0" conaffinity="0"/></default>'
        f'</default><worldbody><body name="arm"><joint axis="0 1 0"/>{bodies}</body></worldbody>'
        "</mujoco>"
    )
    leg = kd.Leg.from_mjcf(write(tmp_path, robot=text), "arm")
    found = [shape.size[0] for shape in leg.file.collisions()]
    assert found == [k + 1 for k, (_, collides) in enumerate(geoms) if collides]
    with pytest.raises(kd.KickdynError, match="a geom of contype 'two': it is an integer"):
        kd.Leg.from_mjcf(write(tmp_path, robot=text.replace('"2"', '"two"')), "arm")


@pytest.mark.parametrize(("actuators", "passive"), [
    ('<motor joint="b"/>', ("a",)), ('<motor joint="a"/><motor jointinparent="b"/>', ()),
    ("", ()),  # a file without actuators says nothing about them
    ('<motor tendon="t"/>', ()), ('<plugin joint="b" plugin="mujoco.pid"/>', ("a",)),
])  # fmt: skip
def test_joints_that_no_actuator_drives_are_passive(tmp_path, actuators, passive):
    body = '<body name="{0}"><joint name="{0}" type="slide"/><geom size="0.1" pos="0 0 {1}"/>'
    tendon = '<tendon><fixed name="t"><joint joint="a" coef="1"/></fixed></tendon>'
    file = write(
        tmp_path,
        robot=f"<mujoco><worldbody>{body.format('a', 0)}{body.format('b', 1)}</body></body>"
        f"</worldbody>{tendon}<actuator>{actuators}</actuator></mujoco>",
    )
    assert kd.Leg.from_mjcf(file, "b").file.passive_joints == passive
