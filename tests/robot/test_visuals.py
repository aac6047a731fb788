"""Meshes of a robot's file: read from its folder only, in bounded memory, at the right place."""

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
