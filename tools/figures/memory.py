"""Figures of hidden units and of memory: what they are, and what is learned with and without them."""

import itertools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.signal
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import motorgrad as mg
from motorgrad.policies import (
    Autoregressive,
    FiniteStateController,
    Layered,
    Policy,
    Recurrent,
    abilities,
    graded_hyperplanes,
)
from motorgrad.tasks import FiniteTask, LoadUnload, Parity, TMaze
from motorgrad.worlds import oracle
from tools.figures._diagram import frame, states
from tools.figures._style import BLUE, FAINT, GREEN, ORANGE, PINK, RED, arrow, band, level, over, panels, plane
from tools.figures._work import Work

SEEDS = 20
RECURRENT: dict[str, dict[str, Any]] = {
    "load-unload": {"policy": {"kind": "recurrent", "longest": 10.0}, "learning_rate": 0.003, "entropy": 0.003},
    "t-maze": {
        "policy": {"kind": "recurrent", "hidden": 16, "longest": 20.0},
        "decay": 0.8,
        "learning_rate": 0.001,
        "entropy": {"kind": "annealed", "start": 0.5, "end": 0.02, "steps": 500_000},
    },
}
"""Settings of learners with recurrent units, chosen on other seeds than those of the figures."""


def layered(work: Work) -> Figure:
    """The exclusive or, with and without hidden units; and what a learned network does."""
    task = Parity()
    steps = 60_000
    single = work.train(task, mg.agent_for(task, policy="hyperplanes"), steps, SEEDS)
    layers = work.train(task, None, steps, SEEDS)
    figure, (curves, map_) = panels(2, height=3.1, width_ratios=(1.35, 1))
    for run, colour, words in ((layers, BLUE, "16 hidden units"), (single, RED, "one layer")):
        decisions, rewards = run.curve()
        band(curves, decisions / 1000, rewards, colour, f"{words}, {SEEDS} seeds")
    level(curves, 0.75, "best of one layer")
    level(curves, 1.0, "best policy")
    curves.set(xlabel="thousand decisions", ylabel="mean reward", ylim=(0.45, 1.06))
    curves.legend(loc="lower right")
    network = layers.policy(layers.seeds[0])
    assert isinstance(network, Layered)
    x, y = plane(1.6, 61)
    shown = map_.pcolormesh(x, y, over(network.prob, x, y)[..., 0], vmin=0, vmax=1, cmap="RdBu_r", rasterized=True)
    weights, bias = (np.asarray(each) for each in (network.hidden[0].weights, network.hidden[0].bias))  # type: ignore[attr-defined]
    for (one, two), offset in zip(weights, bias, strict=True):
        map_.contour(x, y, one * x + two * y + offset, levels=[0], colors="0.25", linewidths=0.5)
    for one in (-1, 1):
        for two in (-1, 1):
            map_.text(one, two, "1" if one != two else "0", ha="center", va="center", fontweight="bold")
    map_.set(xlabel="input $y_1$", ylabel="input $y_2$", aspect="equal", title="a learned network")
    figure.colorbar(shown, ax=map_, label="probability of action 1", shrink=0.85)
    return figure


def parity(work: Work) -> Figure:
    """Parities of two, three and four bits."""
    figure, axes = panels()
    for bits, colour in zip((2, 3, 4), (BLUE, GREEN, ORANGE), strict=True):
        decisions, rewards = work.train(Parity(inputs=bits), None, 200_000, SEEDS).curve()
        band(axes, decisions / 1000, rewards, colour, f"{bits} bits, {SEEDS} seeds")
    level(axes, 1.0, "best policy")
    axes.set(xlabel="thousand decisions", ylabel="mean reward", ylim=(0.45, 1.06))
    axes.legend(loc="lower right")
    return figure


def load_unload() -> Figure:
    """The line, what is seen on it, and the round trip that pays."""
    length = LoadUnload().length
    figure, axes = panels(height=1.7)
    places = [(1.0 * place, 0.0) for place in range(length)]
    states(axes, places, ["left\nend", *["?"] * (length - 2), "right\nend"], [0.0] * length)
    for start, end in itertools.pairwise(places):
        arrow(axes, (start[0] + 0.2, 0.1), (end[0] - 0.2, 0.1), ORANGE, -0.25)
        arrow(axes, (end[0] - 0.2, -0.1), (start[0] + 0.2, -0.1), BLUE, -0.25)
    middle = (length - 1) / 2
    axes.text(middle, 0.33, "loaded: go right", color=ORANGE, ha="center", fontsize=8)
    axes.text(middle, -0.42, "empty: go left", color=BLUE, ha="center", fontsize=8)
    axes.text(-0.3, 0.0, "load", ha="right", va="center", fontsize=8)
    axes.text(length - 0.7, 0.0, "unload, $r$ = 1", ha="left", va="center", fontsize=8)
    frame(axes, places)
    axes.set(xlim=(-0.9, length + 0.3))
    return figure


