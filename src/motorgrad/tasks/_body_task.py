"""Tasks on muscle-driven bodies."""

import abc
from collections.abc import Sequence

from motorgrad.bodies import Body, BodyBatch
from motorgrad.tasks._host_task import HostTask


class BodyTask(HostTask):
    """A task whose dynamics are a body; an action holds the activation of each of its groups of muscles.

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
    def action_size(self) -> int:
        return len(self.dynamics.groups)

    def batch(self, seeds: Sequence[int], threads: int = 0) -> BodyBatch:
        return BodyBatch(self.dynamics, len(seeds), substeps=self.substeps, threads=threads)
