"""What a URDF says its links look like."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import meshcat.geometry as shapes
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.urdf_file import UrdfFile
from kickdyn.view.cylinder_pose import UPRIGHT
from kickdyn.view.mesh_file import read_mesh

PLAIN = (0.62, 0.67, 0.73, 1.0)


@dataclass(frozen=True, eq=False)
class Visual:
    """One shape of one link.

    Attributes:
        link: its name.
        place: of the shape in the link's frame, shape `(4, 4)` [m].
        shape: a meshcat geometry.
        rgba: colour, 0 to 1.
    """

    link: str
    place: Array
    shape: Any
    rgba: tuple[float, ...]


def urdf_visuals(urdf: UrdfFile) -> list[Visual]:
    """Return all visuals of a URDF, from the text that was checked.

    Raises:
        InvalidInput: a visual cannot be read, or names a mesh outside the URDF's folder.
    """
    import yourdfpy  # takes half a second; `from_model` legs do without

    try:
        robot = yourdfpy.URDF.load(
            io.BytesIO(urdf.text.encode()), build_scene_graph=False, load_meshes=False
        ).robot
    except Exception as error:  # yourdfpy has no error of its own for a bad file
        raise InvalidInput(f"{urdf.source}: its visuals cannot be read ({error})") from None
    colours = _colours(robot)
    return [
        found
        for link in robot.links
        for visual in link.visuals
        for found in _shapes(link.name, visual, colours, urdf)
    ]


def _shapes(
    link: str, visual: Any, colours: dict[str, tuple[float, ...]], urdf: UrdfFile
) -> Iterator[Visual]:
    place = np.eye(4) if visual.origin is None else visual.origin
    painted = colours.get(visual.material.name) if visual.material else None
    if visual.material and visual.material.color:
        painted = _rgba(visual.material.color.rgba)
    rgba = painted or PLAIN
    geometry = visual.geometry
    if geometry.box:
        yield Visual(link, place, shapes.Box(geometry.box.size.tolist()), rgba)
    elif geometry.sphere:
        yield Visual(link, place, shapes.Sphere(geometry.sphere.radius), rgba)
    elif geometry.cylinder:
        cylinder = shapes.Cylinder(geometry.cylinder.length, geometry.cylinder.radius)
        yield Visual(link, place @ UPRIGHT, cylinder, rgba)
    else:
        for part in read_mesh(geometry.mesh.filename, urdf.folder, geometry.mesh.scale):
            own = PLAIN if part.rgba is None else _rgba(part.rgba)
            triangles = shapes.TriangularMeshGeometry(part.vertices, part.faces)
            textured = visual.material is not None and visual.material.texture is not None
            yield Visual(link, place, triangles, own if textured else painted or own)


def _colours(robot: Any) -> dict[str, tuple[float, ...]]:
    """Return the colours by name, wherever in the file the name is defined."""
    inline = [visual.material for link in robot.links for visual in link.visuals]
    return {
        material.name: _rgba(material.color.rgba)
        for material in [*filter(None, inline), *robot.materials]
        if material.color
    }


def _rgba(values: Array) -> tuple[float, ...]:
    if np.shape(values) != (4,) or not np.isfinite(values).all():
        return PLAIN
    return tuple(np.clip(values, 0.0, 1.0).tolist())
