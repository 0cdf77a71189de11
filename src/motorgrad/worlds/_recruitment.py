"""The loads that a pool of motoneurons is asked to lift: independent ones, those it asks for itself, and a sweep from
light to heavy."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.worlds._world import World


class UniformLoads(World):
    """Each load is drawn from U[`low`, `high`] by itself (section 4.3.1 of the thesis). The state is the load."""

    uniforms: ClassVar[int] = 1
    reset_uniforms: ClassVar[int] = 1

    def __init__(self, low: float = 0.0, high: float = 1.0) -> None:
        check(low < high, "low, high", (low, high), "an interval, low < high")
        self.low, self.high = low, high

    def reset(self, uniforms: Float[Array, " 1"]) -> Float[Array, ""]:
        return self.low + (self.high - self.low) * uniforms[0]

    def step(self, state: Float[Array, ""], action: Array, uniforms: Float[Array, " 1"]) -> Float[Array, ""]:
        return self.reset(uniforms)


class QueriedLoads(UniformLoads):
    """Each load is the one that was asked for: the last number of the action, as far as it is within [`low`, `high`].

    The first load is drawn from U[`low`, `high`]. The state is the load.
    """

    uniforms: ClassVar[int] = 0

    def step(self, state: Float[Array, ""], action: Array, uniforms: Float[Array, " 0"]) -> Float[Array, ""]:
        return jnp.clip(action[-1], self.low, self.high).astype(state.dtype)


class SweepingLoads(World):
    """The load starts at `low` and grows by U[`least`, `most`] at every step (section 4.3.2 of the thesis).

    The state is the load. It grows without end; where a sweep is over is a matter of the task.
    """

    uniforms: ClassVar[int] = 1

    def __init__(self, low: float = -2.0, least: float = 0.1, most: float = 0.3) -> None:
        check(0 < least <= most, "least, most", (least, most), "positive, least <= most")
        self.low, self.least, self.most = low, least, most

    def reset(self, uniforms: Float[Array, " 0"]) -> Float[Array, ""]:
        return jnp.asarray(self.low, jnp.result_type(float))

    def step(self, state: Float[Array, ""], action: Array, uniforms: Float[Array, " 1"]) -> Float[Array, ""]:
        return state + self.least + (self.most - self.least) * uniforms[0]
