r"""Several steps from one batch of decisions: the clipped surrogate (Schulman et al., 2017).

A gradient sample $\delta z$ holds at the parameters that chose the actions, so it is good for one step. To use a batch
again, it must be kept: what was seen, what was done and what it led to. Then, at any parameters near by,

$$L(\theta) = \frac1n \sum_t \min\big(\rho_t A_t,\ \operatorname{clip}(\rho_t, 1 - \epsilon, 1 + \epsilon)\,A_t\big),
\qquad \rho_t = \frac{\pi_\theta(a_t \mid y_t)}{\pi_{\text{old}}(a_t \mid y_t)},$$

measures the gain over the old policy. Decisions whose probability has changed by the share $\epsilon$ in the direction
of their advantage add nothing more.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree, UInt32

from motorgrad.learning._branching import Flag, Scalar, where
from motorgrad.policies import Policy, split, trainable
from motorgrad.schema import Part, count, number, static


def gradient_of(gain: Callable[[Any], Float[Array, ""]], policy: Policy) -> PyTree[Array]:
    """The gradient of a function of a policy, in the structure and the types of its trainable part."""
    learned, settings = split(policy)
    slope = jax.grad(lambda parameters: gain(eqx.combine(parameters, settings)))(learned)
    return jax.tree.map(lambda g, p: g.astype(p.dtype), slope, learned)


def empty_rows(policy: Policy, size: int) -> tuple[Array, Array]:
    """Zeros in the place of the observations and actions of so many decisions."""
    observation = jnp.zeros(policy.inputs, jax.tree.leaves(trainable(policy))[0].dtype)
    observations, actions = (
        jnp.zeros((size, *each.shape), each.dtype) for each in (observation, policy.mode(observation))
    )
    return observations, actions


class Batch(NamedTuple):
    r"""The decisions of a batch, of which the first `waiting` are filled in.

    `worth` is the part of each advantage that the actions before share, `newest` the part of its own action alone, both
    in units of (scaled) reward; after an `end` another episode began. `key` draws the order in which the decisions are
    used.
    """

    observations: Float[Array, "batch inputs"]
    actions: Array
    worth: Float[Array, " batch"]
    newest: Float[Array, " batch"]
    end: Bool[Array, " batch"]
    waiting: Int[Array, ""]
    key: UInt32[Array, " words"]


class ClippedSurrogate(Part):
    r"""Uses every batch of decisions several times, by the clipped surrogate of PPO (Schulman et al., 2017).

    Once a batch is full, its advantages are summed up from the last decision back, $A_t = \delta_t + \beta A_{t+1}$
    with the decay $\beta$ of the estimator's trace. The end of an episode, or of the batch, ends the sum. Then the
    decisions are shuffled and cut into minibatches, and the gradient of $L$ for each goes through metric, optimizer and
    further transformations as any gradient does. This happens `epochs` times. The estimator's entropy bonus is added to
    $L$.

    **Raises:** `ValueError` for a value out of range; in an `Estimator` with parts that do not go with it.
    """

    clip: float = number(
        0.2,
        0,
        open_low=True,
        help=r"$\epsilon$; a decision whose probability has changed by this share of it, in the direction of its "
        r"advantage, adds nothing to the gradient",
    )
    epochs: int = count(10, 1, 10_000, help="number of times that each decision is used")
    minibatches: int = count(
        1,
        1,
        1_000_000,
        help="into how many parts a batch is cut, each for a step of the parameters; a divisor of `improve`",
    )
    standardise: bool = static(
        True, help="whether the advantages of a batch are made to have mean 0 and deviation 1; equal ones become 0"
    )

    def init(self, policy: Policy, size: int, key: jax.Array) -> Batch:
        """The state before any decision, for batches of this size."""
        seen, done = empty_rows(policy, size)
        numbers = jnp.zeros(size, seen.dtype)
        words = jax.random.key_data(key)
        return Batch(seen, done, numbers, numbers, jnp.zeros(size, bool), jnp.zeros((), jnp.int32), words)

    def add(
        self, batch: Batch, seen: Array, action: Array, worth: Array, newest: Array | int, dropped: Flag = False
    ) -> Batch:
        """The batch with one more decision; what is to be `dropped` is written, too, and overwritten by the next."""

        def put(rows: Array, row: Array | bool | int) -> Array:
            # There is room: a step has emptied what was full.
            return rows.at[batch.waiting].set(jnp.asarray(row, rows.dtype))

        return batch._replace(
            observations=put(batch.observations, seen),
            actions=put(batch.actions, action),
            worth=put(batch.worth, worth),
            newest=put(batch.newest, newest),
            end=put(batch.end, False),
            waiting=where(dropped, batch.waiting, batch.waiting + 1),
        )

    def restart(self, batch: Batch) -> Batch:
        """The batch where an episode ends with the newest decision."""
        newest = jnp.arange(len(batch.end)) == batch.waiting - 1
        return batch._replace(end=batch.end | newest)

    def emptied(self, batch: Batch) -> Batch:
        """The batch after it was used."""
        key = jax.random.key_data(jax.random.fold_in(jax.random.wrap_key_data(batch.key), 1))
        return batch._replace(waiting=jnp.zeros_like(batch.waiting), key=key)

    def advantages(self, batch: Batch, decay: Scalar) -> Float[Array, " batch"]:
        """The advantage of every decision, for a trace of this decay."""

        def back(later: Array, decision: tuple[Array, Array]) -> tuple[Array, Array]:
            worth, end = decision
            total = (worth + jnp.where(end, 0, decay * later)).astype(worth.dtype)
            return total, total

        nothing = jnp.zeros((), batch.worth.dtype)
        found = jax.lax.scan(back, nothing, (batch.worth, batch.end), reverse=True)[1] + batch.newest
        if not self.standardise:
            return found
        spread = jnp.std(found)
        # of equal numbers, deviations and their spread are rounding, and would be standardised to 1
        flat = (jnp.max(found) == jnp.min(found)) | (spread == 0)
        return jnp.where(flat, 0, (found - jnp.mean(found)) / jnp.where(flat, 1, spread))

    def gradient(self, policy: Policy, rows: PyTree, bonus: Float[Array, ""] | None = None) -> PyTree[Array]:
        r"""$\nabla_\theta L$ at the parameters of `policy`, for the decisions in `rows`: observations, actions, their
        log-probabilities under the old policy and advantages; `bonus`, what a nat of entropy is worth, if anything."""
        observations, actions, old, advantages = rows

        def gain(present: Policy) -> Float[Array, ""]:
            ratio = jnp.exp(jax.vmap(present.log_prob)(observations, actions) - old)
            limited = jnp.clip(ratio, 1 - self.clip, 1 + self.clip)
            total = jnp.mean(jnp.minimum(ratio * advantages, limited * advantages))
            return total if bonus is None else total + bonus * jnp.mean(jax.vmap(present.entropy)(observations))

        return gradient_of(gain, policy)

    def climb(
        self,
        batch: Batch,
        policy: Policy,
        decay: Scalar,
        bonus: Callable[[PyTree], Float[Array, ""] | None],
        state: PyTree,
        step: Callable[[PyTree, PyTree[Array]], PyTree],
    ) -> PyTree:
        """The state after all steps of a batch. `step(state, gradient)` makes one; `state.policy` is what it moves."""
        advantages = self.advantages(batch, decay)
        old = jax.vmap(policy.log_prob)(batch.observations, batch.actions)
        rows = (batch.observations, batch.actions, old, advantages)

        def minibatch(state: PyTree, places: Int[Array, " size"]) -> tuple[PyTree, None]:
            chosen = jax.tree.map(lambda each: each[places], rows)
            return step(state, self.gradient(state.policy, chosen, bonus(state))), None

        return jax.lax.scan(minibatch, state, self.order(batch))[0]

    def order(self, batch: Batch) -> Int[Array, "steps size"]:
        """The places of the decisions in the batch, those of one step in each row."""
        keys = jax.random.split(jax.random.wrap_key_data(batch.key), self.epochs)
        drawn = jax.vmap(lambda key: jax.random.permutation(key, len(batch.end)))(keys)
        return drawn.reshape(self.epochs * self.minibatches, -1)
