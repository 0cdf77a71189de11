"""The contract of every policy."""

import abc
import copy
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree
from numpy.typing import ArrayLike

from motorgrad._errors import check
from motorgrad._interface import Interface
from motorgrad.policies import abilities
from motorgrad.policies._actor import Actor
from motorgrad.policies._arguments import check_arguments
from motorgrad.policies._export import export
from motorgrad.policies._parameters import Parametric, from_rows, parts_of, rows, trainable, with_parts


class Policy(Parametric):
    r"""A distribution $\pi(a \mid y, \theta)$ over actions $a$ given an observation $y$.

    A policy is a pytree. Its trainable parameters $\theta$ are the floating-point arrays of all fields that are not
    declared with `fixed`. Scores, traces, gradients and step sizes have the structure of `trainable(policy)`.

    All methods are pure and take a single observation, as an array or a list; batch them with `jax.vmap`. Randomness is
    explicit: `sample` consumes `uniforms` numbers drawn from U[0, 1), so that the numbers for many decisions can be
    drawn at once. An observation of another size is refused, and so are uniform numbers.

    A field may hold another policy, or a tuple of policies.

    What only some policies can do has no member here: a memory, hidden units, a Fisher matrix that is more than a
    sample, a temperature, limits of parameters. A class has such an ability where it defines the methods of a protocol
    of `motorgrad.policies.abilities`, and the functions there take any policy. All methods here take the whole: the
    observation with what is remembered, and the action with what hidden units drew.

    **Example:**

    ```python
    policy = Hyperplanes(weights=[[1.0, -2.0]], bias=[0.5])
    observation = jnp.array([0.3, 0.1])
    action = policy.sample(observation, jax.random.uniform(key, (policy.uniforms,)))
    score = policy.score(observation, action)
    ```
    """

    # as `fixed`, in a form in which type checkers see that it comes last
    interface: Interface | None = eqx.field(default=None, kw_only=True, repr=False, metadata={"fixed": True})
    """What observations and actions mean in the environment, for a policy of a run; `None` for one that no task has
    had. `act` and `export` use it; all other methods see scaled observations, and return the policy's own actions."""

    def __new__(cls, *arguments: object, **keywords: object) -> Self:
        del arguments, keywords
        made = super().__new__(cls)
        object.__setattr__(made, "interface", None)  # also where a class has an `__init__` of its own
        return made

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        check_arguments(cls)
        abilities.check_whole(cls)

    @property
    @abc.abstractmethod
    def inputs(self) -> int:
        """Length of the vector that the units see: the observation, with what is remembered."""

    @property
    def observation_size(self) -> int:
        """Length of the observation that the task shows; by default all `inputs`."""
        return self.inputs

    @property
    @abc.abstractmethod
    def outputs(self) -> int:
        """Number of units, or number of alternatives of a discrete action."""

    @property
    def actions(self) -> str | tuple[str, ...]:
        """The kind of action.

        `"binary"`: a vector of zeros and ones. `"discrete"`: an integer. `"continuous"`: a vector of real numbers.
        `"querying"`: zeros and ones followed by the requested next input. A tuple of `"binary"` and `"continuous"`: a
        vector whose numbers are of these kinds.
        """
        observation = jax.ShapeDtypeStruct((self.inputs,), jnp.result_type(float))
        return "binary" if jax.eval_shape(lambda policy, y: policy.mode(y), self, observation).ndim else "discrete"

    @property
    def uniforms(self) -> int:
        """Count of U[0, 1) numbers that one decision consumes; by default one per unit."""
        return self.outputs

    @abc.abstractmethod
    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        """Firing probability (or mean activation) of each unit, or probability of each alternative."""

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
        r"""The analytic $\nabla_\theta \log \pi(a \mid y, \theta)$, with the structure of `trainable(self)`."""

    def export(self, path: Path | str, only: Sequence[str] | None = None) -> Path:
        """Write the policy to a file that needs no motorgrad: C source (`.c`), an ONNX model (`.onnx`), or arrays for
        NumPy (`.npz`), which `motorgrad.export.read` reads.

        The policy of a run takes raw observations, in the units of the environment, and gives raw actions: scaling and
        code (`interface`) are in the file.

        The file has `prob`; `mode`; `sample`, a function of uniform numbers; `deviation` of graded units; and for a
        policy with a memory the memory before and after. The page on exporting (`docs/export.md`) has the details.

        **Arguments:** `path`, the file; `only`, the names of the functions that it has, by default all.

        **Returns** the path.

        **Raises:** `ValueError` for another ending, and for a policy that uses an operation which the format lacks: the
        message names it, and the functions that can be exported; `RuntimeError` where the package onnx is missing.
        """
        return export(self, path, only)

    def act(self, observation: ArrayLike, uniforms: ArrayLike | None = None) -> np.ndarray:
        """The raw action for a raw observation, both as the environment has them: their shapes, types and units.

        For the policy of a run, `run.policy(seed)`, which knows the scale of observations and the code of actions.

        **Arguments:** `observation`, of the shape that the environment has, or several along leading axes; `uniforms`,
        numbers from U[0, 1) by which the action is drawn, `(…, policy.uniforms)`; by default the most probable action.

        **Raises:** `ValueError` for a policy without an `interface`, and for one with a memory: `Actor` keeps that.

        ```python
        policy = mg.train("three-state", steps=200, progress=False).policy()
        print(policy.act([1.0, 0.0, 0.0]))
        ```
        """
        wanted = "without a memory; motorgrad.policies.Actor keeps one"
        check(not abilities.has_memory(self), "policy", type(self).__name__, wanted)
        return Actor(self).act(observation, uniforms)

    @abc.abstractmethod
    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """Entropy of the action distribution, in nats."""


