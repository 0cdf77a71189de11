"""What every policy is: a distribution over actions that can be sampled and differentiated."""

import abc
import itertools
from typing import Any, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def fixed(**keywords: Any) -> Any:
    """Declare a field of a policy that holds arrays which are *not* learnt (a mask, a maximal probability)."""
    return eqx.field(metadata={"fixed": True}, **keywords)


class Policy(eqx.Module):
    r"""A distribution $\pi(a \mid y, \theta)$ over actions $a$ given an observation $y$.

    A policy is a pytree. Its trainable parameters $\theta$ are the floating-point arrays of the fields that are not
    declared `fixed`; a score, a trace, a gradient and a step size are pytrees of the same structure as the trainable
    part (see `trainable`).

    All methods are pure and act on one observation; use `jax.vmap` for many. Randomness is explicit: `sample` consumes
    `uniforms` numbers drawn from U[0, 1), so that a whole block of decisions can be drawn at once.
    """

    @property
    @abc.abstractmethod
    def inputs(self) -> int:
        """Length of the observation vector."""

    @property
    @abc.abstractmethod
    def outputs(self) -> int:
        """Number of units (binary actions), or of alternatives (a discrete action)."""

    @property
    def actions(self) -> str:
        """What an action is: `"binary"`, a vector of zeros and ones; `"discrete"`, one of some integers; `"graded"`, a
        vector of real numbers; `"querying"`, zeros and ones followed by an input that is asked for."""
        seen = jax.ShapeDtypeStruct((self.inputs,), jnp.result_type(float))
        return "binary" if jax.eval_shape(lambda policy, y: policy.mode(y), self, seen).ndim else "discrete"

    @property
    def uniforms(self) -> int:
        """How many numbers from U[0, 1) one decision consumes: one a unit, unless a policy says otherwise."""
        return self.outputs

    @abc.abstractmethod
    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        """Each unit's probability of firing, or mean activation; or each alternative's probability of being chosen."""

    @abc.abstractmethod
    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]) -> Array:
        """Draw an action, as a function of `uniforms` numbers from U[0, 1)."""

    @abc.abstractmethod
    def mode(self, observation: Float[Array, " inputs"]) -> Array:
        """The most probable action."""

    @abc.abstractmethod
    def log_prob(self, observation: Float[Array, " inputs"], action: Array) -> Float[Array, ""]:
        r"""$\log \pi(a \mid y, \theta)$."""

    @abc.abstractmethod
    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        r"""The analytic $\nabla_\theta \log \pi(a \mid y, \theta)$, in the structure of `trainable(self)`."""

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        """A gradient's numbers as matrices, a row for each unit that has parameters of its own.

        By default it is one row of all. A pool of binary units whose every parameter has a leading axis of units has a
        row for each, a policy of several pools a matrix for each.
        """
        return (rows(gradient, 1),)

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        """The inverse of `blocks`: a gradient in the structure of `trainable(self)`."""
        return from_rows(trainable(self), blocks[0])

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""The Fisher matrix of each row of `blocks`, $\mathbb E[ss']$ of the row's score $s$ at one observation.

        The mean is over the unit's own action, exactly, where that is cheap: binary units and softmax. Otherwise, as
        here, it is the sample $ss'$ of the `action` that was drawn, whose mean it is.
        """
        return tuple(outer(block) for block in self.blocks(self.score(observation, action)))

    def limited(self) -> Self:
        """The policy with its parameters put back within their limits, where it has any: after every step."""
        return self

    def allowed(self, step: Any) -> Any:
        """A step of the parameters without what must not move; by default all of it."""
        return step

    @abc.abstractmethod
    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """Entropy of the action's distribution, in nats."""

    @abc.abstractmethod
    def enumerate(self) -> Array:
        """Every action, along a leading axis: what an exact oracle sums over. **Raises** `ValueError` where there are
        infinitely many."""


P = TypeVar("P", bound=Policy)


def trainable(policy: P) -> P:
    """The trainable part: `policy` with every fixed array replaced by `None` (as `equinox.partition` does)."""
    return split(policy)[0]


def split(policy: P) -> tuple[P, P]:
    """Part a policy in its trainable and its fixed arrays; `equinox.combine` joins them again."""

    def learnt(path: tuple[Any, ...], leaf: Any) -> bool:
        node: Any = policy
        for key in path:
            if isinstance(key, jax.tree_util.GetAttrKey):
                if node.__dataclass_fields__[key.name].metadata.get("fixed", False):
                    return False
                node = getattr(node, key.name)
            else:
                node = node[key.idx if isinstance(key, jax.tree_util.SequenceKey) else key.key]
        return eqx.is_inexact_array(leaf)

    return eqx.partition(policy, jax.tree_util.tree_map_with_path(learnt, policy))


def in_structure(policy: P, **values: Array) -> P:
    """A gradient of `policy`: its trainable structure with these fields' values."""
    names = tuple(values)
    return eqx.tree_at(
        lambda node: tuple(getattr(node, name) for name in names), trainable(policy), tuple(values.values())
    )


def rows(gradient: Any, units: int) -> Float[Array, "units parameters"]:
    """Arrays that lead with `units`, side by side; for one unit, whatever their shape."""
    parts = [leaf.reshape(units, leaf.size // units) for leaf in jax.tree.leaves(gradient)]
    return jnp.concatenate(parts, axis=1) if parts else jnp.zeros((units, 0))


def from_rows(like: P, matrix: Float[Array, "units parameters"]) -> P:
    """The inverse of `rows`, in the structure, shapes and types of `like`."""
    leaves, structure = jax.tree.flatten(like)
    widths = [leaf.size // matrix.shape[0] for leaf in leaves]
    ends = itertools.accumulate(widths, initial=0)
    parts = [matrix[:, start:end] for start, end in itertools.pairwise(ends)]
    shaped = [part.reshape(leaf.shape).astype(leaf.dtype) for part, leaf in zip(parts, leaves, strict=True)]
    return jax.tree.unflatten(structure, shaped)


def unit_rows(policy: Policy, gradient: Any) -> Float[Array, "units parameters"]:
    """A row for each unit, where every trainable array leads with the units; else one row of what they share."""
    return rows(gradient, policy.outputs if has_rows(policy) else 1)


def has_rows(policy: Policy) -> bool:
    """Whether every trainable array leads with the units."""
    return all(leaf.shape[:1] == (policy.outputs,) for leaf in jax.tree.leaves(trainable(policy)))


def is_plain(policy: Policy) -> bool:
    """Whether a policy is a pool of one kind of units, and not made of others."""
    parts = jax.tree.leaves(vars(policy), is_leaf=lambda part: isinstance(part, Policy))
    return not any(isinstance(part, Policy) for part in parts)


def outer(block: Float[Array, "units parameters"]) -> Float[Array, "units parameters parameters"]:
    return block[:, :, None] * block[:, None, :]
