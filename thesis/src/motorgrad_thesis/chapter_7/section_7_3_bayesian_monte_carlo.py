"""Section 7.3: the posterior of a gradient given sampled episodes, in place of their mean."""

from collections.abc import Callable, Iterator
from typing import ClassVar, NamedTuple

import numpy as np

from motorgrad.learning import GradientPosterior, bayesian_gradient
from motorgrad.policies import Policy, softmax
from motorgrad.schema import Range, count, static
from motorgrad.statistics import mean_of
from motorgrad.worlds import FiniteMDP, chain, episodes, oracle, three_state
from motorgrad_thesis._claims import Claim, below, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_intervals, new_figure
from motorgrad_thesis.chapter_3._estimates import comparison_point, scores

WORLDS: dict[str, tuple[Callable[[], FiniteMDP], Callable[[FiniteMDP], Policy], int]] = {
    "three states": (three_state, lambda _: comparison_point(), 10),
    "walk of 4": (lambda: chain(4), lambda mdp: softmax(mdp.states, mdp.actions), 12),
}
"""Worlds by name, with the policy at which the gradient is taken, and the decisions of an episode."""

METHODS = {
    "classical": ("classical: mean of return × score", "0.5"),
    "baseline": ("classical, mean return as baseline", "C1"),
    "integrand": ("Bayesian, of the integrand", "C2"),
    "return": ("Bayesian, of the return", "C0"),
    "visited": ("the same, Fisher matrix from visits", "C3"),
}
COVERED = 1.96  # standard deviations either side of the mean


class Episodes(NamedTuple):
    """Sampled episodes: `returns` (runs, episodes); `scores` (runs, episodes, parameters); and `fisher` (runs,
    episodes, parameters, parameters), the sum of the Fisher matrices of the decisions at the states visited."""

    returns: np.ndarray
    scores: np.ndarray
    fisher: np.ndarray


