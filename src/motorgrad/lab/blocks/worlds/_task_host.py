"""Tasks whose dynamics live on the host: what runs behind their blocks."""

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._host import Host, HostMoment
from motorgrad.lab.blocks.worlds._scene import Scene, begin, restart, settle, shown
from motorgrad.tasks import HostBatch, HostTask


class Functions(NamedTuple):
    """A task's functions for all seeds, compiled; `numbers` are of one row for each."""

    begin: Callable[..., Scene]
    settle: Callable[..., Any]
    restart: Callable[..., Scene]


def functions(task: HostTask, unpack: Callable[[Any], Any]) -> Functions:
    """The functions of a task that sees its dynamics by `unpack`."""
    look, init = task.uniforms, task.init_uniforms

    def first(packed: Any, numbers: Any) -> Scene:
        return begin(task, unpack(packed), numbers[:init], numbers[init:])

    def next_(scene: Scene, action: Any, packed: Any, numbers: Any) -> Any:
        return settle(task, scene, unpack(packed), action, numbers[:look], packed[-1] > 0)

    def again(scene: Scene, packed: Any, ended: Any, numbers: Any) -> Scene:
        rest = numbers[look:]
        return restart(task, scene, unpack(packed), ended, rest[:init], rest[init:])

    return Functions(*(jax.jit(jax.vmap(function)) for function in (first, next_, again)))


class TaskHost(Host):
    """The dynamics of all seeds, and what the task makes of them."""

    def __init__(self, task: HostTask, batch: HostBatch, compiled: Functions, numbers: np.ndarray):
        self.task, self.batch, self._compiled = task, batch, compiled
        self._scene = _here(compiled.begin(batch.packed.copy(), numbers))

    def output(self, block: Any, inputs: dict[str, np.ndarray], now: HostMoment) -> dict[str, np.ndarray]:
        return {name: np.asarray(value) for name, value in shown(self._scene, now.tick > 0).items()}

    def update(self, block: Any, inputs: dict[str, np.ndarray], now: HostMoment) -> None:
        action, numbers = inputs["action"], now.uniforms
        control = np.asarray(self.task.control(action, self._scene.memory), np.float32)
        self.batch.step(control.reshape(len(control), -1))
        scene, ended = _here(self._compiled.settle(self._scene, action, self.batch.packed.copy(), numbers))
        if ended.any():
            self.batch.reset(np.flatnonzero(ended))
            scene = _here(self._compiled.restart(scene, self.batch.packed.copy(), ended, numbers))
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
        check(fits, "snapshot", sorted(snapshot), "one of this block for as many seeds")
        self.batch.restore(own)
        kept = [np.array(snapshot[n], leaf.dtype) for n, leaf in zip(names, leaves, strict=True)]
        self._scene = jax.tree.unflatten(structure, kept)


_here = functools.partial(jax.tree.map, np.array)
"""As copies in NumPy; it waits for what computes them."""
