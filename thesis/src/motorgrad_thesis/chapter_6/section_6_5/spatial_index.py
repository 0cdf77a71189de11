"""Section 6.5.4: local units in a spatial index, of which a decision evaluates only few."""

import time
from collections.abc import Iterator
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.learning import Learner, SpatialIndex
from motorgrad.policies import LocalGaussians, trainable
from motorgrad.schema import Range, count, static
from motorgrad.statistics import difference_of, exact, mean_of, median_of
from motorgrad.tasks import FallingParticle
from motorgrad.training import agent_for, stepper_for
from motorgrad_thesis._claims import Claim, at_least, at_most, below, positive, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import STYLE, Figure, subplots
from motorgrad_thesis.chapter_6._local_study import EXACT_READ

OVERLAP = 0.64  # width of a unit in spacings, as for 32 units of width 0.16, two to a place
METHOD_LABELS = {"dense": "all units", "indexed": "those that can fire"}
TIMES = 8.0


SUBDIVIDED = "With a subdivision of space, a decision costs little although there are many units."


@experiment("sec-6.5.4-index", "a spatial index for local units", "section 6.5.4")
class Index(Experiment):
    """The cost of a decision with up to thousands of local units, if all of them are evaluated, and if only those that
    can fire at the observation are; and the learning of both.

    The falling particle in R1, with units on a regular grid, two to a place. Widths are proportional to the spacing, so
    that equally many units can fire anywhere, regardless of their number, and step sizes of centres are proportional to
    the square of the widths. Costs include everything: random draws, tables, the particle. They are measured over
    stretches of learning of one seed, alternating between the two learners.
    """

    reading: ClassVar[str] = EXACT_READ

    sizes: tuple[int, ...] = static(
        (16, 64, 256, 1024, 4096),
        allowed=Range(4, 8192, kind="int"),
        unit="units",
        help="sizes of the pools whose cost is measured, rising",
    )
    pairs: int = count(7, 1, 20, help="number of pairs of stretches for each size, one of either learner")
    decisions: int = count(10_000, 200, 10**7, help="number of decisions of each stretch")
    units: int = count(256, 16, 8192, help="number of units of the pools whose learning is compared")
    seeds: int = count(24, 2, 1000, help="number of seeds of either learner")
    steps: int = count(100_000, 200, 10**8, help="number of decisions of each of these learners")

    def validate(self) -> None:
        super().validate()
        self.check_rising("sizes")

    quick = smoke(sizes=(16, 64), pairs=1, decisions=400, units=64, seeds=2, steps=400)

    def run(self, work: Workspace) -> Values:
        found: Values = {"sizes": np.array(self.sizes)}
        found |= work.part("cost", self._costs)
        runs = {kind: work.train(*_learner(self.units, kind), self.steps, self.seeds) for kind in METHOD_LABELS}
        for kind, run in runs.items():
            found["decision"], found[f"{kind}_reward"] = run.curve()
        learned = runs["indexed"]
        found |= work.part("neglect", lambda: _neglect(learned.initial, learned.policies))
        return found

    def _costs(self) -> dict[str, Any]:
        """Microseconds per decision, by learner, size and pair."""
        cost = {kind: np.zeros((len(self.sizes), self.pairs)) for kind in METHOD_LABELS}
        for row, size in enumerate(self.sizes):
            steppers = {}
            for kind in METHOD_LABELS:
                task, agent = _learner(size, kind)
                steppers[kind] = stepper_for(task, agent, [0])
                steppers[kind].advance(self.decisions // 2)  # compile, and skip the start
            for pair in range(self.pairs):
                for kind, stepper in steppers.items():
                    start = time.perf_counter()
                    stepper.advance(self.decisions)
                    cost[kind][row, pair] = 1e6 * (time.perf_counter() - start) / self.decisions
        return {f"{kind}_cost": values for kind, values in cost.items()}

    def figure(self, values: Values) -> Figure:
        import matplotlib as mpl

        with mpl.rc_context(STYLE):
            figure, (left, right) = subplots(9, 3.8, 1, 2)
            for kind, colour in zip(METHOD_LABELS, ("#777777", "#3b6fb6"), strict=True):
                cost = values[f"{kind}_cost"]
                middle = np.median(cost, axis=1)
                spread = np.abs(np.stack([cost.min(axis=1), cost.max(axis=1)]) - middle)
                left.errorbar(
                    values["sizes"], middle, spread, color=colour, marker="o", ms=4, label=METHOD_LABELS[kind]
                )
                reward = values[f"{kind}_reward"]
                decision = values["decision"] / 1000
                low, high = np.quantile(reward, (0.25, 0.75), axis=0)
                right.fill_between(decision, low, high, color=colour, alpha=0.25, lw=0)
                right.plot(decision, np.median(reward, axis=0), color=colour, label=METHOD_LABELS[kind])
            left.set(xscale="log", yscale="log", xlabel="units", ylabel="µs per decision, one seed")
            left.set_xticks(values["sizes"], [f"{size:,}" for size in values["sizes"]])
            left.minorticks_off()
            left.legend(title="evaluated per decision")
            right.set(xlabel="thousand decisions", ylabel="reward per decision", title=f"{self.units} units")
            right.legend()
            return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        yield at_least(
            TIMES,
            f"With {values['sizes'][-1]:,} units, a decision costs less if only the units that can fire are evaluated.",
            median_of(values["dense_cost"][-1] / values["indexed_cost"][-1]),
            "factor, including random draws and tables,",
            note="Ratio of each pair of stretches, one after the other on one machine.",
            of=SUBDIVIDED,
        )
        yield self._growth(values)
        yield from self._learning(values)
        yield at_most(
            float(values["bound"]) * (1 + 1e-4),
            "Wherever units have moved, no unit would fire with more than the neglected probability where it is not "
            "listed.",
            exact(values["worst"]),
            note=f"On average, {float(values['missed']):.2g} units per decision would have fired and could not.",
            kind="extension",
        )

    def _growth(self, values: Values) -> Claim:
        """From the size at which the neighbourhood of a place is full."""
        kept = values["sizes"] >= 256
        power = exact(np.nan)
        if kept.sum() > 1:
            power = median_of(np.polyfit(np.log(values["sizes"][kept]), np.log(values["indexed_cost"][kept]), 1)[0])
        said = "From 256 units on, the cost of a decision grows far more slowly than the number of units."
        return below(0.5, said, power, "power of the number of units", of=SUBDIVIDED)

    def _learning(self, values: Values) -> Iterator[Claim]:
        last = values["decision"] > 0.75 * values["decision"][-1]
        first = values["decision"] <= 0.05 * values["decision"][-1]
        dense, indexed = (values[f"{kind}_reward"] for kind in METHOD_LABELS)
        ends = [reward[:, last].mean(axis=1) for reward in (dense, indexed)]
        rise = mean_of(ends[0] - dense[:, first].mean(axis=1))
        tenth = 0.1 * rise.value
        yield positive("Reward is learned.", rise, "rise", "reward", kind="extension")
        yield within(
            -tenth,
            tenth,
            "The indexed learner reaches the same reward as the one that evaluates all units.",
            difference_of(ends[1], ends[0]),
            "difference, against a tenth of the learned reward,",
            "reward",
            kind="extension",
        )


def _learner(units: int, kind: str) -> tuple[FallingParticle, Learner]:
    task = FallingParticle(units=units)
    width = OVERLAP / np.sqrt(units / 2)
    return task, agent_for(
        task,
        policy={"copies": 2, "width": float(width), "least_log_width": -8.0},
        learning_rate={"centre": 2e-4 * float(width / 0.16) ** 2, "log_width": 8e-4},
        kind="sparse" if kind == "indexed" else "policy-gradient",
    )


def _neglect(initial: Any, learned: Any, samples: int = 20_000) -> dict[str, Any]:
    """Firing of units where they are not listed, after they have moved from the places for which the table was made, on
    the way to what they learned, as far as their margins permit: the greatest probability, and the mean number that
    would fire."""
    index = SpatialIndex()
    rng = np.random.default_rng(0)
    worst = 0.0
    missed = []
    for seed in range(len(learned.centre)):
        before, after = (jax.tree.map(lambda leaf, seed=seed: leaf[seed], pools) for pools in (initial, learned))
        pool = _moved(index, before, after)
        low, size = map(jnp.asarray, index.grid(before))
        table = index.table(before, np.asarray(low), np.asarray(size))
        units = len(before.centre)
        seen = jnp.asarray(rng.uniform(0, 1, (samples // len(learned.centre), 2)), np.float32)
        p = np.asarray(jax.vmap(pool.prob)(seen))
        cells = np.asarray(jax.vmap(index.cell, (0, None, None, None))(seen, low, size, units))
        listed = np.zeros((len(table), units + 1), bool)
        np.put_along_axis(listed, table, True, axis=1)
        hidden = np.where(listed[cells, :-1], 0, p)
        worst = max(worst, float(hidden.max()))
        missed.append(hidden.sum(axis=1).mean())
    return {"worst": worst, "missed": np.mean(missed), "bound": index.neglect}


def _moved(index: SpatialIndex, before: LocalGaussians, after: LocalGaussians) -> LocalGaussians:
    """Every unit on its way from one pool to another, as far as its margin permits, to within one percent."""
    step = jax.tree.map(lambda new, old: new - old, trainable(after), trainable(before))
    part = np.ones((len(before.centre), 1), np.float32)
    pool = after
    for _ in range(1000):
        pool = eqx.apply_updates(before, jax.tree.map(lambda leaf: part * leaf, step))
        far = np.asarray(index.strain(before, pool)) > 1
        if not far.any():
            break
        part[far] *= 0.99
    return pool
