"""Tasks on finite MDPs: reward and observation are the MDP's own."""

import dataclasses
import functools
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad.schema import count, static
from motorgrad.tasks._task import Actions, Task
from motorgrad.worlds import FiniteMDP, call_admission, chain, load_unload, parity, t_maze, three_state

MAX_STATES = 2000  # a finite MDP is a dense table of all transitions


@dataclasses.dataclass(frozen=True)
class FiniteTask(Task):
    """A finite MDP as a task: the `world` of its settings, unless it has `dynamics` of its own."""

    world: ClassVar[Callable[..., FiniteMDP]]
    """The function that makes the MDP of the settings after the first, in their order."""

    time_limit: int | None = count(
        None, 1, unit="decisions", help="length at which an episode is cut and restarts; `None` for a continuing task"
    )

    @property
    def dynamics(self) -> FiniteMDP:
        _, *settings = (getattr(self, field.name) for field in dataclasses.fields(self))
        return _made(type(self).world, *settings)

    @property
    def observation_size(self) -> int:
        return self.dynamics.observations.shape[1]

    @property
    def action_size(self) -> int:
        count = self.dynamics.actions
        if self.actions == "discrete":
            return count
        check(count & (count - 1) == 0, "number of actions", count, "a power of two where units spell the action")
        return (count - 1).bit_length()

    @property
    def episode_limit(self) -> int | None:
        return self.time_limit

    def observe(self, memory: PyTree, state: Array, uniforms: Float[Array, " 0"]) -> tuple[PyTree, Array]:
        # If the reward depends on the state in which the action was taken, that state is the memory.
        memory = state if self.dynamics.rewards.ndim == 2 else memory
        return memory, jnp.asarray(self.dynamics.observations, jnp.result_type(float))[state]

    def reward(self, memory: PyTree, state: Array, action: Array) -> tuple[PyTree, Array, bool]:
        return memory, self.dynamics.reward(memory, action, state), False

    def init(self, uniforms: Float[Array, " 0"]) -> PyTree:
        return jnp.asarray(self.dynamics.start, jnp.int32) if self.dynamics.rewards.ndim == 2 else ()


@dataclasses.dataclass(frozen=True)
class ThreeState(FiniteTask):
    """The three-state MDP of Baxter & Bartlett (2001), on which gradient estimators are compared."""

    name: ClassVar[str] = "three-state"
    world: ClassVar[Callable[..., FiniteMDP]] = three_state
    actions: ClassVar[Actions] = "discrete"
    learner: ClassVar[Mapping[str, Any]] = {"policy": "softmax", "decay": 0.8, "learning_rate": 0.01}


@dataclasses.dataclass(frozen=True)
class Chain(FiniteTask):
    """The chain of figure 4.9: reward only at its far end (see `motorgrad.worlds.chain` for the variants)."""

    name: ClassVar[str] = "chain"
    world: ClassVar[Callable[..., FiniteMDP]] = chain
    actions: ClassVar[Actions] = "discrete"
    learner: ClassVar[Mapping[str, Any]] = {"policy": "softmax", "decay": 0.9, "learning_rate": 0.05}

    length: int = count(6, 2, MAX_STATES, help="number of states")
    variant: Literal["walk", "reset"] = static(
        "walk", help='effect of a wrong move: `"walk"`, one state back; `"reset"`, back to the start'
    )


@dataclasses.dataclass(frozen=True)
class CallAdmission(FiniteTask):
    """Call admission control (Marbach & Tsitsiklis, 1998): accept an arriving call, or keep room for a better one."""

    name: ClassVar[str] = "call-admission"
    world: ClassVar[Callable[..., FiniteMDP]] = call_admission
    actions: ClassVar[Actions] = "binary"
    learner: ClassVar[Mapping[str, Any]] = {"policy": "hyperplanes", "decay": 0.9, "learning_rate": 0.003}

    capacity: int = count(10, 1, MAX_STATES, help="calls that the link carries")


@dataclasses.dataclass(frozen=True)
class Parity(FiniteTask):
    """Whether an odd number of bits is set (see `motorgrad.worlds.parity`): it takes hidden units."""

    name: ClassVar[str] = "parity"
    world: ClassVar[Callable[..., FiniteMDP]] = parity
    actions: ClassVar[Actions] = "binary"
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "layered", "hidden": (16,), "scale": 6.0},
        "decay": 0.0,
        "learning_rate": 0.03,
    }

    inputs: int = count(2, 1, 10, help="number of bits")


@dataclasses.dataclass(frozen=True)
class LoadUnload(FiniteTask):
    """Carry loads from one end of a line to the other, without seeing the load (see `motorgrad.worlds.load_unload`)."""

    name: ClassVar[str] = "load-unload"
    world: ClassVar[Callable[..., FiniteMDP]] = load_unload
    actions: ClassVar[Actions] = "discrete"
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "finite-state-controller", "strength": 1.0},
        "decay": 0.95,
        "learning_rate": 0.1,
    }

    length: int = count(5, 3, MAX_STATES // 2, help="number of places")

    @property
    def observation_names(self) -> tuple[str, ...]:
        return ("left end", "right end", "between")


@dataclasses.dataclass(frozen=True)
class TMaze(FiniteTask):
    """A T-maze: a cue at the start tells which way to turn at the end of a corridor (see `motorgrad.worlds.t_maze`)."""

    name: ClassVar[str] = "t-maze"
    world: ClassVar[Callable[..., FiniteMDP]] = t_maze
    actions: ClassVar[Actions] = "discrete"
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "finite-state-controller", "states": 8},
        "decay": 0.9,
        "learning_rate": 0.01,
    }

    length: int = count(5, 1, 900, help="steps from the start to the junction")

    @property
    def observation_names(self) -> tuple[str, ...]:
        return ("cue up", "cue down", "corridor", "junction", "outside")


@functools.cache  # tasks with equal settings are equal, so each world is made only once
def _made(world: Callable[..., FiniteMDP], *settings: int | str) -> FiniteMDP:
    return world(*settings)
