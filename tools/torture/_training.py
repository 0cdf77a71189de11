#!/usr/bin/env python
"""Kill training at random instants, resume it by the same command, and see that nothing shows.

For a task in a world and for one with a body the run is made once undisturbed. Then the same command is started again
and again and killed (SIGKILL): a third of the times at a random instant from its start, a third at one from the end of
its start-up, and a third at the first write of records or a checkpoint after such an instant. Whenever it finishes
before it is killed, the run must be the undisturbed one, bit for bit but for wall time, and another is begun; so until
all kills are used up, and then the last run is left to finish. The exit status is 1 if anything differs or a command
fails, and the folder with the runs is kept.

`--seed` repeats the instants that are drawn; where in the work they fall depends on how busy the machine is.
"""

import argparse
import contextlib
import json
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa

import motorgrad as mg
from motorgrad.training.store._checkpoint import load as read_state

# The windows fit no block of random numbers, and some checkpoints come between two records.
STEPS = {"three-state": 2_000_000, "hopper": 4_000}
WINDOWS = {"three-state": 99_999, "hopper": 199}
EVERY = 0.05  # seconds between checkpoints
KINDS = ("any", "started", "write")  # the kills: from the start, from the end of the start-up, at a write after that
PATIENCE = 300.0  # seconds that any command may take
PLACES = ("before learning", "while learning", "during a commit")

Trace = tuple[Path, int]  # a file, and when it was written


class Failure(Exception):
    """Something that must not happen."""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=100, help="how many kills, shared by the tasks (100)")
    parser.add_argument("--seed", type=int, default=0, help="of the random instants (0)")
    parser.add_argument("--keep", action="store_true", help="keep the runs also if all is well")
    options = parser.parse_args(arguments)
    if options.kills < 1 or options.seed < 0:
        parser.error("--kills must be at least 1 and --seed at least 0")
    folder, began, landed, compared = Path(tempfile.mkdtemp(prefix="torture-")), time.monotonic(), Counter(), 0
    try:
        for number, name in enumerate(STEPS):
            kills = (options.kills + number) // len(STEPS)
            compared += torture(name, folder, kills, np.random.default_rng([options.seed, number]), landed)
    except Failure as failure:
        say(f"FAILED: {failure}\nthe runs are in {folder}; --seed {options.seed} draws the same instants again")
        return 1
    where = ", ".join(f"{landed[place]} {place}" for place in PLACES)
    took, total = time.monotonic() - began, landed.total()
    noun = "kill" if total == 1 else "kills"
    say(f"{total} {noun} ({where}); {compared} runs, each as if undisturbed; {took:.0f} s, seed {options.seed}")
    if options.keep:
        say(f"the runs are in {folder}")
    else:
        shutil.rmtree(folder)
    return 0


def torture(name: str, folder: Path, kills: int, random: np.random.Generator, landed: Counter[str]) -> int:
    """Kill the task's training so often, adding to `landed` where it was hit; the number of runs compared."""
    undisturbed, start = folder / f"{name}-undisturbed", time.monotonic()
    finish(begin(name, undisturbed), undisturbed)
    whole = time.monotonic() - start
    say(f"{name}: undisturbed in {whole:.1f} s")
    spans = {"any": whole, "started": whole / 2, "write": whole / 2}  # the start-up takes about half
    used = done = 0
    while used < kills or (folder / f"{name}-{done}").exists():
        path = folder / f"{name}-{done}"
        sessions, old = sessions_of(path), leftovers(path)
        kind = str(random.choice(KINDS))
        child = begin(name, path)
        if used < kills and kill(child, path, sessions, old, kind, random.uniform(0, spans[kind])):
            used += 1
            place = where_hit(path, sessions, old)
            landed[place] += 1
            say(f"{name}: kill {used} of {kills}, {place}, after {reached(path):,} of {STEPS[name]:,} decisions")
            continue
        finish(child, path)
        if different := list(differences(path, undisturbed)):
            raise Failure(f"{path.name} differs from {undisturbed.name}:\n  " + "\n  ".join(different))
        done += 1
        say(f"{name}: run {done} ended as the undisturbed one")
    return done


def begin(name: str, path: Path) -> subprocess.Popen[bytes]:
    """Start the command; what it says goes to a file beside the run."""
    settings = {"steps": STEPS[name], "window": WINDOWS[name], "seeds": 3, "threads": 1, "checkpoint-every": EVERY}
    command = [sys.executable, "-m", "motorgrad", "train", name, "--out", str(path)]
    command += [part for option, value in settings.items() for part in (f"--{option}", str(value))]
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
    mine, wanted = mg.load(path), mg.load(other)
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
    found = {name: metrics[name].combine_chunks() for name in metrics.column_names if name != "wall_time"}
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


if __name__ == "__main__":
    sys.exit(main())
