"""The run directory, which survives a kill at any instant.

    config.toml        the effective configuration
    provenance.json    versions, processor and command of every session
    metrics/*.parquet  records, one file for the time between two checkpoints
    checkpoint/*       the last two complete states, and the initial policies
    figures/           figures and films

The newest whole checkpoint is the commit point: on resume, later metrics are discarded and recomputed.
"""

import dataclasses
import datetime
import importlib.metadata
import json
import os
import platform
import sys
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Self

import filelock
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w
from jaxtyping import PyTree

from motorgrad._errors import check
from motorgrad._files import read_json, read_toml, write_atomically
from motorgrad._settings import build
from motorgrad.training.store._checkpoint import CorruptCheckpoint, load, save

LIBRARIES = "motorgrad jax jaxlib equinox optax mujoco gymnasium cloudpickle numpy scipy numba pyarrow"


class RunDirectoryError(RuntimeError):
    """A run directory that cannot be used: locked by another process, of another configuration, or not a run at all."""


class RunWarning(UserWarning):
    """A warning about a run directory, such as a damaged checkpoint."""


@dataclasses.dataclass(frozen=True)
class _Run:
    """The table `run` of a configuration."""

    steps: int
    seeds: tuple[int, ...]
    window: int
    initial: str | None = None


class RunDirectory:
    """The directory of a run. As a context manager, it is locked against other processes."""

    def __init__(self, path: Path | str):
        self.path = Path(path)
        self._lock = filelock.FileLock(self.path / ".lock", timeout=0)

    def __enter__(self) -> Self:
        if self.path.exists() and not self.path.is_dir():
            raise RunDirectoryError(f"{self.path} is a file, not a run directory")
        if self.path.is_dir() and not self.is_run:
            # a run killed before it wrote anything leaves empty folders and hidden files
            files = (p for p in self.path.rglob("*") if p.is_file() and not p.name.startswith("."))
            if (found := next(files, None)) is not None:
                raise RunDirectoryError(f"{self.path} holds other files ({found.name}) and no config.toml: not a run")
        self.path.mkdir(parents=True, exist_ok=True)
        try:
            self._lock.acquire()
        except filelock.Timeout:
            holder = self.path / ".holder"
            who = f" (process {holder.read_text()})" if holder.exists() else ""
            raise RunDirectoryError(f"{self.path} is in use by another process{who}") from None
        (self.path / ".holder").write_text(str(os.getpid()))
        return self

    def __exit__(self, *_: object) -> None:
        (self.path / ".holder").unlink(missing_ok=True)
        self._lock.release()

    @property
    def is_run(self) -> bool:
        """Whether the directory has a configuration."""
        return (self.path / "config.toml").is_file()

    def read_config(self) -> dict[str, Any]:
        """The configuration. **Raises** `RunDirectoryError` where there is none."""
        if not self.is_run:
            raise RunDirectoryError(f"{self.path} is not a run directory: it has no config.toml")
        config = read_toml(self.path / "config.toml")
        try:
            check({"run", "task", "agent"} <= set(config), "tables", list(config), "run, task and agent")
            build(_Run, config["run"], "run")
            for name, key in (("task", "name"), ("agent", "policy")):
                check(isinstance(config[name], dict) and key in config[name], name, config[name], f"a table with {key}")
        except ValueError as error:
            raise RunDirectoryError(f"{self.path} is not a run directory: its config.toml: {error}") from None
        return config

    def write_config(self, config: dict[str, Any]) -> None:
        """Write the configuration, which makes the folder a run directory. Call it before any other write."""
        write_atomically(self.path / "config.toml", tomli_w.dumps(config).encode())
        for name in ("metrics", "checkpoint", "figures"):
            (self.path / name).mkdir(exist_ok=True)

    def add_session(self, seeds: list[int], continues: bool = False) -> None:
        """Add this process to the run's provenance. Warn of changes where it `continues` a run."""
        file = self.path / "provenance.json"
        sessions = read_json(file)["sessions"] if file.exists() else []
        sessions.append(provenance())
        changes = list(provenance_changes(*sessions[-2:])) if continues and len(sessions) > 1 else []
        if changes:
            warnings.warn(f"{self.path} continues, but not bit for bit: {'; '.join(changes)}", RunWarning, stacklevel=2)
        write_atomically(file, json.dumps({"seeds": seeds, "sessions": sessions}, indent=2).encode())

    def save(self, state: PyTree[np.ndarray], about: dict[str, Any], tables: Iterable[pa.Table | None]) -> None:
        """Commit the records since the last checkpoint, then the state, and delete the oldest state."""
        for records in filter(None, tables):
            first, last = (records["decision"][i].as_py() for i in (0, -1))
            sink = pa.BufferOutputStream()
            pq.write_table(records, sink)
            write_atomically(self.path / "metrics" / f"{first:012d}-{last:012d}.parquet", sink.getvalue().to_pybytes())
        save(self._checkpoint(about["decision"]), state, about)
        for old in self._checkpoints()[:-2]:
            old.unlink()

    @property
    def has_initial_policies(self) -> bool:
        """Whether the policies before learning are stored."""
        return self._initial.is_file()

    def save_initial(self, policies: PyTree[np.ndarray], learner: dict[str, Any]) -> None:
        """Store the policies before learning, and the learner as a table."""
        save(self._initial, policies, {"decision": 0, "learner": learner})

    def initial(self) -> dict[str, np.ndarray]:
        """The policies before learning, by the names of their fields."""
        return load(self._initial)[0]

    def learner(self) -> dict[str, Any] | None:
        """The learner as a table, with the structure of its policy; `None` before the first decision."""
        about = load(self._initial)[1] if self._initial.exists() else {}
        return about.get("learner")

    def latest(self) -> tuple[dict[str, np.ndarray], dict[str, Any]] | None:
        """The newest whole checkpoint, `None` before the first.

        For a damaged checkpoint it warns (`RunWarning`) and uses the one before. **Raises** `RunDirectoryError` if all
        are damaged, so that nothing is discarded silently.
        """
        for before, path in reversed(list(enumerate(self._checkpoints()))):
            try:
                return load(path)
            except CorruptCheckpoint as error:
                if not before:
                    raise RunDirectoryError(
                        f"{error}; there is none before it. Delete the folder {path.parent} to train from the start"
                    ) from None
                warnings.warn(f"{error}; using the checkpoint before it", RunWarning, stacklevel=2)
        return None

    def roll_back(self, decision: int, recorded: int = 0) -> None:
        """Discard checkpoints after `decision` and metrics after `recorded`, which will be recomputed."""
        for part in self._parts():
            if int(part.stem.split("-")[1]) > recorded:
                part.unlink()
        for path in self._checkpoints():
            if int(path.stem) > decision:
                path.unlink()

    def metrics(self) -> pa.Table | None:
        """All records, in order."""
        parts = self._parts()
        return pa.concat_tables([pq.read_table(part) for part in parts]) if parts else None

    @property
    def _initial(self) -> Path:
        return self.path / "checkpoint" / "initial.policies"

    def _parts(self) -> list[Path]:
        return sorted((self.path / "metrics").glob("*.parquet"))

    def _checkpoint(self, decision: int) -> Path:
        return self.path / "checkpoint" / f"{decision:012d}.state"

    def _checkpoints(self) -> list[Path]:
        return sorted((self.path / "checkpoint").glob("*.state"))


def provenance() -> dict[str, Any]:
    """Versions, processor, command and time of this process.

    Runs are reproducible bit for bit where `versions`, `compiler` and `processor` are equal.
    """
    return {
        "versions": {name: importlib.metadata.version(name) for name in LIBRARIES.split()}
        | {"python": platform.python_version()},
        "compiler": {"XLA_FLAGS": os.environ.get("XLA_FLAGS", "")},
        "processor": _processor(),
        "system": platform.platform(),
        "cores": os.cpu_count(),
        "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
        "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def provenance_changes(before: dict[str, Any], now: dict[str, Any]) -> Iterator[str]:
    """The differences between two sessions on which bit-for-bit reproducibility depends, in words."""
    were, are = (
        {"processor": each["processor"], **each["versions"], **each.get("compiler", {})} for each in (before, now)
    )
    for name in were.keys() & are.keys():
        if were[name] != are[name]:
            yield f"{name} was {were[name]} and is now {are[name]}"


def _processor() -> str:
    """The processor's model: `platform.processor()` is empty on many Linux systems."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
