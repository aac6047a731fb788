import http.client
import socket
import threading
from urllib.parse import urlsplit

import psutil
import pytest

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
    assert get(server, Host=f"localhost:{urlsplit(server.url).port}")[0] == 200
    assert capfd.readouterr() == ("", "")
    assert not caplog.records


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "evil.example:7000"])
def test_a_foreign_host_is_not_found(server, host):
    status, answer = get(server, Host=host)
    assert status == 404
    assert "leg_human" not in answer


def test_stops_while_a_browser_is_connected(kick):
    server = kd.page(kick[0]).serve()
    address = ("127.0.0.1", urlsplit(server.url).port)
    with socket.create_connection(address, timeout=10):
        server.stop()
    assert not [t for t in threading.enumerate() if t.name == "kickdyn page server"]
    with socket.socket() as probe:
        assert probe.connect_ex(address) != 0
    server.stop()  # a second time does nothing


def test_a_port_that_is_not_free(server, kick):
    with pytest.raises(kd.InvalidInput, match="port is 70000"):
        kd.page(kick[0]).serve(70000)
    port = urlsplit(server.url).port
    with pytest.raises(kd.InvalidInput, match=f"port {port} cannot be served"):
        kd.page(kick[0]).serve(port)


def test_the_page_in_a_browser(server, chromium):
    dom = chromium(server.url, "--dump-dom")
    assert "<canvas" in dom
    assert "Animations" in dom  # meshcat's controls for the animation
