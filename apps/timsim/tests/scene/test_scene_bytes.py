"""What a moment costs on the wire."""

import msgspec
import numpy as np
import pytest
import viser
import zstandard
from scene_moments import moment, walk
from websockets.sync.client import connect

from patience import PATIENCE

MOST = 14_000
"""Bytes of one moment of a hexapod with 24 muscles and all layers on; `Scene` says some 14 kB."""


class Listener:
    """Hears what a server sends, up to a mark that it is made to send."""

    def __init__(self, server, socket):
        self._server, self._socket, self._marks = server, socket, 0

    def received(self):
        """Bytes, and the kinds of messages, that came before the mark, and with it."""
        self._marks += 1
        self._server.scene.add_frame(f"/mark-{self._marks:03}", visible=False)
        total, kinds = 0, []
        while True:
            raw = self._socket.recv(PATIENCE)
            total += len(raw)
            size, packed = (int.from_bytes(raw[start : start + 8], "little") for start in (0, 8))
            text = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], max_output_size=size)
            messages = msgspec.msgpack.decode(text)["messages"]
            kinds += [each["type"] for each in messages if not str(each.get("name")).startswith("/mark")]
            if any(each.get("name") == f"/mark-{self._marks:03}" for each in messages):
                return total, kinds


@pytest.mark.ci
def test_bytes_of_a_moment_are_bounded_and_do_not_grow(hexapod, server, staged):
    scene, pose = staged(hexapod)
    moments = []
    for decision in range(30):
        position, velocity, control = walk(hexapod, 10 * decision, seed=1)
        moments.append(moment(position, velocity=velocity, control=control, decision=decision, model=hexapod))
    pose.place(moments[0])
    scene.update(moments[0], pose)
    url = f"ws://127.0.0.1:{server.get_port()}"
    with connect(url, subprotocols=[f"viser-v{viser.__version__}"], max_size=None, compression=None) as socket:  # type: ignore[list-item]
        listener = Listener(server, socket)
        listener.received()
        listener.received()
        pose.place(moments[0])
        scene.update(moments[0], pose)
        mark, kinds = listener.received()
        assert kinds == []  # a moment that was shown costs nothing
        costs = []
        for part in np.array_split(np.arange(1, 30), 2):
            total = 0
            for index in part:
                pose.place(moments[index])
                scene.update(moments[index], pose)
                total += listener.received()[0] - mark
            costs.append(total / len(part))
    print(f"{costs[0]:,.0f} and {costs[1]:,.0f} bytes a moment")
    assert 1_000 < costs[0] < MOST
    assert costs[1] < MOST
    assert costs[1] < 1.2 * costs[0]
