"""What the blocks of tasks show: ports, and the functions of one seed behind them."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from motorgrad.lab._block import Ports, Signals
from motorgrad.lab._port import Port
from motorgrad.tasks import Task, outcome

OWN = ("observation", "reward", "terminated", "truncated", "ended", "valid", "next_observation")


class Scene(NamedTuple):
    """A task between two decisions: its `memory`; the `observation` that the next action is chosen on; what the last
    action led to, before any reset (`reached`), its `reward`, whether the episode `terminated` or was `truncated`;
    whether that counts (`valid`: not before the first action, nor where the dynamics broke); decisions `elapsed`, or
    `None`; the last value of each of the task's `readings`."""

    memory: Any
    observation: Float[Array, " inputs"]
    reached: Float[Array, " inputs"]
    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]
    valid: Bool[Array, ""]
    elapsed: Int[Array, ""] | None
    readings: dict[str, Float[Array, ""]]


def action_port(task: Task) -> Port:
    """The port of a task's actions."""
    if task.actions == "discrete":
        return Port((), "int", feedthrough=False, help=f"one of {task.action_size}, from 0")
    return Port((task.action_size,), feedthrough=False)


def scene_ports(task: Task) -> Ports:
    """The outputs of a task."""
    size, flag = (task.observation_size,), Port((), "bool")
    return {
        "observation": Port(size, help="what the next action is chosen on"),
        "reward": Port(help="of the action before; 0 at the first tick"),
        "terminated": flag,
        "truncated": flag,
        "ended": Port((), "bool", help="whether a new episode begins at this tick, for whatever reason"),
        "valid": Port((), "bool", help="whether something was paid: not at the first tick, nor where dynamics broke"),
        "next_observation": Port(size, help="what the action before led to, before any reset"),
        **{name: Port(help="its last value") for name in task.reports},
    }


def shown(scene: Scene, started: Any) -> Signals:
    """The outputs of a scene, of one seed or of many; `started` says whether an action was taken yet."""
    broken = ~scene.valid & started
    return {
        "observation": scene.observation,
        "reward": scene.reward,
        "terminated": scene.terminated,
        "truncated": scene.truncated,
        "ended": scene.terminated | scene.truncated | broken,
        "valid": scene.valid,
        "next_observation": scene.reached,
        **scene.readings,
    }


def begin(task: Task, state: Any, init: Float[Array, " _"], observe: Float[Array, " _"]) -> Scene:
    """Before the first action, the dynamics being in `state`."""
    memory, observation = task.observe(task.init(init), state, observe)
    no, zero = jnp.zeros((), bool), jnp.zeros(())
    elapsed = jnp.zeros((), jnp.int32) if task.episode_limit else None
    readings = dict.fromkeys(task.reports, zero)
    return Scene(memory, observation, observation, zero, no, no, no, elapsed, readings)


def settle(
    task: Task, scene: Scene, state: Any, action: Array, observe: Float[Array, " _"], broken: Any = False
) -> tuple[Scene, Bool[Array, ""]]:
    """What an action led to, the dynamics having moved on to `state`; and whether a new episode is to begin."""
    led = outcome(task, scene.memory, state, action, observe, scene.elapsed)
    terminated, truncated, broken = (jnp.asarray(flag, bool) for flag in (led.terminated, led.truncated, broken))
    named = task.readings(led.memory, state)
    readings = {
        name: jnp.where(jnp.logical_and(named[name][1], ~broken), named[name][0], last)
        for name, last in scene.readings.items()
    }
    reward = jnp.where(broken, 0.0, led.reward)
    seen = led.observation
    after = Scene(led.memory, seen, seen, reward, terminated, truncated, ~broken, led.elapsed, readings)
    return after, terminated | truncated | broken


def restart(
    task: Task, scene: Scene, state: Any, where: Bool[Array, ""], init: Float[Array, " _"], look: Float[Array, " _"]
) -> Scene:
    """Begin a new episode `where` one has ended, the dynamics having been put back to `state`."""
    memory, observation = task.observe(task.renew(scene.memory, init), state, look)
    elapsed = None if scene.elapsed is None else jnp.zeros_like(scene.elapsed)
    fresh = scene._replace(memory=memory, observation=observation, elapsed=elapsed)
    return jax.tree.map(lambda new, old: jnp.where(where, new, old), fresh, scene)
