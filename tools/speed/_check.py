"""Two commits side by side: their rows in turn, in processor time, each measurement in a process of its own."""

import contextlib
import dataclasses
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from motorgrad.benchmarks import Row
from tools.speed._processes import ROOT, Failed, git, measure, present

ROWS_OF = ("src/motorgrad/benchmarks", "apps/timlab/src/timlab/benchmarks.py", "apps/timsim/src/timsim/benchmarks.py")
"""The code of rows. Both commits are measured by that of this checkout: so an older one needs none of its rows, and a
change of a row is no change in speed."""
WITHIN = 2
"""Pairs that a row measures in each process, of which the median counts."""


@dataclasses.dataclass(frozen=True)
class Change:
    """How fast a row is, as new ÷ base of each pair of processes: by the processor time of its work, or by memory."""

    id: str
    ratios: tuple[float, ...]

    @property
    def median(self) -> float:
        return float(np.median(self.ratios))

    @property
    def fell(self) -> bool:
        """Whether it fell by more than the pairs spread."""
        return 1 - self.median > max(self.ratios) - min(self.ratios)

    def __str__(self) -> str:
        return f"{self.id}: new ÷ base {self.median:.2f} [{min(self.ratios):.2f} … {max(self.ratios):.2f}]"


def check(base: str, rows: Sequence[Row], pairs: int) -> int:
    """Compare this checkout, as it is, with a commit. **Returns** 1 if a row fell by more than its spread, or failed in
    this checkout; else 0."""
    commit, changed = present()
    print(f"new: {commit}{', with changes' * changed}; base: {git('rev-parse', '--short=8', f'{base}^{{commit}}')}")
    fallen = []
    with base_checkout(base) as old:
        for row in rows:
            change = compare(row.id, old, pairs)
            if isinstance(change, str):
                print(f"{row.id}: not compared: {change}", flush=True)
                if change.startswith("new: "):
                    fallen.append(row.id)
                continue
            print(f"{change}{', FELL' * change.fell}", flush=True)
            if change.fell:
                fallen.append(row.id)
    print(
        f"fell by more than their spread, or failed: {', '.join(fallen)}"
        if fallen
        else "no row fell by more than its spread"
    )
    return int(bool(fallen))


def compare(row_id: str, base: Path, pairs: int) -> Change | str:
    """How a row changed from the checkout `base` to this one: base, new, base, new … Or why it cannot be compared."""
    ratios = []
    for _ in range(pairs):
        costs = []
        for name, checkout in (("base", base), ("new", ROOT)):
            try:
                found = measure(checkout, row_id, WITHIN)
            except Failed as failed:
                return f"{name}: {failed}"
            if "missing" in found:
                return found["missing"]
            costs.append(float(np.median(found["costs"])))
        ratios.append(costs[0] / costs[1])
    return Change(row_id, tuple(ratios))


@contextlib.contextmanager
def base_checkout(commit: str) -> Iterator[Path]:
    """A commit in a temporary folder, with the rows of this checkout."""
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        base = Path(folder).resolve() / "base"
        git("worktree", "add", "--detach", str(base), commit)
        try:
            for name in ROWS_OF:
                put(ROOT / name, base / name)
            yield base
        finally:
            git("worktree", "remove", "--force", str(base))


def put(source: Path, target: Path) -> None:
    """Let a file or a folder take the place of another."""
    if source.is_dir():
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
    elif target.parent.exists():
        shutil.copy(source, target)
