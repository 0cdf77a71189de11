"""The study of learned gaits: the learner of section 5.3.4, its training and evaluation, and walks of the fixed
controller."""

import dataclasses
from typing import Any, ClassVar, Literal

import numpy as np

from motorgrad.bodies import Hexapod, walk
from motorgrad.learning import Learner
from motorgrad.schema import Range, count, number, static
from motorgrad.tasks import HexapodSynergy
from motorgrad.training import Evaluation, Run, agent_for, evaluate
from motorgrad_thesis._experiment import Experiment, Values, Workspace, smoke

GAITS = ("tripod", "pronk", "intermediate", "stalled")
MODES: tuple[Literal["sample", "mode"], ...] = ("sample", "mode")
START = 2.0  # seconds at the start of a walk that do not count towards its gait
INDEPENDENT = "an independent model of the hexapod"
JITTER = 1e-3
"""Relative variation of the servos' gain: negligible in itself, but sufficient for walks, which are chaotic, to
diverge."""


@dataclasses.dataclass(frozen=True)
class SynergyStudy(Experiment):
    """Base of experiments on hexapods that practise on four synergies, by default with the thesis's numbers."""

    reading: ClassVar[str] = (
        "The thesis has no lag between observation and action, so that only hexapods without one judge its "
        "statements. A gait counts as tripod or pronk by the phase and the correlation of the tripods; the "
        "bounds are ours."
    )

    seconds: float = number(600.0, 0, open_low=True, unit="simulated s", help="length of every hexapod's practice")
    seeds: int = count(20, 2, 10_000, help="number of independent hexapods with each lag")
    lags: tuple[int, ...] = static(
        (0, 1, 2),
        allowed=Range(0, 1_000, kind="int"),
        unit="decisions",
        help="delays of the observations, rising; the thesis has none",
    )
    decay: float = number(0.97, 0, 1, help="decay of the eligibility trace, per decision")
    rate: float = number(1e-3, 0, help="the step size of all parameters")
    watched: float = number(20.0, 20, 3600, unit="simulated s", help="length of the evaluation of the frozen policies")

    def validate(self) -> None:
        super().validate()
        self.check_rising("lags")
        self.check_least(seconds=50 * self.task(self.lags[0]).period)

    quick = smoke(seconds=6.0, seeds=2, lags=(0, 1))

    def task(self, lag: int) -> HexapodSynergy:
        """The task with observations delayed by this many decisions."""
        return HexapodSynergy(lag=lag)

    def learner(self, lag: int) -> Learner:
        """OLGARB on four hyperplanes."""
        return agent_for(self.task(lag), decay=self.decay, learning_rate=self.rate)

    def trained(self, work: Workspace, lag: int) -> Run:
        """Trained hexapods, shared with other experiments of the same settings."""
        task = self.task(lag)
        return work.train(task, self.learner(lag), round(self.seconds / task.period), self.seeds)

    def watch(self, work: Workspace, run: Run, mode: Literal["sample", "mode"]) -> Evaluation:
        """Evaluate the policies of all seeds from a fresh start, without learning."""
        return evaluate(run, round(self.watched / run.task.period), mode=mode, threads=work.threads)


def controller_speeds(work: Workspace, seconds: float) -> Values:
    """Speeds of the fixed controller on level ground after its start, (1,) each, in m/s: `speed` along the heading and
    `net` displacement over time."""

    def measure() -> dict[str, Any]:
        gait = walk(Hexapod(drive="servos"), seconds=seconds + START, threads=work.threads).gait(since=START)
        return {"speed": gait.speed, "net": gait.net}

    return work.part("fixed controller", measure)


def gait_readings(outcome: Evaluation) -> dict[str, np.ndarray]:
    """Results of an evaluation for each seed: `speed`, `net`, `stalls` and `falls` as the task reports them, `gait` and
    its measures."""
    return {**outcome.metrics, **outcome.motion_metrics}


def jittered_hexapods(count: int) -> list[Hexapod]:
    """Hexapods with servos that differ only by tiny variations of the servos' gain: their walks sample the spread due
    to chaos."""
    gains = 1.0 + JITTER * np.random.default_rng(0).uniform(-1.0, 1.0, count)
    body = Hexapod(drive="servos")
    return [dataclasses.replace(body, servo_gain=body.servo_gain * float(gain)) for gain in gains]
