"""Files that a robot names, and their meshes: read from allowed folders only, in bounded memory."""

import io
import os
import re
import sys
import zipfile
from contextlib import contextmanager

import numpy as np
import pytest
import trimesh

import kickdyn as kd
from kickdyn.robot.robot_file import PackageFiles, read_mesh

MANIFEST = "<?xml version='1.0'?><package format='3'><name>{}</name></package>"


def touch(folder, *files):
    for file in files:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).touch()
    return folder


def package(folder, name, *files):
    """Make a ROS package with files in it."""
    touch(folder, *files, "package.xml")
    (folder / "package.xml").write_text(MANIFEST.format(name))
    return folder


@pytest.fixture(autouse=True)
def no_ros(monkeypatch):
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def robot(tmp_path):
    """A package in a folder of another name, as repositories are, and a secret beside it."""
    touch(tmp_path, "secret.stl")
    files = "urdf/robot.urdf", "urdf/beside.stl", "meshes/a b.stl", "meshes/visual/hip.stl"
    return package(tmp_path / "ws" / "robot_repo", "robot_description", *files)


@pytest.mark.parametrize(("name", "file"), [
    ("beside.stl", "urdf/beside.stl"), ("../meshes/a b.stl", "meshes/a b.stl"),
    ("package://robot_description/meshes/visual/hip.stl", "meshes/visual/hip.stl"),
    ("package://robot_description/urdf/../meshes/a b.stl", "meshes/a b.stl"),
    ("file://{robot}/meshes/a%20b.stl", "meshes/a b.stl"),
    ("{robot}/meshes/a b.stl", "meshes/a b.stl")])  # fmt: skip
def test_names_in_the_robots_package(robot, name, file):
    path = PackageFiles(robot / "urdf").find(name.format(robot=robot))
    assert path == robot / file


def test_meshes_beside_the_folder_of_a_robot_without_a_package(tmp_path):
    files = PackageFiles(touch(tmp_path, "urdf/robot.urdf", "meshes/a.stl", "b.stl") / "urdf")
    assert files.find("../meshes/a.stl") == tmp_path / "meshes/a.stl"
    for name, what in (("../b.stl", "mesh"), ("../../a.stl", "mesh"), ("../meshes/a.stl", "file")):
        with pytest.raises(kd.InvalidInput, match="lies outside"):
            files.find(name, what)


@pytest.mark.parametrize("name", [
    "../../../secret.stl", "package://robot_description/../../secret.stl", "{top}/secret.stl",
    "link.stl", "out/secret.stl"])  # fmt: skip
@pytest.mark.parametrize("is_named", [False, True])
def test_files_outside_are_refused(robot, tmp_path, name, is_named):
    """Also if the package itself is named in package_dirs."""
    (robot / "urdf/link.stl").symlink_to(tmp_path / "secret.stl")
    (robot / "urdf/out").symlink_to(tmp_path)
    files, name = PackageFiles(robot / "urdf", [robot] * is_named), name.format(top=tmp_path)
    with pytest.raises(kd.InvalidInput, match=r"lies outside|is missing") as refusal:
        files.find(name)
    assert repr(name) in str(refusal.value)


@pytest.mark.parametrize(("name", "said"), [
    *((f"{scheme}://a.stl", "no addresses") for scheme in ("http", "ftp", "javascript", "")),
    ("file://meshes/a.stl", "no addresses"),
    ("package://hand/hand.stl", "'hand' is unknown; .*--package-dir.*ROS_PACKAGE_PATH"),
    (f"package://{'x' * 5000}/a.stl", "is unknown|cannot be found"), ("a\0b.stl", "cannot be found")
])  # fmt: skip
def test_names_of_no_file_are_refused(robot, name, said):
    with pytest.raises(kd.InvalidInput, match=said):
        PackageFiles(robot / "urdf").find(name)


