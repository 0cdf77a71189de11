"""Section 6.5.4: units without a part in the policy, and the policy after pruning."""

import functools
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.plane import trajectories
from motorgrad.policies import LocalGaussians, Masked, activity, prune, reach
from motorgrad.schema import Range, count, static
from motorgrad.statistics import mean_of, share_of
from motorgrad.tasks import FallingParticle, Region, region_reward
from motorgrad_thesis._claims import Claim, at_most, below, within
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_intervals, subplots
from motorgrad_thesis.chapter_6._local_study import LayoutStudy, outside, policy_at
from motorgrad_thesis.chapter_6.figure_6_5 import JUNK

ROUND = 4096  # paths are padded to a multiple of this many places
KEPT = 0.005  # tolerated change of the reward per decision
SIDES = ((0.0, 1.0), (0.0, 1.0))  # of the box


@experiment("sec-6.5.4-pruning", "pruning of junk units", "section 6.5.4")
class Pruning(LayoutStudy):
    """Units that hardly ever fire on the learner's own paths are removed from the policies learned in R1 and R2, and
    the remaining policy acts from the same starts with the same random numbers. The bound is the expected number of
    firings per episode: removing such a unit changes at most that share of the episodes.
    """

    looks: int = count(
        400,
        10,
        10**6,
        help="number of episodes over which activity is averaged; as many others are used for the evaluation",
    )
    bounds: tuple[float, ...] = static(
        (JUNK, 0.5, 2.0),
        allowed=Range(0, open_low=True),
        help="expected firings per episode below which units are removed, rising; the first is that of junk",
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("bounds")

    quick = smoke(decisions=2_000, seeds=3, layouts=("R1",), looks=20)

    def run(self, work: Workspace) -> Values:
        found: Values = {"bounds": np.array(self.bounds)}
        for layout in self.layouts:
            task = FallingParticle(layout=layout)  # type: ignore[arg-type]
            run = self.learned(work, layout)  # type: ignore[arg-type]
            work.say(f"pruning the policies of {layout}")
            each = [self._pruned(task, policy_at(run.policies, row)) for row in range(self.seeds)]
            found |= {f"{layout} {name}": np.stack([made[name] for made in each]) for name in each[0]}
        return found

    def _pruned(self, task: FallingParticle, policy: LocalGaussians) -> Values:
        """For one policy: its units, and its reward with all of them and with those that each bound keeps."""
        whole = Masked(policy, jnp.ones(policy.outputs, bool))
        seen = trajectories(task, whole, self.looks, seed=1)
        at = np.concatenate([path[:-1] for path in seen])
        firing = np.asarray(activity(whole, at)) * len(at) / self.looks
        before = trajectories(task, whole, self.looks, seed=2)
        rewards = [_reward(task, before)]
        changed = []
        for bound in self.bounds:
            after = trajectories(task, prune(whole, firing >= bound), self.looks, seed=2)
            rewards.append(_reward(task, after))
            changed.append(np.mean([not np.array_equal(a, b) for a, b in zip(before, after, strict=True)]))
        return {
            "firing": firing,
            "reach": np.asarray(reach(policy, *np.transpose(SIDES))),
            "centre": np.asarray(policy.centre),
            "reward": np.array(rewards),
            "changed": np.array(changed),
        }

    def figure(self, values: Values) -> Figure:
        figure, (units, kept) = subplots(9, 3.8, 1, 2)
        for colour, layout in zip(("C0", "C1", "C2"), self.layouts, strict=False):
            firing = values[f"{layout} firing"]
            units.plot(np.sort(firing.ravel()), np.arange(1, firing.size + 1) / len(firing), color=colour, label=layout)
            change = values[f"{layout} reward"][:, 1:] - values[f"{layout} reward"][:, :1]
            means = [mean_of(each) for each in change.T]
            draw_intervals(kept, values["bounds"], means, fmt="o-", color=colour, label=layout)
        units.axvline(values["bounds"][0], color="0.5", linewidth=0.8, linestyle="--")
        units.text(values["bounds"][0] * 0.9, 7.8, "junk", color="0.4", ha="right", va="top")
        units.set(xscale="log", xlim=(1e-4, 30), ylim=(0, 8.2))
        units.set(xlabel="expected firings per episode", ylabel="units that fire less often, of 8")
        units.legend(loc="center left")
        kept.axhline(0, color="0.7", linewidth=0.8)
        kept.set(xscale="log", xlabel="bound for pruning: firings per episode", ylabel="change of reward")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for layout in self.layouts:
            firing = values[f"{layout} firing"]
            reward = values[f"{layout} reward"]
            junk = firing < values["bounds"][0]
            allowed = (firing * junk).sum(1)
            beyond = outside(values[f"{layout} centre"])
            yield within(
                -KEPT,
                KEPT,
                f"Junk units can be pruned: the reward does not change ({layout}).",
                mean_of(reward[:, 1] - reward[:, 0]),
                "change of the reward",
                "per decision",
                note=f"{junk.sum(1).mean():.2f} of 8 units fire less than once per {1 / values['bounds'][0]:g} "
                f"episodes; the reward is {reward[:, 0].mean():.3f}.",
                source="section 6.3.1",
                of="Junk units can be pruned.",
            )
            yield at_most(
                0,
                f"No more episodes change than their expected firings allow ({layout}).",
                mean_of(values[f"{layout} changed"][:, 0] - allowed),
                "share of changed episodes minus the expected firings of the removed units",
                kind="extension",
                source="the bound on the page about pruning",
            )
            yield below(
                0.5,
                f"A unit beyond a wall has no part in the policy ({layout}).",
                share_of(~junk[beyond]),
                "share of units centred outside of the box that fire more often than junk",
                note=f"{beyond.sum(1).mean():.2f} of 8 units are centred outside of the box; "
                f"{(values[f'{layout} reach'] < values['bounds'][0]).sum(1).mean():.2f} reach a probability of "
                f"{values['bounds'][0]:g} nowhere in it.",
                source="section 6.3.1",
                of="Units beyond a wall have no part in the policy.",
            )


def _reward(task: FallingParticle, paths: Sequence[np.ndarray]) -> float:
    """Mean reward per decision along paths; the reward is a function of the position."""
    places = np.concatenate([path[1:] for path in paths])
    # padded to few different lengths, because each one is compiled
    padded = np.pad(places, ((0, -len(places) % ROUND), (0, 0)), constant_values=np.nan)
    return float(np.nanmean(_paid(task.places, padded)))


@functools.cache
def _payer(regions: tuple[Region, ...]) -> Any:
    return jax.jit(jax.vmap(lambda place: region_reward(regions, place)))


def _paid(regions: tuple[Region, ...], places: np.ndarray) -> np.ndarray:
    return np.asarray(_payer(regions)(jnp.asarray(places, jnp.float32)))
