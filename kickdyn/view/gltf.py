"""A recorded scene as glTF, which slides, Blender and viewers of 3-D models open."""

from typing import Any

import numpy as np
import trimesh
import umsgpack

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


def to_glb(recorder: Recorder) -> bytes:
    """Return what a recorder has drawn as binary glTF, as it stands before an animation.

    Bodies, arrows, curves and the ground are meshes with colours, in metres; labels, light and
    shadows are left out.
    """
    poses: dict[str, Array] = {}
    drawn: dict[str, dict[str, Any]] = {}
    for packed in recorder.commands:
        command = umsgpack.unpackb(packed)
        path = command.get("path", "")
        if not path.startswith(ROOT):
            continue
        if command["type"] == "set_transform":
            poses[path] = np.reshape(command["matrix"], (4, 4)).T
        elif command["type"] == "set_object":
            drawn[path] = command["object"]
    scene: Any = trimesh.Scene()
    for path, lowered in drawn.items():
        mesh = _mesh(lowered)
        if mesh is None:
            continue
        pose, names = np.eye(4), path.removeprefix(ROOT).split("/")
        for depth in range(1, len(names) + 1):
            pose = pose @ poses.get(ROOT + "/".join(names[:depth]), np.eye(4))
        own = np.reshape(lowered["object"]["matrix"], (4, 4)).T
        name = path.removeprefix(ROOT).replace("/", "_")
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=Y_UP @ pose @ own)
    return bytes(scene.export(file_type="glb"))


def _mesh(lowered: dict[str, Any]) -> Any:
    """Return the mesh of an object of meshcat; None for a shadow."""
    (geometry,), (material,) = lowered["geometries"], lowered["materials"]
    if material["type"] == "ShadowMaterial":
        return None
    match geometry["type"]:
        case "BoxGeometry":
            sizes = [geometry[name] for name in ("width", "height", "depth")]
            mesh = trimesh.creation.box(sizes)
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
