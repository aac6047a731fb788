"""Time the sweep's kernel beside loops of the same Pinocchio calls, in one run on one thread.

    python benchmarks/sweep.py

The loops, over the same postures: in C++ (`pinocchio_loop.cpp`, which is compiled here for this
processor; that takes two minutes, 3.5 GB of memory, g++ and Eigen's headers, Debian's
libeigen3-dev), and in Python. Both call `crba`, take the frame's Jacobian and solve for the impulse
along the normal with Cholesky factors, without friction; "with joints" adds `rnea` for the impulses
inside the joints. The kernel computes more: friction, and with joints the least use of the speed
limits and residuals. Answers are compared to 1e-12. To the landing, the loop is Python's with
`solve_ivp` (RK45, 1e-9). Times are processor times per posture, the shortest of rounds that are
taken in turn.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from by_hand import fly_by_hand
from scipy.linalg import lapack

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.sweeps.chunk_solver import BLOCK, ChunkSolver, launches
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel import DOUBT, MOBILITY, WORST, Kernel, KernelModel
from kickdyn.sweeps.sweep import CARRY_TOLERANCE
from kickdyn.sweeps.sweep_kick import Kick

KICK = Kick(speed=12.0)
FEW, MANY, FLOWN, ROUNDS = 3000, 200_000, 60, 15
PUSH = (1.0 + KICK.restitution_used) * KICK.speed
"""Change of the foot's velocity relative to the ball [m/s]."""

Run = Callable[[], "tuple[float, ...]"]
"""Something to time: returns its processor times per posture [us]."""


def timed(work: Callable[[], object], count: int) -> Run:
    """Return the run of some Python code that computes `count` postures."""

    def run() -> tuple[float, ...]:
        begin = time.process_time()
        work()
        return ((time.process_time() - begin) / count * 1e6,)

    return run


def shortest(*runs: Run) -> list[float]:
    """Return the shortest times of each run, rounds taken in turn."""
    rounds = [[t for run in runs for t in run()] for _ in range(ROUNDS)]
    return [min(times) for times in zip(*rounds, strict=True)]


def python_loop(leg: kd.Leg, postures: Array) -> Callable[[], Array]:
    """Return what most people would write: inverse effective masses [1/kg] and impulses [N s]."""
    model, frame, n = leg.model, leg.frame_id, KICK.direction
    data = model.createData()

    def compute() -> Array:
        found = []
        for q in postures:
            inertia = pin.crba(model, data, q)
            jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
            row = n.dot(jacobian[:3])
            give = row.dot(lapack.dposv(inertia, row, lower=1)[1])
            found.append((give, PUSH / (give + 1.0 / KICK.ball.mass)))
        return np.array(found)

    return compute


def compile_cpp_loop(folder: Path) -> Path | None:
    """Return the program of the loop in C++, or None where it cannot be compiled, and say why."""
    source, program = Path(__file__).with_name("pinocchio_loop.cpp"), folder / "pinocchio_loop"
    prefix = Path(pin.__file__).parents[4]  # of the wheel: its headers and libraries
    places = [prefix / "include" / "eigen3", Path("/usr/include/eigen3")]
    eigen = next((place for place in places if (place / "Eigen").is_dir()), None)
    compiler = shutil.which(os.environ.get("CXX", "g++"))
    if compiler is None or eigen is None or not (prefix / "include" / "pinocchio").is_dir():
        missing = "compiler g++" if compiler is None else "headers of Eigen or Pinocchio"
        print(f"No {missing}: there is no loop in C++ to compare with.\n")
        return None
    options = [
        "-O3", "-march=native", "-DNDEBUG", "-std=c++17", "-w",
        # as Pinocchio's own CMake files say
        "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
        "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
        f"-I{prefix / 'include'}", f"-I{eigen}", f"-L{prefix / 'lib'}",
        f"-Wl,-rpath,{prefix / 'lib'}",
    ]  # fmt: skip
    command = [compiler, *options, str(source), "-o", str(program), "-lboost_serialization"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if "error" in line]
        print(f"The loop in C++ cannot be compiled: {(lines or ['no reason given'])[0]}\n")
        return None
    return program


def cpp_loop(program: Path, leg: kd.Leg, postures: Array) -> tuple[Run, Callable[[], Array]]:
    """Return the run of the loop in C++, and a function that reads its answers."""
    model, given, answers = (program.with_name(name) for name in ("model", "given", "answers"))
    leg.model.saveToText(str(model))
    postures.tofile(given)
    numbers = (*KICK.direction, PUSH, 1.0 / KICK.ball.mass)
    command = [program, model, given, len(postures), leg.frame_id, *map(float, numbers), answers]

    def run() -> tuple[float, ...]:
        done = subprocess.run(
            [str(each) for each in command], capture_output=True, text=True, check=True
        )
        return tuple(map(float, done.stdout.split()))

    return run, lambda: np.fromfile(answers).reshape(-1, 2)


def fine(names: tuple[str, ...]) -> Grid:
    """Return a grid of at least `MANY` postures."""
    each = int(np.ceil(MANY ** (1 / len(names))))
    return Grid({name: np.linspace(-0.5, 0.7, each) for name in names})


