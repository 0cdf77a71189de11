"""viser's server behind the gate of `motorgrad.pages`: who can reach it, and which messages pass."""

import asyncio
import contextlib
import dataclasses
import gzip
import http
import io
import logging
import math
import threading
from collections.abc import Awaitable, Callable
from typing import Any

import msgspec
import viser
import websockets.asyncio.server
from viser import _messages as viser_messages
from viser.infra import _infra
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosedError
from websockets.http11 import Request, Response
from websockets.typing import Data

from motorgrad._errors import check, choice, shown
from motorgrad.pages import BACKLOG, HEADERS, Answer, Gate, Lobby, Pace, Passed
from timsim.page._additions import with_additions
from timsim.page._plots import PlotPages
from timsim.page._watching import RATE, SHARE, may_watch

MESSAGE_TYPES: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        viser_messages.CommandTriggerMessage,
        viser_messages.GetRenderResponseMessage,
        viser_messages.GuiFormDirtyMessage,
        viser_messages.GuiFormSubmitMessage,
        viser_messages.GuiUpdateMessage,
        viser_messages.SceneNodeClickMessage,
        viser_messages.SceneNodeDragMessage,
        viser_messages.ViewerCameraMessage,
    )
}
"""What the pages send. Everything else is refused, above all the requests to share a page with the world."""
PICTURE = viser_messages.GetRenderResponseMessage
MAX_PICTURE_BYTES = 2**24
MAX_MESSAGE_BYTES = 2**16  # of any message but a picture
MAX_TEXT_CHARACTERS = 1000  # of a field
MAX_NUMBER = 1e9  # in a message
MAX_PICTURE_SIDE = 2**15  # pixels
ROUNDING = 1e-6  # by which a browser's sliders may miss their ends, as a share of them
UNIT = (0.5, 2.0)  # lengths of a direction, of which browsers send 1 and rounding
TOLERATED = 20  # refused messages after which a client is hung up on
MAX_CLIENTS = 200  # at a time
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; worker-src blob:; "
    "style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src data:; media-src data: blob:; "
    "connect-src 'self' ws://{host} data: blob:; base-uri 'none'; form-action 'none'"
)
"""No script, picture or connection leads to another server, whatever a message or a name contains."""

log = logging.getLogger(__name__)
_silent = logging.getLogger(f"{__name__}.transport")
_silent.setLevel(logging.CRITICAL + 1)  # at a lower level it would log whole requests, with the token, and tracebacks
_opening = threading.Lock()