@experiment("sec-7.3-bayesian-monte-carlo", "the posterior of a gradient", "section 7.3")
class BayesianMonteCarlo(Experiment):
    """The gradient of the return of short episodes at fixed parameters, estimated from a few of them: by the mean of
    return times score, with and without a baseline, and by the posterior mean of Bayesian Monte Carlo. Errors are
    against the exact gradient of the oracle.

    The Bayesian estimates know the exact Fisher matrix, which depends on the policy and the dynamics, but not on
    rewards; one estimates it from the states that the same episodes visit.
    """

    reading: ClassVar[str] = (
        "The thesis proposes to infer a posterior of the integrand, and gives no algorithm; ours is that of "
        "Ghavamzadeh and Engel (2006), with a constant in the return and an integral over the noise."
    )

    numbers: tuple[int, ...] = static(
        (5, 10, 20, 40, 80, 160), allowed=Range(4), help="numbers of episodes of an estimate, rising"
    )
    runs: int = count(400, 2, 100_000, help="repetitions of each estimate")

    quick = smoke(numbers=(5, 20), runs=20)

    def validate(self) -> None:
        super().validate()
        self.check_rising("numbers")

    def run(self, work: Workspace) -> Values:
        found: Values = {"numbers": np.array(self.numbers)}
        for name in WORLDS:
            made = work.part(name.replace(" ", "-"), lambda name=name: self._estimated(name))
            found |= {f"{name} {key}": value for key, value in made.items()}
        return found

    def _estimated(self, name: str) -> Values:
        """For each method, the squared error of each estimate relative to the squared gradient, `(numbers, runs)`; and
        the share of the parameters whose exact derivative the posterior's 95 % interval has."""
        make, policy_for, steps = WORLDS[name]
        mdp = make()
        policy = policy_for(mdp)
        whole = episodes(mdp, steps)
        exact = steps * oracle.flat(oracle.gradient(whole, policy))
        fisher = steps * oracle.fisher(whole, policy)
        made: Values = {}
        errors: dict[str, list[list[float]]] = {method: [[] for _ in self.numbers] for method in METHODS}
        inside: dict[str, list[list[float]]] = {method: [[] for _ in self.numbers] for method in METHODS}
        for place, number in enumerate(self.numbers):
            drawn = sample(mdp, policy, steps, number, self.runs, np.random.default_rng([number, steps]))
            for returns, score, seen in zip(*drawn, strict=True):
                means, posteriors = estimates(returns, score, fisher, seen.mean(axis=0))
                for method, mean in means.items():
                    errors[method][place].append(np.sum((mean - exact) ** 2) / np.sum(exact**2))
                for method, posterior in posteriors.items():
                    spread = COVERED * np.sqrt(np.diag(posterior.covariance))
                    inside[method][place].append(float(np.mean(np.abs(posterior.mean - exact) <= spread + 1e-9)))
        made |= {f"{method} error": np.array(each) for method, each in errors.items()}
        made |= {f"{method} inside": np.array(each) for method, each in inside.items() if each[0]}
        return made

    def figure(self, values: Values) -> Figure:
        figure = new_figure(11, 4)
        panels = figure.subplots(1, 3)
        for axes, name in zip(panels, WORLDS, strict=False):
            for method, (label, colour) in METHODS.items():
                measured = [mean_of(each) for each in values[f"{name} {method} error"]]
                draw_intervals(
                    axes, values["numbers"], measured, fmt="o-", markersize=4, linewidth=1, color=colour, label=label
                )
            axes.set(xscale="log", yscale="log", xlabel="episodes", title=name)
            axes.set(xticks=values["numbers"], xticklabels=values["numbers"])
            axes.minorticks_off()
        panels[0].set_ylabel("mean squared error / squared gradient")
        for name, style in zip(WORLDS, ("-", "--"), strict=True):
            for method in ("integrand", "return", "visited"):
                share = values[f"{name} {method} inside"].mean(axis=1)
                panels[2].plot(values["numbers"], 100 * share, style, color=METHODS[method][1])
            panels[2].plot([], [], style, color="0.4", label=name)
        panels[2].axhline(95, color="0.6", linewidth=0.8)
        panels[2].set(xscale="log", xlabel="episodes", ylabel="% of derivatives in the 95 % interval", ylim=(0, 102))
        panels[2].set(title="what the posterior says of itself")
        panels[2].set(xticks=values["numbers"], xticklabels=values["numbers"])
        panels[2].minorticks_off()
        panels[2].legend(fontsize=8, loc="lower right")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        """For the fewest episodes, a middle number and the most."""
        places = sorted({0, len(self.numbers) // 2, len(self.numbers) - 1})
        judged = {place: self.numbers[place] for place in places}
        for name in WORLDS:
            for method, against, statement in (
                ("return", "classical", "A posterior is more accurate than classical Monte Carlo from as few episodes"),
                ("return", "baseline", "It is more accurate than with a baseline, too"),
                ("visited", "baseline", "It is so with a Fisher matrix from the states visited"),
                ("integrand", "classical", "So is the posterior of the whole integrand"),
            ):
                for place, number in judged.items():
                    usual = values[f"{name} {against} error"][place]
                    ours = values[f"{name} {method} error"][place]
                    yield below(
                        1,
                        f"{statement} ({name}, {number} episodes).",
                        mean_of(ours / usual.mean()),
                        "mean squared error relative to that of classical Monte Carlo"
                        f"{' with the mean return as baseline' if against == 'baseline' else ''}",
                        "times",
                        note=f"{ours.mean():.3g} and {usual.mean():.3g} of the squared gradient.",
                        kind="extension",
                        of=f"{statement}.",
                    )
            for place, number in judged.items():
                yield within(
                    0.9,
                    1,
                    f"The posterior of the return knows how accurate it is ({name}, {number} episodes).",
                    mean_of(values[f"{name} return inside"][place]),
                    "share of derivatives in their 95 % intervals",
                    kind="extension",
                    of="The posterior of the return knows how accurate it is.",
                )


def sample(mdp: FiniteMDP, policy: Policy, steps: int, number: int, runs: int, random: np.random.Generator) -> Episodes:
    """Episodes of so many `steps`, a `number` of them for each of several `runs`."""
    chance = oracle.action_probabilities(mdp, policy)
    score = scores(mdp, policy)
    matrices = np.einsum("sa,sai,saj->sij", chance, score, score)
    size = score.shape[-1]
    state = np.full((runs, number), mdp.start)
    returns = np.zeros((runs, number))
    total = np.zeros((runs, number, size))
    fisher = np.zeros((runs, number, size, size))
    for _ in range(steps):
        action = _drawn(chance[state], random)
        after = _drawn(mdp.transitions[action, state], random)
        total += score[state, action]
        fisher += matrices[state]
        returns += mdp.rewards[after] if mdp.rewards.ndim == 1 else mdp.rewards[action, state]
        state = after
    return Episodes(returns, total, fisher)


def estimates(
    returns: np.ndarray, score: np.ndarray, fisher: np.ndarray, visited: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, GradientPosterior]]:
    """The estimate of every method from the episodes of one run, and the posteriors among them. Where all returns are
    the same, the episodes say nothing, and posteriors have the mean 0 and no bounds."""
    apart = returns - returns.mean()
    means = {
        "classical": returns @ score / len(returns),
        "baseline": apart @ score / (len(returns) - 1),  # as the mean is of the same returns
    }
    size = score.shape[1]
    nothing = GradientPosterior(np.zeros(size), np.diag(np.full(size, np.inf)))
    known = np.ptp(returns) > 0
    posteriors = {
        "integrand": bayesian_gradient(returns, score, fisher, "integrand") if known else nothing,
        "return": bayesian_gradient(returns, score, fisher) if known else nothing,
        "visited": bayesian_gradient(returns, score, visited) if known else nothing,
    }
    return means | {name: each.mean for name, each in posteriors.items()}, posteriors


def _drawn(chances: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """An index from each row of probabilities."""
    above = random.random(chances.shape[:-1])[..., None] >= np.cumsum(chances, axis=-1)[..., :-1]
    return above.sum(axis=-1)
