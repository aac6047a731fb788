"""The tables of docs/explanation/robots.md are the outputs of their scripts."""

import ast
import runpy
import shlex
from pathlib import Path

import pytest

import kickdyn as kd
from kickdyn.robot.catalog import robots_folder

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "docs" / "explanation" / "robots.md").read_text(encoding="utf-8")


def test_table_is_the_output_of_the_script():
    script = runpy.run_path(str(ROOT / "benchmarks" / "robots_table.py"))
    assert script["table"]() in TEXT
    assert "| g1 | toe | 30 | 0.255 | 0.622 | 1.141 | 2.147 |" in script["contact_table"]()
    assert "1.14 instead of 0.62 kg, with ankle and knee 2.15 kg" in " ".join(TEXT.split())


@pytest.fixture(scope="module")
def urdf_files():
    return runpy.run_path(str(ROOT / "benchmarks" / "urdf_files.py"))


@pytest.fixture(scope="module")
def readings(urdf_files):
    return list(urdf_files["readings"]())


def test_as_many_urdf_files_load_as_the_page_says(urdf_files, readings):
    assert urdf_files["summary"](readings) == "62 of 66 files load"
    assert "reads 62 of the 66 URDF files" in TEXT
    refused = {Path(reading.file).name for reading in readings if reading.leg is None}
    assert len(refused) == 4
    assert "Four files are\nrefused" in TEXT


def test_what_is_loaded_has_a_well_conditioned_posture(readings):
    """Slightly bent: with a straight neck, the mass matrix of iCub is singular."""
    for reading in readings:
        if reading.leg is not None:
            driven = {mimic.joint for mimic in reading.leg.mimics}
            bent = [name for name in reading.leg.single_joints if name not in driven]
            angles = {name: 0.1 + 0.01 * i for i, name in enumerate(bent)}
            assert reading.leg.posture(reading.leg.configuration(angles)).condition < 1e7


@pytest.mark.parametrize(
    ("file", "frame"), [("alex_psyonic_hands.urdf", "Torso"), ("romeo.urdf", "r_sole")]
)
def test_refused_files_load_with_the_joints_locked_that_the_reason_names(readings, file, frame):
    (found,) = [reading for reading in readings if reading.file.endswith("/" + file)]
    named = [part.partition("'")[0] for part in found.reason.split("joint '")[1:]]
    named += found.reason.partition(", as do ")[2].partition(":")[0].split(", ")
    locked = dict.fromkeys(filter(None, named), 0.0)
    leg = kd.Leg.from_urdf(robots_folder() / found.file, frame, locked=locked)
    assert leg.posture(leg.configuration()).condition < 1e7


def test_the_remedy_of_a_refusal_can_be_copied(readings):
    """Its `locked=` for Python and its options for commands lock the same joints."""
    (found,) = [reading for reading in readings if reading.file.endswith("/romeo.urdf")]
    python = ast.literal_eval(found.reason.partition("by locked=")[2].partition(" in Python")[0])
    options = shlex.split(found.reason.partition(" in Python, by ")[2].removesuffix(" in commands"))
    assert options == [word for name in python for word in ("--lock", f"{name}=0")]
    leg = kd.Leg.from_urdf(robots_folder() / found.file, "r_sole", locked=python)
    patterns = {"*Finger*": 0.0, "*Hand": 0.0, "*Thumb*": 0.0}
    same = kd.Leg.from_urdf(robots_folder() / found.file, "r_sole", locked=patterns)
    assert leg.joint_names == same.joint_names
    assert leg.nv == 31
