"""The editor on the local network interface: pages and a WebSocket, behind the gate of `motorgrad.pages`.

The pages use relative paths; the WebSocket is `socket`.
"""

import asyncio
import contextlib
import socket
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.http.auto import AutoHTTPProtocol

from motorgrad._errors import check
from motorgrad.pages import BACKLOG, HEADERS, Gate, Lobby, Pace, Passed, open_in_browser
from timlab.editor._protocol import event_text
from timlab.editor._session import Session
from timlab.editor._static import NOT_BUILT, STATIC

HOST = "127.0.0.1"
MAX_MESSAGE_BYTES = 64 * 2**20
POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; worker-src 'self' blob:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
PAGE_HEADERS = {**HEADERS, "Content-Security-Policy": POLICY}


class Server:
    """Serves a session on 127.0.0.1.

    **Arguments:** the session; the `port`, 0 for a free one; the folder of the built pages.
    """

    def __init__(self, session: Session, port: int = 0, static: Path = STATIC):
        whole = isinstance(port, int) and not isinstance(port, bool)
        check(whole and 0 <= port < 2**16, "port", port, "an integer from 0 to 65535, 0 for a free one")
        self.session = session
        self._gate = Gate(HOST, "`motorgrad lab`")
        self._static = static
        self._socket = socket.socket()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((HOST, port))
        except OSError as error:
            self._socket.close()
            raise ValueError(f"port = {port}: cannot be used: {error.strerror}") from None
        self._socket.listen(128)  # clients that connect before the server is up wait
        self.port = self._socket.getsockname()[1]
        routes = [Route("/{path:path}", self._page), WebSocketRoute("/socket", self._talk)]
        self._lobby = Lobby()
        app = _Guard(Starlette(routes=routes), self._gate, self._lobby)
        settings: Any = {
            "log_level": "critical",
            "ws": "websockets-sansio",
            "ws_max_size": MAX_MESSAGE_BYTES,
            "lifespan": "off",
        }
        # the lobby must know clients by their real addresses, whatever a header of a proxy says
        settings |= {"http": self._lobby.connections_of(AutoHTTPProtocol), "proxy_headers": False, "backlog": BACKLOG}
        self._server = uvicorn.Server(uvicorn.Config(app, timeout_graceful_shutdown=1, **settings))
        self._thread: threading.Thread | None = None

    @property
    def built(self) -> bool:
        """Whether the editor's pages are built."""
        return (self._static / "index.html").is_file()

    @property
    def token(self) -> str:
        """The secret in the address."""
        return self._gate.token

    @property
    def url(self) -> str:
        """The address of the editor, with the token."""
        return f"{self._origin}/{self.token}/"

    @property
    def _origin(self) -> str:
        return f"http://{HOST}:{self.port}"

    def open(self) -> bool:
        """Open the editor in the user's browser. **Returns** whether there is one."""
        return open_in_browser(self._gate, self._origin)

    def run(self) -> None:
        """Serve until stopped, in this thread."""
        try:
            self._server.run([self._socket])
        finally:
            self._gate.end_tickets()

    def start(self) -> None:
        """Serve in a thread of its own, until `stop`."""
        self._thread = threading.Thread(target=self.run, name="motorgrad-lab-server", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop serving; the session continues."""
        self._server.should_exit = True
        if self._thread is not None:
            self._thread.join(10)
        self._socket.close()

    async def _page(self, request: Request) -> Response:
        path = request.path_params["path"] or "index.html"
        file = self._built(path)
        if not file.is_relative_to(self._static.resolve()) or not file.is_file():
            missing = path == "index.html"
            text = NOT_BUILT if missing else "There is no such page."
            return PlainTextResponse(text, 404, PAGE_HEADERS)
        return FileResponse(file, headers=PAGE_HEADERS)

    def _built(self, path: str) -> Path:
        """The file of a page; the folder of all pages if the path cannot name a file."""
        try:
            file = (self._static / path).resolve()
            return file if file.is_file() else self._static
        except (OSError, ValueError):  # too long, or with a zero byte
            return self._static

    async def _talk(self, connection: WebSocket) -> None:
        await connection.accept()
        outbox = _Outbox(asyncio.get_running_loop(), self.session.resend)
        end = self.session.listen(outbox.put)
        sender = asyncio.create_task(outbox.drain(connection.send_text))
        pace = Pace()
        text = ""
        try:
            while True:
                await pace.wait(len(text))
                text = await connection.receive_text()
                self.session.handle(text, outbox.put)
        except (WebSocketDisconnect, KeyError):  # disconnected, or it sent bytes
            pass
        finally:
            end()
            sender.cancel()


class _Outbox:
    """Events queued for one client. A slow client misses samples; once it has caught up, it gets all recorded signals
    again, in few points.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, resend: Callable[[Callable[..., None]], None], most: int = 300):
        self._loop = loop
        self._resend = resend
        self._most = most
        self._behind = False
        self._events: deque[dict[str, Any]] = deque()
        self._lock = threading.Lock()
        self._there = asyncio.Event()

    def put(self, event: dict[str, Any]) -> None:
        """Queue an event, from any thread."""
        with self._lock:
            self._events.append(event)
            if len(self._events) > self._most:
                self._events = deque(each for each in self._events if each["event"] != "samples")
                self._behind = True
        with contextlib.suppress(RuntimeError):  # the server has stopped
            self._loop.call_soon_threadsafe(self._there.set)

    async def drain(self, send: Callable[[str], Any]) -> None:
        """Send events as long as the connection lives."""
        while True:
            await self._there.wait()
            self._there.clear()
            while self._events:
                with self._lock:
                    event = self._events.popleft() if self._events else None
                if event is not None:
                    await send(event_text(event))
            if self._behind:
                self._behind = False
                self._resend(self.put)


class _Guard:
    """Puts the gate in front of an application, which sees paths without the token."""

    def __init__(self, app: ASGIApp, gate: Gate, lobby: Lobby):
        self._app, self._gate, self._lobby = app, gate, lobby

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        upgrade = scope["type"] == "websocket"
        query = scope["query_string"].decode("latin-1")
        headers = [(name.decode("latin-1"), value.decode("latin-1")) for name, value in scope["headers"]]
        verdict = self._gate.judge(f"{scope['path']}{query and '?'}{query}", headers, upgrade)
        if isinstance(verdict, Passed):
            self._lobby.leave((scope["client"], scope["server"]))
            await self._app({**scope, "path": verdict.path}, receive, send)
        elif upgrade:
            await send({"type": "websocket.close", "code": 1008})  # before accepting: status 403
        else:
            await Response(verdict.text, verdict.status, verdict.headers)(scope, receive, send)
