"""A robot of your own, from a URDF file: its effective mass, and an impact with a ball."""

from pathlib import Path

import kickdyn as kd

LINK = """
  <joint name="{joint}" type="revolute">
    <parent link="{parent}"/> <child link="{link}"/>
    <origin xyz="0 0 {z}"/> <axis xyz="0 {sign} 0"/>
    <limit lower="-1.5" upper="1.5" effort="60" velocity="14"/>
  </joint>
  <link name="{link}">
    <inertial> <origin xyz="0 0 -0.1"/> <mass value="{mass}"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.002" ixy="0" ixz="0" iyz="0"/> </inertial>
    <visual> <origin xyz="0 0 -0.12"/>
      <geometry> <cylinder radius="0.03" length="0.24"/> </geometry> </visual>
  </link>"""
thigh = LINK.format(joint="hip", parent="base", link="thigh", z=0, sign=-1, mass=2.0)
shank = LINK.format(joint="knee", parent="thigh", link="shank", z=-0.25, sign=1, mass=1.2)
toe = """<joint name="tip" type="fixed"> <parent link="shank"/> <child link="toe"/>
  <origin xyz="0 0 -0.25"/> </joint> <link name="toe"/>"""
file = Path("own_robot.urdf")
file.write_text(f'<robot name="own_robot"> <link name="base"/>{thigh}{shank}{toe}</robot>')

leg = kd.Leg.from_urdf(file, frame="toe")  # refuses a faulty file with a list of its faults
posture = leg.posture(leg.configuration({"hip": 0.2, "knee": 0.5}))
ball = kd.Ball(mass=0.2, radius=0.07)
contact = kd.Contact((1, 0, 0.2), restitution=0.7, friction=0.3)
impact = kd.strike(posture, posture.joint_velocity((3, 0, 0.6)), ball, contact)
print(impact)
kd.page(impact).save("own_robot.html")
