"""Every bad robot we know of: refused by a line that names the culprit, or taken on purpose."""

import html
import os
import re
import threading
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.robot.leg import NO_DRIVES
from kickdyn.robot.package_files import MAX_BYTES
from kickdyn.robot.urdf_file import build_model, find_irregularities, read_urdf

LAUGHS = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10))

BAD_TEXT = {
    "empty": (b"", "is empty"),
    "blank": (b" \n\t", "is empty"),
    "not XML": (b"solid teapot", "not well-formed XML"),
    "cut off": (
        b'<robot name="leg"><link name="base"/>',
        r"not well-formed XML \(no element found",
    ),
    "NUL": (b'<robot name="l\0"/>', "not well-formed XML"),
    "HTML": (b"<html><body>404</body></html>", "its root is <html>, not <robot>"),
    "HTML page": (b"<!DOCTYPE html><html><head>", "is an HTML page"),
    "entity": (b'<!DOCTYPE r [<!ENTITY m "7">]><robot name="&m;"/>', "has a DOCTYPE"),
    "file entity": (b'<!DOCTYPE r [<!ENTITY m SYSTEM "/etc/passwd">]><r>&m;</r>', "has a DOCTYPE"),
    "external DTD": (b'<!DOCTYPE r SYSTEM "http://example.org/x.dtd"><r/>', "has a DOCTYPE"),
    "billion laughs": (
        f'<!DOCTYPE r [<!ENTITY a0 "ha">{LAUGHS}]><robot name="&a9;"/>'.encode(),
        "has a DOCTYPE",
    ),
    "entity of nowhere": (b'<robot name="&m;"/>', "undefined entity"),
    "UTF-16": ('<robot name="leg"/>'.encode("utf-16"), r"not UTF-8 text \(byte 0\)"),
    "latin-1": ('<robot name="\u00e9t\u00e9"/>'.encode("latin-1"), r"not UTF-8 text \(byte 13\)"),
    "lone surrogate": (b'<robot name="\xed\xa0\x80"/>', "not UTF-8"),
    "200 000 tags deep": (
        b"<a>" * 200_000 + b"</a>" * 200_000,
        "nests tags deeper than 64",
    ),
    "an attribute twice": (b"<a " + b'a="" ' * 2 + b"/>", "duplicate attribute"),
    "another namespace": (b'<robot xmlns="http://x" name="a"/>', "its root is <{http://x}robot>"),
}


@pytest.mark.parametrize(("content", "said"), BAD_TEXT.values(), ids=BAD_TEXT)
def test_bad_text_is_refused(load, content, said):
    with pytest.raises(kd.UrdfError, match=said) as caught:
        load(content)
    assert len(caught.value.faults) == 1
    assert len(caught.value.faults[0]) < 200


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.encode("utf-8-sig"),
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: f'<?xml version="1.0" encoding="latin-1"?>{text}'.encode(),
        lambda text: f'<?xml version="1.0"?><!-- a --><?b c?>\n{text}<!-- d -->'.encode(),
        lambda text: text.replace('"7"', '"&#55;"').encode(),
        lambda text: text.replace("<robot", '<robot xmlns:x="http://x"').encode(),
        lambda text: text.replace("<mass", "<![CDATA[<mass value='9'/>]]><mass").encode(),
    ],
    ids=["BOM", "CRLF", "declared latin-1", "instruction", "numeric", "prefix", "CDATA"],
)
def test_what_xml_allows_changes_nothing(good_urdf, load, change):
    leg = load(change(good_urdf))
    assert [inertia.mass for inertia in leg.model.inertias] == [0, 7, 3]
    assert leg.joint_names == ("hip", "knee")


def test_utf8_it_is_whatever_it_declares(spoil, load):
    text = spoil(('name="knee"', 'name="g\u00e9nou"'))
    assert load(f'<?xml version="1.0" encoding="latin-1"?>{text}').joint_names[1] == "g\u00e9nou"


def fifo(path):
    os.mkfifo(path)


