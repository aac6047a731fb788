"""The C3D files of the guide and the notebook are what their script makes, with the truth."""

import re
from pathlib import Path

import numpy as np
import pytest

import kickdyn as kd

ROOT = Path(__file__).resolve().parents[2]
measured_kicks = pytest.importorskip("measured_kicks", reason="tools come with the checkout only")


@pytest.mark.parametrize("number", [0, 1])
def test_files_are_those_of_the_script(number):
    surface = list(measured_kicks.KICKS)[number]
    track = kd.BodyTrack.from_c3d(ROOT / "data" / f"kick_{surface}.c3d")
    assert track.markers == (*measured_kicks.MARKERS, "ball")
    made = measured_kicks.record(surface, np.random.default_rng(number))
    assert track.positions == pytest.approx(made, abs=1e-6, nan_ok=True)


def test_the_truth_is_beside_them():
    page = (ROOT / "data" / "README.md").read_text("utf-8")
    rows = [re.findall(r"\| (\d+\.\d+) \| (\d+\.\d+) \|", line) for line in page.splitlines()]
    shown = np.array([row[0] for row in rows if row], dtype=float).T
    for values, surface in zip(shown, measured_kicks.KICKS, strict=True):
        hit = measured_kicks.impact(surface)
        names = hit.posture.leg.joint_names
        sizes = dict(zip(names, np.linalg.norm(hit.joint_impulses[:, :3], axis=1), strict=True))
        truth = [np.linalg.norm(hit.foot_velocity), hit.ball_after.speed]
        truth += [sizes[joint] for joint in ("hip", "knee", "ankle")]
        assert values == pytest.approx(truth, rel=1e-3)


@pytest.mark.parametrize(("height", "lines"), [(1.65, 0), (1.72, 1)])
def test_a_leg_of_another_height_is_noticed(height, lines):
    page = (ROOT / "docs" / "how-to" / "measured-impacts.md").read_text("utf-8")
    (places,) = re.findall(r"^markers = (\{.*?^\})", page, re.DOTALL | re.MULTILINE)
    person = {"mass": 58, "sex": "female", "side": "right", "model": "3d"}
    leg = kd.Leg.human(height=height, base="floating", frame="instep", **person)
    track = kd.BodyTrack.from_c3d(ROOT / "data" / "kick_instep.c3d")
    few = kd.BodyTrack(track.times[::4], track.markers, track.positions[::4])
    motion = kd.fit_motion(few, leg, eval(places), contact=0.2007)
    assert len(motion.warnings) == lines
    for line in motion.warnings:
        assert re.match(
            r"the places .* or the height of the leg, do not fit: .*'\w+' by 1\d mm", line
        )
