"""What users install holds all that kickdyn needs, and runs from any folder."""

import contextlib
import importlib.util
import inspect
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
KICK = """
import kickdyn as kd
print(kd.__file__)
for leg in (kd.Leg.human(), kd.Leg.testbed()):
    print(leg.model.nv)
print(kd.load_scene("volley").leg.model.nv)
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "--directory", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    (sdist,) = folder.glob("*.tar.gz")
    return wheel, sdist


def test_the_wheel_runs_from_any_folder(built, tmp_path):
    installed = tmp_path / "installed"
    with zipfile.ZipFile(built[0]) as wheel:
        wheel.extractall(installed)
    ended = subprocess.run(
        [sys.executable, "-c", KICK],
        cwd=tmp_path,
        env={"PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
    )
    assert ended.stderr == ""
    module, *degrees_of_freedom = ended.stdout.split()
    assert Path(module).is_relative_to(installed)
    assert degrees_of_freedom == ["3", "3", "3"]


def test_the_wheel_holds_the_package_and_nothing_else(built):
    with zipfile.ZipFile(built[0]) as wheel:
        names = wheel.namelist()
    assert {name.split("/")[0].split("-")[0] for name in names} == {"kickdyn"}
    data = {"urdf/leg_fourbar.urdf", "scenes/free_kick.toml", "view/page.html"}
    assert {f"kickdyn/{name}" for name in data} <= set(names)
    assert not [name for name in names if Path(name).name.startswith("test")]


def test_the_sdist_can_test_itself(built):
    with tarfile.open(built[1]) as sdist:
        rooms = {Path(*Path(name).parts[1:2]) for name in sdist.getnames()}
    wanted = "Makefile constraints.txt kickdyn urdf tests tools scenes notebooks docs examples"
    wanted += " benchmarks"
    assert {Path(name) for name in wanted.split()} <= rooms


def test_type_checkers_find_the_names_in_the_wheel(built):
    with zipfile.ZipFile(built[0]) as wheel:
        assert {"kickdyn/py.typed", "kickdyn/__init__.pyi"} <= set(wheel.namelist())


def test_the_import_is_clean_and_loads_nothing_heavy():
    code = "import kickdyn, sys; print({'numpy', 'numba', 'pinocchio'} & sys.modules.keys())"
    command = [sys.executable, "-W", "error", "-c", code]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert (ended.stdout, ended.stderr) == ("set()\n", "")


def test_no_public_name_hides_a_module():
    for name in dir(kd):
        assert importlib.util.find_spec(f"kickdyn.{name}") is None, name


def test_a_star_brings_every_public_name():
    names: dict[str, object] = {}
    exec("from kickdyn import *", names)
    assert {"Leg", "strike", "plan_kick", "sweep", "open_sweep"} <= names.keys()
    assert all(
        value.__module__.startswith("kickdyn.") for name, value in names.items() if name in dir(kd)
    )


def test_a_star_compiles_nothing():
    """Machine code is made when it is first needed: a cold compilation takes half a minute."""
    code = """
from numba.core.dispatcher import Dispatcher
def compile(*_): raise AssertionError("an import compiles")
Dispatcher.compile = compile
from kickdyn import *
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_the_list_of_public_names_is_sorted():
    lines = (ROOT / "kickdyn" / "__init__.pyi").read_text().splitlines()
    imports = [line for line in lines if line.startswith("from")]
    assert imports == sorted(imports)


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


@pytest.mark.parametrize("file", ["CITATION.cff", "conda/recipe.yaml"])
def test_other_files_name_the_same_version(file):
    versions = re.findall(r"^ *version: \"?([\d.]+)\"?$", (ROOT / file).read_text("utf-8"), re.M)
    assert versions == [kd.__version__]


def test_the_authors_are_those_of_the_license():
    (author,) = (one["name"] for one in PROJECT["authors"])
    assert f"Copyright (c) 2026, {author}".lower() in (ROOT / "LICENSE").read_text("utf-8").lower()
    assert f"  - name: {author}\n" in (ROOT / "CITATION.cff").read_text("utf-8")


def test_the_conda_recipe_needs_what_the_wheel_needs():
    recipe = (ROOT / "conda" / "recipe.yaml").read_text("utf-8")
    needs = set(re.findall(r"^    - (\S+ [\w.<>=,]+)", recipe.split("  run:")[1], re.M))
    names = {"pin": "pinocchio", "matplotlib": "matplotlib-base", "meshcat": "meshcat-python"}
    wanted = {f"python {PROJECT['requires-python']}"}
    for line in PROJECT["dependencies"]:
        name, limits = re.fullmatch(r"([\w-]+)(.*)", line).groups()
        wanted.add(f"{names.get(name, name)} {limits}")
    assert {need for need in needs if re.search("[<>]", need)} == wanted


def test_continuous_integration_runs_every_python_that_is_allowed():
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8")
    minors = re.findall(r'"3\.(\d+)"', workflow.split("matrix:")[1])
    least, first_beyond = re.fullmatch(r">=3\.(\d+),<3\.(\d+)", PROJECT["requires-python"]).groups()
    assert [*map(int, minors)] == [*range(int(least), int(first_beyond))]
    assert {"make lint", "make test", "make test-lowest"} <= set(re.findall("run: (.*)", workflow))


def test_signatures_are_short_enough_to_read():
    """An array is `ArrayLike`, and not the dozen types that it stands for."""
    for name in kd.__all__:
        public = getattr(kd, name)
        if callable(public):
            with contextlib.suppress(ValueError):  # exceptions have none
                signature = str(inspect.signature(public))
                assert "numpy._typing" not in signature
                assert len(signature) < 1200, name
