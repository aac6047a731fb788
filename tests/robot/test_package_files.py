import os

import pytest

import kickdyn as kd
from kickdyn.robot.package_files import PackageFiles, parse_xml

MANIFEST = "<?xml version='1.0'?><package format='3'><name>{}</name></package>"


def package(folder, name, *files):
    """Make a ROS package with files in it."""
    for file in files:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).touch()
    (folder / "package.xml").write_text(MANIFEST.format(name))
    return folder


@pytest.fixture(autouse=True)
def no_ros(monkeypatch):
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def robot(tmp_path):
    """A package in a folder of another name, as repositories are, and a secret beside it."""
    (tmp_path / "secret.stl").touch()
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
def test_names_in_the_own_package(robot, name, file):
    found = PackageFiles(robot / "urdf").find(name.format(robot=robot))
    assert found == robot / file


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
@pytest.mark.parametrize("named", [False, True])
def test_what_lies_outside_is_refused(robot, tmp_path, name, named):
    """Also if the package itself is named in package_dirs."""
    (robot / "urdf/link.stl").symlink_to(tmp_path / "secret.stl")
    (robot / "urdf/out").symlink_to(tmp_path)
    finder = PackageFiles(robot / "urdf", [robot] if named else [])
    with pytest.raises(kd.InvalidInput, match=r"lies outside|is missing") as caught:
        finder.find(name.format(top=tmp_path))
    assert repr(name.format(top=tmp_path)) in str(caught.value)


@pytest.mark.parametrize(
    "name", ["http://x/a.stl", "file://meshes/a.stl", "ftp://a.stl", "javascript://a.stl", "://a"]
)
def test_addresses_are_refused(robot, name):
    with pytest.raises(kd.InvalidInput, match="no addresses"):
        PackageFiles(robot / "urdf").find(name)


def test_an_unknown_package_says_what_to_do(robot):
    with pytest.raises(kd.InvalidInput) as caught:
        PackageFiles(robot / "urdf").find("package://hand_description/meshes/hand.stl")
    assert str(caught.value) == (
        "mesh 'package://hand_description/meshes/hand.stl' is missing: package 'hand_description' "
        "is unknown; name the package's folder, or the folder that contains it under that name, in "
        "package_dirs= or --package-dir, or in the environment variable ROS_PACKAGE_PATH"
    )


def test_the_folder_that_a_refusal_asks_for_makes_the_mesh_readable(tmp_path):
    for folder in ("urdf", "meshes"):
        (tmp_path / folder).mkdir()
    (tmp_path / "meshes/a.stl").touch()
    with pytest.raises(kd.InvalidInput, match=r"urdf, the folder or .* or --package-dir names"):
        PackageFiles(tmp_path / "urdf").find("../meshes/a.stl")
    finder = PackageFiles(tmp_path / "urdf", [tmp_path / "meshes"])
    assert finder.find("../meshes/a.stl") == tmp_path / "meshes/a.stl"


@pytest.mark.parametrize(
    ("name", "given"), [("hand", "hand"), ("repo", "repo"), ("hand", "."), ("hand", "../ws")]
)
def test_package_dirs_are_packages_or_contain_them(tmp_path, robot, name, given):
    """By the name in the manifest or by that of the folder; folders in them, by their names."""
    hand = package(tmp_path / "ws" / name, "hand", "meshes/hand.stl")
    (tmp_path / "x").mkdir()
    folder = tmp_path / "x/../ws" if given == "../ws" else tmp_path / "ws" / given
    finder = PackageFiles(robot / "urdf", [tmp_path / "x", folder])
    found = hand / "meshes/hand.stl"
    assert finder.find("package://hand/meshes/hand.stl") == found
    # a file that is named by its path, too
    assert finder.find(f"file://{found}") == found
    assert finder.find(f"../../{name}/meshes/hand.stl") == found


def test_a_folder_of_the_name_needs_no_manifest_in_package_dirs(tmp_path, robot):
    (tmp_path / "share/hand/meshes").mkdir(parents=True)
    (tmp_path / "share/hand/meshes/hand.stl").touch()
    for folder in ("share", "share/hand"):
        finder = PackageFiles(robot / "urdf", [tmp_path / folder])
        found = finder.find("package://hand/meshes/hand.stl")
        assert found == tmp_path / "share/hand/meshes/hand.stl"


def test_a_package_from_pip_has_the_name_of_its_folder(tmp_path):
    """It has no manifest; no more than the four folders from the file's own on are tried."""
    share = tmp_path / "share"
    for name in ("iCub/robots/v2/model.urdf", "iCub/meshes/hip.stl", "secret.stl"):
        (share / name).parent.mkdir(parents=True, exist_ok=True)
        (share / name).touch()
    files = PackageFiles(share / "iCub" / "robots" / "v2")
    assert files.find("package://iCub/meshes/hip.stl") == share / "iCub/meshes/hip.stl"
    with pytest.raises(kd.InvalidInput, match="is refused: it lies outside"):
        files.find("package://iCub/../secret.stl")
    deep = PackageFiles(share / "iCub/robots/v2/a/b")
    with pytest.raises(kd.InvalidInput, match="package 'iCub' is unknown"):
        deep.find("package://iCub/meshes/hip.stl")


