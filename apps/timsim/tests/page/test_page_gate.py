"""Strangers before TimSim's page: nobody gets in, nothing leaves, and what is out of bounds makes one line of log."""

import contextlib
import http.client
import logging
import random
import socket as addresses
import threading
import time

import msgspec
import pytest
from page_clients import CAMERA, PLACES, TIMEOUT, VERSION, alive, client, fields, get, hear_out, send, socket, update
from viser import _messages as viser_messages
from websockets.exceptions import ConnectionClosed, InvalidStatus

from motorgrad.pages import BACKLOG, COOKIE
from patience import until
from timsim.page import ExposedWarning, check_port, warn_of
from timsim.page._server import MAX_CLIENTS, MAX_PICTURE_BYTES, MESSAGE_TYPES, TOLERATED, read_message


def origin(page):
    return f"http://127.0.0.1:{page.server.get_port()}"


def test_the_printed_address_leads_to_a_page_without_the_token(page):
    token = page._gate.token
    status, headers, _ = get(page, f"/{token}/")
    assert (status, headers["location"]) == (303, f"/{page._gate.place}/")
    cookie = headers["set-cookie"].split(";")[0]
    status, headers, text = get(page, f"/{page._gate.place}/", Cookie=cookie)
    assert status == 200
    assert "<title>Viser</title>" in text
    assert token not in text + str(headers)
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert f"connect-src 'self' ws://127.0.0.1:{page.server.get_port()} " in headers["content-security-policy"]
    assert headers["referrer-policy"] == "no-referrer"
    with socket(page, f"{origin(page)}/{page._gate.place}", additional_headers={"Cookie": cookie}) as connection:
        assert connection.recv(TIMEOUT)
    assert token in page.url
    assert token not in repr(page)


def test_a_notebook_shows_the_page_in_a_frame(page):
    assert f'<iframe src="{page.url}"' in page._repr_html_()
    status, headers, text = get(page, f"/{page._gate.token}/", Sec_Fetch_Dest="iframe")
    assert status == 200
    assert "<title>Viser</title>" in text
    assert "frame-ancestors" not in headers["content-security-policy"]
    assert "cross-origin-resource-policy" not in headers


def test_without_the_token_nothing_is_served(page):
    place, token = page._gate.place, page._gate.token
    for path in (
        "/",
        "/index.html",
        f"/{place}/",
        f"/{place}",
        f"/?{token}",
        f"//{token}/",
        f"/{token}x/",
        "/%00",
        "*",
    ):
        status, headers, text = get(page, path)
        assert (status, "set-cookie" in headers, "Viser" in text) == (403, False, False), path
        with pytest.raises(InvalidStatus, match="403"):
            socket(page, f"{origin(page)}/{path[1:]}")
    for path in ("../index.html", "%2e%2e/x", "..%2f..%2fsetup.py", "/etc/passwd", "%00", "x" * 4000):
        assert get(page, f"/{place}/{path}", Cookie=f"{COOKIE}={token}")[0] in (403, 404)


def test_pages_of_other_origins_are_refused_although_their_browser_has_the_cookie(page):
    cookie = {"Cookie": f"{COOKIE}={page._gate.token}"}
    address = f"{origin(page)}/{page._gate.place}"
    for other in ("http://evil.example", "null", "http://127.0.0.1:1", origin(page).replace("http", "https"), None):
        with pytest.raises(InvalidStatus, match="403"):
            socket(page, address, origin=other, additional_headers=cookie)
        with pytest.raises(InvalidStatus, match="403"):
            socket(page, origin=other)
    for host in ("evil.example", f"evil.example:{page.server.get_port()}"):
        assert get(page, f"/{page._gate.token}/", Host=host)[0] == 403
        assert get(page, f"/{page._gate.place}/", Host=host, **cookie)[0] == 403


