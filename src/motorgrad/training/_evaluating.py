"""Callbacks that evaluate while training, and that keep the best policies."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from jaxtyping import PyTree

from motorgrad._errors import check, choice
from motorgrad.policies import Policy
from motorgrad.schema import Settings, count, numbers_of, static
from motorgrad.tasks import Task
from motorgrad.training._callbacks import Report
from motorgrad.training._episodes import MAX_EPISODES, EpisodeEvaluation, evaluate_episodes
from motorgrad.training.store import part_of

SETTINGS = ("every", "episodes", "seed", "mode")
SHARE = 20
"""Evaluations in a training, by default."""
STATE = "evaluation"
"""Where a checkpoint keeps the evaluations."""


@dataclasses.dataclass(eq=False)
class EvaluationCallback(Settings):
    """A callback that evaluates the present policies in whole episodes while they learn.

    Every evaluation has the same episodes, by random numbers of their own: training is the same in every bit as without
    them, and a run that was killed and resumed has the same evaluations. They are part of the run: they are saved with
    its checkpoints (`Run.evaluations`, `Run.evaluated`), and a run that continues goes on evaluating, whether or not it
    is told to again. Time spent in them is not in the records' times.

    `last` is the newest `EpisodeEvaluation`.

    ```python
    evaluations = mg.training.EvaluationCallback(every=1_000, episodes=5)
    run = mg.train("particle-navigation", steps=2_000, window=500, seeds=2, callbacks=evaluations, progress=False)
    decisions, returns = run.evaluated()  # (2,) and (2, 2): the means of two seeds at two times
    ```
    """

    every: int | None = count(
        None,
        1,
        2**32,
        unit="decisions",
        help="between two evaluations, which take place at the ends of records: the first end of a record after each "
        "multiple of it. By default a twentieth of the steps of the run",
    )
    episodes: int = count(10, 1, MAX_EPISODES, help="episodes of each seed")
    seed: int = count(1, help="of their random numbers. Those of `evaluate` differ unless its `seed` is the same")
    mode: Literal["sample", "mode"] = static("sample", help="whether actions are drawn, or the most probable ones")
    last: EpisodeEvaluation | None = dataclasses.field(default=None, init=False, repr=False)
    _found: dict[str, Any] = dataclasses.field(default_factory=dict, init=False, repr=False)
    _every: int = dataclasses.field(default=0, init=False, repr=False)

    @property
    def settings(self) -> dict[str, Any]:
        """The settings as the table `run` of a configuration has them."""
        given = {name: getattr(self, name) for name in SETTINGS} | {"every": self._every or self.every}
        return {f"evaluate_{name}": value for name, value in given.items()}

    def begin(self, task: Task, steps: int, every: int | None = None) -> None:
        """Forget earlier runs. Evaluations are `every` so many decisions, unless the callback itself says it.
        **Raises** `ValueError` for a task that cannot be evaluated so."""
        check(task.has_episodes, "callbacks", self, f"none for the task {task.name!r}, which has no episodes")
        self._every = self.every or every or max(1, steps // SHARE)
        self._found = {}
        self.last = None

    def __call__(self, report: Report) -> None:
        decisions = self._found.get("decision", np.zeros(0, np.int64))
        before = int(decisions[-1]) if len(decisions) else 0
        if not report.whole or report.decision // self._every <= before // self._every:
            return
        run = report.run
        more: Any = {"seed": self.seed, "mode": self.mode, "settings": run.settings}
        self.last = evaluate_episodes(run.task, run.policies, run.memory, run.seeds, self.episodes, **more)
        found = {"decision": np.append(decisions, report.decision)}
        for name in ("returns", "lengths", "diverged", "cut"):
            new = getattr(self.last, name)[:, None]
            found[name] = np.concatenate([self._found[name], new], axis=1) if name in self._found else new
        self._found |= found
        self._judge(report.decision, self.last, run.policies, run.memory)

    def _judge(self, decision: int, found: EpisodeEvaluation, policies: Policy, memory: PyTree) -> None:
        """What follows from an evaluation."""

    @property
    def state(self) -> dict[str, Any]:
        """All that was found, as arrays for a checkpoint, by name. Lanes lead, but of the `decision` of each."""
        return dict(self._found)

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Restore the `state` from the arrays of a checkpoint, by path."""
        self._found = part_of(arrays, STATE)


@dataclasses.dataclass(eq=False)
class KeepBest(EvaluationCallback):
    """A callback that evaluates as `EvaluationCallback` does, and keeps the policy of each seed that did best.

    `Run.best` gives the run with these policies, which are stored in its directory. Being the best of several, the
    value with which a policy was chosen is too good: report that of new episodes, `evaluate(run.best(), episodes=…)`.

    ```python
    keep = mg.training.KeepBest(every=1_000, episodes=5)
    run = mg.train("particle-navigation", steps=2_000, window=500, seeds=2, callbacks=keep, progress=False)
    print(run.best().best_at, mg.evaluate(run.best(), episodes=20).over_seeds())
    ```
    """

    of: str = static("return", help="what is compared, the mean over episodes: return, length or a metric of the task")
    larger_is_better: bool = static(True, help="whether the best is the largest. Of equal ones the first is kept")

    @property
    def settings(self) -> dict[str, Any]:
        least = {} if self.larger_is_better else {"keep_least": True}
        return super().settings | {"keep_best": self.of} | least

    def begin(self, task: Task, steps: int, every: int | None = None) -> None:
        choice("of", self.of, ("return", "length", *task.metric_names))
        super().begin(task, steps, every)

    def _judge(self, decision: int, found: EpisodeEvaluation, policies: Policy, memory: PyTree) -> None:
        value = found.means(self.of)
        new = {"policy": policies, **({} if memory is None else {"memory": memory})}
        new = {name: np.asarray(leaf) for name, leaf in numbers_of(new).items()}
        new |= {"value": value, "at": np.full(len(value), decision)}
        before = {name: self._found.get(f"best.{name}") for name in new}
        sign = 1.0 if self.larger_is_better else -1.0
        for name, leaf in new.items():
            old = before[name]
            known = before["value"]
            if old is not None and known is not None:
                better = np.isfinite(value) & ~(sign * value <= sign * known)  # also than one that is unknown
                leaf = np.where(better.reshape(-1, *[1] * (leaf.ndim - 1)), leaf, old)
            self._found[f"best.{name}"] = leaf


def evaluating_of(run: Mapping[str, Any]) -> EvaluationCallback | None:
    """The callback that a run's configuration, its table `run`, asks for; `None` without one."""
    if run.get("evaluate_every") is None:
        return None
    given = {name: run[f"evaluate_{name}"] for name in SETTINGS if f"evaluate_{name}" in run}
    if run.get("keep_best") is None:
        return EvaluationCallback(**given)
    return KeepBest(**given, of=run["keep_best"], larger_is_better=not run.get("keep_least", False))
