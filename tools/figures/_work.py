"""Where figures that are measured get their runs from."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import motorgrad as mg
from motorgrad.learning import Learner
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from motorgrad.training import stepper_for
from motorgrad.worlds import FiniteMDP, oracle


@dataclasses.dataclass(frozen=True)
class Work:
    """How much is done for figures that are measured.

    **Arguments:** `most`, decisions per seed, where figures want more; `runs`, a folder that keeps the long runs.
    """

    most: int = 2**31
    runs: Path | None = None

    def train(self, task: Task | str, agent: Learner | None, steps: int, seeds: int, keep: str = "") -> mg.Run:
        """A trained run; under the name `keep` it stays in the folder of runs, and is not made again."""
        out = self.runs / keep if self.runs and keep else None
        steps = min(steps, self.most)
        run = mg.train(task, agent, steps, seeds, out, window=None if keep else max(1, steps // 100), progress=False)
        if not run.complete:
            raise KeyboardInterrupt
        return run

    def lengths(self, *lengths: int) -> list[int]:
        """Of these numbers of decisions those that are allowed, at least the first."""
        return [length for length in lengths if length <= max(self.most, lengths[0])]


def errors(agent: Learner, task: Task, mdp: FiniteMDP, lengths: Sequence[int], seeds: int) -> np.ndarray:
    """How far estimates are from the exact gradient, relative to its length: `(lengths, seeds)`."""
    assert isinstance(agent.policy, Policy)
    exact = oracle.flat(oracle.gradient(mdp, agent.policy))
    stepper = stepper_for(task, agent, range(seeds))
    found = []
    for length in lengths:
        stepper.advance(length - stepper.decision)
        mean = stepper.state["cycle"].agent.gradient.mean
        estimate = np.asarray(mean.weights, float).reshape(seeds, -1)
        found.append(np.linalg.norm(estimate - exact, axis=1) / np.linalg.norm(exact))
    return np.array(found)
