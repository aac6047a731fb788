"""`kick_library`: motions of a robot for a range of launches, from which any kick follows at once.

Motions are planned on a grid of launches and places of the ball, each next to that of a neighbour,
outward from the middle. Between them, motions are interpolated: in a cell of the grid, those at its
centre and at the centres of its faces must keep all limits and meet the launch by `strike`, or the
cell is halved, and at last not covered. `KickReader` has the interpolation and the exact impact.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.integrate import trapezoid
from scipy.interpolate import BSpline

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.files import FileName, attributes, checked_ending
from kickdyn.core.plot_style import styled
from kickdyn.core.representation import ReprMixin, Row, freeze_arrays
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.motion.motion import Motion
from kickdyn.planning.goal import Goal
from kickdyn.planning.kick import turn_plan
from kickdyn.planning.kick_limits import Balance
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_reader import (
    AXES,
    InterpolatedKick,
    launch_axes,
    launch_velocity,
    read_kicks,
)
from kickdyn.planning.kick_steps import (
    check_has_drives,
    checked_contact,
    checked_leg,
    path_to_target,
)
from kickdyn.planning.kick_terms import KickObjective
from kickdyn.planning.launch import Launch, plan_launch
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import StandingRobot, is_floating

UNITS = {"speed": "m/s", "elevation": "rad", "azimuth": "rad", "x": "m", "y": "m"}

SAME = 1e-6
"""Difference from the only value of an axis that counts as rounding [m/s, rad, m]."""

SAMPLES = 200
"""Times at which the torques of a motion are integrated."""

Range = float | tuple[float, float] | tuple[float, float, float]
"""A single value of an axis, or its least and largest one, if need be with the largest step."""

Progress = Callable[[str, int, int], None]
"""Is called with what is computed, `motions` or `checks`, how many there are, and of how many."""


@validation.check_arguments
def kick_library(
    robot: Leg,
    file: FileName,
    ball: Ball | None = None,
    *,
    speed: Range | None = None,
    elevation: Range = 0.0,
    azimuth: Range = 0.0,
    x: Range | None = None,
    y: Range | None = None,
    height: float | None = None,
    contact: Contact | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> "KickLibrary":
    """Plan motions for a range of launches and places of the ball, or read those in a file.

    What is computed is stored beside the file as it comes, so that a library that was interrupted
    is continued by the same call. A file that is finished is read: without a `speed`, or with the
    ranges that it was made for.

    Args:
        robot: as for `plan_kick` with a motion.
        file: of the library, `.npz`.
        ball: at rest; None is `Ball()`.
        speed: of the launch [m/s]: a value, or the least and the largest one. A third number is
            the largest step between motions, in place of 4 % of the speed, 2 degrees or 2 cm.
        elevation: of the launch above the ground, likewise [rad].
        azimuth: of the launch to the left of x, likewise [rad]. A standing robot can turn instead,
            as `LibraryKick.heading` says, so that one azimuth is enough.
        x: place of the ball's centre in the axes in which the robot stands, with the base above
            the origin while all joints are at 0, likewise [m]. None is the place that suits the
            middle of the ranges best.
        y: likewise, to the left.
        height: of the ball's centre [m]; None is its radius, for a robot that stands.
        contact: as for `plan_kick`, with one coefficient of restitution.
        executor: of processes or of a cluster, as for `sweep`; None computes here.
        progress: is called as motions and checks are computed.

    Raises:
        InvalidInput: a range that is none, a robot whose motions cannot be planned, or a file of
            another robot, of other ranges, or damaged.
        Unfinished: interrupted by Ctrl-C, a full disk or lost workers.
    """
    path = Path(file)
    validation.check_installed("casadi", "motion", "libraries of kicks")
    checked_ending(path, (".npz",), "a library is written as")
    given, contact = contact, checked_contact(contact)
    named = {"speed": speed, "elevation": elevation, "azimuth": azimuth, "x": x, "y": y}
    ranges = {name: _checked_range(name, value) for name, value in named.items()}
    if speed is None or path.exists():
        library = KickLibrary(path, robot)
        library.check_settings(ranges if speed is not None else {}, ball, given, height)
        return library
    if not isinstance(contact.restitution, float):
        raise InvalidInput("the restitution depends on the speed: a library needs a single value")
    ball, robot = ball or Ball(), checked_leg(robot)
    check_has_drives(robot)
    if height is None:
        if not is_floating(robot):
            raise InvalidInput("height of the ball's centre is missing: a leg needs it")
        height = ball.radius
    from kickdyn.planning.library_making import LibraryMaking  # it imports CasADi
    from kickdyn.planning.library_motions import Kicks

    kicks = Kicks(robot, ball, contact, height)
    making = LibraryMaking(path, kicks, ranges, executor, progress or (lambda *_: None))
    making.run()
    return KickLibrary(path, robot)


def _checked_range(name: str, value: Range | None) -> tuple[float, ...] | None:
    """Return the least and the largest value of an axis, and the step if one is given."""
    if value is None:
        return None
    values = np.atleast_1d(validation.floats(name, value, unit=UNITS[name]))
    pair, step = values[:2], values[2:]
    if values.shape not in ((1,), (2,), (3,)) or pair[0] > pair[-1] or (step <= 0.0).any():
        raise InvalidInput(
            f"{name} is {validation.brief(value)}: it must be a value, or the least and the "
            "largest one, or these and a step above 0"
        )
    above = 0.0 if name == "speed" else -math.inf
    most = {"elevation": math.pi / 2, "azimuth": math.pi}.get(name, math.inf)
    for each in pair:
        validation.number(name, each, above=above, unit=UNITS[name])
        if abs(each) > most:
            raise InvalidInput(f"{name} is {each:g} rad: at most {most:.4g}, in radians")
    return (*pair[[0, -1]].tolist(), *step.tolist())


class KickLibrary(ReprMixin):
    """Motions of a robot for a range of launches, see `kick_library`.

    Args:
        file: that `kick_library` has written.
        robot: that it was made for.

    Attributes:
        reader: of the file, on NumPy alone.
    """

    def __init__(self, file: FileName, robot: Leg) -> None:
        try:
            self.reader = read_kicks(file)
        except FileNotFoundError:
            raise InvalidInput(f"{file} does not exist: speed is missing to make it") from None
        except ValueError as error:
            raise InvalidInput(str(error)) from None
        self.file, robot = Path(file), checked_leg(robot)
        self._standing = StandingRobot(robot) if is_floating(robot) else None
        self.robot = robot if self._standing is None else self._standing.robot
        whole = robot if self._standing is None else self._standing.leg
        a = self.reader.arrays
        masses = np.array([body.mass for body in whole.workspace.model.inertias[1:]])
        same = tuple(self.reader.joints) == whole.joint_names and np.allclose(masses, a["masses"])
        if not same:
            raise InvalidInput(
                f"{self.file.name} is a library of {a['robot']}, with "
                f"{len(self.reader.joints)} joints and {a['masses'].sum():.4g} kg: {robot.name} "
                f"has {len(whole.joint_names)} and {masses.sum():.4g} kg"
            )
        point = whole.posture(whole.configuration()).contact_lever
        if whole.contact_joint - 1 != a["contact"] or not np.allclose(point, a["contact_point"]):
            raise InvalidInput(
                f"{self.file.name} is a library of kicks with another frame than {robot.frame}"
            )

    @property
    def covered(self) -> float:
        """Share of the ranges in which there are kicks."""
        a, active = self.reader.arrays, self.reader.active
        sizes = (a["cell_upper"] - a["cell_lower"])[:, active].prod(axis=1)
        return float(sizes[a["cell_reasons"] == ""].sum() / sizes.sum())

    @property
    def _simulated(self) -> list[tuple[str, float, float]]:
        """Ranges of speed and elevation in MuJoCo; none unless the library was carried out."""
        launches = self.reader.arrays.get("simulated", np.empty((0, 3)))
        columns = launches[~np.isnan(launches[:, 0]), :2].T
        return [(AXES[k], min(each), max(each)) for k, each in enumerate(columns) if len(each)]

    def _rows(self) -> Iterable[Row]:
        yield "robot", str(self.reader.arrays["robot"]), ""
        for name, low, high in zip(AXES, self.reader.lower, self.reader.upper, strict=True):
            yield name, _shown(name, low, high), ""
        yield "motions", len(self.reader.arrays["coefficients"]), ""
        yield "covered share of the ranges", self.covered, ""
        for name, low, high in self._simulated:
            yield f"{name} in MuJoCo", _shown(name, low, high), ""

    def to_json(self) -> dict[str, Any]:
        """Return the ranges and the share of them that is covered."""
        a, reader = self.reader.arrays, self.reader
        pairs = zip(AXES, reader.lower.tolist(), reader.upper.tolist(), strict=True)
        return {
            "robot": str(a["robot"]),
            "ranges": {name: {"low": low, "high": high, "unit": UNITS[name]}
                       for name, low, high in pairs},
            "motions": len(a["coefficients"]),
            "covered": self.covered,
        }  # fmt: skip

    def check_settings(
        self,
        ranges: Mapping[str, tuple[float, ...] | None],
        ball: Ball | None,
        contact: Contact | None,
        height: float | None,
    ) -> None:
        """Raise `InvalidInput` for ranges or an impact other than the library's; None is any."""
        a, exists = self.reader.arrays, f"{self.file.name} exists, for"
        for name, low, high in zip(AXES, self.reader.lower, self.reader.upper, strict=True):
            wish = ranges.get(name)
            if wish is not None and not np.allclose(wish[:2], (low, high)):
                wanted, has = _shown(name, *wish[:2]), _shown(name, low, high)
                raise InvalidInput(f"{name} is {wanted}: {exists} {has}")
        for name, value, stored, unit in (
            ("mass of the ball", ball and ball.mass, a["ball"][0], "kg"),
            ("radius of the ball", ball and ball.radius, a["ball"][1], "m"),
            ("height of the ball", height, a["ball"][2], "m"),
            ("restitution", contact and contact.restitution, a["impact"][0], ""),
            ("friction", contact and contact.friction, a["impact"][1], ""),
        ):
            if value is not None and not (isinstance(value, float) and np.isclose(value, stored)):
                shown = validation.brief(value)
                raise InvalidInput(f"{name} is {shown}: {exists} {stored:.4g} {unit}".rstrip())

    def kick(
        self, goal: Goal, *, ball_position: ArrayLike | None = None, air: Air | None = None
    ) -> "LibraryKick":
        """Return the kick that meets a goal, or why there is none.

        By `strike`, or in MuJoCo if `kickdyn.correct_library` has carried the library out.

        Args:
            goal: seen from where the ball lies, in the axes in which the robot stands.
            ball_position: x and y of the ball's centre in the axes of the library, in which the
                launch has its azimuths, `(2,)` [m]. None is the middle of its ranges.
            air: of the flight to the goal; None is the vacuum.

        Raises:
            InvalidInput: a goal with spin, or a value that is no number.
        """
        if goal.spin.any() or goal.beside is not None:
            raise InvalidInput("the goal has spin: kicks of a library give the ball none")
        launch = plan_launch(goal, self._ball, air)
        return self.kick_for([*launch_axes(launch.velocity), *self.place(ball_position)])

    def place(self, ball_position: ArrayLike | None) -> Array:
        """Return x and y of the ball, `(2,)` [m]; by default the middle of the ranges."""
        if ball_position is None:
            return np.asarray(0.5 * (self.reader.lower + self.reader.upper)[3:])
        return validation.vector("ball_position", ball_position, 2, unit="m")

    def kick_for(self, point: ArrayLike) -> "LibraryKick":
        """Return the kick that gives speed, elevation and azimuth to a ball at x and y, `(5,)`.

        If `kickdyn.correct_library` has carried the library out, the ball has them in MuJoCo.
        """
        point, reader = self._on_axes(point), self.reader
        if "simulated" not in reader.arrays:
            return self._turned(point)
        if (np.clip(point, reader.lower, reader.upper) != point)[3:].any():
            return self.kick_at(point)  # none, with the reason
        found = reader.correct(point)
        if found is None:
            ranges = ", ".join(f"{name} {_shown(name, *ends)}" for name, *ends in self._simulated)
            reason = f"no kick has this launch in MuJoCo; motions have, not all at once, {ranges}"
            return LibraryKick(self, point, 0.0, reason, None)
        place, turn = found
        if self._standing is None:  # it cannot be turned
            place, turn = place + turn * np.eye(5)[2], 0.0
        return replace(self.kick_at(place, turn), corrected_by="mujoco")

    def _turned(self, point: Array) -> "LibraryKick":
        """Return the kick with a launch by `strike`, of a robot that is turned if need be."""
        low, high = self.reader.lower[2], self.reader.upper[2]
        if self._standing is None or low <= point[2] <= high:
            return self.kick_at(point)
        middle = 0.5 * (low + high)
        return self.kick_at([*point[:2], middle, *point[3:]], point[2] - middle)

    def _on_axes(self, point: ArrayLike) -> Array:
        """Return a point, `(5,)`, with exactly the single values that axes have."""
        reader, point = self.reader, validation.vector("point", point, 5)
        single = (reader.upper == reader.lower) & (np.abs(point - reader.lower) <= SAME)
        return np.where(single, reader.lower, point)

    def kick_at(self, point: ArrayLike, heading: float = 0.0) -> "LibraryKick":
        """Return the kick at speed, elevation, azimuth, x and y, `(5,)`, of a turned robot."""
        point = self._on_axes(point)
        kick = self.reader.kick(point)
        reason = "" if kick is not None else self._why_not(point)
        return LibraryKick(self, point, heading, reason, kick)

    def plan(
        self, goal: Goal, *, ball_position: ArrayLike | None = None, air: Air | None = None
    ) -> KickPlan:
        """Return the plan of the `kick` that meets a goal, as `plan_kick` with a motion returns it.

        Limits are those of the motions that were checked around it. The plan serves where one of
        `plan_kick` does, as for `run_in_mujoco`.

        Raises:
            InvalidInput: as for `kick`, or there is none.
        """
        kick = self.kick(goal, ball_position=ball_position, air=air)
        launch = plan_launch(goal, self._ball, air)
        return self._plan(kick, goal.at(launch.time), launch, air, launch.time)

    def replan(self, plan: KickPlan, velocity: ArrayLike) -> KickPlan:
        """Return the plan with another launch by `strike`, `(3,)` [m/s, world], for the same goal.

        It serves to correct a launch, as `refine_kick` does; raises `InvalidInput` without a kick.
        """
        wished = validation.vector("velocity", velocity, 3, unit="m/s")
        launch, path = plan.launch, plan.path
        if not isinstance(launch, Launch) or not isinstance(path, Flight):
            raise InvalidInput("the plan is a pass or a trap: a library has none")
        place = plan.impact.ball_before.position[:2]
        wished = pin.rpy.rpyToMatrix(0.0, 0.0, -plan.heading) @ wished
        kick = self._turned(self._on_axes([*launch_axes(wished), *place]))
        kick = replace(kick, heading=kick.heading + plan.heading)
        return self._plan(kick, plan.aim, launch, path.air)

    def _plan(
        self,
        kick: "LibraryKick",
        goal: Goal,
        launch: Launch,
        air: Air | None,
        time: float | None = None,
    ) -> KickPlan:
        """Return a kick as a plan for a goal, whose flight takes a time [s]."""
        motion, impact, standing = kick.motion, kick.impact, self._standing
        if motion is None or impact is None:
            raise InvalidInput(f"the library has no kick for this goal: {kick.reason}")
        target = impact_target_for(kick.launch, np.zeros(3), impact.ball, impact.contact)
        speed_use, torque_use = (
            1.0 - min(margin for name, margin in kick.margins.items() if name.startswith(kind))
            for kind in ("speed of", "torque of")
        )
        columns = [self.robot.velocity_index(name) for name in motion.joints]
        times = np.linspace(motion.begin, motion.end, SAMPLES)
        use = np.array([motion.torque(t) for t in times])[:, columns]
        use /= self.robot.effort_limit[columns]
        plan = KickPlan(
            goal=goal,
            launch=launch,
            objective=KickObjective.TORQUE_SQUARED,
            value=float(trapezoid((use**2).mean(axis=1), times)),
            share=1.0,
            impact_target=target,
            impact=impact,
            path=path_to_target(impact, goal, air, None, None if kick.corrected_by else time),
            speed_use=speed_use,
            torque_use=torque_use,
            binding=(),
            ball_place=impact.ball_before.position,
            heading=0.0,
            balance=None if standing is None else Balance(standing).distance(impact.posture),
            motion=motion,
            corrected_by=kick.corrected_by,
        )
        return turn_plan(plan, kick.heading) if kick.heading else plan

    @cached_property
    def _ball(self) -> Ball:
        mass, radius, _ = self.reader.arrays["ball"]
        return Ball(mass=float(mass), radius=float(radius))

    def largest(self, elevation: float, azimuth: float, place: Array) -> tuple[float, str]:
        """Return the largest speed by `strike` in a direction, and why none is larger.

        Angles are in rad, the place of the ball has x and y, `(2,)` [m]. The speed is 0 m/s if the
        library has no kick in this direction.
        """
        reader, a = self.reader, self.reader.arrays
        if self._standing is not None:  # it can be turned
            azimuth = float(np.clip(azimuth, reader.lower[2], reader.upper[2]))
        point = self._on_axes([reader.upper[0], elevation, azimuth, *place])
        inside = (a["cell_lower"] - SAME <= point) & (point <= a["cell_upper"] + SAME)
        cells = inside[:, 1:].all(axis=1) & (a["cell_reasons"] == "")
        speed = float(a["cell_upper"][cells, 0].max(initial=0.0))
        if speed == reader.upper[0]:
            return speed, "it is the largest one of the library"
        point[0] = speed + SAME if speed else point[0]
        return speed, self._why_not(point).partition(";")[0]

    @styled()
    def plot(self) -> Any:
        """Return a figure of matplotlib: cells on two axes, with their least margins as shares.

        Cells with kicks are coloured, others are grey. Margins are those of limits that have a
        share, as torques, speeds and friction. Without two axes with a range it raises
        `InvalidInput`; of further axes, the middle is drawn. Lines on speeds and elevations are how
        far the ball flies in the air at 20 degrees, until it is as high as before [m].
        """
        from matplotlib.collections import PatchCollection
        from matplotlib.figure import Figure
        from matplotlib.patches import Rectangle

        from kickdyn.flight.batch import fly_many  # imports xarray

        reader, a = self.reader, self.reader.arrays
        if len(reader.active) < 2:
            raise InvalidInput("the library has no two axes with a range to draw it on")
        i, j = reader.active[:2].tolist()
        units = [180.0 / math.pi if UNITS[AXES[k]] == "rad" else 1.0 for k in (i, j)]
        middle = 0.5 * (reader.lower + reader.upper)
        inside = (a["cell_lower"] <= middle) & (middle <= a["cell_upper"])
        inside[:, [i, j]] = True
        shares = [not _unit(name) for name in reader.limits]
        figure = Figure(figsize=(7.5, 5.0))
        axes = figure.subplots()
        groups: dict[bool, list[Any]] = {True: [], False: []}
        margins = []
        for number in np.flatnonzero(inside.all(axis=1)):
            low, high = (a[end][number, [i, j]] * units for end in ("cell_lower", "cell_upper"))
            covered = not a["cell_reasons"][number]
            groups[covered].append(Rectangle(low, *(high - low)))
            if covered:
                margins.append(a["cell_margins"][number, shares].min(initial=np.inf))
        axes.add_collection(PatchCollection(groups[False], facecolor="0.8", hatch="//"))
        kicks = PatchCollection(groups[True], cmap="viridis", edgecolor="white")
        kicks.set_array(100.0 * np.array(margins))
        axes.add_collection(kicks)
        kicks.set_clim(0.0, max([1.0, *(100.0 * margin for margin in margins)]))
        figure.colorbar(kicks, label="least margin [% of the limit]")
        if (i, j) == (0, 1):
            grid = np.meshgrid(*np.linspace(reader.lower[:2], reader.upper[:2], 12).T)
            points = np.stack([*grid, 0.0 * grid[0]], axis=-1).reshape(-1, 3)
            launches = BallState(velocity=[launch_velocity(point) for point in points])
            lengths = fly_many(launches, self._ball, Air())["landing_position"].to_numpy()
            distance = np.hypot(*lengths.T[:2]).reshape(grid[0].shape)
            lines = axes.contour(grid[0], units[1] * grid[1], distance, colors="black")
            axes.clabel(lines, fmt="%.3g m")
        ends = [np.array([reader.lower[k], reader.upper[k]]) for k in (i, j)]
        labels = [f"{AXES[k]} [{UNITS[AXES[k]].replace('rad', 'deg')}]" for k in (i, j)]
        axes.set(xlim=units[0] * ends[0], ylim=units[1] * ends[1])
        axes.set(xlabel=labels[0], ylabel=labels[1])
        axes.set_title(f"{a['robot']}: kicks of the library")
        return figure

    def _why_not(self, point: Array) -> str:
        """Return why there is no kick at a point, and the nearest one."""
        reader = self.reader
        outside = [
            f"{name} is {_shown(name, value, value)}, outside of {_shown(name, low, high)}"
            for name, value, low, high in zip(AXES, point, reader.lower, reader.upper, strict=True)
            if not low - 1e-9 <= value <= high + 1e-9
        ]
        if not outside:
            a = reader.arrays
            inside = (a["cell_lower"] <= point) & (point <= a["cell_upper"])
            numbers = np.flatnonzero(inside.all(axis=1))
            outside = [f"not covered: {a['cell_reasons'][numbers[0]]}"] if len(numbers) else []
        nearest = reader.nearest(point)
        if nearest is None:
            return "; ".join(outside)
        near = ", ".join(
            f"{name} {_shown(name, nearest[k], nearest[k])}"
            for k, name in enumerate(AXES)
            if abs(nearest[k] - point[k]) > 1e-9
        )
        return f"{'; '.join(outside)}; the nearest kick has {near}"

    def motion_of(self, kick: InterpolatedKick) -> Motion:
        """Return the motion of the whole robot."""
        a, names, moving = self.reader.arrays, self.reader.joints, self.reader.arrays["moving"]
        before, after = (
            BSpline(a[f"{name}_knots"], a[f"{name}_matrix"] @ kick.coefficients, 3)
            for name in ("before", "after")
        )
        others = np.setdiff1d(np.arange(len(names)), moving).tolist()
        return Motion(
            self.robot,
            tuple(names[k] for k in moving.tolist()),
            before,
            after,
            None if self._standing is None else self._standing.placement,
            aside={names[k]: float(a["resting"][k]) for k in others},
            pushed={names[k]: float(kick.v_after[k]) for k in others},
        )