def test_other_methods_and_broken_requests_are_refused_in_silence(page, quiet):
    for method in ("POST", "OPTIONS", "PUT", "HEAD", "BREW"):
        connection = http.client.HTTPConnection("127.0.0.1", page.server.get_port(), timeout=TIMEOUT)
        connection.request(method, page.url, body="x")
        with contextlib.suppress(http.client.HTTPException):  # hung up on
            assert connection.getresponse().status >= 400
        connection.close()
    for junk in (b"\x00" * 100, b"GET\r\n\r\n", b"GET / HTTP/1.1\r\nHost\r\n\r\n", b"\x16\x03\x01" + b"x" * 500):
        connection = http.client.HTTPConnection("127.0.0.1", page.server.get_port(), timeout=TIMEOUT)
        connection.connect()
        connection.sock.sendall(junk)
        connection.close()
    assert alive(page)
    assert quiet() == []


def test_no_log_has_the_token(page, caplog, capfd):
    """Not even with every logger at its most talkative."""
    caplog.set_level(logging.DEBUG)
    loggers = [logging.getLogger(name) for name in list(logging.root.manager.loggerDict)]
    before = {logger: logger.level for logger in loggers if logger.level and "websockets" in logger.name}
    try:
        for logger in before:
            logger.setLevel(logging.DEBUG)
        get(page, f"/{page._gate.token}/")
        get(page, f"/{page._gate.place}/", Cookie=f"{COOKIE}={page._gate.token}")
        assert alive(page)
        with socket(page) as connection:
            connection.send(b"\xc1 no message")
            connection.send(f"{page._gate.token}")
            connection.send(b"x" * (MAX_PICTURE_BYTES + 2**17))
            assert until(lambda: "larger" in caplog.text)
    finally:
        for logger, level in before.items():
            logger.setLevel(level)
    theirs = [r for r in caplog.records if r.name != "websockets.client"]  # the log of this test's own client
    assert theirs
    assert [record for record in theirs if page._gate.token in record.getMessage()] == []
    assert page._gate.token not in "".join(capfd.readouterr())


def test_no_tunnel_is_ever_opened(page, quiet):
    """viser would make the page public for whoever sends one of these."""
    with client(page) as connection:
        for kind in ("ShareUrlRequest", "ShareUrlDisconnect", "ShareUrlUpdated"):
            send(connection, type=kind)
            send(connection, type=kind, share_url="http://evil.example")
        send(connection, type="GuiUpdateMessage", uuid="x", updates={"value": {"type": "ShareUrlRequest"}})
        assert until(lambda: len(quiet()) == 6)
        assert all("ShareUrl" in line for line in quiet())
    assert alive(page)
    assert page.server._share_tunnel is None


def test_only_what_pages_send_is_taken(page, quiet):
    """Every other message that viser knows is refused, whoever sends it."""
    kinds = set(viser_messages.Message._subclass_from_type_string()) - set(MESSAGE_TYPES)
    assert len(kinds) > 90
    for kind in sorted(kinds):
        with pytest.raises(ValueError, match="not one that this page sends"):
            read_message(msgspec.msgpack.encode({"type": kind, "uuid": "x", "name": "/x"}))


FLAWS = {
    "text": "hello",
    "empty": b"",
    "no message": b"\xc1",
    "a number": msgspec.msgpack.encode(3),
    "no type": msgspec.msgpack.encode({"uuid": "x"}),
    "type is a list": msgspec.msgpack.encode({"type": ["GuiUpdateMessage"]}),
    "unknown type": msgspec.msgpack.encode({"type": "x" * 5000}),
    "field missing": msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "x"}),
    "field too many": msgspec.msgpack.encode({"type": "GuiFormDirtyMessage", "uuid": "x", "excluded_self_client": 1}),
    "uuid is a list": msgspec.msgpack.encode({"type": "CommandTriggerMessage", "uuid": []}),
    "NaN": msgspec.msgpack.encode({**CAMERA, "fov": float("nan")}),
    "infinite": msgspec.msgpack.encode({**CAMERA, "position": (0.0, float("inf"), 0.0)}),
    "too short": msgspec.msgpack.encode({**CAMERA, "position": (0.0, 1.0)}),
    "too deep": b"\x91" * 5000 + b"\xc0",
    "too large": msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": "x" * 100_000}}),
}


@pytest.mark.parametrize("flaw", FLAWS)
def test_a_malformed_message_makes_one_line(page, quiet, flaw):
    with client(page) as connection:
        connection.send(FLAWS[flaw])
        assert until(lambda: len(quiet()) == 1)
        update(connection, page.panels.panels["Run"]._speed, [0.0])  # the connection goes on
        assert until(lambda: page.panels.panels["Run"]._speed.value == (0.0,))
    assert len(quiet()) == 1
    assert "a browser's message was refused: " in quiet()[0]


