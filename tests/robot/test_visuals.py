import io
import logging
import os
import re
import subprocess
import sys
import zipfile
from contextlib import contextmanager

import numpy as np
import pytest
import trimesh

import kickdyn as kd
from kickdyn.robot import visuals
from kickdyn.robot.package_files import PackageFiles
from kickdyn.robot.visuals import FORMATS, read_mesh

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
    """A robot's folder with a box in it, and one beside it that is none of its business."""
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    robot = tmp_path / "robot"
    (robot / "meshes").mkdir(parents=True)
    for place in (robot / "meshes" / "box.stl", robot / "box.obj", tmp_path / "secret.stl"):
        box.export(place)
    (robot / "link.stl").symlink_to(tmp_path / "secret.stl")
    (robot / "alias.stl").symlink_to(robot / "meshes" / "box.stl")
    (robot / "elsewhere").symlink_to(tmp_path)
    (robot / "loop.stl").symlink_to(robot / "loop.stl")
    (robot / "junk.stl").write_bytes(b"junk")
    (robot / "junk.dae").write_bytes(b"junk")
    (robot / "empty.stl").touch()
    (robot / "box.urdf").touch()
    (robot / "folder.stl").mkdir()
    os.mkfifo(robot / "pipe.stl")
    return robot


@pytest.mark.parametrize(
    "name",
    [
        "meshes/box.stl",
        "meshes/../box.obj",
        "alias.stl",
        "package://meshes/box.stl",
        "package://robot/meshes/box.stl",
    ],
)
def test_meshes_of_the_folder_are_read(folder, name):
    (mesh,) = read(name, folder)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), (0.1, 0.2, 0.3), rtol=1e-6)
    assert mesh.faces.shape == (12, 3)
    assert mesh.rgba is None


def test_an_absolute_path_inside_is_read(folder):
    assert read(str(folder / "meshes" / "box.stl"), folder)


@pytest.mark.parametrize(
    "name",
    [
        "../secret.stl",
        "meshes/../../secret.stl",
        "link.stl",
        "elsewhere/secret.stl",
        "package://../secret.stl",
        "package://robot/../secret.stl",
        "package://robot/../../secret.stl",
        "{outside}/secret.stl",
        "package://robot/elsewhere/secret.stl",
    ],
)
def test_meshes_outside_are_refused(folder, name, watch):
    name = name.format(outside=folder.parent)
    with (
        watch() as opened,
        pytest.raises(kd.InvalidInput, match="lies outside") as caught,
    ):
        read(name, folder)
    assert repr(name) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not [path for path in opened if "secret" in path]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("file:///etc/passwd", "lies outside"),
        ("file://meshes/box.stl", "no addresses"),
        ("http://example.org/box.stl", "no addresses"),
        ("missing.stl", "is missing"),
        ("package://missing.stl", "is missing"),
        ("package://", "is missing"),
        ("loop.stl", "is missing|cannot be found"),
        ("a\0b.stl", "cannot be found"),
        ("junk.stl", "cannot be read|no triangles"),
        ("junk.dae", "cannot be read"),
        ("empty.stl", "no triangles"),
        ("box.urdf", "no known extension"),
        ("folder.stl", "not a regular file"),
        ("pipe.stl", "not a regular file"),
    ],
)
def test_bad_meshes_are_named(folder, name, reason):
    with pytest.raises(kd.InvalidInput, match=reason) as caught:
        read(name, folder)
    assert repr(name) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_huge_mesh_is_refused(folder, monkeypatch):
    monkeypatch.setattr("kickdyn.robot.package_files.MAX_MESH", 100)
    with pytest.raises(kd.InvalidInput, match="at most 100 are read"):
        read("meshes/box.stl", folder)


def test_a_mesh_of_a_gigabyte_is_refused_by_its_size(folder):
    with (folder / "huge.stl").open("wb") as file:
        file.truncate(10**9)
    with pytest.raises(
        kd.InvalidInput, match=r"'huge\.stl': has 1000000000 bytes: at most 100000000"
    ):
        read("huge.stl", folder)


@pytest.mark.parametrize(("scale", "size"), [(2.0, (0.2, 0.4, 0.6)), ((1, -1, 10), (0.1, 0.2, 3))])
def test_scale(folder, scale, size):
    (mesh,) = read("meshes/box.stl", folder, scale)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), size, rtol=1e-6)


@pytest.mark.parametrize("scale", [(1, 2), float("nan"), (1, 1, float("inf")), "abc", 10**400, {}])
def test_bad_scale(folder, scale):
    with pytest.raises(kd.InvalidInput, match="scale"):
        read("meshes/box.stl", folder, scale)


