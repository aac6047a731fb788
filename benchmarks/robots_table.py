"""Compare the same kick of every robot, with a 3-D page of each row.

The tables of docs/explanation/robots.md.

    python benchmarks/robots_table.py [--pages FOLDER]
    python benchmarks/robots_table.py --rotors ROBOT FRAME

Posture of the paper's Table 2 (hip 5, knee 10, ankle -5 degrees, all other joints at 0), foot at
1 m/s along 30 degrees upward, which is also the contact normal, e 0.8, frictionless, a size 5 ball
at rest. Robots strike on a fixed base, on a floating base, and on a floating base with the left
foot fixed. The second form prints the line on rotors of a robot by name, such as
`booster_t1_mj_description right_foot_link`, which robot_descriptions downloads.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.util import find_spec
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
ROTORS = {
    "humanoid.xml": ("right_foot", "floating"),
    "walker2d_v5.xml": ("foot", "fixed"),
    "hopper.xml": ("foot", "fixed"),
}
"""MJCF models of gymnasium that give rotor inertias: contact frame and base.

Walker and hopper have slides and a hinge of their own at the root.
"""
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


def kicks() -> Iterator[tuple[str, str, kd.Impact]]:
    """Yield name, base and impact of every line."""
    for name, leg in (("human leg", kd.Leg.human()), ("test bed", kd.Leg.testbed())):
        yield name, "fixed", struck(posture(leg, leg.joint_names))
    for name, joints in BENDS.items():
        legs = name in SINGULAR
        shown = f"{name}, legs only" if legs else name
        floating = kd.Leg.from_robot(name, base="floating", legs_only=legs)
        foot = kd.Support(ROBOTS[name].stance, point=name in POINT_FEET)
        fixed = kd.Leg.from_robot(name, legs_only=legs)
        yield shown, "fixed", struck(posture(fixed, joints))
        yield shown, "floating", struck(posture(floating, joints))
        yield shown, "left foot fixed", struck(posture(floating.with_supports(foot), joints))


def struck(bent: kd.Posture) -> kd.Impact:
    """Return the kick from a posture."""
    return kd.strike(bent, bent.joint_velocity(ATTACK), kd.Ball(), CONTACT)


def table() -> str:
    """Return the table, in Markdown."""
    lines = [
        "| robot | base | impulse on the ball [N s] | effective mass [kg] | ball / foot speed "
        "| worst joint [N s] | where | residual |",
        "|---|---|---:|---:|---:|---:|---|---:|",
    ]
    for name, base, hit in kicks():
        joint, size = hit.worst_joint
        residual = max(hit.momentum_residual, hit.restitution_residual)
        lines.append(
            f"| {name} | {base} | {np.linalg.norm(hit.impulse):.4f} | {hit.effective_mass:.4f} "
            f"| {hit.speed_ratio:.4f} | {size:.4f} | {joint} "
            f"| {'below 1e-12' if residual <= 1e-12 else f'{residual:.0e}'} |"
        )
    return "\n".join(lines)


def contact_table() -> str:
    """Return the table of contact points with free and with stiff joints, in Markdown."""
    lines = [
        "| robot | contact point | normal above the foot's x axis [deg] | all joints free [kg] "
        "| stiff ankle [kg] | stiff ankle and knee [kg] |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for name, joints in BENDS.items():
        for frame, degrees in RISES.items():
            if frame not in ROBOTS[name].contact_points or len(ROBOTS[name].contact_points) == 1:
                continue
            leg = kd.Leg.from_robot(name, frame, legs_only=True)
            normal = (np.cos(np.radians(degrees)), 0.0, np.sin(np.radians(degrees)))
            ankle = [joint for joint in leg.joint_names if "nkle" in joint]
            masses = [
                posture(leg.with_stiff_joints(*stiff), joints).effective_mass(normal)
                for stiff in ((), ankle, (*ankle, joints[1]))
            ]
            shown = " | ".join(f"{mass:.3f}" for mass in masses)
            lines.append(f"| {name} | {frame} | {degrees} | {shown} |")
    return "\n".join(lines)


def rotor_table() -> str:
    """Return the table of robots whose file gives rotor inertias, in Markdown."""
    lines = [
        "| model | contact frame | rotors | impulse on the ball [N s] | effective mass [kg] "
        "| ball / foot speed | worst joint [N s] | where |",
        "|---|---|---|---:|---:|---:|---:|---|",
    ]
    package = find_spec("gymnasium")
    assert package is not None
    assert package.origin is not None
    folder = Path(package.origin).parent / "envs" / "mujoco" / "assets"
    for name, (frame, base) in ROTORS.items():
        lines += rotor_lines(kd.Leg.from_mjcf(folder / name, frame, base=base))
    return "\n".join(lines)


def rotor_lines(leg: kd.Leg) -> Iterator[str]:
    """Yield the lines of a leg as it is, straight, and without its rotors."""
    bare = leg.with_armature(dict.fromkeys(leg.single_joints, 0.0))
    for rotors, one in (("as in the file", leg), ("none", bare)):
        hit = struck(one.posture(one.configuration()))
        joint, size = hit.worst_joint
        yield (
            f"| {leg.name} | {leg.frame} | {rotors} | {np.linalg.norm(hit.impulse):.4f} "
            f"| {hit.effective_mass:.4f} | {hit.speed_ratio:.4f} | {size:.4f} | {joint} |"
        )


def pages(folder: Path) -> None:
    """Write a page of every line that shows the kick."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, base, hit in kicks():
        path = kd.fly(hit.ball_after, kd.Ball(), air=kd.Air(), ground=None)
        file = folder / f"{name} {base}.html".replace(", ", " ").replace(" ", "_")
        kd.page(hit, path, caption=f"{name}, {base}").save(file)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--rotors"]:
        print("\n".join(rotor_lines(kd.Leg.from_robot(*sys.argv[2:4], base="floating"))))
        sys.exit()
    print(table())
    print()
    print(contact_table())
    print()
    print(rotor_table())
    if sys.argv[1:2] == ["--pages"]:
        pages(Path(sys.argv[2]))
