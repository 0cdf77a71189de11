"""Tasks whose dynamics run on the host, for all seeds at once."""

import abc
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import jax
import numpy as np
from jaxtyping import Float

from motorgrad.tasks._task import Task

# On the host every decision is a compiled call, which takes less time than waking another thread for it, as
# asynchronous dispatch does. The setting is the whole process's, and has no effect where JAX is already at work.
jax.config.update("jax_cpu_enable_async_dispatch", False)


class HostBatch(Protocol):
    """The dynamics of all seeds, moved on the host.

    - `packed` (seeds, width) float32: all that the task's functions may see, refreshed in place; the last number of a
      row is 1 where the dynamics broke in the step just made, else 0.
    - `lost`: whether any row broke in the step just made.
    """

    packed: Float[np.ndarray, "seeds width"]
    lost: bool

    def step(self, actions: Float[np.ndarray, "seeds size"], /) -> None:
        """Move every seed by one decision."""

    def reset(self, rows: Any = None) -> None:
        """Begin a new episode in these rows, by default in all."""

    def unpack(self, packed: Any) -> Any:
        """The state that the task's functions see, from one packed row or any array of them."""

    def snapshot(self) -> dict[str, np.ndarray]:
        """All that `restore` needs, copied; seeds lead."""
        ...

    def restore(self, snapshot: Mapping[str, np.ndarray], /) -> None:
        """Go back to a snapshot."""


class HostTask(Task):
    """A task whose dynamics are stepped on the host, and whose functions are compiled."""

    @abc.abstractmethod
    def batch(self, seeds: Sequence[int], threads: int = 0) -> HostBatch:
        """The dynamics, one row for each seed, at the start of an episode; `threads`, where they can use them."""

    def control(self, action: Any, memory: Any = None) -> Any:
        """What the dynamics are told of an action, `(…, action_size)`: by default the action itself. `memory` is what
        the task remembered when it was chosen, with the same leading axes."""
        del memory
        return action

    @property
    def no_resume(self) -> str | None:
        """Why the dynamics cannot be saved and restored; `None` where they can."""
        return None
