"""Tasks behind blocks: their ports, the functions of one seed, and the host of tasks whose dynamics run on the host."""

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._errors import check
from motorgrad.tasks import HostBatch, HostTask, Task, outcome
from timlab.diagram import Host, HostBlock, HostMoment, Port, Ports, Signals


class Scene(NamedTuple):
    """A task between two decisions.

    - `memory`: the task's memory.
    - `observation`: the observation for the next action.
    - `reached`: the observation that the last action led to, before any reset.
    - `reward`: of the last action.
    - `terminated`, `truncated`: how the episode ended, if it did.
    - `valid`: whether the reward counts: not before the first action, nor after the dynamics diverged.
    - `elapsed`: decisions in this episode, or `None`.
    - `metrics`: the last value of each of the task's metrics.
    """

    memory: Any
    observation: Float[Array, " inputs"]
    reached: Float[Array, " inputs"]
    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]
    valid: Bool[Array, ""]
    elapsed: Int[Array, ""] | None
    metrics: dict[str, Float[Array, ""]]


def action_port(task: Task) -> Port:
    """The port for a task's actions."""
    if task.actions == "discrete":
        return Port((), "int", feedthrough=False, help=f"index of one of {task.action_size} actions")
    return Port((task.action_size,), feedthrough=False)


def scene_ports(task: Task) -> Ports:
    """The output ports of a task."""
    size = (task.observation_size,)
    flag = Port((), "bool")
    return {
        "observation": Port(size, help="observation for the next action"),
        "reward": Port(help="reward of the previous action; 0 at the first tick"),
        "terminated": flag,
        "truncated": flag,
        "ended": Port((), "bool", help="whether a new episode begins at this tick, for any reason"),
        "valid": Port((), "bool", help="whether the reward counts: not at the first tick, nor after divergence"),
        "next_observation": Port(size, help="observation after the previous action, before any reset"),
        **{name: Port(help="last value") for name in task.metric_names},
    }


def scene_outputs(scene: Scene, started: Array | np.ndarray | bool) -> Signals:
    """The outputs for a scene, of one seed or many; `started` is whether an action has been taken."""
    diverged = ~scene.valid & started
    return {
        "observation": scene.observation,
        "reward": scene.reward,
        "terminated": scene.terminated,
        "truncated": scene.truncated,
        "ended": scene.terminated | scene.truncated | diverged,
        "valid": scene.valid,
        "next_observation": scene.reached,
        **scene.metrics,
    }


def initial_scene(task: Task, state: PyTree[Array], init: Float[Array, " _"], observe: Float[Array, " _"]) -> Scene:
    """The scene before the first action, with the dynamics in `state`."""
    memory, observation = task.observe(task.init(init), state, observe)
    no = jnp.zeros((), bool)
    zero = jnp.zeros(())
    elapsed = jnp.zeros((), jnp.int32) if task.episode_limit else None
    metrics = dict.fromkeys(task.metric_names, zero)
    return Scene(memory, observation, observation, zero, no, no, no, elapsed, metrics)


def advance_scene(
    task: Task,
    scene: Scene,
    state: PyTree[Array],
    action: Array,
    observe: Float[Array, " _"],
    diverged: Array | bool = False,
) -> tuple[Scene, Bool[Array, ""]]:
    """The scene after an action moved the dynamics to `state`, and whether a new episode must begin."""
    led = outcome(task, scene.memory, state, action, observe, scene.elapsed)
    terminated, truncated, diverged = (jnp.asarray(flag, bool) for flag in (led.terminated, led.truncated, diverged))
    named = task.metrics(led.memory, state)
    metrics = {
        name: jnp.where(jnp.logical_and(named[name][1], ~diverged), named[name][0], last)
        for name, last in scene.metrics.items()
    }
    reward = jnp.where(diverged, 0.0, led.reward)
    seen = led.observation
    after = Scene(led.memory, seen, seen, reward, terminated, truncated, ~diverged, led.elapsed, metrics)
    return after, terminated | truncated | diverged


