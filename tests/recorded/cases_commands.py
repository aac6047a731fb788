"""Every command: what it prints, its JSON, pages, plots and files, and what it refuses."""

import math
import re
from pathlib import Path
from unittest.mock import patch

from click.testing import CliRunner

from kickdyn.cli.commands import kickdyn_command
from kickdyn.cli.function_costs import FunctionCost, cost_figure
from recorded.parts import BOX, MIMIC, ROOT
from recorded.plain import message, of_figure, of_file, text_of

MATCH = (ROOT / "data" / "match_ball.csv").read_text().splitlines()
G1 = ("--leg", "g1", "--frame", "toe")


def run(*words, inputs=None):
    """Return what a command prints, writes and draws."""
    figures = []

    def save(figure, file, *_, **__):
        figures.append(of_figure(figure))
        Path(file).write_bytes(b"drawn")

    for name, text in (inputs or {}).items():
        Path(name).write_text(text)
    known = {path.name for path in Path().iterdir()}
    with patch("matplotlib.figure.Figure.savefig", save):
        ended = CliRunner(env={"COLUMNS": "110"}).invoke(kickdyn_command, [str(w) for w in words])
    said = {
        "printed": [text_of(line.rstrip()) for line in _without_times(ended.output)],
        "code": ended.exit_code,
    }
    if ended.exception is not None and not isinstance(ended.exception, SystemExit):
        said["refused"] = message(ended.exception)
    for path in sorted(Path().iterdir()):
        if path.name not in known and path.suffix != ".zarr":
            said[path.name] = of_file(path)
    return said | ({"figures": figures} if figures else {})


def _without_times(output):
    """Yield the lines, without the processor times of a table."""
    timed = False
    for line in output.splitlines():
        timed = (timed or "took [ms]" in line) and not line.startswith("size:")
        yield re.sub(r"^(\S.*?  +\S+  +)[\d.e+-]+", r"\1T", line) if timed else line


def identify(*words, rows=slice(2808, 2924)):
    return run(
        "identify",
        "track.csv",
        *words,
        inputs={"track.csv": "\n".join([MATCH[0], *MATCH[rows]]) + "\n"},
    )


def options(command):
    """Return names, defaults and help of the options of a command."""
    import click

    _, found, _ = kickdyn_command.resolve_command(click.Context(kickdyn_command), [command])
    return {
        "help": text_of(found.help or ""),
        "options": {
            parameter.name:
            [*parameter.opts, *parameter.secondary_opts, repr(parameter.default) if not callable(parameter.default) else "",
             getattr(parameter, "help", None) or "", str(parameter.metavar), parameter.required, parameter.multiple,
             list(getattr(parameter.type, "choices", ()))]
            for parameter in found.params
            if parameter.name != "help"
        },
    }  # fmt: skip


