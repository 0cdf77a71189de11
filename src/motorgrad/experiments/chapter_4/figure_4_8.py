"""Figure 4.8: the policies that pools of several units learn on the arm."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim, mean_of, share_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_4._arm_policies_figure import draw_arm_policies
from motorgrad.experiments.chapter_4._linear_study import check_units
from motorgrad.experiments.chapter_4._pool_drawing import count_chances
from motorgrad.experiments.chapter_4._pools import firing, numbers
from motorgrad.experiments.chapter_4.figure_4_7 import rewards
from motorgrad.policies import Motoneurons
from motorgrad.tasks import ArmRecruitment
from motorgrad.training import Run, settings_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GOOD = 0.9
"""The part of the best possible reward that a pool should earn."""
POINTS = 1601  # loads at which policies are judged
SWEEPS = 6  # that are shown as samples


@dataclasses.dataclass(frozen=True)
class ArmPolicies(Experiment):
    """The policies that pools learn on the arm, from sweeps over the loads with a step at the end of each. Colour: the
    exact probability of each number of active units. Black: the expected number. Red: the thresholds. Dotted: the best
    number at each load. On the right samples of the reward under the largest pool's policy. The pool in the middle of
    all seeds is shown above, the thresholds of every seed below.

    **Arguments:**

    - `units`: of the pools, each number once.
    - `steps` (decisions): for which every pool learns; about 80 make a sweep.
    - `seeds`: pools of each number of units.
    """

    name: ClassVar[str] = "fig-4.8"
    title: ClassVar[str] = "learnt realistic policies"
    source: ClassVar[str] = "figure 4.8"

    units: tuple[int, ...] = (2, 3, 4)
    steps: int = 400_000
    seeds: int = 32

    def __post_init__(self) -> None:
        check_units(self.units, 1)
        check(200 <= self.steps <= 10**9, "steps", self.steps, "in 200 … 1,000,000,000 decisions")
        check(1 <= self.seeds <= 10_000, "seeds", self.seeds, "in 1 … 10,000")

    @classmethod
    def quick(cls) -> Self:
        return cls(units=(2, 3), steps=2_000, seeds=3)

    def run(self, work: Workspace) -> Values:
        found: Values = {"units": np.array(self.units)}
        runs = {units: self._trained(work, units) for units in self.units}
        for units, run in runs.items():
            found |= {f"{name} {units}": value for name, value in judged(self.task(units), run).items()}
        largest = max(self.units)
        shown = runs[largest].seeds[int(found[f"middle {largest}"])]
        return found | sampled(self.task(largest), runs[largest].policy(shown))

    def task(self, units: int) -> ArmRecruitment:
        return ArmRecruitment(units=units)

    def _trained(self, work: Workspace, units: int) -> Run:
        task = self.task(units)
        return work.train(task, settings_for(task), self.steps, self.seeds)

    def figure(self, values: Values) -> "Figure":
        return draw_arm_policies(values)

    def claims(self, values: Values) -> Sequence[Claim]:
        made = []
        for units in values["units"].tolist():
            best = float(values[f"best {units}"])
            earned = mean_of(values[f"reward {units}"] / best)
            made.append(
                Claim(
                    f"Pools of {units} units learn to lift the loads.",
                    "figure 4.8",
                    f"{GOOD:g} or more",
                    earned,
                    earned.low >= GOOD,
                    "of the best mean reward",
                    f"The best number of units at each load would earn {best:.3f} on average, the pools "
                    f"{values[f'reward {units}'].mean():.3f}.",
                )
            )
        for units in values["units"].tolist():
            graded = share_of((values[f"gain {units}"] > 0).all(1))
            made.append(
                Claim(
                    f"Pools of {units} units recruit: all their gains are positive.",
                    "figure 4.8",
                    "in most seeds",
                    graded,
                    graded.low > 0.5,
                    note="The others have a unit of negative gain, most often with a threshold beyond the loads: it "
                    "fires at every load (the pathology of section 4.4).",
                )
            )
        for units in values["units"].tolist():
            shifts = early(values, units)
            if len(shifts) < 2:
                continue
            shift = mean_of(shifts)
            made.append(
                Claim(
                    f"The thresholds of {units} units do not sit exactly where the best number of units changes.",
                    "section 4.3.2",
                    "not 0",
                    shift,
                    shift.low > 0 or shift.high < 0,
                    "kg above it",
                    "Pools without a unit of negative gain, means over their units.",
                )
            )
        return made


def judged(task: ArmRecruitment, run: Run) -> Values:
    """The pools of a run: thresholds, gains, and exact mean reward over loads spread evenly over the sweep, `reward`
    (seeds,); beside it that of the best number of units at each load, `best`. `middle` is the seed in the middle."""
    loads, counts = np.linspace(task.low, task.high, POINTS), np.arange(task.units + 1)
    paid = rewards(task, loads, counts / task.units).T
    threshold, gain = numbers(run.policies)
    reward = (count_chances(firing(run.policies, loads)) * paid).sum(-1).mean(-1)
    return {
        "threshold": threshold,
        "gain": gain,
        "reward": reward,
        "middle": np.argsort(reward, kind="stable")[len(reward) // 2],
        "best": paid.max(1).mean(),
        "load": loads,
        "best count": paid.argmax(1),
    }


def sampled(task: ArmRecruitment, policy: Any) -> Values:
    """Loads of some sweeps, how many units the policy activates, and what that pays, `(decisions,)` each."""
    assert isinstance(policy, Motoneurons)
    drawn, world = np.random.default_rng(0).random((SWEEPS * 80, 1 + task.units)).astype(np.float32), task.dynamics

    def step(load: jax.Array, uniforms: jax.Array) -> tuple[jax.Array, tuple[jax.Array, ...]]:
        seen = load[None]
        action = policy.sample(seen, uniforms[1:])
        after = world.step(load, action, uniforms[:1])
        after = jnp.where(task.over(after), world.reset(uniforms[:0]), after)
        return after, (load, action.sum(), task.immediate(seen, action))

    load, count, paid = jax.lax.scan(step, world.reset(jnp.zeros(0)), jnp.asarray(drawn))[1]
    return {"sample load": np.asarray(load), "sample count": np.asarray(count), "sample reward": np.asarray(paid)}


def early(values: Values, units: int) -> np.ndarray:
    """How far the thresholds are above the loads at which the best number of units changes, the mean of each pool that
    has positive gains only, `(pools,)`, in kg."""
    load, best = values[f"load {units}"], values[f"best count {units}"]
    ideal = np.repeat(load[1:], np.maximum(np.diff(best), 0))  # of many units several may be worth it at once
    good = (values[f"gain {units}"] > 0).all(1)
    return (np.sort(values[f"threshold {units}"][good], axis=1) - ideal).mean(1)
