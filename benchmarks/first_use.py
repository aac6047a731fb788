"""Processor time to the first answer, without and with machine code on the disk.

Each row is a process of its own: python benchmarks/first_use.py [words of a row]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

KICK = """
import kickdyn as kd
leg = kd.Leg.human()
posture = leg.posture([0.7, 0.5, -0.3])
v = [6.6, -14.5, 6.6]
contact = kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
"""
BALLS = """
import numpy as np
import kickdyn as kd
draw = np.random.default_rng(0)
balls = kd.BallState(
    velocity=draw.uniform((10, -2, 2), (25, 2, 12), (COUNT, 3)),
    spin=draw.normal(0, 20, (COUNT, 3)),
)
kd.fly_many(balls, kd.Ball(), kd.Air())
"""
COMPILE = """
from kickdyn.core.compilation import MachineCode
MachineCode.pays = lambda code, in_python: True
"""


class Row(NamedTuple):
    """What is measured: a script or a command, and its goals without and with stored code [s]."""

    name: str
    arguments: list[str]
    cold: float
    warm: float


def script(text: str) -> list[str]:
    """Return the arguments of Python that run a text."""
    return ["-c", text]


SWEEP = ["-m", "kickdyn.posture_sweep"]
FILES = ["--out", "sweep.nc", "--plot", "sweep.png", "--view", "kick.html"]
ROWS = (
    Row("import, first strike", script(f"{KICK}kd.strike(posture, v, kd.Ball(), contact)"), 1, 1),
    Row(
        "first plan_kick",
        script(
            f"{KICK}goal = kd.Goal(25, time=1.6)\n"
            "kd.plan_kick(leg, goal, kd.Ball(), kd.Air(), ball_position=-0.7042)"
        ),
        2, 2,
    ),
    Row("posture_sweep, 2,145 postures", SWEEP, 5, 2.5),
    Row("the same with --out --plot --view", [*SWEEP, *FILES], 8, 8),
    Row("fly_many, 1,000 balls", script(BALLS.replace("COUNT", "1000")), 2, 2),
    Row(
        "strike_many in machine code",
        script(f"{COMPILE}{KICK}kd.strike_many(leg, [posture.q], [v], kd.Ball(), contact)"),
        8, 2,
    ),
    Row("fly_many in machine code", script(COMPILE + BALLS.replace("COUNT", "10")), 8, 2),
    Row(
        "posture_sweep in machine code",
        script(f"{COMPILE}from kickdyn.cli.posture_sweep_command import posture_sweep\n"
               "posture_sweep.main([], standalone_mode=False)"),
        16, 2.5,
    ),
    Row(
        "collide_many in machine code",
        script(f"{COMPILE}{KICK}kd.collide_many(leg, [posture.q], [v], kd.Ball(), contact)"),
        8, 2,
    ),
)  # fmt: skip


def processor_time(arguments: list[str], environment: dict[str, str], folder: str) -> float:
    """Return the processor time of a run of Python [s]."""
    before = os.times()
    subprocess.run(
        [sys.executable, *arguments], check=True, cwd=folder, env=environment,
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    after = os.times()
    return (
        after.children_user
        + after.children_system
        - (before.children_user + before.children_system)
    )


def main() -> None:
    """Print the table of the rows whose names have all words."""
    root = Path(__file__).resolve().parent.parent
    print(f"{'processor time [s]':36} {'no code stored':>14} {'goal':>5} {'stored':>7} {'goal':>5}")
    for row in ROWS:
        if not all(word in row.name for word in sys.argv[1:]):
            continue
        with tempfile.TemporaryDirectory() as folder:
            environment = os.environ | {"NUMBA_CACHE_DIR": folder, "PYTHONPATH": str(root)}
            cold, warm = (processor_time(row.arguments, environment, folder) for _ in range(2))
        print(f"{row.name:36} {cold:14.1f} {row.cold:5g} {warm:7.1f} {row.warm:5g}")


if __name__ == "__main__":
    main()
