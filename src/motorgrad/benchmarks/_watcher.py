"""A browser without a display: it connects to a page of TimSim, receives everything, and draws nothing."""

import importlib.metadata
import sys
import time

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


def watch(port: int, seconds: float, pause: float = 0.0) -> tuple[int, int]:
    """Receive what a page sends for `seconds`; returns the numbers of messages and of bytes.

    **Arguments:** `pause`: seconds to sleep after each message, which simulates a slow browser.
    """
    import msgspec
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    version = Subprotocol(f"viser-v{importlib.metadata.version('viser')}")
    messages = size = 0
    until = time.monotonic() + seconds
    with connect(f"ws://127.0.0.1:{port}", subprotocols=[version], max_size=None, compression=None) as socket:
        socket.send(msgspec.msgpack.encode(CAMERA))
        while (left := until - time.monotonic()) > 0:
            try:
                got = socket.recv(timeout=left)
            except TimeoutError:
                break
            messages, size = messages + 1, size + len(got)
            if pause:
                time.sleep(min(pause, max(0.0, until - time.monotonic())))
    return messages, size


if __name__ == "__main__":
    print(*watch(int(sys.argv[1]), float(sys.argv[2]), *map(float, sys.argv[3:])))
