import asyncio
import http.client
import socket
import threading
from urllib.parse import urlsplit

import meshcat.geometry as shapes
import psutil
import pytest
import umsgpack
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

import kickdyn as kd


@pytest.fixture
def server(kick):
    with kd.page(kick[0], caption="<i>").serve() as running:
        yield running


def get(server, path="/", **headers):
    connection = http.client.HTTPConnection(urlsplit(server.url).netloc, timeout=10)
    try:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()
    finally:
        connection.close()


def connect(server, **headers):
    url = f"ws://{urlsplit(server.url).netloc}/scene"
    return websocket_connect(HTTPRequest(url, headers=headers, connect_timeout=10))


def listening():
    return {(c.laddr.ip, c.laddr.port) for c in psutil.Process().net_connections()
            if c.status == psutil.CONN_LISTEN}  # fmt: skip


def test_listens_on_this_machine_only_and_starts_no_child(kick):
    before, children = listening(), psutil.Process().children()
    with kd.page(kick[0]).serve() as server:
        ((address, port),) = listening() - before
        assert address == "127.0.0.1"
        assert server.url == f"http://127.0.0.1:{port}/"
        assert psutil.Process().children() == children
    assert listening() == before


def test_serves_the_page_in_silence(server, capfd, caplog):
    status, html = get(server)
    assert status == 200
    assert "&lt;i&gt;" in html
    assert "leg_human" in html
    assert get(server, "/static/")[0] == 404
    assert capfd.readouterr() == ("", "")
    assert not caplog.records


@pytest.mark.parametrize("path", ["/", "/scene"])
@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "evil.example:7000"])
def test_a_foreign_host_is_not_found(server, path, host):
    assert get(server, path, Host=host)[0] == 404


def test_a_page_from_elsewhere_may_not_watch(server):
    async def ask():
        with pytest.raises(HTTPClientError, match="403"):
            await connect(server, Origin="http://evil.example")

    asyncio.run(ask())


def test_a_browser_gets_the_scene_and_what_is_drawn_later(server):
    scene = server.viewer.window.commands()

    async def watch():
        browser = await connect(server)
        first = [await browser.read_message() for _ in scene]
        server.viewer["extra"].set_object(shapes.Sphere(0.1))
        later = await asyncio.wait_for(browser.read_message(), 10)
        browser.close()
        assert await browser.read_message() is None
        return first, umsgpack.unpackb(later)

    first, later = asyncio.run(watch())
    assert first == scene
    assert later["path"] == "/meshcat/extra"


def test_stops_while_a_browser_watches(kick):
    server = kd.page(kick[0]).serve()
    address = ("127.0.0.1", urlsplit(server.url).port)

    async def watch():
        browser = await connect(server)
        await asyncio.to_thread(server.stop)
        while await asyncio.wait_for(browser.read_message(), 10) is not None:
            pass
        assert browser.close_code == 1001  # going away, said properly
        browser.close()

    asyncio.run(watch())
    assert not [t for t in threading.enumerate() if "kickdyn" in t.name]
    with socket.socket() as probe:
        assert probe.connect_ex(address) != 0
    server.stop()  # a second time does nothing
    server.viewer["late"].set_object(shapes.Sphere(0.1))


def test_stopping_hangs_up(kick):
    server = kd.page(kick[0]).serve()
    with socket.create_connection(("127.0.0.1", urlsplit(server.url).port), timeout=10) as idle:
        idle.sendall(b"GET /none HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert b"404" in idle.recv(65536)
        server.stop()
        while idle.recv(65536):
            pass


def test_a_port_that_cannot_be_had(server, kick):
    with pytest.raises(kd.InvalidInput, match="port is 70000"):
        kd.page(kick[0]).serve(70000)
    port = urlsplit(server.url).port
    with pytest.raises(kd.InvalidInput, match=f"port {port} cannot be served"):
        kd.page(kick[0]).serve(port)


def test_the_page_in_a_browser(server, chromium):
    dom = chromium(server.url, "--dump-dom")
    assert "<canvas" in dom
    assert "Animations" in dom  # meshcat's panel for the film it was sent
