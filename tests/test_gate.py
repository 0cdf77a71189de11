"""The gate of both pages: every way past it that a stranger could try, without a server."""

import asyncio
import contextlib
import itertools
import re
import socket
import stat
import sys
import webbrowser
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit
from urllib.request import url2pathname

import pytest

from motorgrad.pages import (
    BACKLOG,
    COOKIE,
    STRANGERS,
    Answer,
    Gate,
    Lobby,
    Pace,
    Passed,
    _gate,
    open_in_browser,
    strangers,
)

HOST = "127.0.0.1:8080"


@pytest.fixture(scope="module")
def gate():
    return Gate("127.0.0.1", "`it`")


def judge(gate, target, upgrade=False, **headers):
    """The gate's verdict; a header given as None is left out, underscores in names are hyphens."""
    usual = {"Host": HOST, "Origin": f"http://{HOST}" if upgrade else None}
    given = {name.replace("_", "-"): value for name, value in {**usual, **headers}.items()}
    return gate.judge(target, [(name, value) for name, value in given.items() if value is not None], upgrade)


def cookie(gate):
    return f"{COOKIE}={gate.token}"


def test_the_token_moves_from_the_address_to_a_cookie(gate):
    answer = judge(gate, f"/{gate.token}/")
    assert isinstance(answer, Answer)
    assert (answer.status, answer.headers["Location"]) == (303, f"/{gate.place}/")
    assert answer.headers["Set-Cookie"] == f"{cookie(gate)}; Path=/{gate.place}; HttpOnly; SameSite=Lax"
    assert gate.token not in answer.headers["Location"] + answer.text
    assert judge(gate, f"/{gate.place}/x.js", Cookie=cookie(gate)) == Passed("/x.js", False)
    assert judge(gate, f"/{gate.place}", True, Cookie=f"a=b; {cookie(gate)};c") == Passed("/", False)


def test_a_frame_keeps_the_token_since_no_cookie_reaches_it(gate):
    framed = {"Sec_Fetch_Dest": "iframe"}
    assert judge(gate, f"/{gate.token}/", **framed) == Passed("/", True)
    assert judge(gate, f"/{gate.token}", True) == Passed("/", False)
    again = judge(gate, f"/{gate.token}/?websocket=ws://evil.example", **framed)
    assert (again.status, again.headers["Location"], "Set-Cookie" in again.headers) == (303, f"/{gate.token}/", False)
    # by the cookie it is a page of its own, which nothing may frame
    assert judge(gate, f"/{gate.place}/", Cookie=cookie(gate), **framed) == Passed("/", False)


def test_no_query_reaches_a_page(gate):
    for query in ("?websocket=ws://evil.example", "?playbackPath=http://evil.example/x", "?", "?a?b"):
        answer = judge(gate, f"/{gate.place}/{query}", Cookie=cookie(gate))
        if query != "?":
            assert (answer.status, answer.headers["Location"]) == (303, f"/{gate.place}/")


def test_nobody_else_gets_in(gate):
    """Every wrong token with every wrong cookie, for pages and sockets."""
    other = Gate("127.0.0.1", "`it`")
    firsts = ["", gate.place, other.token, other.place, gate.token[:-1], gate.token + "x", gate.token.swapcase(), "é"]
    firsts += [f"/{gate.token}", f"x/{gate.token}", f"?{gate.token}", f"{gate.token}%00", f".{gate.token}", "*"]
    cookies = [None, "", COOKIE, f"{COOKIE}=", f"{COOKIE}={other.token}", f"{COOKIE}={gate.token}x", f"x={gate.token}"]
    cookies += [f"x{cookie(gate)}", f'{COOKIE}="{gate.token}"', f"{COOKIE}=é"]
    for first, wrong, upgrade in itertools.product(firsts, cookies, (False, True)):
        assert judge(gate, f"/{first}", upgrade, Cookie=wrong).status == 403, (first, wrong)
    for first in firsts:  # the cookie opens its own place, and that alone
        if first != gate.place:
            assert judge(gate, f"/{first}", Cookie=cookie(gate)).status == 403


FOREIGN = ["evil.example", "127.0.0.1.evil.example:8080", "localhost.evil.example", "evil.example#localhost", "", "::1"]
FOREIGN += ["localhost@evil.example", "evil.example@localhost", "[::2]:8080", "192.168.0.1:8080", "local host", "0"]