def arm() -> kd.Leg:
    """Return an arm of seven hinges, each across the one before."""
    model, here = pin.Model(), pin.SE3.Identity()
    kinds, parent = (pin.JointModelRZ(), pin.JointModelRY()), 0
    for k in range(7):
        place = pin.SE3(here.rotation, np.array([0.02 * k, 0.01, 0.2]))
        parent = model.addJoint(parent, kinds[k % 2], place, f"joint{k + 1}")
        body = pin.Inertia(3.0 - 0.3 * k, np.array([0.01, 0.02, 0.1]), 0.02 * np.eye(3))
        model.appendBodyToJoint(parent, body, here)
    tip = pin.SE3(here.rotation, np.array([0.0, 0.0, 0.15]))
    model.addFrame(pin.Frame("toe", parent, 0, tip, pin.FrameType.OP_FRAME))
    model.name = "arm"
    return kd.Leg.from_model(model, "toe")


def in_blocks(kernel: Kernel, *, joint_impulses: bool) -> None:
    """Compute `MANY` postures, as many at a time as a sweep does."""
    for first in range(0, MANY, BLOCK):
        kernel(first, min(BLOCK, MANY - first), joint_impulses=joint_impulses)


def compare(name: str, leg: kd.Leg, target: float, program: Path | None) -> str:
    """Return a row of the table."""
    model = KernelModel.of(leg, KICK)
    level = KernelModel.of(leg, replace(KICK, friction=0.0))
    assert model is not None
    assert level is not None
    grid = fine(leg.joint_names)
    numbers = np.random.default_rng(0).choice(MANY, FEW, replace=False)
    postures = np.array([grid.configuration(leg, int(number)) for number in numbers])
    kernel, frictionless = (Kernel(each, leg, grid, machine_code=True) for each in (model, level))
    answers = frictionless(0, MANY)[:, numbers]
    loop = python_loop(leg, postures)
    sure = answers[DOUBT] == 0.0
    gaps = [answers[MOBILITY] / loop()[:, 0] - 1.0]
    runs = [
        timed(loop, FEW),
        timed(lambda: in_blocks(kernel, joint_impulses=False), MANY),
        timed(lambda: in_blocks(kernel, joint_impulses=True), MANY),
    ]
    if program is not None:
        cpp, read = cpp_loop(program, leg, postures)
        python, bare, whole, cpp_bare, cpp_whole = shortest(*runs, cpp)
        gives, worst = read().T
        gaps += [answers[MOBILITY] / gives - 1.0, answers[WORST] / worst - 1.0]
    else:
        python, bare, whole = shortest(*runs)
        cpp_bare = cpp_whole = np.nan
    gap = max(float(np.abs(each[sure]).max()) for each in gaps)
    if not gap <= 1e-12:
        raise SystemExit(f"{name}: kernel and loop differ by {gap:.1e}")
    row = (
        f"| {name} | {cpp_bare:.3f} | {python:.2f} "
        f"| {bare:.4f} | **{cpp_bare / bare:.1f}** (target {target:g}), {python / bare:.0f} "
        f"| {cpp_whole:.3f} | {whole:.4f} | {cpp_whole / whole:.1f} | {gap:.0e} |"
    )
    return row.replace("nan", "-")


def main() -> None:
    """Print the table, and the times from posture to landing."""
    human, g1 = kd.Leg.human(), kd.Leg.from_robot("g1", legs_only=True)
    chain = g1.locked({name: 0.0 for name in g1.joint_names if name.startswith("left")})
    cases: tuple[tuple[str, kd.Leg, float], ...] = (
        ("human leg, 3 joints", human, 12),
        ("arm, 7 joints", arm(), 2),
        ("G1 leg, 6 joints", chain, 1.5),
    )
    with tempfile.TemporaryDirectory() as folder:
        program = compile_cpp_loop(Path(folder))
        print("| chain | C++ [us] | Python [us] | impulse alone [us] | times faster than "
              "C++, Python | C++ with joints [us] | with joints [us] | times faster | largest "
              "difference |\n|---|---|---|---|---|---|---|---|---|")  # fmt: skip
        for name, leg, target in cases:
            print(compare(name, leg, target, program), flush=True)
    load = ", ".join(f"{each:.1f}" for each in os.getloadavg())
    print(f"load of the machine, {os.cpu_count()} cores: {load}")
    model = KernelModel.of(human, KICK)
    assert model is not None
    assert KICK.air is not None
    postures, air = fine(human.joint_names), KICK.air
    exact, read = (ChunkSolver(human, postures, KICK, each) for each in (0.0, CARRY_TOLERANCE))
    exact.prepare()
    read.prepare()
    kernel = Kernel(model, human, postures, machine_code=True)
    launched = launches(model, kernel(0, MANY)[:3, :: MANY // FLOWN].T)
    few = np.random.default_rng(0).uniform(-0.5, 0.7, (FEW, human.nq))
    struck, by_hand, flown, swept = shortest(
        timed(python_loop(human, few), FEW),
        timed(lambda: fly_by_hand(launched, KICK.ball, air), len(launched.position)),
        timed(lambda: exact(0, 50_000), 50_000),
        timed(lambda: read(0, MANY), MANY),
    )
    peer = struck + by_hand
    print(f"posture to landing: loop {peer:.0f} us; every ball flown {flown:.2f} us, ratio "
          f"{peer / flown:.0f}; carries interpolated within {CARRY_TOLERANCE:g} m {swept:.3f} us, "
          f"ratio {peer / swept:.0f}")  # fmt: skip


if __name__ == "__main__":
    main()
