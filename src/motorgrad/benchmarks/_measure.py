"""Measurements: two pieces of work in turn, in wall and processor time, and the start and memory of whole processes."""

import dataclasses
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad._processes import SAFE, environment
from motorgrad._program_store import FOLDER, VARIABLE

PER_SECOND = "/s"
"""The end of units of which more is better; of the others, seconds and bytes, less is better."""
Span = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Took:
    """A piece of work: how much was done, and the wall and processor seconds (`cpu`, of all threads) that it took."""

    amount: float
    wall: float
    cpu: float


@dataclasses.dataclass(frozen=True)
class Figures:
    """What a row of the speed table found: `ours` and `other` in `unit`, by wall time, and their ratio, by wall time
    and by processor time. Machines drift in speed, so ratios are taken of pairs measured one after the other, with the
    least and the greatest (`spread`); single figures are medians.

    - `pairs`: what ours and the other took, where both were timed; of some rows there is only ours, or none.
    - `also`: what else was found, and what is missing, in words.
    """

    ours: float
    other: float | None
    unit: str
    ratio: float | None = None
    spread: Span | None = None
    cpu_ratio: float | None = None
    cpu_spread: Span | None = None
    pairs: tuple[tuple[Took, Took | None], ...] = ()
    also: str = ""

    @property
    def costs(self) -> list[float]:
        """What a unit of our work cost: processor seconds of every piece of it, or `ours` itself if it is no time."""
        return [took.cpu / took.amount for took, _ in self.pairs] or [self.ours]


def figures(unit: str, pairs: list[tuple[Took, Took | None]], also: str = "") -> Figures:
    """The figures of pairs. A `unit` that ends in "/s" is a rate, and has a ratio; any other is seconds per amount."""
    rates = unit.endswith(PER_SECOND)
    sides = [[took for took in side if took is not None] for side in zip(*pairs, strict=True)]
    each = [[took.amount / took.wall if rates else took.wall / took.amount for took in side] for side in sides]
    ours, other = (float(np.median(side)) if side else None for side in each)
    assert ours is not None
    if other is None or not rates:
        return Figures(ours, other, unit, pairs=tuple(pairs), also=also)
    found: dict[str, Any] = {}
    for name, clock in (("", "wall"), ("cpu_", "cpu")):
        one, two = (np.array([took.amount / getattr(took, clock) for took in side]) for side in sides)
        ratios = one / two
        found[f"{name}ratio"] = float(np.median(ratios))
        found[f"{name}spread"] = (float(ratios.min()), float(ratios.max()))
    return Figures(ours, other, unit, **found, pairs=tuple(pairs), also=also)


def timed(work: Callable[[], object], amount: float = 1.0) -> Took:
    """Do an `amount` of work, of this process and of those that it starts and waits for."""
    used = _used()
    start = time.perf_counter()
    work()
    wall = time.perf_counter() - start
    return Took(amount, wall, _used() - used)


def _used() -> float:
    """Processor seconds of this process, all threads, and of the children that it has waited for."""
    try:
        import resource
    except ImportError:  # Windows, where work of other processes is not counted
        return time.process_time()
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def in_turn(
    unit: str,
    amount: float,
    ours: Callable[[], object],
    other: Callable[[], object] | None = None,
    other_amount: float | None = None,
    pairs: int = 5,
    also: str = "",
) -> Figures:
    """Time `ours` and `other`, if there is one, in turn. `amount` is the work done per call, and `other_amount` that of
    the other, where it differs."""
    found: list[tuple[Took, Took | None]] = []
    for _ in range(pairs):
        mine = timed(ours, amount)
        found.append((mine, None if other is None else timed(other, other_amount or amount)))
    return figures(unit, found, also)


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
IDLE = ("-c", "pass")


def started(arguments: list[str], runs: int = 7) -> Figures:
    """Seconds of a new interpreter, beside those of one that does nothing."""
    return in_turn("s", 1, lambda: interpret(arguments), lambda: interpret(IDLE), pairs=runs, also="other: an idle one")


def first_decision(command: Callable[[Path], list[str]], warm: bool, runs: int = 3) -> Figures:
    """Seconds of a new interpreter that trains for one decision, by a command of the folder that it may write: with
    everything compiled anew, or with what was compiled for an earlier process (`warm`)."""
    pairs: list[tuple[Took, Took | None]] = []
    with tempfile.TemporaryDirectory() as folder:
        for run in range(-warm, runs):  # a warm cache is filled by a run that does not count
            cache = kept_in(Path(folder) / ("cache" if warm else f"cache {run}"))
            words = command(Path(folder) / f"run {run}")
            took = timed(lambda words=words, cache=cache: interpret(words, cache))
            if run >= 0:
                pairs.append((took, None))
    return figures("s", pairs)


def kept_in(folder: Path) -> Mapping[str, str]:
    """The variables by which all that a process compiles is kept in a folder."""
    return {VARIABLE: str(folder / "programs"), FOLDER: "", "NUMBA_CACHE_DIR": str(folder / "numba")}


def interpret(arguments: list[str] | tuple[str, ...], settings: Mapping[str, str] | None = None) -> str:
    """What a new interpreter prints, with these environment variables."""
    with environment({**SAFE, **(settings or {})}):
        return subprocess.run([sys.executable, *arguments], check=True, capture_output=True, text=True).stdout


def peak(script: str) -> float:
    """Peak memory in bytes of a new interpreter that runs a script."""
    return float(interpret(["-c", script + PEAK]).split()[-1])


def peak_of(script: str) -> Figures:
    """Peak memory of a new interpreter that runs a script."""
    return Figures(peak(script) / 1e9, None, "GB")


def memory_of_a_seed() -> Figures:
    """How much each additional seed of the particle's learner adds to the peak memory of a new process."""
    fewer, more = (peak(PARTICLES.format(seeds=seeds)) for seeds in SEEDS)
    return Figures((more - fewer) / (SEEDS[1] - SEEDS[0]) / 1e3, None, "kB")