def gated_server(gate: Gate, host: str, port: int, label: str, plots: PlotPages) -> viser.ViserServer:
    """Start viser's server behind a gate, with the pages of plots. It takes the next free port if `port` is in use."""
    front = _Front(gate, label, plots)
    serve = websockets.asyncio.server.serve

    def gated(handler: Callable[..., Any], *arguments: Any, **settings: Any) -> Any:
        if getattr(handler, "__module__", "") != _infra.__name__:
            return serve(handler, *arguments, **settings)
        return serve(front.handler(handler), *arguments, **front.settings(settings))

    # viser offers no way to decide about requests, and starts listening in the constructor
    with _opening, contextlib.redirect_stdout(io.StringIO()):  # its banner; whoever made the page tells its address
        websockets.asyncio.server.serve = gated  # type: ignore[misc, assignment]
        try:
            server = viser.ViserServer(host, port, label=label, verbose=False)
        finally:
            websockets.asyncio.server.serve = serve  # type: ignore[misc]
    if not front.used:
        server.stop()
        raise RuntimeError(f"viser {viser.__version__} cannot be put behind a gate: install viser 1.1")
    front.server = server

    def log_briefly(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Log what failed in the event loop in one line."""
        del loop
        error = context.get("exception")
        log.warning("the page's server: %s", context["message"] if error is None else _line(error))

    server.get_event_loop().set_exception_handler(log_briefly)
    return server


def clear(server: viser.ViserServer) -> None:
    """Remove everything from the page, in every open and every new browser."""
    with server._client_lock:  # viser has no public way to take a callback back
        server._client_connect_cb.clear()
        server._client_disconnect_cb.clear()
    for api in (*server.get_clients().values(), server):
        api.gui.reset()
        api.scene.reset()


class _Front:
    """The checks in front of viser's server: the gate for handshakes and pages, and limits for messages."""

    def __init__(self, gate: Gate, label: str, plots: PlotPages):
        self._gate = gate
        self._label = label
        self._plots = plots
        self._clients = 0
        self.used = False
        self._pages: dict[tuple[bool, bool], bytes] = {}
        self._lobby = Lobby()
        self.server: viser.ViserServer | None = None

    def settings(self, given: dict[str, Any]) -> dict[str, Any]:
        """The settings of viser's server, with the gate before its pages."""
        self.used = True
        bounds = {
            "max_size": MAX_PICTURE_BYTES + MAX_MESSAGE_BYTES,
            "max_queue": 4,
            "logger": _silent,
            "backlog": BACKLOG,
        }
        bounds["create_connection"] = self._lobby.connections_of(websockets.asyncio.server.ServerConnection)
        return {**given, **bounds, "process_request": self._process(given["process_request"])}

    def handler(self, handle: Callable[[Any], Any]) -> Callable[[Any], Any]:
        """viser's handler of a connection, which sees only valid messages."""

        async def run(connection: ServerConnection) -> None:
            request = connection.request
            assert request is not None  # its handshake is over
            verdict = self._gate.judge(request.path, request.headers.raw_items(), True)
            watches = not isinstance(verdict, Passed) or verdict.watches
            if self._clients >= (SHARE * MAX_CLIENTS if watches else MAX_CLIENTS):
                log.warning("a browser was refused: %d are connected", self._clients)
                self._lobby.enter(connection.transport)  # so that those who do not leave exhaust nothing either
                await connection.close(1013, "too many browsers")
                return
            self._clients += 1
            try:
                await handle(_Client(connection, self._check, watches))
            except Exception as error:
                log.warning("the connection of a browser failed: %s", _line(error))
            finally:
                self._clients -= 1
                closed = connection.protocol.close_sent
                if closed is not None and closed.code == 1009:  # said here, as viser may be writing when it notices
                    log.warning("a browser's message was refused: larger than %d bytes", MAX_PICTURE_BYTES)

        return run

    def _process(self, serve_page: Callable[[Any, Request], Response | None]) -> Any:
        def process(connection: ServerConnection, request: Request) -> Response | Awaitable[Response] | None:
            upgrade = "Upgrade" in request.headers
            verdict = self._gate.judge(request.path, request.headers.raw_items(), upgrade)
            if isinstance(verdict, Passed) and (upgrade or not verdict.watches):
                self._lobby.left(connection.transport)
            if isinstance(verdict, Passed) and not upgrade and verdict.path in self._plots:
                host = request.headers["Host"]
                return asyncio.to_thread(self._plot, verdict, host)  # drawing takes some milliseconds
            if isinstance(verdict, Passed) and not upgrade and verdict.path != "/":  # the page is one file
                verdict = Answer(404, HEADERS, "There is no such page.\n")
            if isinstance(verdict, Answer):
                status = http.HTTPStatus(verdict.status)
                body = verdict.text.encode()
                headers = Headers({**verdict.headers, "Content-Length": str(len(body))})
                return Response(status, status.phrase, headers, body)
            if upgrade:
                return None
            page = serve_page(connection, Request("/", Headers()))
            if page is not None:
                self._complete(page, "gzip" in request.headers.get("Accept-Encoding", ""), verdict.watches)
                policy = POLICY.format(host=request.headers["Host"])
                page.headers.update({**HEADERS, "Content-Security-Policy": policy})
                if verdict.framed:
                    del page.headers["Cross-Origin-Resource-Policy"]
                else:
                    page.headers["Content-Security-Policy"] = f"{policy}; frame-ancestors 'none'"
            return page

        return process

    def _plot(self, verdict: Passed, host: str) -> Response:
        """The page of plots, or figures of it."""
        found = self._plots.answer(verdict.path)
        status = http.HTTPStatus(found.status)
        body = found.text.encode()
        policy = POLICY.format(host=host)
        headers = Headers({**HEADERS, "Content-Type": found.kind, "Content-Length": str(len(body))})
        headers["Content-Security-Policy"] = policy if verdict.framed else f"{policy}; frame-ancestors 'none'"
        return Response(status, status.phrase, headers, body)

    def _complete(self, page: Response, zipped: bool, watches: bool) -> None:
        """Add this page's own style and scripts to viser's."""
        kind = zipped, watches
        if kind not in self._pages:
            body = with_additions(bytes(page.body), self._label, watches)
            self._pages[kind] = gzip.compress(body) if zipped else body
        page.body = self._pages[kind]
        del page.headers["Content-Length"], page.headers["Content-Encoding"]
        page.headers["Content-Length"] = str(len(page.body))
        page.headers["Content-Encoding"] = "gzip" if zipped else "identity"

    def _check(self, raw: object, sender: "_Client") -> bool:
        """Check a message before viser reads it; whether it may. **Raises** `ValueError`."""
        message = read_message(raw)
        if sender.watches and not may_watch(self._handle_of(sender), message):
            return False
        if isinstance(message, viser_messages.GuiUpdateMessage) and self.server is not None:
            apis = [self.server.gui, *(client.gui for client in self.server.get_clients().values())]
            found = [api._gui_input_handle_from_uuid.get(message.uuid) for api in apis]
            for handle in filter(None, found):
                check_value(handle, message.updates)
        return True

    def _handle_of(self, sender: "_Client") -> viser.ClientHandle | None:
        """viser's handle of a browser; None until it has sent its first message."""
        if self.server is None:
            return None
        connections = self.server._websock_server._live_connections
        number = next((number for number, known in connections.items() if known is sender), None)
        return self.server.get_clients().get(number)  # type: ignore[arg-type]


class _Client:
    """A connection as viser's handler sees it, without invalid messages and with a limited rate.

    **Attributes:** `watches`: whether it may only watch; what it may not send is left out.
    """

    def __init__(self, connection: ServerConnection, check: Callable[[Any, Any], bool], watches: bool):
        self._connection, self._check, self.watches = connection, check, watches
        self._pace = Pace(RATE) if watches else Pace()
        self._size = 0
        self._refused = 0
        self._ignored = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)

    async def recv(self) -> Data:
        """The next valid message."""
        while True:
            await self._pace.wait(self._size)
            raw = await self._connection.recv()
            self._size = len(raw)
            try:
                allowed = self._check(raw, self)
            except ValueError as error:
                self._refused += 1
                log.warning("a browser's message was refused: %s", _line(error))
                if self._refused >= TOLERATED:
                    self._connection.transport.abort()  # a proper end would wait for everything else that was sent
                    raise ConnectionClosedError(None, None) from None
                continue
            if allowed:
                return raw
            if not self._ignored:  # an honest one may press a key, or click on the picture
                log.warning("a browser that may only watch is not obeyed")
                self._ignored = True


