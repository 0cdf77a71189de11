"""Figure 6.5: local policies learned in two layouts of rewards, and the particle's paths under them."""

from collections.abc import Iterator, Mapping

import numpy as np

from motorgrad.plane import draw_occupancy, draw_paths, draw_regions, draw_units, occupancy, trajectories
from motorgrad.policies import activity
from motorgrad.schema import count
from motorgrad.statistics import Measured, mean_of, share_of, tally_of
from motorgrad.tasks import FallingParticle
from motorgrad.training import Run
from motorgrad_thesis._claims import Claim, more_than_half, positive, within
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, new_figure
from motorgrad_thesis.chapter_6._local_study import (
    FORGETTING,
    LAYOUTS,
    LocalStudy,
    frozen_reward,
    gaussians,
    late_reward,
    median_row,
    outside,
    policy_at,
    visited,
)
from motorgrad_thesis.chapter_6._pairs import BothPairs, Pair, settings_of

JUNK = 0.05  # expected firings per episode, below which a unit takes no part
ONE_SIDED = 0.1  # difference of the shares of time on the two sides
# mean reward of an independent model over 20 seeds: untrained; after 2,000 episodes, with its deviation
INDEPENDENT = {"R1": (-0.001, 0.283, 0.024), "R2": (0.123, 0.329, 0.008)}
SAMPLE = 20