@pytest.mark.parametrize("upgrade", [False, True])
@pytest.mark.parametrize("host", FOREIGN)
def test_foreign_names_do_not_lead_here(gate, host, upgrade):
    for origin in (f"http://{host}", f"http://{HOST}", None):
        assert judge(gate, f"/{gate.token}/", upgrade, Host=host, Origin=origin).status == 403


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8080", "[::1]:8080", "127.0.0.1:9999"])
def test_own_names_do_also_through_a_tunnel_from_another_port(gate, host):
    assert judge(gate, f"/{gate.token}/", True, Host=host, Origin=f"http://{host}") == Passed("/", False)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "", "http://127.0.0.1:8081", "https://127.0.0.1:8080", "file://", HOST]
)
def test_pages_of_other_origins_are_refused(gate, origin):
    for upgrade in (False, True):
        assert judge(gate, f"/{gate.token}/", upgrade, Origin=origin).status == 403
        assert judge(gate, f"/{gate.place}/", upgrade, Origin=origin, Cookie=cookie(gate)).status == 403
    assert judge(gate, f"/{gate.token}", True, Origin=None).status == 403  # no browser leaves it out


def test_a_header_given_twice_is_refused(gate):
    for name, value in (("Host", HOST), ("host", "evil.example"), ("Origin", f"http://{HOST}")):
        headers = [("Host", HOST), ("Origin", f"http://{HOST}"), (name, value)]
        assert gate.judge(f"/{gate.token}/", headers, True).status == 403


def test_an_exposed_page_takes_addresses_and_own_names_only():
    gate = Gate("0.0.0.0", "`it`")
    for host in ("192.168.0.7:8080", "[fe80::1]", "localhost:8080"):
        assert judge(gate, f"/{gate.token}", True, Host=host, Origin=f"http://{host}") == Passed("/", False)
    assert judge(gate, f"/{gate.token}", True, Host="evil.example", Origin="http://evil.example").status == 403


def test_no_two_gates_have_the_same_secrets():
    gates = [Gate("localhost", "`it`") for _ in range(100)]
    assert len({gate.token for gate in gates} | {gate.place for gate in gates}) == 200
    assert min(len(gate.token) for gate in gates) >= 32


def test_who_sends_too_fast_waits(monkeypatch):
    clock = [100.0]

    async def sleep(seconds):
        clock[0] += seconds

    monkeypatch.setattr("motorgrad.pages._gate.time", SimpleNamespace(monotonic=lambda: clock[0]))
    monkeypatch.setattr("motorgrad.pages._gate.asyncio", SimpleNamespace(sleep=sleep))

    async def send(count, size=0):
        pace, start = Pace(rate=1000.0, burst=100.0), clock[0]
        for _ in range(count):
            await pace.wait(size)
        return clock[0] - start

    assert asyncio.run(send(90)) == 0
    assert asyncio.run(send(300)) == pytest.approx(0.2)
    assert asyncio.run(send(30, size=10 * 2**16)) == pytest.approx(0.23)  # long messages count for more


def test_who_may_watch_has_a_token_a_place_and_a_cookie_of_its_own():
    gate = Gate("127.0.0.1", "`it`", watched=True)
    token, place = gate.watching
    assert len({token, place, gate.token, gate.place}) == 4
    answer = judge(gate, f"/{token}/")
    assert (answer.status, answer.headers["Location"]) == (303, f"/{place}/")
    assert answer.headers["Set-Cookie"] == f"{COOKIE}={token}; Path=/{place}; HttpOnly; SameSite=Lax"
    assert gate.token not in str(answer)
    assert judge(gate, f"/{place}/", Cookie=f"{COOKIE}={token}") == Passed("/", False, True)
    for upgrade in (False, True):
        assert not judge(gate, f"/{gate.place}/", upgrade, Cookie=cookie(gate)).watches
        # neither cookie opens the other's place
        for cookies, where in ((f"{COOKIE}={token}", gate.place), (cookie(gate), place)):
            assert judge(gate, f"/{where}/", upgrade, Cookie=cookies).status == 403
    assert judge(gate, f"/{place}/", Cookie=f"{COOKIE}={token}; {cookie(gate)}").watches  # with both, it still watches
    assert judge(gate, f"/{token}", True).watches
    assert Gate("127.0.0.1", "`it`").watching is None


def test_a_ticket_leads_one_browser_to_the_page_once(gate):
    ended = []
    token = gate.ticket(lambda: ended.append(1))
    # neither a foreign page nor a socket uses it up
    assert judge(gate, f"/{token}/", Host="evil.example").status == 403
    assert judge(gate, f"/{token}/", True).status == 403
    assert judge(gate, f"/{token}x/").status == 403
    assert not ended
    answer = judge(gate, f"/{token}/")
    assert (answer.status, answer.headers["Location"]) == (303, f"/{gate.place}/")
    assert answer.headers["Set-Cookie"].startswith(f"{cookie(gate)};")
    assert ended == [1]
    assert judge(gate, f"/{token}/").status == 403
    assert judge(gate, f"/{token}/", Cookie=cookie(gate)).status == 403
    assert judge(gate, f"/{gate.token}/").status == 303


def test_a_ticket_soon_ends(gate, monkeypatch):
    ended = []
    monkeypatch.setattr(_gate, "VALID", -1.0)
    late = gate.ticket(lambda: ended.append("late"))
    assert judge(gate, f"/{late}/").status == 403
    monkeypatch.undo()
    unused = gate.ticket(lambda: ended.append("unused"))
    gate.end_tickets()
    assert judge(gate, f"/{unused}/").status == 403
    assert ended == ["late", "unused"]


