"""Hidden units: pools that draw one after the other, each given the draws of the pools before it."""

import abc
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._binary import Hyperplanes, product
from motorgrad.policies._featured import featured
from motorgrad.policies._features import INPUTS, FeatureMap
from motorgrad.policies._output_units import output_units
from motorgrad.policies._parameters import trainable, with_parts
from motorgrad.policies._policy import Composed, Policy, check_plain
from motorgrad.policies._starting import POSITIVE, Initial, InitialPolicy, function_of
from motorgrad.schema import Range, count, static

MAX_EXACT_PATTERNS = 256  # of hidden units, over which a mean is an exact sum
Draws = Sequence[Array]
"""What each pool has drawn, in their order."""


class Sequential(Composed):
    r"""Pools that draw one after the other: $\log\pi = \sum_k \log\pi_k(a_k \mid y, a_1, \dots, a_{k-1})$.

    The action of the policy is that of all pools, one after the other in a vector. The task gets that of the last. As
    the log-probability is a sum, the score of each unit is its own, given what it saw: no derivative passes from one
    pool to another (Thomas & Barto, 2011, call such units coagents). The expected product of this score and the return
    is the gradient of what the policy as a whole earns (Kostas, Nota & Thomas, 2020, theorem 1).

    The Fisher matrix has no cross terms between pools: given what a pool saw, its score has mean zero. Each pool's
    matrices are taken at the drawn actions of the pools before it.

    A subclass defines `pools` and `view`.
    """

    @property
    @abc.abstractmethod
    def pools(self) -> tuple[Policy, ...]:
        """The pools in the order in which they draw, and of the fields."""

    @abc.abstractmethod
    def view(self, observation: Float[Array, " inputs"], drawn: Draws) -> Float[Array, " _"]:
        """What the next pool sees, after `drawn`."""

    @property
    def outputs(self) -> int:
        return self.pools[-1].outputs

    @property
    def actions(self) -> str | tuple[str, ...]:
        return self.pools[-1].actions

    @property
    def uniforms(self) -> int:
        return sum(pool.uniforms for pool in self.pools)

    def task_action(self, action: Float[Array, " draws"]) -> Array:
        """The action of the last pool."""
        return abilities.task_action(self.pools[-1], self.drawn(action)[-1])

    def drawn(self, action: Float[Array, " draws"]) -> list[Array]:
        """What each pool has drawn: an integer where it chooses among alternatives, else a vector."""
        shapes = [_shape(pool) for pool in self.pools]
        ends = itertools.accumulate((math.prod(each.shape) for each in shapes), initial=0)
        parts = zip(itertools.pairwise(ends), shapes, strict=True)
        return [action[start:end].reshape(each.shape).astype(each.dtype) for (start, end), each in parts]

    def joined(self, drawn: Draws) -> Float[Array, " draws"]:
        """The inverse of `drawn`."""
        dtype = jax.tree.leaves(trainable(self))[0].dtype
        return jnp.concatenate([jnp.atleast_1d(each).astype(dtype) for each in drawn])

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        """The mean probability of each output, over what the hidden pools may draw.

        It is exact for up to 256 patterns of hidden units. Beyond, it is the mean over 256 draws, always from the same
        random numbers.
        """
        return self._mean(observation, lambda drawn: self.pools[-1].prob(self.view(observation, drawn)))

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]) -> Array:
        ends = itertools.accumulate((pool.uniforms for pool in self.pools), initial=0)
        shares = [uniforms[start:end] for start, end in itertools.pairwise(ends)]
        return self._one_by_one(observation, lambda k, seen: self.pools[k].sample(seen, shares[k]))

    def mode(self, observation: Float[Array, " inputs"]) -> Array:
        """The most probable action of each pool, given those of the pools before it. Another action of all pools
        together may be more probable."""
        return self._one_by_one(observation, lambda k, seen: self.pools[k].mode(seen))

    def hidden_activations(self, observation: Float[Array, " inputs"]) -> tuple[Float[Array, " units"], ...]:
        """What the units of each hidden pool do on average, given the most probable actions of the pools before it:
        firing probabilities, mean activations, or the probabilities of alternatives. A pool's own hidden layers come
        before it."""
        found: list[Array] = []
        for pool, (view, _) in zip(self.pools, self._seen(observation, self.mode(observation)), strict=True):
            found += [*abilities.hidden_activations(pool, view), pool.prob(view)]
        return tuple(found[:-1])

    def log_prob(self, observation: Float[Array, " inputs"], action: Array) -> Float[Array, ""]:
        r"""$\log\pi$ of what all pools have drawn."""
        seen = self._seen(observation, action)
        terms = [pool.log_prob(view, own) for pool, (view, own) in zip(self.pools, seen, strict=True)]
        return sum(terms, start=jnp.zeros(()))

    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        seen = zip(self.pools, self._seen(observation, action), strict=True)
        return with_parts(trainable(self), [pool.score(view, own) for pool, (view, own) in seen])

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        seen = zip(self.pools, self._seen(observation, action), strict=True)
        return tuple(matrix for pool, (view, own) in seen for matrix in abilities.fisher(pool, view, own))

    def fisher_coordinates(self, observation: Float[Array, " inputs"], action: Array) -> Float[Array, " coordinates"]:
        seen = zip(self.pools, self._seen(observation, action), strict=True)
        return jnp.concatenate([abilities.fisher_coordinates(pool, view, own) for pool, (view, own) in seen])

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        seen = zip(self.pools, jax.vmap(self._seen)(observations, actions), strict=True)
        return tuple(
            matrix for pool, (views, own) in seen for matrix in abilities.fisher_sum(pool, views, own, weights)
        )

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """The entropy of all pools together, in nats, which is at least that of the outputs alone.

        It is exact for up to 256 patterns of hidden units, else a mean over 256 draws, as in `prob`.
        """

        def of_pools(drawn: Draws) -> Float[Array, ""]:
            terms = [pool.entropy(self.view(observation, drawn[:k])) for k, pool in enumerate(self.pools)]
            return sum(terms, start=jnp.zeros(()))

        return self._mean(observation, of_pools)

    def enumerate(self) -> Float[Array, "actions draws"]:
        """All actions of all pools together; those of the last pool change fastest."""
        return _patterns(self.pools)

    def _one_by_one(
        self, observation: Float[Array, " inputs"], choose: Callable[[int, Float[Array, " _"]], Array]
    ) -> Float[Array, " draws"]:
        drawn: list[Array] = []
        for k in range(len(self.pools)):
            drawn.append(choose(k, self.view(observation, drawn)))
        return self.joined(drawn)

    def _seen(self, observation: Float[Array, " inputs"], action: Array) -> list[tuple[Array, Array]]:
        """What each pool saw, and what it drew."""
        drawn = self.drawn(action)
        return [(self.view(observation, drawn[:k]), own) for k, own in enumerate(drawn)]

    def _mean(self, observation: Float[Array, " inputs"], value: Callable[[Draws], Array]) -> Array:
        """The mean of a function of what the hidden pools draw, with the right derivative."""
        hidden = self.pools[:-1]

        def one_by_one(uniforms: Float[Array, " uniforms"]) -> list[Array]:
            return self.drawn(self.sample(observation, uniforms))[:-1]

        def log_prob(drawn: Draws) -> Float[Array, ""]:
            terms = [hidden[k].log_prob(self.view(observation, drawn[:k]), own) for k, own in enumerate(drawn)]
            return sum(terms, start=jnp.zeros(()))

        count = math.prod(_count(pool) for pool in hidden)
        if count <= MAX_EXACT_PATTERNS:
            last = self.pools[-1]
            filler = jnp.zeros((len(patterns := _patterns(hidden)), math.prod(_shape(last).shape)), patterns.dtype)
            drawn = jax.vmap(self.drawn)(jnp.concatenate([patterns, filler], axis=1))[:-1]
            weights = jnp.exp(jax.vmap(log_prob)(drawn))
        else:
            numbers = jnp.asarray(
                np.random.default_rng(0).random((MAX_EXACT_PATTERNS, self.uniforms)), observation.dtype
            )
            drawn = jax.lax.stop_gradient(jax.vmap(one_by_one)(numbers))
            logs = jax.vmap(log_prob)(drawn)
            weights = (
                jnp.exp(logs - jax.lax.stop_gradient(logs)) / MAX_EXACT_PATTERNS
            )  # whose derivative is that of drawing
        return jnp.tensordot(weights, jax.vmap(value)(drawn), 1)