class Units(Policy):
    """A pool of units that draw independently of each other, or each given the draws of others."""

    @abc.abstractmethod
    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        r"""The term of each unit in $\log\pi$: of its probability, or of its density."""

    def log_prob(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, ""]:
        return jnp.sum(self.log_probs(observation, action))

    def blocks(self, gradient: PyTree) -> tuple[Float[Array, "units parameters"], ...]:
        """One row per unit if every trainable array leads with the units, else a single row."""
        return (rows(gradient, self.outputs if has_rows(self) else 1),)

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        return from_rows(trainable(self), blocks[0])


class Composed(Policy):
    """A policy whose trainable parameters all belong to the policies that it is made of."""

    def blocks(self, gradient: PyTree) -> tuple[Float[Array, "units parameters"], ...]:
        """The blocks of the parts, in the order of the fields."""
        parts = zip(parts_of(self), parts_of(gradient), strict=True)
        return tuple(block for part, own in parts for block in abilities.blocks(part, own))

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        remaining = iter(blocks)
        gradients = []
        for part in parts_of(self):
            count = len(abilities.blocks(part, trainable(part)))
            gradients.append(abilities.from_blocks(part, tuple(itertools.islice(remaining, count))))
        return with_parts(trainable(self), gradients)


P = TypeVar("P", bound=Policy)


def with_interface(policy: P, interface: Interface | None) -> P:
    """The policy with another interface.

    **Arguments:** `policy`: any policy; `interface`: what its observations and actions mean; `None` for a policy that
    knows nothing of them.

    ```python
    same_kind = jax.tree.map(jnp.add, with_interface(run.policies, None), others)
    ```
    """
    if policy.interface is interface:
        return policy
    made = copy.copy(policy)
    object.__setattr__(made, "interface", interface)
    return made


def check_shapes(policy: Policy, wanted: tuple[int, ...], *names: str) -> None:
    """Refuse fields of another shape than is wanted."""
    for name in names:
        shape = getattr(policy, name).shape
        check(shape == wanted, name, shape, f"of shape {wanted}")


def check_plain(name: str, *policies: Policy) -> None:
    """Refuse a part of a policy that has hidden units or a memory, which the policy would have to handle."""
    refused = [each for each in policies if abilities.has_hidden_units(each) or abilities.has_memory(each)]
    kinds = [type(policy).__name__ for policy in refused]
    check(not kinds, name, kinds, "units without hidden units or a memory")


def has_rows(policy: Policy) -> bool:
    """Whether every trainable array has a leading axis of units."""
    return all(leaf.shape[:1] == (policy.outputs,) for leaf in jax.tree.leaves(trainable(policy)))
