"""What kickdyn sees in a file, what is wrong with it, and the commands that come next."""

import math
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial

from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.core.files import FileName, attributes, check_file, plain, read_text, read_toml
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import FaultyFile, InvalidInput, printable
from kickdyn.identification.body_track import TRANSLATION, BodyTrack
from kickdyn.identification.fit_motion import check_angle
from kickdyn.identification.segments import segments
from kickdyn.identification.track import (
    LARGEST_FILE,
    METRES,
    MOST_TITLES,
    SEPARATORS,
    TIME,
    Track,
    c3d_content,
    cells_of,
)
from kickdyn.robot.catalog import TOE
from kickdyn.robot.constraints import Support, find_open_loops
from kickdyn.robot.foot_surfaces import kick_with
from kickdyn.robot.ground_clearance import body_frames, find_unread
from kickdyn.robot.leg import Leg, read_leg
from kickdyn.robot.leg_model import load_drives
from kickdyn.robot.mjcf_file import body_name, is_mjcf, read_mjcf
from kickdyn.robot.mjcf_model import build_mjcf_model
from kickdyn.robot.model_validation import facing_doubts
from kickdyn.robot.names import FOOT_WORDS, listed
from kickdyn.robot.robot_file import RobotFile
from kickdyn.robot.standing import StandingRobot, joint_spheres
from kickdyn.robot.surgery import has_floating_base
from kickdyn.robot.urdf_file import build_model, read_urdf
from kickdyn.scene.toml_reader import load_scene

AXES = {"x": (1.0, 0.0), "y": (0.0, 1.0), "-x": (-1.0, 0.0), "-y": (0.0, -1.0)}
"""Horizontal axes that a robot may face, as for `Leg.from_urdf`, and their directions."""

FRICTION = 0.7
"""Coefficient of friction under the supporting foot of the commands."""

AHEAD = 1.2
"""Least ratio of what a foot reaches ahead of its last joint and behind it."""

SWEPT = 40.0
"""Largest angle of the posture sweep to either side of 0 [deg]."""

GAP = 1.5
"""Time between samples, as a multiple of the median, that is a gap."""

NO_AXES = {
    "ball", "pos", "position", "centre", "center", "m", "s", "sec", "mm", "cm", "ms", "ft", "in",
}  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class FileCheck(ReprMixin):
    """What `check` says of a file.

    Attributes:
        kind: what the file has, such as `robot`; empty where it cannot be read.
        rows: name, value and unit of each line about its content.
        problems: a line for each fault, with its remedy; none where the file can be used.
        commands: what to run next.
    """

    kind: str
    rows: tuple[Row, ...]
    problems: tuple[str, ...]
    commands: tuple[str, ...]

    def _rows(self) -> Iterable[Row]:
        yield "kind", self.kind or "unknown", ""
        yield from self.rows
        yield from (("problem", line, "") for line in self.problems)
        yield from (("next", line, "") for line in self.commands)

    def to_json(self) -> dict[str, Any]:
        """Return the lines with their numbers, in the units that they name."""
        rows = [{"name": name, "value": plain(x), "unit": unit} for name, x, unit in self.rows]
        return attributes(self, "kind problems commands") | {"rows": rows}


class _Found:
    def __init__(self, path: str, folders: tuple[str, ...]) -> None:
        self.kind, self.path, self.folders = "", path, folders
        self.rows, self.problems, self.commands = list[Row](), list[str](), list[str]()

    def add(self, name: str, value: object, unit: str = "") -> None:
        self.rows.append((name, value, unit))

    def propose(self, *words: str) -> None:
        self.commands.append(shlex.join(["kickdyn", *words]))

    def name_fit(self, read: str, what: str) -> None:
        call = f"kd.fit_motion(kd.BodyTrack.{read}({self.path!r}), leg, {what}={{...}})"
        self.add("in Python", f"{call} is the motion of a leg")


