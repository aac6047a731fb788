"""Files that a robot's file names: found in its package and in folders that the user names only."""

import os

import pytest

import kickdyn as kd
from kickdyn.robot.package_files import PackageFiles, parse_xml

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
    return package(
        tmp_path / "ws" / "robot_repo",
        "robot_description",
        *("urdf/robot.urdf", "urdf/beside.stl", "meshes/a b.stl", "meshes/visual/hip.stl"),
    )


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("beside.stl", "urdf/beside.stl"),
        ("../meshes/a b.stl", "meshes/a b.stl"),
        ("package://robot_description/meshes/visual/hip.stl", "meshes/visual/hip.stl"),
        ("package:///robot_description//meshes/a b.stl", "meshes/a b.stl"),
        ("package://robot_repo/meshes/a b.stl", "meshes/a b.stl"),
        ("model://robot_description/meshes/a b.stl", "meshes/a b.stl"),
        ("package://robot_description/urdf/../meshes/a b.stl", "meshes/a b.stl"),
        ("file://{robot}/meshes/a%20b.stl", "meshes/a b.stl"),
        ("{robot}/meshes/a b.stl", "meshes/a b.stl"),
    ],
)
def test_names_in_the_robots_package(robot, name, file):
    path = PackageFiles(robot / "urdf").find(name.format(robot=robot))
    assert path == robot / file


@pytest.mark.parametrize(
    "name",
    [
        "../../../secret.stl",
        "package://robot_description/../../secret.stl",
        "package://robot_description//{top}/secret.stl/../../secret.stl",
        "file://{top}/secret.stl",
        "{top}/secret.stl",
        "link.stl",
        "package://robot_description/urdf/link.stl",
        "package://robot_description/urdf/out/secret.stl",
        "package://../secret.stl",
        "package://./../../../secret.stl",
    ],
)
@pytest.mark.parametrize("is_named", [False, True])
def test_files_outside_are_refused(robot, tmp_path, name, is_named):
    """Also if the package itself is named in package_dirs."""
    (robot / "urdf/link.stl").symlink_to(tmp_path / "secret.stl")
    (robot / "urdf/out").symlink_to(tmp_path)
    files, name = PackageFiles(robot / "urdf", [robot] * is_named), name.format(top=tmp_path)
    with pytest.raises(kd.InvalidInput, match=r"lies outside|is missing") as refusal:
        files.find(name)
    assert repr(name) in str(refusal.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        *((f"{scheme}://a.stl", "no addresses") for scheme in ("http", "ftp", "javascript", "")),
        ("file://meshes/a.stl", "no addresses"),
        ("package://hand/hand.stl", "'hand' is unknown; .*--package-dir.*ROS_PACKAGE_PATH"),
        (f"package://{'x' * 5000}/a.stl", "is unknown|cannot be found"),
        ("a\0b.stl", "cannot be found"),
    ],
)
def test_names_of_no_file_are_refused(robot, name, said):
    with pytest.raises(kd.InvalidInput, match=said):
        PackageFiles(robot / "urdf").find(name)


def test_the_folder_that_a_refusal_asks_for_makes_the_mesh_readable(tmp_path):
    touch(tmp_path, "urdf/a.urdf", "meshes/a.stl")
    with pytest.raises(kd.InvalidInput, match="package_dirs= or --package-dir"):
        PackageFiles(tmp_path / "urdf").find("../meshes/a.stl")
    files = PackageFiles(tmp_path / "urdf", [tmp_path / "meshes"])
    assert files.find("../meshes/a.stl") == tmp_path / "meshes/a.stl"


@pytest.mark.parametrize(
    ("name", "folder"),
    [("hand", "hand"), ("repo", "repo"), ("hand", "."), ("hand", "../ws"), ("hand", "x/../.")],
)
def test_package_dirs_are_packages_or_contain_them(tmp_path, robot, name, folder):
    """By the name in the manifest or by that of the folder; folders in them, by their names."""
    hand = package(tmp_path / "ws" / name, "hand", "meshes/hand.stl")
    (tmp_path / "ws" / "x").mkdir()
    files = PackageFiles(robot / "urdf", [tmp_path / "ws/x", tmp_path / "ws" / folder])
    file = hand / "meshes/hand.stl"
    for mesh in ("package://hand/meshes/hand.stl", f"file://{file}",
                 f"../../{name}/meshes/hand.stl"):  # fmt: skip
        assert files.find(mesh) == file


