"""Compare the same kick of every robot, with a 3-D page of each row.

The tables of docs/explanation/robots.md.

    python benchmarks/robots_table.py [--pages FOLDER]

Posture of the paper's Table 2 (hip 5, knee 10, ankle -5 degrees, all other joints at 0), foot at
1 m/s along 30 degrees upward, which is also the contact normal, e 0.8, frictionless, a size 5 ball
at rest. Robots strike on a fixed base, on a floating base, and on a floating base with the left
foot fixed, with the drives of the catalogue and, in two columns, without.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

import kickdyn as kd
from kickdyn.robot.catalog import ROBOTS

ATTACK = np.array([np.cos(np.radians(30)), 0.0, np.sin(np.radians(30))])
CONTACT = kd.Contact(ATTACK, restitution=0.8)
DEGREES = (5.0, 10.0, -5.0)
BENDS = {
    "g1": ("right_hip_pitch_joint", "right_knee_joint", "right_ankle_pitch_joint"),
    "talos": ("leg_right_3_joint", "leg_right_4_joint", "leg_right_5_joint"),
    "icub": ("r_hip_pitch", "r_knee", "r_ankle_pitch"),
    "romeo": ("RHipPitch", "RKneePitch", "RAnklePitch"),
    "bolt": ("FR_HFE", "FR_KFE"),
    "human": ("right_hip_Z", "right_knee_Z", "right_ankle_Z"),
    "simple_humanoid": ("RLEG_HIP_P", "RLEG_KNEE", "RLEG_ANKLE_P"),
}
RISES = {"toe": 30, "instep": 70, "sole_edge": -30}
SINGULAR = ("icub", "romeo")
POINT_FEET = ("bolt",)


def posture(leg: kd.Leg, joints: tuple[str, ...]) -> kd.Posture:
    """Return the leg bent as in Table 2; hip flexion turns about -y, the others about y."""
    leg.posture(leg.configuration())  # so that the joints' axes are those of the straight leg
    angles = {}
    for joint, degrees, about in zip(joints, DEGREES, (-1, 1, 1), strict=False):
        space = leg.workspace
        index = 1 + leg.joint_names.index(joint)
        axis = space.data.oMi[index].rotation @ np.array(space.data.joints[index].S)[3:]
        angles[joint] = about * np.sign(axis[1]) * np.radians(degrees)
    return leg.posture(leg.configuration(angles))


def kicks(drives: bool = True) -> Iterator[tuple[str, str, kd.Impact]]:
    """Yield name, base and impact of every line, of robots with or without their drives."""
    for name, leg in (("human leg", kd.Leg.human()), ("test bed", kd.Leg.testbed())):
        yield name, "fixed", struck(posture(leg, leg.joint_names))
    for name, joints in BENDS.items():
        legs = name in SINGULAR
        shown = f"{name}, legs only" if legs else name
        floating = kd.Leg.from_robot(name, base="floating", legs_only=legs, drives=drives)
        foot = kd.Support(ROBOTS[name].stance, point=name in POINT_FEET)
        fixed = kd.Leg.from_robot(name, legs_only=legs, drives=drives)
        yield shown, "fixed", struck(posture(fixed, joints))
        yield shown, "floating", struck(posture(floating, joints))
        yield shown, "left foot fixed", struck(posture(floating.with_supports(foot), joints))


def struck(bent: kd.Posture) -> kd.Impact:
    """Return the kick from a posture."""
    return kd.strike(bent, bent.joint_velocity(ATTACK), kd.Ball(), CONTACT)


def table() -> str:
    """Return the table of the kicks on a fixed base, in Markdown."""
    lines = [
        "| robot | impulse [N s] | effective mass [kg] | ball / foot speed "
        "| without drives [kg] | ball / foot speed | worst joint [N s] | where |",
        "|---|---:|---:|---:|---:|---:|---:|---|",
    ]
    for (name, base, hit), (_, _, bare) in zip(kicks(), kicks(drives=False), strict=True):
        assert max(hit.momentum_residual, hit.restitution_residual) <= 1e-12, name
        if base != "fixed":
            continue
        joint, size = hit.worst_joint
        lines.append(
            f"| {name} | {np.linalg.norm(hit.impulse):.4f} | {hit.effective_mass:.4f} "
            f"| {hit.speed_ratio:.4f} | {bare.effective_mass:.4f} | {bare.speed_ratio:.4f} "
            f"| {size:.4f} | {joint} |"
        )
    return "\n".join(lines)


def contact_table() -> str:
    """Return the table of contact points with free and with stiff joints, in Markdown."""
    lines = [
        "| robot | contact point | normal above the foot's x axis [deg] | without drives [kg] "
        "| with drives [kg] | stiff ankle [kg] | stiff ankle and knee [kg] |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for name, joints in BENDS.items():
        points = [frame for frame in RISES if frame in ROBOTS[name].contact_points]
        for frame in points if len(points) > 1 else ():
            degrees = RISES[frame]
            leg = kd.Leg.from_robot(name, frame, legs_only=True)
            normal = (np.cos(np.radians(degrees)), 0.0, np.sin(np.radians(degrees)))
            ankle = [joint for joint in leg.joint_names if "nkle" in joint]
            bare = kd.Leg.from_robot(name, frame, legs_only=True, drives=False)
            masses = [posture(bare, joints).effective_mass(normal)]
            masses += [
                posture(leg.with_stiff_joints(*stiff), joints).effective_mass(normal)
                for stiff in ((), ankle, (*ankle, joints[1]))
            ]
            shown = " | ".join(f"{mass:.3f}" for mass in masses)
            lines.append(f"| {name} | {frame} | {degrees} | {shown} |")
    return "\n".join(lines)


def plan_table() -> str:
    """Return the table of plans for G1 without drives that G1 with its drives carries out."""
    lines = [
        "| goal | joints | effective mass without and with drives [kg] | planned ball speed [m/s] "
        "| ball speed with the drives [m/s] | difference |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for (distance, time), legs_only in product(((2.0, 0.5), (3.0, 0.4)), (True, False)):
        bare, robot = (
            kd.Leg.from_robot("g1", base="floating", legs_only=legs_only, drives=drives)
            for drives in (False, True)
        )
        standing = bare.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))
        impact = kd.plan_kick(standing, kd.Goal(distance, time=time), kd.Ball(), kd.Air()).impact
        driven = robot.with_supports(*impact.posture.leg.supports).posture(impact.posture.q)
        real = kd.strike(driven, impact.v_before, kd.Ball(), impact.contact)
        planned, speed = impact.ball_after.speed, real.ball_after.speed
        joints = "of the legs" if legs_only else "all"
        lines.append(
            f"| {distance:g} m in {time:g} s | {joints} "
            f"| {impact.effective_mass:.2f}, {real.effective_mass:.2f} | {planned:.3f} "
            f"| {speed:.3f} | {100 * (speed / planned - 1):+.0f} % |"
        )
    return "\n".join(lines)


def pages(folder: Path) -> None:
    """Write a page of every line that shows the kick."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, base, hit in kicks():
        path = kd.fly(hit.ball_after, kd.Ball(), air=kd.Air(), ground=None)
        file = folder / f"{name} {base}.html".replace(", ", " ").replace(" ", "_")
        kd.page(hit, path, caption=f"{name}, {base}").save(file)


if __name__ == "__main__":
    print(table())
    print()
    print(contact_table())
    print()
    print(plan_table())
    if sys.argv[1:2] == ["--pages"]:
        pages(Path(sys.argv[2]))
