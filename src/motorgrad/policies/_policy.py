"""The contract of every policy."""

import abc
import copy
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree
from numpy.typing import ArrayLike

from motorgrad._errors import check
from motorgrad._interface import Interface
from motorgrad.policies._actor import Actor
from motorgrad.policies._arguments import check_arguments
from motorgrad.policies._export import export
from motorgrad.policies._parameters import Parametric, from_rows, outer, parts_of, rows, trainable, with_parts


class Regions(NamedTuple):
    """Where local units respond, as NumPy arrays with one row per unit.

    `centre` and `half`: centres and half extents along each input; `box`: true for boxes, false for ellipsoids;
    `active`: false for units that a mask has switched off.
    """

    centre: Float[np.ndarray, "units inputs"]
    half: Float[np.ndarray, "units inputs"]
    box: Bool[np.ndarray, " units"]
    active: Bool[np.ndarray, " units"]


class Policy(Parametric):
    r"""A distribution $\pi(a \mid y, \theta)$ over actions $a$ given an observation $y$.

    A policy is a pytree. Its trainable parameters $\theta$ are the floating-point arrays of all fields that are not
    declared with `fixed`. Scores, traces, gradients and step sizes have the structure of `trainable(policy)`.

    All methods are pure and take a single observation, as an array or a list; batch them with `jax.vmap`. Randomness is
    explicit: `sample` consumes `uniforms` numbers drawn from U[0, 1), so that the numbers for many decisions can be
    drawn at once. An observation of another size is refused, and so are uniform numbers.

    A field may hold another policy, or a tuple of policies. By default, `limited`, `allowed` and `with_temperature`
    apply to each of them.

    Most policies see what the task shows, and the task gets what they draw. A policy with hidden units draws more than
    the task gets: `emit` picks the task's part. A policy with a memory sees more than the task shows: `perceive` adds
    to an observation what is remembered, and `remember` keeps the memory for the next decision. All other methods take
    the whole: what `perceive` returns as the observation, and what `sample` returns as the action.

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

    def emit(self, action: Array) -> Array:
        """The part of an action that the task gets; by default all of it."""
        return action

    @property
    def hides(self) -> bool:
        """Whether the task gets only a part of an action."""
        return type(self).emit is not Policy.emit

    def hidden_activations(self, observation: Float[Array, " inputs"]) -> tuple[Float[Array, " units"], ...]:
        """The output of each hidden layer, from the inputs on; by default none. Of stochastic units it is the firing
        probability or the mean activation."""
        del observation
        return ()

    def initial_memory(self) -> Float[Array, " memory"] | None:
        """The memory at the start of an episode; by default `None`, no memory."""
        return None

    @property
    def has_memory(self) -> bool:
        """Whether the policy remembers anything from decision to decision."""
        return type(self).initial_memory is not Policy.initial_memory

    @property
    def remembers_parameters(self) -> bool:
        """Whether the memory after given observations and actions depends on the parameters, so that it is out of date
        once they move; by default not."""
        return False

    @property
    def has_exact_score(self) -> bool:
        """Whether `score` is the whole derivative of the log-probability; by default so. It is not where the memory
        depends on the parameters and the score takes it as given."""
        return True

    def perceive(
        self, memory: Float[Array, " memory"] | None, observation: Float[Array, " observation"]
    ) -> Float[Array, " inputs"]:
        """What the units see: an observation of the task, with what is remembered."""
        del memory
        return observation

    def remember(self, seen: Float[Array, " inputs"], action: Array) -> Float[Array, " memory"] | None:
        """The memory after an action, given what the units saw."""
        del seen, action
        return None

    def adapted(self, seen: Float[Array, " inputs"]) -> Self:
        """The policy after one more observation, for one that keeps statistics of them; the policy itself, for others.
        A learner calls it with what an action led to. By default it concerns the parts that see the same."""
        parts = parts_of(self)
        after = [part.adapted(seen) if part.inputs == self.inputs else part for part in parts]
        return self if all(new is old for new, old in zip(after, parts, strict=True)) else with_parts(self, after)

    @property
    def marginal(self) -> "Policy":
        """The policy without a memory that acts alike on average, for one whose memory only makes its noise last; the
        policy itself, for others."""
        return self

    def critic_observation(self, seen: Float[Array, " inputs"]) -> Float[Array, " critic_observation"]:
        """The part of what the units see by which baselines and critics judge a situation; by default all of it."""
        return seen

    def blocks(self, gradient: PyTree) -> tuple[Float[Array, "units parameters"], ...]:
        """Flatten a gradient to matrices that have one row for each unit with parameters of its own.

        The default is a single row. A pool of binary units whose trainable arrays all have a leading axis of units
        returns one row per unit. A policy made of several pools returns one matrix per pool.
        """
        return (rows(gradient, 1),)

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        """The inverse of `blocks`: a gradient with the structure of `trainable(self)`."""
        return from_rows(trainable(self), blocks[0])

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""The Fisher matrix $\mathbb E[ss']$ of each row $s$ of `blocks`, at one observation.

        Binary units and softmax compute the expectation over the unit's own action exactly. The default is the sample
        $ss'$ for the drawn `action`, an unbiased estimate.
        """
        return tuple(outer(block) for block in self.blocks(self.score(observation, action)))

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""$\sum_t w_t\,F_t$, the sum of the matrices of `fisher` at many decisions, with weights of at least 0.

        Units with parameters of their own take several decisions at a time, which is quicker.
        """

        def add(total: tuple[Array, ...], decision: tuple[Array, ...]) -> tuple[tuple[Array, ...], None]:
            observation, action, weight = decision
            matrices = self.fisher(observation, action)
            return tuple(sum_ + weight * matrix for sum_, matrix in zip(total, matrices, strict=True)), None

        matrices = jax.eval_shape(self.fisher, observations[0], actions[0])
        zeros = tuple(jnp.zeros(matrix.shape, matrix.dtype) for matrix in matrices)
        return jax.lax.scan(add, zeros, (observations, actions, weights))[0]

    def fisher_coordinates(self, observation: Float[Array, " inputs"], action: Array) -> Float[Array, " coordinates"]:
        r"""Numbers $c(\theta)$ whose derivatives $J = \partial c/\partial\theta$ make up the Fisher matrix at one
        observation, $F = \mathbb E[J'J]$.

        So $Fv$ takes two products with derivatives, by automatic differentiation, and no matrix (Pearlmutter, 1994).
        What only scales is held constant. Units that know their Fisher matrix give coordinates that do not depend on
        the drawn `action`. The default is its log-probability: $J'J$ is the sample $ss'$, an unbiased estimate.
        """
        return self.log_prob(observation, action)[None]

    def limited(self) -> Self:
        """The policy with its parameters clipped to their limits, if they have any. Applied after every step."""
        return with_parts(self, [part.limited() for part in parts_of(self)])

    def allowed(self, step: PyTree) -> PyTree:
        """Zero the entries of a parameter step that must not move; by default none."""
        parts = parts_of(self)
        if not parts:
            return step
        return with_parts(step, [part.allowed(own) for part, own in zip(parts, parts_of(step), strict=True)])

    @property
    def has_temperature(self) -> bool:
        """Whether `with_temperature` changes the policy."""
        own = type(self).with_temperature is not Policy.with_temperature
        return own or any(part.has_temperature for part in parts_of(self))

    def with_temperature(self, factor: float | Float[Array, ""]) -> Self:
        r"""The policy with the temperature of its units multiplied by `factor`.

        Where a unit fires with probability $\sigma(\phi)$, the temperature divides $\phi$. Graded units multiply their
        own noise $e^\lambda$ by `factor`, soft spheres divide their hardness by it. Units without a temperature stay as
        they are, and so do all other parameters. Parameters may have any leading axes of seeds.

        A unit that overrides this method has a temperature; nothing else needs to be declared.
        """
        return with_parts(self, [part.with_temperature(factor) for part in parts_of(self)])

    def regions(self) -> Regions | None:
        """Where each unit responds, or `None` if some unit is not local."""
        return None

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
        check(not self.has_memory, "policy", type(self).__name__, wanted)
        return Actor(self).act(observation, uniforms)

    @abc.abstractmethod
    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """Entropy of the action distribution, in nats."""

    def entropy_estimate(
        self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> Float[Array, ""]:
        """An estimate of the entropy in nats, from the random numbers of one `sample`.

        It is for learners that average over many observations. Policies whose entropy is cheap return it exactly.
        """
        del uniforms
        return self.entropy(observation)

    def enumerate(self) -> Array:
        """All actions along a leading axis, for exact sums.

        **Raises:** `ValueError` if there are infinitely many, as by default.
        """
        raise ValueError(f"{type(self).__name__}: has infinitely many actions: real numbers")


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


class Composed(Policy):
    """A policy whose trainable parameters all belong to the policies that it is made of."""

    def blocks(self, gradient: PyTree) -> tuple[Float[Array, "units parameters"], ...]:
        """The blocks of the parts, in the order of the fields."""
        parts = zip(parts_of(self), parts_of(gradient), strict=True)
        return tuple(block for part, own in parts for block in part.blocks(own))

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        remaining = iter(blocks)
        gradients = []
        for part in parts_of(self):
            count = len(part.blocks(trainable(part)))
            gradients.append(part.from_blocks(tuple(itertools.islice(remaining, count))))
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
    kinds = [type(policy).__name__ for policy in policies if policy.hides or policy.has_memory]
    check(not kinds, name, kinds, "units without hidden units or a memory")


def has_rows(policy: Policy) -> bool:
    """Whether every trainable array has a leading axis of units."""
    return all(leaf.shape[:1] == (policy.outputs,) for leaf in jax.tree.leaves(trainable(policy)))
