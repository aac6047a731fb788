"""A recorded scene as animated glTF, which slides, Blender and viewers of 3-D models open."""

import json
import struct
from typing import Any

import numpy as np
import trimesh
import umsgpack
from scipy.spatial.transform import Rotation

from kickdyn.core.validation import Array
from kickdyn.view.document import Recorder

ROOT = "/meshcat/"

NUMBER_TYPES = {0x16: np.uint32, 0x17: np.float32}
"""Types of meshcat's packed arrays, by the code of their extension."""

SEGMENTS = 32

Y_UP: Array = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""From axes with z up to the axes of glTF, whose y is up."""

Z_TO_Y: Array = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
"""A rotation that turns the axis z to y."""


TARGETS = {".position": "translation", ".quaternion": "rotation", ".scale": "scale"}
"""What meshcat's tracks move, by its name in glTF."""

FLOAT = 5126
"""Type of 32-bit floats in glTF."""


def to_glb(recorder: Recorder) -> bytes:
    """Return the drawing of a recorder as binary glTF, with its animation.

    Bodies, arrows, curves and the ground are meshes with colours, in metres; labels, light and
    shadows are left out. Each path of the recorder is a node with the path as its name, `/` as `_`.
    Before the animation plays, the nodes stand as they were drawn.
    """
    poses: dict[str, Array] = {}
    drawn: dict[str, dict[str, Any]] = {}
    clips: dict[str, dict[str, Any]] = {}
    for packed in recorder.commands:
        command = umsgpack.unpackb(packed)
        path = command.get("path", "").removeprefix(ROOT)
        match command["type"]:
            case "set_transform":
                poses[path] = np.reshape(command["matrix"], (4, 4)).T
            case "set_object" if command["path"].startswith(ROOT):
                drawn[path] = command["object"]
            case "set_animation":
                clips = {clip["path"]: clip["clip"] for clip in command["animations"]}
    scene: Any = trimesh.Scene()
    nodes: set[str] = set()
    scene.graph.update("kickdyn", "world", matrix=Y_UP)
    for path, lowered in drawn.items():
        mesh = _mesh(lowered)
        if mesh is None:
            continue
        names, parent = path.split("/"), "kickdyn"
        for depth in range(1, len(names) + 1):
            upper = "/".join(names[:depth])
            pose, name = poses.get(upper, np.eye(4)), upper.replace("/", "_")
            if name not in nodes:
                scene.graph.update(name, parent, matrix=pose)
                nodes.add(name)
            parent = name
        placement = np.reshape(lowered["object"]["matrix"], (4, 4)).T
        name = f"{parent}_mesh"
        scene.add_geometry(
            mesh, node_name=name, geom_name=name, parent_node_name=parent, transform=placement
        )
    animated = {path.removeprefix(ROOT).replace("/", "_"): clip for path, clip in clips.items()}
    content = bytes(scene.export(file_type="glb"))
    return _animated(content, {name: clip for name, clip in animated.items() if name in nodes})


def _animated(content: bytes, clips: dict[str, dict[str, Any]]) -> bytes:
    """Return binary glTF with the clips of meshcat as an animation of the nodes they name."""
    if not clips:
        return content
    (length,) = struct.unpack_from("<I", content, 12)
    tree, blob = json.loads(content[20 : 20 + length]), bytearray(content[28 + length :])
    animation: dict[str, Any] = {"name": "kick", "channels": [], "samplers": []}
    for number, node in enumerate(tree["nodes"]):
        clip = clips.get(node.get("name", ""))
        if clip is None:
            continue
        _take_apart(node)
        for track in clip["tracks"]:
            frames, indices = np.unique([key["time"] for key in track["keys"]], return_index=True)
            values = np.array([track["keys"][k]["value"] for k in indices])
            sampler = {
                "input": _append(tree, blob, frames / clip["fps"]),
                "output": _append(tree, blob, values),
            }
            target = {"node": number, "path": TARGETS[track["name"]]}
            animation["channels"].append({"sampler": len(animation["samplers"]), "target": target})
            animation["samplers"].append(sampler)
    tree["animations"] = [animation]
    tree["buffers"][0]["byteLength"] = len(blob)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _take_apart(node: dict[str, Any]) -> None:
    """Replace the matrix of a node, which an animation cannot move, by its three factors."""
    pose = np.reshape(node.pop("matrix", np.eye(4)), (4, 4)).T
    scale = np.linalg.norm(pose[:3, :3], axis=0)
    node["translation"] = pose[:3, 3].tolist()
    node["rotation"] = Rotation.from_matrix(pose[:3, :3] / scale).as_quat().tolist()
    node["scale"] = scale.tolist()