WRONG = ["x" * 100_000, "x" * 1001, ["x"] * 1000, {"a": 1}, None, float("nan"), [[]], [1.0] * 50, b"x", 2**63]


def test_no_field_takes_what_it_cannot_have(page, quiet):
    """Among these is the text of 100,000 characters after which nobody could connect any more."""
    before, sent = {id(field): field.value for field in fields(page)}, 0
    for field in fields(page):
        with client(page) as connection:
            kind = type(field.value)
            values = [value for value in WRONG if not (kind is int or kind is float) or value != 2**63]
            for value in values[:10]:
                update(connection, field, value)
                sent += 1
            for name in ("update_cb", "sync_cb", "removed", "props", "gui_api", "visible", "__class__"):
                update(connection, field, True, name)
                sent += 1
            assert until(lambda wanted=sent: len(quiet()) == wanted), (field, sent, quiet()[-3:])
    assert {id(field): field.value for field in fields(page)} == before
    assert sent > 150
    assert alive(page)


def test_an_oversized_frame_ends_one_connection_and_no_other(page, quiet):
    with client(page) as bystander:
        with pytest.raises(ConnectionClosed) as closed, client(page) as connection:
            hear_out(connection, b"x" * (MAX_PICTURE_BYTES + 2**17))
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1009
        update(bystander, page.panels.panels["Run"]._speed, [0.125])
        assert until(lambda: page.panels.panels["Run"]._speed.value == (0.125,))
    assert until(lambda: len(quiet()) == 1)  # said once the connection has ended
    assert alive(page)


def test_who_goes_on_with_nonsense_is_hung_up_on(page, quiet):
    with client(page) as connection, pytest.raises(ConnectionClosed):
        hear_out(connection, *[b"\xc1"] * 500)
    assert len(quiet()) == TOLERATED
    assert alive(page)


@pytest.mark.ci
def test_a_flood_slows_itself_alone(page, quiet):
    """A thousand messages at once, and more until another browser is served. All of them are read in the end."""
    speed, served, sent = page.panels.panels["Run"]._speed, threading.Event(), [0]

    def read():
        return round(1e5 * speed.value[0])

    def flood():
        with client(page) as connection:
            while sent[0] < 1000 or not served.is_set():
                if sent[0] < 1000 or sent[0] - read() < 500:
                    sent[0] += 1
                    update(connection, speed, [sent[0] / 1e5])
                else:
                    time.sleep(0.001)
            assert until(lambda: read() == sent[0])

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        assert until(lambda: 100 < read() < sent[0] >= 1000)
        with client(page) as other:
            assert other.recv(TIMEOUT)
    finally:
        served.set()
        thread.join()
    assert read() == sent[0]
    assert quiet() == []


