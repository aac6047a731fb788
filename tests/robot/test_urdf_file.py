"""Every bad robot we know of: refused by a line that names the culprit, or taken on purpose."""

import html
import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.robot.leg import NO_DRIVES
from kickdyn.robot.robot_file import MAX_BYTES
from kickdyn.robot.urdf_file import read_urdf

LAUGHS = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10))
LAUGHS = f'<!DOCTYPE r [<!ENTITY a0 "ha">{LAUGHS}]><robot name="&a9;"/>'

BAD_TEXT = {
    "empty": (b"", "is empty"), "not XML": (b"solid teapot", "not well-formed XML"),
    "HTML": (b"<html><body>404</body></html>", "<html>, not <robot>"),
    "an MJCF": (b"<mujoco/>", "Leg.from_mjcf"),
    "entity": (b'<!DOCTYPE r [<!ENTITY m "7">]><robot name="&m;"/>', "DOCTYPE"),
    "billion laughs": (LAUGHS.encode(), "DOCTYPE"),
    "latin-1": ('<robot name="\u00e9t\u00e9"/>'.encode("latin-1"), r"not UTF-8 text \(byte 13\)"),
    "200 000 tags deep": (b"<a>" * 200_000 + b"</a>" * 200_000, "deeper than 64")}  # fmt: skip


@pytest.mark.parametrize("name", BAD_TEXT)
def test_bad_text_is_refused(load, name):
    content, said = BAD_TEXT[name]
    with pytest.raises(kd.UrdfError, match=said) as refusal:
        load(content)
    (fault,) = refusal.value.faults
    assert len(fault) < 200


@pytest.mark.parametrize(("make", "said"), [
    (lambda path: None, "no such file"), (Path.mkdir, "not a regular file"),
    (os.mkfifo, "not a regular file"), (lambda path: path.symlink_to(path), "symbolic links"),
    (lambda path: (path.touch(), os.truncate(path, MAX_BYTES + 1)), "5000001 bytes"),
], ids=["missing", "directory", "FIFO", "link to itself", "5 MB"])  # fmt: skip
def test_what_is_no_file_is_refused_at_once(tmp_path, make, said):
    path = tmp_path / "leg.urdf"
    make(path)
    with pytest.raises(kd.UrdfError, match=said) as refusal:
        read_urdf(path)
    assert refusal.value.source == str(path)


# What only Pinocchio finds, which says so on file descriptor 2 alone.
@pytest.mark.parametrize(("old", "new", "said"), [
    ("<child link", '<dynamics damping="x"/><child link', r"cannot read it: .*\(x\)"),
    ("<child link", '<safety_controller k_velocity="x"/><child link', "k_velocity"),
    ("<robot", '<robot version="x"', "version attribute"),
    ('value="7"', 'value=" 7 "', r"complains: .*\[ 7 \]"),  # it would be dropped
    ("<visual>", '<visual><material name="m"><color rgba="a b c d"/></material>', r"\[m\]"),
])  # fmt: skip
def test_pinocchio_tells_why_it_refuses(spoil, load, capfd, old, new, said):
    with pytest.raises(kd.UrdfError, match=f"Pinocchio .*{said}"):
        load(spoil((old, new)))
    assert capfd.readouterr().err == ""


THIGH_MASS = '<mass value="7"/>'
THIGH_INERTIA = '<inertia ixx="0.08" ixy="0" ixz="0" iyy="0.07" iyz="0" izz="0.02"/>'
SHANK_INERTIAL = re.compile(r'<inertial>\s*<mass value="3"/>.*?</inertial>', re.DOTALL)
LIMIT = '<limit lower="0" upper="2.5" effort="80" velocity="20"/>'
AXIS = '<axis xyz="0 1 0"/>'
KNEE = 'name="knee" type="revolute"'
SPHERE = '<sphere radius="0.05"/>'
PARENT = '<parent link="thigh"/>'
END = "</robot>"
CLOSE = '<joint name="close" type="fixed"><parent link="base"/><child link="toe"/></joint></robot>'


def inertia(xx, yy, zz, xy=0):
    return f'<inertia ixx="{xx}" ixy="{xy}" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>'


def mass(*values):
    return [
        (THIGH_MASS, f'<mass value="{x}"/>', "mass value is .*must be a finite number")
        for x in values
    ]


def moments(*values, xy=0, said="'hip' moves .*triangle"):
    return THIGH_INERTIA, inertia(*values, xy=xy), said