def test_each_part_keeps_its_colour_and_place(folder):
    boxes = [trimesh.creation.box((1, 1, 1)) for _ in range(2)]
    for box, colour in zip(boxes, ((255, 0, 0, 255), (0, 0, 255, 255)), strict=True):
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=colour)
        box.visual = trimesh.visual.TextureVisuals(material=material)
    text = trimesh.exchange.dae.export_collada(boxes).decode()
    node = '<node id="node1" name="node1">'
    assert node in text
    (folder / "two.dae").write_text(text.replace(node, f"{node}<translate>5 0 0</translate>"))
    first, second = sorted(read("two.dae", folder), key=lambda mesh: mesh.vertices[0, 0])
    np.testing.assert_allclose(first.rgba, (1, 0, 0, 1))
    np.testing.assert_allclose(second.rgba, (0, 0, 1, 1))
    np.testing.assert_allclose(second.vertices.mean(axis=0), (5, 0, 0), atol=1e-6)


def test_what_is_passed_over_is_passed_over_silently(folder, monkeypatch, capsys):
    text = trimesh.creation.box((1, 1, 1)).export(file_type="ply", encoding="ascii").decode()
    named = text.replace("end_header", "comment TextureFile secret.png\nend_header", 1)
    (folder / "textured.ply").write_text(named)
    monkeypatch.setattr(logging.root, "handlers", [])  # as without pytest
    assert read("textured.ply", folder)
    assert capsys.readouterr().err == ""


