"""`check_motion`: the launches of a ball that a motion strikes, and the limits that it breaks."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.files import attributes, plain
from kickdyn.core.plot_style import styled
from kickdyn.core.representation import ReprMixin, Row, freeze_arrays, warned
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.strike_many import StrikeStatus, strike_many
from kickdyn.motion.motion import Motion
from kickdyn.motion.motion_record import (
    GroundForces,
    RecordedMotion,
    as_recorded,
    feet_of,
    ground_forces,
)
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.standing import is_floating

if TYPE_CHECKING:
    from kickdyn.motion.limits import BrokenLimit

SHOWN_LIMITS, DRAWN_LIMITS = 12, 5
"""Numbers of broken limits in the rows that are shown, and in the figure."""

AT_REST = 1e-3
"""Horizontal speed of a foot up to which it strikes no ball [m/s]."""

VARIABLES = {
    "foot_velocity": ("m/s", "velocity of the contact point", ("axis",)),
    "foot_speed": ("m/s", "speed of the contact point", ()),
    "contact_height": ("m", "height of the contact point above the ground", ()),
    "normal": ("1", "normal of the contact with a ball on the ground", ("axis",)),
    "ball_position": ("m", "centre of that ball", ("axis",)),
    "effective_mass": ("kg", "effective mass of the robot along the normal", ()),
    "approach_speed": ("m/s", "speed of foot and ball along the normal", ()),
    "ball_velocity": ("m/s", "velocity of the ball after the impact", ("axis",)),
    "ball_spin": ("rad/s", "spin of the ball after the impact", ("axis",)),
    "ball_speed": ("m/s", "speed of the ball after the impact", ()),
    "elevation": ("rad", "launch above the horizontal", ()),
    "azimuth": ("rad", "launch to the left of x", ()),
    "joint_impulses": ("N s, N m s", "impulse of a joint's parent on its child",
                       ("joint", "component")),
}  # fmt: skip
"""Variables of the launches beside flags: unit, meaning, and dimensions after `frame`."""

SCALARS = ("foot_speed", "contact_height", "effective_mass", "ball_speed", "elevation", "azimuth")
"""Variables that are shown of the best frame, and are in the JSON document."""


@dataclass(frozen=True, eq=False, repr=False)
class MotionCheck(ReprMixin):
    """What a motion does to a ball, and the limits that it breaks.

    Attributes:
        motion: that is checked.
        ball: that it would strike.
        launches: along `frame`, with its `time` [s]: `foot_velocity`, `foot_speed`,
            `contact_height`, the `normal` and the `ball_position` of a ball on the ground,
            `effective_mass`, `approach_speed`, `ball_velocity`, `ball_spin`, `ball_speed`,
            `elevation`, `azimuth`, `joint_impulses` [N s, N m s, axes of the joint], and flags:
            `status` as of `strike_many`, `faces` (whether the surface of the foot meets such a
            normal) and `stands` (whether a foot held the robot). Numbers are nan without an impact.
        forces: torques of the joints and wrenches of the ground, over the frames.
        margins: distances from limits over the frames, by name, nan where none apply.
        broken: the limits that the motion breaks.
        warnings: of the motion, and of what cannot be checked.
    """

    motion: RecordedMotion
    ball: Ball
    launches: xr.Dataset
    forces: GroundForces
    margins: Mapping[str, Array]
    broken: "tuple[BrokenLimit, ...]"
    warnings: tuple[str, ...]

    @property
    def best(self) -> int | None:
        """Number of the frame with the fastest ball that is not struck into the ground, if any."""
        table = self.launches
        speed = np.where(table.elevation.values >= 0.0, table.ball_speed.values, np.nan)
        return None if np.isnan(speed).all() else int(np.nanargmax(speed))

    def __post_init__(self) -> None:
        freeze_arrays(self.margins)

    def _rows(self) -> Iterable[Row]:
        yield "frames", len(self.motion.t), ""
        yield "frames with an impact", int((self.launches.status < 2).sum()), ""
        if self.forces.feet:
            yield "frames without support", int((~self.forces.stands.any(axis=1)).sum()), ""
        if (best := self.best) is not None:
            row, (joint, impulse) = self.launches.isel(frame=best), self.worst_joint(best)
            for name in ("time", *SCALARS):
                value, unit = float(row[name]), str(row[name].units)
                if unit == "rad":
                    value, unit = math.degrees(value), "deg"
                yield f"best frame, {name.replace('_', ' ')}", value, unit
            yield "best frame, worst joint", f"{joint}, {impulse:.4g} N s", ""
        for limit in self.broken[:SHOWN_LIMITS]:
            yield "broken", limit.sentence, ""
        if len(self.broken) > SHOWN_LIMITS:
            yield "broken", f"and {len(self.broken) - SHOWN_LIMITS} more limits: see `broken`", ""
        yield from warned(self.warnings)

    def worst_joint(self, frame: int) -> tuple[str, float]:
        """Return the joint with the largest linear impulse in a frame, and this impulse [N s]."""
        first = int(is_floating(self.motion.leg))
        impulses = self.launches.joint_impulses.values[frame, first:, :3]
        sizes = np.linalg.norm(impulses, axis=1)
        return str(self.launches.joint.values[first + sizes.argmax()]), float(sizes.max())

    @styled()
    def plot(self) -> Any:
        """Return a figure of matplotlib over time: ball, its place, margins of broken limits."""
        from matplotlib.figure import Figure

        table = self.launches
        time, worst = table.time.values, sorted(self.broken, key=lambda limit: -limit.frames)
        figure = Figure(figsize=(9.0, 9.0))
        rows = figure.subplots(4 if worst else 3, 1, sharex=True)
        for axes, label, values in (
            (rows[0], "ball speed [m/s]", table.ball_speed.values[:, None]),
            (rows[1], "elevation [deg]", np.degrees(table.elevation.values)[:, None]),
            (rows[2], "centre of the ball [m]", table.ball_position.values[:, :2]),
        ):
            axes.plot(time, values)
            axes.set_ylabel(label)
        rows[2].legend(rows[2].lines, ["x", "y"])
        for limit in worst[:DRAWN_LIMITS]:
            name = limit.name if limit.unit == "1" else f"{limit.name} [{limit.unit}]"
            rows[3].plot(time, self.margins[name], label=name.replace("$", r"\$"))
        if worst:
            rows[3].set_ylabel("margin")
            rows[3].legend()
        rows[-1].set_xlabel("time [s]")
        for axes in rows if self.best is not None else ():
            axes.axvline(time[self.best], color="0.6", linewidth=1, linestyle=":")
        figure.suptitle((self.motion.leg.name or "leg").replace("$", r"\$"))
        return figure

    def to_json(self) -> dict[str, Any]:
        """Return the best frame, launches and broken limits for JSON, with null for nan."""
        table, best, statuses = self.launches, self.best, list(StrikeStatus)
        columns = {name: plain(table[name].values) for name in ("time", *SCALARS)}
        best_frame: dict[str, Any] | None = None
        if best is not None:
            joint, impulse = self.worst_joint(best)
            best_frame = {"frame": best, **{name: values[best] for name, values in columns.items()}}
            best_frame |= {"worst_joint": joint, "worst_joint_impulse": impulse}
        return {
            "rate": self.motion.rate,
            "best": best_frame,
            "launches": columns,
            "status": [str(statuses[k]) for k in table.status.values],
            **attributes(self, "broken warnings"),
        }


@validation.check_arguments
def check_motion(
    motion: RecordedMotion | Motion,
    robot: Leg,
    ball: Ball,
    contact: Contact | None = None,
    *,
    ground: float | None = None,
    ground_friction: float | None = None,
) -> MotionCheck:
    r"""Return the launch of a ball if a motion struck it in each frame, and the limits it breaks.

    The ball of radius r lies on the ground, straight ahead of the horizontal velocity of the foot,
    whose contact point is at the height z: the normal has the azimuth of that velocity and the
    elevation :math:`\arcsin((r - z)/r)`. There is no contact unless :math:`0 < z < 2r`.

    The base of the robot floats. If a foot other than the kicking one stands, it is held as a
    support in the impact, and v is `Posture.admissible`: a foot that slides is taken to rest. A
    foot stands if its sole is slower than 0.5 m/s and within 3 cm of the lower one in this frame.
    Feet are the robot's supports, or for a robot by name its other foot.

    Torques are by inverse dynamics with rotors. Where no foot stands, torques are not compared with
    their limits. Margins are those of planned motions, without their reserves.

    Args:
        motion: of `read_motion`, or a planned one, which is sampled 500 times a second.
        robot: with the joints of the motion; its contact frame strikes.
        ball: the ball.
        contact: restitution, friction and offset of the contact with the ball; its normal does not
            count. None is `Contact()`.
        ground: height of the ground [m]; None is 0, or of a leg on a fixed base the height of its
            contact point while all joints are at 0, under which bodies may be.
        ground_friction: Coulomb's coefficient of ground and soles; None is that of the robot's
            supports, or 0.7.

    Raises:
        InvalidInput: a motion of another robot, a number out of range, or the package casadi is
            not installed (`pip install "kickdyn[motion]"`).
    """
    validation.check_installed("casadi", "motion", "limits of motions")
    from kickdyn.motion.limits import FRICTION, margins_of  # it imports CasADi

    recorded, contact = as_recorded(motion), contact or Contact()
    if recorded.leg.joint_names != robot.joint_names or recorded.leg.nq != robot.nq:
        raise InvalidInput(
            f"motion is of {recorded.leg.name} with {recorded.leg.nv} degrees of freedom: robot is "
            f"{robot.name} with {robot.nv}, and must have the same joints"
        )
    if ground is not None:
        ground = floor = validation.number("ground", ground, unit="m")
    elif is_floating(robot):
        ground = floor = 0.0
    else:
        straight = robot.posture(robot.configuration()).with_contact_offset(contact.offset)
        ground, floor = float(straight.contact_point[2]), -math.inf  # bodies may be under it
    stated = [support.friction for support in robot.supports if support.friction is not None]
    friction = (stated or [FRICTION])[0] if ground_friction is None else ground_friction
    friction = validation.number("ground friction", friction, at_least=0)
    warnings, bare = list(recorded.warnings), robot.with_supports()
    try:
        forces = ground_forces(recorded, robot, feet_of(robot))
    except InvalidInput as error:
        warnings.append(f"forces of the ground are not known: {error}")
        forces = ground_forces(recorded, robot, ())
    if is_floating(robot) and not forces.feet:
        warnings.append("no foot is known on which the robot stands: forces of the ground and "
                        "torques are not checked; robot.with_supports(FRAME) (--support) names "
                        "one")  # fmt: skip
    launches = _launches(recorded, bare, ball, contact, forces, ground)
    margins, broken = margins_of(recorded, robot, forces, floor, friction)
    check = MotionCheck(recorded, ball, launches, forces, margins, broken, tuple(warnings))
    if check.best is not None and not launches.faces.values[check.best]:
        warnings.append(f"{robot.frame} cannot meet the ball of the best frame with its surface: "
                        "the normal is outside its cone (`faces`)")  # fmt: skip
    return replace(check, warnings=tuple(warnings))


def _launches(
    motion: RecordedMotion, robot: Leg, ball: Ball, contact: Contact, forces: GroundForces,
    ground: float,
) -> xr.Dataset:  # fmt: skip
    """Return the launches of balls on the ground that lie ahead of the foot in each frame."""
    k, columns = len(motion.t), dict[str, Array]()
    sizes = {"axis": 3, "joint": len(robot.joint_names), "component": 6}
    for name, (_, _, dimensions) in VARIABLES.items():
        columns[name] = np.full((k, *(sizes[one] for one in dimensions)), np.nan)
    others = forces.stands[:, :-1]  # feet but the kicking one
    stands = others.any(axis=1)
    stance = np.where(stands, others.argmax(axis=1) if others.size else -1, -1)
    status, faces = np.full(k, StrikeStatus.NO_IMPACT.flag, np.int8), np.ones(k, bool)
    for foot in np.unique(stance).tolist():
        leg = robot.with_supports(forces.feet[foot]) if foot >= 0 else robot
        rows, velocities, contacts = list[int](), list[Array](), list[Contact]()
        cone = leg.contact_normal_cone
        frame = leg.workspace.model.frames[leg.frame_id].placement.rotation
        for row in np.flatnonzero(stance == foot).tolist():
            posture = leg.posture(motion.q[row]).with_contact_offset(contact.offset)
            velocity = posture.admissible(motion.v[row])
            numbers = _ball_ahead(posture, posture.point_velocity(velocity), ball.radius, ground)
            for name, number in numbers.items():
                columns[name][row] = number
            if (normal := numbers.get("normal")) is not None:
                in_frame = frame.T @ posture.rotation_world_joint.T @ normal
                faces[row] = cone is None or bool((cone @ in_frame >= 0.0).all())
                rows.append(row)
                velocities.append(velocity)
                contacts.append(replace(contact, normal=normal))
        if rows:
            impacts = strike_many(leg, motion.q[rows], velocities, ball, contacts)
            status[rows] = impacts.status
            for name in ("approach_speed", "ball_velocity", "ball_spin", "joint_impulses"):
                columns[name][rows] = getattr(impacts, name)
    columns["foot_speed"] = np.linalg.norm(columns["foot_velocity"], axis=1)
    columns["ball_speed"] = np.linalg.norm(columns["ball_velocity"], axis=1)
    vx, vy, vz = columns["ball_velocity"].T
    columns["elevation"], columns["azimuth"] = np.arctan2(vz, np.hypot(vx, vy)), np.arctan2(vy, vx)
    data: dict[str, Any] = {
        name: (("frame", *dimensions), columns[name], {"units": unit, "long_name": meaning})
        for name, (unit, meaning, dimensions) in VARIABLES.items()
    }
    flags: dict[str, Any] = {
        "long_name": "how the strike ends",
        "flag_values": np.arange(len(StrikeStatus), dtype=np.int8),
        "flag_meanings": " ".join(StrikeStatus),
    }
    data |= {
        "status": ("frame", status, flags),
        "faces": ("frame", faces, {"long_name": "whether the foot's surface meets the normal"}),
        "stands": ("frame", stands, {"long_name": "whether a foot holds the robot"}),
    }
    coordinates = {
        "time": ("frame", motion.t, {"units": "s"}),
        "axis": ["x", "y", "z"],
        "joint": list(robot.joint_names),
    }
    attributes = {"title": "launches of a motion", "ball_mass_kg": ball.mass,
                  "ball_radius_m": ball.radius, "ground_m": ground}  # fmt: skip
    return xr.Dataset(data, coordinates, attributes)


def _ball_ahead(posture: Posture, foot: Array, radius: float, ground: float) -> dict[str, Any]:
    """Return the variables of a foot with a velocity, and of the ball ahead if it meets one."""
    height, level = float(posture.contact_point[2]) - ground, math.hypot(foot[0], foot[1])
    numbers: dict[str, Any] = {"foot_velocity": foot, "contact_height": height}
    if 0.0 < height < 2 * radius and level > AT_REST:
        rise = (radius - height) / radius
        ahead = math.sqrt(1.0 - rise**2) / level
        normal = np.array([ahead * foot[0], ahead * foot[1], rise])
        numbers |= {
            "normal": normal,
            "ball_position": posture.contact_point + radius * normal,
            "effective_mass": posture.effective_mass(normal),
        }
    return numbers