def test_packages_of_the_environment(tmp_path, robot, monkeypatch):
    one = package(tmp_path / "ros1/stack/one", "one", "one.stl")
    two = package(tmp_path / "ros2/share/two", "two", "two.stl")
    gone = tmp_path / "gone"
    monkeypatch.setenv(
        "ROS_PACKAGE_PATH", os.pathsep.join(["", "relative", str(gone), str(one.parent)])
    )
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{gone}{os.pathsep}{tmp_path / 'ros2'}")
    monkeypatch.chdir(tmp_path)
    package(tmp_path / "relative/three", "three", "three.stl")
    finder = PackageFiles(robot / "urdf")
    with pytest.raises(kd.InvalidInput, match="package 'three' is unknown"):
        finder.find("package://three/three.stl")  # it would depend on the working directory
    assert finder.find("package://one/one.stl") == one / "one.stl"
    assert finder.find("package://two/two.stl") == two / "two.stl"
    assert finder.find(f"file://{two}/two.stl") == two / "two.stl"


def test_the_first_of_several_packages_is_taken(tmp_path, robot, monkeypatch):
    """package_dirs, then the own package, then the environment."""
    for name in ("named", "installed"):
        package(tmp_path / name / "robot_description", "robot_description", "a.stl")
    (robot / "a.stl").touch()
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "installed"))
    mesh = "package://robot_description/a.stl"
    named = PackageFiles(robot / "urdf", [tmp_path / "named"]).find(mesh)
    assert named == tmp_path / "named/robot_description/a.stl"
    assert PackageFiles(robot / "urdf").find(mesh) == robot / "a.stl"
    assert PackageFiles(tmp_path).find(mesh) == tmp_path / "installed/robot_description/a.stl"


def test_a_package_that_is_a_link_to_elsewhere_is_none(tmp_path, robot):
    """Or an unpacked archive could make all of the disk a package."""
    (tmp_path / "archive").mkdir()
    (tmp_path / "archive/evil").symlink_to(tmp_path)
    package(tmp_path / "real", "real_package", "a.stl")
    (tmp_path / "archive/alias").symlink_to(tmp_path / "real")
    finder = PackageFiles(tmp_path / "archive", [tmp_path / "archive"])
    with pytest.raises(kd.InvalidInput, match="lies outside"):
        finder.find("package://evil/secret.stl")
    for name in ("alias", "real_package"):
        with pytest.raises(kd.InvalidInput, match=r"lies outside|is unknown"):
            finder.find(f"package://{name}/a.stl")


@pytest.mark.parametrize(
    "manifest", ["", "<package>", "<robot><name>robot</name></robot>", "\0", "<package/>"]
)
def test_a_file_that_is_no_manifest_makes_no_package(tmp_path, manifest):
    """Its folder is a package by its own name only, and no path leaves the file's folder."""
    (tmp_path / "robot/urdf").mkdir(parents=True)
    (tmp_path / "robot/package.xml").write_text(manifest)
    (tmp_path / "robot/a.stl").touch()
    finder = PackageFiles(tmp_path / "robot/urdf")
    assert finder.find("package://robot/a.stl") == tmp_path / "robot/a.stl"
    if manifest == "<package/>":
        return
    for name in ("package://urdf2/a.stl", "../a.stl"):
        with pytest.raises(kd.InvalidInput, match=r"is unknown|lies outside"):
            finder.find(name)


def test_a_name_that_no_folder_can_have(tmp_path, robot):
    with pytest.raises(kd.InvalidInput, match=r"is unknown|cannot be found"):
        PackageFiles(robot / "urdf", [tmp_path]).find(f"package://{'x' * 5000}/a.stl")


def test_text_and_attributes_are_read():
    root = parse_xml("<?xml version='1.0'?><!-- note --><a b='1'><c>text</c></a>")
    assert (root.tag, root.attrib, root.findtext("c")) == ("a", {"b": "1"}, "text")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (" ", "is empty"),
        ("<a>", "is not well-formed XML"),
        ("<!DOCTYPE html><html/>", "is an HTML page"),
        ("<!DOCTYPE a><a/>", "has a DOCTYPE: entities are not expanded, remove it"),
        ("<a>" * 65 + "</a>" * 65, "nests tags deeper than 64"),
    ],
)
def test_what_is_refused(text, reason):
    with pytest.raises(ValueError, match=reason):
        parse_xml(text)
