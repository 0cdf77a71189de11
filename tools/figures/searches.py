"""The figures of searches over the parameters of a policy."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.learning import MeanReward, gpomdp
from motorgrad.policies import softmax
from motorgrad.search import (
    BayesianOptimisation,
    Boltzmann,
    CmaEs,
    EvolutionStrategy,
    Found,
    Method,
    Pulled,
    Uniform,
    search,
)
from motorgrad.training import PolicyScore
from motorgrad.worlds import oracle
from tools.figures._style import BLUE, GREEN, ORANGE, PINK, RED, SKY, band, level, panels
from tools.figures._work import Work

SEEDS = 12
ROUNDS = 30
BATCH = 12
STEPS = 100
METHODS: dict[str, tuple[Method, str]] = {
    "uniform": (Uniform(BATCH), SKY),
    "Boltzmann": (Boltzmann(BATCH), GREEN),
    "pulled": (Pulled(BATCH), ORANGE),
    "evolution strategy": (EvolutionStrategy(BATCH), PINK),
    "CMA-ES": (CmaEs(BATCH), BLUE),
}
STREAMS = (1, 2, 4, 8)


SPARING = BayesianOptimisation(4, initial=4)
EXPENSIVE: dict[str, tuple[Method, bool, str]] = {
    "uniform": (Uniform(4), False, SKY),
    "CMA-ES": (CmaEs(8), False, BLUE),
    "Bayesian": (SPARING, False, GREEN),
    "Bayesian, with gradients": (SPARING, True, RED),
}


def earned(score: PolicyScore, found: Found, every: int) -> np.ndarray:
    """What the best candidate so far earns exactly after every so many, as a share of the best policy."""
    mdp: Any = score.task.dynamics
    tops = [int(np.nanargmax(found.scores[:number])) for number in range(every, len(found.scores) + 1, every)]
    exact = {}
    for top in set(tops):
        named = dict(zip(found.space.names, found.candidates[top].tolist(), strict=True))
        exact[top] = oracle.average_reward(mdp, score.policy_of(named))
    return np.array([exact[top] for top in tops]) / oracle.optimal_policy(mdp)[1]


def bayesian(work: Work) -> Figure:
    """Bayesian optimisation with and without gradients, on a world with four parameters and on one with twelve."""
    seeds = 8 if work.most > 10_000 else 1
    figure, axes = panels(2, sharey=True)
    worlds = ("three-state", "four parameters", 24), ("chain", "twelve parameters", 16)
    for place, (name, words, evaluations) in zip(axes, worlds, strict=True):
        evaluations = evaluations if work.most > 10_000 else 8
        task: Any = mg.make(name)
        for label, (method, gradients, colour) in EXPENSIVE.items():
            # whatever the number of parameters
            rows = []
            every = method.batch(1)
            for seed in range(seeds):
                gradient = gpomdp(0.9, MeanReward()) if gradients else None
                score = PolicyScore(task, softmax(task), STEPS, 8, seed=seed * 1000, gradient=gradient)
                found = search(score, score.space(), method, evaluations=evaluations, seed=seed, progress=False)
                rows.append(earned(score, found, every))
            band(place, every * np.arange(1, len(rows[0]) + 1), np.array(rows), colour, label)
        level(place, 1, "best policy")
        place.set(xlabel="candidates", title=f"{name}, {words}", xticks=range(4, evaluations + 1, 4))
    axes[0].set_ylabel("share of the best average reward")
    axes[0].legend(loc="lower right")
    return figure


def policies(work: Work) -> Figure:
    """What the best candidate so far earns exactly: by method, and by the number of streams."""
    task: Any = mg.make("chain")
    start = softmax(task)
    seeds, rounds = (SEEDS, ROUNDS) if work.most > 10_000 else (1, 1)
    best = oracle.optimal_policy(task.dynamics)[1]

    def found(method: Method, streams: int, fixed: bool, seed: int) -> tuple[np.ndarray, float]:
        """What the best candidate after every round earns, as a share of the best policy; its score in the end."""
        score = PolicyScore(task, start, STEPS, streams, fixed, seed * 1000)
        done = search(score, score.space(), method, evaluations=rounds * BATCH, seed=seed, progress=False)
        return earned(score, done, BATCH), float(np.nanmax(done.scores)) / best

    figure, (left, right) = panels(2)
    x = BATCH * np.arange(1, rounds + 1)
    for name, (method, colour) in METHODS.items():
        band(left, x, np.array([found(method, 8, True, seed)[0] for seed in range(seeds)]), colour, name)
    level(left, 1, "best policy")
    left.set(xlabel="candidates", ylabel="share of the best average reward", title="methods, eight fixed streams")
    left.legend(loc="lower right")
    for fixed, colour, label in ((True, BLUE, "fixed streams"), (False, RED, "new ones in each round")):
        each = [[found(METHODS["CMA-ES"][0], n, fixed, seed) for seed in range(seeds)] for n in STREAMS]
        band(right, np.array(STREAMS), np.array([[exact[-1] for exact, _ in row] for row in each]).T, colour, label)
        scores = np.median([[score for _, score in row] for row in each], axis=1)
        # both lie at the most that can be earned, one upon the other
        right.plot(STREAMS, scores, color="gray", linestyle=":", label=None if fixed else "median of the best scores")
    right.set(xscale="log", xticks=STREAMS, xticklabels=STREAMS, xlabel="streams", title="CMA-ES: what is found")
    right.minorticks_off()
    right.legend(loc="upper left")
    return figure