def big(path):
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: None, "there is no such file"),
        (Path.mkdir, "is not a regular file"),
        (fifo, "is not a regular file"),
        (lambda path: path.symlink_to("/dev/zero"), "is not a regular file"),
        (lambda path: path.symlink_to(path), "cannot be read .*symbolic links"),
        (lambda path: path.symlink_to(path.parent / "gone"), "there is no such file"),
        (big, "has 5000001 bytes: at most 5000000 are read"),
    ],
    ids=["missing", "directory", "FIFO", "device", "link to itself", "link to nothing", "5 MB"],
)
def test_what_is_no_file_is_refused_at_once(tmp_path, make, said):
    path = tmp_path / "leg.urdf"
    make(path)
    with pytest.raises(kd.UrdfError, match=said) as caught:
        read_urdf(path)
    assert caught.value.source == str(path)
    assert str(caught.value).count(str(path)) == 1


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable_file_is_refused(tmp_path, good_urdf):
    path = tmp_path / "leg.urdf"
    path.write_text(good_urdf)
    path.chmod(0)
    with pytest.raises(kd.UrdfError, match="ermission denied"):
        read_urdf(path)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("http://example.org/leg.urdf", "^http://example.org/leg.urdf: there is no such file"),
        ("leg\0.urdf", "cannot be read .*null"),
        ("x" * 5000, "cannot be read .*too long"),
        ("", "is not a regular file"),
        (b"leg.urdf", "must be a str or a Path"),
        (None, "must be a str or a Path"),
        (3, "must be a str or a Path"),
    ],
    ids=lambda value: repr(value)[:20],
)
def test_what_is_no_path_is_refused(path, said):
    with pytest.raises(kd.InvalidInput, match=said):
        read_urdf(path)


@pytest.mark.parametrize("kind", [str, Path], ids=["str", "Path"])
def test_good_file_by_any_name(tmp_path, good_urdf, kind):
    (tmp_path / "real").mkdir()
    path = tmp_path / "real" / "leg.urdf"
    path.write_text(good_urdf)
    link = tmp_path / "l\u00efnk with blanks"
    link.symlink_to(path)
    urdf = read_urdf(kind(link))
    assert urdf.folder == path.parent.resolve()  # where its meshes are
    assert urdf.source == str(link)
    assert kd.Leg.from_urdf(link).name == "leg"


def test_file_is_read_once(tmp_path, good_urdf):
    path = tmp_path / "leg.urdf"
    path.write_text(good_urdf)
    leg = kd.Leg.from_urdf(path)
    path.unlink()
    model = pin.buildModelFromXML(leg.file.text)
    assert [inertia.mass for inertia in model.inertias] == [0, 7, 3]


# What only Pinocchio finds, which says so on file descriptor 2 alone.
PINOCCHIO_REFUSES = {
    "damping": ("<child link", '<dynamics damping="x"/><child link', r"damping value \(x\)"),
    "safety": ("<child link", '<safety_controller k_velocity="x"/><child link', "k_velocity"),
    "version": ("<robot", '<robot version="x"', "version attribute"),
}
PINOCCHIO_DROPS = {
    "mass": ('value="7"', 'value=" 7 "', r"mass \[ 7 \] is not a float"),
    "colour": (
        "<visual>",
        '<visual><material name="m"><color rgba="a b c d"/></material>',
        r"Material \[m\] has malformed color",
    ),
}


@pytest.mark.parametrize(("old", "new", "said"), PINOCCHIO_REFUSES.values(), ids=PINOCCHIO_REFUSES)
def test_pinocchio_tells_why_it_refuses(spoil, load, capfd, old, new, said):
    with pytest.raises(kd.UrdfError, match=f"Pinocchio cannot read it; .*{said}"):
        load(spoil((old, new)))
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(("old", "new", "said"), PINOCCHIO_DROPS.values(), ids=PINOCCHIO_DROPS)
def test_nothing_is_dropped_in_silence(spoil, load, capfd, old, new, said):
    with pytest.raises(kd.UrdfError, match=f"Pinocchio complains; .*{said}"):
        load(spoil((old, new)))
    assert capfd.readouterr().err == ""


