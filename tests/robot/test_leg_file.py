"""One reader of leg files, whatever their format."""

import pytest

import kickdyn as kd
from kickdyn.robot.leg_file import read_leg

MJCF = """<mujoco><worldbody><body><joint name="hip" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.8" size="0.05"/><site name="toe" pos="0 0 -0.8"/>
</body></worldbody></mujoco>"""


def test_the_root_element_tells_the_formats_apart(tmp_path):
    """The files' names do not: both are XML."""
    urdf, mjcf = tmp_path / "a.xml", tmp_path / "b.xml"
    urdf.write_text(kd.Leg.human().file.text)
    mjcf.write_text(MJCF)
    assert read_leg(urdf, "toe", "fixed").joint_names == ("hip", "knee", "ankle")
    assert read_leg(mjcf, "toe", "fixed").joint_names == ("hip",)


def test_folders_of_packages_are_for_a_urdf(tmp_path):
    mjcf = tmp_path / "b.xml"
    mjcf.write_text(MJCF)
    with pytest.raises(kd.InvalidInput, match="package-dir is 'meshes': it is for a URDF file"):
        read_leg(mjcf, "toe", "fixed", ["meshes"])