@validation.check_arguments
def check(path: FileName, package_dirs: Iterable[FileName] = ()) -> FileCheck:
    """Return what kickdyn sees in a file: a robot, markers, joint angles, a ball track or a scene.

    Args:
        path: a URDF or MJCF (`.urdf`, `.xml`, `.mjcf`), markers (`.c3d`, `.trc`), joint angles
            (`.mot`, `.sto`), a ball track (`.csv`) or a scene (`.toml`).
        package_dirs: ROS packages with meshes of a robot, as for `Leg.from_urdf`.

    Faults of the file are in `FileCheck.problems` and raise nothing.

    Example:
        >>> import kickdyn as kd
        >>> kd.check("missing.csv").problems
        ('there is no such file',)
    """
    name = str(path)
    found = _Found(name, tuple(map(str, package_dirs)))
    try:
        check_file(path, name, LARGEST_FILE, FaultyFile)
        ending = Path(path).suffix.lower()
        if ending not in READERS:
            raise InvalidInput(f"its name must end in {', '.join(READERS)}, whichever it is")
        found.kind, read = READERS[ending]
        with np.errstate(all="ignore"):  # a file may have numbers of any size
            read(found)
    except InvalidInput as error:
        source = error.source if isinstance(error, FaultyFile) else printable(name)
        where = "" if source == printable(name) else f"{source}: "  # of a file that it includes
        found.problems += [where + fault for fault in error.faults]
    return FileCheck(found.kind, tuple(found.rows), tuple(found.problems), tuple(found.commands))


def _check_robot(found: _Found) -> None:
    file, model = _read_robot(found)
    floats = model.njoints > 1 and has_floating_base(model)
    if model.njoints == 1 + floats:
        raise InvalidInput("it has no moving joint, and a kick moves some")
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    places = np.array([placement.translation for placement in data.oMi])
    ends = sorted(set(range(1, model.njoints)) - set(model.parents))
    # share of the robot's height by which its feet may differ in height while all joints are at 0
    highest = min(places[end, 2] for end in ends) + 0.05 * np.ptp(places[1:, 2])
    feet = {_foot_name(file, model, end): end for end in ends if places[end, 2] <= highest}
    seen = Leg(model, next(iter(feet)), file)
    found.add("robot", seen.name)
    found.add("mass", sum(body.mass for body in model.inertias), "kg")
    _add_joints(found, seen)
    found.add("feet", ", ".join(feet))
    for name, end in feet.items():
        apart = set(feet.values()) - {end}
        alone = [j for j in model.supports[end] if j and not apart & set(model.subtrees[j])]
        top = alone[1 if floats and alone[0] == 1 else 0]  # below the base
        moved = sum(model.inertias[joint].mass for joint in model.subtrees[top])
        found.add(f"mass of the leg of {name}", moved, "kg")
    rotors = np.count_nonzero(model.armature)
    none = "none: --drives FILE gives rotor inertias, which make the foot heavier, and limits"
    found.add("drives", f"rotor inertias of {rotors} joints" if rotors else none)
    axis = _facing(found, seen, len(feet))
    _check_meshes(found, seen)

    left = np.array([-AXES[axis][1], AXES[axis][0]])  # the right foot kicks
    frame, *others = sorted(feet, key=lambda name: (name != TOE, places[feet[name], :2] @ left))

    def loaded(base: str) -> Leg:
        leg = read_leg(found.path, frame, base, found.folders, facing=axis)
        return replace(leg, file=file)  # whose meshes were read

    leg = loaded("fixed")
    found.rows += (("note", line, "") for line in leg.warnings if line not in leg.open_loops)
    kicking = frame
    if frame != TOE:
        try:
            leg, kicking = kick_with(leg, "toe"), f"{frame}:toe"
        except InvalidInput as fault:
            found.add("note", f"the origin of {frame} kicks, because {fault}")
    found.add("kicks with", kicking)
    options = ["--leg", found.path, *([] if frame == TOE else ["--frame", kicking])]
    options += [] if axis == "x" else ["--facing", axis]
    options += [word for folder in found.folders for word in ("--package-dir", folder)]
    loops = find_open_loops(leg.model, leg.workspace.data)
    for first, second in loops:
        found.add("loop", f"{first} and {second} are at one place: --loop joins them")
        options += ["--loop", f"{first}:{second}"]
    support: list[str] = []
    for other in others if floats else ():
        try:
            StandingRobot(loaded("floating").with_supports(Support(other, friction=FRICTION)))
        except InvalidInput as fault:
            found.add("does not stand on", f"{other}: {fault}")
        else:
            found.add("stands on", other)
            support = support or ["--support", f"{other}:{FRICTION}"]
    swept, page = _swept(leg), ["--view", "kick.html"]
    limb = {leg.joint_names[joint - 1] for joint in leg.model.supports[leg.contact_joint] if joint}
    if loops or leg.loops:
        found.add("note", "kicks are planned for legs without loops only")
    elif mimics := [m for m in leg.mimics if {m.joint, m.driver} & limb]:
        remedy = f"--lock {mimics[0].driver}=VALUE locks {mimics[0].joint} too"
        found.add("note", f"kicks are planned without mimic joints in the kicking limb: {remedy}")
    else:
        found.propose("plan", *options, *support, "--distance", "1", "--time", "0.4", *page)
        found.propose("reach", *options, *support, "--elevation", "20", "--tolerance", "0.2")
    if swept:
        found.propose("posture-sweep", *options, *swept, *page)


