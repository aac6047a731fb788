"""Files that a robot's file names: found in its package and in folders that the user names only."""

import os

import pytest

import kickdyn as kd
from kickdyn.robot.robot_file import PackageFiles

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
