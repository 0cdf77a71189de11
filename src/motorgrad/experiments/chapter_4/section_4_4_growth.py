"""Section 4.4: pools that grow one unit at a time."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim, exact, median_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_4._growth_figure import draw_growth
from motorgrad.experiments.chapter_4._pools import NATURAL
from motorgrad.policies import Motoneurons, Policy, grow
from motorgrad.tasks import LinearRecruitment, spacing_error
from motorgrad.training import Run, settings_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Way(NamedTuple):
    """A way to learn: what the force is, the learner's settings, how many units at the end, decisions with each."""

    words: str
    output: Any
    changes: Mapping[str, Any]
    units: int
    phase: int


@dataclasses.dataclass(frozen=True)
class Growth(Experiment):
    """A pool begins with one unit and gets another after a fixed number of decisions, with gain 0 and a threshold at
    random, until it is complete. Beside it a pool that has all its units from the start, and as many decisions in all.

    **Arguments:**

    - `units`: in the complete pools that learn by the natural gradient.
    - `phase` (decisions): with each number of units, by the natural gradient.
    - `plain_units`: in the complete pools that learn by the plain gradient.
    - `plain_phase` (decisions): with each number of units, by the plain gradient.
    - `ratio_rate`: the step size where the force is a ratio.
    - `seeds`: pools of each kind.
    """

    name: ClassVar[str] = "sec-4.4-growth"
    title: ClassVar[str] = "a pool that grows"
    source: ClassVar[str] = "section 4.4"

    units: int = 8
    phase: int = 100_000
    plain_units: int = 4
    plain_phase: int = 800_000
    ratio_rate: float = 3e-3
    seeds: int = 24

    def __post_init__(self) -> None:
        for name in ("units", "plain_units"):
            check(3 <= getattr(self, name) <= 64, name, getattr(self, name), "in 3 … 64")
        for name in ("phase", "plain_phase"):
            check(200 <= getattr(self, name) <= 10**8, name, getattr(self, name), "in 200 … 100,000,000")
        check(0 < self.ratio_rate < 1, "ratio_rate", self.ratio_rate, "above 0 and below 1")
        check(2 <= self.seeds <= 10_000, "seeds", self.seeds, "in 2 … 10,000")

    @classmethod
    def quick(cls) -> Self:
        return cls(units=3, phase=400, plain_units=3, plain_phase=400, seeds=3)

    @property
    def ways(self) -> dict[str, Way]:
        """Every way to learn, by name."""
        ratio = {**NATURAL, "rate": self.ratio_rate}
        return {
            "ratio": Way("natural gradient, force as a ratio", "ratio", ratio, self.units, self.phase),
            "count": Way("natural gradient, force as a count", "count", NATURAL, self.units, self.phase),
            "plain": Way("plain gradient, force as a count", "count", {}, self.plain_units, self.plain_phase),
        }

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, way in self.ways.items():
            found |= {f"{name} {key}": value for key, value in self._compared(work, way).items()}
        return found

    def _compared(self, work: Workspace, way: Way) -> Values:
        task = LinearRecruitment(units=way.units, output=way.output)
        whole = work.train(task, settings_for(task, **way.changes), way.units * way.phase, self.seeds)
        phases = self._grown(work, way)
        decision, error = whole.curve("error")
        pairs = [run.curve("error") for run in phases]
        thresholds = [np.asarray(run.policies.threshold) for run in phases]  # type: ignore[attr-defined]
        starts = [np.asarray(run.initial.threshold) for run in phases[1:]]  # type: ignore[attr-defined]
        spacings = [spacing_error(y, run.task) for y, run in zip(thresholds, phases, strict=True)]  # type: ignore[arg-type]
        return {
            "start decision": decision,
            "start error": error,
            "start spacing": spacing_error(whole.policies.threshold, task),  # type: ignore[attr-defined]
            "grown decision": np.concatenate([n * way.phase + pair[0] for n, pair in enumerate(pairs)]),
            "grown error": np.concatenate([pair[1] for pair in pairs], axis=1),
            "grown spacing": np.stack(spacings),
            "grown gain": np.asarray(phases[-1].policies.gain),  # type: ignore[attr-defined]
            "move": np.stack(
                [np.abs(y - x)[:, :-1].mean(1) * task.slope for x, y in zip(starts, thresholds[1:], strict=True)]
            ),
        }

    def _grown(self, work: Workspace, way: Way) -> list[Run]:
        runs: list[Run] = []
        for count in range(1, way.units + 1):
            task = LinearRecruitment(units=count, output=way.output)
            initial = with_another(runs[-1].policies, count) if runs else None
            runs.append(work.train(task, settings_for(task, **way.changes), way.phase, self.seeds, initial))
        return runs

    def figure(self, values: Values) -> "Figure":
        return draw_growth(values, {name: way.words for name, way in self.ways.items()})

    def claims(self, values: Values) -> Sequence[Claim]:
        made = []
        for name, way in self.ways.items():
            better = median_of(values[f"{name} grown error"].mean(1) / values[f"{name} start error"].mean(1))
            spaced = median_of(values[f"{name} grown spacing"][-1] / values[f"{name} start spacing"])
            made += [
                Claim(
                    f"Growing is the better strategy: less error on the way ({way.words}).",
                    "section 4.4",
                    "mean error over all decisions, by that of a pool complete from the start: below 1, with its "
                    "interval",
                    better,
                    better.high < 1,
                    note=f"{way.units} units, {way.units * way.phase:,} decisions.",
                ),
                Claim(
                    f"Growing is the better strategy: nearer to equal spacing in the end ({way.words}).",
                    "section 4.4",
                    "spacing error, by that of a pool complete from the start: below 1, with its interval",
                    spaced,
                    spaced.high < 1,
                ),
            ]
        moves = values["ratio move"]
        counts = np.arange(1, moves.shape[0] + 1)
        least = median_of(moves[-1] / moves[0])
        ideal = [ideal_move(int(count)) * count * (count + 1) for count in counts]
        note = "For ideal thresholds: " + ", ".join(
            f"{count} → {count + 1}: {move:.2f}" for count, move in zip(counts, ideal, strict=True)
        )
        return [
            *made,
            Claim(
                "Each additional unit forces the older thresholds to move less than the last (force as a ratio).",
                "section 4.4",
                "mean move with the last unit, by that with the second: below 1, with its interval",
                least,
                least.high < 1,
            ),
            Claim(
                "To make room for another unit each of N thresholds moves by 1/(N(N + 1)) of the input.",
                "section 4.4",
                f"mean move of equally spaced thresholds for N = {counts[-1]}, in that unit: 1, to 25 %",
                exact(ideal[-1]),
                abs(ideal[-1] - 1) <= 0.25,
                "1/(N(N + 1))",
                f"By so much the spacing changes; thresholds in the middle add up several such changes. {note}.",
            ),
        ]


def with_another(pools: Policy, salt: int) -> Motoneurons:
    """The pools of all seeds, each with one more unit of gain 0 and a threshold from U[0, 1], by the `salt`."""
    count = jax.tree.leaves(pools)[0].shape[0]
    thresholds = jnp.asarray(np.random.default_rng([salt, count]).random(count), jnp.float32)
    return jax.vmap(lambda pool, y: grow(pool, Motoneurons(y[None], jnp.zeros(1))))(pools, thresholds)


def ideal_move(count: int) -> float:
    """The mean distance by which equally spaced thresholds must move to make room for one more at the best place, as a
    part of the range: from (i − ½)/N to (i − ½)/(N + 1), or (i + ½)/(N + 1) above the new one."""
    place = np.arange(1, count + 1)
    before = (place - 0.5) / count
    return min(float(np.abs((place - 0.5 + (place > new)) / (count + 1) - before).mean()) for new in range(count + 1))
