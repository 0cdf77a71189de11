"""Section 7.1: supervised learning for imitation, before learning by reward."""

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import jax
import numpy as np

from motorgrad._errors import check, counted
from motorgrad.learning import Demonstrations, imitate
from motorgrad.policies import Policy
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import mean_of, median_of
from motorgrad.tasks import FallingParticle, Task
from motorgrad.training import Run, agent_for, rollout
from motorgrad_thesis._claims import Claim, at_least, below, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, draw_intervals, subplots
from motorgrad_thesis.chapter_6._local_study import LAYOUTS_READ, Layout, LayoutStudy, policy_at
from motorgrad_thesis.chapter_6.section_6_3_noise import SMOOTH, decisions_to, final_reward

LEVEL = 0.95  # of the demonstrators' reward, which counts as theirs
WELL = 0.9  # of the demonstrators' reward, which counts as a good copy
EVALUATION_DECISIONS = 5_000
COLOURS = ("#E69F00", "#D55E00", "#CC79A7", "#0072B2", "#009E73", "#000000")


@experiment("sec-7.1-imitation", "learning from demonstrations", "section 7.1")
class Imitations(LayoutStudy):
    """Local units that have learned the falling particle demonstrate some episodes, each to a policy that has not
    learned, which is fitted to them by maximum likelihood. Reward of the clones at once; and learning by reward from
    there on, as in section 6.3, beside learning from the start. As many episodes are also demonstrated in turns: after
    the first, the clone acts, and the demonstrator says what it would have done (DAgger).

    A learner never begins with a copy of its own seed's policy, but with that of its neighbour.
    """

    reading: ClassVar[str] = (
        'The thesis says that motor systems require "supervised learning for imitation learning", and gives no '
        f"method; ours is behaviour cloning (Pomerleau, 1991). {LAYOUTS_READ}"
    )

    seeds: int = count(24, 2, 10_000, help="number of demonstrators, and of learners of each kind")
    episodes: tuple[int, ...] = static(
        (1, 3, 10, 30, 100), allowed=Range(1, 10_000, kind="int"), help="numbers of demonstrated episodes, rising"
    )
    rounds: int = count(5, 2, 100, help="turns in which the asked demonstrator shows the middle number of episodes")
    rate: float = number(0.01, 0, 1, open_low=True, help="learning rate of the fit")

    def validate(self) -> None:
        super().validate()
        self.check_rising("episodes", 2)
        check(len(self.episodes) <= len(COLOURS), "episodes", self.episodes, f"at most {len(COLOURS)}, to have colours")
        whole = self.asked % self.rounds == 0
        check(whole, "rounds", self.rounds, f"a divisor of {self.asked}, the middle number of episodes")

    quick = smoke(decisions=2_000, seeds=3, layouts=("R1",), episodes=(1, 4), rounds=2)

    @property
    def asked(self) -> int:
        """The number of episodes of an asked demonstrator."""
        return self.episodes[len(self.episodes) // 2]

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for layout in self.layouts:
            task = FallingParticle(layout=layout)
            scratch = self.learned(work, task)
            found["decision"], found[f"{layout} scratch"] = scratch.curve()
            found[f"{layout} demonstrator at once"] = self._still(work, task, scratch.policies).curve()[1].mean(1)
            found[f"{layout} start at once"] = self._still(work, task, scratch.initial).curve()[1].mean(1)
            shown = demonstrated(scratch, max(self.episodes))
            for episodes in self.episodes:
                parts = [first_episodes(each, episodes) for each in shown]
                clones = self._clones(work, f"{layout}-{episodes}", scratch, parts)
                found[f"{layout} {episodes} at once"] = self._still(work, task, clones).curve()[1].mean(1)
                neighbours = jax.tree.map(lambda leaf: np.roll(leaf, 1, axis=0), clones)
                learning = work.train(task, agent_for(task), self.decisions, self.seeds, neighbours)
                found[f"{layout} {episodes}"] = learning.curve()[1]
            found[f"{layout} asked at once"] = self._asked(work, layout, scratch, shown)
        return found

    def _still(self, work: Workspace, task: Task, policies: Policy) -> Run:
        """Policies, which lead in every array, act without learning on the random numbers of their neighbours."""
        frozen = agent_for(task, update_every="never")
        steps = min(EVALUATION_DECISIONS, self.decisions)
        return work.train(task, frozen, steps, [*range(1, self.seeds), 0], policies)

    def _clones(self, work: Workspace, name: str, scratch: Run, shown: Sequence[Demonstrations]) -> Policy:
        """The policies that are fitted to demonstrations, which lead in every array."""

        def make() -> Values:
            starts = (policy_at(scratch.initial, row) for row in range(len(shown)))
            pairs = enumerate(zip(starts, shown, strict=True))
            clones = [imitate(start, each, rate=self.rate, seed=row).policy for row, (start, each) in pairs]
            leaves = zip(*map(jax.tree.leaves, clones), strict=True)
            return {f"{place}": np.stack(each) for place, each in enumerate(leaves)}

        fitted = work.part(name, make)
        leaves, structure = jax.tree.flatten(scratch.policies)
        return jax.tree.unflatten(structure, [fitted[f"{place}"] for place in range(len(leaves))])

    def _asked(self, work: Workspace, layout: Layout, scratch: Run, shown: Sequence[Demonstrations]) -> np.ndarray:
        """The reward of clones whose demonstrators were asked in turns, `(seeds,)`."""
        task = scratch.task
        each = self.asked // self.rounds
        gathered = [first_episodes(parts, each) for parts in shown]
        acting = self._still(work, task, self._clones(work, f"{layout}-asked-1", scratch, gathered))
        for turn in range(2, self.rounds + 1):
            for row, seen in enumerate(demonstrated(acting, each, seed=turn)):
                gathered[row] += seen.answered_by(policy_at(scratch.policies, row), seed=turn)
            acting = self._still(work, task, self._clones(work, f"{layout}-asked-{turn}", scratch, gathered))
        return acting.curve()[1].mean(1)

    def figure(self, values: Values) -> Figure:
        """For each layout: the reward of clones by the number of episodes, learning from there on, and how soon it
        reaches the demonstrators' level."""
        figure, grid = subplots(11, 3.3 * len(self.layouts), len(self.layouts), 3, squeeze=False)
        places = np.arange(len(self.episodes))
        for row, layout in zip(grid, self.layouts, strict=True):
            self._draw_at_once(row[0], values, layout)
            thousand = values["decision"] / 1000
            style: dict[str, Any] = {"records": min(SMOOTH, len(thousand)), "mean": True}
            for episodes, colour in zip(self.episodes, COLOURS, strict=False):
                draw_band(row[1], thousand, values[f"{layout} {episodes}"], colour, f"{episodes}", **style)
            draw_band(row[1], thousand, values[f"{layout} scratch"], "0.4", "none", **style)
            row[1].axhline(values[f"{layout} demonstrator at once"].mean(), color="0.3", linewidth=0.8, linestyle="--")
            row[1].set(xlabel="thousand decisions of learning", ylabel="reward per decision")
            row[1].legend(title="demonstrated\nepisodes", fontsize=8, title_fontsize=8, loc="lower right")
            kinds = ("scratch", *self.episodes)
            soon = [median_of(self._decisions(values, layout, each) / 1000) for each in kinds]
            draw_intervals(row[2], np.arange(-1, len(places)), soon, fmt="o-", color="black", markersize=4)
            row[2].set_xticks(np.arange(-1, len(places)), ["none", *map(str, self.episodes)])
            row[2].set(
                xlabel="demonstrated episodes",
                ylabel=f"thousand decisions to\n{LEVEL:.0%} of the demonstrators' reward",
            )
            row[2].set_ylim(0, None)
        return figure

    def _draw_at_once(self, axes: Axes, values: Values, layout: str) -> None:
        places = np.arange(len(self.episodes))
        found = np.stack([values[f"{layout} {episodes} at once"] for episodes in self.episodes])
        spread = np.linspace(-0.2, 0.2, found.shape[1])
        axes.plot(places[:, None] + spread, found, "o", color="0.75", markersize=3, markeredgewidth=0)
        draw_intervals(axes, places, [mean_of(each) for each in found], fmt="o-", color="black", markersize=4)
        middle = self.episodes.index(self.asked)
        asked = mean_of(values[f"{layout} asked at once"])
        draw_intervals(
            axes, [middle + 0.35], [asked], fmt="s", color="C3", markersize=4, label=f"asked in {self.rounds} turns"
        )
        for name, words, style in (("demonstrator", "demonstrators", "--"), ("start", "before learning", ":")):
            axes.axhline(values[f"{layout} {name} at once"].mean(), color="0.3", linewidth=0.8, linestyle=style)
            axes.text(0, values[f"{layout} {name} at once"].mean(), words, fontsize=8, va="bottom", ha="left")
        axes.set_xticks(places, [str(each) for each in self.episodes])
        axes.set(xlabel="demonstrated episodes", ylabel=f"{layout}: reward of clones per decision")
        axes.legend(fontsize=8, loc="lower right")

    def _decisions(self, values: Values, layout: str, kind: str | int) -> np.ndarray:
        """Decisions of learning until the demonstrators' level, `(seeds,)`."""
        level = LEVEL * values[f"{layout} demonstrator at once"].mean()
        return decisions_to(values["decision"], values[f"{layout} {kind}"], level)

    def claims(self, values: Values) -> Iterator[Claim]:
        for layout in self.layouts:
            yield from self._of_clones(values, layout)
            yield from self._of_learning(values, layout)

    def _of_clones(self, values: Values, layout: str) -> Iterator[Claim]:
        few, *_, many = self.episodes
        at_once = {
            each: values[f"{layout} {each} at once"] for each in ("demonstrator", "start", "asked", *self.episodes)
        }
        means = ", ".join(f"{at_once[each].mean():.3f} from {each}" for each in self.episodes)
        for episodes in (few, many):
            yield positive(
                f"A clone of {counted(episodes, 'episode')} does better than a policy before learning ({layout}).",
                mean_of(at_once[episodes] - at_once["start"]),
                "reward per decision minus that before learning",
                note=f"{at_once['start'].mean():.3f} before learning; {means}.",
                kind="extension",
                of="A clone does better at once than a policy before learning.",
            )
        yield at_least(
            WELL,
            f"A clone of {counted(many, 'episode')} is a good copy ({layout}).",
            mean_of(at_once[many] / at_once["demonstrator"].mean()),
            "reward relative to the demonstrators'",
            note=f"{at_once['demonstrator'].mean():.3f} of the demonstrators; {means}.",
            kind="extension",
            of="Many demonstrations make a good copy.",
        )
        yield positive(
            f"A clone of {counted(few, 'episode')} is a worse copy than one of {many} ({layout}).",
            mean_of(at_once[many] - at_once[few]),
            "reward per decision, difference",
            kind="extension",
            of="Few demonstrations copy worse.",
        )
        yield positive(
            f"A demonstrator that is asked in turns teaches more by as many episodes ({layout}).",
            mean_of(at_once["asked"] - at_once[self.asked]),
            f"reward per decision with {self.asked} episodes in {self.rounds} turns, minus that with as many at once",
            note=f"{at_once['asked'].mean():.3f} and {at_once[self.asked].mean():.3f}.",
            kind="extension",
            of="A demonstrator that is asked where the clone comes teaches more.",
        )

    def _of_learning(self, values: Values, layout: str) -> Iterator[Claim]:
        few, *_, many = self.episodes
        usual = self._decisions(values, layout, "scratch")
        last = values["decision"][-1]
        for episodes in (few, many):
            ours = self._decisions(values, layout, episodes)
            clone = f"a clone of {counted(episodes, 'episode')}"
            yield below(
                1,
                f"Learning reaches the demonstrators' level sooner from {clone} ({layout}).",
                median_of(ours / np.median(usual)),
                f"decisions to {LEVEL:.0%} of the demonstrators' reward, relative to the median from the start,",
                "times",
                note=f"Medians {np.median(ours):,.0f} and {np.median(usual):,.0f}; {int((ours == last).sum())} and "
                f"{int((usual == last).sum())} of {len(ours)} never get there, and count with all {last:,} decisions. "
                "The demonstrators' own learning is not counted.",
                kind="extension",
                of="Learning by reward reaches the demonstrators' level sooner from a clone.",
            )
            yield positive(
                f"Learning improves {clone} ({layout}).",
                mean_of(
                    final_reward(values[f"{layout} {episodes}"]) - np.roll(values[f"{layout} {episodes} at once"], 1)
                ),
                "reward per decision at the end minus that of the clone at once",
                kind="extension",
                of="Learning by reward goes on from a clone.",
            )
            yield at_least(
                LEVEL,
                f"From {clone}, learning ends as high as from the start ({layout}).",
                mean_of(
                    final_reward(values[f"{layout} {episodes}"]) / final_reward(values[f"{layout} scratch"]).mean()
                ),
                "final reward relative to that from the start",
                kind="extension",
                of="From a clone, learning ends as high as from the start.",
            )


def demonstrated(run: Run, episodes: int, seed: int = 0) -> list[Demonstrations]:
    """What the policy of each seed does in some episodes."""
    table = rollout(run, episodes=episodes, seed=seed)
    return [table.of(seed=each).demonstrations() for each in run.seeds]


def first_episodes(shown: Demonstrations, episodes: int) -> Demonstrations:
    """The first of the demonstrated episodes."""
    kept = np.asarray(shown.episodes) < episodes
    return Demonstrations(shown.observations[kept], shown.actions[kept], np.asarray(shown.episodes)[kept])