def restart_scene(
    task: Task,
    scene: Scene,
    state: PyTree[Array],
    where: Bool[Array, ""],
    init: Float[Array, " _"],
    uniforms: Float[Array, " _"],
) -> Scene:
    """Begin a new episode `where` one has ended, with the dynamics reset to `state`."""
    memory, observation = task.observe(task.renew(scene.memory, init), state, uniforms)
    elapsed = None if scene.elapsed is None else jnp.zeros_like(scene.elapsed)
    fresh = scene._replace(memory=memory, observation=observation, elapsed=elapsed)
    return jax.tree.map(lambda new, old: jnp.where(where, new, old), fresh, scene)


class Functions(NamedTuple):
    """A task's functions for all seeds, compiled; `numbers` has one row per seed."""

    begin: Callable[..., Scene]
    advance: Callable[..., Any]
    restart: Callable[..., Scene]


def functions(task: HostTask, unpack: Callable[[Any], Any]) -> Functions:
    """The functions of a task that reads its dynamics through `unpack`."""
    observing, init = task.uniforms, task.init_uniforms

    def begin(packed: Array, numbers: Array) -> Scene:
        return initial_scene(task, unpack(packed), numbers[:init], numbers[init:])

    def advance(scene: Scene, action: Array, packed: Array, numbers: Array) -> Any:
        return advance_scene(task, scene, unpack(packed), action, numbers[:observing], packed[-1] > 0)

    def restart(scene: Scene, packed: Array, ended: Array, numbers: Array) -> Scene:
        rest = numbers[observing:]
        return restart_scene(task, scene, unpack(packed), ended, rest[:init], rest[init:])

    return Functions(*(jax.jit(jax.vmap(function)) for function in (begin, advance, restart)))


class TaskHost(Host):
    """The dynamics of all seeds, and the task on them."""

    def __init__(self, task: HostTask, batch: HostBatch, compiled: Functions, numbers: np.ndarray):
        self.task, self.batch, self._compiled = task, batch, compiled
        init = self.task.init_uniforms
        if start := task.begin(numbers[:, :init]):
            batch.reset(None, **start)
        self._scene = _to_numpy(compiled.begin(batch.packed.copy(), numbers))

    def output(self, block: HostBlock, inputs: dict[str, np.ndarray], now: HostMoment) -> dict[str, np.ndarray]:
        return {name: np.asarray(value) for name, value in scene_outputs(self._scene, now.tick > 0).items()}

    def update(self, block: HostBlock, inputs: dict[str, np.ndarray], now: HostMoment) -> None:
        action = inputs["action"]
        numbers = now.uniforms
        control = np.asarray(self.task.control(action, self._scene.memory), np.float32)
        self.batch.step(control.reshape(len(control), -1))
        scene, ended = _to_numpy(self._compiled.advance(self._scene, action, self.batch.packed.copy(), numbers))
        if ended.any():
            rows = np.flatnonzero(ended)
            observing = self.task.uniforms
            self.batch.reset(rows, **self.task.begin(numbers[rows, observing : observing + self.task.init_uniforms]))
            scene = _to_numpy(self._compiled.restart(scene, self.batch.packed.copy(), ended, numbers))
        self._scene = scene

    def snapshot(self) -> dict[str, np.ndarray]:
        own = {f"dynamics.{name}": value for name, value in self.batch.snapshot().items()}
        leaves = jax.tree.leaves(self._scene)
        return own | {f"scene.{number}": np.array(leaf) for number, leaf in enumerate(leaves)}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        leaves, structure = jax.tree.flatten(self._scene)
        names = [f"scene.{number}" for number in range(len(leaves))]
        own = {name.removeprefix("dynamics."): value for name, value in snapshot.items() if name not in names}
        fits = set(names) <= set(snapshot)
        fits = fits and all(np.shape(snapshot[n]) == leaf.shape for n, leaf in zip(names, leaves, strict=True))
        check(fits, "snapshot", sorted(snapshot), "a snapshot of this block with as many seeds")
        self.batch.restore(own)
        kept = [np.array(snapshot[n], leaf.dtype) for n, leaf in zip(names, leaves, strict=True)]
        self._scene = jax.tree.unflatten(structure, kept)


_to_numpy = functools.partial(jax.tree.map, np.array)
"""Copies in NumPy; waits for the computation."""
