"""The demonstration: train hoppers, evaluate them before and after, film them, and report what they learned."""

import dataclasses
import math
import time
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad._errors import check
from motorgrad.tasks import Hopper
from motorgrad.training import Evaluation, Run, agent_for, evaluate, train
from motorgrad_thesis.chapter_5.figure_5_3 import behaviour_figure
from timsim import motion_of, write_film


@dataclasses.dataclass(frozen=True)
class Demonstration:
    """Results of a demonstration: the run, its evaluations before and after learning, and its files by name."""

    run: Run
    before: Evaluation
    after: Evaluation
    files: dict[str, Path]
    notes: list[str]
    seconds: float


def demonstrate(out: Path | str, seconds: float = 1200.0, seeds: int = 8, film_seconds: float = 8.0) -> Demonstration:
    """Train hoppers for `seconds` of simulated time each. Write the learning curve, the behaviour before and after
    (figure 5.3 of the thesis) and a film of both into the run directory `out`. A run found there is resumed."""
    started = time.monotonic()
    task = Hopper()
    check(task.period <= seconds < math.inf, "seconds", seconds, f"at least one decision, {task.period} s")
    steps = round(seconds / task.period)
    run = train(task, agent_for(task), steps, seeds, out)
    before, after = (evaluate(run, 2000, untrained=untrained) for untrained in (True, False))
    # the median seed, not the best: a figure should show what to expect
    order = np.argsort(np.nan_to_num(after.metrics["apex"]))
    shown = run.seeds[int(order[len(order) // 2])]
    figures = Path(out) / "figures"
    files = {
        "learning curve": figures / "learning-curve.png",
        "behaviour before and after": figures / "behaviour.png",
        "film before and after": figures / "before-after.mp4",
    }
    run.plot("apex", files["learning curve"])
    behaviour_figure(run, before, after, shown, files["behaviour before and after"])
    motions = [
        motion_of(run, outcome, shown, label, film_seconds)
        for outcome, label in ((before, "before learning"), (after, "after learning"))
    ]
    made = write_film(motions, files["film before and after"])
    return Demonstration(run, before, after, files, [made.note] if made.note else [], time.monotonic() - started)


def in_words(shown: Demonstration) -> list[str]:
    """What was learned, as lines of text."""

    def apex(outcome: Evaluation) -> str:
        values = np.nan_to_num(outcome.metrics["apex"])
        low, median, high = np.percentile(values, [25, 50, 75])
        return f"{median:.2f} m (quartiles {low:.2f} … {high:.2f})"

    weights: Any = shown.run.policies
    contact = np.sign(weights.weights[:, :, 0]).astype(int)
    seeds = len(contact)
    return [
        f"{seeds} hoppers practised for {shown.run.decision * shown.run.task.period:,.0f} simulated seconds each.",
        f"Height of a hop, foot above the floor: {apex(shown.before)} before, {apex(shown.after)} after learning.",
        f"On the ground the extensors now fire more than in the air in {np.sum(contact[:, 1] > 0)} of {seeds}, "
        f"the flexors less in {np.sum(contact[:, 0] < 0)} of {seeds}.",
    ]
