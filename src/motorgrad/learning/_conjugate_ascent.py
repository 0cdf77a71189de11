r"""Conjugate-gradient ascent on estimated gradients (CONJPOMDP; Baxter, Bartlett & Weaver, 2001).

A line search by the values of noisy objectives needs long estimates: near a maximum they hardly differ. The *sign* of
$g(\theta) \cdot h$ along a direction $h$ differs most there. So the maximum is bracketed by points of opposite signs,
and the parameters go where the line between both inner products is 0.
"""

from typing import ClassVar, Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import Flag, ratio, where
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._chain import Optimizer, Updates, inner
from motorgrad.learning._schedules import Steps
from motorgrad.policies import Policy, trainable
from motorgrad.schema import count, number

DIRECTION, FIRST, OUTWARD, INWARD = range(4)


class Trial(NamedTuple):
    r"""A place along the direction: its `step` $s$, and the inner product `slope` $g(\theta_0 + s h) \cdot h$."""

    step: Float[Array, ""]
    slope: Float[Array, ""]


class AscentState(NamedTuple):
    r"""Where the search is.

    - `origin`: $\theta_0$, from which the present line starts.
    - `direction`: $h$; `gradient`: the estimate at the origin.
    - `phase`: at the origin (0), at the first trial (1), or beyond it outward (2) or inward (3).
    - `step`: of the present trial.
    - `near` and `far`: the trials between which the maximum is.
    - `trials`: on this line.
    - `estimate`: the mean of the batches here, of which there are `estimate.count`; `signs`: the running mean of their
      inner products with the direction and of the squares.
    """

    origin: PyTree[Array]
    direction: PyTree[Array]
    gradient: PyTree[Array]
    phase: Int[Array, ""]
    step: Float[Array, ""]
    near: Trial
    far: Trial
    trials: Int[Array, ""]
    estimate: RunningMean
    signs: RunningMean


