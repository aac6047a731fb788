import json
import struct

import pytest
import trimesh

import kickdyn as kd
from kickdyn.view import mesh_file, mesh_size
from kickdyn.view.mesh_file import read_mesh


def glb(about, data=b""):
    said = json.dumps({"asset": {"version": "2.0"}, **about}).encode()
    said += b" " * (-len(said) % 4)
    chunks = struct.pack("<2I", len(said), 0x4E4F534A) + said
    if data:
        chunks += struct.pack("<2I", len(data), 0x004E4942) + data
    return struct.pack("<3I", 0x46546C67, 2, 12 + len(chunks)) + chunks


def accessor(count):
    return {"componentType": 5126, "count": count, "type": "VEC3"}


def meshes(count, use=0):
    return [{"primitives": [{"attributes": {"POSITION": use}}] * count}]


SCENE = {"scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}]}
PROMISES = {
    "accessor.glb": glb({"accessors": [accessor(30_000_000)], "meshes": meshes(1), **SCENE}),
    "less than none.glb": glb({"accessors": [accessor(-(10**9)), accessor(10**9)], **SCENE}),
    "used often.glb": glb({"accessors": [accessor(30_000)], "meshes": meshes(900), **SCENE}),
    "header.ply": b"ply\nformat ascii 1.0\nelement vertex 3000001\nproperty float x\nend_header\n",
    "corners.obj": b"v 0 0 0\nf" + b" 1 1 \\\n1" * 1_000_001 + b"\n",
    "bare.obj": b"v 0 0 0\n" * 3_000_001,
}


@pytest.mark.parametrize("name", PROMISES)
def test_what_a_file_promises_is_refused_unread(name, tmp_path, monkeypatch):
    monkeypatch.setattr(trimesh, "load_scene", None)
    (tmp_path / name).write_bytes(PROMISES[name])
    with pytest.raises(kd.InvalidInput, match=r"has \d+ vertices: at most 3000000 are read"):
        read_mesh(name, tmp_path)


@pytest.mark.parametrize("ending", mesh_size.FORMATS)
def test_every_format_is_counted(ending, tmp_path, monkeypatch):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / f"box{ending}")
    assert read_mesh(f"box{ending}", tmp_path)
    monkeypatch.setattr(mesh_size, "MAX_VERTICES", 17)
    with pytest.raises(kd.InvalidInput, match="at most 17 are read"):
        read_mesh(f"box{ending}", tmp_path)


def test_an_ascii_stl_is_counted_by_its_words(tmp_path, monkeypatch):
    box = trimesh.creation.box((1, 1, 1))
    (tmp_path / "box.stl").write_text(box.export(file_type="stl_ascii"))
    monkeypatch.setattr(mesh_size, "MAX_VERTICES", 35)
    with pytest.raises(kd.InvalidInput, match="has 36 vertices"):
        read_mesh("box.stl", tmp_path)


def test_copies_count(tmp_path, monkeypatch):
    scene = trimesh.Scene(trimesh.creation.box((1, 1, 1)))
    for k in range(9):
        scene.add_geometry(trimesh.creation.box((1, 1, 1)), geom_name="same", node_name=str(k))
    scene.export(tmp_path / "boxes.glb")
    assert len(read_mesh("boxes.glb", tmp_path)) == 10
    monkeypatch.setattr(mesh_file, "MAX_VERTICES", 79)
    with pytest.raises(kd.InvalidInput, match="has 80 vertices"):
        read_mesh("boxes.glb", tmp_path)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.glb", glb({"accessors": [accessor(3)], "meshes": meshes(1001), **SCENE})),
        ("b.glb", glb({"nodes": [{"children": list(range(1, 1001))}]})),
        ("c.obj", b"".join(b"usemtl %d\nf 1 1 1\n" % k for k in range(1001))),
    ],
)
def test_many_parts_are_refused(name, content, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(kd.InvalidInput, match="has 1001 parts: at most 1000 are read"):
        read_mesh(name, tmp_path)


def test_copies_of_a_buffer_are_refused(tmp_path):
    views = [{"buffer": 0, "byteLength": 10_000_000}] * 6
    (tmp_path / "a.glb").write_bytes(glb({"bufferViews": views, **SCENE}))
    with pytest.raises(kd.InvalidInput, match="60000000 bytes: at most 50000000"):
        read_mesh("a.glb", tmp_path)


def collada(edit):
    text = trimesh.creation.box((1, 1, 1)).export(file_type="dae").decode()
    changed = edit(text)
    assert changed != text
    return changed


def doubled(text, levels=40):
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


def test_nodes_that_stand_for_others_are_counted(tmp_path):
    (tmp_path / "few.dae").write_text(collada(lambda text: doubled(text, 3)))
    assert len(read_mesh("few.dae", tmp_path)) == 8
    (tmp_path / "many.dae").write_text(collada(doubled))
    with pytest.raises(kd.InvalidInput, match=r"has \d+ vertices: at most"):
        read_mesh("many.dae", tmp_path)


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (lambda text: text.replace("<COLLADA", '<!DOCTYPE a [<!ENTITY b "1 ">]><COLLADA', 1),
         "has a DOCTYPE: entities are not expanded, remove it"),
        (lambda text: doubled(text, 3).replace('url="#n0"', 'url="#n3"'), "recursion"),
        (lambda text: text.encode("utf-16").decode("latin-1"), "not well-formed"),
    ],
)  # fmt: skip
def test_collada_files_that_are_refused(edit, reason, tmp_path):
    (tmp_path / "a.dae").write_bytes(collada(edit).encode())
    with pytest.raises(kd.InvalidInput, match=rf"'a\.dae' cannot be read \(.*{reason}"):
        read_mesh("a.dae", tmp_path)
