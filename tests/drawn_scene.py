"""What is drawn with meshcat, read back: poses in the world, shapes, arrows, the animation."""

import numpy as np
import pinocchio as pin
import trimesh
import umsgpack
from scipy.spatial.transform import Rotation
from tolerances import agrees, closed_form

SINGLE = 1e-6
"""Relative rounding of what goes through a page."""


def packed_array(packed):
    """Return an array of meshcat, a row for each vertex or face."""
    kind = np.float32 if packed["array"].type == 0x17 else np.uint32
    return np.frombuffer(packed["array"].data, kind).reshape(-1, packed["itemSize"])


class DrawnScene:
    """The nodes of a scene by their paths, without `/meshcat/`: of a page, viewer or commands."""

    def __init__(self, source):
        window = getattr(getattr(source, "viewer", source), "window", None)
        self.commands = [umsgpack.unpackb(c) for c in (window.commands if window else source)]
        self.labels = "\n".join(window.labels if window else ())
        self.matrices, self.objects, self.tracks, self.properties = {}, {}, {}, {}
        for command in self.commands:
            path = command.get("path", "").removeprefix("/meshcat").removeprefix("/")
            match command["type"]:
                case "set_transform":
                    self.matrices[path] = np.reshape(command["matrix"], (4, 4)).T
                case "set_object":
                    self.objects[path] = command["object"]
                case "set_property":
                    self.properties[path, command["property"]] = command["value"]
                case "set_animation":
                    self.options = command["options"]
                    for clip in command["animations"]:
                        tracks = self.tracks.setdefault(clip["path"].removeprefix("/meshcat/"), {})
                        for track in clip["clip"]["tracks"]:
                            keys = {key["time"]: np.array(key["value"]) for key in track["keys"]}
                            tracks[track["name"]] = keys

    def pose(self, path, frame=None):
        """Return the pose of a node in the world, at a frame of the animation."""
        pose, names = np.eye(4), path.split("/")
        for depth in range(1, len(names) + 1):
            node = "/".join(names[:depth])
            local = self.matrices.get(node, np.eye(4)).copy()
            tracks = self.tracks.get(node, {}) if frame is not None else {}
            if ".position" in tracks:
                local[:3, 3] = tracks[".position"][frame]
            if ".quaternion" in tracks:
                local[:3, :3] = Rotation.from_quat(tracks[".quaternion"][frame]).as_matrix()
            pose = pose @ local
        return pose

    def point(self, path, frame=None):
        return self.pose(path, frame)[:3, 3]

    def shape(self, path):
        return self.objects[path]["geometries"][0]

    def vertices(self, path):
        """Return the vertices of a mesh in the world."""
        pose = self.pose(path)
        local = packed_array(self.shape(path)["data"]["attributes"]["position"])
        return local @ pose[:3, :3].T + pose[:3, 3]

    def mesh(self, path):
        """Return a mesh in the world."""
        faces = packed_array(self.shape(path)["data"]["index"]).reshape(-1, 3)
        return trimesh.Trimesh(self.vertices(path), faces, process=False)

    def curve(self, path):
        return self.vertices(path).reshape(-1, 8, 3).mean(axis=1)

    def arrow(self, path):
        """Return the start of an arrow, and the vector to its tip, in the world."""
        ends = [
            (self.pose(node) @ (0, side * self.shape(node)["height"], 0, 1))[:3]
            for node in (f"{path}/shaft", f"{path}/head") for side in (-0.5, 0.5)
        ]  # fmt: skip
        agrees(ends[1], ends[2], closed_form(1e4))
        assert self.shape(f"{path}/head")["radiusTop"] == 0
        return ends[0], ends[3] - ends[0]

    def camera(self):
        """Return position of the camera and the point that it looks at, in the world."""
        x, y, z = self.properties["Cameras/default/rotated/<object>", "position"]  # y up
        return np.array([x, -z, y]) - self.matrices[""][:3, 3], -self.matrices[""][:3, 3]

    def slopes(self, points):
        """Return how far points are to the right and above the middle of the picture."""
        position, target = self.camera()
        into = (target - position) / np.linalg.norm(target - position)
        right = np.cross(into, (0, 0, 1)) / np.linalg.norm(np.cross(into, (0, 0, 1)))
        away = np.asarray(points) - position
        assert (away @ into > 0).all()
        return np.stack([away @ right, away @ np.cross(right, into)], -1) / (away @ into)[:, None]


def check_joints(scene, node, leg, q, frame=None, offset=(0.0, 0.0, 0.0)):
    """Compare the joints of a figure with forward kinematics by Pinocchio."""
    data = leg.model.createData()
    pin.forwardKinematics(leg.model, data, q)
    for joint in range(1, leg.model.njoints):
        right = data.oMi[joint].homogeneous.copy()
        right[:3, 3] += offset
        agrees(scene.pose(f"{node}/{joint}", frame), right, SINGLE)


def in_the_picture(slopes):
    """Raise unless slopes are in a picture of 16 by 9, beside the caption at its left."""
    half = np.tan(np.radians(22.0))
    assert (slopes > (-0.76 * half - closed_form(), -half)).all()
    assert (slopes < (16 / 9 * half, half)).all()