@experiment("fig-6.5", "local policy learning", "figure 6.5")
class LocalPolicies(BothPairs, LocalStudy):
    """Eight local units learn to steer a falling particle in two layouts of rewards: the policy of the median seed,
    some of its paths, and its stationary distribution.
    """

    episodes: int = count(
        15_000,
        1,
        10**6,
        help="number of episodes of the median seed, over which the share of time in each place is sampled",
    )
    looks: int = count(
        200, 1, 10**6, help="number of episodes of every seed, over which the activity of its units is averaged"
    )
    drawn: int = count(12, 1, 10**6, help="number of episodes whose paths are in each picture")

    quick = smoke(decisions=2_000, seeds=3, episodes=100, looks=20, drawn=4)

    def measure(self, work: Workspace, pair: Pair) -> Values:
        found: Values = {}
        for layout in LAYOUTS:
            task = FallingParticle(layout=layout)  # type: ignore[arg-type]
            run = self.learned(work, task, **settings_of(pair))
            reward = late_reward(run)
            found |= {
                f"{layout} late": reward,
                f"{layout} untrained": frozen_reward(
                    work, task, run.initial, min(self.decisions, 5_000), **settings_of(pair)
                ),
                f"{layout} decision": run.curve()[0],
                f"{layout} reward": run.curve()[1],
            }
            if pair == "exact":
                found[f"{layout} late forgetting"] = late_reward(self.learned(work, layout, **FORGETTING))
            work.say(f"{layout}: {self.episodes:,} episodes")
            shown = self._shown(task, run, median_row(reward))
            found |= {f"{layout} {name}": value for name, value in (shown | self._units(task, run)).items()}
        return found

    def films(self, work: Workspace) -> Mapping[str, Run]:
        first = settings_of(self.pairs[0])
        return {f"animation-{layout}": self.learned(work, layout, **first) for layout in LAYOUTS}

    def learned_reward(self, values: Values) -> Values:
        return {layout: values[f"{layout} late"] for layout in LAYOUTS}

    def _shown(self, task: FallingParticle, run: Run, row: int) -> Values:
        """Paths and stationary distribution of one seed."""
        policy = policy_at(run.policies, row)
        paths = trajectories(task, policy, self.drawn)
        return {
            "row": np.array(row),
            "paths": np.concatenate(paths),
            "ends": np.cumsum([len(path) for path in paths]),
            "occupancy": occupancy(task, policy, self.episodes),
        }

    def _units(self, task: FallingParticle, run: Run) -> Values:
        """For every seed: its units, their firings per episode, and the share of time left of the middle."""
        policies = [policy_at(run.policies, row) for row in range(self.seeds)]
        seen = [visited(task, policy, self.looks) for policy in policies]
        firing = [
            np.asarray(activity(policy, at)) * len(at) / self.looks for policy, at in zip(policies, seen, strict=True)
        ]
        return {
            "centre": np.stack([policy.centre for policy in policies]),
            "log width": np.stack([policy.log_width for policy in policies]),
            "firing": np.stack(firing),
            "left": np.array([(at[:, 0] < 0.5).mean() for at in seen]),
        }

    def draw(self, values: Values) -> Figure:
        figure = new_figure(8.4, 8.6)
        for axes, layout in zip(figure.subplots(2, 2), LAYOUTS, strict=True):
            task = FallingParticle(layout=layout)  # type: ignore[arg-type]
            row = int(values[f"{layout} row"])  # type: ignore[arg-type]
            draw_regions(axes[0], task.places)
            draw_paths(axes[0], np.split(values[f"{layout} paths"], values[f"{layout} ends"][:-1]))
            policy = gaussians(values[f"{layout} centre"][row], values[f"{layout} log width"][row])
            draw_units(axes[0], policy, task.dynamics.forces)
            reward = values[f"{layout} late"]
            axes[0].set_title(
                f"{layout}: seed {row}, {reward[row]:.3f} per decision (mean of {len(reward)}: {reward.mean():.3f})",
                fontsize=9.5,
            )
            draw_occupancy(axes[1], values[f"{layout} occupancy"])
            axes[1].set_title("share of time in each place", fontsize=9.5)
        return figure

    def judge(self, values: Values, pair: Pair) -> Iterator[Claim]:
        for layout, (before, after, deviation) in INDEPENDENT.items():
            late_reward = values[f"{layout} late"]
            yield positive(
                f"Local units learn {layout}.",
                mean_of(late_reward - values[f"{layout} untrained"]),
                "reward in the last 200 of 2,000 episodes minus that before learning",
                "per decision",
                source="section 6.3.1",
                of="Local units learn the tasks.",
            )
            yield within(
                before - 0.005,
                before + 0.005,
                f"Before learning, the reward in {layout} is {before:g}.",
                mean_of(values[f"{layout} untrained"]),
                unit="per decision",
                kind="reference model",
                source="an independent model of section 6.3",
            )
            yield _as_far(layout, late_reward, after, deviation, "")
            if f"{layout} late forgetting" in values:  # only the model's learner has this variant
                yield _as_far(
                    layout, values[f"{layout} late forgetting"], after, deviation, " with a baseline that forgets"
                )
        yield from self._about_units(values)

    def _about_units(self, values: Values) -> Iterator[Claim]:
        junk = values["R1 firing"] < JUNK
        beyond = outside(values["R1 centre"])
        # the thesis says that units can end up so, and shows a run in a layout of its own
        yield positive(
            "Units can end up without a part in the policy (R1).",
            tally_of(junk.any(1)),
            "share of these seeds in which one does",
            source="section 6.3.1",
        )
        yield positive(
            "They can be pushed out of the box (R1).",
            tally_of((junk & beyond).any(1)),
            "share of these seeds in which one is",
            source="section 6.3.1",
        )
        yield more_than_half(
            "In most seeds, some units end up without a part in the policy (R1).",
            share_of(junk.any(1)),
            f"share of seeds with at least one unit that fires less than once per {1 / JUNK:g} episodes",
            note=f"{junk.sum(1).mean():.2f} of {junk.shape[1]} units on average, at most {junk.sum(1).max()}; "
            f"in R2 {(values['R2 firing'] < JUNK).sum(1).mean():.2f}. The thesis shows a run with six.",
            kind="extension",
        )
        yield more_than_half(
            "In most seeds, some of them are pushed out of the box (R1).",
            share_of((junk & beyond).any(1)),
            "share of seeds with at least one unit without a part and with its centre beyond a wall",
            note=f"{(junk & beyond).sum(1).mean():.2f} units on average.",
            kind="extension",
        )
        yield more_than_half(
            "Policies for a symmetric task are highly asymmetric (R2).",
            share_of(np.abs(2 * values["R2 left"] - 1) > ONE_SIDED),
            f"share of seeds with more than {(1 + ONE_SIDED) / 2:.0%} of the time on one side of the middle",
            source="section 6.3.1",
        )


def _as_far(layout: str, late_reward: np.ndarray, expected: float, deviation: float, words: str) -> Claim:
    """Whether learners reach the reward of an independent model with known mean and deviation."""
    from scipy import stats

    error = np.hypot(late_reward.std(ddof=1) / np.sqrt(len(late_reward)), deviation / np.sqrt(SAMPLE))
    away = late_reward.mean() - expected
    half = stats.norm.ppf(0.975) * error
    return within(
        -deviation,
        deviation,
        f"In {layout}, learners reach {expected:g} (± {deviation:g} over seeds){words}.",
        Measured(away, away - half, away + half, len(late_reward), "difference of means"),
        f"difference from its {SAMPLE} seeds, against their deviation,",
        "per decision",
        note=f"{late_reward.mean():.4f} ± {late_reward.std(ddof=1):.4f} over {len(late_reward)} seeds.",
        kind="reference model",
        source="an independent model of section 6.3",
    )
