"""Tasks on finite MDPs: reward and observation are the MDP's own."""

import abc
import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad.schema import static
from motorgrad.tasks._task import Actions, Task, check_time_limit
from motorgrad.worlds import FiniteMDP, call_admission, chain, load_unload, parity, t_maze, three_state

MAX_STATES = 2000  # a finite MDP is a dense table of all transitions
# Tasks with equal settings are equal, so each world is made only once.
_three_state, _chain, _call_admission = (functools.cache(make) for make in (three_state, chain, call_admission))
_parity, _load_unload, _t_maze = (functools.cache(make) for make in (parity, load_unload, t_maze))


@dataclasses.dataclass(frozen=True)
class FiniteTask(Task):
    """A finite MDP as a task."""

    time_limit: int | None = static(
        None, help="decisions after which an episode is cut and restarts; `None` for a continuing task"
    )

    def validate(self) -> None:
        check_time_limit(self.time_limit)

    @property
    @abc.abstractmethod
    def dynamics(self) -> FiniteMDP: ...

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
    actions: ClassVar[Actions] = "discrete"
    learner: ClassVar[Mapping[str, Any]] = {"policy": "softmax", "decay": 0.8, "learning_rate": 0.01}

    @property
    def dynamics(self) -> FiniteMDP:
        return _three_state()


@dataclasses.dataclass(frozen=True)
class Chain(FiniteTask):
    """The chain of figure 4.9: reward only at its far end (see `motorgrad.worlds.chain` for the variants)."""

    name: ClassVar[str] = "chain"
    actions: ClassVar[Actions] = "discrete"
    learner: ClassVar[Mapping[str, Any]] = {"policy": "softmax", "decay": 0.9, "learning_rate": 0.05}

    length: int = static(6, help="number of states, from 2 to 2,000")
    variant: Literal["walk", "reset"] = static(
        "walk", help='effect of a wrong move: `"walk"`, one state back; `"reset"`, back to the start'
    )

    def validate(self) -> None:
        super().validate()
        check(2 <= self.length <= MAX_STATES, "length", self.length, f"from 2 to {MAX_STATES} states")

    @property
    def dynamics(self) -> FiniteMDP:
        return _chain(self.length, self.variant)


@dataclasses.dataclass(frozen=True)
class CallAdmission(FiniteTask):
    """Call admission control (Marbach & Tsitsiklis, 1998): accept an arriving call, or keep room for a better one."""

    name: ClassVar[str] = "call-admission"
    actions: ClassVar[Actions] = "binary"
    learner: ClassVar[Mapping[str, Any]] = {"policy": "hyperplanes", "decay": 0.9, "learning_rate": 0.003}

    capacity: int = static(10, help="calls that the link carries, from 1 to 2,000")

    def validate(self) -> None:
        super().validate()
        check(1 <= self.capacity <= MAX_STATES, "capacity", self.capacity, f"from 1 to {MAX_STATES} calls")

    @property
    def dynamics(self) -> FiniteMDP:
        return _call_admission(self.capacity)


@dataclasses.dataclass(frozen=True)
class Parity(FiniteTask):
    """Whether an odd number of bits is set (see `motorgrad.worlds.parity`): it takes hidden units."""

    name: ClassVar[str] = "parity"
    actions: ClassVar[Actions] = "binary"
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "layered", "hidden": (16,), "scale": 6.0},
        "decay": 0.0,
        "learning_rate": 0.03,
    }

    inputs: int = static(2, help="number of bits, from 1 to 10")

    def validate(self) -> None:
        super().validate()
        check(1 <= self.inputs <= 10, "inputs", self.inputs, "from 1 to 10 bits")

    @property
    def dynamics(self) -> FiniteMDP:
        return _parity(self.inputs)


@dataclasses.dataclass(frozen=True)
class LoadUnload(FiniteTask):
    """Carry loads from one end of a line to the other, without seeing the load (see `motorgrad.worlds.load_unload`)."""

    name: ClassVar[str] = "load-unload"
    actions: ClassVar[Actions] = "discrete"
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "finite-state-controller", "strength": 1.0},
        "decay": 0.95,
        "learning_rate": 0.1,
    }

    length: int = static(5, help="number of places, from 3 to 1,000")

    def validate(self) -> None:
        super().validate()
        check(3 <= self.length <= MAX_STATES // 2, "length", self.length, f"from 3 to {MAX_STATES // 2} places")

    @property
    def dynamics(self) -> FiniteMDP:
        return _load_unload(self.length)

    @property
    def observation_names(self) -> tuple[str, ...]:
        return ("left end", "right end", "between")


@dataclasses.dataclass(frozen=True)
class TMaze(FiniteTask):
    """A T-maze: a cue at the start tells which way to turn at the end of a corridor (see `motorgrad.worlds.t_maze`)."""

    name: ClassVar[str] = "t-maze"
    actions: ClassVar[Actions] = "discrete"
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "finite-state-controller", "states": 8},
        "decay": 0.9,
        "learning_rate": 0.01,
    }

    length: int = static(5, help="steps from the start to the junction, from 1 to 900")

    def validate(self) -> None:
        super().validate()
        check(1 <= self.length <= 900, "length", self.length, "from 1 to 900 steps")

    @property
    def dynamics(self) -> FiniteMDP:
        return _t_maze(self.length)

    @property
    def observation_names(self) -> tuple[str, ...]:
        return ("cue up", "cue down", "corridor", "junction", "outside")
