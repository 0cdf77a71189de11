"""True-online TD(λ): a critic whose weights equal those of the online forward view after every decision."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._branching import Flag, where
from motorgrad.learning._critic_fits import CriticStep, LevelFit, Weights, level_rate
from motorgrad.schema import number


class TrueOnlineState(NamedTuple):
    r"""The dutch `trace` $e$, and the `value` of the present state by the weights of the previous decision."""

    trace: Weights
    value: Float[Array, ""]


class TrueOnlineTemporalDifference(LevelFit):
    r"""True-online TD(λ) (van Seijen et al., 2016, algorithm 1).

    With $v = w \cdot \phi$, $v' = w \cdot \phi'$ and $\bar v$, the $v'$ of the previous decision (0 at the start of an
    episode),

    $$e \leftarrow \gamma\lambda e + \phi - \alpha\gamma\lambda\,(e \cdot \phi)\,\phi, \qquad
    w \leftarrow w + \alpha\,(\delta + v - \bar v)\,e - \alpha\,(v - \bar v)\,\phi .$$

    After each decision the weights are exactly those of the online forward view, in which every earlier state moves
    towards its λ-return up to now. TD(λ) approaches them only as $\alpha \to 0$. With $\lambda = 0$ both are the same.

    ```python
    critic = mg.learning.LinearCritic(discount=0.9, decay=0.9, fit=mg.learning.TrueOnlineTemporalDifference(0.1))
    ```
    """

    learning_rate: float = number(
        0.01,
        0,
        help=r"$\alpha$. Steps are stable where $\alpha$ times the squared length of the features is below 1, for any "
        r"decay",
    )
    level_rate: float = level_rate()

    def init(self, weights: Weights, features: int) -> TrueOnlineState:
        return TrueOnlineState(weights, jnp.zeros((), weights.dtype))

    def update(
        self, weights: Weights, state: TrueOnlineState, step: CriticStep, dropped: Flag = False
    ) -> tuple[Weights, TrueOnlineState]:
        phi = step.slope
        rate = self.learning_rate
        fade = step.discount * step.decay
        trace = fade * state.trace + (1 - rate * fade * jnp.sum(state.trace * phi)) * phi
        change = jnp.sum(weights * phi) - state.value
        moved = weights + rate * ((step.error + change) * trace - change * phi)
        following = jnp.sum(weights * step.next_features)
        return where(dropped, (weights, state), (moved, TrueOnlineState(trace, following)))

    def restart(self, state: TrueOnlineState) -> TrueOnlineState:
        return TrueOnlineState(jnp.zeros_like(state.trace), jnp.zeros_like(state.value))
