import numpy as np
import pytest

import kickdyn as kd
from kickdyn.robot.urdf_file import build_model


def test_floating_base_of_a_urdf(good_urdf, tmp_path):
    path = tmp_path / "leg.urdf"
    path.write_text(good_urdf.replace('<link name="base"/>', BASE))
    fixed, floating = (kd.Leg.from_urdf(path, base=base) for base in ("fixed", "floating"))
    assert floating.joint_names == ("root_joint", *fixed.joint_names)
    q = floating.configuration({"hip": 0.3, "knee": 0.5})
    assert q[:7].tolist() == [0, 0, 0, 0, 0, 0, 1]
    ours, theirs = floating.posture(q), fixed.posture(q[7:])
    assert ours.contact_point == pytest.approx(theirs.contact_point, abs=1e-15)
    assert ours.inertia[6:, 6:] == pytest.approx(theirs.inertia, abs=1e-14)
    assert ours.inertia[:3, :3] == pytest.approx(14 * np.eye(3))  # base 4, thigh 7, shank 3 kg
    assert ours.effective_mass([1, 0, 0]) < theirs.effective_mass([1, 0, 0])
    assert floating.angles_deg(q) == pytest.approx(fixed.angles_deg(q[7:]))
    with pytest.raises(kd.InvalidInput, match=r"length 1"):
        floating.posture(np.zeros(9))


def test_bad_base_is_refused(good_urdf, tmp_path):
    path = tmp_path / "leg.urdf"
    path.write_text(good_urdf)
    with pytest.raises(kd.InvalidInput, match="base is 'free': it must be fixed or floating"):
        kd.Leg.from_urdf(path, base="free")
    # a base without mass floats well enough: the thigh moves with it
    assert kd.Leg.from_urdf(path, base="floating").nv == 8


BASE = """<link name="base"><inertial><mass value="4"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>"""


def test_what_pinocchio_says_is_passed_on(spoil):
    text = spoil(('<mass value="7"/>', '<mass value="seven"/>'))
    with pytest.raises(kd.UrdfError, match=r"^leg: Pinocchio complains; .*mass"):
        build_model(text, "leg", "fixed")
    with pytest.raises(kd.UrdfError, match=r"^leg: Pinocchio cannot read it"):
        build_model("<robot/>", "leg", "fixed")
    text = spoil(('<limit lower="0"', '<dynamics damping="much"/><limit lower="0"'))
    with pytest.raises(kd.UrdfError) as caught:
        build_model(text, "leg", "fixed")
    first, why, *_ = caught.value.faults
    assert (first, why) == ("Pinocchio cannot read it", "damping value (much) is not a valid float")
    assert not [fault for fault in caught.value.faults if "Error" in fault or "at line" in fault]
