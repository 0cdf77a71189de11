"""Tasks as blocks: over JAX worlds, over bodies in MuJoCo, and over Gymnasium environments."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad import worlds
from motorgrad._errors import check, choice
from motorgrad.schema import static
from motorgrad.tasks import TASKS, BodyTask, Gymnasium, HostTask, Task, make
from timlab.blocks._base import as_text, read_table
from timlab.blocks.worlds._scene import (
    Functions,
    Scene,
    TaskHost,
    action_port,
    advance_scene,
    functions,
    initial_scene,
    restart_scene,
    scene_outputs,
    scene_ports,
)
from timlab.diagram import Block, HostBlock, Moment, Ports, Signals

TASK_NAMES = tuple(name for name, kind in TASKS.items() if not issubclass(kind, HostTask))


class _State(NamedTuple):
    scene: Scene
    dynamics: Any


@dataclasses.dataclass(frozen=True)
class World(Block):
    """A task over a world that is compiled with the diagram: recruitment, particles, finite decision processes.

    It outputs an observation; the action taken on it moves the world until the next tick, which outputs the reward. A
    new episode begins as soon as one ends. One tick of the diagram is one decision, and should last the task's
    `period`.
    """

    name: ClassVar[str] = "world"
    category: ClassVar[str] = "bodies and worlds"

    task: Literal[TASK_NAMES] = static("linear-recruitment", help="name of the task")  # type: ignore[valid-type]
    settings: str | Mapping[str, Any] = static("", help="settings of the task, as TOML: `units = 8`")

    def validate(self) -> None:
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        _ = self.instance

    @functools.cached_property
    def instance(self) -> Task:
        """The task."""
        choice("task", self.task, TASKS, registered=True)  # a file must not name an environment's module here
        return make(self.task, **read_table("settings", self.settings))

    @functools.cached_property
    def _dynamics(self) -> worlds.World:
        dynamics = self.instance.dynamics
        assert isinstance(dynamics, worlds.World)
        return dynamics

    @property
    def _restarts(self) -> bool:
        return self.instance.has_episodes

    @property
    def inputs(self) -> Ports:
        return {"action": action_port(self.instance)}

    @property
    def outputs(self) -> Ports:
        return scene_ports(self.instance)

    @property
    def uniforms(self) -> int:
        return sum(self._sizes)

    @property
    def init_uniforms(self) -> int:
        return sum(self._sizes[2:]) if self._restarts else sum(self._reset_sizes)

    @functools.cached_property
    def _reset_sizes(self) -> tuple[int, int, int]:
        """How many random numbers the start of an episode consumes: for the world, for the task's memory, for its
        observation.
        """
        return self._dynamics.reset_uniforms, self.instance.init_uniforms, self.instance.uniforms

    @functools.cached_property
    def _sizes(self) -> tuple[int, ...]:
        own = self._dynamics.uniforms, self.instance.uniforms
        return own + self._reset_sizes if self._restarts else own

    def init(self, uniforms: Float[Array, " numbers"]) -> _State:
        reset, memory, observing = _parts(uniforms, self._reset_sizes)
        state = self._dynamics.reset(reset)
        return _State(initial_scene(self.instance, state, memory, observing), state)

    def output(self, state: _State, inputs: Signals, now: Moment) -> Signals:
        return scene_outputs(state.scene, now.tick > 0)

    def update(self, state: _State, inputs: Signals, now: Moment) -> _State:
        task, world = self.instance, self._dynamics
        chance, observe, *again = _parts(now.uniforms, self._sizes)
        # as in training: without the barrier XLA would step the world again for every use of its state
        moved = jax.lax.optimization_barrier(world.step(state.dynamics, inputs["action"], chance))
        scene, ended = advance_scene(task, state.scene, moved, inputs["action"], observe)
        if not self._restarts:
            return _State(scene, moved)
        reset, memory, observing = again
        moved = jax.tree.map(lambda new, old: jnp.where(ended, new, old), world.reset(reset), moved)
        return _State(restart_scene(task, scene, moved, ended, memory, observing), moved)


def _parts(numbers: Array, sizes: tuple[int, ...]) -> list[Array]:
    """Consecutive parts of these sizes."""
    ends = [sum(sizes[: n + 1]) for n in range(len(sizes))]
    return [numbers[end - size : end] for end, size in zip(ends, sizes, strict=True)]


BODIES = tuple(name for name, kind in TASKS.items() if issubclass(kind, BodyTask))


@dataclasses.dataclass(frozen=True)
class HostTaskBlock(HostBlock):
    """Base class of tasks on the host: their ports and functions."""

    category: ClassVar[str] = "bodies and worlds"

    @functools.cached_property
    def instance(self) -> HostTask:
        """The task."""
        raise NotImplementedError

    @functools.cached_property
    def _compiled(self) -> Functions:
        return functions(self.instance, self.instance.batch([0], threads=1).unpack)

    @property
    def inputs(self) -> Ports:
        return {"action": action_port(self.instance)}

    @property
    def outputs(self) -> Ports:
        return self._outputs

    @functools.cached_property
    def _outputs(self) -> Ports:  # read at every tick
        return scene_ports(self.instance)

    @property
    def uniforms(self) -> int:
        return self.instance.init_uniforms + 2 * self.instance.uniforms

    @property
    def init_uniforms(self) -> int:
        return self.instance.init_uniforms + self.instance.uniforms

    @property
    def no_restore(self) -> str | None:
        return self.instance.no_resume

    def start(self, seeds: np.ndarray, uniforms: Float[np.ndarray, "seeds _"], threads: int = 0) -> TaskHost:
        batch = self.instance.batch([int(seed) for seed in seeds], threads)
        return TaskHost(self.instance, batch, self._compiled, uniforms)


@dataclasses.dataclass(frozen=True)
class Body(HostTaskBlock):
    """A task on a body with muscles: the hopper, the hexapods. All seeds are stepped together, on as many threads as
    there are processors.

    It outputs an observation; the action taken on it moves the body until the next tick, which outputs the reward. One
    tick of the block is one decision, and must last the task's `period`.
    """

    name: ClassVar[str] = "body"

    task: Literal[BODIES] = static("hopper", help="name of the task")  # type: ignore[valid-type]
    settings: str | Mapping[str, Any] = static("", help="settings of the task, as TOML: `penalty = 0.2`")

    def validate(self) -> None:
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        _ = self.instance

    @functools.cached_property
    def instance(self) -> BodyTask:
        choice("task", self.task, TASKS, registered=True)
        return cast(BodyTask, make(self.task, **read_table("settings", self.settings)))

    def ticks(self, tick: float) -> int:
        ticks = super().ticks(tick)
        period = self.instance.period
        fits = abs(ticks * tick - period) <= 1e-6 * period
        check(fits, "tick of the block", ticks * tick, f"a decision of the task, {period:g} s")
        return ticks


@dataclasses.dataclass(frozen=True)
class Environment(HostTaskBlock):
    """Any installed Gymnasium environment, one per seed. Observations are scaled and actions coded as in
    `motorgrad.tasks.Gymnasium`.

    The environment is made by Gymnasium from its registry: an id may not name a module to import. Some environments
    cannot be saved; a run of the diagram then cannot go back in time, and says so before it runs.
    """

    name: ClassVar[str] = "environment"

    env_id: str = static("CartPole-v1", help="id of the environment")
    settings: str | Mapping[str, Any] = static(
        "", help="settings of the task, as TOML; those of the environment are `kwargs.name = 1`"
    )

    def validate(self) -> None:
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        text = len(self.env_id) <= 200 and ":" not in self.env_id
        check(text, "env_id", self.env_id, "the id of a registered environment; import its module first")
        _ = self.instance

    @functools.cached_property
    def instance(self) -> HostTask:
        return cast(Gymnasium, make("gymnasium", env_id=self.env_id, **read_table("settings", self.settings)))