def mutated(rng):
    """A message that a browser might send, somewhat wrong."""
    usual = [
        CAMERA,
        {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": rng.choice([1, "a", [1.0], None, True])}},
        {"type": "GuiFormSubmitMessage", "uuid": "x"},
        {"type": "CommandTriggerMessage", "uuid": "x"},
        {"type": "GetRenderResponseMessage", "payload": b"xyz", "render_uuid": "x"},
    ]
    message = dict(rng.choice(usual))
    name = rng.choice(list(message))
    message[name] = rng.choice([None, -1, 2**63, 1e308, "", "x" * 2000, [], {}, [[[]]], b"", True, message[name]])
    raw = bytearray(msgspec.msgpack.encode(message))
    for _ in range(rng.choice([0, 0, 1, 3, 20])):
        raw[rng.randrange(len(raw))] = rng.randrange(256)
    return bytes(raw[: rng.choice([len(raw), len(raw), rng.randrange(len(raw))])])


def test_mutated_messages_are_read_or_refused(page):
    rng, read, refused = random.Random(18), 0, 0
    for _ in range(10_000):
        try:
            read_message(mutated(rng))
            read += 1
        except ValueError:
            refused += 1
    assert read > 300
    assert refused > 5000


def test_mutated_messages_leave_the_page_as_it_is(page, quiet):
    rng = random.Random(19)
    for _ in range(20):
        with client(page) as connection:
            try:
                for _ in range(30):
                    connection.send(mutated(rng))
            except ConnectionClosed:  # too much nonsense
                pass
    assert alive(page)
    assert 0 < len(quiet()) <= 20 * TOLERATED


def test_there_is_an_end_to_connections(page, quiet, monkeypatch):
    monkeypatch.setattr("timsim.page._server.MAX_CLIENTS", 3)
    assert MAX_CLIENTS >= 100
    assert until(lambda: not page.server._websock_server._live_connections)
    held = [socket(page) for _ in range(3)]
    assert until(lambda: len(page.server._websock_server._live_connections) == 3)
    with pytest.raises(ConnectionClosed) as closed, socket(page) as connection:
        hear_out(connection)
    assert closed.value.rcvd.code == 1013
    for connection in held:
        connection.close()
    assert until(lambda: not page.server._websock_server._live_connections)
    assert alive(page)
    assert quiet() == ["a browser was refused: 3 are connected"]


def test_another_version_is_told_so(page):
    with socket(page, subprotocols=["viser-v0.0.0"]) as connection, pytest.raises(ConnectionClosed):
        connection.recv(TIMEOUT)
    assert VERSION != "viser-v0.0.0"
    assert alive(page)


def test_another_host_is_warned_of():
    with pytest.warns(ExposedWarning, match=r"host = '0.0.0.0': other machines can reach the page"):
        warn_of("0.0.0.0")


def test_other_machines_cannot_reach_the_page(page):
    own = (each[4][0] for each in addresses.getaddrinfo(addresses.gethostname(), None, addresses.AF_INET))
    others = [address for address in own if not address.startswith("127.")]
    if not others:
        pytest.skip("this machine has no other address than its own")
    with addresses.socket() as probe:
        assert probe.connect_ex((others[0], page.server.get_port())) != 0


def test_the_address_names_no_host_that_another_user_could_answer_for(page):
    """Browsers may take localhost for ::1, where another user may listen on the same port for the token."""
    with contextlib.ExitStack() as opened:
        if addresses.has_dualstack_ipv6():
            other = opened.enter_context(addresses.socket(addresses.AF_INET6))
            with contextlib.suppress(OSError):  # a machine without ::1
                other.bind(("::1", page.server.get_port()))
        for url in (page.url, page.read_only_url, page.plots_url, page.link(decision=1), page._repr_html_()):
            assert "localhost" not in url
            assert f"http://127.0.0.1:{page.server.get_port()}/" in url
    assert alive(page)


@pytest.mark.parametrize("host", ["", " ", 5, "x" * 300, "two words", "192.0.2.1"])
def test_a_host_that_is_not_of_this_machine_is_refused(host):
    """viser would wait for ever; and an empty name would stand for all that are not readable."""
    with pytest.raises(ValueError, match=r"^host = .*: (must be|cannot listen there)"):
        check_port(host, None)


def test_connections_without_a_token_exhaust_nothing(page):
    with contextlib.ExitStack() as held:
        where = ("127.0.0.1", page.server.get_port())
        crowd = [held.enter_context(addresses.create_connection(where, TIMEOUT)) for _ in range(PLACES + BACKLOG)]
        for number, connection in enumerate(crowd):
            with contextlib.suppress(OSError):  # it is closed already
                connection.sendall([b"", b"GET / HTTP/1.1\r\nX: "][number % 2])
        assert get(page, f"/{page._gate.token}/")[0] == 303
        assert alive(page)
        with contextlib.suppress(ConnectionResetError):
            assert crowd[0].recv(1) == b""


def test_many_who_come_at_once_and_show_the_token_late_get_in(page):
    """As browsers on a busy machine: all have connected before the first of them sends its request."""
    where = ("127.0.0.1", page.server.get_port())
    request = f"GET /{page._gate.token}/ HTTP/1.1\r\nHost: {where[0]}:{where[1]}\r\n\r\n".encode()
    with contextlib.ExitStack() as held:
        crowd = [held.enter_context(addresses.create_connection(where, TIMEOUT)) for _ in range(PLACES - 10)]
        for connection in crowd:
            connection.sendall(request)
        assert {connection.recv(12) for connection in crowd} == {b"HTTP/1.1 303"}
