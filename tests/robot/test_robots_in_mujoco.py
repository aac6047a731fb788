"""Robots of the catalogue, with their drives, against MuJoCo."""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.robot.catalog import ROBOTS, robots_folder

COMMON = ("g1", "talos", "bolt", "simple_humanoid")
"""Robots whose URDF MuJoCo compiles: links of icub have impossible inertias, which kickdyn takes
where the composite inertia is sound, and links of romeo and human have no mass."""

AXES = 0.0 if mujoco.mj_version() >= 400 else 1e-6
"""Relative error of the principal axes of inertia that older versions of MuJoCo compute."""


def bare_urdf(name):
    """The URDF of a robot without shapes, whose meshes MuJoCo would look for elsewhere."""
    root = ET.fromstring((robots_folder() / ROBOTS[name].file).read_text())
    for link in root.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    options = {"fusestatic": "false", "balanceinertia": "false"}
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", options)
    return root


@pytest.mark.parametrize("name", COMMON)
def test_the_joint_space_inertia_is_that_of_mujoco(name):
    model = mujoco.MjModel.from_xml_string(ET.tostring(bare_urdf(name), encoding="unicode"))
    leg, data = kd.Leg.from_robot(name), mujoco.MjData(model)
    joints = [model.joint(int(joint)).name for joint in model.dof_jntid]
    order = [leg.velocity_index(joint) for joint in joints]
    model.dof_armature[:] = leg.model.armature[order]
    assert leg.model.armature.any() == (name != "simple_humanoid")
    for q in np.random.default_rng(1).uniform(-1, 1, size=(5, leg.nq)):
        data.qpos[:] = q[order]
        mujoco.mj_forward(model, data)
        inertia = np.zeros((leg.nv, leg.nv))
        for column, unit in zip(inertia, np.eye(leg.nv), strict=True):
            mujoco.mj_mulM(model, data, column, unit)
        ours = leg.posture(q).inertia[np.ix_(order, order)]
        rounding = max(AXES, 1e-14) * np.abs(inertia).max()
        assert ours == pytest.approx(inertia, abs=rounding)


def as_mjcf(root, armature):
    """Return an MJCF with the bodies, joints and inertias of a URDF, and rotors."""
    links = {link.get("name"): link for link in root.findall("link")}
    children = {name: [] for name in links}
    for joint in root.findall("joint"):
        children[joint.find("parent").get("link")].append(joint)

    def numbers(element, key):
        text = "0 0 0" if element is None else element.get(key, "0 0 0")
        return np.array(text.split(), dtype=float)

    def text(values):
        return " ".join(map(repr, np.asarray(values, dtype=float).tolist()))

    def add(above, name, joint):
        origin = None if joint is None else joint.find("origin")
        place = {"pos": text(numbers(origin, "xyz")), "euler": text(numbers(origin, "rpy"))}
        body, inertial = (
            ET.SubElement(above, "body", name=name, **place),
            links[name].find("inertial"),
        )
        if joint is not None and joint.get("type") != "fixed":
            axis, rotor = text(numbers(joint.find("axis"), "xyz")), armature[joint.get("name")]
            ET.SubElement(body, "joint", name=joint.get("name"), axis=axis, armature=repr(rotor))
        if inertial is not None:
            keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
            x, xy, xz, y, yz, z = (float(inertial.find("inertia").get(key)) for key in keys)
            turn = pin.rpy.rpyToMatrix(*numbers(inertial.find("origin"), "rpy"))
            moments = turn @ [[x, xy, xz], [xy, y, yz], [xz, yz, z]] @ turn.T
            full = text([*moments.diagonal(), *moments[0, 1:], moments[1, 2]])
            mass, centre = (
                inertial.find("mass").get("value"),
                numbers(inertial.find("origin"), "xyz"),
            )
            ET.SubElement(body, "inertial", mass=mass, pos=text(centre), fullinertia=full)
        for below in children[name]:
            add(body, below.find("child").get("link"), below)

    mjcf = ET.Element("mujoco")
    ET.SubElement(mjcf, "compiler", angle="radian", eulerseq="XYZ", autolimits="false")
    below = {joint.find("child").get("link") for joint in root.findall("joint")}
    (base,) = links.keys() - below
    add(ET.SubElement(mjcf, "worldbody"), base, None)
    return ET.tostring(mjcf, encoding="unicode")


@pytest.mark.parametrize("name", ["g1", "bolt"])
def test_a_urdf_with_drives_strikes_as_an_mjcf_with_rotors(name, tmp_path):
    leg = kd.Leg.from_robot(name, ROBOTS[name].foot)
    rotors = {
        joint: float(leg.model.armature[leg.velocity_index(joint)]) for joint in leg.joint_names
    }
    file = tmp_path / "robot.xml"
    file.write_text(as_mjcf(bare_urdf(name), rotors))
    other = kd.Leg.from_mjcf(file, ROBOTS[name].foot)
    for values in np.random.default_rng(2).uniform(-0.5, 0.5, size=(3, leg.nv)):
        q = dict(zip(leg.joint_names, values.tolist(), strict=True))
        hits = []
        for robot in (leg, other):
            posture = robot.posture(robot.configuration(q))
            v = posture.joint_velocity([3, 0.5, 1])
            hits.append(kd.strike(posture, v, kd.Ball(), kd.Contact((3, 0, 1), 0.8, 0.3)))
        ours, theirs = hits
        assert theirs.impulse == pytest.approx(ours.impulse, rel=max(AXES, 1e-9))
        assert theirs.effective_mass == pytest.approx(ours.effective_mass, rel=max(AXES, 1e-9))
        jumps = [
            {joint: hit.v_after[robot.velocity_index(joint)] for joint in leg.joint_names}
            for hit, robot in ((ours, leg), (theirs, other))
        ]
        size = max(map(abs, jumps[0].values()))
        assert jumps[1] == pytest.approx(jumps[0], abs=max(AXES, 1e-9) * size)
