"""Checkouts, and processes that measure a row with the library of one."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from motorgrad._program_store import NOTHING_KEPT
from tools.speed import ENVIRONMENT

ROOT = Path(__file__).parents[2]
WORKER = Path(__file__).with_name("_worker.py")
SOURCES = ("src", "apps/timsim/src", "apps/timlab/src")


class Failed(RuntimeError):
    """A row could not be measured; the last line of what its process said."""


def measure(checkout: Path, row_id: str, pairs: int) -> dict[str, Any]:
    """The `figures`, `costs` and `machine` of a row, measured in a process of its own by the library of a checkout; or
    what is `missing`. **Raises** `Failed`."""
    paths = os.pathsep.join(str(checkout / source) for source in SOURCES)
    done = subprocess.run(
        [sys.executable, str(WORKER), str(checkout), row_id, str(pairs)],
        env={**ENVIRONMENT, **NOTHING_KEPT, "PYTHONPATH": paths, "PYTHONSAFEPATH": "1"},
        cwd=checkout,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise Failed((done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1])
    return json.loads(done.stdout.splitlines()[-1])


def git(*words: str, checkout: Path = ROOT) -> str:
    """What git says in a checkout. **Raises** `CalledProcessError`."""
    done = subprocess.run(["git", *words], cwd=checkout, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def present() -> tuple[str, bool]:
    """The commit of this checkout, and whether its code has changed since. What is stored and drawn is no code."""
    return git("rev-parse", "--short=8", "HEAD"), bool(
        git("status", "--porcelain", "--", ".", ":!benchmarks", ":!docs")
    )
