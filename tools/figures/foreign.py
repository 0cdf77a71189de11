"""The figures of foreign environments: how Gymnasium's are learned."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from motorgrad.learning import SGD, Agent, olgarb
from motorgrad.policies import softmax
from motorgrad.presets import natural
from motorgrad.tasks import from_gymnasium
from motorgrad.training import Run
from tools.figures._style import BLUE, level, panels
from tools.figures._work import Work

SEEDS = 10
# id: (options, of them those of gymnasium.make, learning rate, decisions, the usual bar, limits of the axis)
LEARNT = {
    "CartPole-v1": ({"end_reward": -20.0}, {}, 5e-3, 100_000, 475, (0, 520)),
    "MountainCar-v0": ({"end_reward": 100.0, "repeat": 4}, {"max_episode_steps": 1000}, 1e-3, 80_000, -110, (-500, 0)),
    "Acrobot-v1": ({"end_reward": 100.0, "repeat": 2}, {}, 5e-4, 50_000, -100, (-520, 0)),
}


# id: (decisions, the usual bar, limits of the axis)
BY_PRESET = {
    "CartPole-v1": (50_000, 475, (0, 520)),
    "InvertedPendulum-v5": (100_000, 950, (0, 1050)),
    "MountainCarContinuous-v0": (100_000, 90, (-60, 105)),
    "Pendulum-v1": (100_000, -250, (-1600, 0)),
}


def preset(work: Work) -> Figure:
    """Return of an episode by the preset alone, every seed, median and quartiles."""
    figure, axes = panels(len(BY_PRESET))
    for panel, (name, (steps, bar, limits)) in zip(axes, BY_PRESET.items(), strict=True):
        task = from_gymnasium(name)
        run = work.train(task, natural(task, steps), steps, SEEDS, keep=f"natural-{name}")
        _curve(panel, run, name, bar, limits, block=4)
    axes[0].set_ylabel("return of an episode")
    return figure


def _curve(panel: Any, run: Run, name: str, bar: float, limits: tuple[float, float], block: int = 1) -> None:
    """Every seed, median and quartiles, with so many records in each point."""
    window = run.config["run"]["window"]
    decisions, returns = run.curve("return", smooth=block * window if block > 1 else None)  # of all episodes in a point
    decisions = decisions[block - 1 :: block]
    returns = returns[:, block - 1 :: block]
    x = decisions / 1000
    seen = np.isfinite(returns).any(axis=0)
    panel.plot(x, returns.T, color=BLUE, alpha=0.35, linewidth=0.5)
    if seen.any():  # a short run may end no episode
        low, median, high = np.nanpercentile(returns[:, seen], [25, 50, 75], axis=0)
        panel.fill_between(x[seen], low, high, color=BLUE, alpha=0.25, linewidth=0)
        panel.plot(x[seen], median, color=BLUE, linewidth=1.8)
    level(panel, bar, "")
    panel.set(title=name, xlabel="thousand decisions", ylim=limits)


def learning(work: Work) -> Figure:
    """Return of an episode, every seed, median and quartiles, with the settings of the page."""
    figure, axes = panels(len(LEARNT))
    for panel, (name, (options, given, rate, steps, bar, limits)) in zip(axes, LEARNT.items(), strict=True):
        task = from_gymnasium(name, scaling="running", **options, **given)
        agent = Agent(softmax(task), olgarb(decay=0.95), SGD(rate))
        _curve(panel, work.train(task, agent, steps, SEEDS, keep=name), name, bar, limits)
    axes[0].set_ylabel("return of an episode")
    return figure