ALL = ("--json", "out.json", "--view", "out.html", "--plot", "out.png")
RUNS = {
    "plan": ("plan", "--distance", 30, "--time", 1.5, "--json", "out.json", "--view", "out.html"),
    "plan, free kick": ("plan", "--distance", 20, "--height", 0.9, "--left", 0, "--over", "9.15:2.6", "--goal", "--wall", "9.15:1.9",
                        "--json", "out.json", "--view", "out.html"),
    "plan, wall only": ("plan", "--distance", 20, "--wall", "9.15:1.9", "--wind", "1,0.0,0", "--drag", "brazuca", "--json", "out.json"),
    "plan, robot": ("plan", *G1, "--distance", 4, "--left", 1, "--time", 0.8, "--stiff", "*wrist*", "--json", "out.json"),
    "plan, pass": ("plan", "--distance", 12, "--time", 1.5, "--pass", "turf", "--ball", "0.41:0.105:80000", "--json", "out.json"),
    "plan, testbed": ("plan", "--leg", "testbed", "--distance", 1.2, "--time", 0.3, "--air", "none", "--json", "out.json", "--view", "out.html"),
    "plan, incoming": ("plan", "--distance", 18, "--time", 1.2, "--ball-position", "2,0,-0.7042", "--ball-velocity", "-2.5,0,0",
                       "--ball-spin", "0,-22.8,0", "--json", "out.json"),
    "plan, runner": ("plan", "--distance", 16, "--time", 1.2, "--receiver-velocity", "2,0,0", "--json", "out.json"),
    "plan, too far": ("plan", "--distance", 60, "--time", 1.9, "--json", "out.json"),
    "plan, unreachable": ("plan", "--distance", 300, "--time", 1.2, "--json", "out.json"),
    "plan, unlimited": ("plan", "--distance", 40, "--apex", 6, "--no-limits", "--objective", "kinetic-energy", "--restitution", "5:0.8,20:0.65"),
    "plan, bad": ("plan", "--distance", 12),
    "plan, bad wall": ("plan", "--distance", 12, "--wall", "13:2"),
    "plan, bad vector": ("plan", "--distance", 12, "--apex", 2, "--spin", "1,2"),
    "plan, bad objective": ("plan", "--distance", 12, "--apex", 2, "--objective", "speed"),
    "plan, bad drag": ("plan", "--distance", 12, "--apex", 2, "--drag", "golf"),
    "plan, two": ("plan", "--distance", 12, "--apex", 2, "--time", 1),
    "plan, heights": ("plan", "--distance", 12, "--apex", 2, "--ball-height", 0, "--ball-at", "0,0,0"),
    "plan, plot alone": ("plan", "--distance", 12, "--apex", 2, "--plot", "out.png"),
    "plan, out alone": ("plan", "--distance", 12, "--apex", 2, "--out", "out.csv"),
    "plan, twice one file": ("plan", "--distance", 12, "--apex", 2, "--json", "out.html", "--view", "out.html"),
    "plan, page ending": ("plan", "--distance", 12, "--apex", 2, "--view", "out.pdf"),
    "sweep": ("posture-sweep", "--joint", "hip=-10:60:10", "--joint", "knee=0:90:15", "--joint", "ankle=-5:15:10", "--speed", 2,
              "--out", "out.nc", "--json", "out.json"),
    "sweep, where": ("posture-sweep", "--joint", "hip=0:60:10", "--joint", "knee=0:90:10", "--joint", "ankle=0",
                     "--where", "knee < 50 and worst_joint_impulse <= 1.5", "--friction", 0.2, "--json", "out.json", "--plot", "out.png"),
    "sweep, locked": ("posture-sweep", "--lock", "ankle=5", "--joint", "hip=0:60:10", "--joint", "knee=0:90:30", "--json", "out.json"),
    "sweep, robot": ("posture-sweep", *G1, "--joint", "right_hip_pitch_joint=-60:10:10", "--joint", "right_knee_joint=10:70:10",
                     "--attack", 20, "--json", "out.json"),
    "sweep, stronge": ("posture-sweep", "--joint", "hip=0:40:20", "--joint", "knee=0:60:20", "--joint", "ankle=0", "--law", "stronge",
                       "--air", "paper", "--speed", 9, "--restitution", "peacock-ball"),
    "sweep, testbed": ("posture-sweep", "--leg", "testbed", "--joint", "hip=0:60:20", "--joint", "knee=0:60:20", "--joint", "ankle=0",
                       "--variables", "impulse,carry", "--out", "out.nc", "--tolerance", 0),
    "sweep, mjcf": ("posture-sweep", "--leg", "kicker.xml", "--frame", "toe", "--joint", "hip=0:60:20", "--joint", "knee=10:60:20",
                    "--joint", "rail=0:0.08:0.04", "--speed", 2),
    "sweep, geared": ("posture-sweep", "--leg", "geared.urdf", "--frame", "toe", "--joint", "hip=0:60:20", "--joint", "knee=10:60:20"),
    "sweep, bad joint": ("posture-sweep", "--joint", "hipp=0:40:20"),
    "sweep, bad range": ("posture-sweep", "--joint", "hip=40:0:20"),
    "sweep, bad where": ("posture-sweep", "--joint", "hip=0", "--where", "knie < 3"),
    "sweep, bad file": ("posture-sweep", "--joint", "hip=0", "--out", "out.txt"),
    "sweep, bad variable": ("posture-sweep", "--joint", "hip=0", "--variables", "speed", "--out", "out.nc"),
    **{f"simulate {name}": ("simulate", name, "--json", "out.json") for name in ("free_kick", "robot_chip", "wet_grass_pass")},
    "simulate exactly": ("simulate", "volley", "--exact", "--json", "out.json"),
    "simulate finely": ("simulate", "robocup_carpet", "--tolerance", 0.001),
    "simulate nothing": ("simulate", "nothing"),
    "tradeoff": ("tradeoff", "--scene", "free_kick", "--json", "out.json", "--plot", "out.png"),
    "tradeoff, pass": ("tradeoff", "--scene", "wet_grass_pass"),
    **{f"view {name}": ("view", name, "--out", "out.html", "--json", "out.json") for name in ("free_kick", "wet_grass_pass", "volley")},
    "view, bad": ("view", "free_kick", "--out", "out.pdf"),
    "view, no file": ("view", "free_kick", "--at", 3),
    "paper": ("paper", "--only", "table2", "--json", "out.json"),
    "paper, figure": ("paper", "--only", "fig8", "--json", "out.json"),
    "paper, nothing": ("paper", "--only", "fig2"),
    "tune": ("tune-mujoco", "volley", "--json", "out.json", "--out", "ball.xml", "--scene-out", "all.xml"),
    "tune, step": ("tune-mujoco", "volley", "--timestep", 0.5),
    "empty": ("plan", "--distance", ""),
    "unknown": ("fly",),
    "version": ("--version",),
}  # fmt: skip
COSTS = (
    FunctionCost("strike", 3e-5, False, 2e-15, 0.03), FunctionCost("fly", 2e-3, False, 3e-9, math.nan),
    FunctionCost("strike_many", 2e-7, True, 4e-15, 0.04),
)  # fmt: skip
FILES = {"kicker.xml": BOX, "geared.urdf": MIMIC}
CASES = {
    **{name: (lambda words=words: run(*words, inputs={f: t for f, t in FILES.items() if f in words})) for name, words in RUNS.items()},
    "costs of functions": lambda: of_figure(cost_figure(COSTS)),
    "identify": lambda: identify(*ALL),
    "identify one": lambda: identify("--start", 5, "--end", 88, "--drag", "brazuca", "--json", "out.json"),
    "identify, constant": lambda: identify("--start", 5, "--end", 88, "--drag", 0.16, "--ball", "0.42:0.109"),
    "identify many": lambda: identify("--json", "out.json", "--plot", "out.png", rows=slice(2600, 3500)),
    "identify, columns": lambda: identify("--columns", "t,x,y,w"),
    "identify, nothing": lambda: identify(rows=slice(1, 6)),
    "identify, end": lambda: identify("--start", 50, "--end", 20),
    **{f"options of {name}": (lambda name=name: options(name)) for name in
       ("identify", "paper", "plan", "posture-sweep", "reach", "simulate", "tradeoff", "tune-mujoco", "view")},
}  # fmt: skip
LOOSE = {"": 1e-4, "tune": 1e-2}
