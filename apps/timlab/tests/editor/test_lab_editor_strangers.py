"""Strangers and crowds before TimLab's page: its gate, the bounds of messages, and fifty clients at once."""

import contextlib
import http.client
import json
import logging
import os
import random
import socket as sockets
import time

import pytest
from editor_page import wave
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from crowd import crowd, fair
from motorgrad.pages import BACKLOG, COOKIE, _gate
from timlab import dumps
from timlab.editor import Server, Session
from timlab.editor._server import MAX_MESSAGE_BYTES

TIMEOUT = 600
PLACES = 160  # for those without a token, fewer than usual


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """A server of a wave that can run; its pages are the test's own."""
    folder = tmp_path_factory.mktemp("served")
    (folder / "static").mkdir()
    (folder / "static" / "index.html").write_text("<!doctype html><title>TimLab</title>")
    session = Session(wave(), folder=folder, states=folder / "states")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_gate, "STRANGERS", PLACES)
        server = Server(session, static=folder / "static")
    server.start()
    yield server
    server.stop()
    session.close()


def address(server):
    return f"ws://127.0.0.1:{server.port}/{server.token}/socket"


def join(server, where=None, **options):
    settings = {"origin": f"http://127.0.0.1:{server.port}", "open_timeout": TIMEOUT, "max_queue": None, **options}
    return connect(where or address(server), **settings)


def get(server, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=TIMEOUT)
    connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, dict(answer.getheaders()), text


def ask(connection, **operation):
    connection.send(json.dumps(operation))
    while True:
        event = json.loads(connection.recv(TIMEOUT))
        if event["event"] in ("done", "refused") and event.get("sequence") == operation["sequence"]:
            return event


def hear_out(connection, *frames):
    """Send raw frames, and hear all that is said, to the end."""
    for frame in frames:
        connection.socket.sendall(frame)
    while True:
        connection.recv(TIMEOUT)


def alive(server):
    with join(server) as connection:
        return ask(connection, client=f"c{time.monotonic()}", sequence=1, op="hello")["event"] == "done"


def test_the_token_leaves_the_address_with_the_first_request(server):
    status, headers, _ = get(server, f"/{server.token}/")
    assert status == 303
    assert server.token not in headers["location"]
    assert "HttpOnly; SameSite=Lax" in headers["set-cookie"]
    assert f"Path={headers['location'].rstrip('/')};" in headers["set-cookie"]  # other ports of this host do not see it
    cookie = {"Cookie": headers["set-cookie"].split(";")[0]}
    status, headers, text = get(server, headers["location"], **cookie)
    assert (status, "TimLab" in text) == (200, True)
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    place = f"ws://127.0.0.1:{server.port}/{server._gate.place}/socket"
    with join(server, place, additional_headers=cookie) as connection:
        assert ask(connection, client="x", sequence=1, op="hello")["event"] == "done"
    for wrong in (f"{COOKIE}=x", f"x={server.token}", ""):
        assert get(server, f"/{server._gate.place}/", Cookie=wrong)[0] == 403
        with pytest.raises(InvalidStatus, match="403"):
            join(server, place, additional_headers={"Cookie": wrong})
    for origin in ("http://evil.example", "null", None):
        with pytest.raises(InvalidStatus, match="403"):
            join(server, place, origin=origin, additional_headers=cookie)
    assert get(server, f"/{server._gate.place}/", Cookie="", Sec_Fetch_Dest="iframe")[0] == 403


def test_no_log_has_the_token(server, caplog, capfd):
    caplog.set_level(logging.DEBUG)
    get(server, f"/{server.token}/")
    get(server, f"/{server._gate.place}/", Cookie=f"{COOKIE}={server.token}")
    assert alive(server)
    with join(server) as connection:
        connection.send("{" + server.token)
        connection.recv(TIMEOUT)
    theirs = [record for record in caplog.records if record.name != "websockets.client"]  # this test's own client
    assert [record for record in theirs if server.token in record.getMessage()] == []
    assert server.token not in "".join(capfd.readouterr())


