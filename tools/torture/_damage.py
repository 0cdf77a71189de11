"""Damage one file of a run directory, load the run, and train it on by the same command.

Whatever is damaged must be named, by a warning or by an error. What is loaded must be what was saved: the same records,
or fewer, and a state that was saved. A run that goes on must end like the undisturbed one, or say what it has lost.
"""

import shutil
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

import motorgrad as mg
from tools.torture._training import Failure, differences

SETTINGS = {"steps": 400, "seeds": 2, "window": 20, "checkpoint_every": 0.0, "progress": False}
TASKS = {"world": "chain", "body": "hopper"}


def flip(content: bytes, random: np.random.Generator) -> bytes:
    """Flip one bit."""
    at = int(random.integers(len(content)))
    return content[:at] + bytes([content[at] ^ 1 << int(random.integers(8))]) + content[at + 1 :]


def cut(content: bytes, random: np.random.Generator) -> bytes:
    """Cut off the end, or all."""
    return content[: int(random.integers(len(content)))]


def blank(content: bytes, random: np.random.Generator) -> bytes:
    """Replace a part by zeros, as a disk that lost a block does."""
    start = int(random.integers(len(content)))
    stop = min(len(content), start + int(random.integers(1, 4096)))
    return content[:start] + bytes(stop - start) + content[stop:]


def extend(content: bytes, random: np.random.Generator) -> bytes:
    """Append random bytes."""
    return content + random.bytes(int(random.integers(1, 100)))


WAYS: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (flip, flip, flip, cut, blank, extend)


def damage(name: str, folder: Path, count: int, random: np.random.Generator) -> tuple[Counter[str], int]:
    """Damage a copy of a run so often. **Raises** `Failure`."""
    task = TASKS[name]
    found = Counter[str]()
    compared = 0
    whole = folder / "whole"
    mg.train(task, out=whole, **SETTINGS)
    files = [path.relative_to(whole) for path in sorted(whole.rglob("*")) if path.is_file()]
    files = [file for file in files if not file.name.startswith(".") and file.parts[0] != "figures"]
    kinds = sorted({(file.parent, file.suffix) for file in files})
    for number in range(count):
        path = folder / f"{number}"
        shutil.copytree(whole, path)
        kind = kinds[int(random.integers(len(kinds)))]
        file = str(random.choice([str(file) for file in files if (file.parent, file.suffix) == kind]))
        way = WAYS[int(random.integers(len(WAYS)))]
        content = (path / file).read_bytes()
        altered = way(content, random)
        if altered == content:
            altered = flip(content, random)
        (path / file).write_bytes(altered)
        outcome = _outcome(task, path, whole, Path(file).name)
        if outcome is None and way is extend and file.endswith("SHA256SUMS"):
            outcome = "no part of the run"  # a commit that was killed leaves such lines, which no checkpoint covers
        if outcome is None:
            raise Failure(f"{path}: {way.__name__} of {file} was not named")
        found[outcome] += 1
        compared += outcome == "named, and made again"
        shutil.rmtree(path)
    return found, compared


def _outcome(task: str, path: Path, whole: Path, file: str) -> str | None:
    """What became of a damaged run, or None if the damage was not named."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            run = mg.load(path)
            if not _is_part(run, mg.load(whole)):
                raise Failure(f"{path}: altered records were loaded")
            mg.train(task, out=path, **SETTINGS)
        except (ValueError, RuntimeError) as error:
            return "refused by name" if file in str(error) else None
        different = list(differences(path, whole))
    named = any(file in str(each.message) for each in said)
    if not different:
        return "named, and made again" if named else None
    if not named:
        raise Failure(f"{path} differs:\n  " + "\n  ".join(different))
    return "named, and left out"


def _is_part(run: mg.Run, whole: mg.Run) -> bool:
    """Whether every record of a run is one of the undisturbed run."""
    rows = [
        {tuple(map(str, row.values())) for row in each.metrics.drop_columns(["wall_time", "cpu_time"]).to_pylist()}
        for each in (run, whole)
    ]
    return rows[0] <= rows[1]


ATTACKS = dict.fromkeys(TASKS, damage)
