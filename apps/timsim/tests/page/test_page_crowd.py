"""Fifty browsers at a page, some slow, some deaf, some that reload all the time; and a run that goes on."""

import os
import time

import msgspec
import pytest
from page_clients import CAMERA, TIMEOUT, VERSION, alive, client

from crowd import crowd, fair
from patience import until
from timsim import live


def resident():
    """Resident memory of this process in MB."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def visited(page, seconds, url=None, **kinds):
    address = (url or page.url).replace("http", "ws", 1)
    return crowd(address, msgspec.msgpack.encode(CAMERA), seconds, protocols=[VERSION], **kinds)


@pytest.mark.slow
@pytest.mark.ci
def test_fifty_browsers_disturb_neither_the_run_nor_each_other(page, quiet):
    """A class that watches by the address for it."""
    session = page.session
    visited(page, 2, readers=30)  # threads and buffers are made
    session.order(live.Speed(1.0))
    session.order(live.Play())
    before = resident()
    with live.Session(live.setup_of("chain"), speed=1.0) as unwatched:  # as busy as the machine may be
        assert until(lambda: unwatched.snapshot().decision > 0)
        sessions = (session, unwatched)
        began = [each.snapshot().decision for each in sessions]
        found = visited(page, 8, page.read_only_url, readers=35, slow=5, deaf=3, reloaders=7)
        made, alone = (each.snapshot().decision - then for each, then in zip(sessions, began, strict=True))
    session.order(live.Pause())
    assert found["failed"] == []
    assert fair(found)
    assert made > 0.8 * alone > 0  # as fast as one that nobody watches
    assert until(lambda: not page.server._websock_server._live_connections)
    assert until(lambda: not page.server.get_clients())
    assert resident() - before < 100 + 0.5 * sum(found["reloaders"])
    assert alive(page)
    assert quiet() == []


@pytest.mark.slow
@pytest.mark.ci
def test_a_storm_of_reloads_leaves_nothing_behind(page, quiet):
    reloads = 0
    while reloads <= 100:  # as many as a fast machine makes at once
        found = visited(page, 6, reloaders=20)
        assert found["failed"] == []
        reloads += sum(found["reloaders"])
    assert until(lambda: not page.server._websock_server._live_connections)
    assert until(lambda: not page.server._websock_server._broadcast_buffer.generator_cursors)
    with client(page) as connection:
        start = time.process_time()
        assert connection.recv(TIMEOUT)
        assert time.process_time() - start < 2
    assert quiet() == []
