"""What users install holds all that kickdyn needs, and runs from any folder."""

import importlib.util
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import kickdyn as kd

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
KICK = """
import kickdyn as kd
print(kd.__file__)
for leg in (kd.Leg.human(), kd.Leg.testbed(), kd.load_scene("volley").leg):
    print(leg.model.nv)
"""


def python(code, **settings):
    """Run Python code in a process of its own, in which a warning is an error."""
    noise = "ignore:zmq.eventloop.ioloop is deprecated:DeprecationWarning"
    command = [sys.executable, "-W", "error", "-W", noise, "-c", code]
    ended = subprocess.run(command, capture_output=True, text=True, **settings)
    assert (ended.returncode, ended.stderr) == (0, "")
    return ended.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "--directory", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    (sdist,) = folder.glob("*.tar.gz")
    return wheel, sdist


@pytest.mark.slow
def test_the_wheel_runs_from_any_folder(built, tmp_path):
    installed = tmp_path / "installed"
    with zipfile.ZipFile(built[0]) as wheel:
        wheel.extractall(installed)
    printed = python(KICK, cwd=tmp_path, env={"PYTHONPATH": str(installed)})
    module, *degrees_of_freedom = printed.split()
    assert Path(module).is_relative_to(installed)
    assert degrees_of_freedom == ["3", "3", "3"]


@pytest.mark.slow
def test_wheel_and_sdist_hold_what_they_need(built):
    with zipfile.ZipFile(built[0]) as wheel:
        names = set(wheel.namelist())
    assert {name.split("/")[0].split("-")[0] for name in names} == {"kickdyn"}
    data = {"urdf/leg_fourbar.urdf", "scenes/free_kick.toml", "view/page.html", "py.typed"}
    assert {f"kickdyn/{name}" for name in data | {"__init__.pyi"}} <= names
    assert not [name for name in names if Path(name).name.startswith("test")]
    with tarfile.open(built[1]) as sdist:
        folders = {Path(name).parts[1] for name in sdist.getnames() if len(Path(name).parts) > 1}
    needed = "Makefile constraints.txt kickdyn urdf tests tools scenes docs examples benchmarks"
    assert set(needed.split(" ")) <= folders


@pytest.mark.slow
def test_importing_every_name_compiles_nothing():
    """Machine code is made when it is first needed: a cold compilation takes half a minute."""
    python("""
from numba.core.dispatcher import Dispatcher
def compile(*_): raise AssertionError("an import compiles")
Dispatcher.compile = compile
from kickdyn import *
""")


def test_no_public_name_hides_a_module_and_a_star_brings_all():
    assert [name for name in dir(kd) if importlib.util.find_spec(f"kickdyn.{name}")] == []
    names: dict[str, object] = {}
    exec("from kickdyn import *", names)
    assert set(kd.__all__) <= names.keys()


@pytest.mark.parametrize("file", ["CITATION.cff", "conda/recipe.yaml"])
def test_other_files_name_the_same_version(file):
    versions = re.findall(r"^ *version: \"?([\d.]+)\"?$", (ROOT / file).read_text("utf-8"), re.M)
    assert versions == [kd.__version__]
