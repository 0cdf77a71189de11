"""Where an experiment works: a folder that keeps what is finished."""

import hashlib
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad._files import read_arrays, write_arrays
from motorgrad._settings import table
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from motorgrad.training import AgentSettings, Run, fingerprint, train


class Workspace:
    """The folder of one experiment, and the trained runs that experiments share.

    **Arguments:** `path`, the experiment's folder; `shared`, the folder of trained runs; `threads` for physics, 0 for
    one per processor; `progress`, whether to show it.
    """

    def __init__(self, path: Path, shared: Path, threads: int = 0, progress: bool = True):
        self.path, self.shared, self.threads, self.progress = path, shared, threads, progress
        self.trained: dict[str, float] = {}
        """Of every run that was asked for, the seconds that its training took, in whatever session."""

    def train(self, task: Task, settings: AgentSettings, steps: int, seeds: int, initial: Policy | None = None) -> Run:
        """A trained run, from the shared folder where another experiment has asked for the same; `initial` as in
        `motorgrad.train`.

        **Raises** `KeyboardInterrupt` where it was stopped by Ctrl-C: all is saved.
        """
        asked = {"task": table(task), "agent": table(settings), "steps": steps, "seeds": seeds}
        asked |= {} if initial is None else {"initial": fingerprint(initial)}
        mark = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:8]
        out = self.shared / f"{task.name}-{mark}"
        run = train(task, settings, steps, seeds, out, threads=self.threads, progress=self.progress, initial=initial)
        if not run.complete:
            raise KeyboardInterrupt
        self.trained[out.name] = float(run.metrics["wall_time"][-1].as_py())
        return run

    def part(self, name: str, make: Callable[[], Mapping[str, Any]]) -> dict[str, np.ndarray]:
        """The arrays that `make` returns, made once and kept under `name`.

        `make` must depend on the experiment's settings only: the folder is of these settings.
        """
        file = self.path / "parts" / f"{name}.npz"
        if file.exists():
            return read_arrays(file)
        self.say(name)
        made = {key: np.asarray(value) for key, value in make().items()}
        write_arrays(file, made)
        return made

    def say(self, what: str) -> None:
        """A line about how far it is."""
        if self.progress:
            print(f"  {self.path.name}: {what}", file=sys.stderr, flush=True)
