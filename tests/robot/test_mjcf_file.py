"""Files that are refused with one line, before MuJoCo sees them, and those that are read."""

import os
import pickle

import numpy as np
import pytest
import trimesh

import kickdyn as kd
from kickdyn.robot import package_files
from kickdyn.robot.mjcf_file import is_mjcf, read_mjcf
from kickdyn.robot.visuals import Shape

BODY = '<body name="arm"><joint name="j" axis="0 1 0"/><geom size="0.1"/></body>'
MODEL = f"<mujoco><worldbody>{BODY}</worldbody></mujoco>"


def write(folder, **texts):
    """Write files by their names; return the path of the first."""
    paths = []
    for name, text in texts.items():
        path = folder / f"{name}.xml"
        path.write_text(text)
        paths.append(path)
    return paths[0]


def box(folder, name="box.stl", size=(0.2, 0.4, 0.6)):
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    trimesh.creation.box(size).export(path)
    return path


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("mujoco", "is not well-formed XML"),
        ("<mujoco>", "is not well-formed XML"),
        ("<html></html>", "is not an MJCF file: its root is <html>, not <mujoco>"),
        ("<!DOCTYPE html><html/>", "is an HTML page"),
        ('<!DOCTYPE m [<!ENTITY a "b">]><mujoco/>', "has a DOCTYPE"),
        ('<robot name="r"/>', "is a URDF, its root is <robot>: Leg.from_urdf reads it"),
        ("<mujoco/>", "MuJoCo cannot read it|frame 'arm' is unknown"),
        (70 * "<mujoco>" + 70 * "</mujoco>", "nests tags deeper than 64"),
        (MODEL.replace("</w", "<composite/></w"), "has <composite>: composite bodies are not"),
        (MODEL.replace("</w", "<flexcomp/></w"), "has <flexcomp>: flexible bodies are not read"),
        (MODEL.replace("</w", '<attach model="a"/></w'), "has <attach>: models attached"),
        (MODEL.replace("<w", "<extension/><w"), "has <extension>: plugins are not read"),
        (MODEL.replace('"arm"', '"universe"'), "body name 'universe' is reserved by Pinocchio"),
        (MODEL.replace('"arm"', '"a&#10;b"'), r"body name 'a\\nb' is not a printable name"),
        (MODEL.replace('"arm"', f'"{201 * "a"}"'), "is not a printable name of at most 200"),
        (
            MODEL.replace(BODY, 251 * BODY.replace('name="arm"', "").replace('name="j"', "")),
            "has 251 joints: at most 250 are read",
        ),
        (
            MODEL.replace(BODY, f'<replicate count="99999">{BODY}</replicate>'),
            "has [0-9]+ elements, copies of <replicate> included: at most 100000",
        ),
        (
            MODEL.replace(BODY, 3 * '<replicate count="99">' + BODY + 3 * "</replicate>"),
            "has [0-9]+ elements",
        ),
        (MODEL.replace('"0.1"', '"nan"'), "MuJoCo cannot read it"),
        (MODEL.replace('"0.1"', '"-1"'), "MuJoCo cannot read it"),
        (MODEL.replace('"0.1"', '"1e80"'), "body 'arm' has a mass, moment or position"),
        (MODEL.replace('"arm"', '"arm" pos="1e200 0 0"'), "body 'arm' has a mass, moment or pos"),
        (MODEL.replace('"0 1 0"', '"0 0 0"'), "MuJoCo cannot read it"),
        (MODEL.replace("<geom", '<inertial pos="0 0 0" mass="-1"/><geom'), "MuJoCo cannot read"),
        (MODEL.replace('<geom size="0.1"/>', ""), "MuJoCo cannot read it: mass and inertia"),
    ],
)
def test_a_bad_file_is_refused_with_one_line(tmp_path, text, said):
    file = write(tmp_path, robot=text)
    with pytest.raises(kd.InvalidInput, match=said) as refusal:
        kd.Leg.from_mjcf(file, "arm")
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 600


