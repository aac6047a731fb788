import os
import re
import threading
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.robot.package_files import MAX_BYTES
from kickdyn.robot.urdf_file import build_model, read_urdf

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
