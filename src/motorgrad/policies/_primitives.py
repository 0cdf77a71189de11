"""Motor primitives: when each begins, and with which movement parameters, learnt together."""

from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._binary import BinaryUnits, entropy_of
from motorgrad.policies._graded import GradedUnits
from motorgrad.policies._policy import Policy, has_rows, is_plain, trainable


class Primitives(Policy):
    r"""$N$ motor primitives with $K$ movement parameters each (section 5.4.1 of the thesis).

    A unit of `precondition` decides whether its primitive begins; where it does, $K$ units of `movement` draw how it
    moves. The first $N$ observed numbers say which primitives can begin now, 1, and which cannot, 0, such as those
    under way: the rest $y$ is what both kinds of units see. With $c_i$ for these flags and $f_i$ for what begins,

    $$\log\pi = \sum_i c_i \log\pi_i(f_i \mid y) + \sum_i f_i \sum_k \log\pi_{ik}(a_{ik} \mid y).$$

    So a choice that counts for nothing has no score: not the precondition of a primitive that cannot begin, and no
    movement parameter of one that does not.

    The action is $f$, then the parameters of the first primitive, of the second and so on, which are 0 where it does
    not begin. Preconditions and movements do not mix in the Fisher matrix.

    **Arguments:** `precondition`, $N$ independent binary units; `movement`, $N K$ graded units over the same inputs.
    Every unit must have parameters of its own.
    """

    precondition: BinaryUnits
    movement: GradedUnits

    def __check_init__(self) -> None:
        for name, pool, kind in (
            ("precondition", self.precondition, BinaryUnits),
            ("movement", self.movement, GradedUnits),
        ):
            said = type(pool).__name__
            check(isinstance(pool, kind), name, said, f"a pool of {kind.__name__}")
            check(has_rows(pool) and is_plain(pool), name, said, "units of one kind with parameters of their own")
        check(self.precondition.independent, "precondition", type(self.precondition).__name__, "independent units")
        count, inputs = self.precondition.outputs, self.precondition.inputs
        size = self.movement.outputs
        check(size % count == 0, "movement.outputs", size, f"a multiple of the {count} preconditions")
        check(self.movement.inputs == inputs, "movement.inputs", self.movement.inputs, f"{inputs}, the precondition's")

    @property
    def primitives(self) -> int:
        """$N$."""
        return self.precondition.outputs

    @property
    def inputs(self) -> int:
        return self.primitives + self.precondition.inputs

    @property
    def outputs(self) -> int:
        return self.primitives + self.movement.outputs

    @property
    def actions(self) -> str:
        return "graded"

    @property
    def uniforms(self) -> int:
        return self.precondition.uniforms + self.movement.uniforms

    def _seen(self, observation: Float[Array, " inputs"]) -> tuple[Float[Array, " primitives"], Float[Array, " rest"]]:
        """Which primitives can begin, and what else is observed."""
        return (observation[: self.primitives] > 0.5) * 1.0, observation[self.primitives :]

    def _each(self, primitives: Float[Array, " primitives"]) -> Float[Array, " movement"]:
        """A number of each primitive, for all its movement parameters."""
        return jnp.repeat(primitives, self.movement.outputs // self.primitives)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        """With which probability each primitive begins; then the mean of each parameter if it does."""
        can, rest = self._seen(observation)
        return jnp.concatenate([can * self.precondition.prob(rest), self.movement.mean(rest)])

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]) -> Array:
        can, rest = self._seen(observation)
        first = self.precondition.uniforms
        begins = can * self.precondition.sample(rest, uniforms[:first])
        return jnp.concatenate([begins, self._each(begins) * self.movement.sample(rest, uniforms[first:])])

    def mode(self, observation: Float[Array, " inputs"]) -> Array:
        """A primitive begins where that is likelier than not, and moves by the mean of its parameters."""
        can, rest = self._seen(observation)
        begins = can * self.precondition.mode(rest)
        return jnp.concatenate([begins, self._each(begins) * self.movement.mode(rest)])

    def log_prob(self, observation: Float[Array, " inputs"], action: Array) -> Float[Array, ""]:
        can, rest = self._seen(observation)
        begins, moves = action[: self.primitives], action[self.primitives :]
        when = jnp.sum(can * self.precondition.log_probs(rest, begins))
        return when + jnp.sum(self._each(begins) * self.movement.log_probs(rest, moves))

    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        can, rest = self._seen(observation)
        begins, moves = action[: self.primitives], action[self.primitives :]
        when = _where(can, self.precondition.score(rest, begins))
        return self._gradient(when, _where(self._each(begins), self.movement.score(rest, moves)))

    def _gradient(self, precondition: Any, movement: Any) -> Self:
        return eqx.tree_at(lambda each: (each.precondition, each.movement), trainable(self), (precondition, movement))

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        """The preconditions' rows, then those of the movement parameters."""
        return (*self.precondition.blocks(gradient.precondition), *self.movement.blocks(gradient.movement))

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        when, how = blocks
        return self._gradient(self.precondition.from_blocks((when,)), self.movement.from_blocks((how,)))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """Exact: those of the units, times how probable it is that their choice counts."""
        can, rest = self._seen(observation)
        begins = can * self.precondition.prob(rest)
        (when,) = self.precondition.fisher(rest, action[: self.primitives])
        (how,) = self.movement.fisher(rest, action[self.primitives :])
        return can[:, None, None] * when, self._each(begins)[:, None, None] * how

    def allowed(self, step: Any) -> Any:
        parts = (self.precondition.allowed(step.precondition), self.movement.allowed(step.movement))
        return eqx.tree_at(lambda each: (each.precondition, each.movement), step, parts)

    def limited(self) -> Self:
        parts = (self.precondition.limited(), self.movement.limited())
        return eqx.tree_at(lambda each: (each.precondition, each.movement), self, parts)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """Of what begins, and the differential one of the parameters of what does, in nats."""
        can, rest = self._seen(observation)
        begins = can * self.precondition.prob(rest)
        return entropy_of(begins) + jnp.sum(self._each(begins) * self.movement.entropies)

    def enumerate(self) -> Array:
        raise ValueError(f"{type(self).__name__}: has infinitely many actions: real numbers")


def _where(counts: Float[Array, " units"], score: Any) -> Any:
    """The rows of a score that count, and zeros."""
    return jax.tree.map(lambda x: jnp.where(counts.reshape(-1, *(1,) * (x.ndim - 1)) > 0, x, 0), score)