REFUSED = [
    ('<robot name="leg">', "<model>", "<model>"), ('name="leg"', "", "robot has no name"),
    # mass and inertia
    (THIGH_MASS, '<mass value="0"/>', r"'hip' moves .*\(mass 0"),
    (THIGH_MASS, '<mass value="-7"/>', "'hip' moves .*mass -7 kg"),
    *mass("heavy", "1,5", "nan", "inf", "1e400", "0x10", "1_000", "\u0667", "", "9" * 9999),
    moments(1, "nan", 1, said="iyy is 'nan'"), ('ixx="0.08"', "", "has no ixx"), moments(1, 1, -1),
    moments(1, 1, 1, xy=2), moments(1e300, 1e300, 1e300, said=r"'hip' moves .* below 1e\+100"),
    moments(1, 1, 2.02),  # the triangle inequality is broken by 1 %
    (THIGH_MASS, THIGH_MASS * 2, "'thigh' inertial has 2 of <mass>"),
    ('xyz="0 0 -0.2"', 'xyz="0 0 nan"', "xyz is '0 0 nan'"),
    ('xyz="0 0 -0.4"', 'xyz="0 0 -1e200"', r"'knee' .*below 1e\+100 m"),
    (SHANK_INERTIAL, "", "'knee' moves .*mass 0 kg"),
    # tree
    (re.compile(r"\n.*(?=</robot>)", re.DOTALL), "", "has no link"),
    (END, '<link name="stray"/></robot>', r"2 roots \(base, stray\)"),
    ('<parent link="base"/>', '<parent link="toe"/>', "form a loop"),
    (PARENT, '<parent link="thihg"/>', "'knee' parent is 'thihg'"),
    ('<child link="shank"/>', "", "'knee' has no child"), (END, CLOSE, "'toe' has two parents"),
    (END, '<link name="toe"/></robot>', "'toe' is used 2 times"),
    (KNEE, 'name="hip" type="revolute"', "'hip' is used 2 times"),
    # joints
    *((KNEE, f'name="knee" type="{kind}"', f"'knee' type is '{kind}'")
      for kind in ("hinge", "", "planar", "floating")),
    (LIMIT, "", "'knee' has no <limit>: .*continuous"),
    *((LIMIT, re.sub(f'{key}="[^"]*"', f'{key}="{value}"', LIMIT), rf"knee.*{key} is '{value}'")
      for key in ("lower", "upper", "effort", "velocity") for value in ("", "80 Nm", "nan")),
    ('effort="80"', "", "knee.*no effort"),
    ('upper="2.5"', 'upper="-1"', r"'knee' is \[0.0, -1.0\]: lower must not exceed upper"),
    ("<link", '<x:property xmlns:x="http://www.ros.org/wiki/xacro"/><link', "xacro FILE"),
    *((AXIS, f'<axis xyz="{xyz}"/>', f"'knee' axis is '{xyz}'")
      for xyz in ("0 0 0", "0 nan 0", "0 1", "", "0 1e-200 0", "0 1e200 0")),
    # names
    (KNEE, 'name="universe" type="revolute"', "'universe' is reserved"),
    ('<link name="toe"/>', "<link/>", "link has no name"),
    (KNEE, 'name="a&#10;&lt;x&gt;" type="revolute"', r"'a\\n<x>' is not a printable"),
    (KNEE, f'name="{"x" * 9999}" type="revolute"', "'x{40}' is not .*at most 200"),
    # shapes
    (SPHERE, '<box size="1 2"/>', r"\[1 2\]")]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "said"), REFUSED, ids=lambda value: str(value)[:50])
def test_a_bad_robot_is_refused_by_name(good_urdf, load, capfd, old, new, said):
    if isinstance(old, str):
        old = re.compile(re.escape(old))
    text, count = old.subn(lambda _: new, good_urdf)
    assert count
    if new == "<model>":
        text = text.replace("</robot>", "</model>")
    with pytest.raises(kd.UrdfError) as refusal:
        load(text)
    faults = refusal.value.faults
    assert any(re.search(said, fault) for fault in faults), faults
    assert all(len(fault) < 250 for fault in faults), faults
    assert len(faults) == 1 or "name" in faults[0], faults
    assert capfd.readouterr().err == ""


