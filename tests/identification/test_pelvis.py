"""The pelvis of OpenSim as a floating base: axes, signs, the hip's place, and a whole motion."""

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.identification.pelvis import PELVIS, base_configurations

PERSON = {"height": 1.7, "mass": 60, "sex": "female", "model": "3d"}
JOINTS = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "-ankle_angle",
          "subtalar_angle")  # fmt: skip


def pose(leg, **coordinates):
    values = dict.fromkeys(PELVIS, 0.0) | coordinates
    (q,) = base_configurations(leg, {name: np.array([x]) for name, x in values.items()})
    return pin.XYZQUATToSE3(q)


@pytest.mark.parametrize(("side", "out"), [("right", -1.0), ("left", 1.0)])
def test_axes_signs_and_the_place_of_the_hip(side, out):
    leg = kd.Leg.human(**PERSON, side=side, base="floating")
    upright = pose(leg, pelvis_tx=2.0, pelvis_ty=1.0, pelvis_tz=0.3)
    knee, ankle = (leg.model.jointPlacements[leg.model.getJointId(n)] for n in ("knee", "ankle"))
    size = (np.linalg.norm(knee.translation) + np.linalg.norm(ankle.translation)) / 0.826
    hip = size * np.array([-0.0707, out * 0.0835, -0.0661])  # x forward, y left, z up
    assert upright.translation == pytest.approx(np.array([2.0, -0.3, 1.0]) + hip)
    assert upright.rotation == pytest.approx(np.eye(3))
    backwards = pose(leg, pelvis_tilt=0.2)  # about the axis to the right: the front rises
    assert backwards.rotation[:, 0] == pytest.approx([np.cos(0.2), 0.0, np.sin(0.2)])
    assert backwards.translation == pytest.approx(backwards.rotation @ hip)
    to_the_left = pose(leg, pelvis_rotation=0.2)
    assert to_the_left.rotation[:, 0] == pytest.approx([np.cos(0.2), np.sin(0.2), 0.0])
    right_side_down = pose(leg, pelvis_list=0.2)
    assert right_side_down.rotation[:, 1] == pytest.approx([0.0, np.cos(0.2), np.sin(0.2)])
    turns = ({"pelvis_tilt": 0.3}, {"pelvis_list": -0.2}, {"pelvis_rotation": 0.5})
    tilt, list_, rotation = (pose(leg, **turn).rotation for turn in turns)
    together = pose(leg, **turns[0], **turns[1], **turns[2])
    assert together.rotation == pytest.approx(tilt @ list_ @ rotation)


def written(path, columns):
    """Write a MOT file in degrees, as OpenSim does."""
    degrees = {
        name: x if name.endswith(("time", "_tx", "_ty", "_tz")) else np.degrees(x)
        for name, x in columns.items()
    }
    rows = "\n".join(
        "\t".join(map(repr, row)) for row in np.transpose(list(degrees.values())).tolist()
    )
    path.write_text(f"Coordinates\ninDegrees=yes\nendheader\n{chr(9).join(columns)}\n{rows}\n")
    return kd.BodyTrack.from_mot(path)


def test_a_motion_with_its_pelvis(tmp_path):
    """The velocities at the contact are the rates of the coordinates."""
    times = np.arange(0.0, 0.2, 1 / 240)
    rates = {"pelvis_tx": 3.5, "pelvis_ty": -0.1, "pelvis_tz": 0.2, "pelvis_tilt": 0.4}
    columns = {"time": times} | {name: rates.get(name, 0.0) * times for name in PELVIS}
    turns = dict(zip(JOINTS, (6.0, 0.5, -1.0, -12.0, 2.0, 0.3), strict=True))
    columns |= {f"{n.removeprefix('-')}_r": 0.2 + rate * (times - 0.2) for n, rate in turns.items()}
    track = written(tmp_path / "kick.mot", columns)
    leg = kd.Leg.human(**PERSON, base="floating")
    names = {joint: f"{name}_r" for joint, name in zip(leg.single_joints, JOINTS, strict=True)}
    motion = kd.fit_motion(track, leg, angles=names, contact=0.2)
    assert motion.warnings == ()
    at = motion.at_contact()
    signs = [-1.0 if name.startswith("-") else 1.0 for name in names.values()]
    assert at.v[6:] == pytest.approx(np.array(signs) * list(turns.values()), abs=1e-3)
    assert at.v[3:6] == pytest.approx([0.0, -0.4, 0.0], abs=1e-3)
    before, after = (pose(leg, **{n: r * t for n, r in rates.items()}) for t in (0.199, 0.201))
    moved = (after.translation - before.translation) / 0.002
    turn = pin.XYZQUATToSE3(at.posture.q[:7]).rotation
    assert turn @ at.v[:3] == pytest.approx(moved, abs=1e-3)

    fixed = kd.Leg.human(**PERSON)
    (line,) = kd.fit_motion(track, fixed, angles=names, contact=0.2).warnings
    assert line.startswith("coordinates pelvis_tx, pelvis_ty, pelvis_tz, pelvis_tilt, pelvis_list, "
                           "pelvis_rotation of the track do not count")  # fmt: skip
    angles = {name: x for name, x in track.angles.items() if name != "pelvis_ty"}
    with pytest.raises(kd.InvalidInput, match=r"a track that also has pelvis_ty$"):
        kd.fit_motion(kd.BodyTrack(times, angles=angles), leg, angles=names)
    angles = {**track.angles, "pelvis_list": np.degrees(track.angles["pelvis_tilt"]) + 20.0}
    with pytest.raises(kd.InvalidInput, match=r"angle 'pelvis_list' is up to .*, as in degrees"):
        kd.fit_motion(kd.BodyTrack(times, angles=angles), leg, angles=names)
