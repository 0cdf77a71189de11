"""Whole processes: how long an import takes, how much memory a run needs."""

import subprocess
import sys
import time

import numpy as np

from motorgrad.benchmarks._measure import Row

HOPPERS = """
import resource, motorgrad as mg
mg.train("hopper", steps=2000, seeds=16, progress=False)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def start_row(name: str, arguments: list[str], wanted: str, runs: int = 7) -> Row:
    """Seconds of wall time of a fresh interpreter, less those of one that does nothing."""

    def seconds(command: list[str]) -> float:
        start = time.perf_counter()
        subprocess.run([sys.executable, *command], check=True, capture_output=True)
        return time.perf_counter() - start

    took = [(seconds(arguments), seconds(["-c", "pass"])) for _ in range(runs)]
    ours, empty = np.median(took, axis=0)
    return Row(name, float(ours), float(empty), "s (other: python -c pass)", None, None, wanted)


def memory_row(wanted: str) -> Row:
    """Peak memory of a fresh process that trains 16 hoppers."""
    done = subprocess.run([sys.executable, "-c", HOPPERS], check=True, capture_output=True, text=True)
    unit = 1024 if sys.platform != "darwin" else 1  # ru_maxrss is in KiB on Linux, in bytes on macOS
    return Row("peak memory, 16 hoppers", int(done.stdout) * unit / 1e9, None, "GB", None, None, wanted)
