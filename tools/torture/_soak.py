"""Let a training run, TimSim and TimLab work side by side for many minutes, and watch their memory."""

import contextlib
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from websockets.sync.connection import Connection

from tools.torture._applications import ask, lab_server, lab_socket
from tools.torture._training import Failure, say

PAUSE = 5.0  # seconds between two measurements
WARM = 0.3  # share of the time in which memory may still grow: compiling, filling histories
ALLOWED = 48.0  # MB by which the median memory may grow after that


def soak(name: str, folder: Path, count: int, random: np.random.Generator) -> tuple[Counter[str], int]:
    """Watch the memory for `count` minutes. **Raises** `Failure` if it grows, or if a process ends."""
    del name, random
    motorgrad = [sys.executable, "-P", "-m", "motorgrad"]
    with (folder / "soak.log").open("w") as log:
        quiet: Any = {"stdout": log, "stderr": log, "cwd": folder}
        train = [
            *motorgrad,
            "train",
            "hopper",
            "--seeds",
            "4",
            "--steps",
            "1000000000",
            "--out",
            "run",
            "--window",
            "200",
        ]
        sim = [*motorgrad, "sim", "hopper", "--speed", "max", "--no-browser", "--autosave", "policy.npz"]
        processes: dict[str, subprocess.Popen[Any]] = {
            "train": subprocess.Popen(train, **quiet),
            "sim": subprocess.Popen(sim, **quiet),
        }
        processes["lab"], address = lab_server(["--gallery", "linear-recruitment"])
        used: dict[str, list[float]] = {name: [] for name in processes}
        try:
            with lab_socket(address) as connection:
                ask(connection, 1, op="play", speed=None)
                end = time.monotonic() + 60 * count
                while time.monotonic() < end:
                    for name, process in processes.items():
                        if process.poll() is not None:
                            raise Failure(
                                f"{name} ended with {process.returncode}: {(folder / 'soak.log').read_text()}"
                            )
                        used[name].append(_memory(process.pid))
                    _read_for(connection, PAUSE)
        finally:
            for process in processes.values():
                process.kill()
                process.wait()
    for name, values in used.items():
        late = np.array(values[int(WARM * len(values)) :])
        early, last = (float(np.median(part)) for part in (late[: len(late) // 3], late[-(len(late) // 3) :]))
        say(f"{name}: {early:.0f} MB early, {last:.0f} MB late")
        if last > early + ALLOWED:
            raise Failure(f"{name}: its memory grew from {early:.0f} to {last:.0f} MB")
    return Counter({"minutes of each": count}), len(used)


def _memory(process: int) -> float:
    """The resident memory of a process and its children, MB (Linux)."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
        children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    except OSError:  # just ended
        return 0.0
    own = next((line.split()[1] for line in status.splitlines() if line.startswith("VmRSS")), "0")
    return int(own) / 1024 + sum(_memory(int(child)) for child in children)


def _read_for(connection: Connection, seconds: float) -> None:
    """Receive what comes, as a browser does."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        with contextlib.suppress(TimeoutError):
            connection.recv(left)


ATTACKS = {"together": soak}
