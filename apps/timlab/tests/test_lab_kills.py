"""A server of TimLab that is killed between edits, or in the midst of one, loses nothing that it acknowledged."""

import json
import multiprocessing
import random
import re
import time
from contextlib import suppress

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import timlab
from timlab.editor import Server, Session

TIMEOUT = 600
WORKERS = multiprocessing.get_context("forkserver")
WORKERS.set_forkserver_preload(["timlab.editor"])


def serve(folder, pipe):
    """A server on a file, in a process of its own, until it is killed."""
    session = Session(file=folder / "work.json", folder=folder, states=folder / "states")
    server = Server(session)
    server.start()
    pipe.send(server.url)
    time.sleep(7200)


class Tab:
    """A browser's tab on the server of a process."""

    def __init__(self, folder):
        ours, theirs = WORKERS.Pipe()
        self.process = WORKERS.Process(target=serve, args=(folder, theirs), daemon=True)
        self.process.start()
        url = ours.recv()
        origin = re.match(r"http://[^/]*", url).group()
        self.connection = connect(url.replace("http", "ws", 1) + "socket", origin=origin, open_timeout=TIMEOUT)
        self.sequence = 0

    def send(self, op, **fields):
        self.sequence += 1
        operation = {"client": "tab", "sequence": self.sequence, "op": op, **fields}
        self.connection.send(json.dumps(operation))

    def until(self, *kinds):
        """The next event of these kinds."""
        while True:
            event = json.loads(self.connection.recv(TIMEOUT))
            if event["event"] in kinds:
                return event

    def ask(self, op, **fields):
        self.send(op, **fields)
        answer = self.until("done", "refused")
        assert answer["event"] == "done", answer

    def kill(self):
        self.process.kill()
        self.process.join()
        with suppress(ConnectionClosed, OSError):
            self.connection.close()

    def recover(self):
        """Take up the work that a killed server left. **Returns** the names of the blocks that are there."""
        self.send("hello")
        left = self.until("recoverable")["list"]
        self.until("done")
        for found in left:
            self.ask("recover", id=found["id"])
        self.send("text")
        names = list(timlab.loads(self.until("text")["text"]).nodes)
        self.until("done")
        return names


def work_until_killed(tab, chance, made):
    """Add blocks, and save now and then, until the process is killed in the midst of a random operation.

    **Returns** how many blocks were acknowledged, and how many were asked for.
    """
    acknowledged = asked = made
    waiting = {}
    for _ in range(chance.randint(1, 20)):
        for _ in range(chance.randint(1, 4)):
            if chance.random() < 0.2:
                tab.send("save", over=True)
            else:
                tab.send("add", at=[], type="gain", name=f"block {asked}")
                asked += 1
                waiting[tab.sequence] = asked
        while waiting and chance.random() < 0.8:  # else something is still asked for when it is killed
            event = tab.until("done", "refused")
            assert event["event"] == "done", event
            acknowledged = waiting.pop(event["sequence"], acknowledged)
    time.sleep(chance.uniform(0.0, 0.01))
    tab.process.kill()
    with suppress(ConnectionClosed):  # what was acknowledged before the kill counts, too
        while True:
            event = tab.until("done", "refused")
            acknowledged = waiting.pop(event["sequence"], acknowledged)
    return acknowledged, asked


@pytest.mark.parametrize("kills", [pytest.param(4, marks=pytest.mark.ci), pytest.param(200, marks=pytest.mark.slow)])
def test_a_killed_server_loses_nothing_that_it_acknowledged(kills, tmp_path):
    chance, made, before = random.Random(kills), 0, 0
    for kill in range(kills):
        tab = Tab(tmp_path)
        found = tab.recover()
        assert found == [f"block {n}" for n in range(len(found))]  # in order, each once
        assert before <= len(found) <= made, f"kill {kill}"
        before, made = work_until_killed(tab, chance, len(found))
        tab.kill()
    assert made > kills  # the work went on
    tab = Tab(tmp_path)
    found = tab.recover()
    assert before <= len(found) <= made
    tab.ask("save", over=True)
    tab.kill()
    assert list(timlab.load(tmp_path / "work.json").nodes) == found
