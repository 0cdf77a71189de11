"""A run: what training gives back, and what a run directory holds."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from motorgrad._errors import check, unknown
from motorgrad.policies import Policy, rebuild
from motorgrad.tasks import Task, make
from motorgrad.training._checkpoint import name_of
from motorgrad.training._directory import RunDirectory, RunDirectoryError
from motorgrad.training._plot import learning_curves

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True, eq=False)
class Run:
    """The outcome of training.

    - `config`: the effective configuration, as in `config.toml`.
    - `decision`: decisions made per seed; `complete`, whether that is all that was asked for.
    - `metrics`: a table of records (`docs/training.md` has its columns).
    - `policies`: the policies of all seeds, stacked along a leading axis; `initial`, the same before learning.
    - `path`: the run directory, `None` for a run in memory.
    """

    config: dict[str, Any]
    decision: int
    metrics: pa.Table
    policies: Policy
    initial: Policy
    path: Path | None = None
    _task: Task | None = None

    @property
    def seeds(self) -> list[int]:
        """The seeds, in the order of every leading axis."""
        return self.config["run"]["seeds"]

    @property
    def complete(self) -> bool:
        """Whether all decisions asked for were made; if not, the same call of `train` goes on."""
        return self.decision >= self.config["run"]["steps"]

    @property
    def task(self) -> Task:
        """The task, rebuilt from the configuration where the run was loaded."""
        if self._task is not None:
            return self._task
        settings = dict(self.config["task"])
        return make(settings.pop("name"), **settings)

    def policy(self, seed: int | None = None) -> Policy:
        """The learnt policy of one seed, by default the first."""
        seed = self.seeds[0] if seed is None else seed
        check(seed in self.seeds, "seed", seed, f"one of the run's seeds, {self.seeds}")
        row = self.seeds.index(seed)
        return jax.tree.map(lambda leaf: jax.numpy.asarray(leaf[row]), self.policies)

    def curve(self, quantity: str = "reward") -> tuple[np.ndarray, np.ndarray]:
        """A column of the metrics as `(decisions (records,), values (seeds, records))`."""
        known = [c for c in self.metrics.column_names if c not in ("seed", "decision", "parameters")]
        if quantity not in known:
            raise unknown("quantity", quantity, known)
        decision = self.metrics["decision"].to_numpy()[:: len(self.seeds)]
        values = self.metrics[quantity].to_numpy().astype(float).reshape(-1, len(self.seeds)).T
        return decision, values

    def plot(self, quantity: str = "reward", path: Path | str | None = None) -> "Figure":
        """The learning curve: every seed, their median and their interquartile band; saved to `path` if given."""
        return learning_curves([self], quantity, path)


def load(path: Path | str) -> Run:
    """The run in a directory: configuration, metrics, policies. Reading takes no lock, so a run may be under way.

    **Raises:** `RunDirectoryError` where there is no run, or none of its checkpoints is whole.
    """
    directory = RunDirectory(path)
    config = directory.read_config()
    found = directory.latest()
    if found is None:
        raise RunDirectoryError(f"{path} has no whole checkpoint yet")
    arrays, about = found
    shapes = rebuild(config["agent"]["policy"])

    def filled(arrays: dict[str, np.ndarray], prefix: str) -> Policy:
        return jax.tree_util.tree_map_with_path(lambda place, _: arrays[prefix + name_of(place)], shapes)

    policies, initial = filled(arrays, "cycle.agent.policy."), filled(directory.initial(), "")
    metrics = directory.metrics()
    metrics = pa.table({}) if metrics is None else metrics.filter(pc.field("decision") <= about["decision"])
    return Run(config, about["decision"], metrics, policies, initial, Path(path))
