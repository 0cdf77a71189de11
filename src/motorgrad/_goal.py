"""The goal of a task: what tasks say of their target, and learners use to learn about other targets."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float


class Goal(NamedTuple):
    """A target that is drawn for each episode and stays where it is, with which a learner can tell what an observation
    and a reward would have been for another target. Observations are meant in the task's own units, as `Task.sense`
    gives them.

    - `errors`: the places in the observation of the target's errors, wanted − actual.
    - `reward(errors)`: the part of a reward that depends on the errors to which an action led.
    - `targets`, `actual`: the places of the target itself, and of what should reach it, in the order and the units of
      its errors; empty where they are not shown.
    - `shown(observation)`: what policies see of it, for a task that scales; `None` where they see it as it is. Engines
      set it, with the present statistics.
    """

    errors: tuple[int, ...]
    reward: Callable[[Float[Array, " errors"]], Float[Array, ""]]
    targets: tuple[int, ...] = ()
    actual: tuple[int, ...] = ()
    shown: Callable[[Float[Array, " inputs"]], Float[Array, " inputs"]] | None = None

    def target(self, observation: Float[Array, "*batch inputs"]) -> Float[Array, "*batch errors"] | None:
        """The target, as observations show it, or actual + error; none where they show neither."""
        if self.targets:
            return observation[..., jnp.asarray(self.targets)]
        if self.actual:
            return observation[..., jnp.asarray(self.actual)] + observation[..., jnp.asarray(self.errors)]
        return None
