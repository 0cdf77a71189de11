"""Access control of the pages of TimSim and TimLab: which requests are served, and at what rate.

A page prints the address `http://127.0.0.1:PORT/TOKEN/`. The first request moves the token into a cookie and leads to
`/PLACE/`, so that neither the address bar nor the history keeps it. Browsers send cookies to every port of a host;
this one is limited to its place, which other servers on the machine do not know. A browser that the program opens comes
with a ticket instead, a token that serves once.
"""

import asyncio
import ipaddress
import re
import secrets
import socket
import time
from collections.abc import Callable, Iterable
from hmac import compare_digest
from typing import Any, NamedTuple

LOCAL = frozenset({"127.0.0.1", "localhost", "::1"})
COOKIE = "motorgrad"
UNIT = 2**16  # bytes that cost as much as one more message
VALID = 120.0  # s in which a browser must come with its ticket
STRANGERS = 512  # connections at a time that have shown no token, as all have when many browsers come at once
SHARE_OF_FILES = 4  # a process that may open few files has places for a part of them
PATIENCE = 30.0  # s that such a connection may last
BACKLOG = 64  # connections accepted at a time; fewer than have a place, or one would be closed before it is read
HEADERS = {
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
"""Headers of every answer. Without a referrer, no other server is told the address."""


Ends = tuple[tuple[str, int], tuple[str, int]]
"""The two ends of a connection: address and port of the client, and those of the page."""


class Passed(NamedTuple):
    """A request that is served: the `path` it asks for, without the token or the place; whether it is for a frame, such
    as a notebook's, of someone who knows the token; and whether it came by the token for watching, and so may change
    nothing."""

    path: str
    framed: bool
    watches: bool = False


class Door(NamedTuple):
    """A secret `token`, and the `place`, the path of the page once the token is in the cookie."""

    token: str
    place: str


def _door() -> Door:
    return Door(secrets.token_urlsafe(24), secrets.token_hex(8))


class _Ticket(NamedTuple):
    """A token that opens the page once: until when, and what to call when it has served or ended."""

    until: float
    ended: Callable[[], None]


class Answer(NamedTuple):
    """The gate's own answer to a request that it does not let in, or leads on."""

    status: int
    headers: dict[str, str]
    text: str


class Gate:
    """Decides about requests by token, `Host` and `Origin`.

    **Arguments:** the `host` where the page listens; the `source` that prints the whole address, as told to those who
    come without it; whether there is a second token, for those who may watch and change nothing.

    **Attributes:** `token`, the secret; `place`, the path of the page once the token is in the cookie; `watching`, the
    door of those who may only watch, or None.
    """

    def __init__(self, host: str, source: str, watched: bool = False):
        door = _door()
        self.token, self.place = door
        self._source = source
        self.watching = _door() if watched else None
        self._doors = [door] if self.watching is None else [door, self.watching]
        self._tickets: dict[str, _Ticket] = {}
        self._names = {*LOCAL, host.lower()}
        self._exposed = host not in LOCAL
        if self._exposed:
            name = socket.gethostname().lower()
            self._names |= {name, f"{name}.local"}

    def judge(self, target: str, headers: Iterable[tuple[str, str]], upgrade: bool) -> Passed | Answer:
        """Decide about a request by the `target`, the path and query that it asks for, its `headers`, and whether it
        asks for a WebSocket (`upgrade`)."""
        known = _single(headers)
        if known is None or not self._comes_from_here(known, upgrade):
            return self._refusal()
        path, _, query = target.partition("?")
        first, _, rest = path.removeprefix("/").partition("/")
        found = [(door, by) for door in self._doors for by in _ways(door, first, known.get("cookie", ""))]
        if not found:
            return _lead(self._doors[0]) if not upgrade and self._take(first) else self._refusal()
        door, by_token = found[0]
        # a frame keeps the token: a notebook at another address could not send the cookie, and shows no address
        framed = by_token and known.get("sec-fetch-dest") in ("iframe", "frame")
        if upgrade or not (query or (by_token and not framed)):
            return Passed(f"/{rest}", framed, door is self.watching)
        # no query reaches a page: viser's client would connect to any server that one names
        if by_token and not framed:
            return _lead(door)
        return Answer(303, {**HEADERS, "Location": f"/{door.token if framed else door.place}/"}, "")

    def ticket(self, ended: Callable[[], None]) -> str:
        """A token that leads one browser to the page, once and soon. `ended` is called when it no longer does."""
        token = secrets.token_urlsafe(24)
        self._tickets[token] = _Ticket(time.monotonic() + VALID, ended)
        return token

    def end_tickets(self) -> None:
        """End all tickets that nobody has used."""
        for token in list(self._tickets):
            self._end(token)

    def _take(self, token: str) -> bool:
        """Use a ticket. **Returns** whether it was a valid one."""
        given = token.encode("utf-8", "replace")
        found = [known for known in list(self._tickets) if compare_digest(given, known.encode())]
        ticket = self._end(found[0]) if found else None
        return ticket is not None and time.monotonic() < ticket.until

    def _end(self, token: str) -> _Ticket | None:
        ticket = self._tickets.pop(token, None)
        if ticket is not None:
            ticket.ended()
        return ticket

    def _refusal(self) -> Answer:
        text = f"Forbidden: open the whole address that {self._source} printed.\n"
        return Answer(403, {**HEADERS, "Content-Type": "text/plain; charset=utf-8"}, text)

    def _comes_from_here(self, headers: dict[str, str], upgrade: bool) -> bool:
        """Whether the host is ours, so that no foreign name leads here, and the origin is this very host. Browsers
        always send an origin with a WebSocket."""
        host = headers.get("host", "").lower()
        origin = headers.get("origin")
        if origin is None:
            return not upgrade and self._is_own(host)
        return origin.lower() == f"http://{host}" and self._is_own(host)

    def _is_own(self, host: str) -> bool:
        # any port: a tunnel may lead from another one
        found = re.fullmatch(r"(?:\[([0-9a-f:.]+)\]|([a-z0-9_.-]+))(?::\d+)?", host)
        name = (found[1] or found[2]) if found else ""
        return name in self._names or (self._exposed and _is_address(name))


class Pace:
    """Slow down a client that sends too fast: its next message is read later, and nothing is dropped. A message, and
    every 64 KiB of it, counts as one of `rate` per second; a `burst` of messages is taken at once."""

    def __init__(self, rate: float = 250.0, burst: float = 500.0):
        self._cost = 1 / rate
        self._ahead = burst / rate
        self._paid = 0.0

    async def wait(self, size: int = 0) -> None:
        """Wait until a further message, after one of `size` bytes, may be read."""
        now = time.monotonic()
        self._paid = max(self._paid, now - self._ahead) + self._cost * (1 + size / UNIT)
        if self._paid > now:
            await asyncio.sleep(self._paid - now)


class Lobby:
    """The connections that have shown no token: limited in number and time, so that they exhaust nothing. Where there
    are too `many`, the one that has waited longest is closed: whoever has the token shows it at once. Each may last for
    the seconds of `patience`."""

    def __init__(self, many: int | None = None, patience: float = PATIENCE):
        self._many = strangers() if many is None else many
        self._patience = patience
        self._waiting: dict[Ends, tuple[asyncio.Transport, asyncio.TimerHandle]] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def connections_of(self, kind: type[Any]) -> type[Any]:
        """A server's `kind` of connections (`asyncio.Protocol`), which are in the lobby at first."""
        lobby = self

        class Connection(kind):
            def connection_made(self, transport: asyncio.Transport) -> None:
                lobby.enter(transport)
                super().connection_made(transport)

            def connection_lost(self, exc: Exception | None) -> None:
                lobby.left(self.transport)
                super().connection_lost(exc)

        return Connection

    def enter(self, transport: asyncio.Transport) -> None:
        """Take in a new connection, within its event loop."""
        ends = _ends(transport)
        if ends is None:  # it has gone already
            transport.abort()
            return
        if ends in self._waiting:  # an earlier connection between them has ended
            self._close(ends)
        if len(self._waiting) >= self._many:
            ended = (known for known, (other, _) in self._waiting.items() if other.is_closing())
            self._close(next(ended, next(iter(self._waiting))))
        expiry = asyncio.get_running_loop().call_later(self._patience, self._close, ends)
        self._waiting[ends] = transport, expiry

    def leave(self, ends: Ends | None) -> None:
        """Let a connection stay that has shown a token. `ends` are the addresses of the client and of the page."""
        if ends in self._waiting:
            self._waiting.pop(ends)[1].cancel()

    def left(self, transport: asyncio.Transport) -> None:
        """Let the connection of a transport stay, or forget it once it has ended, but no later one between its ends."""
        ends = _ends(transport)
        if ends in self._waiting and self._waiting[ends][0] is transport:
            self.leave(ends)

    def _close(self, ends: Ends) -> None:
        transport = self._waiting[ends][0]
        self.leave(ends)
        transport.abort()


def strangers() -> int:
    """How many connections that have shown no token a page of this process takes at a time."""
    try:
        import resource
    except ImportError:  # Windows, where connections are no files
        return STRANGERS
    files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return STRANGERS if files == resource.RLIM_INFINITY else min(STRANGERS, max(2 * BACKLOG, files // SHARE_OF_FILES))


def _ends(transport: asyncio.BaseTransport) -> Ends | None:
    """The two ends of a connection: a page that listens everywhere has many addresses, to all of which a client may
    connect from one port."""
    peer, own = (transport.get_extra_info(name) for name in ("peername", "sockname"))
    return None if peer is None or own is None else ((str(peer[0]), int(peer[1])), (str(own[0]), int(own[1])))


def _lead(door: Door) -> Answer:
    """Move the token into a cookie, and lead on to the page."""
    cookie = f"{COOKIE}={door.token}; Path=/{door.place}; HttpOnly; SameSite=Lax"
    return Answer(303, {**HEADERS, "Location": f"/{door.place}/", "Set-Cookie": cookie}, "")


def _ways(door: Door, first: str, cookies: str) -> list[bool]:
    """How a door is opened by the first part of a path and the header of cookies: by its token in the address (true),
    or by its place and the cookie (false); empty if not."""
    if compare_digest(first.encode("utf-8", "replace"), door.token.encode()):
        return [True]
    pairs = (part.strip().partition("=") for part in cookies.split(";"))
    given = [value.encode("utf-8", "replace") for name, _, value in pairs if name == COOKIE]
    known = any(compare_digest(value, door.token.encode()) for value in given)
    return [False] if first == door.place and known else []


def _single(headers: Iterable[tuple[str, str]]) -> dict[str, str] | None:
    """Headers by name in lower case, or None where one that the gate reads is given twice."""
    found: dict[str, str] = {}
    for name, value in headers:
        key = name.lower()
        if key == "cookie" and key in found:  # HTTP/2 proxies may split it
            value = f"{found[key]}; {value}"
        elif key in ("host", "origin", "upgrade") and key in found:
            return None
        found[key] = value
    return found


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
