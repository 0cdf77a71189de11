"""Tasks on muscle-driven bodies."""

import abc
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from motorgrad.bodies import Body, BodyBatch
from motorgrad.tasks._host_task import HostTask


class BodyTask(HostTask):
    """A task whose dynamics are a body; an action holds the activation of each of its groups of muscles, or of units
    that drive several groups each (`drives`).

    The `state` that the task's functions see is a `motorgrad.bodies.BodyState`.
    """

    @property
    @abc.abstractmethod
    def dynamics(self) -> Body: ...

    @property
    @abc.abstractmethod
    def substeps(self) -> int:
        """Physics steps from one decision to the next."""

    @property
    def drives(self) -> Float[np.ndarray, "units groups"] | None:
        """Which groups of muscles each unit drives, in zeros and ones; `None` where every group has a unit of its own.

        A group is active while any of the units that drive it fires.
        """
        return None

    @property
    def action_size(self) -> int:
        drives = self.drives
        return len(self.dynamics.groups if drives is None else drives)

    def control(self, action: Any, memory: Any = None) -> Any:
        """The activation of each group of muscles, `(…, action_size)` to `(…, groups)`."""
        del memory
        drives = self.drives
        return action if drives is None else jnp.minimum(action @ drives, 1.0)

    def batch(self, seeds: Sequence[int], threads: int = 0) -> BodyBatch:
        return BodyBatch(self.dynamics, len(seeds), substeps=self.substeps, threads=threads)
