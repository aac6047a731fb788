"""The live view: what a browser gets, and who gets it."""

import base64
import http.client
import json
import sys
import urllib.error
import urllib.request
from urllib.parse import urlsplit

import numpy as np
import pytest
import umsgpack

import kickdyn as kd
from kickdyn.view.show import ADDRESS, HEARTBEAT


class Browser:
    """Reads the updates of a view, as the script of its page does."""

    def __init__(self, view):
        self.stream = urllib.request.urlopen(f"{view.url}events", timeout=600)
        self.commands = {}

    def next_moves(self):
        """Return the next message, which comes within 24 signs of life, two minutes."""
        waits, line = 0, b""
        while not line.startswith(b"data: "):
            line = self.stream.readline()
            waits += line.startswith(b": still here")
            assert waits < 24, "no message has come"
        return json.loads(line.removeprefix(b"data: "))

    def next_update(self):
        """Return the next update, with the commands of its scenes."""
        update = self.next_moves()
        self.new = update["commands"]
        for number, text in self.new:
            self.commands[number] = umsgpack.unpackb(base64.b64decode(text))
        numbers = [number for scene in update["scenes"] for number in scene["commands"]]
        self.commands = {number: self.commands[number] for number in numbers}
        return update, [self.commands[number] for number in numbers]


@pytest.fixture
def view(kick):
    view = kd.show(kick[0].posture)
    yield view
    view.close()


def test_a_browser_gets_what_the_page_has(view, kick, commands_of):
    impact, _, path = kick
    browser = Browser(view)
    update, commands = browser.next_update()
    assert commands == commands_of(kd.page(impact.posture).html)
    assert not update["keeps_camera"]
    assert kd.show(impact, path) is view
    update, commands = browser.next_update()
    page = kd.page(impact, path)
    assert commands == commands_of(page.html)
    assert update["title"] == page.title
    assert update["caption"] == f'<section class="scene" data-scene="0">\n{page.panel}</section>'
    assert update["scenes"][0]["times"] == page.pace.knots.tolist()
    assert not update["keeps_camera"]


def test_an_update_keeps_the_camera_and_sends_what_is_new(view, kick):
    browser = Browser(view)
    browser.next_update()
    posture = kick[0].posture
    view.update(posture.leg.posture(posture.q + 0.1))
    update, commands = browser.next_update()
    assert update["keeps_camera"]
    assert 0 < len(browser.new) < len(commands) / 2
    view.update(posture)
    latecomer = Browser(view)
    update, _ = latecomer.next_update()
    assert not update["keeps_camera"]
    assert len(latecomer.new) == len(latecomer.commands)


def test_one_tab_is_opened(kick, opened, monkeypatch):
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)  # outside of Jupyter
    kd.show(kick[0].posture, browser=False).close()  # which another test may have left
    view = kd.show(kick[0].posture)
    kd.show(kick[0])
    assert opened == [view.url]
    view.close()
    other = kd.show(kick[0], browser=False)
    assert other is not view
    assert other.url != view.url
    assert opened == [view.url]
    other.close()


def test_only_this_machine_and_who_knows_the_address_get_it(view):
    url = urlsplit(view.url)
    assert url.hostname == ADDRESS

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
        assert status(host, url.path) == 404
        assert status(url.netloc, url.path, host) == 404
    for path in ("/", "/events", url.path[:-2] + "/", url.path + "../"):
        assert status(url.netloc, path) == 404


def test_a_closed_view_serves_nothing(kick):
    view = kd.show(kick[0].posture)
    assert view.is_open
    view.close()
    view.close()
    assert not view.is_open
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(view.url, timeout=600)


def test_what_cannot_be_shown_leaves_the_view_as_it_is(view, kick):
    with pytest.raises(kd.InvalidInput, match=r"subject is 1\.0: it must be"):
        kd.show(1.0)
    with pytest.raises(kd.InvalidInput, match="path is given with a Posture"):
        view.update(kick[0].posture, kick[2])
    assert Browser(view).next_update()[0]["title"] == "leg_human"


def test_a_posture_has_its_angles_and_contact_point():
    leg = kd.Leg.human()
    posture = leg.posture(np.radians([40.0, 30.0, -20.0]))
    panel = kd.page(posture, caption="at the impact").panel
    for row in ("<th>hip</th><td>40°", "<th>knee</th><td>30°", "<th>ankle</th><td>-20°"):
        assert row in panel
    x, y, z = posture.contact_point
    assert f"{x:.3f}, {y:.3f}, {z:.3f} m" in panel
    assert "at the impact" in panel
    assert "<td>0°</td>" in kd.page(leg).panel


def test_a_still_kick_moves_in_the_browser(kick, view):
    impact, _, path = kick
    assert kd.show(impact, path, still=True) is view
    browser = Browser(view)
    browser.next_update()
    other = kd.strike(impact.posture, 0.5 * impact.v_before, impact.ball, impact.contact)
    view.update(other)
    moved = browser.next_moves()
    assert f">{np.linalg.norm(other.impulse):.3g} N s<" in moved["labels"]
    paths = {umsgpack.unpackb(base64.b64decode(each))["path"] for each in moved["moves"]}
    assert {"/meshcat/leg/1", "/meshcat/ball", "/meshcat/ellipsoid", "/meshcat/ground"} <= paths
    latecomer = Browser(view)
    latecomer.next_update()
    assert latecomer.next_moves() == moved
    view.update(other.posture)  # another kind of subject is a new scene
    update, _ = browser.next_update()
    assert update["keeps_camera"]
    with pytest.raises(kd.InvalidInput, match=r"subject .* must be"):
        kd.show(impact.posture, still=True)


def test_without_news_a_message_waits(view, monkeypatch):
    waits = []
    monkeypatch.setattr(view._changed, "wait", waits.append, raising=False)
    messages = view._messages()
    assert next(messages).startswith("data: ")
    assert waits == []
    assert [next(messages), next(messages)] == [": still here\n\n"] * 2
    assert waits == [HEARTBEAT] * 2
