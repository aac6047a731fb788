"""Surfaces of a foot that can meet a ball: toe, instep, edge of the sole, inside, outside, heel.

Robots by name have theirs in `catalog`; other feet get theirs from their shapes.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
import pinocchio as pin
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, QhullError

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.robot.catalog import SIDE, SURFACES, add_contact_points, normal_cone
from kickdyn.robot.ground_clearance import find_unread
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frames_by_name
from kickdyn.robot.standing import joint_bodies, joint_spheres

LONGER = 1.2
"""Width of a foot over its length above which the robot seems to face another axis than x."""


@dataclass(frozen=True, eq=False)
class FootSurface:
    """A surface of a foot, in axes of the world while all joints are at 0: x forward, z up.

    Attributes:
        name: of the contact frame of a leg that kicks with it.
        point: from the origin of the leg's contact frame to the contact point, shape `(3,)` [m].
        normal: out of the foot, shape `(3,)`, of any length but zero.
        size: how far it reaches, level and upwards, across the normal, shape `(2,)` [m], if known.
        rise: range of the rise of normals that meet a ball, shape `(2,)` [rad]; None is up to 15
            degrees to either side of `normal`, as to its left and right.
    """

    name: str
    point: ArrayLike
    normal: ArrayLike
    size: Array | None = None
    rise: Array | None = None

    def __post_init__(self) -> None:
        what = f"surface {self.name}"
        point = validation.vector(f"point of {what}", self.point, 3, unit="m")
        normal = validation.direction(f"normal of {what}", self.normal)
        rise = np.arcsin(normal[2]) + SIDE * np.array([-1, 1]) if self.rise is None else self.rise
        vars(self).update(point=point, normal=normal, rise=rise)


@validation.check_arguments
def kick_with(leg: Leg, surface: str | FootSurface) -> Leg:
    """Return a leg that kicks with a surface of its foot, which its plans turn to the ball.

    Args:
        leg: whose contact frame is on the foot.
        surface: one of `foot_surfaces` by name, or one that is given.

    Raises:
        InvalidInput: there is no such surface, or the foot has no shapes.
    """
    if isinstance(surface, str):
        if surface not in SURFACES:
            raise InvalidInput(f"surface {surface!r} is unknown: choose {', '.join(SURFACES)}")
        surface = foot_surfaces(leg)[surface]
        hull = _foot_hull(leg)
        along, across = (hull.max_bound - hull.min_bound)[:2]
        if across > LONGER * along:
            leg = leg.with_warnings(
                f"the foot is {along:.3g} m long along x and {across:.3g} m along y: a robot that "
                "faces y or -y is turned by facing='y' or '-y' (--facing)"
            )
    model, (x, y, _) = leg.model, np.asarray(surface.normal)
    if surface.name not in frames_by_name(model):
        add_contact_points(model, leg.frame, {surface.name: surface.point})
    cone = normal_cone(np.arctan2(y, x), *np.asarray(surface.rise))
    return replace(leg, model=model, frame=surface.name, contact_normal_cone=cone)


@validation.check_arguments
def foot_surfaces(leg: Leg) -> dict[str, FootSurface]:
    r"""Return the surfaces of the foot that carries a leg's contact frame, by name.

    A contact point p is where a ball overlaps least with the convex hull of the foot's shapes, of
    all normals n of the surface, with the ball seen as a plane:

    .. math:: \min_p \max_n (h(n) - n \cdot p), \qquad h(n) = \max_x n \cdot x .

    The points of a robot of the catalogue are its frames. The robot faces x; a foot with
    its middle left of y = 0 is a left one, whose inside is on its right.

    Raises:
        InvalidInput: the foot has no shapes that span a volume.
    """
    hull, model, data = _foot_hull(leg), leg.workspace.model, leg.workspace.data
    pin.updateFramePlacements(model, data)
    origin, joint = data.oMf[leg.frame_id].translation.copy(), leg.contact_joint
    on_foot = {
        name: data.oMf[number].translation - origin
        for name, number in frames_by_name(model).items()
        if int(model.frames[number].parentJoint) == joint
    }
    is_left, surfaces = hull.min_bound[1] + hull.max_bound[1] + 2.0 * origin[1] > 0.0, {}
    for name, degrees in SURFACES.items():
        direction, low, high = np.radians(degrees) * (-1.0 if is_left else 1.0, 1.0, 1.0)
        side, up = np.meshgrid(direction + SIDE * np.arange(-1, 2), np.linspace(low, high, 3))
        level = np.cos(up)
        normals = np.stack([level * np.cos(side), level * np.sin(side), np.sin(up)], axis=-1)
        point = on_foot.get(name)
        if point is None:
            point = _contact_point(hull, normals.reshape(-1, 3))
        size = _size(hull, normals[1, 1])
        surfaces[name] = FootSurface(name, point, normals[1, 1], size, np.array([low, high]))
    return surfaces


def _foot_hull(leg: Leg) -> ConvexHull:
    """Return the hull of the foot's shapes with all joints at 0, from the contact frame [m]."""
    model, data, joint = leg.workspace.model, leg.workspace.data, leg.contact_joint
    pin.forwardKinematics(model, data, leg.configuration())
    origin = pin.updateFramePlacement(model, data, leg.frame_id).translation
    spheres = joint_spheres(leg, joint).moved(data.oMi[joint].homogeneous)
    try:
        return ConvexHull(spheres.points - origin)
    except (QhullError, ValueError):
        unread = filter(None, (find_unread(leg, frame) for frame in joint_bodies(leg, joint)))
        reason = next((f" ({why}; --package-dir names the folder of meshes)" for why in unread), "")
        raise InvalidInput(
            f"the foot at {leg.frame} of {leg.name} has no shapes that span a volume{reason}: give "
            "the surface, FootSurface(name, point, normal) (--frame FRAME:X,Y,Z:NX,NY,NZ)"
        ) from None