def test_stderr_is_given_back(good_urdf, load, capfd, monkeypatch):
    def build(text):
        os.write(2, "no \u00e9t\u00e9 \xff\n\n".encode("latin-1"))
        raise ValueError("three\npages")

    monkeypatch.setattr(pin, "buildModelFromXML", build)
    with pytest.raises(kd.UrdfError) as caught:
        load(good_urdf)
    assert caught.value.faults[1] == "no \ufffdt\ufffd \ufffd"
    os.write(2, b"still here")
    assert capfd.readouterr().err == "still here"


def test_silent_refusal_still_has_a_reason(good_urdf, load, monkeypatch):
    def build(text):
        raise ValueError("three\npages")

    monkeypatch.setattr(pin, "buildModelFromXML", build)
    with pytest.raises(kd.UrdfError, match=re.escape("Pinocchio cannot read it; three") + "$"):
        load(good_urdf)


def test_threads_do_not_lose_stderr(good_urdf, load):
    before = os.fstat(2).st_ino
    workers = [
        threading.Thread(target=lambda: [kd.Leg.human() for _ in range(30)]) for _ in range(4)
    ]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert os.fstat(2).st_ino == before


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
    with pytest.raises(kd.UrdfError, match=r"the base floats and has no mass: .* or fix the base"):
        kd.Leg.from_urdf(path, base="floating")


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


THIGH_MASS = '<mass value="7"/>'
THIGH_INERTIA = '<inertia ixx="0.08" ixy="0" ixz="0" iyy="0.07" iyz="0" izz="0.02"/>'
SHANK_INERTIAL = re.compile(r'<inertial>\s*<mass value="3"/>.*?</inertial>', re.DOTALL)
KNEE_LIMIT = '<limit lower="0" upper="2.5" effort="80" velocity="20"/>'
LIMITS = ("lower", "upper", "effort", "velocity")
KNEE_AXIS = '<axis xyz="0 1 0"/>'
KNEE = 'name="knee" type="revolute"'
CONTINUOUS = 'name="knee" type="continuous"'
END = "</robot>"


def inertia(xx, yy, zz, xy=0):
    return f'<inertia ixx="{xx}" ixy="{xy}" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>'


def mass(value, shown=None):
    said = rf"^Inertial: mass \[{shown or value}" + ("" if shown else r"\] is not a float$")
    return THIGH_MASS, f'<mass value="{value}"/>', said


def moments(*values, said, xy=0):
    return THIGH_INERTIA, inertia(*values, xy=xy), said


