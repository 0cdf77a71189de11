"""Whole processes: how long an import takes, how much memory a run needs."""

import subprocess
import sys
import time

import numpy as np

from motorgrad.benchmarks._measure import Row

HOPPERS = """
import motorgrad as mg
mg.train("hopper", steps=2000, seeds=16, progress=False)
"""
PARTICLES = """
import motorgrad as mg
mg.train("particle", steps=256, seeds={seeds}, window=256, progress=False)
"""
# On Linux the greatest size in getrusage counts that of the process which started this one, too.
PEAK = """
import re, resource, sys
from pathlib import Path
if sys.platform == "linux":
    print(1024 * int(re.search("VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1]))
else:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024))
"""
SEEDS = (1_000, 21_000)


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
    return Row("peak memory, 16 hoppers", _peak(HOPPERS) / 1e9, None, "GB", None, None, wanted)


def seed_memory_row() -> Row:
    """What one more seed of the particle's learner adds to the peak memory of a fresh process."""
    fewer, more = (_peak(PARTICLES.format(seeds=seeds)) for seeds in SEEDS)
    each = (more - fewer) / (SEEDS[1] - SEEDS[0])
    return Row("memory of a seed, particle with 8 local units", each / 1e3, None, "kB", None, None)


def _peak(script: str) -> int:
    """Peak memory in bytes of a fresh interpreter that does what a script says."""
    done = subprocess.run([sys.executable, "-c", script + PEAK], check=True, capture_output=True, text=True)
    return int(done.stdout)
