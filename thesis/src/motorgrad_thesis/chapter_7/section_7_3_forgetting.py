"""Section 7.3: a Gaussian process of the objective surface that forgets samples."""

import time
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from motorgrad.learning import MeanReward, gpomdp
from motorgrad.policies import softmax
from motorgrad.schema import Range, count, static
from motorgrad.search import BayesianOptimisation, Found, search
from motorgrad.statistics import exact, mean_of
from motorgrad.tasks import Chain
from motorgrad.training import PolicyScore
from motorgrad.worlds import oracle
from motorgrad_thesis._claims import Claim, above, at_least
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, new_figure

METHODS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "all": ("all samples", "0.3", {}),
    "oldest": ("forgets the oldest", "C1", {"forgets": "oldest"}),
    "informative": ("forgets the least informative", "C0", {"forgets": "least-informative"}),
}
CANDIDATES = 4  # a round
STEPS = 100  # decisions of a candidate in each stream
STREAMS = 8
NUMBERS = 4  # of a candidate whose round is timed
REPEATED = 2  # rounds timed; the fastest counts


@experiment("sec-7.3-forgetting", "a Gaussian process that forgets", "section 7.3", needs=("tinygp", "search"))
class Forgetting(Experiment):
    """Bayesian optimisation of a policy, by a Gaussian process of scores and gradient estimates: with all samples, or
    with a memory of a few candidates beyond which the oldest or the least informative are forgotten.

    Left: the processor time of a round in which four candidates are chosen, given so many with four numbers each, whose
    scores and derivatives are known. Right: the search for the twelve parameters of a softmax policy on the chain; each
    candidate acts for 100 decisions in eight streams, which give its score and the mean of GPOMDP's estimates. What the
    best candidate so far earns is computed by the oracle.
    """

    reading: ClassVar[str] = (
        "The thesis calls the regression O(n²) in the number of samples. That is the work of one more sample, given "
        "the factors of the others. Fitting the settings of the process anew takes O(n³)."
    )

    lengths: tuple[int, ...] = static(
        (12, 28, 60), allowed=Range(12), help="candidates known to the process when a round is timed, rising"
    )
    memory: int = count(8, 4, 1_000, unit="candidates", help="that are not forgotten")
    evaluations: int = count(16, 8, 1_000, unit="candidates", help="of each search")
    seeds: int = count(10, 2, 1_000, help="number of searches by each method")
    first: int = count(0, 0, 10**5, help="the first seed")

    quick = smoke(lengths=(12, 28), evaluations=8, seeds=2, memory=4)

    def validate(self) -> None:
        super().validate()
        self.check_rising("lengths", 2)

    def method(self, name: str) -> BayesianOptimisation:
        """The search method of this name in `METHODS`."""
        memory = None if name == "all" else self.memory
        return BayesianOptimisation(CANDIDATES, initial=4, memory=memory, **METHODS[name][2])

    def run(self, work: Workspace) -> Values:
        found: Values = {"lengths": np.array(self.lengths)}
        for name in METHODS:
            timed = work.part(f"time-{name}", lambda name=name: {"seconds": self._seconds(name)})
            rows = [
                work.part(f"search-{name}-{seed}", lambda name=name, seed=seed: {"earned": self._earned(name, seed)})
                for seed in range(self.first, self.first + self.seeds)
            ]
            found[f"{name} seconds"] = timed["seconds"]
            found[f"{name} earned"] = np.array([row["earned"] for row in rows])
        found["candidates"] = CANDIDATES * np.arange(1, found["all earned"].shape[1] + 1)
        return found

    def _seconds(self, name: str) -> list[float]:
        """The time of a round given each of `lengths` candidates, compiled beforehand."""
        method = self.method(name)
        return [self._round(method, number) for number in self.lengths]

    def _round(self, method: BayesianOptimisation, number: int) -> float:
        random = np.random.default_rng(number)
        places = random.random((number, NUMBERS))
        if method.memory is not None:
            places = places[-method.memory - CANDIDATES :]  # what a search still knows at the end of a round
        apart = places - 0.4
        noise = 0.1 * random.standard_normal(places.shape)
        state = method.tell(method.begin(np.full(NUMBERS, 0.5)), places, -np.sum(apart**2, axis=1) + noise[:, 0])
        state = method.tell_gradients(state, places, -2 * apart + noise, np.full(places.shape, 0.01))
        taken = []
        for _ in range(1 + REPEATED):
            started = time.process_time()
            method.ask(state, np.random.default_rng(0))
            taken.append(time.process_time() - started)
        return min(taken[1:])

    def _earned(self, name: str, seed: int) -> np.ndarray:
        """What the best candidate after every round earns exactly, as a share of the best policy."""
        task = Chain()
        score = PolicyScore(task, softmax(task), STEPS, STREAMS, seed=1000 * seed, gradient=gpomdp(0.9, MeanReward()))
        method = self.method(name)
        found = search(score, score.space(), method, evaluations=self.evaluations, seed=seed, progress=False)
        rounds = range(CANDIDATES, len(found.scores) + 1, CANDIDATES)
        best = oracle.optimal_policy(task.dynamics)[1]
        return np.array([oracle.average_reward(task.dynamics, _best_of(score, found, each)) for each in rounds]) / best

    def figure(self, values: Values) -> Figure:
        figure = new_figure(9.5, 3.8)
        left, right = figure.subplots(1, 2)
        for name, (label, colour, _) in METHODS.items():
            left.plot(values["lengths"], values[f"{name} seconds"], "o-", color=colour, markersize=4, label=label)
            draw_band(right, values["candidates"], values[f"{name} earned"], colour, label)
        left.set(xscale="log", yscale="log", xlabel="candidates so far", ylabel="processor seconds per round")
        left.set(xticks=values["lengths"], xticklabels=values["lengths"], title="cost of a round")
        left.minorticks_off()
        left.legend(fontsize=8)
        right.axvline(self.memory, color="0.6", linewidth=0.8, linestyle="--")
        right.set(xlabel="candidates", ylabel="share of the best average reward", title="what the search reaches")
        right.set(xticks=values["candidates"], ylim=(0, 1.02))
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        lengths = values["lengths"]
        seconds = values["all seconds"]
        growth = np.log(seconds[-1] / seconds[-2]) / np.log(lengths[-1] / lengths[-2])
        yield at_least(
            2,
            "The work of the regression grows with the square of the number of samples.",
            exact(growth),
            f"power of the number of candidates, from {lengths[-2]} to {lengths[-1]}, with which a round's time grows,",
            note=f"{seconds[-2]:.2g} s and {seconds[-1]:.2g} s on this machine, the fastest of {REPEATED} each.",
            untested="The statement is about many samples; with so few, costs that do not grow are still a part.",
        )
        for name in ("oldest", "informative"):
            words = METHODS[name][0]
            ours = values[f"{name} seconds"]
            yield above(
                2,
                f"A process that {words} makes a round cheaper.",
                exact(seconds[-1] / ours[-1]),
                f"time of a round after {lengths[-1]} candidates with all, relative to a memory of {self.memory},",
                "times",
                note=f"{seconds[-1]:.2g} s and {ours[-1]:.2g} s on this machine.",
                kind="extension",
                of="Forgetting samples makes the regression practical.",
            )
            apart = values[f"{name} earned"][:, -1] - values["all earned"][:, -1]
            yield above(
                -0.02,
                f"A search that {words} reaches as much as with all samples.",
                mean_of(apart),
                "share of the best average reward minus that with all samples",
                note=f"Means {values[f'{name} earned'][:, -1].mean():.3f} and {values['all earned'][:, -1].mean():.3f} "
                f"after {self.evaluations} candidates, with a memory of {self.memory}.",
                kind="extension",
                of="Forgetting samples loses nothing.",
            )


def _best_of(score: PolicyScore, found: Found, number: int) -> Any:
    """The policy of the greatest score among the first so many candidates."""
    top = int(np.nanargmax(found.scores[:number]))
    return score.policy_of(dict(zip(found.space.names, found.candidates[top].tolist(), strict=True)))
