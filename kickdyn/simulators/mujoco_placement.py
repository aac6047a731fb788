"""Geoms of the MJCF file from which a leg was read: the foot, and where a kicked ball lies."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.mjcf_file import MjcfFile, body_name, find_body, mujoco_pose
from kickdyn.robot.names import unknown
from kickdyn.simulators.mujoco_kick import load_mujoco, row

BALL = "kickdyn's ball"
"""Name of the ball among the geoms."""

GAP_TOLERANCE = 2e-3
"""Largest distance of the ball from the foot, and depth in another geom, without a warning [m]."""

TILT_TOLERANCE = math.radians(5.0)
"""Largest angle between the normals of contact and geom without a warning [rad]."""

LARGEST_DISTANCE = 100.0
"""Distance up to which distances are computed [m]."""


def placement_warnings(
    posture: Posture, normal: Array, centre: Array, radius: float
) -> tuple[str, ...]:
    """Return a line if a ball does not touch the foot of the leg's MJCF file, or overlaps a geom.

    At the nearest point, the foot's outward normal must be the contact's normal. The foot is the
    body of the contact frame with those fixed to it. Bodies that move apart from the leg, such as a
    ball that the file has already, are left out. Empty for a leg without such a file.
    """
    file = posture.leg.file
    if not isinstance(file, MjcfFile):
        return ()
    mujoco = load_mujoco()
    compiled, data = _placed(file, posture, centre, radius)
    ball, ends = compiled.geom(BALL).id, np.zeros(6)  # the nearest points of two geoms
    frame_body = find_body(compiled, posture.leg.frame)
    foot = compiled.body_weldid[frame_body] if frame_body >= 0 else -1
    of_foot: list[tuple[float, float, str]] = []  # distance, angle between the normals, name
    others: list[tuple[float, str]] = []
    for geom in range(compiled.ngeom):
        body = int(compiled.geom_bodyid[geom])
        if geom == ball or body_name(compiled, body) in file.left_out:
            continue
        name = compiled.geom(geom).name
        label = repr(str(name)) if name else f"geom {geom - (geom > ball)}"  # number in the file
        name = f"{label} of {body_name(compiled, body)!r}"
        apart = float(mujoco.mj_geomDistance(compiled, data, ball, geom, LARGEST_DISTANCE, ends))
        if compiled.body_weldid[body] == foot:
            outward = centre - ends[3:]
            sine = float(np.linalg.norm(np.cross(normal, outward)))
            of_foot.append((apart, math.atan2(sine, float(normal @ outward)), name))
        else:
            others.append((apart, name))
    lines = []
    if of_foot:
        apart, tilt, name = min(of_foot)
        if abs(apart) > GAP_TOLERANCE:
            lines.append(
                f"at first contact the ball's surface is {1e3 * abs(apart):.0f} mm "
                f"{'outside' if apart > 0.0 else 'inside'} {name}, so that the kick in that file "
                "differs from this one: change the offset of the contact point or the posture "
                "until the ball touches the geom"
            )
        elif tilt > TILT_TOLERANCE:
            lines.append(
                f"where the ball touches {name}, the geom's normal is {math.degrees(tilt):.0f} deg "
                "from that of the contact: in the file the kick differs from this one; choose "
                "another contact point or normal"
            )
    apart, name = min(others, default=(0.0, ""))
    if apart < -GAP_TOLERANCE:
        lines.append(
            f"at first contact the ball is {-1e3 * apart:.0f} mm inside {name}, which pushes it "
            "out where the two collide: choose another posture"
        )
    return tuple(lines)


def _placed(file: MjcfFile, posture: Posture, centre: Array, radius: float) -> tuple[Any, Any]:
    """Return MuJoCo's model and data of a file with a ball, all geoms in their places.

    Bodies that are not part of the leg are where the file draws them.
    """
    mujoco = load_mujoco()
    ball = (
        f'<worldbody><geom name={quoteattr(BALL)} type="sphere" size="{radius!r}" '
        f'pos="{row(centre)}"/></worldbody>'
    )
    end = file.text.rindex("</mujoco>")
    compiled = replace(file, text=file.text[:end] + ball + file.text[end:]).compile()
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    model = posture.leg.model
    state = model.createData()
    pin.framesForwardKinematics(model, state, posture.q)
    for geom in range(compiled.ngeom):
        name = body_name(compiled, int(compiled.geom_bodyid[geom]))
        if model.existFrame(name, pin.FrameType.BODY):
            place = state.oMf[model.getFrameId(name, pin.FrameType.BODY)]
            pose = place * mujoco_pose(compiled.geom_pos[geom], compiled.geom_quat[geom])
            data.geom_xpos[geom], data.geom_xmat[geom] = pose.translation, pose.rotation.ravel()
    return compiled, data


def check_feet(leg: Leg, feet: Sequence[str]) -> None:
    """Raise `InvalidInput` for a name that no geom of the leg's MJCF file has."""
    if not feet or not isinstance(leg.file, MjcfFile):
        return
    compiled = leg.file.compile()
    names = [str(compiled.geom(geom).name) for geom in range(compiled.ngeom)]
    for foot in feet:
        if foot not in names:
            raise InvalidInput(unknown("geom", foot, leg.name, [name for name in names if name]))


def find_foot(leg: Leg) -> tuple[str, ...]:
    """Return the geom of a leg's contact frame in its MJCF; none where the leg has no such file.

    Raises `InvalidInput` if the frame is a body or a site of a body that has several geoms, or one
    without a name.
    """
    if not isinstance(leg.file, MjcfFile):
        return ()
    compiled, frame = leg.file.compile(), leg.frame
    geoms = np.flatnonzero(compiled.geom_bodyid == find_body(compiled, frame))
    names = [str(compiled.geom(int(geom)).name) for geom in geoms]
    if frame in names:
        return (frame,)
    if len(names) == 1 and names[0]:
        return (names[0],)
    known = ", ".join(filter(None, names)) or "none with a name"
    raise InvalidInput(
        f"which geom of {frame!r} strikes the ball? MuJoCo needs its name for friction: name it "
        f"with --foot (there are {known}), or choose --friction 0"
    )