def t_maze() -> Figure:
    """The maze, the cue at its start, and what is seen at each place."""
    length = TMaze().length
    figure, axes = panels(height=2.1)
    for place in range(length + 1):
        axes.add_patch(Rectangle((place - 0.5, -0.5), 1, 1, facecolor="white", edgecolor="0.6"))
    for side, words, colour in ((1, "$r$ = 4", "#009E7333"), (-1, "$r$ = −0.1", "#D55E0022")):
        axes.add_patch(Rectangle((length - 0.5, side - 0.5), 1, 1, facecolor=colour, edgecolor="0.6"))
        axes.text(length, side, words, ha="center", va="center", fontsize=8)
    axes.text(0, 0, "cue: up", color=RED, ha="center", va="center", fontsize=8)
    for place in range(1, length):
        axes.text(place, 0, "corridor", color=FAINT, ha="center", va="center", fontsize=8)
    axes.text(length, 0, "junction", ha="center", va="center", fontsize=8)
    arrow(axes, (-1.3, 0), (-0.55, 0), "0.3")
    axes.set(xlim=(-1.4, length + 0.7), ylim=(-1.6, 1.6), aspect="equal")
    axes.set_axis_off()
    return figure


def _learning(work: Work, task: FiniteTask, steps: int) -> Figure:
    """Learners with internal states, with recurrent units and without a memory, beside what can be had."""
    figure, axes = panels(height=3.0)
    learners = {
        "finite-state controller": (mg.agent_for(task), BLUE),
        "recurrent units": (mg.agent_for(task, RECURRENT[task.name]), GREEN),
        "no memory (softmax)": (mg.agent_for(task, policy="softmax"), RED),
    }
    for words, (agent, colour) in learners.items():
        decisions, rewards = work.train(task, agent, steps, SEEDS).curve()
        band(axes, decisions / 1000, rewards, colour, f"{words}, {SEEDS} seeds")
    best = oracle.optimal_policy(task.dynamics)[1]
    level(axes, best, "best policy with a memory")
    level(axes, oracle.best_memoryless(task.dynamics, 4)[1], "best policy without")
    axes.set(xlabel="thousand decisions", ylabel="mean reward", ylim=(-0.2 * best, 1.12 * best))
    axes.legend(loc="center right", bbox_to_anchor=(1, 0.7))
    return figure


def load_unload_learning(work: Work) -> Figure:
    """The learners on the line."""
    return _learning(work, LoadUnload(), 200_000)


def t_maze_learning(work: Work) -> Figure:
    """The learners in the maze."""
    return _learning(work, TMaze(), 600_000)


def controller(work: Work) -> Figure:
    """A controller that was learned: its transitions and its actions, as tables."""
    run = work.train(LoadUnload(), None, 200_000, SEEDS)
    learned = run.policy(run.seeds[0])
    assert isinstance(learned, FiniteStateController)
    kinds = ("left end", "right end", "between")
    seen = jnp.eye(3)
    tables = np.asarray(learned.table(seen))
    figure, axes = panels(4, height=2.2, width_ratios=(1, 1, 1, 0.8))
    ticks = range(learned.states)
    image = None
    for panel, table, kind in zip(axes, tables, kinds, strict=False):
        image = panel.imshow(table, vmin=0, vmax=1, cmap="Blues")
        panel.set(title=f"next state, {kind}", xlabel="$g'$", xticks=ticks, yticks=ticks)
        _numbers(panel, table)
    axes[0].set_ylabel("internal state $g$")
    right = np.stack([_act(learned, state, seen) for state in ticks])
    axes[3].imshow(right, vmin=0, vmax=1, cmap="Oranges")
    axes[3].set(title="chance of going right", ylabel="$g'$", xticks=range(3), yticks=ticks)
    axes[3].set_xticklabels(("left", "right", "betw."), fontsize=7)
    _numbers(axes[3], right)
    assert image is not None
    figure.colorbar(image, ax=axes, shrink=0.7, label="probability")
    return figure


def _act(learned: FiniteStateController, state: int, seen: Any) -> np.ndarray:
    """The chance of action 1 in an internal state, for several observations."""
    own = jnp.zeros(learned.states).at[state].set(1)
    return np.array([learned.act.prob((own[:, None] * y).ravel())[1] for y in seen])


def _numbers(panel: Any, table: np.ndarray) -> None:
    """The entries of a table in its cells."""
    for (row, column), value in np.ndenumerate(table):
        colour = "white" if value > 0.6 else "0.3"
        panel.text(column, row, f"{value:.2f}".lstrip("0"), ha="center", va="center", fontsize=6, color=colour)


