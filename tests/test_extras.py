"""Without the packages of the extras kickdyn works, and what needs one of them names its extra.

Also: `constraints-lowest.txt` has the lowest versions that pyproject.toml allows.
"""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = ("robots", "motion", "store", "c3d", "mjcf", "descriptions")
"""Extras that users install for a feature."""

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
        for found in PathFinder.find_distributions(*context):
            if re.sub("[-_.]+", "_", found.metadata["Name"]).lower() not in HIDDEN:
                yield found

sys.meta_path[sys.meta_path.index(PathFinder)] = Hiding
"""
"""Python code that hides packages, named by the first argument, from `import`."""

ORDINARY = """
import kickdyn as kd
leg = kd.Leg.human()
scene = kd.load_scene("free_kick")
print(kd.simulate(scene).summary)
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
"""What needs the packages of each extra."""


def packages(extra):
    """Return the modules of an extra's packages."""
    requirements = PROJECT["optional-dependencies"][extra]
    return [re.split("[<>=]", text)[0].replace("-", "_") for text in requirements]


def without_extras(folder, code):
    """Run Python code where no package of an extra can be imported; return what it printed."""
    hidden = ",".join(name for extra in EXTRAS for name in packages(extra))
    (folder / "script.py").write_text(HIDE + code)
    (folder / "leg.xml").write_text("<mujoco><worldbody/></mujoco>")
    ended = subprocess.run(
        [sys.executable, "script.py", hidden], cwd=folder, capture_output=True, text=True
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    return ended.stdout


def test_what_needs_no_extra_works_without_them(tmp_path):
    printed = without_extras(tmp_path, ORDINARY).splitlines()
    assert printed[0].startswith(("landed", "at-plane", "reached"))
    assert printed[-2:] == ["2", "met"]
    assert (tmp_path / "kick.html").stat().st_size > 1e5


def test_what_needs_an_extra_names_it_in_a_line(tmp_path):
    tries = "".join(
        f"try:\n    {call}\nexcept kd.InvalidInput as error:\n    print(error)\n"
        for call in LACKING.values()
    )
    lines = without_extras(
        tmp_path, f"import kickdyn as kd\nleg, kick = kd.Leg.human(), kd.Kick(attack=0.5)\n{tries}"
    ).splitlines()
    assert len(lines) == len(EXTRAS)
    for extra, line in zip(LACKING, lines, strict=True):
        assert f'pip install "kickdyn[{extra}]"' in line


def test_every_extra_of_a_feature_is_hidden():
    tools = {"notebooks", "test", "docs", "dev"}
    assert set(PROJECT["optional-dependencies"]) - tools == set(EXTRAS) == set(LACKING)


def test_the_lowest_versions_are_those_of_pyproject():
    lowest = {}
    for line in (ROOT / "constraints-lowest.txt").read_text("utf-8").splitlines():
        if not line.startswith("#"):
            name, version = line.split("==")
            lowest[name] = version
    extras = [PROJECT["optional-dependencies"][extra] for extra in (*EXTRAS, "test")]
    bounds = {}
    for text in [*PROJECT["dependencies"], *(text for extra in extras for text in extra)]:
        if bound := re.match(r"([\w-]+)>=([\d.]+)", text):
            bounds[bound[1]] = bound[2]
    assert lowest.keys() == bounds.keys()
    for name, bound in bounds.items():
        assert re.fullmatch(rf"{re.escape(bound)}(\.0)*", lowest[name]), name


@pytest.mark.parametrize("name", ["heyoka"])
def test_what_only_tests_compare_with_is_installed_with_them(name):
    assert any(text.startswith(name) for text in PROJECT["optional-dependencies"]["test"])
