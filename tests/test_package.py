"""What users install is whole, also without the extras; errors and copies of results."""

import copy
import importlib.util
import pickle
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from one_of_each import MADE, one, sticking

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


WAYS = {
    "pickle": lambda original: pickle.loads(pickle.dumps(original)),
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
}
BY_HAND = {"tuning", "restitution"}
"""Made in the tests without the function that gives them, which protects their arrays."""

MORE = {
    "uncertainty": lambda: sticking().uncertainty(q=0.1, normal=0.02),
    "hold": lambda: one("standing impact").posture.constraint_projector,
}
ORIGINALS = {name: partial(one, name) for name in MADE.keys() - BY_HAND} | MORE


def arrays(value):
    """Yield all arrays of a value, of mappings and of tuples."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, dict | tuple):
        for entry in value.values() if isinstance(value, dict) else value:
            yield from arrays(entry)


def writeable(result):
    """Return the public attributes with arrays that can be written to."""
    public = {key: value for key, value in vars(result).items() if key[0] != "_"}
    return [key for key, value in public.items() if any(a.flags.writeable for a in arrays(value))]


@pytest.mark.parametrize("name", sorted(ORIGINALS))
def test_copies_are_the_same_and_read_only(name):
    original = ORIGINALS[name]()
    if not hasattr(original, "__dict__"):
        pytest.skip("it has slots")
    assert writeable(original) == []
    for way, copied in WAYS.items():
        result = copied(original)
        assert type(result) is type(original)
        assert "object at 0x" in repr(original) or repr(result) == repr(original)
        assert writeable(result) == []
        of_copy = list(arrays(vars(result)))
        of_original = list(arrays({key: getattr(original, key) for key in vars(result)}))
        for one_array, other in zip(of_copy, of_original, strict=True):
            np.testing.assert_array_equal(one_array, other)
            assert way == "copy" or other.size == 0 or not np.shares_memory(one_array, other)


LONG = "folder/" * 200 + "leg.urdf"

ERRORS = {
    "input": kd.InvalidInput("a is 1:\n it must be 2", "b is 3"),
    "urdf": kd.UrdfError("leg.urdf", ["has no link", "a joint has no name"]),
    "scene": kd.SceneError("s.toml", ["has no leg", "has no contact"]),
    "long": kd.InvalidInput(f"{LONG} is full"),
    "long urdf": kd.UrdfError(LONG, ["has no link"]),
    "long scene": kd.SceneError(LONG.replace("/", " "), ["has no leg", "has no contact"]),
}


def test_an_error_can_be_caught_by_its_kinds():
    assert issubclass(kd.UrdfError, kd.InvalidInput)
    assert kd.InvalidInput.__bases__ == (kd.KickdynError, ValueError)
    assert issubclass(kd.NoImpact, kd.KickdynError)
    assert not issubclass(kd.NoImpact, ValueError)  # an answer, not a bad value


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_survives_a_process_pool(name):
    error = ERRORS[name]
    copied = pickle.loads(pickle.dumps(error))
    assert (type(copied), str(copied), copied.faults) == (type(error), str(error), error.faults)
    assert getattr(copied, "source", None) == getattr(error, "source", None)


def test_every_fault_is_in_the_message_and_on_its_own():
    assert ERRORS["input"].faults == ("a is 1: it must be 2", "b is 3")
    assert str(ERRORS["input"]) == "a is 1: it must be 2; b is 3"
    assert str(ERRORS["urdf"]) == "leg.urdf: has no link; a joint has no name"
    assert str(ERRORS["scene"]).splitlines() == ["s.toml:", "has no leg", "has no contact"]


def test_a_long_name_of_a_file_loses_its_middle():
    for name in ("long", "long urdf", "long scene"):
        text = str(ERRORS[name])
        assert all(end in text for end in ("folder", "leg.urdf")), name
        assert len(text) < 300, name


def test_a_message_is_one_printable_line():
    assert str(kd.KickdynError("a\xa0b\x7fc\r\n   d\te")) == "a\\xa0b\\x7fc d\\te"
    with pytest.raises(kd.InvalidInput, match="array") as refusal:
        kd.Ball(mass=np.eye(3))
    assert str(refusal.value).isprintable()


OPTIONAL = PROJECT["optional-dependencies"]

HIDE = """
import re
import sys
from importlib.machinery import PathFinder

