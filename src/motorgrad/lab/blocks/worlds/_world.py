"""Tasks over worlds written in JAX, as a block."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import worlds
from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Setting
from motorgrad.lab.blocks._toml import as_text, read_table
from motorgrad.lab.blocks.worlds._scene import Scene, action_port, begin, restart, scene_ports, settle, shown
from motorgrad.tasks import TASKS, HostTask, Task, make

NAMES = tuple(name for name, kind in TASKS.items() if not issubclass(kind, HostTask))


class _State(NamedTuple):
    scene: Scene
    dynamics: Any


@dataclasses.dataclass(frozen=True)
class World(Block):
    """A task over a world that is compiled with the diagram: recruitment, particles, finite decision processes.

    It shows an observation; the action on it moves the world until the next tick, which then shows what was paid.
    Where an episode ends it begins anew at once. A tick of the diagram is a decision; it should be as long as the
    task's `period`.
    """

    name: ClassVar[str] = "world"
    category: ClassVar[str] = "bodies and worlds"

    task: Annotated[str, Setting("its name", choices=NAMES)] = "linear-recruitment"
    settings: Annotated[str | Mapping[str, Any], Setting("the task's settings, as TOML: `units = 8`")] = ""

    def validate(self) -> None:
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        _ = self.made

    @functools.cached_property
    def made(self) -> Task:
        """The task."""
        return make(self.task, **read_table("settings", self.settings))

    @functools.cached_property
    def _dynamics(self) -> worlds.World:
        dynamics = self.made.dynamics
        assert isinstance(dynamics, worlds.World)
        return dynamics

    @property
    def _restarts(self) -> bool:
        return self.made.has_episodes

    @property
    def inputs(self) -> Ports:
        return {"action": action_port(self.made)}

    @property
    def outputs(self) -> Ports:
        return scene_ports(self.made)

    @property
    def uniforms(self) -> int:
        return sum(self._sizes)

    @property
    def init_uniforms(self) -> int:
        return sum(self._sizes[2:]) if self._restarts else sum(self._again)

    @functools.cached_property
    def _again(self) -> tuple[int, int, int]:
        """How many numbers the start of an episode takes: of the world, of the task's memory, of its look at it."""
        return self._dynamics.reset_uniforms, self.made.init_uniforms, self.made.uniforms

    @functools.cached_property
    def _sizes(self) -> tuple[int, ...]:
        own = self._dynamics.uniforms, self.made.uniforms
        return own + self._again if self._restarts else own

    def init(self, uniforms: Float[Array, " numbers"]) -> _State:
        reset, memory, look = _parts(uniforms, self._again)
        state = self._dynamics.reset(reset)
        return _State(begin(self.made, state, memory, look), state)

    def output(self, state: _State, inputs: Signals, now: Moment) -> Signals:
        return shown(state.scene, now.tick > 0)

    def update(self, state: _State, inputs: Signals, now: Moment) -> _State:
        task, world = self.made, self._dynamics
        chance, observe, *again = _parts(now.uniforms, self._sizes)
        # as in training: the barrier keeps the compiler from stepping the world again for everything that needs it
        moved = jax.lax.optimization_barrier(world.step(state.dynamics, inputs["action"], chance))
        scene, ended = settle(task, state.scene, moved, inputs["action"], observe)
        if not self._restarts:
            return _State(scene, moved)
        reset, memory, look = again
        moved = jax.tree.map(lambda new, old: jnp.where(ended, new, old), world.reset(reset), moved)
        return _State(restart(task, scene, moved, ended, memory, look), moved)


def _parts(numbers: Array, sizes: tuple[int, ...]) -> list[Array]:
    """Consecutive parts of these sizes."""
    ends = [sum(sizes[: n + 1]) for n in range(len(sizes))]
    return [numbers[end - size : end] for end, size in zip(ends, sizes, strict=True)]
