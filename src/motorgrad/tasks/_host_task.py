"""Tasks whose dynamics run on the host, for all seeds at once: bodies and foreign environments."""

import abc
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, PyTree

from motorgrad._arrays import AnyArray
from motorgrad._errors import check
from motorgrad.bodies import Body, BodyBatch
from motorgrad.schema import number
from motorgrad.tasks._task import Task

MAX_SUBSTEPS = 10_000  # physics steps per decision
# On the host every decision is a compiled call that takes less time than waking another thread, as asynchronous
# dispatch does. The setting is process-wide, and has no effect if JAX is already in use.
jax.config.update("jax_cpu_enable_async_dispatch", False)


class HostBatch(Protocol):
    """The dynamics of all seeds, stepped on the host.

    - `packed` (seeds, width) float32: everything the task's functions may see, updated in place. The last number of a
      row is 1 if the dynamics diverged in the last step, else 0.
    - `lost`: whether any row diverged in the last step.
    """

    packed: Float[np.ndarray, "seeds width"]
    lost: bool

    def step(self, actions: Float[np.ndarray, "seeds size"], /) -> None:
        """Advance every seed by one decision."""

    @property
    def reset(self) -> Callable[..., None]:
        """Start a new episode in these rows, by default in all: `reset(rows=None, **begin)`, with what `HostTask.begin`
        returned."""
        ...

    @property
    def unpack(self) -> Callable[[Float[AnyArray, "*rows width"]], PyTree]:
        """The function from one packed row, or any array of rows, to the state that the task's functions see.

        Compiled programs keep this function. A bound method would keep the batch, and what it holds, alive with them.
        """
        ...

    def snapshot(self) -> dict[str, np.ndarray]:
        """Everything `restore` needs, copied; seeds lead."""
        ...

    def restore(self, snapshot: Mapping[str, np.ndarray], /) -> None:
        """Return to a snapshot."""


class HostTask(Task):
    """A task whose dynamics are stepped on the host, and whose functions are compiled."""

    @abc.abstractmethod
    def batch(self, seeds: Sequence[int], threads: int = 0) -> HostBatch:
        """The dynamics at the start of an episode, one row per seed; `threads` if they can use them."""

    def control(self, action: Float[AnyArray, "... action_size"], memory: PyTree = None) -> Float[AnyArray, "... size"]:
        """The input of the dynamics for an action, `(…, action_size)`; by default the action itself. `memory` is the
        task's memory when the action was chosen, with the same leading axes."""
        del memory
        return action

    def begin(self, uniforms: Float[np.ndarray, "rows init_uniforms"]) -> Mapping[str, np.ndarray]:
        """How the dynamics begin an episode in some rows: further arguments of `HostBatch.reset`, from the numbers that
        `init` receives. By default none, so that they begin in their own way."""
        del uniforms
        return {}

    @property
    def no_resume(self) -> str | None:
        """Why the dynamics cannot be saved and restored; `None` if they can."""
        return None


class BodyTask(HostTask):
    """A task on a muscle-driven body. An action is the activation of each group of muscles, or of units that drive
    several groups each (`drives`).

    Subclasses are dataclasses with the settings `body`, `action_period` and `time_limit`, each with a default of its
    own. The `state` seen by the task's functions is a `motorgrad.bodies.BodyState`.
    """

    body: Any
    action_period: float = number(
        unit="s", help="simulated time between two decisions, a multiple of the body's time step"
    )
    time_limit: float | None = number(
        unit="s", help="simulated time after which an episode is cut; `None` for a continuing task"
    )

    def validate(self) -> None:
        super().validate()
        self.check_times()

    def check_times(self) -> None:
        """Refuse a period that is no multiple of the time step, and an episode shorter than it."""
        ratio = self.action_period / self.body.timestep
        whole = 0.5 < ratio < MAX_SUBSTEPS + 0.5 and abs(ratio - round(ratio)) < 1e-6
        allowed = f"a positive multiple of the time step, {self.body.timestep} s, at most {MAX_SUBSTEPS} of them"
        check(whole, "action_period", self.action_period, allowed)
        check(
            self.time_limit is None or 1 <= self.time_limit / self.action_period < 2**31,
            "time_limit",
            self.time_limit,
            f"None or at least one action period, {self.action_period} s, and fewer than 2147483648 of them",
        )

    @property
    def dynamics(self) -> Body:
        return self.body

    @property
    def substeps(self) -> int:
        """Physics steps per decision."""
        return round(self.action_period / self.body.timestep)

    @property
    def period(self) -> float:
        return self.action_period

    @property
    def episode_limit(self) -> int | None:
        return None if self.time_limit is None else round(self.time_limit / self.action_period)

    @functools.cached_property
    def drives(self) -> Float[np.ndarray, "units groups"] | None:
        """Which groups of muscles each unit drives, in zeros and ones; `None` if every group has its own unit.

        A group is active while any of its units fires.
        """
        return None

    @property
    def action_size(self) -> int:
        drives = self.drives
        return len(self.dynamics.groups if drives is None else drives)

    @property
    def action_names(self) -> tuple[str, ...]:
        """The groups of muscles, where each has its own unit."""
        groups = tuple(self.dynamics.groups)
        return groups if self.drives is None and len(groups) == self.action_size else ()

    def control(self, action: Float[AnyArray, "... action_size"], memory: PyTree = None) -> Float[AnyArray, "... size"]:
        """The activation of each group of muscles, from `(…, action_size)` to `(…, groups)`."""
        del memory
        drives = self.drives
        return action if drives is None else jnp.minimum(action @ drives, 1.0)

    def batch(self, seeds: Sequence[int], threads: int = 0) -> BodyBatch:
        self.check_times()
        return BodyBatch(self.dynamics, len(seeds), substeps=self.substeps, threads=threads)
