"""The figure of spiking units: potentials and spikes, rates over the input, and the Hebbian score."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from motorgrad.policies import SpikingUnits
from tools.figures._style import BLUE, FAINT, GREEN, ORANGE, RED, panels

DECAY = jnp.asarray(0.9)
DECISIONS = 2000


def spiking() -> Figure:
    """Potential and spikes of two units; firing rates over the input; the score of a weight over the age of a pulse."""
    figure, (course, rates, scores) = panels(3, height=2.8)
    for row, (noisy, colour) in enumerate(((False, BLUE), (True, RED))):
        seen, spikes = _trains(SpikingUnits([[1.0]], [5.0], DECAY), np.ones(60), noisy)
        potential = seen[:, 1] - 12 * row
        course.plot(potential, color=colour, linewidth=1.2)
        course.plot(np.flatnonzero(spikes), potential[spikes > 0] + 0.9, "|", color=colour, markersize=7)
        course.axhline(5 - 12 * row, color=FAINT, linewidth=0.8, linestyle=":")
        words = "drawn" if noisy else "most probable"
        course.text(0, 8 - 12 * row, words, color=colour, fontsize=8)
    course.set(title="potential $u$ and spikes, $y$ = 1", xlabel="decisions", yticks=[], ylim=(-14, 10.5))
    levels = np.linspace(0, 1, 21)
    for weight, colour in ((0.5, GREEN), (1.0, BLUE), (4.0, ORANGE)):
        unit = SpikingUnits([[weight]], [5 * weight], DECAY)
        rate = [_trains(unit, np.full(DECISIONS, level), True)[1].mean() for level in levels]
        rates.plot(levels, rate, color=colour, label=rf"$w$ = {weight:g}, $\vartheta$ = {5 * weight:g}")
    rates.set(title="spikes per decision", xlabel="input $y$", ylim=(0, None))
    rates.legend()
    ages = np.arange(31)
    for action, colour, words in ((1.0, BLUE, "a spike"), (0.0, RED, "none")):
        unit = SpikingUnits([[0.0]], [1.0], DECAY)
        found = [float(unit.score(jnp.array([0.0, DECAY**age]), jnp.array([action])).weights[0, 0]) for age in ages]
        scores.plot(ages, found, "o-", markersize=2.5, color=colour, label=words)
    scores.axhline(0, color=FAINT, linewidth=0.8, linestyle=":")
    scores.set(title=r"score of a weight, $\partial_w$", xlabel="age of an input pulse (decisions)")
    scores.legend()
    return figure


def _trains(unit: SpikingUnits, inputs: np.ndarray, noisy: bool) -> tuple[np.ndarray, np.ndarray]:
    """What one unit sees at every decision, and its spikes."""

    def step(memory: Any, now: Any) -> Any:
        level, uniforms = now
        seen = unit.observation_with_memory(memory, level[None])
        action = unit.sample(seen, uniforms) if noisy else unit.mode(seen)
        return unit.remember(seen, action), (seen, action[0])

    uniforms = jax.random.uniform(jax.random.key(1), (len(inputs), 1))
    _, (seen, spikes) = jax.lax.scan(step, unit.initial_memory(), (jnp.asarray(inputs, jnp.float32), uniforms))
    return np.asarray(seen), np.asarray(spikes)
