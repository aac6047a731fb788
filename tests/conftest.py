"""For all tests: the same examples in every run; a well-formed leg, ways to spoil and load it."""

import base64
import importlib
import math
import os
import re
import shutil
import subprocess

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # two workers of two threads wait for each other

import numpy as np
import pytest
import umsgpack
from hypothesis import settings
from numba.core import event as numba_event

import kickdyn as kd

settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")

IMPORTED = ("numba", "scipy.optimize", "xarray", "matplotlib.pyplot", "casadi", "mujoco")
"""Packages that take long to import; with a limit of time they are imported before the tests."""


def pytest_addoption(parser):
    parser.addoption(
        "--processor-limit", type=float, metavar="S",
        help="fail tests not marked slow that take more processor time, compilation left out",
    )  # fmt: skip


def pytest_configure(config):
    if config.getoption("--processor-limit"):
        for name in IMPORTED:
            importlib.import_module(name)


class Compiling(numba_event.Listener):
    """Adds up the processor time that numba compiles, nested compilations once."""

    def __init__(self):
        self.depth, self.begin, self.seconds = 0, 0.0, 0.0

    def on_start(self, event):
        if self.depth == 0:
            self.begin = processor_time()
        self.depth += 1

    def on_end(self, event):
        self.depth -= 1
        if self.depth == 0:
            self.seconds += processor_time() - self.begin


def processor_time():
    """Return the processor time of this process and of those it has waited for [s]."""
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Limit the processor time, which depends less on what else is running than time does.

    It still grows where more processes than processors share their caches.
    """
    limit = item.config.getoption("--processor-limit")
    if limit is None or item.get_closest_marker("slow"):
        return (yield)
    compiling, begin = Compiling(), processor_time()
    with numba_event.install_listener("numba:compile", compiling):
        outcome = yield
    seconds = processor_time() - begin - compiling.seconds
    if seconds > limit:
        pytest.fail(f"takes {seconds:.1f} s of processor time; {limit:g} s are allowed", False)
    return outcome


GOOD = """<robot name="leg">
  <link name="base"/>
  <joint name="hip" type="revolute">
    <parent link="base"/>
    <child link="thigh"/>
    <origin xyz="0 0 1" rpy="0 0 0"/>
    <axis xyz="0 -1 0"/>
    <limit lower="-1" upper="2" effort="100" velocity="9"/>
  </joint>
  <link name="thigh">
    <inertial>
      <origin xyz="0 0 -0.2"/>
      <mass value="7"/>
      <inertia ixx="0.08" ixy="0" ixz="0" iyy="0.07" iyz="0" izz="0.02"/>
    </inertial>
    <visual><geometry><sphere radius="0.05"/></geometry></visual>
  </link>
  <joint name="knee" type="revolute">
    <parent link="thigh"/>
    <child link="shank"/>
    <origin xyz="0 0 -0.4"/>
    <axis xyz="0 1 0"/>
    <limit lower="0" upper="2.5" effort="80" velocity="20"/>
  </joint>
  <link name="shank">
    <inertial>
      <mass value="3"/>
      <inertia ixx="0.05" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.03"/>
    </inertial>
  </link>
  <joint name="tip" type="fixed">
    <parent link="shank"/>
    <child link="toe"/>
    <origin xyz="0 0 -0.4"/>
  </joint>
  <link name="toe"/>
