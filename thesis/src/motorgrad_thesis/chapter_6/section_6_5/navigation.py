"""Section 6.5.4: a learned flow field leads around an obstacle to a goal."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.plane import draw_paths, draw_reward
from motorgrad.policies import Policy
from motorgrad.schema import count
from motorgrad.statistics import mean_of, moving_mean, per_case
from motorgrad.tasks import ParticleNavigation
from motorgrad.training import Evaluation, Run, agent_for, evaluate
from motorgrad_thesis._claims import Claim, in_every, negative, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, subplots
from motorgrad_thesis.chapter_6._local_study import EXACT_READ, median_row, policy_at, prefixed, stored_paths

RATES = {"own": None, "half": {"centre": 1e-4, "log_width": 4e-4}}
STEP_SIZE_LABELS = {"own": "the task's own step sizes", "half": "half of them"}
ARRIVES = 0.9  # a seed has found its way if this share of the episodes ends at the goal
SMOOTH = 5  # records
NOTHING = 1e-6  # forces below this are rounding errors


@experiment("sec-6.5.4-navigation", "a flow field for navigation", "section 6.5.4")
class Navigation(Experiment):
    """A particle learns to find a goal behind an obstacle: 64 local units, each pushing in one of four directions, form
    a field of forces that leads there. The share of episodes that end at the goal, the time they take, and the cost of
    the obstacle; and the expected force of the median seed over the plane, before and after learning.
    """

    reading: ClassVar[str] = EXACT_READ

    first_seed: ClassVar[int] = 100
    """Some of the earlier seeds were used to choose the settings."""

    decisions: int = count(200_000, 400, 10**9, help="number of decisions of learning")
    seeds: int = count(24, 2, 10_000, help="number of learners with each step size")
    watched: int = count(10_000, 1_000, 10**7, unit="decisions", help="length of the evaluation of the frozen policies")
    drawn: int = count(8, 1, 1_000, help="number of episodes whose paths are in each picture")

    quick = smoke(decisions=4_000, seeds=3, watched=1_000, drawn=3)

    def learned(self, work: Workspace, name: str) -> Run:
        """The runs with these step sizes."""
        task = ParticleNavigation()
        settings = agent_for(task, **({} if RATES[name] is None else {"learning_rate": RATES[name]}))
        seeds = list(range(self.first_seed, self.first_seed + self.seeds))
        return work.train(task, settings, self.decisions, seeds)

    def films(self, work: Workspace) -> Mapping[str, Run]:
        return {"animation": self.learned(work, "half")}

    def run(self, work: Workspace) -> Values:
        task = ParticleNavigation()
        found = {}
        for name in RATES:
            run = self.learned(work, name)
            found |= {"decision": run.curve()[0], f"{name} arrivals": arrival_shares(run.metrics, self.seeds)}
            found |= prefixed(name, frozen_outcome(evaluate(run, self.watched)))
            if name == "half":
                found |= prefixed("before", frozen_outcome(evaluate(run, self.watched, untrained=True)))
                row = median_row(found["half reward"])
                found["row"] = np.array(row)
                for when, policies in (("before", run.initial), ("after", run.policies)):
                    policy = policy_at(policies, row)
                    shown = {"flow": flow(policy, task, found.setdefault("places", flow_places()))}
                    # before learning, paths wander until the time limit, and a few cover everything
                    count = self.drawn if when == "after" else min(self.drawn, 2)
                    found |= prefixed(when, shown | stored_paths(task, policy, count))
        return found

    def figure(self, values: Values) -> Figure:
        """Expected force and paths before and after learning, and the share of episodes that end at the goal."""
        task = ParticleNavigation()
        figure, axes = subplots(11, 4.1, 1, 3, width_ratios=[1, 1, 1.1])
        for panel, when in zip(axes, ("before", "after"), strict=False):
            draw_reward(panel, task)
            flow = values[f"{when} flow"]
            most = float(np.linalg.norm(flow, axis=1).max())
            if most > NOTHING:
                x, y = values["places"].T
                panel.quiver(x, y, *flow.T, color="#0061B0", width=0.0045, scale=16 * most, zorder=1.5, alpha=0.75)
            draw_paths(panel, np.split(values[f"{when} paths"], values[f"{when} ends"][:-1]))
        axes[0].set_title("before learning: forces cancel; paths", fontsize=10)
        axes[1].set_title(f"learned, seed {self.first_seed + int(values['row'])}: mean force, paths", fontsize=10)
        _arrivals(axes[2], values, STEP_SIZE_LABELS)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        before = values["before share"]
        for name, words in STEP_SIZE_LABELS.items():
            after = values[f"{name} share"]
            yield positive(
                f"A flow field is learned that leads to the goal ({words}).",
                mean_of(after - before),
                "share of episodes that end at the goal minus that before learning",
                "of the episodes",
                note=f"{before.mean():.0%} before, {after.mean():.0%} after.",
                of="A flow field is learned that leads to the goal.",
            )
            yield in_every(
                f"This happens in every run ({words}).",
                after >= ARRIVES,
                f"share of these seeds in which at least {ARRIVES:.0%} of the episodes end at the goal",
                note=f"Seeds in which none does: {int((after == 0).sum())}.",
                kind="extension",
            )
            yield negative(
                f"The flow field leads past the obstacle ({words}).",
                mean_of(values[f"{name} cost"] - values["before cost"]),
                "cost of the obstacle per decision minus that before learning",
                "reward per decision",
                note=f"{values['before cost'].mean():.3f} before, {values[f'{name} cost'].mean():.3f} after; per "
                f"episode {values['before cost per episode'].mean():.2f} and "
                f"{values[f'{name} cost per episode'].mean():.2f}.",
                kind="extension",
            )
        yield negative(
            "The goal is reached sooner.",
            mean_of(values["half arrival"] - values["before arrival"]),
            "decisions to the goal, if it is reached, minus those before learning (half step sizes),",
            "decisions",
            note=f"{values['before arrival'].mean():.0f} before, {values['half arrival'].mean():.1f} after.",
            kind="extension",
        )


def flow_places() -> np.ndarray:
    """Places at which the flow is drawn, `(places, 2)`."""
    side = (np.arange(16) + 0.5) / 16
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)


def flow(policy: Policy, task: Any, at: np.ndarray) -> np.ndarray:
    """Expected force at each place, `(places, 2)`."""
    fires = jax.vmap(policy.prob)(jnp.asarray(at, jnp.float32))
    return np.asarray(fires) @ np.asarray(task.dynamics.forces)


def arrival_shares(metrics: Any, seeds: int) -> np.ndarray:
    """Share of the episodes ending within each record that end at the goal, `(seeds, records)`; that of the previous
    record if none ended, NaN before the first end."""
    ended, arrived = (metrics[name].to_numpy().reshape(-1, seeds).T for name in ("episodes", "arrival_count"))
    share = per_case(arrived, ended)
    for record in range(1, share.shape[1]):
        share[:, record] = np.where(np.isnan(share[:, record]), share[:, record - 1], share[:, record])
    return share


def frozen_outcome(outcome: Evaluation) -> Values:
    """Results of frozen policies for each seed; the number of decisions to the goal is the time limit
    if none arrived."""
    ended, arrived = (outcome.records[name].to_numpy() for name in ("episodes", "arrival_count"))
    decisions = len(outcome.time)
    return {
        "reward": outcome.reward,
        "share": per_case(arrived, ended),
        "arrival": np.nan_to_num(outcome.metrics["arrival"], nan=float(ParticleNavigation().time_limit)),
        "cost": outcome.metrics["cost"],
        "cost per episode": per_case(outcome.metrics["cost"] * decisions, ended),
    }


def _arrivals(axes: Axes, values: Values, words: Mapping[str, str]) -> None:
    """All seeds, and their mean."""
    thousands = values["decision"] / 1e3
    for (name, label), colour in zip(words.items(), ("C1", "C0"), strict=True):
        shares = moving_mean(values[f"{name} arrivals"], SMOOTH)
        at = thousands[SMOOTH - 1 :]
        axes.plot(at, shares.T, color=colour, linewidth=0.5, alpha=0.35)
        axes.plot(at, shares.mean(0), color=colour, linewidth=2.2, label=label)
    axes.set(xlabel="thousand decisions", ylabel="episodes that end at the goal", ylim=(0, 1.02))
    axes.legend(title="thin: every seed, thick: mean", loc="lower right", fontsize=8, title_fontsize=8)
