"""Sweeps by the kernel and one by one, stores, queries and reports."""

from functools import cache
from pathlib import Path

import numpy as np

import kickdyn as kd
from kickdyn.sweeps.grid import Chunks, Grid, read_postures
from kickdyn.sweeps.queries import outcome_at, pareto_front, shown, shown_unit
from kickdyn.sweeps.store import save_netcdf
from kickdyn.sweeps.summary import summarize
from kickdyn.sweeps.sweep_plot import sweep_figure
from kickdyn.sweeps.sweep_report import as_json, extreme_lines, page_lines, paper_lines, text
from recorded.parts import BALL, HUMAN, g1, legs
from recorded.plain import of_file

AXES = {
    "hip": np.radians([-5, 20, 45]),
    "knee": np.radians([5.0, 30, 60, 90]),
    "ankle": np.radians([-5, 15]),
}
FAST = kd.Kick(
    speed=9.0,
    attack=0.3,
    restitution=[(5, 0.8), (20, 0.6)],
    friction=0.15,
    ball=BALL,
    air=kd.Air(drag="brazuca"),
)


@cache
def swept(leg=HUMAN, kick=FAST, **more):
    return kd.sweep(leg, AXES, kick, **more)


def stored():
    kd.sweep(HUMAN, AXES, FAST, store="s.zarr")
    save_netcdf(swept(), "s.nc")
    return [kd.open_sweep("s.zarr").load(), of_file(Path("s.nc"))]


def reported(kick=FAST, where=None):
    grid = Grid.of(HUMAN, AXES)
    summary = summarize(swept(kick=kick), where)
    lines = [*paper_lines(HUMAN, kick), *extreme_lines(HUMAN, grid, kick, summary)]
    return {
        "text": text(summary, lines), "json": as_json(HUMAN, kick, summary, lines), "figure": sweep_figure(summary, lines),
        "summary": summary.as_json(), "postures": summary.postures,
        "page": [[line.label, line.explanation] for line in page_lines(HUMAN, grid, kick, summary, lines)],
        "lines": [line.as_json() for line in lines],
    }  # fmt: skip


CASES = {
    "kernel": swept,
    "kernel, default": lambda: swept(kick=kd.Kick()),
    "kernel, sticks": lambda: swept(kick=kd.Kick(speed=4, friction=2.0, air=None)),
    "exact carries": lambda: kd.sweep(HUMAN, AXES, FAST, tolerance=0),
    "by stronge": lambda: kd.sweep(HUMAN, AXES, kd.Kick(speed=6, law="stronge", friction=0.2)),
    "some variables": lambda: kd.sweep(HUMAN, AXES, FAST, variables=["impulse", "carry"]),
    "robot": lambda: kd.sweep(g1(), {"right_hip_pitch_joint": np.radians([-50, -10]), "right_knee_joint": np.radians([20, 60]),
                                     "right_hip_roll_joint": np.radians([-5, 5])}, kd.Kick(speed=3.0, friction=0.3)),
    "with a slide": lambda: kd.sweep(legs("mjcf"), {"hip": [0.1, 0.5], "knee": [0.3, 1.0], "rail": [0.0, 0.05], "yaw": [-0.1, 0.2]},
                                     kd.Kick(speed=3.0, friction=0.3)),
    "with armature": lambda: kd.sweep(HUMAN.with_armature({"hip": 0.05, "knee": 0.02}), AXES, FAST),
    "running": lambda: kd.sweep(legs("run-up"), AXES, FAST),
    "stored": stored,
    "kicks": lambda: [FAST, FAST.contact, FAST.direction, FAST.restitution_used, repr(kd.Kick())],
    "report": reported,
    "report of a part": lambda: reported(where="knee < 50 and ball_speed > 4"),
    "report as in the paper": lambda: reported(kd.Kick()),
    "front": lambda: pareto_front(swept()),
    "shown": lambda: [[name, shown(swept(), name).values, shown_unit(swept(), name)] for name in ("hip", "launch_angle", "carry", "speed_use")],
    "outcome": lambda: outcome_at(HUMAN, FAST, swept().isel(hip=1, knee=2, ankle=0)),
    "read": lambda: read_postures(HUMAN, ["hip=-10:60:12.5", "knee=3", "ankle=0:20:5"]),
    "chunks": lambda: [[c.shape, c.counts, [c.index(k) for k in range(min(int(np.prod(c.counts)), 5))], c.region(int(np.prod(c.counts)) - 1), c.span(int(np.prod(c.counts)) - 1)] for c in (
        Chunks.of((7, 40, 30), 500), Chunks.of((4, 5, 6), 60), Chunks.of((40, 3), 1000), Chunks.of((5, 6, 7), 6))],
}  # fmt: skip
LOOSE = {"": 1e-6}
