"""The server: who is let in, what is served, and connections that come and go; and the command that starts it."""

import asyncio
import http.client
import json
import queue
import re
import signal
import socket as net
import subprocess
import sys

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import timlab
from motorgrad.cli import main
from timlab.editor import Server, Session
from timlab.editor._server import _Outbox

TIMEOUT = 600


@pytest.fixture
def server(tmp_path):
    """A server of pages of the test's own."""
    static = tmp_path / "static"
    (static / "assets").mkdir(parents=True)
    (static / "index.html").write_text("<!doctype html><title>TimLab</title>")
    (static / "assets" / "main.js").write_text("1")
    (tmp_path / "secret.txt").write_text("secret")
    session = Session(folder=tmp_path, states=tmp_path / "states")
    server = Server(session, static=static)
    server.start()
    yield server
    server.stop()
    session.close()


def get(server, path, **headers):
    """The status, headers and text that a request is answered with."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=TIMEOUT)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, dict(answer.getheaders()), text


def socket(server, token=None, **options):
    address = f"ws://127.0.0.1:{server.port}/{token or server.token}/socket"
    return connect(address, **{"origin": f"http://127.0.0.1:{server.port}", "open_timeout": TIMEOUT} | options)


def ask(connection, **operation):
    """Send an operation. **Returns** its answer."""
    connection.send(json.dumps(operation))
    while True:
        event = json.loads(connection.recv(TIMEOUT))
        if event["event"] in ("done", "refused"):
            return event


def hear_out(connection):
    """Hear all that is said, to the end."""
    while True:
        connection.recv(TIMEOUT)


def enter(server):
    """The place to which the printed address leads, and the headers of a browser that has been there."""
    status, headers, _ = get(server, f"/{server.token}/")
    assert status == 303
    return headers["location"], {"Cookie": headers["set-cookie"].split(";")[0]}


def test_pages_are_served_to_who_knows_the_token(server):
    place, cookie = enter(server)
    assert server.token not in place
    status, headers, text = get(server, place, **cookie)
    assert (status, text) == (200, "<!doctype html><title>TimLab</title>")
    assert "default-src 'self'" in headers["content-security-policy"]
    assert headers["referrer-policy"] == "no-referrer"
    assert get(server, f"{place}assets/main.js", **cookie)[0] == 200
    assert get(server, f"{place}assets/none.js", **cookie)[0] == 404
    assert len(server.token) >= 32
    assert server.url == f"http://127.0.0.1:{server.port}/{server.token}/"


def test_a_checkout_without_built_pages_says_how_to_build_them(server):
    place, cookie = enter(server)
    assert server.built
    (server._static / "index.html").unlink()
    status, _, text = get(server, place, **cookie)
    assert (status, server.built) == (404, False)
    assert "make editor" in text


@pytest.mark.parametrize(
    "path", ["/", "/index.html", "/assets/main.js", "/x/", "/{token}x/", "/{short}/", "/?token={token}", "//{token}/"]
)
def test_without_the_token_nothing_is_served(server, path):
    status, _, text = get(server, path.format(token=server.token, short=server.token[:-1]))
    assert status == 403
    assert "TimLab" not in text


@pytest.mark.parametrize("path", ["../secret.txt", "%2e%2e/secret.txt", "..%2fsecret.txt", "/etc/passwd", "assets"])
def test_nothing_outside_the_built_pages_is_served(server, path):
    place, cookie = enter(server)
    status, _, text = get(server, f"{place}{path}", **cookie)
    assert status in (403, 404)
    assert "secret" not in text


@pytest.mark.parametrize(
    "line",
    [
        *(
            "OPTIONS * HTTP/1.1",
            "GET ? HTTP/1.1",
            "GET * HTTP/1.1",
            "GET http://evil.example HTTP/1.1",
            "GET x HTTP/1.1",
        ),
        *("GET {place}%00 HTTP/1.1", "GET {place}a%00b.js HTTP/1.1", "GET /%00{place} HTTP/1.1"),
        *("GET {place}{long} HTTP/1.1", "GET {place}{deep} HTTP/1.1", "GET /{long}/ HTTP/1.1"),
        *("GET {place}%ff%fe HTTP/1.1", "GET {place}%ED%A0%80 HTTP/1.1", "GET {place}.. HTTP/1.1"),
        *("POST {place} HTTP/1.1", "GET {place}?{long} HTTP/1.1", "GET  HTTP/1.1", "\x00\xff", "GET / HTTP/9.9"),
        *("GET {place}CON HTTP/1.1", "GET {place}/// HTTP/1.1", "BREW {place} HTTP/1.1", "CONNECT a:1 HTTP/1.1"),
    ],
)
def test_odd_requests_are_refused_as_the_clients_mistake(server, line):
    place, cookie = enter(server)
    request = line.format(place=place, long="x" * 5000, deep="a/" * 3000).encode("latin-1")
    head = {"Host": f"127.0.0.1:{server.port}", "Connection": "close", **cookie}
    with net.create_connection(("127.0.0.1", server.port), TIMEOUT) as connection:
        lines = [request, *(f"{name}: {value}".encode() for name, value in head.items())]
        connection.sendall(b"\r\n".join(lines) + b"\r\n\r\n")
        answer = b""
        while part := connection.recv(65536):
            answer += part
    status = int(answer.split()[1])
    assert 400 <= status < 500 or (status == 303 and b"?x" in request)  # a query is left out
    assert b"Traceback" not in answer
    assert get(server, place, **cookie)[0] == 200


def test_foreign_origins_and_hosts_are_refused(server):
    page, cookie = enter(server)
    for origin in (
        "http://evil.example",
        "null",
        f"http://127.0.0.1:{server.port + 1}",
        f"https://127.0.0.1:{server.port}",
    ):
        assert get(server, page, Origin=origin, **cookie)[0] == 403
        assert get(server, f"/{server.token}/", Origin=origin)[0] == 403
        with pytest.raises(InvalidStatus, match="403"):
            socket(server, origin=origin)
    assert get(server, page, Host="evil.example", **cookie)[0] == 403  # a foreign name that leads to this machine
    for token in ("x", server.token[:-1], server.token + "x"):
        with pytest.raises(InvalidStatus, match="403"):
            socket(server, token)
    with pytest.raises(InvalidStatus, match="403"):
        socket(server, origin=None)
    assert get(server, page, Origin=f"http://127.0.0.1:{server.port}", **cookie)[0] == 200
    with socket(server):
        pass


def test_it_is_heard_on_this_machine_alone(server):
    assert server._socket.getsockname()[0] == "127.0.0.1"


def test_a_lost_connection_comes_back_without_losing_or_doubling_edits(server):
    first = socket(server)
    own = {"client": "tab", "op": "add", "at": [], "type": "gain"}
    ask(first, client="tab", sequence=1, op="hello")
    assert ask(first, sequence=2, **own)["event"] == "done"
    first.send(json.dumps({"sequence": 3, **own}))  # whether it arrives is not known
    first.socket.close()
    second = socket(server)
    ask(second, client="tab", sequence=4, op="hello", revision=1)
    for sequence in (2, 3):
        assert ask(second, sequence=sequence, **own)["event"] == "done"
    assert list(server.session.diagram.nodes) == ["gain", "gain 2"]
    second.close()


def test_tabs_share_the_session_and_one_that_goes_disturbs_none(server):
    one, two = socket(server), socket(server)
    ask(one, client="one", sequence=1, op="hello")
    two.socket.close()
    for sequence in range(2, 12):
        assert ask(one, client="one", sequence=sequence, op="add", at=[], type="gain")["event"] == "done"
    three = socket(server)
    three.send(json.dumps({"client": "three", "sequence": 1, "op": "hello"}))
    while (event := json.loads(three.recv(TIMEOUT)))["event"] != "document":
        pass
    assert len(event["view"]["nodes"]) == 10
    three.send(b"bytes")  # not the language that is spoken here: it is hung up on
    with pytest.raises(ConnectionClosed):
        hear_out(three)
    assert ask(one, client="one", sequence=12, op="undo")["event"] == "done"
    one.close()


def test_a_slow_client_is_not_sent_a_pile_of_samples(server):
    """It hears of all that was done, and in the end what was seen as a whole."""
    loop = asyncio.new_event_loop()
    heard, again = [], []

    async def listen():
        outbox = _Outbox(loop, again.append, most=10)
        for number in range(50):
            outbox.put({"event": "samples", "number": number})
            outbox.put({"event": "changed", "number": number})
        sender = asyncio.create_task(outbox.drain(hear))
        while len(again) < 1:
            await asyncio.sleep(0.01)
        sender.cancel()

    async def hear(text):
        heard.append(json.loads(text))

    loop.run_until_complete(asyncio.wait_for(listen(), TIMEOUT))
    loop.close()
    assert [event["number"] for event in heard if event["event"] == "changed"] == list(range(50))
    assert sum(event["event"] == "samples" for event in heard) <= 10
    assert len(again) == 1


def test_a_port_that_is_taken_is_refused_by_number(server):
    with pytest.raises(ValueError, match=f"port = {server.port}: cannot be used"):
        Server(server.session, server.port)
    with pytest.raises(ValueError, match="port = -1: must be an integer from 0"):
        Server(server.session, -1)


@pytest.mark.slow
def test_the_command_serves_until_it_is_stopped(tmp_path, process_environment):
    command = [sys.executable, "-m", "motorgrad", "lab", "new.json", "--no-browser"]
    process = subprocess.Popen(
        command, cwd=tmp_path, env=process_environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        assert process.stdout is not None
        port, token = re.findall(r"http://127.0.0.1:(\d+)/([\w-]+)/", process.stdout.readline())[0]
        address = f"ws://127.0.0.1:{port}/{token}/socket"
        with connect(address, origin=f"http://127.0.0.1:{port}", open_timeout=TIMEOUT) as connection:
            assert ask(connection, client="a", sequence=1, op="add", at=[], type="gain")["event"] == "done"
            assert ask(connection, client="a", sequence=2, op="save")["event"] == "done"
    finally:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, errors) == (130, "motorgrad lab: stopped\n")
    assert list(timlab.load(tmp_path / "new.json").nodes) == ["gain"]
    assert [path.name for path in tmp_path.iterdir()] == ["new.json"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--port", "70000"], "port = 70000: must be an integer from 0 to 65,535"),
        (["--gallery", "chian"], "did you mean 'chain'"),
        (["x.json", "--gallery", "chain"], "must be given without a file"),
        ([".."], "must be a file, not a folder"),
        (["evil.py"], "file = 'evil.py': must be a name that ends in .json"),
        (["nowhere/x.json"], "must be in an existing folder"),
        (["spoilt.json"], "spoilt.json: line 1, column 1: must be JSON"),
    ],
)
def test_the_command_refuses_before_it_serves(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spoilt.json").write_text("hello")
    assert main(["lab", *arguments, "--no-browser"]) == 2
    assert message in capsys.readouterr().err


def test_the_widget_carries_the_same_messages(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    diagram = timlab.Diagram()
    diagram.add("gain", timlab.Gain())
    widget, sent = timlab.edit(diagram, tmp_path / "cell.json"), queue.SimpleQueue()
    monkeypatch.setattr(widget, "send", lambda text, buffers=None: sent.put(json.loads(text)))
    widget._handle_custom_msg(json.dumps({"client": "cell", "sequence": 1, "op": "add", "at": [], "type": "scope"}), [])
    widget._handle_custom_msg({"not": "a text"}, [])
    while (event := sent.get(timeout=TIMEOUT))["event"] != "done":
        assert event["event"] in ("changed", "problems", "run")
    assert event["client"] == "cell"
    assert list(widget.diagram.nodes) == ["gain", "scope"]
    assert list(diagram.nodes) == ["gain"]
    widget.close()
    widget.close()


@pytest.mark.slow
def test_the_lab_alone_loads_nothing_of_the_web(process_environment):
    code = "import timlab, sys; print([n for n in ('starlette', 'uvicorn', 'anywidget') if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=process_environment)
    assert done.stdout.strip() == "[]"