def test_an_oversized_frame_ends_one_connection_and_no_other(server, capfd):
    """The frame only says how large it is: nothing is allocated for it."""
    with join(server) as bystander:
        for opcode in (0x81, 0x82):
            with join(server) as connection, pytest.raises(ConnectionClosed) as closed:
                hear_out(connection, bytes([opcode, 0xFF]) + (2**40).to_bytes(8, "big") + b"mask" + b"x" * 1000)
            assert closed.value.rcvd.code == 1009
        with join(server) as connection:  # many small frames of one message
            part = b"\x01\xfe\xff\xff" + bytes(4) + b" " * 65535
            with pytest.raises((ConnectionClosed, OSError)):
                hear_out(connection, part, *[b"\x00" + part[1:]] * (MAX_MESSAGE_BYTES // 65535 + 20))
        assert ask(bystander, client="by", sequence=1, op="hello")["event"] == "done"
    assert alive(server)
    assert "".join(capfd.readouterr()) == ""


def test_long_and_mutated_messages_are_refused_in_one_line(server, capfd):
    rng = random.Random(18)
    good = json.dumps({"client": "m", "sequence": 1, "op": "move", "at": [], "places": {"sine": [1, 2]}})
    with join(server) as connection:
        for number in range(300):
            raw = list(good)
            for _ in range(rng.choice([1, 2, 10])):
                raw[rng.randrange(len(raw))] = chr(rng.choice([34, 44, 58, 91, 123, 0x30, 0xE9, 0x1F600, 0]))
            connection.send("".join(raw))
            event = json.loads(connection.recv(TIMEOUT))
            assert event["event"] in ("refused", "done", "changed", "problems", "run"), number
        for text in ("[" * 100_000, '{"client": "' + "x" * 1_000_000 + '"}', '"' * 1_000_000, ""):
            connection.send(text)
            while (event := json.loads(connection.recv(TIMEOUT)))["event"] != "refused":
                pass
            assert len(event["message"]) < 500
            assert "\n" not in event["message"]
    assert alive(server)
    assert "".join(capfd.readouterr()) == ""


@pytest.mark.ci
def test_a_flood_slows_itself_alone(server):
    with join(server) as flood:
        for sequence in range(3000):
            flood.send(json.dumps({"client": "flood", "sequence": sequence, "op": "files"}))
        start = time.process_time()  # of the server, too; other processes do not count
        assert alive(server)
        assert time.process_time() - start < 5


def test_requests_that_never_end_hold_nobody_up(server):
    held = []
    for _ in range(50):
        half = sockets.create_connection(("127.0.0.1", server.port))
        half.sendall(b"GET /x HTTP/1.1\r\nHost: 127.0")
        held.append(half)
    assert alive(server)
    for half in held:
        half.close()


@pytest.mark.slow
@pytest.mark.ci
def test_fifty_clients_see_a_run_and_one_another(server):
    """While it runs: readers, slow ones, deaf ones and reloads; and an edit by one more is made in between."""
    hello = json.dumps({"client": "crowd", "sequence": 1, "op": "hello"})
    with join(server) as connection:
        assert ask(connection, client="own", sequence=1, op="hello")["event"] == "done"
        assert ask(connection, client="own", sequence=2, op="play", speed=1.0)["event"] == "done"
        found = crowd(address(server), hello, 8, readers=35, slow=5, deaf=3, reloaders=7)
        assert ask(connection, client="own", sequence=3, op="pause")["event"] == "done"
        before = len(server.session.diagram.nodes)
        assert ask(connection, client="own", sequence=4, op="add", at=[], type="gain")["event"] == "done"
    assert found["failed"] == []
    assert fair(found)
    assert len(server.session.diagram.nodes) == before + 1
    until = time.monotonic() + TIMEOUT
    while server.session._listeners and time.monotonic() < until:
        time.sleep(0.05)
    assert not server.session._listeners
    assert alive(server)


def test_connections_without_a_token_exhaust_nothing(server):
    """More than there are places, which send nothing or the beginning of a request: the owner gets in all the same."""
    with contextlib.ExitStack() as held:
        where = ("127.0.0.1", server.port)
        crowd = [held.enter_context(sockets.create_connection(where, TIMEOUT)) for _ in range(PLACES + BACKLOG)]
        for number, connection in enumerate(crowd):
            with contextlib.suppress(OSError):  # it is closed already
                connection.sendall([b"", b"GET / HTTP/1.1\r\nX: "][number % 2])
        assert get(server, f"/{server.token}/")[0] == 303
        assert len(server._lobby) <= PLACES
        assert len(server._server.server_state.connections) <= PLACES + BACKLOG
        assert alive(server)
        with contextlib.suppress(ConnectionResetError):
            assert crowd[0].recv(1) == b""


def test_many_who_come_at_once_and_show_the_token_late_get_in(server):
    """As browsers on a busy machine: all have connected before the first of them sends its request."""
    request = f"GET /{server.token}/ HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode()
    with contextlib.ExitStack() as held:
        where = ("127.0.0.1", server.port)
        crowd = [held.enter_context(sockets.create_connection(where, TIMEOUT)) for _ in range(PLACES - 10)]
        for connection in crowd:
            connection.sendall(request)
        assert {connection.recv(12) for connection in crowd} == {b"HTTP/1.1 303"}


def test_the_pages_own_browser_comes_with_a_ticket(server, said):
    assert server.open()
    assert said.read_text().startswith("file://")
    assert server.token not in said.read_text()
    (ticket,) = server._gate._tickets
    status, headers, _ = get(server, f"/{ticket}/")
    assert status == 303
    assert get(server, headers["location"], Cookie=headers["set-cookie"].split(";")[0])[0] == 200
    assert get(server, f"/{ticket}/")[0] == 403


HALVES = [
    {"op": "comment", "at": [], "text": "\ud800", "box": [0, 0, 1, 1]},
    {"op": "set", "at": [], "field": "title", "value": "\ud800"},
    {"op": "move", "at": [], "positions": {"sine": [float("inf"), 0]}},
    {"op": "paste", "at": [], "fragment": {"layout": {"positions": {"a": [1e308, 0], "b": [-1e308, 0]}}}},
]


@pytest.mark.parametrize("operation", HALVES, ids=range(len(HALVES)))
def test_what_could_not_be_sent_on_is_refused(server, operation):
    """Half a character, or a number without end, in the document would silence the page of everybody."""
    if operation["op"] == "paste":
        blocks = {name: {"type": "gain"} for name in "ab"}
        whole = {"format": "motorgrad diagram", "version": 1, "blocks": blocks, **operation["fragment"]}
        operation = operation | {"fragment": whole}
    revision = server.session._document.revision
    text = json.dumps({"client": f"half {time.monotonic()}", "sequence": 1, **operation}).replace("Infinity", "1e999")
    with join(server) as connection:
        connection.send(text)
        while (event := json.loads(connection.recv(TIMEOUT)))["event"] != "refused":
            pass
        assert "must be" in event["message"]
    assert server.session._document.revision == revision


@pytest.mark.parametrize("sender", ['"client": NaN', '"client": "a", "sequence": 1e999', '"client": "\\ud800"'])
def test_a_sender_of_no_name_is_answered(server, sender):
    with join(server) as connection:
        connection.send(f'{{{sender}, "op": "files"}}')
        assert json.loads(connection.recv(TIMEOUT))["event"] == "refused"
        assert ask(connection, client="sender", sequence=1, op="hello")["event"] in ("done", "refused")


def test_names_that_are_no_text_silence_no_page(server):
    folder = server.session._folder.folder
    odd = folder / os.fsdecode(b"\xff.json")
    try:
        odd.write_text(dumps(wave()))
    except OSError:
        pytest.skip("this file system has no such names")
    journal = folder / "states" / os.fsdecode(b"\xff.journal")
    journal.parent.mkdir(exist_ok=True)
    head = {"format": "motorgrad journal", "version": 1, "file": None, "diagram": dumps(wave())}
    change = {"do": {"op": "set", "at": [], "name": None, "field": "title", "value": "\ud800", "fields": {}}}
    journal.write_text(f"{json.dumps(head)}\n{json.dumps(change)}\n")
    with join(server) as connection:
        seen = []
        for sequence, op in enumerate(("hello", "files")):
            connection.send(json.dumps({"client": "odd", "sequence": sequence, "op": op}))
            while not seen or seen[-1]["event"] not in ("done", "refused"):
                seen.append(json.loads(connection.recv(TIMEOUT)))
            assert seen.pop()["event"] == "done"
    told = {event["event"]: event for event in seen}
    assert odd.name in told["files"]["files"]
    assert [each["id"] for each in told["recoverable"]["list"]] == [journal.name]
    journal.unlink()
    odd.unlink()
