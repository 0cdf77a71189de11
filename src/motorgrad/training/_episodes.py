"""Evaluation by episodes: the return and the length of every one, with intervals."""

import dataclasses
import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
import pyarrow as pa
from jaxtyping import Bool, Float, Int, PyTree

from motorgrad._errors import check, check_integer, choice, counted
from motorgrad.learning import Agent
from motorgrad.policies import Policy, trainable
from motorgrad.statistics import LEVEL, Measured, mean_of
from motorgrad.tasks import HostTask, Task
from motorgrad.training._broken import lanes_in_words, not_finite
from motorgrad.training.engines import MAX_TALLY_DECISIONS, Mode, stepper_for
from motorgrad.training.store import RunWarning

FRESH = 1_000_000_000
"""Added to seeds, so that a policy is not evaluated on the random numbers it learned from."""
MAX_EPISODES = 1_000_000
"""Of one policy."""
MAX_EPISODE_DECISIONS = 100_000
"""Decisions after which an episode of a task without a limit is cut."""
TOGETHER = 256
"""Episodes at once, each in dynamics of its own."""
MAX_PARAMETERS_AT_ONCE = 2**26
"""Every episode has a copy of its policy: 256 MiB."""
AT_ONCE = {True: 16, False: 128}
"""Decisions between two looks at what is over: on the host each costs a step of the dynamics; in a compiled world few
cost as much as a block of random numbers."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class EpisodeEvaluation:
    """The behaviour of the policies of a run in whole episodes, without learning.

    In a sweep, `policies` are all seeds of the first setting, then those of the second …

    - `returns`: the sum of the rewards of each episode, not discounted, `(policies, episodes)`; NaN of a policy that is
      not finite.
    - `lengths`: its decisions, `(policies, episodes)`.
    - `metrics`: the mean of each of the task's metrics in each episode, `(policies, episodes)`; NaN where it did not
      occur.
    - `diverged`: which ended because the simulation diverged, `(policies, episodes)`: the last reward is unknown, and
      not in the return.
    - `cut`: which were not over when evaluation ended, `(policies, episodes)`: their returns are those so far.
    - `seeds`: the seed of each policy; `settings`: in a sweep, the number of the setting of each; empty otherwise.
    """

    returns: Float[np.ndarray, "policies episodes"]
    lengths: Int[np.ndarray, "policies episodes"]
    metrics: dict[str, Float[np.ndarray, "policies episodes"]]
    diverged: Bool[np.ndarray, "policies episodes"]
    cut: Bool[np.ndarray, "policies episodes"]
    seeds: list[int]
    settings: list[int] = dataclasses.field(default_factory=list)

    def __repr__(self) -> str:
        policies, episodes = self.returns.shape
        of = f"each of {policies:,} policies" if policies > 1 else "one policy"
        means = "" if self.settings else f"; return {self.in_words('return')}; length {self.in_words('length')}"
        return f"EpisodeEvaluation({counted(episodes, 'episode')} of {of}{means})"

    @property
    def others(self) -> list[str]:
        """The names of the metrics beside return and length, which some tasks read themselves, too."""
        return [name for name in self.metrics if name not in ("return", "length")]

    def values(self, quantity: str = "return") -> Float[np.ndarray, "policies episodes"]:
        """The values of every episode: `"return"`, `"length"` or a metric of the task. **Raises** `ValueError`."""
        known = {**self.metrics, "return": self.returns, "length": self.lengths}
        choice("quantity", quantity, known)
        return np.asarray(known[quantity], float)

    def means(self, quantity: str = "return") -> Float[np.ndarray, " policies"]:
        """The mean over the episodes of each policy; NaN where the quantity did not occur."""
        values = self.values(quantity)
        known = np.isfinite(values)
        with np.errstate(invalid="ignore"):
            return np.where(known, values, 0.0).sum(axis=1) / known.sum(axis=1)

    def over_seeds(self, quantity: str = "return", level: float = LEVEL) -> Measured:
        """The mean over seeds of their means over episodes, with Student's interval over the seeds.

        What is learned differs from seed to seed, so the seeds are the sample, however many episodes each has: more
        episodes make each seed's mean more exact, and say nothing of further seeds. Of a single seed the interval is
        unbounded. Seeds whose mean is unknown are left out of the `count`. **Raises** `ValueError` for a sweep: use
        `run.split()`.
        """
        check(not self.settings, "over_seeds", self, "of a run of one setting: evaluate run.split()[0]")
        means = self.means(quantity)
        return _mean(means[np.isfinite(means)], level)

    def over_episodes(self, quantity: str = "return", level: float = LEVEL) -> list[Measured]:
        """The mean of each policy with Student's interval over its episodes: how well that one policy is known."""
        return [_mean(values[np.isfinite(values)], level) for values in self.values(quantity)]

    def in_words(self, quantity: str = "return") -> str:
        """The mean in words, with the interval over seeds, or of a single one over its episodes, and which it is."""
        if len(self.seeds) > 1:
            return f"{self.over_seeds(quantity)} seeds"
        return f"{self.over_episodes(quantity)[0]} episodes (of one policy: it says nothing of other seeds)"

    @property
    def table(self) -> pa.Table:
        """One row for each episode: `seed`, in a sweep `setting`, `episode`, `return`, `length`, whether it `diverged`
        or was `cut`, and the metrics."""
        policies, episodes = self.returns.shape
        columns: dict[str, Any] = {"seed": np.repeat(self.seeds, episodes)}
        if self.settings:
            columns["setting"] = np.repeat(self.settings, episodes)
        columns |= {
            "episode": np.tile(np.arange(episodes), policies),
            "return": self.returns.ravel(),
            "length": self.lengths.ravel(),
            "diverged": self.diverged.ravel(),
            "cut": self.cut.ravel(),
        }
        return pa.table(columns | {name: each.ravel() for name, each in self.metrics.items() if name not in columns})


