"""Feeds kickdyn broken files and command lines: `python tools/fuzz.py --seconds 600`.

Whatever comes in, an answer or one clear refusal comes out: no other exception, no traceback, no
crash of the process, no hang, no memory that grows. Each input runs in a child process with limited
memory that the parent watches. What went wrong is kept in `tests/corpus`, whose files the tests
feed again, and ends the program with exit code 1.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import multiprocessing as mp
import os
import random
import re
import resource
import shutil
import sys
import tempfile
import time
import traceback
import zipfile
from array import array
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kickdyn import Leg

ROOT = Path(__file__).resolve().parent.parent
CORPUS = ROOT / "tests" / "corpus"
EXTRA_TIME = {"cli": 60.0, "c3d": 600.0}
"""What a kind of input may take longer [s]: a process starts, or is stopped after this time."""

TIMEOUT = 20.0
"""Longest that one input may take [s]; most take milliseconds."""

MEMORY = 2_000_000_000
"""Largest memory of a child [bytes]."""

GROWTH = 150
"""Most that children may grow by after the first third of the inputs [MB]: caches fill, leaks go
on."""

WEIGHTS = {
    **{"urdf": 250, "mjcf": 100, "mesh": 200, "scene": 40, "csv": 200, "c3d": 2},
    **{"netcdf": 10, "zarr": 4, "cli": 10, "trc": 60, "mot": 60, "drives": 60, "reach": 60},
    **{"motion": 60},
}
"""How often each kind of input is drawn: what takes long is rare."""

NUMBERS = [
    *("nan", "inf", "-inf", "0", "-0.0", "-1", "1e-320", "1e-300", "1e300", "1e999", "1e15"),
    *("1e308", "-1e308", "1e-308", "1e155", "1e-145", "1.7976931348623157e308"),
    *("9" * 5000, "0x10", "1_000", "١٢", "1,5", "1e", "--3", "", "true", "null", "1 2 3", "3.14"),
]
NAMES = [
    "<script>alert(1)</script>",
    "",
    " ",
    "a\x00b",
    "x" * 5000,
    "\x1b[31m",
    "[bold]",
    "../../etc",
]
NAMES += [
    "universe",
    "root_joint",
    "/etc/passwd",
    "file:///etc/passwd",
    "ü",
    "\u202e",
    "%s%n",
    "{}",
]


def seeds(kind: str) -> list[str]:
    """Return good files to begin with; of binary files, a letter per byte."""
    if kind == "mesh":
        return meshes()
    if kind == "mjcf":
        return [MJCF, COUPLED, *(file.read_text("utf-8") for file in mjcf_models())]
    if kind == "csv":
        semicolons = CSV.replace(",", ";").replace(".", ",").replace("x", "x [mm]")
        titled = f"# a ball\nof a match\n{CSV}".replace("\n0.00", "\ns,m,m,m\n0.00")
        return [CSV, CSV.replace(",", " , "), CSV.replace("\n", "\r\n"), semicolons, titled]
    if kind == "c3d":
        return [c3d()]
    if kind in ("netcdf", "zarr"):
        return sweeps(kind)
    if kind in ("trc", "mot", "reach"):
        packed = TRC.replace("\tm\t", "\tmm\t").replace("knee\t\t\t", "knee\t")
        states = MOT.replace("hip", "/hip/hip_r/value").replace("\t", "  ").replace("0.", "0,")
        return {"trc": [TRC, packed], "mot": [MOT, states], "reach": [reach()]}[kind]
    if kind == "motion":
        return motions()
    if kind == "drives":
        return [file.read_text("utf-8") for file in sorted((ROOT / "drives").glob("*.toml"))]
    files = sorted((ROOT / "urdf").glob("*.urdf")) if kind == "urdf" else scenes()
    texts = [file.read_text("utf-8") for file in files]
    return [*texts, with_gear(texts[-1]), XACRO] if kind == "urdf" else texts


def with_gear(text: str) -> str:
    """Return a URDF text whose last joint follows its first one, all of them continuous."""
    names = re.findall(r'<joint name="([^"]*)" type="revolute"', text)
    gear = f'<mimic joint="{names[0]}" multiplier="-0.5" offset="0.1"/></joint>'
    start = text.index("</joint>", text.index(f'<joint name="{names[-1]}"'))
    text = text[:start] + gear + text[start + len("</joint>") :]
    return text.replace("revolute", "continuous")


XACRO = """<robot name="leg" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:property name="length" value="0.4"/><xacro:include filename="foot.xacro"/>
<xacro:macro name="limb" params="name *origin"><link name="${name}"/></xacro:macro>
<xacro:limb name="thigh"><origin xyz="0 0 ${-length}"/></xacro:limb></robot>"""

COUPLED = """<mujoco model="arm"><compiler angle="radian"/>
<worldbody><body name="upper"><joint name="a" axis="0 1 0"/><geom size="0.1" pos="0 0 -0.3"/>
<body name="lower" pos="0 0 -0.4"><joint name="b" axis="0 1 0" ref="0.2" range="-2 2"/>
<geom size="0.05" pos="0 0 -0.2"/><body name="foot" pos="0 0 -0.4">
<joint name="c" type="slide" axis="1 0 0" limited="false"/><joint name="d" axis="0 0 1"/>
<geom size="0.04"/></body></body></body></worldbody>
<tendon><fixed name="both"><joint joint="a" coef="1"/><joint joint="b" coef="-2"/></fixed></tendon>
<equality><joint joint1="b" joint2="a" polycoef="0.1 -0.5 0.2 0 0.01"/>
<joint joint1="c" joint2="b" polycoef="0 0.1 0 0 0"/><weld body1="foot" active="false"/>
<tendon tendon1="both" active="false"/></equality>
<actuator><position tendon="both" kp="3" forcerange="-2 2"/></actuator></mujoco>"""

MJCF = """<mujoco model="robot"><compiler angle="radian" autolimits="true" eulerseq="zyx"/>
<option gravity="0 0 -9.81"/>
<default><joint armature="0.01" range="-2 2"/><default class="light"><geom density="10"/></default>
</default>
<asset><material name="paint" rgba="1 0 0 1"/><mesh name="box" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
</asset>
<worldbody><body name="base" pos="0 0 1" childclass="light"><freejoint/><geom size="0.1"/>
<body name="leg" euler="0 0.1 0"><joint axis="0 1 0" actuatorfrcrange="-20 20"/>
<inertial pos="0 0 -0.2" mass="3" fullinertia="0.1 0.1 0.05 0 0 0"/>
<site name="knee" pos="0 0 -0.4"/><site name="hip"/>
<body name="foot" pos="0 0 -0.4"><joint name="ball" type="ball" pos="0 0 0.01" range="0 2"/>
<joint name="slide" type="slide" axis="1 0 0" ref="0.1"/>
<geom type="capsule" size="0.03" fromto="0 0 0 0.2 0 0" material="paint"/>
<geom type="mesh" mesh="box"/></body></body>
<replicate count="2" offset="0.1 0 0" euler="0 0 1"><frame pos="0 0.1 0"><body name="arm">
<joint/><geom type="box" size="0.1 0.02 0.03"/></body></frame></replicate></body></worldbody>
<equality><connect body1="arm0" body2="arm1" anchor="0 0 0"/></equality>
<tendon><spatial><site site="knee"/><site site="hip"/></spatial></tendon>
<actuator><motor joint="slide" gear="3" ctrlrange="-1 1"/></actuator></mujoco>"""


CSV = "t,x,y,z\n" + "".join(
    f"{0.02 * k:.2f},{0.4 * k:.3f},{0.01 * k:.3f},{0.11 + 0.2 * k - 0.002 * k * k:.4f}\n"
    for k in range(40)
)


TRC = (
    "PathFileType\t4\t(X/Y/Z)\tbody.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
    "100\t100\t20\t2\tm\t\nFrame#\tTime\tknee\t\t\tankle\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
) + "".join(f"{k}\t{0.01 * k:.2f}\t0.1\t{0.5 + k / 99:.3f}\t0\t\t0.1\t{k}\n" for k in range(20))
"""A file of markers, with a gap."""

MOT = "angles\nversion=1\nnRows=20\nnColumns=4\ninDegrees=yes\nendheader\n" + "".join(
    ["time\thip\tknee\tpelvis_tx\n", *(f"{k / 100}\t{2 * k}\t{-k}\t0.01\n" for k in range(20))]
)
"""A file of joint angles."""


def motions() -> list[str]:
    """Return motions of the human leg: CSV with and without names, and NPZ."""
    import numpy as np

    t = np.arange(20)[:, None] / 50.0
    angles = 0.3 + 0.2 * np.sin(t * [[5.0, 7.0, 9.0]])
    text = "\n".join(",".join(f"{x:.6f}" for x in row) for row in angles)
    names = ["hip", "knee", "ankle"]
    packed = io.BytesIO()
    np.savez(packed, fps=50.0, joint_names=np.array(names), joint_pos=angles, joint_vel=0 * angles)
    return [text, f"{','.join(names)}\n{text}", packed.getvalue().decode("latin-1")]


def reach() -> str:
    """Return a table of the largest launches, as a computation that is resumed reads it."""
    import kickdyn as kd

    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder, "table.csv")
        kd.reach(kd.Leg.human(), kd.Ball(), None, file=table, **REACH)  # type: ignore[arg-type]
        return table.read_text("utf-8")


REACH = {"azimuths": (0.0,), "elevations": (30.0,), "tolerance": 0.5}
"""Directions of the table."""


def c3d() -> str:
    """Return a C3D file with one marker."""
    import ezc3d
    import numpy as np

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = ("ball",)
    file["parameters"]["POINT"]["UNITS"]["value"] = ("m",)
    points = np.ones((4, 1, 30))
    points[0, 0] = np.linspace(0.0, 3.0, 30)
    file["data"]["points"] = points
    with tempfile.TemporaryDirectory() as folder:
        file.write(f"{folder}/ball.c3d")
        return Path(folder, "ball.c3d").read_bytes().decode("latin-1")


def sweeps(kind: str) -> list[str]:
    """Return a small sweep as a netCDF file, or the files of a Zarr store.

    Each file of a store comes after a line with its name.
    """
    import kickdyn as kd

    postures = {"hip": [0.1, 0.3], "knee": [0.2], "ankle": [0.0]}
    kick = kd.Kick(speed=5.0, air=None)
    data = kd.sweep(kd.Leg.human(), postures, kick)
    with tempfile.TemporaryDirectory() as folder:
        if kind == "netcdf":
            data.to_netcdf(f"{folder}/sweep.nc", engine="h5netcdf")
            return [Path(folder, "sweep.nc").read_bytes().decode("latin-1")]
        data.to_zarr(f"{folder}/sweep.zarr", consolidated=False)
        root = Path(folder, "sweep.zarr")
        files = [file for file in root.rglob("*") if file.is_file()]
        return [
            f"{file.relative_to(root)}\n{file.read_bytes().decode('latin-1')}" for file in files
        ]


def mjcf_models() -> list[Path]:
    """Return models of gymnasium."""
    package = importlib.util.find_spec("gymnasium")
    assert package is not None
    assert package.origin is not None
    folder = Path(package.origin).parent / "envs" / "mujoco" / "assets"
    return [folder / name for name in ("hopper.xml", "ant.xml", "half_cheetah.xml")]


def scenes() -> list[Path]:
    """Return the scenes that are shipped."""
    return sorted((ROOT / "scenes").glob("*.toml"))


def meshes() -> list[str]:
    """Return a box in every format, and as a zip, a letter per byte after a line with the ending.

    COLLADA may be a zip, also one that stands in a comment of a file that is COLLADA as well.
    """
    import trimesh

    box = trimesh.creation.box((0.1, 0.2, 0.3))
    content = {ending: box.export(file_type=ending) for ending in ("obj", "ply", "stl", "dae")}
    content["stl "] = box.export(file_type="stl_ascii")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("manifest.xml", "<dae_root>a.dae</dae_root>")
        file.writestr("a.dae", content["dae"])
    content["dae "] = packed.getvalue()
    content["dae  "] = content["dae"].replace(
        b"<asset>", b"<!--" + packed.getvalue() + b"--><asset>"
    )
    return [
        f"{ending}\n{body if isinstance(body, str) else body.decode('latin-1')}"
        for ending, body in content.items()
    ]


def broken(draw: random.Random, texts: list[str]) -> str:
    """Return one of the texts with one to four things wrong."""
    text = draw.choice(texts)
    for _ in range(draw.randint(1, 4)):
        text = draw.choice([number, quoted, cut, doubled, spliced, typed, line, nested])(
            draw, text, texts
        )
    return text[:200_000]


def number(draw: random.Random, text: str, texts: list[str]) -> str:
    """Put something else where a number stands."""
    return swapped(draw, text, lambda c: c.isdigit() or c in ".-e", draw.choice(NUMBERS))


def quoted(draw: random.Random, text: str, texts: list[str]) -> str:
    """Put something else between two quotation marks."""
    marks = [place for place, letter in enumerate(text) if letter == '"']
    if len(marks) < 2:
        return text
    start = draw.randrange(len(marks) - 1)
    return text[: marks[start] + 1] + draw.choice(NAMES + NUMBERS) + text[marks[start + 1] :]


def cut(draw: random.Random, text: str, texts: list[str]) -> str:
    """Leave a piece out."""
    start = draw.randrange(len(text) + 1)
    return text[:start] + text[start + draw.randint(1, 200) :]


def doubled(draw: random.Random, text: str, texts: list[str]) -> str:
    """Say a piece again and again."""
    start, size = draw.randrange(len(text) + 1), draw.randint(1, 300)
    return (
        text[:start] + text[start : start + size] * draw.choice([2, 3, 50]) + text[start + size :]
    )


def spliced(draw: random.Random, text: str, texts: list[str]) -> str:
    """Put in a piece of another file."""
    other = draw.choice(texts)
    start, origin = draw.randrange(len(text) + 1), draw.randrange(len(other) + 1)
    return text[:start] + other[origin : origin + draw.randint(1, 400)] + text[start:]


def typed(draw: random.Random, text: str, texts: list[str]) -> str:
    """Change a letter into any other."""
    start = draw.randrange(len(text) + 1)
    return (
        text[:start]
        + chr(draw.choice([draw.randint(0, 127), draw.randint(0, 0xD7FF)]))
        + text[start + 1 :]
    )


def line(draw: random.Random, text: str, texts: list[str]) -> str:
    """Leave a line out, or say it twice."""
    lines = text.splitlines(keepends=True)
    if not lines:
        return text
    start = draw.randrange(len(lines))
    lines[start : start + 1] = [lines[start]] * draw.choice([0, 2])
    return "".join(lines)


def nested(draw: random.Random, text: str, texts: list[str]) -> str:
    """Put in a line of deeply dotted keys, of empty elements, or of blanks."""
    size, start = (
        draw.choice([3, 40, 1000, 40_000]),
        draw.choice([0, text.find("\n") + 1, len(text)]),
    )
    new = draw.choice(["a." * size + "a = 1\n", "[" + "a." * size + "a]\n", "<a/>" * size,
                       "<a>" * size, " " * size, "a = " + "[" * size + "\n"])  # fmt: skip
    return text[:start] + new * draw.choice([1, 1, 3]) + text[start:]


def swapped(draw: random.Random, text: str, belongs: object, new: str) -> str:
    """Return the text with one run of letters that belong together replaced."""
    start = draw.randrange(len(text) + 1)
    while start < len(text) and not belongs(text[start]):  # type: ignore[operator]
        start += 1
    end = start
    while end < len(text) and belongs(text[end]):  # type: ignore[operator]
        end += 1
    return text[:start] + new + text[end:]


OPTIONS = {
    "posture-sweep": ["--leg", "--frame", "--joint", "--speed", "--attack", "--restitution",
                      "--friction", "--air", "--out", "--json", "--plot", "--view"],
    "plan": ["--distance", "--time", "--height", "--left", "--apex", "--launch-speed", "--over",
             "--arc", "--leg", "--objective", "--restitution", "--friction", "--spin", "--wind",
             "--ball-height", "--offset", "--ball-position", "--ball-velocity", "--meet-at",
             "--trap", "--pass", "--ball", "--json"],
    "simulate": ["--tolerance", "--exact", "--json"],
    "identify": ["--start", "--end", "--drag", "--columns", "--ground-height", "--ball", "--json"],
    "reach": ["--leg", "--frame", "--azimuth", "--elevation", "--tolerance", "--out", "--json"],
    "tradeoff": ["--scene", "--json", "--plot"],
    "paper": ["--only", "--json", "--figures"],
}  # fmt: skip
WORDS = ["human", "testbed", "hip=0:10:5", "knee=20", "hip=10:0:5", "knee=0:1:0", "nan=0",
         "hip=0:1e12:1e-9", "-", "out.nc", "out.zarr", "no/such/x.html", "x.png", ".", "/",
         "speed=0.02", "20", "1.5", "0.8", "1,2,3", "9:2", "low", "fig 8", "vacuum"]  # fmt: skip


def command(draw: random.Random) -> list[str]:
    """Return a command line; `tradeoff`, which takes long, always with a scene that is none."""
    name = draw.choice(list(OPTIONS))
    words = [name]
    if name == "tradeoff":
        words += ["--scene", draw.choice(["/dev/null", "no.toml", *NAMES[:3]])]
    if name in ("simulate", "identify"):
        words.append(draw.choice(["free_kick", "volley", "no.csv", "/dev/null", *NAMES[:3]]))
    if name == "reach":
        words += ["--tolerance", "0.5", "--elevation", draw.choice(["20", "400"])]
    if name == "paper":
        words += ["--only", draw.choice(["fig 8", *NAMES])]
    if name == "posture-sweep" and draw.random() < 0.7:
        words += ["--joint", "hip=0:20:10", "--joint", "knee=0:20:10", "--joint", "ankle=0"]
    for _ in range(draw.randint(0, 4)):
        words.append(draw.choice(OPTIONS[name]))
        if draw.random() < 0.9:
            words.append(draw.choice(WORDS + NAMES + NUMBERS).replace("\x00", ""))
    return words


def run(kind: str, what: str, folder: Path) -> bool | None:
    """Feed one input; anything but an answer or a refusal is an exception here.

    Meshes, tracks and sweeps return whether there was an answer.
    """
    feeds = {"urdf": run_urdf, "mjcf": run_mjcf, "mesh": run_mesh, "scene": run_scene}
    feeds |= {"csv": run_track, "c3d": run_track, "netcdf": run_sweep, "zarr": run_sweep}
    feeds |= {"cli": run_cli, "trc": run_body, "mot": run_body}
    feeds |= {"drives": run_drives, "reach": run_reach, "motion": run_motion}
    return feeds[kind](what, folder)


FACING = ("x", "y", "-x", "-y")
"""Axes along which robots face."""


def run_urdf(text: str, folder: Path) -> None:
    """Load a robot, and kick with it."""
    import kickdyn as kd

    file = folder / "robot.urdf"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    kicked(lambda: kd.Leg.from_urdf(file, facing=FACING[len(text) % 4]))


def run_mjcf(text: str, folder: Path) -> None:
    """Load the last body of a model, kick with it, and ask for its shapes."""
    import kickdyn as kd

    file = folder / "robot.xml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    names = re.findall(r'<body[^>]* name="([^"]*)"', text)
    base = "floating" if len(text) % 2 else "fixed"
    facing, frame = FACING[len(text) // 2 % 4], names[-1] if names else "toe"
    leg = kicked(lambda: kd.Leg.from_mjcf(file, frame, base=base, facing=facing))
    if leg is not None:
        leg.file.visuals()


def kicked(load: Callable[[], Leg]) -> Leg | None:
    """Return a leg that was loaded and kicked; None if it is refused."""
    import numpy as np

    import kickdyn as kd

    try:
        leg = load()
        posture = leg.posture(leg.close_loops(leg.configuration()))
        contact = kd.Contact((2, 0.3, 1), restitution=0.8, friction=0.4)
        v = posture.admissible(np.ones(leg.nv))
        hit = kd.strike(posture, v, kd.Ball(), contact)
    except kd.KickdynError as refusal:
        said = str(refusal)
        assert said, "a refusal says why"
        assert "\n" not in said, f"a refusal is one line: {said!r}"
        return None
    assert np.isfinite(hit.impulse).all(), "an answer is finite"
    assert np.isfinite(hit.joint_impulses).all(), "an answer is finite"
    return leg


def run_mesh(text: str, folder: Path) -> bool:
    """Read a mesh, whose first line is its ending."""
    import numpy as np

    import kickdyn as kd
    from kickdyn.robot.robot_file import PackageFiles, read_mesh

    ending, _, body = text.partition("\n")
    ending = ending.strip() if ending.strip() in ("obj", "ply", "stl") else "dae"
    (folder / f"mesh.{ending}").write_bytes(body.encode("latin-1", "replace"))
    try:
        surfaces = read_mesh(PackageFiles(folder), f"mesh.{ending}")
    except kd.KickdynError as refusal:
        said = str(refusal)
        assert said.isprintable(), f"a refusal is one line: {said!r}"
        return False
    assert all(np.isfinite(surface.vertices).all() for surface in surfaces), "an answer is finite"
    return True


def run_track(text: str, folder: Path) -> bool:
    """Read a measured track, a C3D file if it begins as one."""
    import numpy as np

    import kickdyn as kd

    is_c3d = text[1:2] == "P"
    file = folder / ("track.c3d" if is_c3d else "track.csv")
    content = text.encode("latin-1", "replace") if is_c3d else text.encode("utf-8", "surrogatepass")
    file.write_bytes(content)
    try:
        if is_c3d and len(text) % 2:
            return len(kd.BodyTrack.from_c3d(file)) > 0
        track = kd.Track.from_c3d(file) if is_c3d else kd.Track.from_csv(file)
    except kd.KickdynError as refusal:
        said = str(refusal)
        assert said.isprintable(), f"a refusal is one line: {said!r}"
        return False
    assert np.isfinite(track.positions).all(), "an answer is finite"
    assert (np.diff(track.times) > 0).all(), "times increase"
    return True


def run_body(text: str, folder: Path) -> bool:
    """Read the motion of a body: joint angles if the text has their header, otherwise markers."""
    import numpy as np

    import kickdyn as kd

    file = folder / "body.txt"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    read = kd.BodyTrack.from_mot if "endheader" in text.lower() else kd.BodyTrack.from_trc

    def check() -> None:
        track = read(file)
        str(track)
        for values in (track.positions, *track.angles.values()):
            assert not np.isinf(values).any(), "an answer is finite, or a gap"

    return refused_or(check)


def run_drives(text: str, folder: Path) -> bool:
    """Read drives, and give them to the human leg."""
    import kickdyn as kd

    file = folder / "drives.toml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    return refused_or(lambda: str(kd.Leg.human().with_drives(file)))


def run_motion(text: str, folder: Path) -> bool:
    """Read a motion of the human leg, an NPZ file if it begins as one."""
    import numpy as np

    import kickdyn as kd

    is_packed = text.startswith("PK")
    file = folder / ("motion.npz" if is_packed else "motion.csv")
    content = (
        text.encode("latin-1", "replace") if is_packed else text.encode("utf-8", "surrogatepass")
    )
    file.write_bytes(content)

    def check() -> None:
        motion = kd.read_motion(file, kd.Leg.human(), rate=None if is_packed else 50.0)
        str(motion)
        assert all(np.isfinite(values).all() for values in (motion.q, motion.v, motion.a))

    return refused_or(check)


def run_reach(text: str, folder: Path) -> bool:
    """Resume a table of the largest launches that lacks nothing, unless it is damaged."""
    import kickdyn as kd

    file = folder / "table.csv"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    leg = kd.Leg.human()
    return refused_or(lambda: kd.reach(leg, kd.Ball(), None, file=file, **REACH))  # type: ignore[arg-type]


def refused_or(read: Callable[[], object]) -> bool:
    """Return whether there was an answer; a refusal has printable lines."""
    import kickdyn as kd

    try:
        read()
    except kd.KickdynError as refusal:
        lines = refusal.faults if isinstance(refusal, kd.InvalidInput) else [str(refusal)]
        assert lines, "a refusal says why"
        assert all(line and line.isprintable() for line in lines), f"a line a fault: {lines!r}"
        return False
    return True


_store: list[str] = []  # the files of a good Zarr store


def run_sweep(text: str, folder: Path) -> bool:
    """Open a sweep, a Zarr store if the text begins with a file's name, and show it."""
    import kickdyn as kd

    if text.startswith("\x89HDF") or "\n" not in text[:80]:
        file = folder / "sweep.nc"
        file.write_bytes(text.encode("latin-1", "replace"))
    else:
        if not _store:
            _store.extend(sweeps("zarr"))
        file = folder / "sweep.zarr"
        shutil.rmtree(file, ignore_errors=True)
        for stored in (*_store, text):
            name, _, body = stored.partition("\n")
            if stored is text and name not in [known.partition("\n")[0] for known in _store]:
                continue
            (file / name).parent.mkdir(parents=True, exist_ok=True)
            (file / name).write_bytes(body.encode("latin-1", "replace"))
    try:
        with kd.open_sweep(file) as data:
            str(data)
            with contextlib.suppress(OSError, RuntimeError, ValueError):  # xarray reads it later
                data.load()
    except kd.KickdynError as refusal:
        said = str(refusal)
        assert said.isprintable(), f"a refusal is one line: {said!r}"
        return False
    return True