REFUSED = {
    # no robot
    "wrong root": ('<robot name="leg">', "<model>", "not a URDF: its root is <model>"),
    "no robot name": ('name="leg"', "", "^a robot has no name"),
    # mass and inertia
    "zero mass": (
        THIGH_MASS,
        '<mass value="0"/>',
        r"^joint 'hip' moves an unsound .*\(mass 0",
    ),
    "negative mass": (
        THIGH_MASS,
        '<mass value="-7"/>',
        r"^joint 'hip' moves an unsound inertia \(mass -7 kg\): mass must be above 0",
    ),
    "mass 1e308": (
        THIGH_MASS,
        '<mass value="1e308"/>',
        r"^joint 'hip' moves .*1e\+308 kg\)",
    ),
    "mass heavy": mass("heavy"),
    "mass 1,5": mass("1,5"),
    "mass nan": mass("nan"),
    "mass inf": mass("inf"),
    "mass 1e400": mass("1e400"),
    "mass 0x10": mass("0x10"),
    "mass 1_000": mass("1_000"),
    "mass of Arabic digits": mass("\u0667"),
    "mass empty": mass(""),
    "mass of 9999 digits": mass("9" * 9999, "9{60}"),
    "mass of 9999 digits and a letter": mass("9" * 9999 + "x", "9{60}"),
    "mass without value": (THIGH_MASS, "<mass/>", "mass element must have value"),
    "mass missing": (THIGH_MASS, "", "Inertial element must have a mass element"),
    "inertia missing": (THIGH_INERTIA, "", "Inertial element must have inertia element"),
    "inertia nan": moments(1, "nan", 1, said="inertia element iyy is not a valid double$"),
    "inertia entry missing": ('ixx="0.08"', "", "inertia element missing ixx attribute"),
    "not positive semidefinite": moments(1, 1, -1, said="^joint 'hip' moves .*triangle"),
    "indefinite": moments(1, 1, 1, xy=2, said="^joint 'hip' moves .*triangle"),
    "moments 1e300": moments(1e300, 1e300, 1e300, said=r"^joint 'hip' moves .* below 1e\+100"),
    "a triangle by 1 %": moments(1, 1, 2.02, said="^joint 'hip' moves .*triangle"),
    "triangle": moments(1, 1, 2.1, said="^joint 'hip' moves .*triangle"),
    "triangle, turned": moments(1.5, 1.5, 1, xy=1, said="^joint 'hip' moves .*triangle"),
    "two masses": (THIGH_MASS, THIGH_MASS * 2, "^link 'thigh' inertial has 2 of <mass>"),
    "two inertials": ("</inertial>", "</inertial><inertial/>", "^link 'thigh' has 2 of <inertial>"),
    "inertial origin nan": (
        'xyz="0 0 -0.2"',
        'xyz="0 0 nan"',
        r"^Unable to parse component \[nan\]",
    ),
    "inertial origin of 2": (
        'xyz="0 0 -0.2"',
        'xyz="0 0"',
        r"^Parser found 2 elements but 3 expected .*\[0 0\]$",
    ),
    "inertial origin of 1e200": (
        'xyz="0 0 -0.2"',
        'xyz="0 0 -1e200"',
        r"^joint 'hip' moves an unsound inertia .*centre and moments below 1e\+100",
    ),
    "joint origin of 1e200": (
        'xyz="0 0 -0.4"',
        'xyz="0 0 -1e200"',
        r"^placement of joint 'knee' .*a translation below 1e\+100 m$",
    ),
    "joint origin rpy": (
        'rpy="0 0 0"',
        'rpy="0 0 x"',
        "^Malformed parent origin element for joint .hip",
    ),
    # tree
    "no links": (re.compile(r"\n.*(?=</robot>)", re.DOTALL), "", "^has no link"),
    "two roots": (END, '<link name="stray"/></robot>', r"^has 2 roots \(base, stray\)"),
    "cyclic": ('<parent link="base"/>', '<parent link="toe"/>', "form a loop"),
    "self loop": ('<parent link="thigh"/>', '<parent link="shank"/>', "link.* shank form a loop"),
    "unknown parent": (
        *('<parent link="thigh"/>', '<parent link="thihg"/>'),
        "^joint 'knee' parent is 'thihg': there is no such link",
    ),
    "no parent": ('<parent link="thigh"/>', "", "^joint 'knee' has no parent: it must name"),
    "missing child": ('<child link="shank"/>', "", "^joint 'knee' has no child: it must name"),
    "closed loop": (
        END,
        '<joint name="close" type="fixed"><parent link="base"/><child link="toe"/></joint></robot>',
        "^link 'toe' has two parents",
    ),
    "duplicate link": (END, '<link name="toe"/></robot>', "^link name 'toe' is used 2 times"),
    "duplicate joint": (KNEE, 'name="hip" type="revolute"', "^joint name 'hip' is used 2 times"),
    # joints
    "unknown type": (KNEE, 'name="knee" type="hinge"', "^joint 'knee' type is 'hinge'"),
    "missing type": (KNEE, 'name="knee"', "^joint 'knee' type is ''"),
    "planar": (KNEE, 'name="knee" type="planar"', "^joint 'knee' type is 'planar'"),
    "floating": (KNEE, 'name="knee" type="floating"', "^joint 'knee' type is 'floating'"),
    "missing limit": (KNEE_LIMIT, "", "knee.* does not specify limits"),
    **{
        f"{what} {key}": (KNEE_LIMIT, re.sub(f'{key}="[^"]*"', change, KNEE_LIMIT), said)
        for key in LIMITS
        for what, change, said in (
            *([("no", "", rf"knee.*limit has no {key}")] if key in ("effort", "velocity") else []),
            ("empty", f'{key}=""', rf"^joint .knee.: {key} value \(\) is not a valid float"),
            (
                "words for",
                f'{key}="80 Nm"',
                rf"^joint .knee.: {key} value \(80 Nm\) is not a valid",
            ),
            (
                "infinite",
                f'{key}="inf"',
                rf"^joint .knee.: {key} value \(inf\) is not a valid",
            ),
        )
    },
    "nan limit": (
        'upper="2.5"',
        'upper="nan"',
        r"^joint .knee.: upper value \(nan\) is not a valid",
    ),
    "lower above upper": ('upper="2.5"', 'upper="-1"', "lower must not exceed upper"),
    "negative effort": (
        'effort="80"',
        'effort="-80"',
        "^joint 'knee' effort is '-80': it must be 0 or more",
    ),
    "negative velocity": (
        'velocity="20"',
        'velocity="-1"',
        "^joint 'knee' velocity is '-1': it must be 0 or more",
    ),
    "axis 0 0 0": (
        KNEE_AXIS,
        '<axis xyz="0 0 0"/>',
        "^joint 'knee' axis is '0 0 0': it must be .*not all 0",
    ),
    "axis nan": (KNEE_AXIS, '<axis xyz="0 nan 0"/>', "^joint 'knee' axis is '0 nan 0'"),
    "axis of 2": (
        KNEE_AXIS,
        '<axis xyz="0 1"/>',
        "^joint 'knee' axis is '0 1': it must be 3 finite",
    ),
    "axis without numbers": (KNEE_AXIS, "<axis/>", "^joint 'knee' axis is ''"),
    "axis vanishing when squared": (
        KNEE_AXIS,
        '<axis xyz="0 1e-200 0"/>',
        "axis is '0 1e-200 0'",
    ),
    "axis overflowing when squared": (
        KNEE_AXIS,
        '<axis xyz="0 1e200 0"/>',
        "axis is '0 1e200 0'",
    ),
    "two axes": (KNEE_AXIS, KNEE_AXIS * 2, "^joint 'knee' has 2 of <axis>"),
    "mimic of nothing": (KNEE_AXIS, KNEE_AXIS + '<mimic joint="?"/>', "^joint 'knee' mimics"),
    "moves no mass": (SHANK_INERTIAL, "", "^joint 'knee' moves .*mass 0 kg.* give a link"),
    # names
    "universe": (
        KNEE,
        'name="universe" type="revolute"',
        "joint name 'universe' is reserved by Pinocchio",
    ),
    "empty joint name": (KNEE, 'name="" type="revolute"', "^a joint has no name"),
    "joint name of blanks": (KNEE, 'name="  " type="revolute"', "^a joint has no name"),
    "empty link name": ('<link name="toe"/>', "<link/>", "^a link has no name"),
    "line end in a name": (
        *(KNEE, 'name="../../etc/passwd&#10;&lt;x&gt;" type="revolute"'),
        r"^joint name '\.\./\.\./etc/passwd\\n<x>' is not a printable name",
    ),
    "9999 letters": (
        *(KNEE, f'name="{"x" * 9999}" type="revolute"'),
        "^joint name 'x{40}' is not a printable name of at most 200 characters",
    ),
    # shapes
    "box of 2": ('<sphere radius="0.05"/>', '<box size="1 2"/>', r"parsing vector \[1 2\]"),
    "unknown shape": ('<sphere radius="0.05"/>', "<torus/>", "Unknown geometry type 'torus'"),
    "no shape": ('<sphere radius="0.05"/>', "", "Geometry tag contains no child"),
    "mesh of nothing": ('<sphere radius="0.05"/>', "<mesh/>", "Mesh must contain a filename"),
}