@pytest.mark.parametrize(("name", "folder"), [
    ("hand", "hand"), ("repo", "repo"), ("hand", "."), ("hand", "../ws"), ("hand", "x/../.")
])  # fmt: skip
def test_package_dirs_are_packages_or_contain_them(tmp_path, robot, name, folder):
    """By the name in the manifest or by that of the folder; folders in them, by their names."""
    hand = package(tmp_path / "ws" / name, "hand", "meshes/hand.stl")
    (tmp_path / "ws" / "x").mkdir()
    files = PackageFiles(robot / "urdf", [tmp_path / "ws/x", tmp_path / "ws" / folder])
    file = hand / "meshes/hand.stl"
    for mesh in ("package://hand/meshes/hand.stl", f"file://{file}",
                 f"../../{name}/meshes/hand.stl"):  # fmt: skip
        assert files.find(mesh) == file


def test_packages_of_the_environment(tmp_path, robot, monkeypatch):
    one = package(tmp_path / "ros1/stack/one", "one", "one.stl")
    two = package(tmp_path / "ros2/share/two", "two", "two.stl")
    package(tmp_path / "relative/three", "three", "three.stl")
    gone = str(tmp_path / "gone")
    ros_1 = os.pathsep.join(["", "relative", gone, str(one.parent)])
    monkeypatch.setenv("ROS_PACKAGE_PATH", ros_1)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{gone}{os.pathsep}{tmp_path / 'ros2'}")
    monkeypatch.chdir(tmp_path)
    files = PackageFiles(robot / "urdf")
    with pytest.raises(kd.InvalidInput, match="'three' is unknown"):
        files.find("package://three/three.stl")  # it would depend on the working directory
    assert files.find("package://one/one.stl") == one / "one.stl"
    assert files.find("package://two/two.stl") == two / "two.stl"
    assert files.find(f"file://{two}/two.stl") == two / "two.stl"


BOX = (0.1, 0.2, 0.3)
watching: list[list[str]] = []


def read(name, folder, scale=1.0):
    return read_mesh(PackageFiles(folder), name, scale)


def hook(event, args):
    if event == "open" and watching:
        watching[-1].append(str(args[0]))


@pytest.fixture(scope="module")
def watch():
    """Note which files are opened inside a `with` block."""
    sys.addaudithook(hook)  # for good, hence the list that is mostly empty

    @contextmanager
    def watched():
        watching.append([])
        yield watching[-1]
        watching.pop()

    return watched


@pytest.fixture
def folder(tmp_path):
    """A robot's folder with a box in it, and files that are none."""
    robot = tmp_path / "robot"
    (robot / "meshes").mkdir(parents=True)
    for place in (robot / "meshes" / "box.stl", robot / "box.obj"):
        trimesh.creation.box(BOX).export(place)
    (robot / "alias.stl").symlink_to(robot / "meshes" / "box.stl")
    (robot / "empty.stl").touch()
    os.mkfifo(robot / "pipe.stl")
    with (robot / "huge.stl").open("wb") as file:
        file.truncate(10**9)
    return robot


@pytest.mark.parametrize("name", [
    "meshes/box.stl", "meshes/../box.obj", "alias.stl", "package://meshes/box.stl",
    "package://robot/meshes/box.stl", "{folder}/meshes/box.stl"])  # fmt: skip
def test_meshes_of_the_folder_are_read(folder, name):
    (mesh,) = read(name.format(folder=folder), folder, (1, -1, 10))
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.1, 0.2, 3.0])  # scaled
    assert mesh.faces.shape == (12, 3)
    assert mesh.rgba is None


@pytest.mark.parametrize(("name", "reason"), [
    ("http://example.org/box.stl", "no addresses"), ("empty.stl", "no triangles"),
    ("pipe.stl", "not a regular file"), ("huge.stl", "1000000000 bytes: at most 100000000")
])  # fmt: skip
def test_bad_meshes_are_named(folder, name, reason):
    with pytest.raises(kd.InvalidInput, match=f"^[^\n]*{re.escape(name)}[^\n]*({reason})"):
        read(name, folder)