def _mean(known: np.ndarray, level: float) -> Measured:
    return mean_of(known, level) if len(known) else Measured(math.nan, math.nan, math.nan, 0, "mean", level)


def evaluation_seeds(seeds: list[int], seed: int, episodes: int) -> Int[np.ndarray, "policies episodes"]:
    """The seeds of all episodes: those of each policy follow each other from a place that `seed` and its own give."""
    starts = [np.random.SeedSequence([seed, own]).generate_state(1)[0] for own in seeds]
    return FRESH + (np.array(starts, np.int64)[:, None] + np.arange(episodes)) % (2**31 - FRESH)


def decision_seeds(seeds: list[int], seed: int) -> list[int]:
    """The seeds of evaluations of a number of decisions, one for each policy."""
    if seed:
        return evaluation_seeds(seeds, seed, 1)[:, 0].tolist()
    return [(own + FRESH) % 2**31 for own in seeds]  # as before evaluations had a `seed`


def evaluate_episodes(
    task: Task,
    policies: Policy,
    memory: PyTree,
    seeds: list[int],
    episodes: int,
    *,
    seed: int = 0,
    mode: Mode = "sample",
    threads: int = 0,
    longest: int | None = None,
    settings: Sequence[Mapping[str, float]] = (),
) -> EpisodeEvaluation:
    """Evaluate policies, with the memory of the task with which they were learned, in whole episodes, cut after
    `longest` decisions. Other arguments are as of `evaluate`; `policies` and `memory` lead with `settings` and `seeds`,
    as in a `Run`. Each episode is the first of dynamics of its own, with random numbers of its own. So no episode is
    counted because it was short enough to end in time, as in a given number of decisions."""
    check_integer("episodes", episodes, 1, MAX_EPISODES)
    check_integer("seed", seed, 0, 2**31 - 1)
    check(task.has_episodes, "episodes", episodes, f"None for the task {task.name!r}, which has none; give it a limit")
    own = task.longest_episode
    longest = min(own or MAX_EPISODE_DECISIONS, MAX_TALLY_DECISIONS) if longest is None else longest
    every = list(seeds) * max(1, len(settings))
    numbers = sum(np.size(leaf) for leaf in jax.tree.leaves(trainable(policies))) // len(every)
    lanes = np.repeat(np.arange(len(every)), episodes)
    chosen = evaluation_seeds(every, seed, episodes).ravel()
    parts = -(-len(lanes) // max(1, min(TOGETHER, MAX_PARAMETERS_AT_ONCE // max(numbers, 1))))
    size = -(-len(lanes) // parts)
    found = []
    for first in range(0, len(lanes), size):
        # the last part is filled up, as one of another size would be another program
        rows = np.arange(first, first + size) % len(lanes)
        part = _first_episodes(task, policies, memory, lanes[rows], chosen[rows].tolist(), mode, threads, longest)
        found.append({name: values[: len(lanes) - first] for name, values in part.items()})
    table = {name: np.concatenate([part[name] for part in found]).reshape(len(every), episodes) for name in found[0]}
    cut = table["episodes"] == 0
    if (broken := not_finite(policies)).any():
        said = lanes_in_words(broken, seeds, settings)
        message = f"{said}: parameters that are not finite; nothing is said of them (NaN)"
        warnings.warn(message, RunWarning, stacklevel=3)
    unknown = broken[:, None] & np.ones(episodes, bool)
    if (short := cut & ~unknown).any():
        warnings.warn(
            f"{short.sum():,} of {cut.size:,} episodes were not over after {longest:,} decisions: their returns and "
            "lengths are those so far (`cut`); give more steps, or the task a time limit",
            RunWarning,
            stacklevel=3,
        )
    return EpisodeEvaluation(
        np.where(unknown, np.nan, table["reward"].astype(float)),
        table["decisions"].astype(np.int64),
        {name: np.where(unknown, np.nan, table[name].astype(float)) for name in task.metric_names},
        table["diverged"] > 0 if "diverged" in table else np.zeros(cut.shape, bool),
        cut,
        every,
        np.repeat(np.arange(len(settings)), len(seeds)).tolist(),
    )


def _first_episodes(
    task: Task,
    policies: Policy,
    memory: PyTree,
    lanes: np.ndarray,
    seeds: list[int],
    mode: Mode,
    threads: int,
    longest: int,
) -> dict[str, np.ndarray]:
    """What happened in the first episode of the policies of these `lanes`, by name."""

    def copied(tree: PyTree) -> PyTree:
        return jax.tree.map(lambda leaf: np.asarray(leaf)[lanes], tree)

    agent = Agent(jax.tree.map(lambda leaf: leaf[0], policies))
    stepper = stepper_for(task, agent, seeds, mode, threads, first_episode=True)
    stepper.set_policies(copied(policies), None if memory is None else copied(memory))
    cycle: Any = stepper.cycle  # type: ignore[attr-defined]
    counted_so_far = stepper.viewer(lambda now, state: cycle.read_tally(now.tally))
    at_once = AT_ONCE[isinstance(task, HostTask)]
    found = counted_so_far()
    while stepper.decision < longest and not (found["episodes"] > 0).all():
        stepper.advance(min(at_once, longest - stepper.decision))
        found = counted_so_far()
    return {name: values for name, values in found.items() if not name.endswith("_count")}