def _shape(pool: Policy) -> jax.ShapeDtypeStruct:
    """Shape and type of what a pool draws."""
    real = jax.tree.leaves(trainable(pool))[0].dtype
    return jax.eval_shape(lambda pool, seen: pool.mode(seen), pool, jax.ShapeDtypeStruct((pool.inputs,), real))


def _count(pool: Policy) -> float:
    """How many actions a pool has."""
    return {"binary": 2.0 ** min(pool.outputs, 1000), "discrete": pool.outputs}.get(str(pool.actions), math.inf)


def _patterns(pools: Sequence[Policy]) -> Float[Array, "patterns draws"]:
    """All that pools may draw together; what the last draws changes fastest."""
    lists = [jnp.asarray(abilities.enumerate(pool), jnp.result_type(float)) for pool in pools]
    return product([each.reshape(len(each), -1) for each in lists])


class Layered(Sequential):
    r"""Hidden layers of stochastic units, each of which learns by its own score and the common reward.

    The first pool of `hidden` sees the observation. Every further one sees what the pool before it has drawn, and the
    pool of `output` what the last hidden pool has drawn. The task gets what `output` draws. Such units are coagents
    (Thomas & Barto, 2011; Kostas, Nota & Thomas, 2020): see `Sequential` for their score.

    A pool with one input more than there are numbers to be seen gets a constant 1 as the last; `Softmax` has no bias of
    its own. Hidden units of equal parameters stay equal on average, so they should start with different ones.

    **Arguments:** `hidden`, a sequence of at least one pool of binary or graded units; `output`, any policy without a
    memory; `skip`, whether further pools see the observation too, before what was drawn.

    **Example:**

    ```python
    either, both = Hyperplanes([[8.0, 8.0], [8.0, 8.0]], [-4.0, -12.0]), Hyperplanes([[8.0, -16.0]], [-4.0])
    policy = Layered([either], both)  # fires for one input or the other, but not for both
    policy.prob(jnp.array([1.0, 0.0])), policy.prob(jnp.array([1.0, 1.0]))  # [0.95], [0.02]
    ```
    """

    hidden: tuple[Policy, ...] = eqx.field(converter=tuple)
    output: Policy
    skip: bool = eqx.field(static=True, default=False)

    def __check_init__(self) -> None:
        check(len(self.hidden) > 0, "hidden", self.hidden, "at least one pool of units")
        check_plain("hidden", *self.hidden)
        check(not abilities.has_memory(self.output), "output", type(self.output).__name__, "a policy without a memory")
        for name, above, below in zip(
            [*(f"hidden[{k}]" for k in range(1, len(self.hidden))), "output"], self.pools[1:], self.hidden, strict=True
        ):
            shown = math.prod(_shape(below).shape) + self.skip * self.inputs
            words = f"{shown}, what it sees, or one more for a constant"
            check(above.inputs in (shown, shown + 1), f"{name}.inputs", above.inputs, words)

    @property
    def pools(self) -> tuple[Policy, ...]:
        return (*self.hidden, self.output)

    @property
    def inputs(self) -> int:
        return self.hidden[0].inputs

    def view(self, observation: Float[Array, " inputs"], drawn: Draws) -> Float[Array, " _"]:
        if not drawn:
            return observation
        below = jnp.atleast_1d(drawn[-1]).astype(observation.dtype)
        shown = jnp.concatenate([observation, below]) if self.skip else below
        return jnp.pad(shown, (0, self.pools[len(drawn)].inputs - shown.size), constant_values=1)