@dataclass(frozen=True, eq=False, repr=False)
class LibraryKick(ReprMixin):
    """A kick of a library, or why there is none.

    Attributes:
        library: that has it.
        point: speed, elevation, azimuth of the launch and place of the ball, shape `(5,)` [m/s,
            rad, m].
        heading: angle by which the robot must be turned to the left [rad].
        reason: why there is no kick, and the nearest one; empty where there is one.
        interpolated: the motion at the impact, and its margins; None without one.
        corrected_by: `mujoco` if the ball is to have the wished launch there, by another one by
            `strike`, that of `point`; otherwise empty.
    """

    library: KickLibrary = field(repr=False)
    point: Array
    heading: float
    reason: str
    interpolated: InterpolatedKick | None = field(repr=False)
    corrected_by: str = ""

    def __post_init__(self) -> None:
        freeze_arrays(vars(self))

    def _rows(self) -> Iterable[Row]:
        yield "status", "met" if self.met else f"none: {self.reason}", ""
        for name, value in zip(AXES, self.point, strict=True):
            yield name, _shown(name, value, value), ""
        yield "heading", math.degrees(self.heading), "deg"
        if self.corrected_by:
            yield "corrected by", self.corrected_by, ""
        for unit, row in {"": "least margin", "m": "least distance", "rad": "least angle"}.items():
            margins = {name: value for name, value in self.margins.items() if _unit(name) == unit}
            if margins:
                nearest = min(margins, key=margins.__getitem__)
                value = f"{margins[nearest]:.4g} {unit}".rstrip()
                yield row, f"{value}, {nearest.split(' [')[0]}", ""

    def to_json(self) -> dict[str, Any]:
        """Return the launch, the place of the ball and the margins."""
        place = dict(zip(AXES, self.point.tolist(), strict=True))
        return attributes(self, "met reason heading margins corrected_by") | place

    @property
    def met(self) -> bool:
        """Whether there is a kick."""
        return self.interpolated is not None

    @property
    def margins(self) -> dict[str, float]:
        """Least distance from each limit among the motions checked around it."""
        return {} if self.interpolated is None else self.interpolated.margins

    @property
    def launch(self) -> Array:
        """Velocity of the ball in the axes of the library, shape `(3,)` [m/s]."""
        return launch_velocity(self.point)

    @cached_property
    def motion(self) -> Motion | None:
        """The motion of the robot, in the axes of the library; None without one."""
        kick = self.interpolated
        return None if kick is None else self.library.motion_of(kick)

    @cached_property
    def impact(self) -> Impact | None:
        """The impact by `strike`; None without a motion."""
        if (motion := self.motion) is None:
            return None
        restitution, friction = self.library.reader.arrays["impact"].tolist()
        contact = Contact(self.launch, restitution=restitution, friction=friction)
        posture = motion.robot.posture(motion.q(0.0))
        return strike(posture, motion.v(0.0), self.library._ball, contact)


def _shown(axis: str, low: float, high: float) -> str:
    """Return a range of an axis, or its single value, with the unit; angles in degrees."""
    is_angle = UNITS[axis] == "rad"
    ends = np.degrees([low, high]) if is_angle else np.array([low, high])
    unit = "deg" if is_angle else UNITS[axis]
    return f"{ends[0]:.4g} to {ends[1]:.4g} {unit}" if high > low else f"{ends[0]:.4g} {unit}"


def _unit(margin: str) -> str:
    """Return the unit in the name of a margin; empty for a share of a limit."""
    if margin == "the tilt of the trunk":
        return "cosine"
    return margin.partition(" [")[2].removesuffix("]")