@pytest.mark.parametrize(("old", "new", "said"), REFUSED.values(), ids=REFUSED)
def test_bad_robot_is_refused_by_name(good_urdf, load, capfd, old, new, said):
    if isinstance(old, str):
        old = re.compile(re.escape(old))
    text, count = old.subn(lambda _: new, good_urdf)
    assert count
    if new == "<model>":
        text = text.replace("</robot>", "</model>")
    with pytest.raises(kd.UrdfError) as caught:
        load(text)
    assert [fault for fault in caught.value.faults if re.search(said, fault)]
    assert all(len(fault) < 250 for fault in caught.value.faults)
    assert capfd.readouterr().err == ""


# What is accepted, and why: it means what it says, and Pinocchio takes it as it stands.
ACCEPTED = {
    "as it is, without mass on base and toe, which are fixed": ("", ""),
    "link and joint of one name": (KNEE, 'name="shank" type="revolute"'),
    "no axis is 1 0 0, as the format says": (KNEE_AXIS, ""),
    "an axis of any sound length": (KNEE_AXIS, '<axis xyz="0 1e-20 0"/>'),
    "no origin is 0 0 0": ('<origin xyz="0 0 1" rpy="0 0 0"/>', ""),
    "names in any script, blanks inside": (
        KNEE,
        'name="Knie d\u2019\u00e9t\u00e9 \u819d" type="revolute"',
    ),
    "a path for a name": (KNEE, 'name="../../etc/passwd" type="revolute"'),
    "a line end in a name, which XML reads as a blank": (KNEE, 'name="k\nnee" type="revolute"'),
    "0 mass and 0 inertia on what is fixed: no body": (
        '<link name="toe"/>',
        '<link name="toe"><inertial><mass value="0"/>'
        '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>',
    ),
    "a flat body, on the edge of the triangle": (
        THIGH_INERTIA,
        inertia(0.013, 0.027, 0.04, xy=0.002),
    ),
    "a limit of no width": ('upper="2.5"', 'upper="0"'),
    "an axis of a fixed joint, which turns about nothing": (
        *('<joint name="tip" type="fixed">', '<joint name="tip" type="fixed"><axis xyz="0 0 0"/>'),
    ),
    "what it does not know": (END, "<gazebo><x/></gazebo><transmission/></robot>"),
    "a mesh anywhere, which a leg never reads": (
        *('<sphere radius="0.05"/>', '<mesh filename="package://../../etc/passwd"/>'),
    ),
    "a joint that is not in the tree of links": (END, '<a><joint name="x"/></a></robot>'),
}