def read_message(raw: object) -> Any:
    """A message of viser's, of a kind that a page sends, whose fields have the right types and finite numbers.

    **Raises** `ValueError`.
    """
    check(isinstance(raw, bytes), "message", "text", "binary")
    assert isinstance(raw, bytes)
    check(len(raw) <= MAX_PICTURE_BYTES, "message", f"{len(raw):,} bytes", f"at most {MAX_PICTURE_BYTES:,} bytes")
    try:
        fields = msgspec.msgpack.decode(raw)
        name = fields.pop("type")
        kind = MESSAGE_TYPES.get(name)
    except Exception as error:  # damaged, not a mapping, keys or types that are lists
        raise ValueError(f"message: not one of viser's: {_line(error)}") from None
    if kind is None:
        raise ValueError(f"message of the kind {shown(name)}: not one that this page sends")
    check(
        kind is PICTURE or len(raw) <= MAX_MESSAGE_BYTES,
        name,
        f"{len(raw):,} bytes",
        f"at most {MAX_MESSAGE_BYTES:,} bytes",
    )
    known = {field.name for field in dataclasses.fields(kind) if field.init}
    for field, value in fields.items():
        choice(f"field of {name}", field, known)
        check(_is_bounded(value), f"{name}.{field}", value, f"finite, and at most {MAX_NUMBER:g}")
    try:
        message = msgspec.convert(fields, kind)
    except msgspec.ValidationError as error:
        raise ValueError(f"{name}: {_line(error)}") from None
    if isinstance(message, viser_messages.ViewerCameraMessage):
        _check_camera(message)
    return message


