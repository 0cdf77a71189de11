"""Figures of credit: which actions a reward, or a value, is credited to."""

import numpy as np
from matplotlib.figure import Figure

from motorgrad.worlds import oracle
from tools.figures._style import BLUE, GREEN, ORANGE, RED, panels
from tools.figures.critics import POLICY, TASK


def angle(one: np.ndarray, other: np.ndarray) -> float:
    """The angle between two vectors, in degrees."""
    cosine = one @ other / (np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def discounting() -> Figure:
    """Exact gradients: how discounted ones lie to that of the average reward, and what the trace's decay does."""
    figure, (turned, traces) = panels(2, height=3.0)
    mdp = TASK.dynamics
    average = oracle.flat(oracle.gradient(mdp, POLICY))
    horizons = np.geomspace(1.25, 300, 40)
    alike = [oracle.flat(oracle.biased_gradient(mdp, POLICY, 1 - 1 / float(h))) for h in horizons]
    start = [oracle.flat(oracle.discounted_gradient(mdp, POLICY, 1 - 1 / float(h))) for h in horizons]
    turned.plot(horizons, [angle(each, average) for each in alike], color=BLUE, label="all decisions alike")
    turned.plot(horizons, [angle(each, average) for each in start], color=RED, label="from the start")
    turned.set(xscale="log", xlabel=r"horizon $1/(1 - \gamma)$", ylabel=r"angle to $\nabla\eta$ (°)")
    turned.legend(fontsize=7)
    decays, discount = np.linspace(0, 1, 41), 0.9
    exact = oracle.flat(oracle.discounted_gradient(mdp, POLICY, discount))
    rules = {r"right: $\lambda$": (1.0, GREEN), r"wrong: $\gamma\lambda$": (discount, ORANGE)}
    for label, (factor, colour) in rules.items():
        found = [oracle.flat(oracle.discounted_gradient(mdp, POLICY, discount, factor * float(d))) for d in decays]
        errors = [np.linalg.norm(each - exact) / np.linalg.norm(exact) for each in found]
        traces.plot(decays, errors, color=colour, label=f"decay of the trace, {label}")
    traces.set(xlabel=r"$\lambda$", ylabel="bias, relative", title=rf"from the start, $\gamma$ = {discount}, no critic")
    traces.legend(fontsize=7)
    return figure
