"""Kill training at random instants, resume it by the same command, and compare with an undisturbed run.

For each engine, one run is made undisturbed. Then the same command is started and killed (SIGKILL) again and again: a
third of the time at a random instant after its start, a third after the end of its start-up, and a third at the first
write of records or a checkpoint after such an instant. Whenever a run finishes before it is killed, it must equal the
undisturbed one bit for bit, except for wall time, and the next run begins.
"""

import contextlib
import dataclasses
import json
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa

import motorgrad as mg
from motorgrad.training.store._checkpoint import load as read_state


@dataclasses.dataclass(frozen=True)
class Engine:
    """The run that an engine is tried with: its command, and the seconds between two checkpoints.

    Windows fit no block of random numbers, and some checkpoints fall between two records.
    """

    task: str
    steps: int
    window: int
    seeds: int = 3
    options: tuple[str, ...] = ()


ENGINES = {
    "world": Engine("three-state", 2_000_000, 99_999),
    "sparse": Engine("particle", 60_000, 4_999, options=("--agent.kind", "sparse")),
    "body": Engine("hopper", 4_000, 199),
    "side-by-side": Engine("hopper", 1_500, 99, seeds=16),
    "environment": Engine("gymnasium", 20_000, 999, options=("--task.env-id", "CartPole-v1")),
}
EVERY = 0.05  # seconds between checkpoints
KILL_KINDS = ("any", "started", "write")  # from the start, from the end of the start-up, at a write after that
PATIENCE = 300.0  # seconds that any command may take
PLACES = ("before learning", "while learning", "during a commit")

Trace = tuple[Path, int]  # a file, and when it was written


class Failure(Exception):
    """Something that must not happen."""


def torture(name: str, folder: Path, kills: int, random: np.random.Generator) -> tuple[Counter[str], int]:
    """Kill the engine's training so often.

    **Returns** where the kills hit, and the number of finished runs that were compared. **Raises** `Failure`.
    """
    engine = ENGINES[name]
    landed = Counter[str]()
    undisturbed = folder / f"{name}-undisturbed"
    start = time.monotonic()
    finish(begin(engine, undisturbed), undisturbed)
    whole = time.monotonic() - start
    say(f"{name}: undisturbed in {whole:.1f} s")
    spans = {"any": whole, "started": whole / 2, "write": whole / 2}  # the start-up takes about half
    used = done = 0
    while used < kills or (folder / f"{name}-{done}").exists():
        path = folder / f"{name}-{done}"
        sessions = sessions_of(path)
        old = leftovers(path)
        kind = str(random.choice(KILL_KINDS))
        child = begin(engine, path)
        if used < kills and kill(child, path, sessions, old, kind, random.uniform(0, spans[kind])):
            used += 1
            place = where_hit(path, sessions, old)
            landed[place] += 1
            say(f"{name}: kill {used} of {kills}, {place}, after {reached(path):,} of {engine.steps:,} decisions")
            continue
        finish(child, path)
        if different := list(differences(path, undisturbed)):
            raise Failure(f"{path.name} differs from {undisturbed.name}:\n  " + "\n  ".join(different))
        shutil.rmtree(path)
        done += 1
        say(f"{name}: run {done} ended as the undisturbed one")
    return landed, done


def begin(engine: Engine, path: Path) -> subprocess.Popen[bytes]:
    """Start the command; its output goes to a file beside the run."""
    settings = {"steps": engine.steps, "window": engine.window, "seeds": engine.seeds, "threads": 2}
    command = [sys.executable, "-P", "-m", "motorgrad", "train", engine.task, "--out", str(path), *engine.options]
    for option, value in {**settings, "checkpoint-every": EVERY}.items():
        command += [f"--{option}", str(value)]
    with log_of(path).open("wb") as log:
        return subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, cwd=path.parent)


def finish(child: subprocess.Popen[bytes], path: Path) -> None:
    """Wait until the command is done. **Raises** `Failure` if it fails."""
    try:
        status = child.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        status = f"nothing for {PATIENCE:.0f} s"
    finally:
        child.kill()
        child.wait()
    if status != 0:
        raise Failure(f"{path.name}: the command ended with {status}:\n{log_of(path).read_text()}")