def test_what_a_mesh_names_is_not_opened(folder, watch):
    # Not even in the folder: trimesh keeps to that by itself, but textures are not wanted at all.
    (folder / "secret.mtl").write_text("newmtl a\nKd 1 0 0\nmap_Kd secret.png\n")
    (folder / "secret.png").write_bytes(b"secret")
    text = trimesh.creation.box((1, 1, 1)).export(file_type="dae").decode()
    for old, new in (
        ("<library_effects>", '<library_images><image id="i"><init_from>secret.png</init_from>'
         "</image></library_images><library_effects>"),
        ("<technique", '<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface>'
         '</newparam><newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>'
         "<technique"),
        ("<diffuse>", '<diffuse><texture texture="t" texcoord="UV"/></diffuse><ignored>'),
        ("</diffuse>\n", "</ignored>"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "textured.dae").write_text(text)
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n"
    (folder / "textured.obj").write_text(f"mtllib secret.mtl\n{corners}usemtl a\nf 1/1 2/1 3/1\n")
    for name in ("textured.dae", "textured.obj"):
        with watch() as opened:
            assert read(name, folder)
        assert any(name in path for path in opened)
        assert not [path for path in opened if "secret" in path]


@pytest.mark.parametrize(
    ("up", "size"),
    [("X_UP", (0.2, 0.3, 0.1)), ("Y_UP", (0.1, 0.3, 0.2)), ("Z_UP", (0.1, 0.2, 0.3))],
)
def test_a_collada_file_is_turned_z_up(folder, up, size):
    """What it calls up is z, and its other axes follow right-handed."""
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    box.apply_translation([0.5, 0.6, 0.7])
    text = box.export(file_type="dae").decode()
    (folder / "up.dae").write_text(re.sub(r"<up_axis>\w+", f"<up_axis>{up}", text))
    assert f"<up_axis>{up}" in (folder / "up.dae").read_text()
    (part,) = read("up.dae", folder)
    assert np.ptp(part.vertices, axis=0) == pytest.approx(size)
    middle = (part.vertices.max(axis=0) + part.vertices.min(axis=0)) / 2
    expected = {"X_UP": (-0.6, -0.7, 0.5), "Y_UP": (0.5, -0.7, 0.6), "Z_UP": (0.5, 0.6, 0.7)}[up]
    assert middle == pytest.approx(expected)


def test_a_surface_is_drawn_without_the_picture_that_it_names(folder):
    """Pictures that are missing would take the whole mesh with them."""
    text = trimesh.creation.box((1, 1, 1)).export(file_type="dae").decode()
    picture = '<diffuse><texture texture="t" texcoord="UV"/></diffuse>'
    edited = re.sub(r"<diffuse>.*?</diffuse>", picture, text, count=1, flags=re.DOTALL)
    missing = (
        '<newparam sid="s"><surface type="2D"><init_from>gone</init_from></surface></newparam>'
        '<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam><technique'
    )
    (folder / "textured.dae").write_text(edited.replace("<technique", missing, 1))
    assert edited != text
    (part,) = read("textured.dae", folder)
    np.testing.assert_allclose(part.rgba, (0.4, 0.4, 0.4, 1))


@pytest.mark.parametrize("ending", FORMATS)
def test_every_format_is_read(ending, folder):
    trimesh.creation.box((1, 1, 1)).export(folder / f"cube{ending}")
    assert sum(len(part.faces) for part in read(f"cube{ending}", folder)) == 12


PROMISES = {
    "vertices.ply": b"ply\nformat ascii 1.0\nelement vertex 2000000000\nproperty float x\n"
    b"property float y\nproperty float z\nend_header\n",
    "faces.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
    b"property float y\nproperty float z\nelement face 2000000000\n"
    b"property list uchar int vertex_indices\nend_header\n" + bytes(49),
    "triangles.stl": bytes(80) + b"\xff\xff\xff\xff" + bytes(50),
    "corners.obj": b"v 0 0 0\nf" + b" 1 1 \\\n1" * 1_000_001 + b"\n",
    "bare.obj": b"v 0 0 0\n" * 3_000_001 + b"f 1 2 3\n",
}


@pytest.mark.parametrize("name", PROMISES)
def test_a_file_that_promises_a_lot_takes_no_more_memory_than_it_has(name, tmp_path):
    """A process with two gigabytes refuses it."""
    (tmp_path / name).write_bytes(PROMISES[name])
    code = f"""
import resource, pathlib
from kickdyn.robot.visuals import read_mesh
from kickdyn.robot.package_files import PackageFiles
finder = PackageFiles(pathlib.Path({str(tmp_path)!r}))
resource.setrlimit(resource.RLIMIT_AS, (2 * 10**9, 2 * 10**9))
try:
    print(sum(len(part.faces) for part in read_mesh(finder, {name!r}, 1.0)))
except ValueError as error:
    print(error)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert f"mesh {name!r} " in ended.stdout or ended.stdout == "1\n"
    assert "allocate" not in ended.stdout


def test_too_many_triangles_are_refused(folder, monkeypatch):
    monkeypatch.setattr(visuals, "MAX_VERTICES", 19)
    with pytest.raises(kd.InvalidInput, match="more than 19 vertices and triangles"):
        read("meshes/box.stl", folder)


def collada(edit):
    text = trimesh.creation.box((1, 1, 1)).export(file_type="dae").decode()
    changed = edit(text)
    assert changed != text
    return changed


def doubled(text, levels):
    """Let nodes stand for twice the one before, `levels` times."""
    start = text.index("<node ")
    end = text.rindex("</node>") + len("</node>")
    nodes = text[start:end].replace('id="node0"', 'id="n0"')
    for k in range(levels):
        twice = f'<instance_node url="#n{k}"/>' * 2
        nodes += f'<node id="n{k + 1}">{twice}</node>'
    library = f"<library_nodes>{nodes}</library_nodes>"
    shown = f'<node id="all"><instance_node url="#n{levels}"/></node>'
    before = text.index("<library_visual_scenes")
    return text[:before] + library + text[before:start] + shown + text[end:]


def test_nodes_may_stand_for_others(folder):
    (folder / "few.dae").write_text(collada(lambda text: doubled(text, 3)))
    assert len(read("few.dae", folder)) == 8


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_zip_is_not_unpacked(encoding, folder):
    """Not even where the same bytes are XML: what was checked is what is read."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as file:
        file.writestr("manifest.xml", "<dae_root>b.dae</dae_root>")
        file.writestr("b.dae", collada(lambda text: doubled(text, 2)))
    for content in (
        packed.getvalue(),
        collada(lambda text: f"{text}<!--").encode(encoding) + packed.getvalue(),
    ):
        assert zipfile.is_zipfile(io.BytesIO(content))
        (folder / "a.dae").write_bytes(content)
        with pytest.raises(kd.InvalidInput, match=r"'a\.dae' cannot be read \(is not well-formed"):
            read("a.dae", folder)


def test_only_what_was_checked_reaches_the_reader_of_scenes(folder, monkeypatch):
    """It is written anew, without comments and in ASCII, so that it can be no zip as well."""
    text = collada(lambda text: text.replace("<asset>", "<!--PK--><asset><title>\u4b50</title>"))
    (folder / "a.dae").write_text(text, encoding="utf-8")
    seen, load = [], trimesh.load_scene
    monkeypatch.setattr(
        trimesh, "load_scene", lambda file, **kw: seen.append(file.getvalue()) or load(file, **kw)
    )
    assert read("a.dae", folder)
    assert b"<!--" not in seen[0]
    assert seen[0].isascii()
    assert b"&#19280;" in seen[0]


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (lambda text: text.replace("<COLLADA", '<!DOCTYPE a [<!ENTITY b "1 ">]><COLLADA', 1),
         "has a DOCTYPE: entities are not expanded, remove it"),
        (lambda text: doubled(text, 3).replace('url="#n0"', 'url="#n3"'), ""),
    ],
)  # fmt: skip
def test_collada_files_that_are_refused(edit, reason, folder):
    (folder / "a.dae").write_bytes(collada(edit).encode())
    with pytest.raises(kd.InvalidInput, match=rf"'a\.dae' cannot be read \(.*{reason}"):
        read("a.dae", folder)