class ConjugateAscent(Optimizer):
    r"""Conjugate directions with a line search by the sign of gradients (CONJPOMDP; Baxter, Bartlett & Weaver, 2001).

    Each batch is an estimate $g$ at the present parameters. At the start of a line the direction is that of Polak and
    Ribière (1969),

    $$h \leftarrow g + \max\Big(0, \frac{(g - g_0) \cdot g}{g_0 \cdot g_0}\Big)\,h,$$

    or $g$ itself where that would descend. The first trial is at $\theta_0 + s_0 h$. As long as $g \cdot h$ is positive
    the steps double, and as long as it is negative they halve. Between the last two trials, of opposite signs, the
    parameters go to the zero of the line through both inner products, and the next direction is due.

    With a `certainty` above 0 an estimate averages batches until its inner product is that many standard errors away
    from 0, or until there are `most` batches.

    **Raises:** `ValueError` for a value out of range; in a learner that makes steps of single samples, or several
    steps of a batch, or that has a metric or growth.

    ```python
    agent = mg.Agent(policy, mg.learning.Estimator(update_every=1000), mg.learning.ConjugateAscent(10.0))
    ```
    """

    steps_from: ClassVar[Literal["any", "sample", "batch"]] = "batch"
    takes_growth: ClassVar[bool] = False

    initial: float = number(
        10.0, 0, open_low=True, help="$s_0$, the first step of a line, in units of the learning rate of a plain ascent"
    )
    certainty: float = number(0.0, 0, unit="standard errors", help="how far from 0 an inner product must be")
    most: int = count(10, 1, unit="batches", help="the most in an estimate")
    trials: int = count(12, 2, help="the most on a line")

    def init(self, policy: Policy) -> AscentState:
        zeros = jax.tree.map(jnp.zeros_like, trainable(policy))
        zero = jnp.zeros(())
        none_yet = jnp.zeros((), jnp.int32)
        trial = Trial(zero, zero)
        signs = running_mean((zero, zero))
        return AscentState(zeros, zeros, zeros, none_yet, zero, trial, trial, none_yet, running_mean(zeros), signs)

    def update(
        self, updates: Updates, state: AscentState, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, AscentState]:
        sample = jax.tree.map(jnp.negative, updates)
        parameters = trainable(policy)
        at_origin = state.phase == DIRECTION
        # At an origin there is no direction yet: batches must agree with the mean of those before.
        compass = where(at_origin, state.estimate.mean, state.direction)
        along = inner(sample, compass)
        signs = add_sample(state.signs, (along, jnp.square(along)))
        signs = where(at_origin & (state.estimate.count == 0), state.signs, signs)  # there are none before the first
        state = state._replace(estimate=add_sample(state.estimate, sample), signs=signs)
        known = self._is_known(state)

        gradient = state.estimate.mean
        started = self._started(state, gradient, parameters)
        searched = self._searched(state, inner(gradient, state.direction))
        after = where(at_origin, started, searched)
        after = after._replace(estimate=running_mean(sample), signs=running_mean(state.signs.mean))
        after = where(known, after, state)
        move = jax.tree.map(
            lambda origin, h, theta: jnp.where(known, origin + after.step * h - theta, 0).astype(theta.dtype),
            after.origin,
            after.direction,
            parameters,
        )
        return move, after

    def reset(self, state: AscentState, policy: Policy) -> AscentState:
        fresh = jax.tree.map(jnp.zeros_like, state)
        return fresh._replace(origin=trainable(policy))

    def _is_known(self, state: AscentState) -> Array:
        """Whether the sign of the inner product at this place is known well enough."""
        signs = state.signs.count.astype(jnp.int32)
        (mean, square) = state.signs.mean
        spread = jnp.maximum(square - jnp.square(mean), 0) / jnp.maximum(signs - 1, 1)
        clear = (signs >= 2) & (jnp.abs(mean) >= self.certainty * jnp.sqrt(spread))
        full = state.estimate.count.astype(jnp.int32) >= self.most
        return clear | full | (jnp.asarray(self.certainty) <= 0)

    def _started(self, state: AscentState, gradient: PyTree, parameters: PyTree) -> AscentState:
        """The first trial along a new direction."""
        before = inner(state.gradient, state.gradient)
        change = inner(gradient, gradient) - inner(state.gradient, gradient)
        share = jnp.maximum(ratio(change, before), 0)
        direction = jax.tree.map(lambda g, h: g + share * h, gradient, state.direction)
        climbs = inner(gradient, direction) > 0
        direction = where(climbs, direction, gradient)
        slope = inner(gradient, direction).astype(state.step.dtype)
        first = jnp.full_like(state.step, 1) * self.initial
        zero = jnp.zeros_like(state.step)
        return state._replace(
            origin=parameters,
            direction=direction,
            gradient=gradient,
            phase=jnp.full_like(state.phase, FIRST),
            step=first,
            near=Trial(zero, slope),
            far=Trial(zero, zero),
            trials=jnp.zeros_like(state.trials),
        )

    def _searched(self, state: AscentState, slope: Array) -> AscentState:
        """The next trial on this line, or the place where it ends."""
        here = Trial(state.step, slope.astype(state.step.dtype))
        ahead = slope > 0
        turned = jnp.where(state.phase == OUTWARD, ~ahead, (state.phase == INWARD) & ahead)
        over = turned | (state.trials + 1 >= self.trials)
        near = where(ahead, here, state.near)
        far = where(ahead, state.far, here)
        onwards = jnp.where(ahead, 2 * state.step, state.step / 2)
        brackets = (near.slope > 0) & (far.slope < 0)
        share = near.slope / jnp.where(brackets, near.slope - far.slope, 1)
        end = jnp.where(brackets, near.step + share * (far.step - near.step), near.step)
        return state._replace(
            phase=jnp.where(over, DIRECTION, jnp.where(ahead, OUTWARD, INWARD)).astype(state.phase.dtype),
            step=jnp.where(over, end, onwards),
            near=near,
            far=far,
            trials=state.trials + 1,
        )
