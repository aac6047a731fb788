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
from kickdyn.robot.mjcf_file import MjcfFile, body_name
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

    At the nearest point, the foot's outward normal must be the contact's normal.

    Empty for a leg that was not read from such a file. The foot is the body of the contact frame
    with those fixed to it. Bodies that move apart from the leg, such as a ball that the file has
    already, are left out.
    """
    file = posture.leg.file
    if not isinstance(file, MjcfFile):
        return ()
    mujoco = load_mujoco()
    compiled, data = _placed(file, posture, centre, radius)
    ball = compiled.geom(BALL).id
    feet: dict[str, float] = {}
    tilts: dict[str, float] = {}
    ends = np.zeros(6)  # the nearest points of two geoms
    distances: dict[str, float] = {}
    body = _body_of(compiled, posture.leg.frame)
    foot = compiled.body_weldid[body] if body >= 0 else -1
    for geom in range(compiled.ngeom):
        if geom == ball:
            continue
        body = int(compiled.geom_bodyid[geom])
        if body_name(compiled, body) in file.left_out:
            continue
        geom_name = str(compiled.geom(geom).name)
        label = (
            repr(geom_name) if geom_name else f"geom {geom - (geom > ball)}"
        )  # its number in the file
        name = f"{label} of {body_name(compiled, body)!r}"
        apart = float(mujoco.mj_geomDistance(compiled, data, ball, geom, LARGEST_DISTANCE, ends))
        if compiled.body_weldid[body] == foot:
            feet[name] = apart
            outward = centre - ends[3:]
            sine = float(np.linalg.norm(np.cross(normal, outward)))
            tilts[name] = math.atan2(sine, float(normal @ outward))
        else:
            distances[name] = apart
    lines = []
    if feet:
        nearest = min(feet, key=lambda name: feet[name])
        if abs(feet[nearest]) > GAP_TOLERANCE:
            where = "outside" if feet[nearest] > 0.0 else "inside"
            lines.append(
                f"at first contact the ball's surface is {1e3 * abs(feet[nearest]):.0f} mm {where} "
                f"{nearest}, so that the kick in that file differs from this one: change the "
                "offset of the contact point or the posture until the ball touches the geom"
            )
        elif tilts[nearest] > TILT_TOLERANCE:
            lines.append(
                f"where the ball touches {nearest}, the geom's normal is "
                f"{math.degrees(tilts[nearest]):.0f} deg from that of the contact: in the file the "
                "kick differs from this one; choose another contact point or normal"
            )
    inside = {name: -apart for name, apart in distances.items() if apart < -GAP_TOLERANCE}
    if inside:
        deepest = max(inside, key=lambda name: inside[name])
        lines.append(
            f"at first contact the ball is {1e3 * inside[deepest]:.0f} mm inside {deepest}, which "
            "pushes it out where the two collide: choose another posture"
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
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, compiled.geom_quat[geom])
            data.geom_xpos[geom] = place.act(compiled.geom_pos[geom].copy())
            data.geom_xmat[geom] = (place.rotation @ turn.reshape(3, 3)).ravel()
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
    body = _body_of(compiled, frame, geoms=False)
    if body < 0:
        return (frame,)
    geoms = np.flatnonzero(np.asarray(compiled.geom_bodyid) == body)
    names = [str(compiled.geom(int(geom)).name) for geom in geoms]
    if len(names) == 1 and names[0]:
        return (names[0],)
    known = ", ".join(filter(None, names)) or "none with a name"
    raise InvalidInput(
        f"which geom of {frame!r} strikes the ball? MuJoCo needs its name for friction: name it "
        f"with --foot (there are {known}), or choose --friction 0"
    )


def _body_of(compiled: Any, frame: str, *, geoms: bool = True) -> int:
    """Return the body of a frame, which is a body, a site or a geom; -1 where it is none."""
    mujoco = load_mujoco()
    kinds = [
        (mujoco.mjtObj.mjOBJ_BODY, np.arange(compiled.nbody)),
        (mujoco.mjtObj.mjOBJ_SITE, compiled.site_bodyid),
    ]
    if geoms:
        kinds.append((mujoco.mjtObj.mjOBJ_GEOM, compiled.geom_bodyid))
    for kind, bodies in kinds:
        number = mujoco.mj_name2id(compiled, kind, frame)
        if number >= 0:
            return int(bodies[number])
    return -1
