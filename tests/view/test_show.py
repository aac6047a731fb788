"""The live view: what a browser gets, and who gets it."""

import base64
import http.client
import json
import math
import urllib.error
import urllib.request
from urllib.parse import urlsplit

import numpy as np
import pinocchio as pin
import pytest
from drawn_scene import SINGLE, DrawnScene, check_joints, in_the_picture
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.view.show import ADDRESS, StillKick, impulse_ellipsoid


class Browser:
    """Reads the updates of a view, as the script of its page does."""

    def __init__(self, view):
        self.stream = urllib.request.urlopen(f"{view.url}events", timeout=600)
        self.commands = {}

    def next_message(self):
        """Return the next message within 24 signs of life."""
        waits, line = 0, b""
        while not line.startswith(b"data: "):
            line = self.stream.readline()
            waits += line.startswith(b": still here")
            assert waits < 24, "no message has come"
        return json.loads(line.removeprefix(b"data: "))

    def next_update(self):
        """Return the next update, and the commands of its scenes."""
        update = self.next_message()
        self.sent = update["commands"]
        self.commands |= {number: base64.b64decode(text) for number, text in self.sent}
        numbers = [number for scene in update["scenes"] for number in scene["commands"]]
        self.commands = {number: self.commands[number] for number in numbers}
        return update, [self.commands[number] for number in numbers]


@pytest.fixture
def view(kick):
    view = kd.show(kick[0].posture)
    yield view
    view.close()


def test_a_browser_gets_what_the_page_has(view, kick):
    impact, _, path = kick
    browser = Browser(view)
    update, commands = browser.next_update()
    assert commands == kd.page(impact.posture).viewer.window.commands
    assert kd.show(impact, path) is view
    update, commands = browser.next_update()
    page = kd.page(impact, path)
    assert commands == page.viewer.window.commands
    assert update["title"] == page.title
    assert page.panel in update["caption"]
    assert update["scenes"][0]["times"] == page.pace.knots.tolist()
    assert not update["keeps_camera"]
    view.update(impact.posture.leg.posture(impact.posture.q + 0.1))
    update, commands = browser.next_update()
    assert update["keeps_camera"]
    view.update(impact.posture)
    browser.next_update()
    assert 0 < len(browser.sent) < len(commands) / 2  # only what is new
    latecomer = Browser(view)
    assert not latecomer.next_update()[0]["keeps_camera"]


def test_a_still_view_sends_what_moves(kick, make_kick):
    impact, _, path = kick
    other, _, other_path = make_kick(impact.posture.leg, 5.0, (20, 40, 0))
    view = kd.show(impact, path, still=True)
    browser = Browser(view)
    browser.next_update()
    view.update(other, other_path, caption="slower")
    update, still = browser.next_message(), StillKick(impact, path)
    right = still.moves(other, other_path, "slower")
    assert [base64.b64decode(text) for text in update["moves"]] == right.viewer.window.commands
    assert right.panel in update["caption"]
    assert "\n".join(right.viewer.window.labels) in update["labels"]
    view.close()
    assert not view.is_open


def test_only_this_machine_and_who_knows_the_address_get_it(view):
    url = urlsplit(view.url)
    assert url.hostname == ADDRESS == "127.0.0.1"

    def status(host, path, *further):
        connection = http.client.HTTPConnection(ADDRESS, url.port, timeout=600)
        connection.putrequest("GET", path, skip_host=True)
        for name in (host, *further):
            connection.putheader("Host", name)
        connection.endheaders()
        return connection.getresponse().status

    assert status(url.netloc, url.path) == 200
    assert status(f"localhost:{url.port}", url.path) == 200
    for host in ("example.org", f"example.org:{url.port}", ADDRESS, f"{url.netloc}@example.org"):
        assert status(host, url.path) == 404, host
        assert status(url.netloc, url.path, host) == 404, host
    for path in ("/", "/events", url.path[:-2] + "/", url.path + "../"):
        assert status(url.netloc, path) == 404, path


LEG = kd.Leg.human()


