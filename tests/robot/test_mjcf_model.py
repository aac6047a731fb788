import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd

MODELS = Path(find_spec("gymnasium").origin).parent / "envs" / "mujoco" / "assets"


def written(tmp_path, body, **sections):
    """The path of a model with these bodies."""
    more = "".join(f"<{name} {value}/>" for name, value in sections.items())
    file = tmp_path / "robot.xml"
    file.write_text(f'<mujoco model="robot">{more}<worldbody>{body}</worldbody></mujoco>')
    return file


@pytest.mark.parametrize(
    ("name", "frame", "mass", "nv"),
    [
        ("humanoid.xml", "right_foot", 42.116, 17),
        ("half_cheetah.xml", "bfoot", 14.0, 9),  # <compiler settotalmass="14"/>
        ("hopper.xml", "foot", 15.820, 6),
        ("walker2d_v5.xml", "foot", 23.677, 9),
        ("ant.xml", "aux_1", None, 8),
        ("swimmer.xml", "back", 106.814, 5),
        ("pusher_v5.xml", "tips_arm", None, 7),  # without the objects on the table
        ("inverted_pendulum.xml", "pole", 15.491, 2),
    ],
)
def test_models_of_gymnasium(name, frame, mass, nv):
    leg = kd.Leg.from_mjcf(MODELS / name, frame)
    assert leg.nv == nv
    model = leg.model
    if mass is not None:
        assert sum(body.mass for body in model.inertias) == pytest.approx(mass, abs=5e-4)
    assert leg.posture(leg.configuration()).condition < 1e4


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_the_humanoid_has_the_inertia_that_pinocchios_reader_gives_it(base):
    """That one merges the joints of a body, in the order of the file, and keeps the free joint."""
    leg = kd.Leg.from_mjcf(MODELS / "humanoid.xml", "right_foot", base=base)
    theirs = pin.buildModelFromMJCF(str(MODELS / "humanoid.xml"))
    draw = np.random.default_rng(0)
    for _ in range(5):
        angles = draw.uniform(-1, 1, 17)
        q = pin.neutral(theirs)
        q[7:] = angles
        inertia = pin.crba(theirs, theirs.createData(), q)
        posture = leg.posture(np.concatenate([pin.neutral(leg.model)[:-17], angles]))
        np.testing.assert_allclose(
            posture.inertia, inertia[-leg.nv :, -leg.nv :], rtol=0, atol=1e-12
        )


def test_limits_of_the_humanoid_come_from_joints_and_actuators():
    leg = kd.Leg.from_mjcf(MODELS / "humanoid.xml", "right_foot")
    knee = leg.velocity_index("right_knee")
    assert leg.joint_range("right_knee") == pytest.approx(np.radians([-160, -2]))
    assert leg.effort_limit[knee] == 200 * 0.4  # gear times ctrlrange
    assert leg.model.armature[knee] == 0.006
    assert np.isinf(leg.velocity_limit).all()


def test_without_mujoco_it_says_what_to_install():
    script = f"""
import sys
sys.modules["mujoco"] = None
import kickdyn as kd
try:
    kd.Leg.from_mjcf({str(MODELS / "ant.xml")!r}, "torso")
except kd.InvalidInput as error:
    print(error)
"""
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True
    )
    assert run.stdout.strip().endswith(
        'ant.xml: MJCF needs the package mujoco: install it with pip install "kickdyn[mjcf]"'
    )
