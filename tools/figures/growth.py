"""Figures of growing pools, learned on a line where firing pays at four places."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from motorgrad.learning import SGD, Agent, Clock, Growth, Plateau, Transition, Visited, olgarb
from motorgrad.learning import AgentState as State
from motorgrad.policies import growing
from tools.figures._style import BLUE, COLOURS, FAINT, GREEN, ORANGE, band, panels

PLACES = (0.1, 0.35, 0.6, 0.9)
WITHIN = 0.06
COST = 0.5
DECISIONS = 80_000
EVERY = 400
SEEDS = 24
UNITS = 10


def schedule() -> Figure:
    """One seed's widths and centres over its decisions; the reward and the units of many seeds by each criterion."""
    figure, ((widths, centres), (reward, units)) = panels(2, height=4.6, rows=2, sharex=True)
    at = np.arange(EVERY, DECISIONS + 1, EVERY) / 1_000
    ways = {
        "by the clock": (Growth(Clock(8_000), **START), BLUE),
        "at a plateau": (Growth(Plateau(2_000), **START), ORANGE),
        "at a plateau, placed": (Growth(Plateau(2_000), placement=Visited(), **START), GREEN),
    }
    for name, (growth, colour) in ways.items():
        states, rewards = _lived(growth)
        band(reward, at, _smooth(rewards), colour, name)
        band(units, at, np.asarray(states.policy.active).sum(-1), colour, name)
        if colour == BLUE:
            _one(widths, centres, at, states)
    widths.set(title="width of each unit, one seed", ylabel=r"$\sigma$", yscale="log")
    widths.set_yticks([0.05, 0.1, 0.2, 0.5, 1.0], ["0.05", "0.1", "0.2", "0.5", "1"])
    widths.minorticks_off()
    centres.set(title="centre of each unit, the same seed", ylabel=r"$\mu$", ylim=(-0.1, 1.1))
    for place in PLACES:
        centres.axhspan(place - WITHIN, place + WITHIN, color=FAINT, alpha=0.15, linewidth=0)
    reward.set(title=f"mean reward, {SEEDS} seeds", xlabel="thousand decisions")
    units.set(title="units that are there", xlabel="thousand decisions", ylim=(0, UNITS + 0.5))
    units.legend(loc="lower right")
    return figure


START: dict[str, Any] = {"width": 0.5, "cutoff": 0.05, "shrink": 0.999}


def _one(widths: Any, centres: Any, at: np.ndarray, states: State) -> None:
    pool: Any = states.policy.pool  # type: ignore[attr-defined]
    for unit in range(UNITS):
        there = np.asarray(states.policy.active)[0, :, unit]  # type: ignore[attr-defined]
        for panel, values in ((widths, np.exp(pool.log_width)), (centres, np.asarray(pool.centre))):
            panel.plot(at, np.where(there, values[0, :, unit, 0], np.nan), color=COLOURS[unit % 6], linewidth=1)


def _lived(growth: Growth) -> tuple[Any, np.ndarray]:
    """Every seed's learner and mean reward after every so many decisions."""
    agent = Agent(growing(1, UNITS), olgarb(0.0), SGD({"centre": 2e-4, "log_width": 2e-3}), growth=growth)
    places = jnp.array(PLACES)

    def decide(state: State, numbers: jax.Array) -> tuple[State, jax.Array]:
        state, action = agent.act(state, numbers[:1], numbers[1:])
        pays = jnp.min(jnp.abs(numbers[0] - places)) < WITHIN
        reward = jnp.max(action) * jnp.where(pays, 1.0, -COST)
        led = Transition(numbers[:1], action, reward, numbers[:1])
        return agent.update(agent.observe(state, led)), reward

    def window(state: State, key: jax.Array) -> tuple[State, tuple[State, jax.Array]]:
        state, rewards = jax.lax.scan(decide, state, jax.random.uniform(key, (EVERY, 1 + UNITS)))
        return state, (state, rewards.mean())

    def run(key: jax.Array) -> Any:
        return jax.lax.scan(window, agent.init(key), jax.random.split(key, DECISIONS // EVERY))[1]

    states, rewards = jax.jit(jax.vmap(run))(jax.random.split(jax.random.key(0), SEEDS))
    return states, np.asarray(rewards)


def _smooth(values: np.ndarray, span: int = 8) -> np.ndarray:
    """The mean over the last few windows."""
    total = np.cumsum(values, axis=1)
    total[:, span:] -= total[:, :-span].copy()
    return total / np.minimum(np.arange(1, values.shape[1] + 1), span)