def run_scene(text: str, folder: Path) -> None:
    """Read a scene, and simulate it."""
    import numpy as np

    import kickdyn as kd

    file = folder / "scene.toml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        answer = kd.simulate(kd.load_scene(file), tolerance=0.1)
    except kd.SceneError as refusal:
        faults = refusal.faults
    except kd.KickdynError as refusal:
        faults = [str(refusal)]
    else:
        assert np.isfinite(answer.end.position).all(), "an answer is finite"
        return
    assert all(fault and "\n" not in fault for fault in faults), f"a line a fault: {faults}"
    assert faults, "a refusal says why"


def run_cli(text: str, folder: Path) -> None:
    """Run a command line as a user would."""
    from kickdyn.cli.commands import main

    out, err = io.StringIO(), io.StringIO()
    argv, sys.argv = sys.argv, ["kickdyn", *text.split("\x01")]
    code: object = None
    try:
        with (
            contextlib.chdir(folder),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            main()
    except SystemExit as end:
        code = end.code
    finally:
        sys.argv = argv
    said = err.getvalue()
    assert code in (0, 2), f"ends with {code}: {said[-500:]}"
    assert "Traceback" not in said, said[-2000:]
    if code == 2:
        assert said.strip(), "a refusal says why"
        assert "\x1b" not in said, "nothing that was typed steers the terminal"


def limit_memory() -> None:
    """Let this process have `MEMORY` at most, beyond which it gets a `MemoryError`."""
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))