@pytest.mark.parametrize(("old", "new"), ACCEPTED.values(), ids=ACCEPTED)
def test_odd_but_sound_robot_is_taken_unchanged(spoil, load, capfd, old, new):
    leg = load(spoil((old, new)))
    assert [inertia.mass for inertia in leg.model.inertias] == [0, 7, 3]
    assert len(leg.joint_names) == 2
    assert all(name.isprintable() for name in leg.joint_names)
    assert leg.posture([0.1, 0.2]).effective_mass([1, 0, 0]) > 0
    assert capfd.readouterr().err == ""


def test_a_link_may_get_all_its_mass_from_behind_a_fixed_joint(good_urdf, load):
    (inertial,) = SHANK_INERTIAL.findall(good_urdf)
    text = good_urdf.replace(inertial, "").replace(
        '<link name="toe"/>', f'<link name="toe">{inertial}</link>'
    )
    leg = load(text)
    assert [body.mass for body in leg.model.inertias] == [0, 7, 3]
    assert leg.model.inertias[2].lever == pytest.approx([0, 0, -0.4])


def test_continuous_joint_has_cosine_and_sine(spoil, load):
    leg = load(spoil((KNEE, CONTINUOUS), (KNEE_LIMIT, "")))
    assert (leg.nq, leg.nv) == (3, 2)


@pytest.mark.parametrize("ends", ["", 'lower="0"', 'lower="1" upper="0"'])
def test_continuous_joint_may_have_a_limit_without_a_range(spoil, load, ends):
    leg = load(spoil((KNEE, CONTINUOUS), (KNEE_LIMIT, f'<limit {ends} effort="80" velocity="7"/>')))
    assert (leg.effort_limit[1], leg.velocity_limit[1]) == (80, 7)


