"""What a moment costs on the wire."""

import time

import numpy as np
import pytest
import viser
from scene_moments import moment, walk
from websockets.sync.client import connect

MOST = 14_000
"""Bytes of one moment of a hexapod with 24 muscles and all layers on; `Scene` says some 14 kB."""


def received(socket, seconds):
    """Bytes that come within some seconds."""
    total, until = 0, time.monotonic() + seconds
    while (left := until - time.monotonic()) > 0:
        try:
            total += len(socket.recv(timeout=left))
        except TimeoutError:
            break
    return total


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
        received(socket, 2.0)
        assert received(socket, 0.5) == 0  # a moment that was shown costs nothing
        costs = []
        for part in np.array_split(np.arange(1, 30), 2):
            for index in part:
                pose.place(moments[index])
                scene.update(moments[index], pose)
                time.sleep(0.04)
            costs.append(received(socket, 0.5) / len(part))
    print(f"{costs[0]:,.0f} and {costs[1]:,.0f} bytes a moment")
    assert 1_000 < costs[0] < MOST
    assert costs[1] < MOST
    assert costs[1] < 1.2 * costs[0]