def kill(child: subprocess.Popen[bytes], path: Path, sessions: int, old: set[Trace], kind: str, delay: float) -> bool:
    """Kill the command, `delay` seconds from its start or start-up on; whether it was still running."""
    deadline = time.monotonic() + PATIENCE

    def wait_while(condition: Callable[[], bool], pause: float) -> None:
        while condition() and child.poll() is None and time.monotonic() < deadline:
            time.sleep(pause)

    if kind != "any":
        wait_while(lambda: sessions_of(path) == sessions, 0.01)
    begun = time.monotonic()
    wait_while(lambda: time.monotonic() < begun + delay, 0.001)
    if kind == "write":
        wait_while(lambda: leftovers(path) <= old, 0.0002)
    child.kill()
    status = child.wait()
    if status not in (0, -signal.SIGKILL):
        raise Failure(f"{path.name}: the command ended by itself with {status}:\n{log_of(path).read_text()}")
    return status != 0


def where_hit(path: Path, sessions: int, old: set[Trace]) -> str:
    """Where a kill fell, from what it left: a session is noted at the end of the start-up."""
    if sessions_of(path) == sessions:
        return PLACES[0]
    newest = max((int(file.stem.split("-")[1]) for file in (path / "metrics").glob("*.parquet")), default=0)
    return PLACES[1] if leftovers(path) <= old and newest <= reached(path) else PLACES[2]


def sessions_of(path: Path) -> int:
    """How many processes have worked on a run."""
    file = path / "provenance.json"
    return len(json.loads(file.read_text())["sessions"]) if file.exists() else 0


def leftovers(path: Path) -> set[Trace]:
    """The records and checkpoints that are being written, or were when the process was killed."""
    found = set()
    for part in ("metrics", "checkpoint"):
        for file in (path / part).glob(".*.partial"):
            with contextlib.suppress(FileNotFoundError):  # just finished
                found.add((file, file.stat().st_mtime_ns))
    return found


def reached(path: Path) -> int:
    """The decision of the newest checkpoint."""
    return max((int(file.stem) for file in states(path)), default=0)


def states(path: Path) -> list[Path]:
    """The checkpoints of a run, oldest first."""
    return sorted((path / "checkpoint").glob("*.state"))


def log_of(path: Path) -> Path:
    """What the latest command of a run said."""
    return path.with_name(f"{path.name}.log")


def differences(path: Path, other: Path) -> Iterator[str]:
    """What differs between two finished runs, but for wall time: configuration, records, complete final state."""
    mine = mg.load(path)
    wanted = mg.load(other)
    if mine.config != wanted.config:
        yield "config.toml"
    if (mine.decision, mine.complete) != (wanted.decision, True):
        yield f"decisions: {mine.decision:,} of {wanted.decision:,}"
    yield from _different_arrays("metrics", _columns(mine.metrics), _columns(wanted.metrics))
    for kind, file in (("initial policies", "initial.policies"), ("final state", None)):
        pair = [read_state(run / "checkpoint" / file if file else states(run)[-1])[0] for run in (path, other)]
        yield from _different_arrays(kind, *pair)


def _columns(metrics: pa.Table) -> dict[str, np.ndarray]:
    """The columns that the wall clock has no part in."""
    found = {
        name: metrics[name].combine_chunks() for name in metrics.column_names if name not in ("wall_time", "cpu_time")
    }
    return {name: (array.flatten() if name == "parameters" else array).to_numpy() for name, array in found.items()}


def _different_arrays(kind: str, mine: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> Iterator[str]:
    if list(mine) != list(wanted):
        yield f"{kind}: {sorted(mine)}, not {sorted(wanted)}"
        return
    for name, array in mine.items():
        right = wanted[name]
        if (array.dtype, array.shape) != (right.dtype, right.shape):
            yield f"{kind}, {name}: {array.dtype}{array.shape}, not {right.dtype}{right.shape}"
        elif array.tobytes() != right.tobytes():
            same = np.array([a.tobytes() == b.tobytes() for a, b in zip(array.flat, right.flat, strict=True)])
            first = int(np.argmin(same))
            found = f"{array.flat[first]!r}, not {right.flat[first]!r}"
            yield f"{kind}, {name}: {np.sum(~same)} of {same.size} numbers, the first at {first}: {found}"


def say(text: str) -> None:
    print(text, flush=True)