@pytest.mark.parametrize(
    ("path", "said"),
    [
        (3, "MJCF path is 3: it must be a str or a Path"),
        (None, "MJCF path is None"),
        ("no/such.xml", "no/such.xml: there is no such file"),
        ("a\0b", "cannot be read"),
        (os.devnull, "is not a regular file"),
    ],
)
def test_a_path_that_is_no_file(path, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_mjcf(path, "arm")


def test_each_reader_names_the_other(tmp_path):
    with pytest.raises(kd.UrdfError, match=r"is an MJCF, its root is <mujoco>: Leg.from_mjcf"):
        kd.Leg.from_urdf(write(tmp_path, robot=MODEL))
    assert is_mjcf(write(tmp_path, robot=MODEL))
    assert is_mjcf(write(tmp_path, robot="<mujoco"))  # by its ending
    assert is_mjcf(tmp_path / "none.xml")
    assert not is_mjcf(write(tmp_path, robot="<robot/>"))
    assert not is_mjcf(tmp_path / "none.urdf")


def test_included_files_stand_where_they_are_named(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "hand.xml").write_text(
        '<mujocoinclude><geom size="0.2"/><joint name="j"/></mujocoinclude>'
    )
    (tmp_path / "defaults.xml").write_text(
        '<mujoco><default><joint armature="3"/></default></mujoco>'
    )
    body = '<body name="arm"><include file="parts/hand.xml"/></body>'
    file = write(
        tmp_path,
        robot=f'<mujoco><include file="defaults.xml"/><worldbody>{body}</worldbody></mujoco>',
    )
    assert kd.Leg.from_mjcf(file, "arm").model.armature.tolist() == [3.0]


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        ('<include file="none.xml"/>', "robot.xml: included file 'none.xml' is missing"),
        ("<include/>", "includes '', which: is not a regular file"),
        ('<include file="robot.xml"/>', "includes 'robot.xml' twice"),
        ('<include file="other.xml"/>', "includes 'other.xml' twice"),  # which includes itself
        (
            '<include file="../secret.xml"/>',
            r"is refused: it lies outside .*model, the folder or ROS package of",
        ),
        ('<include file="/etc/passwd"/>', "'/etc/passwd' is refused: it lies outside"),
        ('<include file="link.xml"/>', "'link.xml' is refused: it lies outside"),
        ('<include file="file:///a.xml"/>', "'file:///a.xml' is refused: it lies outside"),
        ('<include file="."/>', "includes '.', which: is not a regular file"),
        ('<include file="a&#10;"/>', "is missing"),
        ('<include file="empty.xml"/>', "robot.xml includes 'empty.xml', which: is empty"),
    ],
)
def test_a_file_that_cannot_be_included(tmp_path, inner, said):
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "secret.xml").write_text("<mujoco/>")
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")
    file = write(
        folder,
        robot=f"<mujoco>{inner}</mujoco>",
        other='<mujoco><include file="other.xml"/></mujoco>',
        empty="",
    )
    with pytest.raises(kd.MjcfError, match=said) as refusal:
        kd.Leg.from_mjcf(file, "arm")
    assert "\n" not in str(refusal.value)


def test_a_chain_of_includes_ends(tmp_path):
    for k in range(70):
        write(tmp_path, **{f"m{k}": f'<mujoco><include file="m{k + 1}.xml"/></mujoco>'})
    with pytest.raises(kd.MjcfError, match="nests tags deeper than 64, included files among"):
        kd.Leg.from_mjcf(tmp_path / "m0.xml", "arm")


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
    '<geom type="mesh" mesh="box"/>{}</body></worldbody></mujoco>'
)


@pytest.mark.parametrize(
    ("compiler", "mesh", "name"),
    [
        ("", 'file="box.stl"', "box.stl"),
        ("", 'name="box" file="a/b/box.stl"', "a/b/box.stl"),
        ('meshdir="a/b"', 'file="box.stl"', "a/b/box.stl"),
        ('assetdir="a/b"', 'file="box.stl"', "a/b/box.stl"),
        ('assetdir="c" meshdir="a/b/"', 'file="box.stl"', "a/b/box.stl"),
        ('strippath="true"', 'file="c/d/box.stl"', "box.stl"),
        ("", 'file="a\\b\\box.stl"', "a/b/box.stl"),
        ("", 'file="box.obj"', "box.obj"),
    ],
)
def test_a_mesh_is_found(tmp_path, compiler, mesh, name):
    (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    box(tmp_path, name)
    leg = kd.Leg.from_mjcf(write(tmp_path, robot=MESH.format(compiler, mesh, "")), "arm")
    assert leg.model.inertias[1].mass == pytest.approx(48.0)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("../box.stl", "mesh '../box.stl' is refused: it lies outside"),
        ("/etc/passwd.stl", "is refused: it lies outside"),
        ("http://a/box.stl", "is refused: only files are read, no addresses"),
        ("box.png", "has no known extension: .stl, .obj, .msh are read"),
        ("folder.stl", "is not a regular file"),
        ("big.stl", "has 51 bytes: at most 50 are read"),
        ("none.stl", "mesh 'none.stl' is missing from "),
        ("text.stl", "MuJoCo cannot read it"),
    ],
)
def test_a_mesh_that_is_refused(tmp_path, name, said, monkeypatch):
    monkeypatch.setattr(package_files, "MAX_MESH", 50)
    (tmp_path / "folder.stl").mkdir()
    (tmp_path / "big.stl").write_text(51 * "a")
    (tmp_path / "text.stl").write_text("solid")
    file = write(tmp_path, robot=MESH.format("", f'name="box" file="{name}"', ""))
    with pytest.raises(kd.MjcfError, match=said) as refusal:
        kd.Leg.from_mjcf(file, "arm")
    assert "\n" not in str(refusal.value)