def test_each_part_keeps_its_colour_and_place(folder):
    boxes = [trimesh.creation.box((1, 1, 1)) for _ in range(2)]
    for box, colour in zip(boxes, ((255, 0, 0, 255), (0, 0, 255, 255)), strict=True):
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=colour)
        box.visual = trimesh.visual.TextureVisuals(material=material)
    text = trimesh.exchange.dae.export_collada(boxes).decode()
    node = '<node id="node1" name="node1">'
    assert node in text
    (folder / "two.dae").write_text(text.replace(node, f"{node}<translate>5 0 0</translate>"))
    one, other = sorted(read("two.dae", folder), key=lambda mesh: mesh.vertices[0, 0])
    assert one.rgba == pytest.approx([1, 0, 0, 1])
    assert other.rgba == pytest.approx([0, 0, 1, 1])
    assert other.vertices.mean(axis=0) == pytest.approx([5, 0, 0], abs=1e-6)  # digits of the file


@pytest.mark.parametrize(("up", "size", "middle"), [
    ("X_UP", (0.2, 0.3, 0.1), (-0.6, -0.7, 0.5)), ("Y_UP", (0.1, 0.3, 0.2), (0.5, -0.7, 0.6)),
    ("Z_UP", (0.1, 0.2, 0.3), (0.5, 0.6, 0.7))])  # fmt: skip
def test_a_collada_file_is_turned_z_up(folder, up, size, middle):
    """Its axis up becomes z, and its other axes follow right-handed."""
    box = trimesh.creation.box(BOX)
    box.apply_translation([0.5, 0.6, 0.7])
    text = box.export(file_type="dae").decode()
    (folder / "up.dae").write_text(re.sub(r"<up_axis>\w+", f"<up_axis>{up}", text))
    (surface,) = read("up.dae", folder, (1, 2, 4))  # along the axes of the robot
    assert np.ptp(surface.vertices, axis=0) == pytest.approx(np.multiply(size, (1, 2, 4)))
    ends = surface.vertices.max(axis=0) + surface.vertices.min(axis=0)
    assert ends / 2 == pytest.approx(np.multiply(middle, (1, 2, 4)))


def collada():
    return trimesh.creation.box((1, 1, 1)).export(file_type="dae").decode()


PICTURE = '<diffuse><texture texture="t" texcoord="UV"/></diffuse>'
PARAMETERS = (
    '<newparam sid="s"><surface type="2D"><init_from>{}</init_from></surface></newparam>'
    '<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam><technique'
)
IMAGES = '<library_images><image id="i"><init_from>secret.png</init_from></image></library_images>'


@pytest.mark.parametrize("image", ["i", "gone"])
def test_a_surface_is_grey_without_the_picture_that_it_names(folder, watch, image):
    """A picture that is missing would take the whole mesh with it; others are not opened."""
    (folder / "secret.png").write_bytes(b"secret")
    text = re.sub(r"<diffuse>.*?</diffuse>", PICTURE, collada(), count=1, flags=re.DOTALL)
    text = text.replace("<library_effects>", IMAGES + "<library_effects>", 1)
    (folder / "a.dae").write_text(text.replace("<technique", PARAMETERS.format(image), 1))
    with watch() as opened:
        (surface,) = read("a.dae", folder)
    assert surface.rgba == pytest.approx([0.4, 0.4, 0.4, 1])
    assert any("a.dae" in path for path in opened)
    assert not [path for path in opened if "secret" in path]


def zipped():
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as file:
        file.writestr("manifest.xml", "<dae_root>b.dae</dae_root>")
        file.writestr("b.dae", collada())
    return packed.getvalue()


@pytest.mark.parametrize("content", [
    zipped(),
    f"{collada()}<!--".encode() + zipped(),  # not unpacked where it is XML as well
    collada().replace("<COLLADA", '<!DOCTYPE a [<!ENTITY b "1 ">]><COLLADA', 1).encode(),
], ids=["zip", "XML and zip", "entities"])  # fmt: skip
def test_collada_files_that_are_refused(content, folder):
    (folder / "a.dae").write_bytes(content)
    with pytest.raises(kd.InvalidInput, match=r"'a\.dae' cannot be read"):
        read("a.dae", folder)
