"""Clients of a page for tests: what a browser sends, and what a stranger would."""

import contextlib
import http.client
import importlib.metadata

import msgspec
import zstandard
from websockets.sync.client import connect

from patience import PATIENCE, until
from timsim._watching_client import CAMERA, origin_of

VERSION = f"viser-v{importlib.metadata.version('viser')}"
TIMEOUT = PATIENCE  # s, of an answer
PLACES = 160  # of the page, for those without a token; fewer than usual


def get(page, path, **headers):
    """The status, headers and text of the answer to a request."""
    connection = http.client.HTTPConnection("127.0.0.1", page.server.get_port(), timeout=TIMEOUT)
    connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, {name.lower(): value for name, value in answer.getheaders()}, text


def socket(page, url=None, **options):
    """A connection as the page in a browser makes it."""
    url = url or page.url
    usual = {
        "origin": origin_of(url),
        "open_timeout": TIMEOUT,
        "subprotocols": [VERSION],
        "max_size": None,
        "max_queue": None,
    }
    return connect(url.replace("http", "ws", 1), compression=None, **usual | options)


@contextlib.contextmanager
def client(page, **options):
    """A connection that counts as a browser, and that hears all it is sent without keeping it."""
    with socket(page, **options) as connection:
        send(connection, **CAMERA)
        yield connection


def send(connection, **message):
    connection.send(msgspec.msgpack.encode(message))


def update(connection, handle, value, name="value"):
    """Set a field of the page, as someone does who types."""
    send(connection, type="GuiUpdateMessage", uuid=handle._impl.uuid, updates={name: value})


def fields(page):
    """Every field that a browser can change."""
    return list(page.server.gui._gui_input_handle_from_uuid.values())


def hear(connection):
    """The messages that come next, as the page in a browser reads them."""
    raw = connection.recv(TIMEOUT)
    size, packed = (int.from_bytes(raw[start : start + 8], "little") for start in (0, 8))
    text = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], max_output_size=size)
    return msgspec.msgpack.decode(text)["messages"]


def hear_out(connection, *messages):
    """Send messages, and hear all that is said, to the end."""
    for message in messages:
        connection.send(message)
    while True:
        connection.recv(TIMEOUT)


def alive(page):
    """Whether somebody new is let in, served and heard."""
    with client(page) as connection:
        speed = page.panels.panels["Run"]._speed
        wanted = 0.5 if speed.value[0] != 0.5 else 0.25
        update(connection, speed, [wanted])
        return len(connection.recv(TIMEOUT)) > 0 and until(lambda: speed.value == (wanted,))
