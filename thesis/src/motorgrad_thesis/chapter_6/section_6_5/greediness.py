"""Section 6.5.3: a task that takes several units at once, and a penalty on their use."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from motorgrad.learning import Learner
from motorgrad.schema import Range, count, static
from motorgrad.statistics import mean_of, share_of
from motorgrad.tasks import FallingParticle, Region
from motorgrad.training import agent_for
from motorgrad.worlds import ParticlePhysics, ParticleStart
from motorgrad_thesis._claims import Claim, more_than_half, negative, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, new_figure
from motorgrad_thesis.chapter_6._local_study import EXACT_READ, draw_tile, median_row, policy_at, prefixed, stored_paths
from motorgrad_thesis.chapter_6.section_6_5._falls import falls

FORCE = 0.1  # of every unit, to the right
GOAL: Region = (3.0, 0.78, 0.2, 0.1, 0.1)
START = ParticleStart(x=(0.05, 0.15), y=(0.9, 1.0))
"""A fall with one unit that always pushes ends near x = 0.5, with two near 0.85."""

HEIGHT = 0.9  # of every unit
GROWTH = {"width": 1.0, "cutoff": 0.4, "shrink": 0.9998}
RATES = {"grown": {"centre": 1e-4, "log_width": 5e-4}, "fixed": {"centre": 2e-4, "log_width": 8e-4}}
USED = 0.05  # firings per fall of a unit that is in use
DRAWN = 8  # paths in each picture
WAYS = {"grown": "added one by one", "fixed": "present from the start"}
STYLES = {"grown": "C2", "fixed": "C0"}


@experiment("sec-6.5.3-greediness", "units that pay only together", "section 6.5.3")
class Greediness(Experiment):
    """A particle falls from the top left; the reward at the lower right is in reach of two units that push together,
    not of one. Units are added one by one, or all of them are there from the start, in the middle and as wide as grown
    ones have shrunk; without a penalty on every firing, and with one.
    """

    reading: ClassVar[str] = f"The thesis names no task; this one and its penalty are ours. {EXACT_READ}"

    units: int = count(4, 2, 1_000, help="number of units")
    interval: int = count(20_000, 5_000, 10**7, help="number of decisions from one added unit to the next")
    penalties: tuple[float, ...] = static(
        (0.02, 0.1), allowed=Range(0, 1, open_low=True), help="costs of a firing, per decision, rising, beside none"
    )
    seeds: int = count(20, 2, 10_000, help="number of learners of each kind")
    looks: int = count(200, 1, 10**5, help="number of falls of every learned policy")

    def validate(self) -> None:
        super().validate()
        self.check_rising("penalties")

    quick = smoke(units=2, interval=5_000, seeds=3, looks=10, penalties=(0.1,))

    @property
    def decisions(self) -> int:
        """Decisions of learning: one interval for each unit, and one more."""
        return self.interval * (self.units + 1)

    @property
    def costs(self) -> tuple[float, ...]:
        """No penalty, and the others."""
        return (0.0, *self.penalties)

    def task(self, penalty: float, **changes: Any) -> FallingParticle:
        return FallingParticle(
            units=self.units, forces=((FORCE, 0.0),), regions=(GOAL,), start=START, penalty=penalty, **changes
        )

    def learner(self, task: FallingParticle, way: str) -> Learner:
        """The constructive algorithm, or the same pool with all units there from the start and none that shrinks."""
        if way == "grown":
            growth = {"criterion": {"kind": "clock", "interval": self.interval}, **GROWTH}
            policy: dict[str, Any] = {"kind": "growing", "p_max": HEIGHT}
            return agent_for(task, policy=policy, growth=growth, learning_rate=RATES[way])
        policy = {"kind": "tiles", "copies": self.units, "width": GROWTH["cutoff"], "p_max": HEIGHT}
        return agent_for(task, policy=policy, learning_rate=RATES[way])

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for penalty in self.costs:
            task = self.task(penalty)
            for way in WAYS:
                name = f"{penalty:g} {way}"
                run = work.train(task, self.learner(task, way), self.decisions, self.seeds)
                found["decision"], found[f"{name} curve"] = run.curve()
                found |= prefixed(name, self._learned(work, name, run.policies))
        return found

    def _learned(self, work: Workspace, name: str, policies: Any) -> Values:
        """The frozen policies: reward without the penalty, firings of every unit per fall, and the median one's units
        and paths."""

        def made() -> Values:
            physics = ParticlePhysics(timestep=0.1, substeps=1)
            fallen = falls(self.task(0.0, physics=physics), policies, 2, self.looks)
            reward = fallen.reward.mean(1)
            row = median_row(reward)
            policy = policy_at(policies, row)
            pool = getattr(policy, "pool", policy)
            return {
                "goal": reward,
                "firings": fallen.pushes.mean(1) / ParticlePhysics().period,
                "rate": fallen.pushes.mean(1) / fallen.time.mean(1)[:, None],
                "centre": np.asarray(pool.centre),
                "log width": np.asarray(pool.log_width),
                **stored_paths(self.task(0.0), policy, DRAWN),
            }

        return work.part(name, made)

    def figure(self, values: Values) -> Figure:
        figure = new_figure(11, 3.0 * len(self.costs))
        rows: Any = figure.subplots(len(self.costs), 4, width_ratios=[1.6, 1.0, 1.0, 1.0])
        for row, case in zip(rows, self.costs, strict=True):
            for way, colour in STYLES.items():
                thousand = values["decision"] / 1000
                draw_band(row[0], thousand, values[f"{case:g} {way} curve"], colour, WAYS[way], records=5)
                firings = np.sort(values[f"{case:g} {way} firings"], axis=1)[:, ::-1]
                place = np.arange(1, self.units + 1)
                low, middle, high = np.percentile(firings, [25, 50, 75], axis=0)
                row[1].fill_between(place, low, high, color=colour, alpha=0.2, linewidth=0)
                row[1].plot(place, middle, "o-", color=colour, markersize=4)
            for unit in range(1, self.units):
                row[0].axvline(unit * self.interval / 1000, color="0.88", linewidth=0.7, zorder=0)
            row[0].set(ylabel=f"reward per decision,\npenalty {case:g}")
            row[1].set(ylabel="firings per fall", xticks=np.arange(1, self.units + 1), ylim=(0, None))
            for axes, way in zip(row[2:], WAYS, strict=True):
                forces = np.array([(FORCE, 0.0)] * self.units)
                draw_tile(axes, self.task(case), values, f"{case:g} {way}", forces, height=HEIGHT)
                axes.set_title(WAYS[way], fontsize=9.5)
        rows[0, 0].legend(loc="lower right", fontsize=8.5)
        rows[-1, 0].set_xlabel("thousand decisions; lines: a unit is added")
        rows[-1, 1].set_xlabel("units, the busiest first")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for penalty in self.costs:
            net = {way: self._net(values, penalty, way) for way in WAYS}
            if penalty:
                yield from self._penalised(values, penalty, net["fixed"])
            yield positive(
                f"Greedy growth learns less than a fixed pool of as many units (penalty {penalty:g}).",
                mean_of(net["fixed"] - net["grown"]),
                "reward of the fixed pool minus that of the grown one",
                "per decision",
                note=f"{net['fixed'].mean():.3f} and {net['grown'].mean():.3f}.",
                of="Greedy growth learns less than a fixed pool of as many units.",
            )

    def _penalised(self, values: Values, penalty: float, fixed: np.ndarray) -> Iterator[Claim]:
        """What a penalty does to grown units, and whether it leaves anything to learn."""
        firings = values[f"{penalty:g} grown firings"]
        yield more_than_half(
            f"With a penalty on using units, adding them one by one removes them from the policy ({penalty:g}).",
            share_of((firings < USED).all(1)),
            f"share of seeds in which, at the end, no grown unit fires more than once in {1 / USED:g} falls",
            note=f"All together fire {firings.sum(1).mean():.2f} times per fall, "
            f"{values['0 grown firings'].sum(1).mean():.1f} times if they learned without a penalty.",
            of="With a penalty on using units, adding them one by one removes them from the policy.",
        )
        alone = (values["decision"] > self.interval / 2) & (values["decision"] <= self.interval)
        yield negative(
            f"The first unit by itself is not worth its penalty ({penalty:g}).",
            mean_of(values[f"{penalty:g} grown curve"][:, alone].mean(1)),
            "reward in the second half of the time in which there is one unit",
            "per decision",
            kind="extension",
            of="The first unit by itself is not worth its penalty.",
        )
        yield positive(
            f"Several units together are worth it: a fixed pool earns more than no push ({penalty:g}).",
            mean_of(fixed),
            "reward of the fixed pool minus penalties",
            "per decision",
            kind="extension",
            of="Several units together are worth it.",
        )

    @staticmethod
    def _net(values: Values, penalty: float, way: str) -> np.ndarray:
        """Reward along the falls of the frozen policies minus penalties, per decision, `(seeds,)`."""
        name = f"{penalty:g} {way}"
        return values[f"{name} goal"] - penalty * values[f"{name} rate"].sum(1)
