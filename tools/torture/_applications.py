"""Kill the servers of the applications: what TimLab acknowledged, and what TimSim saved, must be there again."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from motorgrad.training import fingerprint
from tools.torture._training import PATIENCE, Failure, say

MAX_EDITS = 30  # before a kill
LIFE = 6.0  # seconds that a page of TimSim lives at most
ADDRESS = re.compile(r"http://127\.0\.0\.1:(\d+)/([\w-]+)/")


def edit(name: str, folder: Path, count: int, random: np.random.Generator) -> tuple[Counter[str], int]:
    """Add blocks in TimLab, kill the server between edits, and count the blocks that a new server recovers."""
    del name
    found = Counter[str]()
    file = folder / "work.json"
    env = os.environ | {"XDG_STATE_HOME": str(folder / "state")}
    for number in range(count):
        edits = int(random.integers(1, MAX_EDITS))
        acknowledged = 0
        server, address = lab_server([str(file)], env)
        with lab_socket(address) as connection:
            for sequence in range(1, edits + 1):
                acknowledged += ask(connection, sequence, op="add", at=[], type="gain")["event"] == "done"
            if random.integers(2):  # an edit on its way may be lost, or not
                connection.send(
                    json.dumps({"client": "a", "sequence": edits + 1, "op": "add", "at": [], "type": "gain"})
                )
                time.sleep(float(random.uniform(0, 0.01)))
            server.kill()
            server.wait()
        blocks = _recovered(file, env)
        if acknowledged != edits or not acknowledged <= blocks <= acknowledged + 1:
            raise Failure(f"kill {number}: {blocks} blocks of {acknowledged} acknowledged")
        found["all edits recovered"] += 1
        for left in (file, *folder.glob(".work*")):
            left.unlink(missing_ok=True)
        say(f"timlab: kill {number + 1} of {count}, after {acknowledged} edits")
    return found, count


def autosave(name: str, folder: Path, count: int, random: np.random.Generator) -> tuple[Counter[str], int]:
    """Kill TimSim while it saves; what is in the file must be a whole policy with which the page starts again."""
    del name
    found = Counter[str]()
    file = folder / "policy.npz"
    command = [
        sys.executable,
        "-P",
        "-m",
        "motorgrad",
        "sim",
        "chain",
        "--autosave",
        str(file),
        "--autosave-every",
        "0.1",
    ]
    command += ["--speed", "max", "--no-browser"]
    for number in range(count):
        started = _started(command, folder, os.environ)
        time.sleep(float(random.uniform(0, LIFE) if number % 4 == 0 else random.uniform(0, 1)))
        os.killpg(started.pid, signal.SIGKILL)
        started.wait()
        if not file.exists():
            found["before the first save"] += 1
            continue
        try:
            _policy(file)
        except ValueError as error:
            raise Failure(f"kill {number}: {error}") from None
        found["a whole policy found"] += 1
        say(f"timsim: kill {number + 1} of {count}")
    return found, found["a whole policy found"]


def _policy(file: Path) -> str:
    """A hash of a saved policy. **Raises** `ValueError` if it is damaged."""
    from timsim.live import setup_of

    return fingerprint(setup_of("chain", run=file).initial)


def lab_server(diagram: list[str], env: Any = None) -> tuple[subprocess.Popen[str], tuple[str, str]]:
    """Start TimLab's server on a diagram. **Returns** the process, and port and token."""
    command = [sys.executable, "-P", "-m", "motorgrad", "lab", *diagram, "--port", "0", "--no-browser"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=env)
    assert server.stdout is not None
    line = server.stdout.readline()
    if (match := ADDRESS.search(line)) is None:
        server.kill()
        raise Failure(f"TimLab did not start: {line}")
    return server, (match[1], match[2])


def lab_socket(address: tuple[str, str]) -> Connection:
    """Connect to a server."""
    port, token = address
    return connect(f"ws://127.0.0.1:{port}/{token}/socket", origin=f"http://127.0.0.1:{port}", open_timeout=PATIENCE)  # type: ignore[arg-type]


def ask(connection: Connection, sequence: int, **operation: Any) -> dict[str, Any]:
    """Send an operation. **Returns** the answer."""
    connection.send(json.dumps({"client": "a", "sequence": sequence, **operation}))
    while True:
        event = json.loads(connection.recv(PATIENCE))
        if event["event"] in ("done", "refused"):
            return event


def _recovered(file: Path, env: Any) -> int:
    """The number of blocks that a new server recovers and saves."""
    server, address = lab_server([str(file)], env)
    try:
        with lab_socket(address) as connection:
            connection.send(json.dumps({"client": "a", "sequence": 1, "op": "hello"}))
            while (event := json.loads(connection.recv(PATIENCE)))["event"] != "recoverable":
                pass
            if not event["list"]:
                return 0
            ask(connection, 2, op="recover", id=event["list"][0]["id"])
            ask(connection, 3, op="save")
        return len(json.loads(file.read_text())["blocks"])
    finally:
        server.kill()
        server.wait()


def _started(command: list[str], folder: Path, env: Any) -> subprocess.Popen[str]:
    """Start a page, in a process group of its own, and wait until it serves."""
    log = (folder / "sim.log").open("w")
    with log:
        page = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=log, text=True, env=env, cwd=folder, start_new_session=True
        )
    assert page.stdout is not None
    if "http" not in (line := page.stdout.readline()):
        page.kill()
        raise Failure(f"TimSim did not start: {line}{(folder / 'sim.log').read_text()}")
    return page


ATTACKS = {"timlab": edit, "timsim": autosave}