class InitialLayered(InitialPolicy):
    r"""Hidden layers of hyperplanes under output units, each of which learns by its own score.

    Hidden weights are drawn from a normal distribution of standard deviation `scale` $/\sqrt{\text{inputs}}$; their
    biases as if there were one input more. Output units start as they do by themselves.
    """

    units: int | None = count(None, 1, help="the number of output units, by default one for each action of the task")
    hidden: tuple[int, ...] = static(
        (8,),
        allowed=Range(1, kind="int"),
        help="the number of hidden units in each layer, the one next to the inputs first",
    )
    output: str = static(
        "",
        help='the output units, a name of an initial policy; by default `"softmax"` for discrete actions, '
        '`"hyperplanes"` for binary, `"bounded-hyperplanes"` for continuous ones and `"mixed"` for both',
    )
    scale: float = static(2.0, allowed=POSITIVE, help="the size of the initial hidden weights, as a potential")
    skip: bool = static(False, help="whether further layers see the observation too")
    features: FeatureMap = static(INPUTS, help="what the first layer sees beside the inputs; by default nothing")

    def validate(self) -> None:
        super().validate()
        check(self.hidden, "hidden", self.hidden, "at least one layer, such as (8,)")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, _ = sizes(task, self.units)
        make, constant = output_units(task, self.units, self.output)

        def made(key: jax.Array) -> Any:
            def pools(seen: int) -> Layered:
                found = []
                shown = seen
                for layer, width in enumerate(self.hidden):
                    normal = jax.random.normal(jax.random.fold_in(key, layer), (width, shown + 1))
                    drawn = self.scale / math.sqrt(shown) * normal
                    found.append(Hyperplanes(drawn[:, :-1], drawn[:, -1]))
                    shown = width + self.skip * seen
                return Layered(found, make(shown + constant, key), self.skip)

            return featured(self.features, inputs, pools)

        jax.eval_shape(lambda: made(jax.random.key(0)))  # refuses what is impossible before a key arrives
        return made


layered = function_of(InitialLayered)