def _append(tree: dict[str, Any], blob: bytearray, numbers: Array) -> int:
    """Append an array to the buffer; return the number of its accessor."""
    array = np.asarray(numbers, dtype="<f4")
    view = {"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes}
    blob += array.tobytes()
    tree["bufferViews"].append(view)
    kind = "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"
    rows = array.reshape(len(array), -1)
    ends = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
    tree["accessors"].append(
        {
            "bufferView": len(tree["bufferViews"]) - 1,
            "componentType": FLOAT,
            "count": len(array),
            "type": kind,
            **ends,
        }
    )
    return len(tree["accessors"]) - 1


def _mesh(lowered: dict[str, Any]) -> Any:
    """Return the mesh of an object of meshcat; None for a shadow."""
    (geometry,), (material,) = lowered["geometries"], lowered["materials"]
    if material["type"] == "ShadowMaterial":
        return None
    match geometry["type"]:
        case "BoxGeometry":
            mesh = trimesh.creation.box([geometry[name] for name in ("width", "height", "depth")])
        case "SphereGeometry":
            mesh = trimesh.creation.uv_sphere(geometry["radius"], count=[SEGMENTS, SEGMENTS])
        case "CylinderGeometry":
            half, top, bottom = (
                float(geometry[name]) for name in ("height", "radiusTop", "radiusBottom")
            )
            half /= 2
            profile = [(0.0, -half), (bottom, -half), (top, half), (0.0, half)]
            mesh = trimesh.creation.revolve(profile, sections=SEGMENTS)  # about z; three.js's is y
            mesh.apply_transform(Z_TO_Y)
        case _:
            mesh = _triangles(geometry["data"])
    colour = int(material.get("color", 0xFFFFFF))
    rgb = [colour >> 16 & 255, colour >> 8 & 255, colour & 255]
    alpha = round(255 * float(material.get("opacity", 1.0)))
    if not material.get("vertexColors"):
        looks: Any = trimesh.visual
        mesh.visual = looks.TextureVisuals(
            material=looks.material.PBRMaterial(
                baseColorFactor=[*rgb, alpha], metallicFactor=0.0, roughnessFactor=0.8,
                alphaMode="BLEND" if alpha < 255 else "OPAQUE", doubleSided=True,
            )
        )  # fmt: skip
    return mesh


def _triangles(data: dict[str, Any]) -> Any:
    """Return a mesh of triangles; of the ground, the part that is no backdrop."""
    attributes = {name: _array(packed) for name, packed in data["attributes"].items()}
    vertices, faces = attributes["position"], _array(data["index"]).reshape(-1, 3)
    colours = attributes.get("color")
    if colours is None:
        return trimesh.Trimesh(vertices, faces, process=False)
    size = np.abs(vertices).max(axis=1)
    faces = faces[(size[faces] < 0.5 * size.max()).all(axis=1)]
    mesh = trimesh.Trimesh(vertices, faces, vertex_colors=colours, process=False)
    mesh.remove_unreferenced_vertices()
    return mesh


def _array(packed: dict[str, Any]) -> Any:
    """Return an array as meshcat has packed it, a row for each vertex or face."""
    extension = packed["array"]
    numbers = np.frombuffer(extension.data, NUMBER_TYPES[extension.type])
    return np.asarray(numbers.reshape(-1, packed["itemSize"]))