</robot>
"""


@pytest.fixture(scope="session")
def good_urdf():
    return GOOD


@pytest.fixture
def spoil():
    """Return the good leg with each `old` replaced by its `new`; every edit must bite."""

    def spoilt(*edits):
        text = GOOD
        for old, new in edits:
            assert old in text
            text = text.replace(old, new, 1)
        return text

    return spoilt


@pytest.fixture
def load(tmp_path):
    """Write text or bytes to a file and load it as a leg."""

    def loaded(content, frame="toe"):
        path = tmp_path / "leg.urdf"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return kd.Leg.from_urdf(path, frame)

    return loaded


def kick_of(leg, speed, degrees=(5, 10, -5), attack=30.0, air=None, friction=0.4):
    posture = leg.posture(np.radians(degrees))
    angle = math.radians(attack)
    way = np.array([math.cos(angle), 0.0, math.sin(angle)])
    contact = kd.Contact(way, restitution=0.8, friction=friction)
    ball = kd.Ball()
    hit = kd.strike(posture, posture.joint_velocity(speed * way), ball, contact)
    return hit, ball, kd.fly(hit.ball_after, ball, air)


@pytest.fixture(scope="session")
def make_kick():
    return kick_of


@pytest.fixture(scope="session")
def kick():
    """A kick of some metres: all is in the picture."""
    return kick_of(kd.Leg.human(), 8.0, air=kd.Air())


@pytest.fixture
def commands_of():
    """Unpack the meshcat commands that a page holds."""

    def commands(html):
        texts = re.findall(r'^"([A-Za-z0-9+/=]+)",?$', html, re.MULTILINE)
        return [umsgpack.unpackb(base64.b64decode(text)) for text in texts]

    return commands


@pytest.fixture(autouse=True)
def opened(monkeypatch):
    """Open no tab of a browser; return the addresses of those that would be."""
    addresses = []
    monkeypatch.setattr("webbrowser.open", addresses.append)
    return addresses


@pytest.fixture
def leg_looking_like(load, spoil):
    """Load the good leg, its thigh looking like the given visual."""

    def leg(visual):
        return load(
            spoil(('<visual><geometry><sphere radius="0.05"/></geometry></visual>', visual))
        )

    return leg


@pytest.fixture
def chromium(tmp_path):
    """Open a page in headless Chromium; return what it printed."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if not browser:
        pytest.skip("no chromium or google-chrome to open the page with")

    def opened(url, *options):
        flags = (
            "--headless=new --no-sandbox --use-gl=angle --use-angle=swiftshader "
            "--enable-unsafe-swiftshader --disable-background-networking --no-first-run "
            "--disable-sync --disable-component-update --window-size=640,480 "
            "--virtual-time-budget=3000 --enable-logging=stderr --v=0"
        )
        profile = f"--user-data-dir={tmp_path / 'profile'}"
        command = [browser, *flags.split(), profile, *options, url]
        done = subprocess.run(command, capture_output=True, text=True, timeout=3600, check=True)
        complaints = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
        assert complaints == []
        return done.stdout

    return opened


@pytest.fixture
def leg_with_arm(tmp_path):
    """The file of a leg beside an arm of two joints that follow each other, on one base."""
    arm = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}_link"/>'
        f'<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/>{gear}</joint>'
        f'<link name="{name}_link"><inertial><origin xyz="0 0 0.2"/><mass value="2"/><inertia '
        'ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for name, parent, gear in (
            ("shoulder", "base", ""),
            ("elbow", "shoulder_link", '<mimic joint="shoulder" offset="0.3"/>'),
        )
    )
    path = tmp_path / "leg.urdf"
    path.write_text(kd.Leg.human().file.text.replace("</robot>", arm + "</robot>"))
    return path


@pytest.fixture
def looped_mjcf(tmp_path):
    """The file of three bodies, the first and the last of which a bar connects."""
    path = tmp_path / "looped.xml"
    path.write_text(
        '<mujoco><worldbody><body name="base"><geom size="0.1"/>'
        '<body name="a"><joint name="ja" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body>'
        '<body name="b" pos="1 0 0"><joint name="jb" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/>'
        '<body name="c" pos="0 0 -1"><joint name="jc" axis="0 1 0"/>'
        '<geom size="0.1" pos="-0.5 0 0"/></body></body></body></worldbody><equality>'
        '<connect name="bar" body1="a" body2="c" anchor="0 0 -1"/></equality></mujoco>'
    )
    return path