def test_a_ros_package_is_read_as_a_whole(tmp_path):
    """Meshes may be beside the folder of the model in its package, as URDF files have them."""
    (tmp_path / "mjcf").mkdir()
    box(tmp_path, "meshes/box.stl")
    text = MESH.format('meshdir="../meshes"', 'file="box.stl"', "")
    file = write(tmp_path / "mjcf", robot=text)
    with pytest.raises(kd.MjcfError, match=r"outside .*mjcf, the folder or ROS package of the"):
        kd.Leg.from_mjcf(file, "arm")
    (tmp_path / "package.xml").write_text("<package><name>robot</name></package>")
    assert kd.Leg.from_mjcf(file, "arm").model.inertias[1].mass == pytest.approx(48.0)
    (tmp_path / "package.xml").unlink()
    assert len(read_mjcf(file, [tmp_path]).meshes) == 1


GEOMS = """<mujoco><asset><mesh name="box" file="box.stl" scale="2 2 2"/></asset>
<worldbody><geom type="plane" size="1 1 1"/><body name="object"><freejoint/><geom size="1"/></body>
<body name="arm" pos="0 0 1"><joint name="j" axis="0 1 0" ref="90"/>
<geom type="sphere" size="0.1" pos="1 0 0"/>
<geom type="capsule" size="0.1" fromto="0 0 0 0 1 0"/>
<geom type="cylinder" size="0.1 0.3" rgba="1 0 0 0.5"/>
<geom type="box" size="0.1 0.2 0.3" euler="0 0 90" group="2"/>
<geom type="ellipsoid" size="0.1 0.2 0.3"/>
<geom type="mesh" mesh="box" pos="1 0 0"/>
<geom type="sphere" size="5" group="3"/>
<geom type="sphere" size="6" rgba="1 1 1 0"/>
</body></worldbody></mujoco>"""


def test_geoms_are_drawn(tmp_path):
    """Those of MuJoCo's first three groups, of the robot only; a plane is the ground's affair."""
    box(tmp_path)
    leg = kd.Leg.from_mjcf(write(tmp_path, robot=GEOMS), "arm")
    found = [visual for visual in leg.file.visuals() if visual.frame == "arm"]
    assert [visual.shape for visual in found] == [
        *(Shape.SPHERE, Shape.CAPSULE, Shape.CYLINDER, Shape.BOX, Shape.ELLIPSOID, Shape.MESH)
    ]
    assert found[1].size == pytest.approx((1.0, 0.1))
    assert [shape.size for shape in leg.file.collisions()] == [(5.0,)]
    assert abs(found[1].pose[:3, 2]) == pytest.approx([0, 1, 0])
    assert found[1].pose[:3, 3] == pytest.approx([0, 0.5, 0])
    assert found[2].size == (0.6, 0.1)
    assert found[2].rgba == (1, 0, 0, 0.5)
    assert found[3].size == (0.2, 0.4, 0.6)
    assert found[3].pose[:3, 0] == pytest.approx([0, 1, 0])
    assert found[4].size == (0.1, 0.2, 0.3)
    corners = found[5].vertices @ found[5].pose[:3, :3].T + found[5].pose[:3, 3]
    assert corners.min(axis=0) == pytest.approx([0.8, -0.4, -0.6])
    assert corners.max(axis=0) == pytest.approx([1.2, 0.4, 0.6])


def test_a_model_can_be_pickled(tmp_path):
    box(tmp_path)
    leg = kd.Leg.from_mjcf(write(tmp_path, robot=GEOMS), "arm")
    again = pickle.loads(pickle.dumps(leg))
    assert len(again.file.visuals()) == len(leg.file.visuals())


@pytest.mark.parametrize(
    ("actuators", "passive"),
    [
        ('<motor joint="b"/>', ("a",)),
        ('<motor joint="a"/><motor jointinparent="b"/>', ()),
        ("", ()),  # a file without actuators says nothing about them
        ('<motor tendon="t"/>', ()),
    ],
)
def test_joints_that_no_actuator_drives(tmp_path, actuators, passive):
    body = '<body name="{0}"><joint name="{0}" type="slide"/><geom size="0.1" pos="0 0 {1}"/>'
    tendon = '<tendon><fixed name="t"><joint joint="a" coef="1"/></fixed></tendon>'
    file = tmp_path / "robot.xml"
    file.write_text(
        f"<mujoco><worldbody>{body.format('a', 0)}{body.format('b', 1)}</body></body></worldbody>"
        f"{tendon}<actuator>{actuators}</actuator></mujoco>"
    )
    assert kd.Leg.from_mjcf(file, "b").file.passive_joints == passive


@pytest.mark.parametrize("key", ["mujoco model", "body name"])
def test_a_name_that_does_not_print_is_refused(tmp_path, key):
    name = {key: "a&#10;b"}
    text = (
        f'<mujoco model="{name.get("mujoco model", "leg")}"><worldbody>'
        f'<body name="{name.get("body name", "foot")}"><joint/><geom size="0.1"/></body>'
        "</worldbody></mujoco>"
    )
    (tmp_path / "leg.xml").write_text(text)
    with pytest.raises(kd.MjcfError, match=key):
        kd.Leg.from_mjcf(tmp_path / "leg.xml", "foot")