HIDDEN = set(sys.argv[1].split(","))

class Hiding:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in HIDDEN:
            return None
        return PathFinder.find_spec(name, path, target)

    @staticmethod
    def find_distributions(*context):
        for distribution in PathFinder.find_distributions(*context):
            if re.sub("[-_.]+", "_", distribution.metadata["Name"]).lower() not in HIDDEN:
                yield distribution

sys.meta_path[sys.meta_path.index(PathFinder)] = Hiding
"""
"""Python code that hides packages, named by the first argument, from `import`."""

WITHOUT = """
import kickdyn as kd
leg = kd.Leg.human()
scene = kd.load_scene("free_kick")
print(kd.simulate(scene).status)
kick = kd.Kick(attack=0.5, restitution=0.7)
print(kd.sweep(leg, {"hip": [0.1, 0.2], "knee": [0.3], "ankle": [-0.1]}, kick).sizes["hip"])
kd.page(scene).save("kick.html")
print(kd.plan_kick(leg, kd.Goal(5.0, time=0.8), kd.Ball(), kd.Air()).status)
from kickdyn.cli.commands import main
"""

LACKING = {
    "robots": "kd.Leg.from_robot('g1')",
    "motion": "kd.plan_kick(leg, kd.Goal(5.0, time=0.8), kd.Ball(), kd.Air(), motion=True)",
    "store": "kd.sweep(leg, {'hip': [0.1], 'knee': [0.3], 'ankle': [0.0]}, kick, store='s.zarr')",
    "c3d": "kd.Track.from_c3d(__file__)",
    "mjcf": "kd.Leg.from_mjcf('leg.xml', 'toe')",
    "descriptions": "kd.Leg.from_robot('upkie_description')",
}
"""What needs the packages of each extra that users install for a feature."""

CHECK = "kd.check_motion(kd.read_motion('swing.csv', leg, rate=50), leg, kd.Ball())"
"""What needs the extra `motion`, too; reading does not."""


def without_extras(folder, code):
    """Run Python code where no package of an extra can be imported; return what it printed."""
    packages = [text for extra in LACKING for text in OPTIONAL[extra]]
    hidden = ",".join(re.split("[<>=]", text)[0].replace("-", "_") for text in packages)
    (folder / "script.py").write_text(HIDE + code)
    (folder / "leg.xml").write_text("<mujoco><worldbody/></mujoco>")
    command = [sys.executable, "script.py", hidden]
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")
    return ended.stdout.splitlines()


@pytest.mark.slow
def test_what_needs_no_extra_works_without_them(tmp_path):
    assert without_extras(tmp_path, WITHOUT) == ["at-plane", "2", "met"]
    assert (tmp_path / "kick.html").stat().st_size > 1e5


@pytest.mark.slow
def test_what_needs_an_extra_names_it_in_a_line(tmp_path):
    tries = "".join(
        f"try:\n    {call}\nexcept kd.InvalidInput as error:\n    print(error)\n"
        for call in (*LACKING.values(), CHECK)
    )
    (tmp_path / "swing.csv").write_text("0.1,0.2,0.3\n" * 12)
    lines = without_extras(
        tmp_path, f"import kickdyn as kd\nleg, kick = kd.Leg.human(), kd.Kick(attack=0.5)\n{tries}"
    )
    for extra, line in zip([*LACKING, "motion"], lines, strict=True):
        assert f'pip install "kickdyn[{extra}]"' in line


def test_the_lowest_versions_are_those_of_pyproject():
    text = (ROOT / "constraints-lowest.txt").read_text("utf-8")
    lowest = dict(re.findall(r"^([\w-]+)==([\d.]+?)(?:\.0)*$", text, re.MULTILINE))
    needs = [*PROJECT["dependencies"], *(x for key in (*LACKING, "test") for x in OPTIONAL[key])]
    bounds = (re.match(r"([\w-]+)>=([\d.]+?)(?:\.0)*(?:,|$)", need) for need in needs)
    assert lowest == {bound[1]: bound[2] for bound in bounds if bound}