@pytest.mark.parametrize(
    ("kind", "limit", "said"),
    [
        ("continuous", '<limit velocity="1"/>', "limit has no effort"),
        ("continuous", '<limit effort="1"/>', "limit has no velocity"),
        ("continuous", '<limit upper="x" effort="1" velocity="1"/>', r"upper value \(x\)"),
        ("fixed", "<limit/>", "limit has no effort"),
        ("prismatic", "", "PRISMATIC without limits|does not specify limits"),
        ("prismatic", '<limit lower="0" upper="1" effort="1"/>', "limit has no velocity"),
    ],
)
def test_limits_of_other_joints_are_judged_too(spoil, load, kind, limit, said):
    with pytest.raises(kd.UrdfError, match=rf"joint \W?knee.*{said}|knee.*{said}"):
        load(spoil((KNEE, f'name="knee" type="{kind}"'), (KNEE_LIMIT, limit)))


IMPOSSIBLE = inertia(1, 1, 3)
SHAPE = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'
LINK = '<link name="toe"><inertial><mass value="{}"/>{}</inertial></link>'


@pytest.mark.parametrize(
    ("edits", "said"),
    [
        ([], None),
        ([('<link name="toe"/>', LINK.format(0, inertia(0, 0, 1e-12)))], None),  # with the foot
        ([('<link name="toe"/>', LINK.format(1e-14, inertia(1e-9, 1e-9, 3e-9)))],
         "links with moments of inertia that no body has (toe): they count together"),
        ([('<link name="toe"/>', LINK.format(1, inertia(0, 0, 0)))], None),  # a mass at a point
        ([('<link name="toe"/>', f'<link name="toe">{SHAPE}</link>')], None),  # fixed to the foot
        ([(KNEE_LIMIT, '<limit upper="2" effort="8" velocity="9"/>')],
         "joints without lower or upper limit (knee): the URDF specification says 0"),
        ([(KNEE_LIMIT, '<limit lower="-2" effort="8" velocity="9"/>')], "joints without lower"),
    ],
)  # fmt: skip
def test_irregular_file_is_read_as_it_is_with_a_line(spoil, load, edits, said):
    leg = load(spoil(*edits))
    *lines, last = leg.warnings
    assert last == NO_DRIVES
    assert [line.startswith(said or "-") for line in lines] == ([True] if said else [])
    assert all(line in html.unescape(leg._repr_html_()) for line in leg.warnings)
    if any(KNEE_LIMIT in edit for edit in edits):
        low, high = leg.joint_range("knee")
        assert (low, high) in ((0, 2), (-2, 0))


def test_a_welded_link_may_be_impossible_alone_but_not_with_what_it_moves_with(spoil, load):
    welded = ('<link name="toe"/>', LINK.format(1, IMPOSSIBLE))
    with pytest.raises(kd.UrdfError, match=r"joint 'knee' moves an unsound inertia .*triangle"):
        load(spoil(welded))


def test_irregularities_are_listed_by_kind():
    links = "".join(
        f'<link name="a{i}"><inertial><mass value="1"/>{IMPOSSIBLE}</inertial></link>'
        for i in "12345"
    )
    (line,) = find_irregularities(ElementTree.fromstring(f"<robot>{links}</robot>"))
    assert "inertia that no body has (a1, a2, a3 and 2 more): they count" in line


def test_joints_may_be_locked_before_inertias_are_judged(spoil, tmp_path):
    path = tmp_path / "leg.urdf"
    (inertial,) = SHANK_INERTIAL.findall(spoil())
    path.write_text(spoil((inertial, "")))
    with pytest.raises(kd.UrdfError, match=r"joint 'knee' moves .*mass 0 kg.*lock it by locked="):
        kd.Leg.from_urdf(path)
    leg = kd.Leg.from_urdf(path, locked={"knee": 0.5})
    assert leg.joint_names == ("hip",)
    assert leg.posture([0.0]).contact_point == pytest.approx(
        [-0.4 * np.sin(0.5), 0, 0.6 - 0.4 * np.cos(0.5)]
    )
    for locked, said in (
        ({"kne": 0}, "joint 'kne' is unknown: did you mean 'knee'"),
        ({"knee": "x"}, "joint knee is 'x'"),
        ({"knee": 0, "hip": 0}, "all joints of leg are locked"),
        (["knee"], r"locked is \['knee'\]: it must map names to values"),
    ):
        with pytest.raises(kd.InvalidInput, match=said):
            kd.Leg.from_urdf(path, locked=locked)