def test_no_argument_of_the_browser_has_a_token(gate, said):
    """As another user sees it with ps, on a machine whose users share the folder of temporary files."""
    assert open_in_browser(gate, "http://127.0.0.1:8080")
    address = said.read_text().strip()
    (ticket,) = gate._tickets
    assert gate.token not in address
    assert ticket not in address
    file = Path(url2pathname(urlsplit(address).path))
    assert [stat.S_IMODE(path.stat().st_mode) for path in (file, file.parent)] == [0o600, 0o700]
    text = file.read_text()
    assert gate.token not in text
    (led,) = re.findall('url=([^"]*)', text)
    assert led == f"http://127.0.0.1:8080/{ticket}/"
    assert judge(gate, f"/{ticket}/").status == 303
    assert not file.parent.exists()


def test_a_browser_that_does_not_open_leaves_no_file(gate, tmp_path, monkeypatch):
    monkeypatch.setenv("BROWSER", f"{tmp_path / 'none'} %s")
    monkeypatch.setattr(webbrowser, "_tryorder", [])
    monkeypatch.setattr(webbrowser, "_browsers", {})
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert not open_in_browser(gate, "http://127.0.0.1:8080")
    assert list(tmp_path.iterdir()) == []
    assert not gate._tickets


async def _visited(lobby, visit):
    """What `visit` returns, given the port of a server whose connections enter a lobby and that echoes."""

    class Echo(asyncio.Protocol):
        def connection_made(self, transport):
            self.transport = transport
            lobby.enter(transport)

        def data_received(self, data):
            lobby.left(self.transport)
            self.transport.write(data)

        def connection_lost(self, exc):
            lobby.left(self.transport)

    server = await asyncio.get_running_loop().create_server(Echo, "127.0.0.1", 0, backlog=BACKLOG)
    async with server:
        return await visit(server.sockets[0].getsockname()[1])


def test_who_shows_nothing_is_closed_and_who_shows_the_token_stays():
    async def visit(port):
        known = await asyncio.open_connection("127.0.0.1", port)
        known[1].write(b"x")
        assert await known[0].readexactly(1) == b"x"
        strangers = [await asyncio.open_connection("127.0.0.1", port) for _ in range(5)]
        # more than three at a time are too many, the oldest goes first; then each ends
        ends = [await reader.read() for reader, _ in strangers]
        known[1].write(b"y")
        assert await known[0].readexactly(1) == b"y"
        for _, writer in (known, *strangers):
            writer.close()
        return ends

    lobby = Lobby(many=3, patience=0.05)
    assert asyncio.run(_visited(lobby, visit)) == [b""] * 5
    assert len(lobby) == 0


def test_a_crowd_of_strangers_is_limited_and_who_knows_gets_in():
    async def visit(port):
        crowd = [await asyncio.open_connection("127.0.0.1", port) for _ in range(3 * places)]
        known = await asyncio.open_connection("127.0.0.1", port)
        known[1].write(b"x")
        assert await known[0].readexactly(1) == b"x"
        most = len(lobby)
        for _, writer in (known, *crowd):
            writer.close()
        return most

    places = 2 * BACKLOG
    lobby = Lobby(places)
    assert asyncio.run(_visited(lobby, visit)) <= places


@pytest.mark.skipif(sys.platform == "win32", reason="connections are no files there")
@pytest.mark.parametrize(("files", "places"), [(256, 128), (1024, 256), (4096, STRANGERS)])
def test_strangers_leave_most_files_of_a_process_to_others(files, places):
    import resource

    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (files, before[1]))
    try:
        assert strangers() == places
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has all of 127.0.0.0/8")
def test_one_port_of_a_stranger_is_a_connection_to_each_address_of_the_page():
    """A page that listens everywhere has many addresses; the client's alone does not tell connections apart."""

    async def visit(port):
        with contextlib.ExitStack() as held:
            source = ("127.0.0.1", 0)
            for last in range(1, 9):
                stranger = held.enter_context(socket.socket())
                stranger.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                stranger.bind(source)
                stranger.setblocking(False)
                await asyncio.get_running_loop().sock_connect(stranger, (f"127.0.0.{last}", port))
                source = stranger.getsockname()
            while len(transports) < 8:
                await asyncio.sleep(0)
            return len(lobby), sum(made.is_closing() for made in transports)

    class Quiet(asyncio.Protocol):
        def connection_made(self, transport):
            lobby.enter(transport)
            transports.append(transport)

    async def all_of():
        loop = asyncio.get_running_loop()
        server = await loop.create_server(Quiet, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        others = await loop.create_server(Quiet, [f"127.0.0.{last}" for last in range(2, 9)], port)
        async with server, others:
            return await visit(port)

    lobby, transports = Lobby(many=5), []
    assert asyncio.run(all_of()) == (5, 3)