def _contact_point(hull: ConvexHull, normals: Array) -> Array:
    """Return the point of a hull that planes with normals overlap least, `(3,)` [m]."""
    reach = (hull.points[hull.vertices] @ normals.T).max(axis=0)
    facets = np.column_stack([hull.equations[:, :3], np.zeros(len(hull.equations))])
    planes = np.column_stack([-normals, -np.ones(len(normals))])
    bounds = np.concatenate([-hull.equations[:, 3], -reach])
    inner = linprog([0, 0, 0, 1], np.vstack([facets, planes]), bounds, bounds=(None, None))
    return np.asarray(inner.x[:3])


def _size(hull: ConvexHull, normal: Array) -> Array:
    """Return the extent of a hull near its tangent plane, level and upwards, `(2,)` [m]."""
    edges = hull.points[hull.simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)]
    heights = edges @ normal
    # depth under its tangent plane up to which a foot belongs to a surface [m]: a ball is pressed
    # in by more than this
    above = heights - (heights.max() - 5e-3)
    cut = above[:, 0] * above[:, 1] < 0.0
    share = above[cut, 0] / (above[cut, 0] - above[cut, 1])
    crossings = edges[cut, 0] + share[:, None] * (edges[cut, 1] - edges[cut, 0])
    level = np.cross((0.0, 0.0, 1.0), normal)
    axes = np.column_stack([level, np.cross(normal, level)]) / np.linalg.norm(level)
    return np.asarray(np.ptp(np.vstack([edges[above >= 0.0], crossings]) @ axes, axis=0))


def load_with_surface(frame: str | None, load: Callable[[str | None], Leg]) -> Leg:
    """Return the leg that `load` returns for FRAME, FRAME:SURFACE or FRAME:X,Y,Z:NX,NY,NZ.

    Names of frames may contain colons; the longest one that exists counts.
    """
    names = list(accumulate((frame or "").split(":"), "{}:{}".format))
    faults = []
    for name in names:
        try:
            leg = load(name or frame)
            break
        except InvalidInput as error:
            faults.append(error)
    else:
        raise faults[0]
    longest = [longer for longer in names if longer in frames_by_name(leg.workspace.model)][-1:]
    if longest and longest != [name]:
        name, leg = longest[0], load(longest[0])
    text = (frame or "").removeprefix(name).removeprefix(":")
    if not text:
        return leg
    if text in SURFACES:
        return kick_with(leg, text)
    try:
        point, normal = ([float(x) for x in vector.split(",")] for vector in text.split(":"))
    except ValueError:
        raise InvalidInput(
            f"surface {text!r} of {name} must be {', '.join(SURFACES)}, or X,Y,Z:NX,NY,NZ"
        ) from None
    return kick_with(leg, FootSurface("surface", point, normal))