def test_all_faults_come_at_once(spoil, load):
    spoilt = spoil(
        (KNEE, 'name="knee" type="x"'),
        (KNEE_AXIS, '<axis xyz="0 0 0"/>'),
        ('link="shank"', 'link="?"'),
    )
    with pytest.raises(kd.UrdfError) as caught:
        load(spoilt)
    assert len(caught.value.faults) == 3
    assert all(fault in str(caught.value) for fault in caught.value.faults)
    for fault, culprit in zip(caught.value.faults, ("'x'", "'0 0 0'", "'?'"), strict=True):
        assert culprit in fault


def chain(kinds, masses=None):
    """A chain of links, joined by joints of the given kinds."""
    lines = ['<robot name="chain"><link name="l0"/>']
    for i, kind in enumerate(kinds):
        weight = masses[i] if masses else 1.0
        lines.append(
            f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>'
            '<origin xyz="0 0 -0.1"/><axis xyz="0 1 0"/>'
            '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
            f'<link name="l{i + 1}"><inertial><mass value="{weight!r}"/>'
            '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        )
    return "".join([*lines, "</robot>"])


@pytest.mark.parametrize(
    ("kinds", "said"),
    [
        (["revolute"] * 1000, "1001 links and 1000 moving joints: at most 3000 and 250"),
        (["fixed"] * 4000, "4001 links and 0 moving"),  # Pinocchio would overflow its stack
        (["fixed"] * 5000, "5001 links"),
    ],
    ids=lambda value: str(value)[:20],
)
def test_endless_chain_is_refused(load, kinds, said):
    with pytest.raises(kd.UrdfError, match=said):
        load(chain(kinds), "l1")


def test_longest_chain_that_is_taken(load):
    leg = load(chain(["revolute"] + ["fixed"] * 2998), "l2999")
    assert leg.posture([0.0]).contact_point == pytest.approx([0, 0, -299.9])
    assert leg.model.inertias[1].mass == pytest.approx(2999, rel=1e-12)


KIND = st.sampled_from(["revolute", "continuous", "prismatic", "fixed"])
WEIGHT = st.floats(1e-15, 1e15)


@given(st.lists(st.tuples(KIND, WEIGHT), min_size=1, max_size=8))
def test_what_is_taken_has_exactly_the_masses_of_the_file(tmp_path_factory, links):
    kinds, masses = zip(("revolute", 2.0), *links, strict=True)
    path = tmp_path_factory.mktemp("chain") / "leg.urdf"
    path.write_text(chain(kinds, masses))
    try:
        leg = kd.Leg.from_urdf(path, f"l{len(kinds)}")
    except kd.UrdfError as error:  # of masses too unlike each other
        if not re.search(r"condition .*no digits|not positive definite", str(error)):
            raise
        return
    carried = []  # by each moving joint: its link, and all that is fixed to it
    for kind, weight in zip(kinds, masses, strict=True):
        if kind == "fixed":
            carried[-1] += weight
        else:
            carried.append(weight)
    loaded = np.array([body.mass for body in leg.model.inertias])[1:]
    assert loaded == pytest.approx(carried, rel=1e-15)
    assert leg.joint_names == tuple(f"j{i}" for i, kind in enumerate(kinds) if kind != "fixed")


@given(st.text(max_size=30), st.integers(0, 10**6))
def test_garbage_in_the_middle_is_refused_or_taken_whole(tmp_path_factory, good_urdf, junk, at):
    at %= len(good_urdf)
    path = tmp_path_factory.mktemp("junk") / "leg.urdf"
    path.write_bytes((good_urdf[:at] + junk + good_urdf[at:]).encode(errors="surrogatepass"))
    try:
        leg = kd.Leg.from_urdf(path)
    except kd.InvalidInput:
        return
    in_text = re.findall(r'<mass value="(.*?)"', leg.file.text)
    assert [body.mass for body in leg.model.inertias][1:] == [float(text) for text in in_text]
