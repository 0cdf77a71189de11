"""Figures of the tasks on finite MDPs: what they are, and how they are learned."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from motorgrad.policies import hyperplanes
from motorgrad.tasks import CallAdmission, Chain, ThreeState
from motorgrad.worlds import AdmissionThresholds, oracle
from tools.figures._diagram import frame, moves, states
from tools.figures._style import BLUE, COLOURS, ORANGE, RED, band, level, panels
from tools.figures._work import Work

SEEDS = 20


def three_state() -> Figure:
    """The transitions of both actions."""
    mdp = ThreeState().dynamics
    places = [(0.0, 0.0), (0.75, 1.2), (1.5, 0.0)]
    figure, axes = panels(2, height=2.7)
    for action, (panel, colour) in enumerate(zip(axes, (BLUE, RED), strict=True)):
        states(panel, places, "ABC", mdp.rewards)
        moves(panel, places, mdp.transitions[action], colour, 0.18)
        frame(panel, places)
        panel.set_title(f"action {action}", color=colour)
    return figure


def three_state_learning(work: Work) -> Figure:
    """The learner that goes with the task."""
    task = ThreeState()
    decisions, rewards = work.train(task, None, 20_000, SEEDS).curve()
    figure, axes = panels()
    band(axes, decisions / 1000, rewards, BLUE, f"median and quartiles of {SEEDS} seeds")
    level(axes, oracle.optimal_policy(task.dynamics)[1], "best policy")
    axes.set(xlabel="thousand decisions", ylabel="mean reward", ylim=(0.3, 0.85))
    axes.legend(loc="center right")
    return figure


def chain() -> Figure:
    """Both variants of the chain."""
    places = [(1.0 * state, 0.0) for state in range(Chain().length)]
    figure, axes = panels(rows=2, height=3.6)
    for panel, variant in zip(axes, ("walk", "reset"), strict=True):
        mdp = Chain(variant=variant).dynamics
        states(panel, places, [str(state) for state in range(mdp.states)], mdp.rewards)
        end = mdp.states - 1
        either = mdp.transitions.min(0)
        moves(panel, places, mdp.transitions[1] - either, ORANGE, 0.0, label=False)
        moves(panel, places, mdp.transitions[0] - either, BLUE, -0.32 if variant == "walk" else -0.28, label=False)
        moves(panel, [(x, y) for x, y in places], either * (np.arange(mdp.states) == end)[:, None], "0.55", 0.2, False)
        frame(panel, places)
        panel.set(title=f'variant "{variant}"', ylim=(-0.75, 0.8))
    for colour, words in ((BLUE, "action 0, left"), (ORANGE, "action 1, right"), ("0.55", "either")):
        axes[1].plot([], [], color=colour, label=words)
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def chain_learning(work: Work) -> Figure:
    """Chains of several lengths, both variants."""
    figure, axes = panels(2, sharey=True)
    for panel, variant in zip(axes, ("walk", "reset"), strict=True):
        for length, colour in zip((4, 6, 8, 10), COLOURS, strict=False):
            task = Chain(length=length, variant=variant)
            decisions, rewards = work.train(task, None, 40_000, SEEDS).curve()
            best = oracle.optimal_policy(task.dynamics)[1]
            band(panel, decisions / 1000, rewards / best, colour, f"{length} states")
        level(panel, 1.0, "best policy")
        panel.set(title=f'variant "{variant}"', xlabel="thousand decisions", ylim=(-0.03, 1.12))
    axes[0].set_ylabel("mean reward, of the best")
    axes[1].legend(loc="center right")
    return figure


def call_admission() -> Figure:
    """In which states the best policy accepts, beside the source's untrained policy."""
    mdp = CallAdmission().dynamics
    types = mdp.observations.shape[1] - 1
    untrained = oracle.action_probabilities(mdp, AdmissionThresholds(np.full(types, 8.0)))[:, 1]
    figure, axes = panels(2, height=2.6, sharey=True)
    rows = (("best policy", oracle.optimal_policy(mdp)[0]), (r"untrained, $\theta$ = 8", untrained))
    calls = mdp.observations[:, -1].astype(int)
    shown: Any = None
    for panel, (title, accepts) in zip(axes, rows, strict=True):
        share = np.full((types, calls.max()), np.nan)  # a full link accepts none
        for kind, busy in np.ndindex(share.shape):
            share[kind, busy] = accepts[(mdp.observations[:, kind] == 1) & (calls == busy)].mean()
        shown = panel.imshow(share, vmin=0, vmax=1, aspect="auto", origin="lower", cmap="cividis")
        panel.set(title=title, xlabel="calls in progress", xticks=range(calls.max()))
    pay = [mdp.rewards[1][mdp.observations[:, kind] == 1].max() for kind in range(types)]
    axes[0].set_yticks(range(types), [f"type {kind + 1}, pays {value:g}" for kind, value in enumerate(pay)])
    figure.colorbar(shown, ax=axes, label="share of calls accepted")
    return figure


def call_admission_learning(work: Work) -> Figure:
    """The learner that goes with the task, against what is known."""
    task = CallAdmission()
    mdp = task.dynamics
    decisions, rewards = work.train(task, None, 60_000, SEEDS).curve()
    figure, axes = panels()
    band(axes, decisions / 1000, rewards, BLUE, f"median and quartiles of {SEEDS} seeds")
    level(axes, oracle.optimal_policy(mdp)[1], "best policy; below it, accepting every call")
    level(axes, oracle.average_reward(mdp, hyperplanes(task)), "before learning")
    always = AdmissionThresholds(np.full(mdp.observations.shape[1] - 1, 1e3))
    level(axes, oracle.average_reward(mdp, always), "")
    axes.set(xlabel="thousand decisions", ylabel="mean reward", ylim=(0.4, 0.86))
    axes.legend(loc="lower right", bbox_to_anchor=(1, 0.25))
    return figure