def work(pipe: object) -> None:
    """Take inputs from the pipe and answer with what went wrong, and this process's size."""
    import warnings

    import psutil

    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", "zmq.eventloop.ioloop is deprecated")
    warnings.filterwarnings("ignore", module="zarr")
    devnull = os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, 2)
    limit_memory()
    process = psutil.Process()
    with tempfile.TemporaryDirectory() as folder:
        while True:
            job = pipe.recv()  # type: ignore[attr-defined]
            if job is None:
                return
            fault = ""
            try:
                run(*job, Path(folder))
            except BaseException:
                fault = traceback.format_exc()
            pipe.send((fault, process.memory_info().rss / 1e6))  # type: ignore[attr-defined]


class Child:
    """A process that is fed, and replaced when it dies or hangs."""

    def __init__(self) -> None:
        self.process: mp.Process | None = None

    def feed(self, kind: str, what: str) -> tuple[str, float]:
        """Return what went wrong, if anything, and the child's size [MB]."""
        if self.process is None:
            ours, theirs = mp.get_context("spawn").Pipe()
            self.process = mp.get_context("spawn").Process(target=work, args=(theirs,), daemon=True)
            self.process.start()
            self.pipe = ours
            theirs.close()
        try:
            self.pipe.send((kind, what))
            longest = TIMEOUT + EXTRA_TIME.get(kind, 0.0)
            if not self.pipe.poll(longest):
                self.stop()
                return f"hangs: more than {longest:g} s", 0.0
            return self.pipe.recv()
        except (EOFError, ConnectionError):
            self.process.join()
            code, self.process = self.process.exitcode, None
            return f"the process died, exit code {code}", 0.0

    def stop(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.process = None


def inputs(seed: int, kinds: list[str]):  # type: ignore[no-untyped-def]
    """Yield inputs without end, the same for the same seed."""
    draw = random.Random(seed)
    texts = {kind: seeds(kind) for kind in kinds if kind != "cli"}
    weights = [WEIGHTS[kind] for kind in kinds]
    while True:
        (kind,) = draw.choices(kinds, weights)
        yield kind, "\x01".join(command(draw)) if kind == "cli" else broken(draw, texts[kind])


def main() -> int:
    """Fuzz for a while, report, and return the exit code: 1 if anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--count", type=int, default=10**9, help="most inputs that are fed")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", default=list(WEIGHTS), choices=list(WEIGHTS))
    asked = parser.parse_args()
    child, faults = Child(), dict[str, int]()
    sizes = array("f")
    end = time.monotonic() + asked.seconds
    counts = dict.fromkeys(asked.kinds, 0)
    for kind, what in islice(inputs(asked.seed, asked.kinds), asked.count):
        if time.monotonic() > end:
            break
        fault, size = child.feed(kind, what)
        counts[kind] += 1
        sizes.append(size)
        if fault:
            key = fault.strip().splitlines()[-1][:120]
            if key not in faults:
                CORPUS.mkdir(exist_ok=True)
                name = CORPUS / f"{kind}-{len(list(CORPUS.iterdir())):03d}.txt"
                name.write_bytes(what.encode("utf-8", "surrogatepass"))
                print(f"{name.name}: {fault.strip()[-900:]}\n", flush=True)
            faults[key] = faults.get(key, 0) + 1
        if len(sizes) % 1000 == 0:
            print(f"{len(sizes)} inputs, {len(faults)} kinds of faults", flush=True)
    child.stop()
    early, largest = max(sizes[: len(sizes) // 3 or 1], default=0.0), max(sizes, default=0.0)
    print(f"{len(sizes)} inputs {counts}; {len(faults)} kinds of faults {faults}")
    print(f"memory {early:.0f} MB in the first third, {largest:.0f} MB at most")
    if largest > early + GROWTH:
        print(f"memory grows by more than {GROWTH} MB")
    return int(bool(faults) or largest > early + GROWTH)


if __name__ == "__main__":
    sys.exit(main())
