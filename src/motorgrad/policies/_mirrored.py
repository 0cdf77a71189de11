"""Units that act for both sides of a symmetric body and share their parameters."""

from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, python_numbers, sizes
from motorgrad.policies._binary import BinaryUnits, zero_hyperplanes
from motorgrad.policies._delegating import Seeing, units_of
from motorgrad.policies._featured import InitialFeatured
from motorgrad.policies._parameters import in_structure, with_fields
from motorgrad.policies._policy import Composed, Policy
from motorgrad.policies._starting import Initial, function_of, then
from motorgrad.schema import count


class Mirrored(Composed, BinaryUnits):
    r"""A pool of $N/2$ units, each with a copy that acts for the other side of a symmetric body.

    Unit $i$ of the pool drives the output `left[i]` from the observation $y$. Its copy drives the output `right[i]`
    from the mirrored observation $My$, $(My)_j = s_j\,y_{o_j}$. So $\pi(a \mid y)$ equals the probability of the
    mirrored action given the mirrored observation, by construction, with half as many parameters.

    All $N$ decisions are independent given the inputs: $\log\pi = \log\pi_0(a_{left} \mid y) + \log\pi_0(a_{right} \mid
    My)$, where $\pi_0$ is the pool's policy. The score is the sum of the pool's scores on both views. The two are
    uncorrelated, so the Fisher matrix is the sum of the pool's as well. A block belongs to a unit and its copy.

    **Arguments:** `pool`, independent units, which may see features or the output of a network; `order` $o$, the mirror
    image of each input; `signs` $s$, 1, or -1 for an input whose sign turns; `left` and `right`, the two outputs of
    each unit, which together name every output once. None of the last four is trainable.

    **Raises:** `ValueError` for dependent units, for a mirror that does not undo itself, or for outputs that are
    missing or named twice.

    **Example:**

    ```python
    unit = Hyperplanes(weights=[[3.0, 1.0, 0.5]], bias=[-0.5])  # left angle, right angle, yaw rate
    policy = Mirrored(unit, order=[1, 0, 2], signs=[1, 1, -1], left=[0], right=[1])
    policy.mirrored(jnp.array([0.3, -0.2, 0.4]))  # [-0.2, 0.3, -0.4]
    ```
    """

    pool: Policy
    order: tuple[int, ...] = eqx.field(converter=python_numbers, static=True)
    signs: tuple[int, ...] = eqx.field(converter=python_numbers, static=True)
    left: tuple[int, ...] = eqx.field(converter=python_numbers, static=True)
    right: tuple[int, ...] = eqx.field(converter=python_numbers, static=True)

    def __check_init__(self) -> None:
        units = units_of(self.pool)
        order = self.order
        signs = self.signs
        kind = type(units).__name__
        check(isinstance(units, BinaryUnits), "pool", kind, "a pool of binary units")
        check(units.independent, "pool", kind, "a pool of independent units")
        count = self.pool.inputs
        valid = _is_permutation(order, count)
        check(valid, "order", order, f"a permutation of the {count} inputs, each of 0 to {count - 1}")
        paired = all(order[other] == one for one, other in enumerate(order))
        check(paired, "order", order, "pairs: an input is the mirror image of its own mirror image")
        valid = len(signs) == count and set(signs) <= {1, -1}
        check(valid, "signs", signs, f"1 or -1 for each of the {count} inputs")
        alike = all(signs[other] == sign for sign, other in zip(signs, order, strict=True))
        check(alike, "signs", signs, "the same for an input and its mirror image")
        for name, outputs in (("left", self.left), ("right", self.right)):
            check(len(outputs) == self.pool.outputs, name, outputs, f"an output of each of {self.pool.outputs} units")
        both = self.left + self.right
        valid = _is_permutation(both, len(both))
        check(valid, "left, right", (self.left, self.right), f"each of 0 to {len(both) - 1} once")

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
        """$My$, the observation as the other side sees it."""
        y = jnp.asarray(observation)
        return y[np.array(self.order)] * jnp.asarray(self.signs, y.dtype)

    def _both_views(self, observation: Array) -> tuple[Float[Array, " inputs"], Float[Array, " inputs"]]:
        return jnp.asarray(observation), self.mirrored(observation)

    def _both_sides(self, action: Array) -> tuple[Float[Array, " units"], Float[Array, " units"]]:
        a = jnp.asarray(action)
        return a[np.array(self.left)], a[np.array(self.right)]

    def _joined(self, left: Float[Array, " units"], right: Float[Array, " units"]) -> Float[Array, " outputs"]:
        """Numbers of both sides in the order of the outputs."""
        return jnp.concatenate([left, right])[np.argsort(self.left + self.right)]

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        return self._joined(*(self.pool.prob(view) for view in self._both_views(observation)))

    def log_probs(
        self, observation: Float[Array, " inputs"], action: Float[Array, " outputs"]
    ) -> Float[Array, " outputs"]:
        parts = zip(self._both_views(observation), self._both_sides(action), strict=True)
        return self._joined(*(_log_probs(self.pool, view, side) for view, side in parts))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " outputs"]) -> Self:
        parts = zip(self._both_views(observation), self._both_sides(action), strict=True)
        return in_structure(self, pool=_sum(*(self.pool.score(view, side) for view, side in parts)))

    def score_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, "decisions sums"]
    ) -> Self:
        views = self._unfolded(observations)
        sides = jnp.concatenate(jax.vmap(self._both_sides)(actions))
        return in_structure(self, pool=abilities.score_sum(self.pool, views, sides, jnp.tile(weights, (2, 1))))

    def entropy_sum(self, observations: Float[Array, "decisions inputs"]) -> Float[Array, ""]:
        return abilities.entropy_sum(self.pool, self._unfolded(observations))

    def _unfolded(self, observations: Float[Array, "decisions inputs"]) -> Float[Array, "views inputs"]:
        """Both views of many observations, in rows."""
        return jnp.concatenate(jax.vmap(self._both_views)(observations))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " outputs"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The sum of the pool's matrices on both views: exact if the pool's are, else an unbiased sample."""
        parts = zip(self._both_views(observation), self._both_sides(action), strict=True)
        return _sum(*(abilities.fisher(self.pool, view, side) for view, side in parts))

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        sides = jnp.concatenate(jax.vmap(self._both_sides)(actions))
        return abilities.fisher_sum(self.pool, self._unfolded(observations), sides, jnp.tile(weights, 2))

    def adapted(self, seen: Float[Array, " inputs"]) -> Self:
        """The policy after both views of one more observation, so that its statistics are symmetric, too."""
        one, other = self._both_views(seen)
        pool = abilities.adapted(abilities.adapted(self.pool, one), other)
        return self if pool is self.pool else with_fields(self, pool=pool)

    def hidden_activations(self, observation: Float[Array, " inputs"]) -> tuple[Float[Array, " units"], ...]:
        """The output of each of the pool's hidden layers on the observation, then on its mirror image."""
        layers = zip(
            *(abilities.hidden_activations(self.pool, view) for view in self._both_views(observation)), strict=True
        )
        return tuple(jnp.concatenate(both) for both in layers)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        one, other = (self.pool.entropy(view) for view in self._both_views(observation))
        return one + other


