"""What the two tasks of chapter 4 have in common: a load is seen, units of a pool fire, and their force is paid."""

import abc
import dataclasses
import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from motorgrad._errors import check
from motorgrad.tasks._drift import Drift
from motorgrad.tasks._task import Task

MOST = 10_000  # units


class Pull(NamedTuple):
    """What a recruitment task remembers: the load that is seen before the coming action; of the last action the load
    that it was `at` (the one that was seen, and what had drifted), its ratio (the part of the pool that fired, by size)
    and its effect; the clock of the drift, or `None`."""

    load: Float[Array, ""]
    at: Float[Array, ""]
    ratio: Float[Array, ""]
    effect: Float[Array, ""]
    clock: Int[Array, ""] | None


@dataclasses.dataclass(frozen=True)
class Recruitment(Task):
    """A pool of motor units that pull together at a load which all motoneurons see.

    **Arguments:**

    - `units`: in the pool, from 1 to 10,000.
    - `size_ratio`: the largest unit's force by the smallest's; sizes grow exponentially from the first unit to the
      last. 1 for equal units.
    - `drift`: how the muscle's strength, or the load beside the observed one, changes over time; by default neither.
    - `time_limit`: decisions after which an episode is cut; `None` for never.
    """

    units: int = 4
    size_ratio: float = 1.0
    drift: Drift = dataclasses.field(default_factory=Drift)
    time_limit: int | None = None

    def __post_init__(self) -> None:
        check(isinstance(self.units, int) and 1 <= self.units <= MOST, "units", self.units, f"from 1 to {MOST}")
        check(1 <= self.size_ratio <= 1e6, "size_ratio", self.size_ratio, "from 1 to 1e6")
        whole = self.time_limit is None or (isinstance(self.time_limit, int) and 1 <= self.time_limit < 2**31)
        check(whole, "time_limit", self.time_limit, "None, or from 1 to 2147483647 decisions")

    @property
    def observation_size(self) -> int:
        return 1

    @property
    def action_size(self) -> int:
        return self.units

    @property
    def takes(self) -> tuple[str, ...]:
        return ("binary", "graded")

    @property
    def episode_limit(self) -> int | None:
        return self.time_limit

    @functools.cached_property
    def sizes(self) -> Float[np.ndarray, " units"]:
        """Each unit's part of the force of the whole pool; they sum to 1."""
        grown = self.size_ratio ** (np.arange(self.units) / max(1, self.units - 1))
        return grown / grown.sum()

    @abc.abstractmethod
    def effect(
        self, load: Float[Array, ""], ratio: Float[Array, ""], strength: Float[Array, ""] | float = 1.0
    ) -> Float[Array, ""]:
        """What comes of pulling at a load with this part of a pool whose muscle has changed to `strength`."""

    @abc.abstractmethod
    def pay(self, load: Float[Array, ""], ratio: Float[Array, ""], effect: Float[Array, ""]) -> Float[Array, ""]:
        """What that pays."""

    def ratio(self, action: Float[Array, " units"]) -> Float[Array, ""]:
        """The part of the pool that fires, by size: from 0 to 1. Graded activations are clipped to that, each by
        itself."""
        action = jnp.clip(action[: self.units], 0, 1)
        if self.size_ratio == 1:
            return jnp.sum(action) / self.units
        return jnp.sum(action * jnp.asarray(self.sizes, action.dtype))

    def init(self, uniforms: Float[Array, " 0"]) -> Pull:
        zero = jnp.zeros(())
        return Pull(zero, zero, zero, zero, self.drift.start())

    def renew(self, memory: Pull, uniforms: Float[Array, " 0"]) -> Pull:
        """What drifts goes on from one episode to the next."""
        return self.init(uniforms)._replace(clock=memory.clock)

    def observe(
        self, memory: Pull, state: Float[Array, ""], uniforms: Float[Array, " 0"]
    ) -> tuple[Pull, Float[Array, " 1"]]:
        return memory._replace(load=state), state[None]

    def reward(
        self, memory: Pull, state: Float[Array, ""], action: Float[Array, " units"]
    ) -> tuple[Pull, Float[Array, ""], Bool[Array, ""] | bool]:
        ratio = self.ratio(action)
        load = memory.load + self.drift.load(memory.clock)
        effect = self.effect(load, ratio, self.drift.strength(memory.clock))
        memory = Pull(memory.load, load, ratio, effect, self.drift.tick(memory.clock))
        return memory, self.pay(load, ratio, effect), self.over(state)

    def over(self, state: Float[Array, ""]) -> Bool[Array, ""] | bool:
        """Whether the episode is over once the next load is `state`."""
        del state
        return False

    def immediate(self, observation: Float[Array, " 1"], action: Any) -> Float[Array, ""]:
        """The reward of an action at an observed load, as `motorgrad.worlds.mean_field` takes it (without drift)."""
        ratio = self.ratio(action)
        return self.pay(observation[0], ratio, self.effect(observation[0], ratio))