def _check_camera(camera: viser_messages.ViewerCameraMessage) -> None:
    """Refuse a camera that no browser has. A hidden page has a picture without size."""
    for name in ("image_width", "image_height"):
        size = getattr(camera, name)
        check(0 <= size <= MAX_PICTURE_SIDE, name, size, f"from 0 to {MAX_PICTURE_SIDE}")
    check(0.001 <= camera.fov <= 3.14, "fov", camera.fov, "an angle from 0.001 to 3.14")
    check(0 < camera.near < camera.far, "near", camera.near, "from 0 to far")
    for name in ("wxyz", "up_direction"):
        way = getattr(camera, name)
        check(UNIT[0] <= math.hypot(*way) <= UNIT[1], name, way, "of length 1")


def check_value(handle: Any, updates: dict[str, Any]) -> None:
    """Check that a page changes nothing but the value of a field, to one that it can have. **Raises** `ValueError`."""
    check(set(updates) == {"value"}, "update", list(updates), "of the value alone")
    value = updates["value"]
    present = handle._impl.value
    options = getattr(handle._impl.props, "options", None)
    if options is not None:
        check(isinstance(value, str) and value in options, "value", value, "one of the options")
    elif isinstance(present, bool):
        check(isinstance(value, bool), "value", value, "true or false")
    elif isinstance(present, int | float):
        check(_is_number(value), "value", value, "a number")
        _check_range(handle._impl.props, [value])
    elif isinstance(present, str):
        text = isinstance(value, str) and len(value) <= MAX_TEXT_CHARACTERS
        check(text, "value", value, f"a text of at most {MAX_TEXT_CHARACTERS:,} characters")
    elif isinstance(present, tuple):
        alike = isinstance(value, list) and len(value) == len(present) and all(map(_is_number, value))
        check(alike, "value", value, f"{len(present)} numbers")
        _check_range(handle._impl.props, value)
    else:
        check(False, "value", value, "left alone")


def _check_range(props: object, values: list[float]) -> None:
    """Refuse numbers beyond the ends of a slider, or of a field that has some."""
    ends = [getattr(props, end, None) for end in ("min", "max")]
    lows, highs = ([end] * len(values) if end is None or _is_number(end) else list(end) for end in ends)
    for value, low, high in zip(values, lows, highs, strict=True):
        slack = ROUNDING * max(abs(low or 0.0), abs(high or 0.0))
        right = (low is None or value >= low - slack) and (high is None or value <= high + slack)
        check(right, "value", value, f"from {'any' if low is None else low} to {'any' if high is None else high}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_bounded(value: object) -> bool:
    """Whether all numbers in a message are finite, and of a size that can mean something."""
    if isinstance(value, int | float):
        return abs(value) <= MAX_NUMBER
    if isinstance(value, dict):
        return all(map(_is_bounded, value.values()))
    return all(map(_is_bounded, value)) if isinstance(value, list) else True


def _line(error: BaseException) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 200 else f"{text[:199]}…"
