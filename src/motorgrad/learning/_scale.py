r"""Normalised advantages: steps of one size, whatever the rewards are counted in and however far they still spread."""

import dataclasses
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check


class ScaleState(NamedTuple):
    """The decaying sum of squared advantages, and that of their `weight`, which tends to 1."""

    squares: Float[Array, ""]
    weight: Float[Array, ""]


@dataclasses.dataclass(frozen=True)
class RootMeanSquare:
    r"""Divides advantages $\delta$ by $\sqrt{v}$, where $v$ is a running mean of $\delta^2$.

    A step size then says how far an advantage of usual size moves the parameters. It means the same for rewards of any
    unit, and in a task whose rewards spread less and less while it is learnt the steps keep their length. The mean
    forgets as $v \leftarrow v + \gamma\,(\delta^2 - v)$ and is corrected for its start as Adam's is (Kingma & Ba,
    2015), so that the first advantage counts as one. The newest is in it, so none counts as more than
    $1/\sqrt\gamma$; this couples the two, a bias of the order of $\gamma$.

    **Arguments:** `rate` $\gamma \in (0, 1)$, per reward.

    **Raises:** `ValueError` for a rate outside its range.
    """

    rate: float = 1e-3

    def __post_init__(self) -> None:
        check(0 < self.rate < 1, "rate", self.rate, "in (0, 1)")

    def init(self, dtype: Any) -> ScaleState:
        """The state before any advantage."""
        return ScaleState(jnp.zeros((), dtype), jnp.zeros((), dtype))

    def update(self, state: ScaleState, advantage: Float[Array, ""]) -> ScaleState:
        """Take in an advantage."""
        return ScaleState(
            state.squares + self.rate * (jnp.square(advantage) - state.squares),
            state.weight + self.rate * (1 - state.weight),
        )

    def factor(self, state: ScaleState) -> Float[Array, ""]:
        """What an advantage is multiplied by; 0 where all of them have been 0."""
        some = state.squares > 0
        return jnp.where(some, jnp.sqrt(state.weight / jnp.where(some, state.squares, 1)), 0)
