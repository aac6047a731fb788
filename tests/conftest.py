"""For all tests: the same examples in every run; a well-formed leg, ways to spoil and load it."""

import pytest
from hypothesis import settings

import kickdyn as kd

settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")

GOOD = """<robot name="leg">
  <link name="base"/>
  <joint name="hip" type="revolute">
    <parent link="base"/>
    <child link="thigh"/>
    <origin xyz="0 0 1" rpy="0 0 0"/>
    <axis xyz="0 -1 0"/>
    <limit lower="-1" upper="2" effort="100" velocity="9"/>
  </joint>
  <link name="thigh">
    <inertial>
      <origin xyz="0 0 -0.2"/>
      <mass value="7"/>
      <inertia ixx="0.08" ixy="0" ixz="0" iyy="0.07" iyz="0" izz="0.02"/>
    </inertial>
    <visual><geometry><sphere radius="0.05"/></geometry></visual>
  </link>
  <joint name="knee" type="revolute">
    <parent link="thigh"/>
    <child link="shank"/>
    <origin xyz="0 0 -0.4"/>
    <axis xyz="0 1 0"/>
    <limit lower="0" upper="2.5" effort="80" velocity="20"/>
  </joint>
  <link name="shank">
    <inertial>
      <mass value="3"/>
      <inertia ixx="0.05" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.03"/>
    </inertial>
  </link>
  <joint name="tip" type="fixed">
    <parent link="shank"/>
    <child link="toe"/>
    <origin xyz="0 0 -0.4"/>
  </joint>
  <link name="toe"/>
</robot>
"""


@pytest.fixture(scope="session")
def good_urdf():
    return GOOD


@pytest.fixture
def spoil():
    """Return the good leg with each `old` replaced by its `new`; every edit must bite."""

    def spoilt(*edits):
        text = GOOD
        for old, new in edits:
            assert old in text
            text = text.replace(old, new, 1)
        return text

    return spoilt


@pytest.fixture
def load(tmp_path):
    """Write text or bytes to a file and load it as a leg."""

    def loaded(content, frame="toe"):
        path = tmp_path / "leg.urdf"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return kd.Leg.from_urdf(path, frame)

    return loaded
