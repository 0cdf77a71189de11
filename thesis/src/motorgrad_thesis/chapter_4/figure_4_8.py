"""Figure 4.8: the policies that pools learn on the arm."""

from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.bodies import Posture
from motorgrad.policies import Motoneurons
from motorgrad.schema import count, static
from motorgrad.statistics import mean_of, share_of
from motorgrad.tasks import ArmRecruitment
from motorgrad.training import Run, agent_for
from motorgrad_thesis._claims import Claim, at_least, more_than_half, negative
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import SubFigure
from motorgrad_thesis.chapter_4._pools import (
    IDEAL,
    SIZES,
    THRESHOLD,
    count_chances,
    draw_pool,
    draw_thresholds,
    firing_probability,
    thresholds_and_gains,
)
from motorgrad_thesis.chapter_4._postures import BothPostures, arm_task
from motorgrad_thesis.chapter_4.figure_4_7 import rewards

GOOD = 0.9
"""The fraction of the best possible reward that a pool should earn."""

POINTS = 1601  # loads at which policies are judged
SWEEPS = 6  # sweeps shown as samples


@experiment("fig-4.8", "learned realistic policies", "figure 4.8")
class ArmPolicies(BothPostures):
    """Policies that pools learn on the arm, from sweeps over the loads with an update at the end of each; with the
    upper arm held vertically and horizontally. Colour: the exact probability of each number of active units. Black: the
    expected number. Red: the thresholds. Dotted: the best number at each load. Right: samples of the reward under the
    largest pool's policy. Above, the median pool; below, the thresholds of every seed.
    """

    units: tuple[int, ...] = static((2, 3, 4), allowed=SIZES, help="sizes of the pools, each once")
    steps: int = count(
        400_000, 200, 10**9, unit="decisions", help="length of the practice of every pool; a sweep takes about 80"
    )
    seeds: int = count(32, 1, 10_000, help="number of pools of each size")

    def validate(self) -> None:
        super().validate()
        self.check_rising("units")

    quick = smoke(units=(2, 3), steps=2_000, seeds=3)

    @property
    def size(self) -> tuple[float, float]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return 2.7 * (len(self.units) + 1) + 0.6, 5.7

    def measure(self, work: Workspace, posture: Posture) -> Values:
        found: Values = {"units": np.array(self.units)}
        tasks = {units: arm_task(posture, units) for units in self.units}
        runs = {units: work.train(task, agent_for(task), self.steps, self.seeds) for units, task in tasks.items()}
        for units, run in runs.items():
            found |= {f"{name} {units}": value for name, value in pool_rewards(tasks[units], run).items()}
        largest = max(self.units)
        shown = runs[largest].seeds[int(found[f"middle {largest}"])]
        return found | sampled_sweeps(tasks[largest], runs[largest].policy(shown))

    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        """Above, the policies of the median pools, and samples; below, the results of every seed."""

        counts = values["units"].tolist()
        panels = figure.subplots(2, len(counts) + 1, height_ratios=[1.5, 1], squeeze=False)
        mesh: Any = None
        for (policy, seeds), units in zip(panels.T, counts, strict=False):
            load = values[f"load {units}"]
            best = values[f"best count {units}"]
            thresholds, gains, reward = (values[f"{what} {units}"] for what in ("threshold", "gain", "reward"))
            middle = int(values[f"middle {units}"])
            mesh = draw_pool(policy, thresholds[middle], gains[middle], load)
            policy.plot(load, best, color=IDEAL, linestyle=":", linewidth=1.6)
            policy.set_title(f"{units} units")
            for change in load[1:][np.diff(best) != 0]:
                seeds.axvline(change, color=IDEAL, linestyle=":", linewidth=1)
            draw_thresholds(seeds, thresholds, gains, (load[0], load[-1]), np.argsort(-reward, kind="stable"))
            caught = np.sum((gains < 0).any(1))
            seeds.set(xlabel="load (kg)")
            seeds.set_title(f"a unit of negative gain: {caught} of {len(gains)}", fontsize=9)
        panels[0, 0].set_ylabel("active units")
        panels[1, 0].set_ylabel("thresholds, every seed")
        _samples(figure, panels[0, -1], values, counts[-1])
        _earned(panels[1, -1], values)
        figure.colorbar(mesh, ax=panels[0, :-1], label="probability", aspect=14, pad=0.01)

    def judge(self, values: Values, posture: Posture) -> Iterator[Claim]:
        for units in values["units"].tolist():
            best = float(values[f"best {units}"])
            yield at_least(
                GOOD,
                f"Pools of {units} units learn to lift the loads.",
                mean_of(values[f"reward {units}"] / best),
                unit="of the best mean reward",
                note=f"The best number of units at each load earns {best:.3f} on average, the pools earn "
                f"{values[f'reward {units}'].mean():.3f}.",
                of="Pools learn to lift the loads.",
            )
        for units in values["units"].tolist():
            yield more_than_half(
                f"Pools of {units} units recruit: all their gains are positive.",
                share_of((values[f"gain {units}"] > 0).all(1)),
                note="The others have a unit of negative gain, mostly with a threshold beyond the loads, which fires "
                "at every load (the pathology of section 4.4).",
                of="Pools learn to recruit: all gains are positive.",
            )
        for units in values["units"].tolist():
            shifts = threshold_shifts(values, units)
            if len(shifts) < 2:
                continue
            yield negative(
                f"The thresholds of {units} units lie below the loads at which the best number of units changes.",
                mean_of(shifts),
                unit="kg above them",
                note="Means over the units of pools without a unit of negative gain.",
                source="section 4.3.2",
                of="Thresholds do not sit where the best number of units changes, because actions are uncertain.",
            )


