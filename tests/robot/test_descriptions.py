"""Names of robot_descriptions: a module of that name tells where the files are, or why not."""

import sys
from types import ModuleType

import pytest

import kickdyn as kd
from kickdyn.cli.leg_options import load_leg
from kickdyn.robot import descriptions

MJCF = """<mujoco><compiler meshdir="../meshes"/><asset><mesh name="m" file="m.stl"/></asset>
<worldbody><body name="base"><freejoint/><geom size="0.2"/><body name="foot"><joint name="hip"/>
<geom size="0.1" pos="0 0 -1"/></body></body></worldbody></mujoco>"""


@pytest.fixture
def described(tmp_path, monkeypatch):
    """Make a module of robot_descriptions, with files in a cache."""
    (tmp_path / "robot" / "files").mkdir(parents=True)

    def make(name, text, key):
        file = tmp_path / "robot" / "files" / "robot.xml"
        file.write_text(text)
        module = ModuleType(f"robot_descriptions.{name}")
        module.REPOSITORY_PATH, module.PACKAGE_PATH = str(tmp_path), str(tmp_path / "robot")
        setattr(module, key, str(file))
        monkeypatch.setitem(sys.modules, module.__name__, module)
        return name

    return make


def test_a_urdf(described, good_urdf):
    name = described("atlas_v4_description", good_urdf, "URDF_PATH")
    assert kd.Leg.from_robot(name, "shank").joint_names == ("hip", "knee")
    assert load_leg(name, "shank").joint_names == ("hip", "knee")
    assert load_leg(name, "shank", locked={"hip": 90}).joint_names == ("knee",)
    with pytest.raises(kd.InvalidInput, match=r"^frame 'heel' is unknown"):
        kd.Leg.from_robot(name, "heel")


def test_an_mjcf_has_its_files_anywhere_in_its_package(described):
    name = described("g1_mj_description", MJCF, "MJCF_PATH")
    leg = kd.Leg.from_robot(name, "foot")
    assert leg.joint_names == ("hip",)
    assert kd.Leg.from_robot(name, "foot", base="floating").nv == 7
    with pytest.raises(
        kd.InvalidInput, match=r"no frame is named, and frame 'toe' is unknown: .*b"
    ):
        kd.Leg.from_robot(name)
    with pytest.raises(kd.InvalidInput, match="joint 'knee' is unknown"):
        kd.Leg.from_robot(name, "foot", locked={"knee": 0})
    with pytest.raises(kd.InvalidInput, match=r"^base is 'free'"):
        kd.Leg.from_robot(name, base="free")
    with pytest.raises(kd.InvalidInput, match=r"legs_only is for g1, .*use locked="):
        kd.Leg.from_robot(name, "foot", legs_only=True)
    with pytest.raises(kd.InvalidInput, match="package-dir is 'a': it is for a URDF file"):
        load_leg(name, "foot", package_dirs=["a"])


def test_joints_are_locked_before_the_file_is_judged(described):
    slide = MJCF.replace("<freejoint/>", '<joint name="rail" type="slide"/>')
    name = described("g1_mj_description", slide, "MJCF_PATH")
    with pytest.raises(kd.MjcfError, match=r"lock it by locked=\{'rail"):
        load_leg(name, "foot", "floating")
    leg = load_leg(name, "foot", "floating", locked={"rail": 0.25})
    assert leg.joint_names == ("root_joint", "hip")
    assert leg.posture(leg.configuration()).contact_point.tolist() == [0, 0, 0.25]


def test_a_bad_file_is_named(described):
    name = described("atlas_v4_description", "<robot/>", "URDF_PATH")
    with pytest.raises(kd.UrdfError, match=r"robot\.xml: a robot has no name"):
        kd.Leg.from_robot(name)
    name = described("ur10e_description", "<robot/>", "XACRO_PATH")
    with pytest.raises(kd.InvalidInput, match="has neither a URDF nor an MJCF: make a URDF of its"):
        kd.Leg.from_robot(name)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("atlas_v4_descriptio", r"did you mean 'atlas_v4_description'\? choose g1, talos, .*bolt"),
        ("talso", r"did you mean 'talos'\? choose g1, .*or a name of robot_descriptions$"),
        ("_cache", "robot '_cache' is unknown: choose g1"),
        ("../a1_description", r"did you mean 'a1_description'\?"),
        ("", "robot '' is unknown: choose g1"),
    ],
)
def test_an_unknown_name_suggests_the_nearest(name, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_robot(name)


def test_without_the_package_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    said = r'install more with pip install "kickdyn\[descriptions\]"$'
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_robot("g1_mj_description")


def test_without_a_network_it_says_so_in_one_line(tmp_path, monkeypatch, capfd):
    """As git does it; the address is one that no network answers."""
    cache = pytest.importorskip("robot_descriptions._cache")
    place = cache.REPOSITORIES["mujoco_menagerie"]
    gone = type(place)(url=str(tmp_path / "gone.git"), commit=place.commit, cache_path="gone")
    monkeypatch.setitem(cache.REPOSITORIES, "mujoco_menagerie", gone)
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    monkeypatch.delitem(sys.modules, "robot_descriptions.g1_mj_description", raising=False)
    with pytest.raises(kd.InvalidInput) as refusal:
        kd.Leg.from_robot("g1_mj_description", "foot")
    said = str(refusal.value)
    assert said.startswith("robot 'g1_mj_description' is not on this machine, and cannot be downl")
    assert "gone.git' does not appear to be a git repository" in said
    assert said.endswith("or set ROBOT_DESCRIPTIONS_CACHE to a folder that has it")
    assert "\n" not in said
    out, progress = capfd.readouterr()
    assert out == ""
    assert progress.endswith("\n")  # the message gets a line of its own


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ValueError("stderr: 'fatal: no host: x'\nmore"), "no host: x"),
        (ImportError("Bad git executable.\nThe git"), "Bad git executable."),
        (OSError(), "OSError"),
    ],
)
def test_the_reason_is_one_line(error, said):
    assert descriptions._reason(error) == said
