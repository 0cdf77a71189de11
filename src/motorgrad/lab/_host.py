"""Blocks that live on the host: a simulator, an environment, anything that is no JAX function."""

import abc
import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from motorgrad.lab._block import Block, Timing


class HostMoment(NamedTuple):
    """When a host is asked; as `Moment`, for all seeds."""

    tick: int
    time: float
    step: float
    uniforms: Float[np.ndarray, "seeds uniforms"]


class Host(abc.ABC):
    """What a host block is while it runs: one object for all seeds, which lead in every array.

    `block` is the block as it stands, with its parameters as arrays: they may change between two calls.
    """

    @abc.abstractmethod
    def output(self, block: Any, inputs: dict[str, np.ndarray], now: HostMoment) -> dict[str, np.ndarray]:
        """The outputs by name, each `(seeds, …)`. `inputs` has the ports with feedthrough only."""

    @abc.abstractmethod
    def update(self, block: Any, inputs: dict[str, np.ndarray], now: HostMoment) -> None:
        """Move on to the next evaluation; `inputs` has all ports."""

    @abc.abstractmethod
    def snapshot(self) -> dict[str, np.ndarray]:
        """A copy of all that `restore` needs, by name; seeds lead."""

    @abc.abstractmethod
    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """Go back to a snapshot."""

    def close(self) -> None:  # noqa: B027  (most have nothing to give back)
        """Give back what the system lent."""


@dataclasses.dataclass(frozen=True)
class HostBlock(Block, abc.ABC):
    """A block whose functions run on the host, for all seeds at once, exactly once at each of its ticks.

    Its inputs should have no feedthrough where that is possible, as then one compiled call makes a tick. The functions
    `init`, `output` and `update` of other blocks are those of its `Host`. Parameters are the same for all seeds.
    """

    @property
    def timing(self) -> Timing:
        return "discrete"

    @property
    def no_restore(self) -> str | None:
        """Why its state cannot be saved and restored; `None` where it can."""
        return None

    @abc.abstractmethod
    def start(self, seeds: np.ndarray, uniforms: Float[np.ndarray, "seeds init_uniforms"], threads: int = 0) -> Host:
        """The host for these seeds before the first tick; `threads` that it may use, 0 for one per processor."""