def pool_rewards(task: ArmRecruitment, run: Run) -> Values:
    """The pools of a run: thresholds, gains, and exact mean reward over loads spread evenly over the sweep, `reward`
    (seeds,); and `best`, the reward of the best number of units at each load. `middle` is the row of the median seed.
    """
    loads = np.linspace(task.low, task.high, POINTS)
    counts = np.arange(task.units + 1)
    paid = rewards(task, loads, counts / task.units).T
    threshold, gain = thresholds_and_gains(run.policies)
    reward = (count_chances(firing_probability(run.policies, loads)) * paid).sum(-1).mean(-1)
    return {
        "threshold": threshold,
        "gain": gain,
        "reward": reward,
        "middle": np.argsort(reward, kind="stable")[len(reward) // 2],
        "best": paid.max(1).mean(),
        "load": loads,
        "best count": paid.argmax(1),
    }


def sampled_sweeps(task: ArmRecruitment, policy: Any) -> Values:
    """Loads of some sweeps, the number of units that the policy activates, and the reward, `(decisions,)` each."""
    assert isinstance(policy, Motoneurons)
    drawn = np.random.default_rng(0).random((SWEEPS * 80, 1 + task.units)).astype(np.float32)
    world = task.dynamics

    def step(load: jax.Array, uniforms: jax.Array) -> tuple[jax.Array, tuple[jax.Array, ...]]:
        seen = load[None]
        action = policy.sample(seen, uniforms[1:])
        after = world.step(load, action, uniforms[:1])
        after = jnp.where(task.over(after), world.reset(uniforms[:0]), after)
        return after, (load, action.sum(), task.immediate(seen, action))

    load, count, paid = jax.lax.scan(step, world.reset(jnp.zeros(0)), jnp.asarray(drawn))[1]
    return {"sample load": np.asarray(load), "sample count": np.asarray(count), "sample reward": np.asarray(paid)}


def threshold_shifts(values: Values, units: int) -> np.ndarray:
    """Distance of the thresholds above the loads at which the best number of units changes, averaged over each pool
    that has only positive gains: `(pools,)`, in kg."""
    load = values[f"load {units}"]
    best = values[f"best count {units}"]
    ideal = np.repeat(load[1:], np.maximum(np.diff(best), 0))  # with many units, several may be added at one load
    good = (values[f"gain {units}"] > 0).all(1)
    return (np.sort(values[f"threshold {units}"][good], axis=1) - ideal).mean(1)


def _samples(figure: SubFigure, axes: Any, values: Values, units: int) -> None:
    load, count, paid = (values[f"sample {what}"] for what in ("load", "count", "reward"))
    # jitter, so that samples do not hide each other
    moved = count + np.random.default_rng(1).uniform(-0.22, 0.22, len(count))
    dots = axes.scatter(load, moved, c=paid, cmap="RdYlBu_r", s=9, edgecolors="0.4", linewidths=0.2)
    axes.set(title=f"samples, {units} units", ylim=(-0.5, units + 0.5), yticks=range(units + 1))
    axes.set(xlim=(values[f"load {units}"][0], values[f"load {units}"][-1]))
    figure.colorbar(dots, ax=axes, label="reward", aspect=14, pad=0.02)


def _earned(axes: Any, values: Values) -> None:
    """The reward of every seed's pool relative to the best."""
    counts = values["units"].tolist()
    for row, units in enumerate(counts):
        part = values[f"reward {units}"] / values[f"best {units}"]
        good = (values[f"gain {units}"] > 0).all(1)
        place = row + np.linspace(-0.25, 0.25, len(part))
        axes.plot(100 * part[good], place[good], "o", color=THRESHOLD, markersize=3)
        axes.plot(100 * part[~good], place[~good], "x", color="black", markersize=3.5)
    axes.set(yticks=range(len(counts)), yticklabels=counts, ylabel="units", xlabel="reward (% of the best)")
    axes.invert_yaxis()
    axes.set_title("× a unit of negative gain", fontsize=9)