def _read_robot(found: _Found) -> tuple[RobotFile, Any]:
    """Return a robot's file and its whole `pin.Model`, on a floating base where it may have one."""
    if not is_mjcf(found.path):
        file = read_urdf(found.path, found.folders)
        return file, build_model(file.text, file.source, "floating")
    read = read_mjcf(found.path, found.folders)
    compiled = read.compile()
    moving = [body for body in range(compiled.nbody) if compiled.body_weldid[body]]
    roots = Counter(compiled.body_rootid[moving].tolist())  # others are objects of a scene
    body = max(moving, key=lambda body: roots[int(compiled.body_rootid[body])], default=0)
    foot = body_name(compiled, body)
    try:
        return build_mjcf_model(read, foot, "floating", None)[:2]
    except InvalidInput:  # joints of the file move its root, or it has a fault
        return build_mjcf_model(read, foot, "fixed", None)[:2]


def _foot_name(file: RobotFile, model: Any, joint: int) -> str:
    """Return a frame that a joint moves: toe, else a body with shapes, or named as a foot."""
    shaped = file.visuals_by_frame | file.collisions_by_frame

    def rank(frame: Any) -> tuple[bool, ...]:
        sounds = any(word in frame.name.lower() for word in FOOT_WORDS)
        body = frame.type == pin.FrameType.BODY
        return (frame.name != TOE, not body, frame.name not in shaped, not sounds)

    return str(min((f for f in model.frames if f.parentJoint == joint), key=rank).name)


def _add_joints(found: _Found, leg: Leg) -> None:
    driven = {mimic.joint: mimic for mimic in leg.mimics}
    for name in leg.single_joints:
        index, slides = leg.velocity_index(name), leg.joint_unit(name) == "m"
        unit, scale = ("m", 1.0) if slides else ("deg", math.degrees(1.0))
        low, high = (scale * end for end in leg.joint_range(name))
        text = f"{low:.4g} to {high:.4g} {unit}"
        effort, speed = leg.effort_limit[index], leg.velocity_limit[index]
        text += f", {effort:.4g} {'N' if slides else 'N m'}" if effort < math.inf else ""
        text += f", {speed:.4g} {'m/s' if slides else 'rad/s'}" if speed < math.inf else ""
        if name in driven:
            _, driver, multiplier, offset, higher = driven[name]
            text += f", moves {multiplier:.4g} times as {driver}" if not higher else ""
            text += f" from {scale * offset:.4g} {unit}" if offset and not higher else ""
            with np.printoptions(precision=4):
                series = f"{Polynomial([offset, multiplier, *higher]):ascii}"
            text += f", is {series} in SI units, with x of {driver}" if higher else ""
        found.add(f"joint {name}", text)


def _facing(found: _Found, leg: Leg, feet: int) -> str:
    """Return the axis that a robot faces, the one that its foot reaches farthest along."""
    model, joint = leg.model, leg.contact_joint
    doubts, data = facing_doubts(model, joint) if feet == 2 else (), model.createData()
    pin.forwardKinematics(model, data, leg.configuration())
    shapes = joint_spheres(leg, joint)
    points = np.vstack([shapes.centres, leg.contact_lever]) @ data.oMi[joint].rotation.T
    radii = np.append(shapes.radii, 0.0)
    reach = {axis: float((points[:, :2] @ way + radii).max()) for axis, way in AXES.items()}
    axes = ("y", "-y") if doubts else tuple(AXES) if feet == 1 else ("x", "-x")
    axis = max(axes, key=reach.__getitem__)
    behind = axis.removeprefix("-") if axis.startswith("-") else f"-{axis}"
    if feet > 2 or not reach[axis] > AHEAD * reach[behind]:
        found.add("faces", "x is assumed: its feet do not show it")
        found.problems += doubts
        return "x"
    found.add("faces", axis)
    turn = f"it faces {axis}, but kicks are along x: facing={axis!r} (--facing {axis}) turns it"
    if axis != "x" and feet == 2:
        found.problems.append(turn)
    elif axis != "x":  # the end of an arm may have any direction
        found.add("note", f"if this is a leg, {turn}")
    return axis


