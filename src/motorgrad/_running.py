"""Running means that stay exact over billions of samples."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree, UInt32

CLIP = 5.0  # standard deviations


def counted_on(count: Array, more: Array | int = 1) -> Array:
    """A count and `more`, which stands still at the greatest number of its type rather than begin again."""
    most = jnp.asarray(jnp.iinfo(count.dtype).max, count.dtype)
    return count + jnp.minimum(jnp.asarray(more, count.dtype), most - count)


def counted_round(count: Array, size: Array | int) -> Array:
    """A count of which only the place in rounds of `size` matters, and whether there was a whole round: from two rounds
    on it is one less, so that it never ends."""
    return jnp.where(count >= 2 * size, count - size, count)


class RunningMean(NamedTuple):
    """The mean of the samples so far, of any pytree. In single precision `mean + (x − mean)/n` stops moving near n =
    1e7, because the increment falls below the mean's rounding. `carry` holds what rounding took away, so that the pair
    is good for the counter's whole range. At its end, 4,294,967,295, every further sample moves the mean by as much as
    that one."""

    mean: PyTree[Array]
    carry: PyTree[Array]
    count: UInt32[Array, ""]  # pyright: ignore[reportIncompatibleMethodOverride]


def running_mean(like: PyTree[Array]) -> RunningMean:
    """The empty mean of samples shaped like `like`: zero, of zero samples."""
    zeros = jax.tree.map(jnp.zeros_like, like)
    return RunningMean(zeros, zeros, jnp.zeros((), jnp.uint32))


def two_sum(total: Array, carry: Array, more: Array) -> tuple[Array, Array]:
    """`total + more`, exact together with what rounding takes from it: the new `carry` (Knuth's two-sum)."""
    more = carry + more
    after = total + more
    part = after - total
    return after, (total - (after - part)) + (more - part)


def add_sample(
    running: RunningMean, sample: PyTree[Array], rate: Array | float | None = None, size: int = 1
) -> RunningMean:
    """Add the n-th sample: it moves the mean by 1/n of its distance, or by `rate` of it where that is more. A sample
    that is itself the mean of `size` others counts as so many."""
    count = counted_on(running.count, size)

    def add(mean: Array, carry: Array, x: Array) -> tuple[Array, Array]:
        distance = (x - mean) - carry
        step = distance * size / count.astype(mean.dtype)
        return two_sum(mean, carry, step if rate is None else jnp.where(rate * count > size, rate * distance, step))

    means, structure = jax.tree.flatten(running.mean)
    leaves = zip(means, jax.tree.leaves(running.carry), jax.tree.leaves(sample), strict=True)
    pairs = [add(*leaf) for leaf in leaves]
    mean, carry = (jax.tree.unflatten(structure, part) for part in zip(*pairs, strict=True))
    return RunningMean(mean, carry, count)


def add_observation(mean: RunningMean, variance: RunningMean, seen: Array) -> tuple[RunningMean, RunningMean]:
    """Update the running mean and variance of observations with one more (Welford, 1962)."""
    after = add_sample(mean, seen)
    product = (seen - mean.mean - mean.carry) * (seen - after.mean - after.carry)
    return after, add_sample(variance, product)


def standardised(mean: RunningMean, variance: RunningMean, seen: Array) -> Array:
    """An observation relative to its running mean, in standard deviations, clipped."""
    deviation = jnp.sqrt(jnp.where(variance.mean > 0, variance.mean, 1.0))
    return jnp.clip((seen - mean.mean - mean.carry) / deviation, -CLIP, CLIP)