def recurrent(work: Work) -> Figure:
    """What recurrent units remember of a pulse; and how a learned policy tells loaded from empty."""
    figure, (pulse, trips) = panels(2, height=2.9)
    units = Recurrent(-jnp.log(jnp.array([1.0, 3.0, 10.0, 30.0])), jnp.ones((4, 1)), jnp.zeros(4), _blind(5))
    shown = _activations(units, np.eye(1, 40)[0][:, None])
    for unit, (constant, colour) in enumerate(zip((1, 3, 10, 30), (BLUE, GREEN, ORANGE, RED), strict=True)):
        pulse.plot(shown[:, unit], color=colour, label=f"{constant}")
    pulse.set(title="after one pulse", xlabel="decisions", ylabel="activation $h$")
    pulse.legend(title="time constant (decisions)", ncols=2)
    task = LoadUnload()
    run = work.train(task, mg.agent_for(task, RECURRENT["load-unload"]), 200_000, SEEDS)
    learned = run.policy(run.seeds[0])
    place = np.array([*range(5), *range(3, 0, -1)] * 3)
    seen = np.stack([place == 0, place == 4, (place > 0) & (place < 4)], axis=1).astype(float)
    right = _chances(learned, seen)
    trips.plot(place / 4, color=FAINT, linewidth=0.8, label="place, 0 left … 1 right")
    trips.plot(right, "o-", color=BLUE, markersize=3.5, label="chance of going right")
    trips.set(title="three round trips", xlabel="decisions", ylim=(-0.05, 1.3))
    trips.legend(loc="upper center", ncols=2)
    return figure


def autoregressive() -> Figure:
    """Noise with and without autocorrelation; what low-pass filters make of it, and how much of it passes."""
    figure, (traces, passing) = panels(2, height=2.9)
    for row, (rho, colour) in enumerate(((0.0, BLUE), (0.8, RED))):
        drawn = _noise(rho, 400)[-150:]
        traces.plot(drawn - 7 * row, color=colour, linewidth=0.6, alpha=0.6)
        traces.plot(_filtered(drawn, 10.0) - 7 * row, color=colour, linewidth=2)
        traces.text(2, 3 - 7 * row, f"autocorrelation {rho:g}", color=colour, fontsize=7)
    traces.set(title="noise (thin), and a limb that it moves (thick)", xlabel="decisions", yticks=[])
    correlations = np.linspace(0, 0.98, 99)
    for constant, colour in ((3.0, GREEN), (10.0, ORANGE), (30.0, PINK)):
        a = np.exp(-1 / constant)
        share = np.sqrt((1 - a) / (1 + a) * (1 + a * correlations) / (1 - a * correlations))
        passing.plot(correlations, share, color=colour, label=f"{constant:g}")
        for rho in (0.0, 0.4, 0.8, 0.95):
            moved = _filtered(_noise(rho, 40_000), constant)[1_000:]
            passing.plot(rho, moved.std(), "o", color=colour, markersize=3.5)
    passing.set(title="deviation of the limb ÷ of the noise", xlabel="autocorrelation of the noise", ylim=(0, 1))
    passing.legend(title="limb's time constant (decisions)", ncols=3, loc="upper left")
    return figure


def _noise(rho: float, decisions: int) -> np.ndarray:
    """What a unit of mean 0 and deviation 1 draws."""
    policy = Autoregressive(graded_hyperplanes(1, 1, deviation=1.0), jnp.asarray(rho))

    def step(memory: Any, uniforms: Any) -> Any:
        seen = abilities.observation_with_memory(policy, memory, jnp.zeros(1))
        action = policy.sample(seen, uniforms)
        return abilities.remember(policy, seen, action), action[0]

    uniforms = jax.random.uniform(jax.random.key(0), (decisions, 1))
    return np.asarray(jax.lax.scan(step, abilities.initial_memory(policy), uniforms)[1])


def _filtered(signal: np.ndarray, constant: float) -> np.ndarray:
    """A first-order low-pass filter with a time constant in decisions."""
    a = np.exp(-1 / constant)
    return np.asarray(scipy.signal.lfilter([1 - a], [1, -a], signal))


def _blind(inputs: int) -> Policy:
    """Output units of which nothing is asked."""
    return mg.policies.Hyperplanes(jnp.zeros((1, inputs)), jnp.zeros(1))


def _walk(policy: Any, observations: np.ndarray) -> Any:
    """What a policy's units see of a sequence of observations, when its actions do not matter."""

    def step(memory: Any, observation: Any) -> Any:
        seen = abilities.observation_with_memory(policy, memory, observation)
        return abilities.remember(policy, seen, jnp.zeros(1)), seen

    return jax.lax.scan(step, abilities.initial_memory(policy), jnp.asarray(observations, jnp.float32))[1]


def _activations(policy: Recurrent, observations: np.ndarray) -> np.ndarray:
    """The recurrent units' activations."""
    seen = jax.vmap(lambda each: abilities.critic_observation(policy, each))(_walk(policy, observations))
    return np.asarray(seen)[:, policy.observation_size :]


def _chances(policy: Any, observations: np.ndarray) -> np.ndarray:
    """The chance of action 1."""
    return np.asarray(jax.vmap(policy.prob)(_walk(policy, observations)))[:, 1]
