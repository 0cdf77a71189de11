"""The study of 24 independent muscles, and evaluation of frozen policies on any ground."""

import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import jax
import numpy as np

from motorgrad._errors import check, choice
from motorgrad.learning import Agent, Annealed
from motorgrad.policies import Policy
from motorgrad.schema import count, number
from motorgrad.tasks import Hexapod, Task
from motorgrad.training import Run, agent_for, evaluate, stepper_for
from motorgrad_thesis._experiment import Experiment, Values, Workspace, smoke

FULL = "the learner"
VARIANTS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    FULL: ({}, {}),
    "mirror tie": ({}, {"policy": "mirrored"}),
    # so much damping leaves the direction of the gradient unchanged; the limit on the divergence still sets its length
    "Euclidean": ({}, {"damping": 1e4, "learning_rate": 1e6}),
    "no critic": ({}, {"baseline": "mean"}),
    "no lag": ({"lag": 0}, {}),
    "seven inputs": ({"observes": ("lateral",)}, {}),
}
"""Changes by name: to the task, and to the learner."""

MODES: tuple[Literal["mode", "sample"], ...] = ("mode", "sample")
FRESH = 500_000_000
"""Added to the row numbers, so that policies are not judged on the random numbers of their training."""

SMOOTH = 40.0
"""Simulated seconds over which the speed during learning is averaged."""
ACTION_LABELS = {"mode": "most probable actions", "sample": "sampled actions"}
SETTLING = 2.0  # seconds that do not count


@dataclasses.dataclass(frozen=True)
class MuscleStudy(Experiment):
    """Base of experiments on hexapods that learn to walk on 24 muscles, with the task's own learner."""

    kind: ClassVar[type[Hexapod]] = Hexapod
    """The task."""
    first_seed: ClassVar[int] = 0
    """The seed of the first hexapod; the others follow."""

    updates: int = count(
        1200, 1, 100_000, help="number of updates of learners on 24 muscles, whose schedules scale with it"
    )
    seeds: int = count(10, 2, 1000, help="number of independent hexapods that learn on 24 muscles")
    watched: float = number(
        60.0, 20, 3600, unit="simulated s", help="length of the evaluation of the frozen policies, a multiple of 20"
    )

    def validate(self) -> None:
        super().validate()
        check(self.watched % 20 == 0, "watched", self.watched, "a multiple of 20 simulated s")

    quick = smoke(updates=4, seeds=2, watched=20.0)

    def task(self, variant: str = FULL) -> Hexapod:
        """The task of a variant."""
        choice("variant", variant, VARIANTS)
        return self.kind(**VARIANTS[variant][0])

    def learner(self, variant: str = FULL) -> Agent:
        """The task's own learner, with schedules that end after this many updates."""
        task = self.task(variant)
        own = agent_for(task)
        assert isinstance(own, Agent)
        annealed = own.estimator.entropy
        assert own.averaging is not None
        assert isinstance(annealed, Annealed)
        kept = self.updates * own.averaging.start // annealed.steps
        scaled = {
            "estimator.entropy.steps": self.updates,
            "metric.kl.steps": self.updates,
            "averaging.start": kept,
        }
        found = agent_for(task, **{**scaled, **VARIANTS[variant][1]})
        assert isinstance(found, Agent)
        return found

    def trained(self, work: Workspace, variant: str = FULL, seeds: int | None = None) -> Run:
        """Trained hexapods, shared with other experiments of the same settings."""
        settings = self.learner(variant)
        assert isinstance(settings.estimator.update_every, int)
        count = seeds or self.seeds
        steps = self.updates * settings.estimator.update_every
        # a count where seeds start from 0, because stored runs are found by it
        chosen = list(range(self.first_seed, self.first_seed + count)) if self.first_seed else count
        return work.train(self.task(variant), settings, steps, chosen)

    def judged(self, work: Workspace, run: Run, variant: str = FULL) -> Values:
        """Walks of frozen policies from a fresh start, by mode and quantity, a number or a word for each seed."""

        def watch(mode: Literal["mode", "sample"]) -> dict[str, Any]:
            outcome = evaluate(run, round(self.watched / run.task.period), mode=mode, threads=work.threads)
            return {**outcome.metrics, **outcome.motion_metrics}

        found: Values = {}
        for mode in MODES:
            seen = work.part(f"{variant} {mode}", lambda mode=mode: watch(mode))
            found |= {f"{variant} {mode} {name}": np.asarray(values) for name, values in seen.items()}
        return found


def frozen_readings(
    work: Workspace, policies: Policy, task: Task, seconds: float, mode: Literal["sample", "mode"], names: Sequence[str]
) -> dict[str, np.ndarray]:
    """Mean of each named reading over `seconds`, after the first two, for each of the `policies` along their leading
    axis, `(policies,)`."""
    count = len(jax.tree.leaves(policies)[0])
    agent = Agent(jax.tree.map(lambda leaf: leaf[0], policies))
    stepper = stepper_for(task, agent, [FRESH + row for row in range(count)], mode, work.threads)
    stepper.set_policies(policies)
    stepper.advance(round(SETTLING / task.period))
    stepper.harvest()
    stepper.advance(round(seconds / task.period))
    record = stepper.harvest()
    return {name: np.asarray(record[name], float) for name in names}
