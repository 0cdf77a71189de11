"""SwiftTD: true-online TD(λ) that learns a step size for every feature."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._branching import Flag, where
from motorgrad._errors import check
from motorgrad.learning._critic_fits import CriticStep, LevelFit, Weights, level_rate
from motorgrad.schema import is_tracer, number

MIN_STEP_SIZE = 1e-10
"""Of a feature."""


class SwiftState(NamedTuple):
    r"""The state of SwiftTD beside the weights.

    - `log_rates`: $\beta$, of which $e^\beta$ are the step sizes.
    - `trace`: the dutch trace $z$, with the step sizes in it.
    - `value`: of the present state by the weights of the previous decision.
    - `slopes`: $h = \partial w/\partial\beta$, and as they were at the previous decision, `earlier_slopes`.
    - `trace_slopes`: $\bar z = \partial z/\partial\beta$.
    - `credit`: the trace of $h\,\phi$, by which a temporal difference moves $\beta$.
    """

    log_rates: Weights
    trace: Weights
    value: Float[Array, ""]
    slopes: Weights
    earlier_slopes: Weights
    trace_slopes: Weights
    credit: Weights


class SwiftTemporalDifference(LevelFit):
    r"""SwiftTD (Javed, Sharifnassab & Sutton, 2024): true-online TD(λ) with a step size $\alpha_i = e^{\beta_i}$ for
    every feature, which is learned.

    The step sizes descend the squared temporal difference, $\beta \leftarrow \beta + \theta\,\delta p/\alpha$ with the
    trace $p$ of $h\,\phi$, where $h = \partial w/\partial\beta$ is followed from decision to decision. So a feature
    that predicts gets a large step size, and one that does not a small one. The sum $\sum_i \alpha_i\phi_i^2$, the
    share of an error that one step takes away, is bounded by $\eta$: where it is more, the steps are shortened to the
    bound, and $\beta_i \leftarrow \beta_i + \phi_i^2\log\epsilon$.

    Derivatives of one feature's weight by another's step size are neglected, as in IDBD (Sutton, 1992), and a step size
    is never above $\eta$.

    **Raises:** `ValueError` for a value out of range, and for an `initial` step size above the `bound`.

    ```python
    critic = mg.learning.LinearCritic(discount=0.9, decay=0.9, fit=mg.learning.SwiftTemporalDifference())
    ```
    """

    initial: float = number(
        0.01, 0, 1, open_low=True, at_start=True, help="every step size at the start, at most the `bound`"
    )
    meta_rate: float = number(0.01, 0, help=r"$\theta$; 0 leaves the step sizes as they are, but for the bound")
    bound: float = number(
        0.5, 0, 1, open_low=True, help=r"$\eta$, the greatest share of an error that one step takes away"
    )
    shrinkage: float = number(
        0.999,
        0,
        1,
        open_low=True,
        help=r"$\epsilon$, what is left of a step size when the bound was exceeded, for a feature of 1",
    )
    level_rate: float = level_rate()

    def validate(self) -> None:
        if not is_tracer(self.initial) and not is_tracer(self.bound):
            check(self.initial <= self.bound, "initial", self.initial, f"at most the bound, {self.bound}")

    def init(self, weights: Weights, features: int) -> SwiftState:
        rates = jnp.full_like(weights, 1) * jnp.log(jnp.asarray(self.initial, weights.dtype))
        return SwiftState(rates, weights, jnp.zeros((), weights.dtype), *[weights] * 4)

    def update(
        self, weights: Weights, state: SwiftState, step: CriticStep, dropped: Flag = False
    ) -> tuple[Weights, SwiftState]:
        phi = step.slope
        fade = step.discount * step.decay
        rates = jnp.exp(state.log_rates)
        share = jnp.sum(rates * jnp.square(phi))
        over = share > self.bound
        entry = jnp.where(over, self.bound / share, 1) * rates * phi
        slopes, earlier = state.slopes, state.earlier_slopes
        old = fade * state.trace
        old_slopes = fade * state.trace_slopes
        room = 1 - jnp.sum(old * phi)
        trace = old + entry * room
        trace_slopes = jnp.where(over, 0, old_slopes + entry * (room - old_slopes * phi))
        credit = fade * state.credit + earlier * phi

        # With v̄, the value before the last step of the weights: δ + v − v̄ is the error that v̄ had.
        change = jnp.sum(weights * phi) - state.value
        surprise = step.error + change
        moved = weights + surprise * trace - change * entry
        log_rates = state.log_rates + self.meta_rate * step.error * credit / rates
        log_rates = log_rates + jnp.where(over, jnp.square(phi) * jnp.log(self.shrinkage), 0)
        log_rates = jnp.clip(log_rates, jnp.log(MIN_STEP_SIZE), jnp.log(self.bound))
        following = slopes - earlier * phi * (trace - entry) - slopes * entry * phi
        following = following + surprise * trace_slopes - change * entry
        # Steps at the bound do not depend on how large the step sizes are: their derivatives begin anew.
        following = jnp.where(over, 0, following)
        slopes = jnp.where(over, 0, slopes)
        value = jnp.sum(weights * step.next_features)
        after = SwiftState(log_rates, trace, value, following, slopes, trace_slopes, credit)
        return where(dropped, (weights, state), (moved, after))

    def restart(self, state: SwiftState) -> SwiftState:
        none = jnp.zeros_like(state.trace)
        return SwiftState(state.log_rates, none, jnp.zeros_like(state.value), state.slopes, state.slopes, none, none)