# What is accepted, and why: it means what it says, and Pinocchio takes it as it stands.
ACCEPTED = {
    "as it is, without mass on base and toe, which are fixed": ("", ""),
    "link and joint of one name": (KNEE, 'name="shank" type="revolute"'),
    "an axis of any sound length": (AXIS, '<axis xyz="0 1e-20 0"/>'),
    "0 mass and 0 inertia on what is fixed: no body": (
        '<link name="toe"/>',
        f'<link name="toe"><inertial><mass value="0"/>{inertia(0, 0, 0)}</inertial></link>',
    ),
    "a flat body": (THIGH_INERTIA, inertia(0.013, 0.027, 0.04, xy=0.002)),
    "a limit of no width": ('upper="2.5"', 'upper="0"'),
    "what it does not know": (END, "<gazebo><x/></gazebo><transmission/></robot>"),
    "a mesh anywhere": (SPHERE, '<mesh filename="package://../../etc/passwd"/>'),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_an_odd_but_sound_robot_is_taken_unchanged(spoil, load, capfd, name):
    leg = load(spoil(ACCEPTED[name]))
    assert [inertia.mass for inertia in leg.model.inertias] == [0, 7, 3]
    assert len(leg.joint_names) == 2
    assert all(name.isprintable() for name in leg.joint_names)
    assert leg.posture([0.1, 0.2]).effective_mass([1, 0, 0]) > 0
    assert capfd.readouterr().err == ""


LINK = '<link name="toe"><inertial><mass value="{}"/>{}</inertial></link>'
TOE = '<link name="toe"/>'


@pytest.mark.parametrize(("edit", "culprit"), [
    (("", ""), None), ((TOE, LINK.format(0, inertia(0, 0, 1e-12))), None),  # no body
    ((TOE, LINK.format(1, inertia(0, 0, 0))), None),  # a mass at a point
    ((TOE, LINK.format(1e-14, inertia(1e-9, 1e-9, 3e-9))), "no body has (toe)"),
    ((LIMIT, '<limit upper="2" effort="8" velocity="9"/>'), "limit (knee)"),
    ((LIMIT, '<limit lower="-2" effort="8" velocity="9"/>'), "limit (knee)"),
    *(((LIMIT, f'<limit lower="0" upper="2.5" effort="{x}" velocity="{x}"/>'), "inf (knee)")
      for x in (0, -1, "inf"))])  # fmt: skip
def test_an_irregular_file_is_read_as_it_is_with_a_line(spoil, load, edit, culprit):
    leg = load(spoil(edit))
    *lines, last = leg.warnings
    assert last == NO_DRIVES
    assert [culprit in line for line in lines] == ([True] if culprit else [])
    assert all(line in html.unescape(leg._repr_html_()) for line in leg.warnings)
    if culprit == "limit (knee)":  # the URDF specification says 0
        assert leg.joint_range("knee") in ((0, 2), (-2, 0))
    if culprit == "inf (knee)":
        assert (leg.effort_limit[1], leg.velocity_limit[1]) == (math.inf, math.inf)


def test_bodies_that_are_fixed_to_each_other_are_judged_together(spoil, load):
    (shank,) = SHANK_INERTIAL.findall(spoil())  # it comes from behind a fixed joint
    leg = load(spoil((shank, ""), (TOE, f'<link name="toe">{shank}</link>')))
    assert [body.mass for body in leg.model.inertias] == [0, 7, 3]
    assert leg.model.inertias[2].lever == pytest.approx([0, 0, -0.4])
    with pytest.raises(kd.UrdfError, match=r"'knee' .*triangle"):
        load(spoil((TOE, LINK.format(1, inertia(1, 1, 3)))))


def test_a_joint_may_have_the_name_of_the_base(spoil, tmp_path):
    path = tmp_path / "leg.urdf"
    base = f'<link name="base"><inertial><mass value="9"/>{inertia(1, 1, 1)}</inertial></link>'
    edits = ('<link name="base"/>', base), ('name="knee"', 'name="root_joint"')
    path.write_text(spoil(*edits))
    leg = kd.Leg.from_urdf(path, base="floating")
    assert leg.joint_names == ("root_joint2", "hip", "root_joint")
    assert leg.joint_range("root_joint") == (0, 2.5)
    assert not kd.check(path).problems


def test_joints_may_be_locked_before_inertias_are_judged(spoil, tmp_path):
    path = tmp_path / "leg.urdf"
    (shank,) = SHANK_INERTIAL.findall(spoil())
    path.write_text(spoil((shank, "")))
    leg = kd.Leg.from_urdf(path, locked={"knee": 0.5})
    assert leg.joint_names == ("hip",)
    toe = [-0.4 * np.sin(0.5), 0, 0.6 - 0.4 * np.cos(0.5)]
    assert leg.posture([0.0]).contact_point == pytest.approx(toe)
    for locked, said in (
        ({}, "'knee' moves .*locked="), ({"kne": 0}, "'kne' is unknown: .*'knee'"),
        ({"knee": "x"}, "knee is 'x'"), ({"knee": 0, "hip": 0}, "all joints"),
        (["knee"], r"locked is \['knee'\]"),
    ):  # fmt: skip
        with pytest.raises(kd.InvalidInput, match=said):
            kd.Leg.from_urdf(path, locked=locked)


def chain(kinds, masses=None):
    """A chain of links, joined by joints of the given kinds."""
    lines = ['<robot name="chain"><link name="l0"/>']
    for i, kind in enumerate(kinds):
        lines.append(
            f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="0 0 -0.1"/>{AXIS}'
            '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint><link '
            f'name="l{i + 1}"><inertial><mass value="{masses[i] if masses else 1.0!r}"/>'
            f"{inertia(1, 1, 1)}</inertial></link>"
        )
    return "".join([*lines, END])


def test_chains_have_an_end(load):
    for kinds, said in (
        (["revolute"] * 251, "252 links and 251 moving joints: at most 3000 and 250"),
        (["fixed"] * 4000, "4001 links and 0 moving"),  # Pinocchio would overflow its stack
    ):
        with pytest.raises(kd.UrdfError, match=said):
            load(chain(kinds), "l1")
    with pytest.raises(kd.UrdfError, match="no moving joint"):
        load(chain(["fixed"]), "l1")
    leg = load(chain(["revolute"] + ["fixed"] * 998), "l999")
    assert leg.posture([0.0]).contact_point == pytest.approx([0, 0, -99.9])
    assert leg.model.inertias[1].mass == pytest.approx(999, rel=closed_form(10))
