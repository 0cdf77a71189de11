"""A browser without a display: it connects to a page of TimSim, receives everything, and draws nothing."""

import importlib.metadata
import sys
import time
from typing import Any

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (0.0, -3.0, 1.0),
    "fov": 0.8,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 480,
    "image_width": 640,
    "look_at": (0.0, 0.0, 0.5),
    "up_direction": (0.0, 0.0, 1.0),
}
"""A browser's first message; only who has sent it counts as a client."""


def watch(url: str, seconds: float, pause: float = 0.0) -> tuple[int, int]:
    """Receive what a page sends for `seconds`; returns the numbers of messages and of bytes.

    **Arguments:** `url`: the page's whole address; `pause`: seconds to sleep after each message, which simulates a slow
    browser.
    """
    import msgspec
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    version = Subprotocol(f"viser-v{importlib.metadata.version('viser')}")
    messages = size = 0
    until = time.monotonic() + seconds
    settings: Any = {"subprotocols": [version], "max_size": None, "compression": None, "origin": origin_of(url)}
    with connect(url.replace("http", "ws", 1), **settings) as socket:
        socket.send(msgspec.msgpack.encode(CAMERA))
        while (left := until - time.monotonic()) > 0:
            try:
                got = socket.recv(timeout=left)
            except TimeoutError:
                break
            messages = messages + 1
            size = size + len(got)
            if pause:
                time.sleep(min(pause, max(0.0, until - time.monotonic())))
    return messages, size


def origin_of(url: str) -> str:
    """The origin that a browser sends from the page at this address."""
    return "/".join(url.split("/")[:3])


if __name__ == "__main__":  # the address is a secret, and the arguments of a process are not
    print(*watch(input(), *map(float, sys.argv[1:])))
