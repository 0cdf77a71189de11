"""Measurements: two pieces of work in turn, and the start-up time and memory of whole processes."""

import dataclasses
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from motorgrad._processes import environment


@dataclasses.dataclass(frozen=True)
class Row:
    """A row of the speed table: `ours` and `other` in `unit`, and the median, least and greatest of their ratio.
    Machines drift in speed, so ratios are taken of pairs measured one after the other; single figures are medians."""

    name: str
    ours: float
    other: float | None
    unit: str
    ratio: float | None = None
    spread: tuple[float, float] | None = None
    wanted: str = ""


def in_turn(
    name: str,
    unit: str,
    amount: float,
    ours: Callable[[], object],
    other: Callable[[], object],
    other_amount: float | None = None,
    pairs: int = 5,
    wanted: str = "",
) -> Row:
    """Time `ours` and `other` in turn. `amount` is the work done per call, so rates are in `unit` (per second)."""
    rates = np.empty((pairs, 2))
    for pair in range(pairs):
        for column, (work, size) in enumerate(((ours, amount), (other, other_amount or amount))):
            start = time.perf_counter()
            work()
            rates[pair, column] = size / (time.perf_counter() - start)
    ratios = rates[:, 0] / rates[:, 1]
    median = np.median(rates, axis=0)
    spread = (float(ratios.min()), float(ratios.max()))
    return Row(name, float(median[0]), float(median[1]), unit, float(np.median(ratios)), spread, wanted)


class Advancing(Protocol):
    """A run that works: `advance` does an amount of its work."""

    def advance(self, amount: int, /) -> object: ...


def rate(run: Advancing, amount: int, runs: int) -> float:
    """How much of its work per second `run.advance(amount)` does, the median of several runs."""
    found = []
    for _ in range(runs):
        start = time.perf_counter()
        run.advance(amount)
        found.append(amount / (time.perf_counter() - start))
    return float(np.median(found))


HOPPERS = """
import motorgrad as mg
mg.train("hopper", steps=2000, seeds=16, progress=False)
"""
PARTICLES = """
import motorgrad as mg
mg.train("particle", steps=256, seeds={seeds}, window=256, progress=False)
"""
# On Linux, the maximum in getrusage includes that of the parent process.
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
    """Wall time in seconds of a new interpreter, minus that of one that does nothing."""

    def seconds(command: list[str]) -> float:
        start = time.perf_counter()
        with environment():
            subprocess.run([sys.executable, *command], check=True, capture_output=True)
        return time.perf_counter() - start

    took = [(seconds(arguments), seconds(["-c", "pass"])) for _ in range(runs)]
    ours, empty = np.median(took, axis=0)
    return Row(name, float(ours), float(empty), "s (other: python -c pass)", wanted=wanted)


def memory_row(wanted: str) -> Row:
    """Peak memory of a new process that trains 16 hoppers."""
    return Row("peak memory, 16 hoppers", _peak(HOPPERS) / 1e9, None, "GB", wanted=wanted)


def seed_memory_row() -> Row:
    """How much each additional seed of the particle's learner adds to the peak memory of a new process."""
    fewer, more = (_peak(PARTICLES.format(seeds=seeds)) for seeds in SEEDS)
    each = (more - fewer) / (SEEDS[1] - SEEDS[0])
    return Row("memory of a seed, particle with 8 local units", each / 1e3, None, "kB")


def _peak(script: str) -> int:
    """Peak memory in bytes of a new interpreter that runs a script."""
    with environment():
        done = subprocess.run([sys.executable, "-c", script + PEAK], check=True, capture_output=True, text=True)
    return int(done.stdout)
