"""The file that a robot was read from, and the shapes that it describes."""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path

from kickdyn.core.validation import Array
from kickdyn.robot.mimic_joints import Mimic


class Shape(StrEnum):
    """What a visual is, and what its `size` holds [m]."""

    BOX = "box"  # lengths of the edges along x, y and z
    SPHERE = "sphere"  # radius
    ELLIPSOID = "ellipsoid"  # radii along x, y and z
    CYLINDER = "cylinder"  # length along z and radius
    CAPSULE = "capsule"  # length along z without the two ends, and radius
    MESH = "mesh"  # scale of the file's own lengths, one number or three, without a unit


@dataclass(frozen=True, eq=False)
class Visual:
    """A shape fixed to a frame of a robot, as the robot's file describes it, unchecked.

    Attributes:
        frame: name of the frame in the model, such as that of a link.
        pose: of the shape in that frame, shape `(4, 4)` [m].
        shape: what it is.
        size: see `Shape`.
        mesh: name of the mesh file as it is written; empty for other shapes.
        rgba: colour, 0 to 1; None where the file gives none.
        has_texture: whether the file colours it by a picture, which is not read.
        vertices, faces: of a mesh that was read with the robot's file, in place of `mesh`: shape
            `(n, 3)` [m, frame of the visual], and indices of vertices, shape `(m, 3)`.
    """

    frame: str
    pose: Array
    shape: Shape
    size: tuple[float, ...] = (1.0,)
    mesh: str = ""
    rgba: tuple[float, ...] | None = None
    has_texture: bool = False
    vertices: Array | None = None
    faces: Array | None = None


@dataclass(frozen=True)
class RobotFile:
    """The text of a robot's file that passed every check, and where it came from.

    Attributes:
        text: the document as it was checked; everything later is read from it, never from the file
            again.
        folder: the folder of the file, for its meshes.
        source: the file as the caller named it.
        package_dirs: ROS packages, or folders that contain them, for meshes named `package://`.
    """

    text: str
    folder: Path
    source: str
    package_dirs: tuple[Path, ...] = ()

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """A line for each kind of irregularity with which the file was read; none was repaired."""
        return ()

    @cached_property
    def mimics(self) -> tuple[Mimic, ...]:
        """The joints that the file lets move with another."""
        return ()

    @cached_property
    def passive_joints(self) -> tuple[str, ...]:
        """The joints that a file with actuators does not drive; none where that is not known."""
        return ()

    def visuals(self) -> list[Visual]:
        """Return the shapes that the file describes; raise `InvalidInput` if they are unreadable.

        A reader of a file format overrides it.
        """
        return []

    def collisions(self) -> list[Visual]:
        """Return the shapes that the file has for contacts; raise `InvalidInput` as `visuals`.

        A reader of a file format overrides it.
        """
        return []

    @cached_property
    def visuals_by_frame(self) -> dict[str, list[Visual]]:
        """The shapes by the frame that they are fixed to; raises what `visuals` raises."""
        return _by_frame(self.visuals())

    @cached_property
    def collisions_by_frame(self) -> dict[str, list[Visual]]:
        """The shapes for contacts by frame; raises what `collisions` raises."""
        return _by_frame(self.collisions())


def _by_frame(shapes: list[Visual]) -> dict[str, list[Visual]]:
    """Return shapes by the frame that they are fixed to."""
    by_frame: dict[str, list[Visual]] = {}
    for shape in shapes:
        by_frame.setdefault(shape.frame, []).append(shape)
    return by_frame
