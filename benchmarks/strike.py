"""Time `kd.strike` beside the bare Pinocchio calls that it cannot do without.

    python benchmarks/strike.py [many]

With `many`, it times `kd.strike_many` beside a loop over the same postures in C++ instead
(`pinocchio_loop.cpp`, see `sweep.py`): inertia, Jacobian, impulse without friction, and `rnea` for
the impulses inside the joints. `strike_many` has friction, launch, energy and status beyond that;
of its 10,000 strikes a third each sticks, slips and misses.
Both are processor times per row, the shortest of rounds that are taken in turn.

Bare: forwardKinematics, updateFramePlacement, crba, computeFrameJacobian, impulseDynamics with one
row for the leg alone, rnea with the impulse on the foot. No ball, no checks, no copies, no joint
order, no residuals, nothing kept. Each figure is the best of many rounds, one thread, and both are
timed in turn. Best, for whatever else the machine does only adds.

What the leg does after the impulse is computed when it is first read. `strike` alone is impulse,
ball, approach and energy; `joint impulses` reads them, joint velocities, supports' impulses and
both residuals; `all` reads the effective mass too. The columns of the laws, with friction
0.4, read joint impulses. A held foot is more than the bare calls do: those are the free robot's.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import kickdyn as kd
from kickdyn.core.validation import Array

BALL = kd.Ball()
ROUNDS, CALLS = 500, 10
READ = ("joint_impulses", "v_after", "constraint_impulses")
READ += ("restitution_residual", "momentum_residual")
ALL = (*READ, "effective_mass")


def bare(leg: kd.Leg, q: Array, v: Array, normal: Array) -> Callable[[], Any]:
    """Return Pinocchio's part of a strike."""
    model = leg.model
    data, frame, still = model.createData(), leg.frame_id, np.zeros(leg.nv)
    outside = pin.StdVec_Force()
    outside.extend([pin.Force.Zero() for _ in range(model.njoints)])

    def calls() -> Any:
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacement(model, data, frame)
        pin.crba(model, data, q)
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        row = normal.dot(jacobian[:3]).reshape(1, leg.nv)
        after = pin.impulseDynamics(model, data, q, v, row, 0.8, 0.0)
        outside[leg.contact_joint] = pin.Force(normal * data.impulse_c[0], normal)
        return pin.rnea(model, data, q, still, after - v, outside)

    return calls


def best(*functions: Callable[[], Any]) -> list[float]:
    """Return the shortest time of each function [us], rounds taken in turn."""
    times = [float("inf")] * len(functions)
    for _ in range(ROUNDS):
        for i, function in enumerate(functions):
            start = time.perf_counter()
            for _ in range(CALLS):
                function()
            times[i] = min(times[i], (time.perf_counter() - start) / CALLS * 1e6)
    return times


def struck(
    leg: kd.Leg,
    q: Array,
    v: Array,
    contact: kd.Contact,
    law: str = "newton",
    read: Sequence[str] = READ,
) -> Callable[[], Any]:
    """Return a strike, after which attributes are read."""

    def calls() -> Any:
        hit = kd.strike(leg.posture(q), v, BALL, contact, law)
        return [getattr(hit, name) for name in read]

    return calls


def many() -> None:
    """Print the times of many strikes."""
    from sweep import KICK, compile_cpp_loop, cpp_loop, shortest, timed

    rng, rows = np.random.default_rng(0), 10_000
    arm = kd.Leg.from_robot("g1", legs_only=True)
    left = [name for name in arm.joint_names if name.startswith("left")]
    legs = {
        "human leg, 3 joints": kd.Leg.human(),
        "leg of G1, 6 joints": arm.locked(dict.fromkeys(left, 0.0)),
    }
    contact = kd.Contact(KICK.direction, KICK.restitution_used, 0.4)
    with tempfile.TemporaryDirectory() as folder:
        program = compile_cpp_loop(Path(folder))
        for name, leg in legs.items():
            q = rng.uniform(0.1, 0.6, (10 * rows, leg.nq))
            size = np.linalg.norm(leg.posture(q[0]).joint_velocity((4.0, 0.0, 1.0)))
            v = rng.normal(0.0, size / np.sqrt(leg.nv), q.shape)
            status = kd.strike_many(leg, q, v, BALL, contact).status
            kinds = [np.flatnonzero(status == flag)[: rows // 3 + 1] for flag in range(3)]
            mixed = rng.permutation(np.concatenate(kinds))[:rows]
            q, v = q[mixed], v[mixed]
            once = timed(lambda: kd.strike_many(leg, q, v, BALL, contact), rows)  # noqa: B023
            run = lambda: (min(once()[0] for _ in range(10)),)  # noqa: B023, E731  # as the loop
            if program is None:
                print(f"{name}: strike_many {shortest(run)[0]:.2f} us")
                continue
            loop, _ = cpp_loop(program, leg, q)
            here, _, inside = shortest(run, loop)
            print(
                f"{name}: strike_many {here:.2f} us, C++ {inside:.2f} us, {inside / here:.1f} times"
            )


def main() -> None:
    """Print the table."""
    if sys.argv[1:] == ["many"]:
        many()
        return
    g1 = kd.Leg.from_robot("g1", frame="right_ankle_roll_link", base="floating")
    bent = g1.configuration({"right_hip_pitch_joint": -0.4, "right_knee_joint": 0.6})
    cases = {
        "human leg, 3 joints": (kd.Leg.human(), np.radians([5, 10, -5])),
        "G1, floating, 35 degrees of freedom": (g1, bent),
        "G1 on its left foot": (g1.with_supports("left_ankle_roll_link"), bent),
    }
    titles = ["bare Pinocchio", "`strike`", "joint impulses", "all", "`newton`", "`stronge`"]
    print("| leg | " + " | ".join(titles) + " |")
    print("|---" * (len(titles) + 1) + "|")
    for name, (leg, q) in cases.items():
        v, contact = leg.posture(q).joint_velocity((4.0, 0.0, 1.0)), kd.Contact((4, 0, 1), 0.8)
        rough = kd.Contact(contact.normal, 0.8, 0.4)
        times = best(
            bare(leg, q, v, contact.normal),
            struck(leg, q, v, contact, read=()),
            struck(leg, q, v, contact),
            struck(leg, q, v, contact, read=ALL),
            struck(leg, q, v, rough),
            struck(leg, q, v, rough, "stronge"),
        )
        cells = [f"{t:.1f} us ({t / times[0]:.1f})" for t in times]
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
