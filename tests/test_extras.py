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
