"""Section 2.5.1: annealing and a genetic algorithm as policy searches, against climbing the gradient."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float

from motorgrad.policies import softmax
from motorgrad.schema import count
from motorgrad.search import Annealing, Found, Genetic, Method, Range, Space, search
from motorgrad.statistics import first_time, mean_of, median_of, moving_mean
from motorgrad.tasks import make
from motorgrad.training import PolicyScore, agent_for
from motorgrad.worlds import oracle
from motorgrad_thesis._claims import Claim, above, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, draw_intervals, subplots
from motorgrad_thesis.chapter_2._landscape import Bumps, climb, greatest, surface
from motorgrad_thesis.chapter_2.figure_2_2 import NARROW, SIDE, WIDE

METHODS: dict[str, Method] = {"annealing": Annealing(), "genetic": Genetic()}
COLOURS = {"annealing": "#c8452f", "genetic": "#d9902f", "gradient": "#3b6fb6"}
LABELS = {"annealing": "annealing", "genetic": "genetic algorithm", "gradient": "policy gradient"}
LENGTH = 100  # decisions of a candidate in each stream
STREAMS = 2
REACHED = 0.9  # of the best average reward
SMOOTH = 5  # records of the moving average of the gradient's rewards
LEAST = 0.02  # the standard deviation of the Gaussian policies that are searched
NEAR = 0.05  # the best optimum counts as found within this distance of its reward
DRAWS = 10  # rewards by which a Gaussian policy is scored
CLIMBS = 4000  # steps of exact climbing
STARTS = 17  # narrow starts


@experiment("sec-2.5.1-search", "global search", "section 2.5.1")
class GlobalSearch(Experiment):
    """Simulated annealing and a genetic algorithm over the parameters of a policy. Left: on the chain of six states,
    the average reward of the best candidate so far over the decisions that all candidates made, and the reward of a
    learner by the policy gradient. Right: on random rewards of one action, as in figure 2.2, how often they find the
    best optimum with so many samples, and how often climbing the exact gradient does.
    """

    reading: ClassVar[str] = (
        '"Much greater than the true sample complexity" is tested as: the median search needs at least twice as many '
        "decisions as the policy gradient until its policy earns nine tenths of what the best one does. The text names "
        "no task or settings."
    )

    seeds: int = count(12, 2, 1000, help="number of searches and of learners on the chain")
    rounds: int = count(60, 1, 10_000, help="of each search on the chain, twelve candidates each")
    steps: int = count(60_000, 2_000, 10**8, unit="decisions", help="of each learner on the chain")
    rewards: int = count(100, 2, 10_000, help="number of random rewards of one action")
    evaluations: int = count(720, 12, 10**6, help="number of candidates of each search on a random reward")
    seed: int = count(0, help="seed of the random rewards")

    quick = smoke(seeds=2, rounds=2, steps=2_000, rewards=2, evaluations=24)

    def run(self, work: Workspace) -> Values:
        task: Any = make("chain")
        found: Values = {"best": np.array(oracle.optimal_policy(task.dynamics)[1])}
        for name in METHODS:
            found |= work.part(f"chain-{name}", lambda n=name: {f"{n} earned": self._searched(n)})
        run = work.train(task, agent_for(task), self.steps, self.seeds)
        found["gradient decisions"], found["gradient reward"] = run.curve()
        for name in METHODS:
            found |= work.part(f"hills-{name}", lambda n=name: {f"{n} optimum": self._hills(n)})
        return found | work.part("hills-gradient", self._climbed)

    @property
    def decisions(self) -> int:
        """Decisions in a round of a search on the chain."""
        return METHODS["annealing"].batch(1) * STREAMS * LENGTH

    def _searched(self, name: str) -> Float[np.ndarray, "seeds rounds"]:
        """What the best candidate after every round earns, exactly."""
        task: Any = make("chain")
        rows = []
        for seed in range(self.seeds):
            score = PolicyScore(task, softmax(task), LENGTH, STREAMS, fixed=False)
            method = METHODS[name]
            evaluations = self.rounds * method.batch(1)
            found = search(score, score.space(), method, evaluations=evaluations, seed=seed, progress=False)
            rows.append(_earned(score, found))
        return np.array(rows)

    def _hills(self, name: str) -> Bool[np.ndarray, " rewards"]:
        """Whether a search over the mean and the standard deviation finds the best optimum of each random reward."""
        space = Space({"mean": Range(-SIDE, SIDE), "deviation": Range(LEAST, SIDE, WIDE)})
        reached = []
        for index, bumps in enumerate(self._random_rewards()):

            def score(candidates: Any, random: np.random.Generator, bumps: Bumps = bumps) -> np.ndarray:
                rows = np.array([[each["mean"], each["deviation"]] for each in candidates])
                actions = rows[:, :1] + rows[:, 1:] * random.standard_normal((len(rows), DRAWS))
                away = (actions[..., None] - bumps.centre) / bumps.width
                return np.asarray((bumps.height * np.exp(-0.5 * away**2)).sum(-1).mean(1))

            found = search(score, space, METHODS[name], evaluations=self.evaluations, seed=index, progress=False)
            best = np.array([list(found.best.values())], float)
            reached.append(_values(bumps, best)[0] > greatest(bumps, -SIDE - 1, SIDE + 1) - NEAR)
        return np.array(reached)

    def _climbed(self) -> Values:
        """Whether climbing the exact gradient finds it: from a wide start, and the share of narrow starts."""
        starts = np.array([(0.0, WIDE), *((mean, NARROW) for mean in np.linspace(-SIDE, SIDE, STARTS))])
        reached = []
        for bumps in self._random_rewards():
            ends = climb(bumps, starts, CLIMBS)[:, -1]
            reached.append(_values(bumps, ends) > greatest(bumps, -SIDE - 1, SIDE + 1) - NEAR)
        each = np.array(reached)
        return {"wide optimum": each[:, 0] * 1.0, "narrow optimum": each[:, 1:].mean(axis=1)}

    def _random_rewards(self) -> list[Bumps]:
        """Sums of five bumps, as for figure 2.2."""
        numbers = np.random.default_rng(self.seed)
        drawn = [numbers.uniform([[0.2], [-SIDE], [0.3]], [[1.0], [SIDE], [0.6]], (3, 5)) for _ in range(self.rewards)]
        return [Bumps(*each) for each in drawn]

    def figure(self, values: Values) -> Figure:
        figure, (left, right) = subplots(11, 4, columns=2, width_ratios=[1.3, 1])
        self._draw_chain(left, values)
        _draw_hills(right, values)
        return figure

    def _draw_chain(self, axes: Axes, values: Values) -> None:
        for name in METHODS:
            earned = values[f"{name} earned"]
            draw_band(axes, self.decisions * np.arange(1, 1 + earned.shape[1]), earned, COLOURS[name], LABELS[name])
        decisions = values["gradient decisions"]
        style = {"colour": COLOURS["gradient"], "label": LABELS["gradient"], "records": self._records(values)}
        draw_band(axes, decisions, values["gradient reward"], **style)
        best = float(values["best"])
        axes.axhline(best, color="0.3", linestyle=":", label="best policy")
        axes.axhline(REACHED * best, color="0.7", linewidth=0.8)
        axes.set(xlabel="decisions", ylabel="average reward", xscale="log", title="the chain, twelve parameters")
        axes.legend(fontsize=9, loc="lower right")

    def _records(self, values: Values) -> int:
        return min(SMOOTH, values["gradient reward"].shape[1])

    def claims(self, values: Values) -> Iterator[Claim]:
        level = REACHED * float(values["best"])
        smooth = moving_mean(values["gradient reward"], self._records(values))
        times = values["gradient decisions"][self._records(values) - 1 :]
        gradient = first_time(times, smooth >= level, times[-1])
        typical = float(np.median(gradient))
        for name in METHODS:
            earned = values[f"{name} earned"]
            spent = self.decisions * np.arange(1, 1 + earned.shape[1])
            reached = earned >= level
            needed = first_time(spent, reached, spent[-1])
            yield above(
                2.0,
                f"A search needs many more samples than the policy gradient ({LABELS[name]}).",
                median_of(needed / typical),
                "decisions, relative to the policy gradient",
                of="The number of samples that global optimisation needs is much greater than necessary.",
                note=f"On the chain, until {REACHED:g} of the best average reward: median {np.median(needed):,.0f} "
                f"against {typical:,.0f} decisions. A search that does not get there counts with all its decisions; "
                f"{reached.any(axis=1).sum()} of {len(reached)} do.",
            )
        for name in METHODS:
            for start, words in (("narrow", f"narrow starts (σ = {NARROW:g})"), ("wide", f"a wide one (σ = {WIDE:g})")):
                yield positive(
                    f"Of several optima, a search finds the best more often than climbing from {words} "
                    f"({LABELS[name]}).",
                    mean_of(values[f"{name} optimum"] - values[f"{start} optimum"]),
                    unit="difference of the shares of random rewards",
                    kind="extension",
                    note=f"{values[f'{name} optimum'].mean():.2g} against {values[f'{start} optimum'].mean():.2g}; "
                    f"{self.evaluations:,} candidates of {DRAWS} samples each, against exact gradients.",
                )


def _earned(score: PolicyScore, found: Found) -> Float[np.ndarray, " rounds"]:
    """What the candidate of the greatest score so far earns after every round, exactly."""
    mdp: Any = score.task.dynamics
    tops = [int(np.nanargmax(found.scores[:end])) for end in range(found.batch, len(found.scores) + 1, found.batch)]
    exact = {}
    for top in set(tops):
        named = dict(zip(found.space.names, found.candidates[top].tolist(), strict=True))
        exact[top] = oracle.average_reward(mdp, score.policy_of(named))
    return np.array([exact[top] for top in tops])


def _values(bumps: Bumps, points: Float[np.ndarray, "points 2"]) -> np.ndarray:
    return np.asarray(surface(bumps, np.asarray(points, np.float32)), float)


def _draw_hills(axes: Axes, values: Values) -> None:
    names = {**LABELS, "narrow": f"gradient, σ = {NARROW:g}", "wide": f"gradient, σ = {WIDE:g}"}
    for place, name in enumerate(("annealing", "genetic", "narrow", "wide")):
        measured = mean_of(values[f"{name} optimum"])
        colour = COLOURS.get(name, COLOURS["gradient"])
        axes.bar(place, measured.value, color=colour, alpha=0.4)
        draw_intervals(axes, [place], [measured], fmt="none", ecolor=colour)
    axes.set_xticks(
        range(4), [names[each].replace(" ", "\n", 1) for each in ("annealing", "genetic", "narrow", "wide")]
    )
    axes.set(ylabel="best optimum found, share of rewards", title="random rewards of one action", ylim=(0, 1))