def _check_meshes(found: _Found, leg: Leg) -> None:
    reasons = {name: why for name in body_frames(leg) if (why := find_unread(leg, name))}
    if reasons:
        name, *others = reasons
        more = f"; nor can those of {listed(others, 5)}" if others else ""
        known = "--package-dir" in reasons[name]
        remedy = "" if known else "; --package-dir (package_dirs) names the folder of the meshes"
        found.problems.append(f"the shape of {name} cannot be read ({reasons[name]}){more}{remedy}")


def _swept(leg: Leg) -> list[str]:
    """Return ranges of the two joints that move the foot fastest along x, for a posture sweep.

    If none moves it along x, they move it fastest. Other joints are at 0, or where their range
    comes nearest to it. There are none if no joint can be swept.
    """
    jacobian = leg.posture(leg.configuration()).jacobian
    along = np.abs(jacobian[0])
    speeds = along if along.max() > 1e-9 else np.linalg.norm(jacobian, axis=0)
    ranges, values = dict[str, float](), list[str]()
    for name in leg.single_joints:
        scale = math.degrees(1.0) if (turns := leg.joint_unit(name) == "rad") else 1.0
        ends = np.round([scale * end for end in leg.joint_range(name)], 6)
        low, high = (math.ceil(max(ends[0], -SWEPT)), math.floor(min(ends[1], SWEPT)))
        if name in {mimic.joint for mimic in leg.mimics}:
            continue
        # a name in a dataset has no "/"
        if turns and "/" not in name and low < high and speeds[leg.velocity_index(name)]:
            ranges[name] = float(speeds[leg.velocity_index(name)])
            values.append(f"{name}={low}:{high}:10")
        if not ends[0] <= 0.0 <= ends[1]:
            nearest = float(min(ends, key=abs))
            inside = math.ceil if nearest > 0.0 else math.floor  # rounded into the range
            values.append(f"{name}={inside(1e4 * nearest) / 1e4:.10g}")
    fastest = sorted(ranges, key=lambda name: -ranges[name])[:2]
    chosen = [text for text in values if (":" in text) == (text.rpartition("=")[0] in fastest)]
    return [word for text in chosen for word in ("--joint", text)] if fastest else []


def _check_markers(found: _Found) -> None:
    ending = Path(found.path).suffix.lower()
    if ending == ".c3d":
        labels, scale, rate, first, data = c3d_content(found.path)
        unit = next(unit for unit, size in METRES.items() if size == scale)
        positions = scale * data[: len(labels)].transpose(1, 0, 2)
        track = BodyTrack((first + np.arange(len(positions))) / rate, labels, positions)
        balls = [name for name in labels if "ball" in name.lower()]
        never = {name for name, gaps in track.gaps.items() if len(gaps) == len(track)}
        balls = [name for name in balls if name not in never]
        if balls or (len(labels) == 1 and not never):
            found.propose("identify", found.path, *(["--marker", balls[0]] if balls else []))
        found.problems += [
            f"{labels.count(name)} markers are named {name}: none of them can be asked for"
            for name in dict.fromkeys(labels) if labels.count(name) > 1
        ]  # fmt: skip
    else:
        track = BodyTrack.from_trc(found.path)
        lines = read_text(found.path, found.path, LARGEST_FILE, FaultyFile).splitlines()
        unit = next(word for word in lines[2].lower().split() if word in METRES)
    found.problems += track.warnings
    if not np.isfinite(track.positions).all(axis=2).any():
        found.problems.append("no marker is seen in any frame")
    found.add("markers", ", ".join(track.markers))
    found.add("unit in the file", unit)
    _add_times(found, "frames", track.times)
    for name, frames in track.gaps.items():
        first, last = track.times[[frames[0], frames[-1]]]
        found.add(f"gaps of {name}", len(frames), f"frames, {first:.4g} to {last:.4g} s")
    found.name_fit(f"from_{ending[1:]}", "markers")
    if len(track) < 2:
        return
    speeds = np.linalg.norm(np.gradient(track.positions, track.times, axis=0), axis=2)
    ball = np.array(["ball" in name.lower() for name in track.markers], dtype=bool)
    for what, among in (("of the body", ~ball), ("of the ball", ball)):
        some = np.where(among & np.isfinite(speeds), speeds, -1.0)
        frame, marker = np.unravel_index(np.argmax(some), some.shape)
        if some[frame, marker] >= 0.0:
            speed = f"{some[frame, marker]:.4g} m/s at {track.times[frame]:.4g} s"
            found.add(f"fastest marker {what}", f"{track.markers[marker]}, {speed}")


