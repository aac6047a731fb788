"""Time the sweep's kernels beside a Python loop of the same Pinocchio calls, in one run.

    python benchmarks/sweep.py

The loop: `pin.crba`, `pin.computeFrameJacobian` and LAPACK's Cholesky solve for the impulse along
the normal; with the flight, `solve_ivp` (RK45, 1e-9) to the landing. One thread; each figure is the
best of several rounds, taken in turn.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin
from by_hand import fly_by_hand
from scipy.linalg import lapack

import kickdyn as kd
from kickdyn.sweeps.carry_table import launches
from kickdyn.sweeps.chunk_solver import ChunkSolver
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel_model import KernelModel
from kickdyn.sweeps.kernels import Kernel
from kickdyn.sweeps.sweep import CARRY_TOLERANCE
from kickdyn.sweeps.sweep_kick import Kick

KICK = Kick(speed=12.0)
FEW, MANY, FLOWN, ROUNDS = 3000, 200_000, 60, 5


def loop(leg: kd.Leg) -> Callable[[], list[float]]:
    """Return what most people would write."""
    model, frame, n = leg.model, leg.frame_id, KICK.direction
    data, draw = model.createData(), np.random.default_rng(0)
    postures = draw.uniform(-0.5, 0.7, (FEW, leg.nq))

    def impulses() -> list[float]:
        found = []
        for q in postures:
            inertia = pin.crba(model, data, q)
            jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
            row = n.dot(jacobian[:3])
            give = row.dot(lapack.dposv(inertia, row, lower=1)[1])
            found.append(1.8 * KICK.speed / (give + 1.0 / KICK.ball.mass))
        return found

    return impulses


def best(*runs: tuple[Callable[[], object], int]) -> list[float]:
    """Return the shortest time per posture of each [us], rounds taken in turn."""
    times = [float("inf")] * len(runs)
    for _ in range(ROUNDS):
        for i, (run, count) in enumerate(runs):
            begin = time.perf_counter()
            run()
            times[i] = min(times[i], (time.perf_counter() - begin) / count * 1e6)
    return times


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


def main() -> None:
    """Print the table."""
    human, g1 = kd.Leg.human(), kd.Leg.from_robot("g1", legs_only=True)
    chain = g1.locked({name: 0.0 for name in g1.joint_names if name.startswith("left")})
    print("| chain | kernel | loop | impulse only | with joints | ratios |")
    print("|---|---|---|---|---|---|")
    cases: tuple[tuple[str, kd.Leg, bool | None], ...] = (
        ("human leg, 3 joints", human, None), ("human leg, 3 joints", human, False),
        ("arm, 7 joints", arm(), None), ("G1 leg, 6 joints", chain, None),
    )  # fmt: skip
    for name, leg, planar in cases:
        model = KernelModel.of(leg, KICK, planar)
        assert model is not None
        kernel = Kernel(model, leg, fine(leg.joint_names))
        peer, bare, whole = best(
            (loop(leg), FEW),
            (lambda k=kernel: k(0, MANY, full=False), MANY),  # type: ignore[misc]
            (lambda k=kernel: k(0, MANY), MANY),  # type: ignore[misc]
        )
        kind = "planar" if model.planar else "general"
        print(f"| {name} | {kind} | {peer:.2f} us | {bare:.3f} us | {whole:.3f} us | "
              f"{peer / bare:.0f}, {peer / whole:.0f} |")  # fmt: skip
    model = KernelModel.of(human, KICK)
    assert model is not None
    assert KICK.air is not None
    postures, air = fine(human.joint_names), KICK.air
    exact, read = (ChunkSolver(human, postures, KICK, each) for each in (0.0, CARRY_TOLERANCE))
    exact.prepare()
    read.prepare()
    kernel = Kernel(model, human, postures)
    launched = launches(model, kernel(0, MANY)[:3, :: MANY // FLOWN].T)
    struck, by_hand, flown, swept = best(
        (loop(human), FEW),
        (lambda: fly_by_hand(launched, KICK.ball, air), len(launched.position)),
        (lambda: exact(0, 50_000), 50_000),
        (lambda: read(0, MANY), MANY),
    )
    peer = struck + by_hand
    print(f"posture to landing: loop {peer:.0f} us; every ball flown {flown:.2f} us, ratio "
          f"{peer / flown:.0f}; carries interpolated within {CARRY_TOLERANCE:g} m {swept:.3f} us, "
          f"ratio {peer / swept:.0f}")  # fmt: skip


if __name__ == "__main__":
    main()