def kick(knee=20.0, speed=10.0, normal=(2, 0, 1)):
    posture = LEG.posture(np.radians([10, knee, -5]))
    v = posture.joint_velocity(speed * np.array([math.cos(0.4), 0, math.sin(0.4)]))
    return kd.strike(posture, v, kd.Ball(), kd.Contact(normal, 0.8, 0.4))


def test_the_moves_place_all_that_another_kick_moves():
    other = kick(knee=50.0, speed=6.0, normal=(1, 0, 2))  # the ball is above the sole
    moves = StillKick(kick()).moves(other, caption="slower")
    scene = DrawnScene(moves)
    check_joints(scene, "leg", LEG, other.posture.q)
    agrees(scene.point("ball"), other.ball_before.position, SINGLE)
    floor, bottom = scene.point("ground")[2], other.ball_before.position[2] - other.ball.radius
    assert floor < bottom - 1e-3
    assert not find_depths(LEG, other.posture.q, floor - 1e-6)
    assert find_depths(LEG, other.posture.q, floor + 5e-3)
    path = kd.fly(other.ball_after, other.ball, kd.Air())
    agrees(scene.point("end"), path.landing.position, SINGLE)
    agrees(scene.curve("curve")[-1], path.landing.position, 10 * SINGLE)
    assert f">{path.range:.3g} m<" in scene.labels
    assert f">{np.linalg.norm(other.impulse):.3g} N s<" in scene.labels
    assert "slower" in moves.panel


def test_the_camera_sees_flights_of_half_as_much_again():
    first, other = kick(), kick(speed=11.5)
    ranges = [kd.fly(hit.ball_after, hit.ball, kd.Air()).range for hit in (first, other)]
    assert 1.4 < ranges[1] / ranges[0] < 1.55
    still = StillKick(first)
    shown, moved = DrawnScene(still.page), DrawnScene(still.moves(other))
    in_the_picture(shown.slopes(moved.curve("curve")))


def test_arrows_and_ellipsoid_keep_their_scale():
    """The ellipsoid is as long in a direction as the root of the effective mass."""
    impact, other, scales = kick(), kick(knee=60.0, speed=5.0), []
    still = StillKick(impact)
    for hit, source in ((impact, still.page), (other, still.moves(other))):
        scene = DrawnScene(source)
        start, vector = scene.arrow("arrow")
        agrees(start, hit.posture.contact_point, SINGLE)
        scale = np.linalg.norm(vector) / np.linalg.norm(hit.impulse)
        agrees(vector, scale * hit.impulse, SINGLE)
        ellipsoid, direction = scene.pose("ellipsoid"), np.array([0.6, 0.0, 0.8])
        agrees(ellipsoid[:3, 3], hit.posture.contact_point, SINGLE)
        radius = 1.0 / np.linalg.norm(np.linalg.solve(ellipsoid[:3, :3], direction))
        scales.append((scale, radius / np.sqrt(hit.posture.effective_mass(direction))))
    assert scales[0] == pytest.approx(scales[1], rel=SINGLE)


def test_impulses_on_the_ellipsoid_take_the_same_energy():
    """A planar leg has a flat one."""
    leg = kd.Leg.human(height=1.8, mass=75, model="3d")
    posture = leg.posture(np.linspace(0.1, 0.6, leg.model.nq))
    radii, axes = impulse_ellipsoid(posture)
    mass = pin.crba(leg.model, leg.model.createData(), posture.q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    for direction in np.random.default_rng(3).normal(size=(20, 3)):
        impulse = axes @ (radii * direction / np.linalg.norm(direction))
        jump = np.linalg.solve(mass, posture.jacobian.T @ impulse)
        assert 0.5 * jump @ mass @ jump == pytest.approx(0.5, rel=closed_form(1e3))
    radii, axes = impulse_ellipsoid(kick().posture)
    (flat,) = np.flatnonzero(radii == 0)
    np.testing.assert_allclose(np.abs(axes[:, flat]), (0, 1, 0), atol=closed_form(1e4))