def _check_angles(found: _Found) -> None:
    track = BodyTrack.from_mot(found.path)
    found.problems += track.warnings
    _add_times(found, "rows", track.times)
    for name, values in track.angles.items():
        known = values[np.isfinite(values)]
        if known.size and re.search("force|torque|moment|_[pv][xyz]$", name, re.IGNORECASE):
            found.add(f"column {name}", np.array([known.min(), known.max()]))
        elif known.size:
            ends = np.array([known.min(), known.max()])
            slides = TRANSLATION.search(name)
            found.add(f"coordinate {name}", *(ends, "m") if slides else (np.degrees(ends), "deg"))
            if not slides:
                try:
                    check_angle(track, name)
                except InvalidInput as error:
                    found.problems.append(str(error))
        if known.size < values.size:
            found.add(f"gaps of {name}", values.size - known.size, "rows")
    found.name_fit("from_mot", "angles")


def _check_ball(found: _Found) -> None:
    with Path(found.path).open(encoding="utf-8-sig", errors="replace", newline="") as file:
        lines = [file.readline(10_000).lstrip("#% ") for _ in range(MOST_TITLES)]
    columns = list[str]()
    for header in (cells_of(line, separator) for line in lines for separator in SEPARATORS):
        guessed = [[name for name in header if _axis(name) == axis] for axis in "txyz"]
        if not columns and all(len(names) == 1 for names in guessed):
            columns = [name for (name,) in guessed]
    usual = not columns or columns == [*"txyz"]
    track = Track.from_csv(found.path) if usual else Track.from_csv(found.path, columns)
    found.add("columns", "t, x, y, z" if usual else ", ".join(columns))
    _add_times(found, "samples", track.times)
    found.add("lowest corner", track.positions.min(axis=0), "m")
    found.add("highest corner", track.positions.max(axis=0), "m")
    found.rows += (("note", line, "") for line in track.warnings)
    split = segments(track, Ball())
    bounded = split.friction is not None and split.friction.is_lower_bound  # says the last line
    doubts = split.warnings[: -1 if bounded else None]
    found.problems += (line for line in doubts if line not in track.warnings)
    found.add("flights", len(split.flights))
    if split.flights:
        longest = max(split.flights, key=lambda flight: flight.duration)
        found.add("longest flight", longest.duration, f"s, from {longest.times[0]:.4g} s")
    words = [] if usual else ["--columns", ",".join(columns)]
    found.propose("identify", found.path, *words, "--plot", "flight.png")


def _axis(name: str) -> str:
    """Return which of t, x, y and z the name of a column means, without units; or nothing."""
    words = set(re.findall("[a-z]+", name.lower())) - NO_AXES
    word = words.pop() if len(words) == 1 else ""
    return "t" if word in TIME else word


def _add_times(found: _Found, what: str, times: Array) -> None:
    found.add(what, len(times))
    found.add("duration", float(times[-1] - times[0]), "s")
    if len(times) < 2:
        return
    steps = np.diff(times)
    usual = float(np.median(steps))
    found.add("rate", 1.0 / usual, "Hz")
    gaps = np.flatnonzero(steps > GAP * usual)
    if gaps.size:
        largest = gaps[np.argmax(steps[gaps])]
        longest = f"the longest {steps[largest]:.4g} s, from {times[largest]:.4g} s"
        found.add("gaps in time", gaps.size, longest)


def _check_toml(found: _Found) -> None:
    if "joints" in read_toml(found.path):
        found.kind = "drives"
        for joint, drive in load_drives(found.path).items():
            found.add(joint, drive.reflected_inertia, "kg m2 at the joint")
        found.add("next", f"--drives {found.path} beside --leg gives them to a robot")
        return
    found.rows += load_scene(found.path)._rows()
    found.propose("simulate", found.path)
    found.propose("view", found.path, "--out", "kick.html")


ROBOT, MARKERS = ("robot", _check_robot), ("markers", _check_markers)
ANGLES = ("joint angles", _check_angles)
READERS: dict[str, tuple[str, Callable[[_Found], None]]] = {
    ".urdf": ROBOT, ".xacro": ROBOT, ".xml": ROBOT, ".mjcf": ROBOT,
    ".c3d": MARKERS, ".trc": MARKERS, ".mot": ANGLES, ".sto": ANGLES,
    ".csv": ("ball track", _check_ball), ".toml": ("scene", _check_toml),
}  # fmt: skip
"""What a file has, and the function that checks it, by the ending of its name."""
