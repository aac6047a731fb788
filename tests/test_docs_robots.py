"""The numbers of docs/explanation/robots.md, and what it says of URDF files that are refused."""

import ast
import re
from pathlib import Path

import pytest
import robots_table
import urdf_files
from shown_numbers import first_missing

import kickdyn as kd
from kickdyn.robot.catalog import robots_folder

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "docs" / "explanation" / "robots.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_table_has_the_numbers_of_the_script():
    """Rows have the robot and seven more cells."""
    printed, shown = (
        {line.split("|")[1].strip(): line for line in text.splitlines() if line.count("|") == 9}
        for text in (robots_table.table(), TEXT)
    )
    robots = printed.keys() - {"robot", "---"}
    assert robots <= shown.keys()
    for robot in robots:
        assert first_missing(shown[robot], printed[robot]) is None, shown[robot]


@pytest.fixture(scope="module")
def readings():
    return list(urdf_files.readings())


def test_as_many_urdf_files_load_as_the_page_says(readings):
    """Those that load have a well-conditioned posture, slightly bent: straight, iCub's has none."""
    loaded = [reading for reading in readings if reading.leg is not None]
    stated = re.search(r"reads (\d+) of the (\d+) URDF files", TEXT)
    assert [*map(int, stated.groups())] == [len(loaded), len(readings)]
    for reading in loaded:
        driven = {mimic.joint for mimic in reading.leg.mimics}
        bent = [name for name in reading.leg.single_joints if name not in driven]
        angles = {name: 0.1 + 0.01 * i for i, name in enumerate(bent)}
        posture = reading.leg.posture(reading.leg.configuration(angles))
        assert posture.condition < 1e7, reading.file


@pytest.mark.parametrize(("file", "frame"), [
    ("alex_psyonic_hands.urdf", "Torso"), ("romeo.urdf", "r_sole")])  # fmt: skip
def test_the_remedy_of_a_refusal_can_be_copied(readings, file, frame):
    """Its `locked=` for Python and its options for commands lock the same joints."""
    (refused,) = (reading for reading in readings if reading.file.endswith("/" + file))
    locks = [ast.literal_eval(text) for text in re.findall(r"locked=({.*?})", refused.reason)]
    python = {name: value for lock in locks for name, value in lock.items()}
    assert set(re.findall(r"--lock (\w+)=0", refused.reason)) == python.keys()
    leg = kd.Leg.from_urdf(robots_folder() / refused.file, frame, locked=python)
    assert leg.posture(leg.configuration()).condition < 1e7