def _log_probs(pool: Any, observation: Array, action: Array) -> Float[Array, " units"]:
    seeing = isinstance(pool, Seeing)
    return _log_probs(pool.pool, pool.seen(observation), action) if seeing else pool.log_probs(observation, action)


def _is_permutation(numbers: tuple[int, ...], count: int) -> bool:
    """Whether the numbers are 0 to `count` − 1, each once."""
    return len(numbers) == count and set(numbers) == set(range(count))


def _sum(one: PyTree, other: PyTree) -> PyTree:
    return jax.tree.map(jnp.add, one, other)


class InitialMirrored(InitialFeatured):
    """Hyperplanes with zero weights that act for both sides of a symmetric body (see `Mirrored`).

    There is one unit for every two actions that are mirror images of each other, as given by the `mirror` of the task.

    **Raises:** `ValueError` for a task without a mirror, for an action that is its own mirror image, and for a number
    of inputs in place of a task.
    """

    units: int | None = count(
        None, 1, help="the number of units on both sides together, by default one for each action of the task"
    )

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        mirror = getattr(task, "mirror", None)
        name = repr(getattr(task, "name", type(task).__name__))
        if mirror is None:
            given = f"there is none of {task} inputs" if isinstance(task, int) else f"task {name} has none"
            raise ValueError(f"policy = 'mirrored': needs a task with a mirror of left and right, {given}")
        check(outputs == len(mirror.outputs), "units", outputs, f"{len(mirror.outputs)}, as the task's mirror has them")
        middle = [i for i, image in enumerate(mirror.outputs) if i == image]
        if middle:
            raise ValueError(
                f"policy = 'mirrored': actions {middle} of task {name} are their own mirror image, of no side"
            )
        left = [i for i, image in enumerate(mirror.outputs) if i < image]
        right = [mirror.outputs[i] for i in left]
        pool = self.behind(inputs, lambda seen: zero_hyperplanes(seen, len(left)))
        return then(lambda pool: Mirrored(pool, mirror.inputs, mirror.signs, left, right), pool)


mirrored = function_of(InitialMirrored)