@pytest.mark.parametrize("folder", ["share", "share/hand"])
def test_a_folder_of_the_name_needs_no_manifest_in_package_dirs(tmp_path, robot, folder):
    touch(tmp_path, "share/hand/meshes/hand.stl")
    files = PackageFiles(robot / "urdf", [tmp_path / folder])
    path = files.find("package://hand/meshes/hand.stl")
    assert path == tmp_path / "share/hand/meshes/hand.stl"


def test_a_package_from_pip_has_the_name_of_its_folder(tmp_path):
    """It has no manifest; no more than the four folders from the file's own on are tried."""
    share = touch(
        tmp_path / "share", "iCub/robots/v2/model.urdf", "iCub/meshes/hip.stl", "secret.stl"
    )
    files = PackageFiles(share / "iCub/robots/v2")
    assert files.find("package://iCub/meshes/hip.stl") == share / "iCub/meshes/hip.stl"
    with pytest.raises(kd.InvalidInput, match="lies outside"):
        files.find("package://iCub/../secret.stl")
    with pytest.raises(kd.InvalidInput, match="'iCub' is unknown"):
        PackageFiles(share / "iCub/robots/v2/a/b").find("package://iCub/meshes/hip.stl")


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


def test_package_dirs_come_before_the_robots_package_and_the_environment(
    tmp_path, robot, monkeypatch
):
    for name in ("named", "installed"):
        package(tmp_path / name / "robot_description", "robot_description", "a.stl")
    (robot / "a.stl").touch()
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "installed"))
    mesh = "package://robot_description/a.stl"
    for files, folder in (
        (PackageFiles(robot / "urdf", [tmp_path / "named"]), tmp_path / "named/robot_description"),
        (PackageFiles(robot / "urdf"), robot),
        (PackageFiles(tmp_path), tmp_path / "installed/robot_description"),
    ):
        assert files.find(mesh) == folder / "a.stl"


@pytest.mark.parametrize("name", ["evil/secret.stl", "alias/a.stl", "real_package/a.stl"])
def test_a_package_that_is_a_link_to_elsewhere_is_none(tmp_path, robot, name):
    """Or an unpacked archive could make all of the disk a package."""
    archive = tmp_path / "archive"
    archive.mkdir()
    (archive / "evil").symlink_to(tmp_path)
    (archive / "alias").symlink_to(package(tmp_path / "real", "real_package", "a.stl"))
    with pytest.raises(kd.InvalidInput, match=r"lies outside|is unknown"):
        PackageFiles(archive, [archive]).find(f"package://{name}")


@pytest.mark.parametrize("manifest", ["", "<package>", "<robot><name>robot</name></robot>", "\0"])
def test_a_file_that_is_no_manifest_makes_no_package(tmp_path, manifest):
    """Its folder is a package by its own name only, and no path leaves the file's folder."""
    touch(tmp_path / "robot", "urdf/a.urdf", "package.xml", "a.stl")
    (tmp_path / "robot/package.xml").write_text(manifest)
    files = PackageFiles(tmp_path / "robot/urdf")
    assert files.find("package://robot/a.stl") == tmp_path / "robot/a.stl"
    for name in ("package://urdf2/a.stl", "../a.stl"):
        with pytest.raises(kd.InvalidInput, match=r"is unknown|lies outside"):
            files.find(name)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (" ", "empty"),
        ("<a>", "not well-formed XML"),
        ("<!DOCTYPE html><html/>", "HTML page"),
        ("<!DOCTYPE a><a/>", "DOCTYPE"),
        ("<a>" * 65 + "</a>" * 65, "deeper than 64"),
    ],
)
def test_documents_that_are_refused(text, reason):
    with pytest.raises(ValueError, match=reason):
        parse_xml(text)
