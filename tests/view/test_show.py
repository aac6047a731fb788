"""The live view: what a browser gets, and who gets it."""

import base64
import http.client
import json
import urllib.error
import urllib.request
from urllib.parse import urlsplit

import pytest

import kickdyn as kd
from kickdyn.view.show import ADDRESS
from kickdyn.view.still_kick import StillKick


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
    assert [base64.b64decode(text) for text in update["moves"]] == right.commands
    assert right.panel in update["caption"]
    assert right.labels in update["labels"]
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
