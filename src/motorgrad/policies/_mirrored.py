"""Units that act for both sides of a symmetric body: what one side learns the other has learnt too."""

from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._policy import trainable


def _whole(values: Any) -> Any:
    """The numbers as Python's own, so that they may be written down; what is not whole stays, to be refused."""
    found = np.ravel(np.asarray(values)).tolist()
    return tuple(int(n) if isinstance(n, int | float) and float(n).is_integer() else n for n in found)


class Mirrored(BinaryUnits):
    r"""A pool of $N/2$ units, each with a copy that acts for the other side of a symmetric body.

    Unit $i$ of the pool drives the output `left[i]` by what it sees, $y$, and its copy the output `right[i]` by the
    mirrored inputs $My$, $(My)_j = s_j\,y_{o_j}$. So $\pi(a \mid y)$ is the probability of the mirrored action given
    the mirrored inputs, by construction, and there are half as many parameters.

    All $N$ decisions are independent given the inputs: $\log\pi = \log\pi_0(a_{left} \mid y) + \log\pi_0(a_{right} \mid
    My)$ of the pool's $\pi_0$. The score is the sum of the pool's on both views, and so, because the two are
    uncorrelated, is the Fisher matrix; a block is that of a unit with its copy.

    **Arguments:** `pool`, of independent units; `order` $o$ and `signs` $s$, for each input the one that is its mirror
    image, and 1, or -1 where the sign turns; `left` and `right`, the two outputs of each unit, all outputs once. None
    of them is learnt.

    **Raises:** `ValueError` for another pool, for a mirror that does not undo itself, or for outputs that are missing
    or named twice.
    """

    pool: BinaryUnits
    order: tuple[int, ...] = eqx.field(converter=_whole, static=True)
    signs: tuple[int, ...] = eqx.field(converter=_whole, static=True)
    left: tuple[int, ...] = eqx.field(converter=_whole, static=True)
    right: tuple[int, ...] = eqx.field(converter=_whole, static=True)

    def __check_init__(self) -> None:
        kind, order, signs = type(self.pool).__name__, self.order, self.signs
        check(isinstance(self.pool, BinaryUnits), "pool", kind, "a pool of binary units")
        check(self.pool.independent, "pool", kind, "a pool of independent units")
        count = self.pool.inputs
        check(_are_all(order, count), "order", order, f"a permutation of the {count} inputs, each of 0 to {count - 1}")
        paired = all(order[other] == one for one, other in enumerate(order))
        check(paired, "order", order, "pairs: an input is the mirror image of its own mirror image")
        valid = len(signs) == count and set(signs) <= {1, -1}
        check(valid, "signs", signs, f"1 or -1 for each of the {count} inputs")
        alike = all(signs[other] == sign for sign, other in zip(signs, order, strict=True))
        check(alike, "signs", signs, "the same for an input and its mirror image")
        for name, outputs in (("left", self.left), ("right", self.right)):
            check(len(outputs) == self.pool.outputs, name, outputs, f"an output of each of {self.pool.outputs} units")
        both = self.left + self.right
        check(_are_all(both, len(both)), "left, right", (self.left, self.right), f"each of 0 to {len(both) - 1} once")

    @property
    def inputs(self) -> int:
        return self.pool.inputs

    @property
    def outputs(self) -> int:
        return 2 * self.pool.outputs

    @property
    def separate(self) -> bool:
        return False

    def mirrored(self, observation: Float[Array, " inputs"]) -> Float[Array, " inputs"]:
        """$My$, the inputs as the other side sees them."""
        y = jnp.asarray(observation)
        return y[np.array(self.order)] * jnp.asarray(self.signs, y.dtype)

    def _views(self, observation: Any) -> tuple[Float[Array, " inputs"], Float[Array, " inputs"]]:
        return jnp.asarray(observation), self.mirrored(observation)

    def _sides(self, action: Any) -> tuple[Float[Array, " units"], Float[Array, " units"]]:
        a = jnp.asarray(action)
        return a[np.array(self.left)], a[np.array(self.right)]

    def _joined(self, left: Float[Array, " units"], right: Float[Array, " units"]) -> Float[Array, " outputs"]:
        """The units' numbers of both sides in the order of the outputs."""
        return jnp.concatenate([left, right])[np.argsort(self.left + self.right)]

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        return self._joined(*(self.pool.prob(view) for view in self._views(observation)))

    def log_probs(
        self, observation: Float[Array, " inputs"], action: Float[Array, " outputs"]
    ) -> Float[Array, " outputs"]:
        parts = zip(self._views(observation), self._sides(action), strict=True)
        return self._joined(*(self.pool.log_probs(view, side) for view, side in parts))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " outputs"]) -> Self:
        parts = zip(self._views(observation), self._sides(action), strict=True)
        return self._gradient(_sum(*(self.pool.score(view, side) for view, side in parts)))

    def _gradient(self, inner: Any) -> Self:
        return eqx.tree_at(lambda each: each.pool, trainable(self), inner)

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        """The pool's: a row for each unit, which its copy shares."""
        return self.pool.blocks(gradient.pool)

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        return self._gradient(self.pool.from_blocks(blocks))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " outputs"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The sum of the pool's on both views: exact where the pool's is, else a sample of the same mean."""
        parts = zip(self._views(observation), self._sides(action), strict=True)
        return _sum(*(self.pool.fisher(view, side) for view, side in parts))

    def allowed(self, step: Any) -> Any:
        return eqx.tree_at(lambda each: each.pool, step, self.pool.allowed(step.pool))

    def limited(self) -> Self:
        return eqx.tree_at(lambda each: each.pool, self, self.pool.limited())

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        one, other = (self.pool.entropy(view) for view in self._views(observation))
        return one + other


def _are_all(numbers: tuple[int, ...], count: int) -> bool:
    """Whether they are the numbers from 0 up to `count`, each once."""
    return len(numbers) == count and set(numbers) == set(range(count))


def _sum(one: Any, other: Any) -> Any:
    return jax.tree.map(jnp.add, one, other)
