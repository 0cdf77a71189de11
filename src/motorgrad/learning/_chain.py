r"""The chain of gradient transformations: from a gradient estimate to a step of the parameters.

    gradient ──▶ metric ──▶ optimizer ──▶ further transformations ──▶ step

A transformation is `init` and `update`, as in optax: updates descend, so the chain starts from minus the gradient. What
optax's transformations cannot do has a method of its own, which does nothing by default: `observe` sees every decision
(a Fisher matrix), `solve` does what is due once in many of them, `constrain` limits the whole step (a trust region),
`after_step` sees the parameters after the step and `final_policy` tells which to keep (an average). `restart`, `reset`
and `after_growth` mark the end of an episode, another policy and new units.
"""

import functools
from collections.abc import Callable
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import NEVER, Flag, Scalar
from motorgrad._groups import by_group
from motorgrad._running import RunningMean, add_sample, counted_on, running_mean
from motorgrad.learning._learner import Transition
from motorgrad.learning._schedules import Annealed, Steps, at
from motorgrad.policies import Policy, abilities, split, trainable
from motorgrad.schema import Part, count, number, static

Updates = PyTree[Array]
S = TypeVar("S", bound=Any)
"""The state of a learner."""


class Transformation(Part):
    """A stage between the gradient estimate and the step of the parameters.

    A transformation of your own derives from this class and goes into `Agent(transformations=(...,))`, after the
    optimizer; so does any optax transformation.

    ```python
    class Clip(mg.learning.Transformation):
        '''Clips every number of a step.'''

        limit: float = 1e-3

        def update(self, updates, state, policy, steps, due):
            return jax.tree.map(lambda u: jnp.clip(u, -self.limit, self.limit), updates), state
    ```
    """

    needs_steps: ClassVar[bool] = False
    """Whether a method needs the number of steps that the parameters have made."""
    single_stream: ClassVar[bool] = False
    """Whether it needs successive decisions of one environment: where the end of an episode changes what it knows of
    earlier ones, which several environments would not share."""
    steps_from: ClassVar[Literal["any", "sample", "batch"]] = "any"
    """From what it makes a step: any gradient, only the sample of every decision, or only the mean of a batch."""
    takes_growth: ClassVar[bool] = True
    """Whether the pool of the policy may grow."""

    def init(self, policy: Policy) -> PyTree:
        """The state before the first decision."""
        return None

    def observe(self, state: PyTree, policy: Policy, transition: Transition) -> PyTree:
        """The state after a decision. A transition that diverged must not change it."""
        return state

    @property
    def takes_batches(self) -> bool:
        """Whether `observe_batch` may see the decisions of a whole batch, in place of `observe` one after the other."""
        return False

    def observe_batch(self, state: PyTree, policy: Policy, observations: Array, actions: Array) -> PyTree:
        """The state after a batch of decisions, none of which diverged, by the present policy."""
        return state

    def solve(self, state: PyTree, policy: Policy, due: Flag) -> PyTree:
        """The state after work that is due once in many decisions, or, at the latest, where a step is `due`."""
        return state

    def decisions_until_due(self, state: PyTree) -> Int[Array, ""]:
        """The least number of coming decisions in which `solve` changes nothing."""
        return jnp.asarray(NEVER, jnp.int32)

    def update(
        self, updates: Updates, state: PyTree, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, PyTree]:
        """The updates that take the place of `updates`, and the state afterwards.

        **Arguments:** `updates`, in the structure of the trainable parameters; the `policy` before the step; the number
        of `steps` made, `None` where nothing counts them; `due`, whether there is a step now. Where it is false the
        result is discarded, so costly work may be left out (`where_any`).
        """
        return updates, state

    def constrain(self, updates: Updates, state: PyTree, policy: Policy, steps: Steps, due: Flag) -> Updates:
        """The step, limited as a whole. It receives the result of all transformations."""
        return updates

    def after_step(self, state: PyTree, policy: Policy, steps: Steps) -> PyTree:
        """The state after the parameters have moved to those of `policy`; `steps` counts all steps so far."""
        return state

    def final_policy(self, state: PyTree, policy: Policy) -> Policy:
        """The policy to keep, for a run and its evaluation. States and policies of many seeds are allowed."""
        return policy

    def reset(self, state: PyTree, policy: Policy) -> PyTree:
        """The state after another policy was put in place, for one seed or for many."""
        return state

    def after_growth(self, state: PyTree, new: Bool[Array, " units"]) -> PyTree:
        """The state after units were added to a pool that grows."""
        return state

    def restart(self, state: PyTree, ended: Flag) -> PyTree:
        """The state where an episode has `ended`, after its last decision was observed."""
        return state

    @property
    def needs_episodes(self) -> str | None:
        """Why the transformation needs a task with episodes, as a setting; `None` where it does not."""
        return None


def inner(one: PyTree, other: PyTree) -> Float[Array, ""]:
    """The inner product of two trees of the same structure."""
    products = jax.tree.map(lambda a, b: jnp.sum(a * b), one, other)
    return sum(jax.tree.leaves(products), start=jnp.zeros(()))


class Optimizer(Transformation):
    """How a gradient estimate moves the parameters."""


class SGD(Optimizer):
    r"""Steepest ascent, $\theta \leftarrow \theta + \alpha g - \lambda\theta$.

    **Raises:** `ValueError` for a number out of range; from `init`, for a field without a learning rate, a rate without
    a field, or a shape that does not fit.
    """

    learning_rate: float | dict[str, Any] | Annealed = number(
        1e-3,
        0,
        groups=True,
        help=r"$\alpha$, for all parameters; or a mapping from names of the policy's fields to numbers or arrays that "
        r'broadcast to the field, such as `{"centre": 2e-4, "log_width": 8e-4}`. In a policy of several pools a name '
        r"stands for that field in every pool, `movement.weights` for that of one; the longest name counts. `Annealed` "
        r"changes with the steps of the parameters",
    )
    weight_decay: float | dict[str, Any] | None = number(
        None,
        0,
        1,
        groups=True,
        help=r"none, or the share $\lambda$ of itself that a parameter loses at every step; a number, or a mapping, in "
        r"which fields left out do not decay. It is decoupled (Loshchilov & Hutter, 2019): neither learning rate nor "
        r"metric changes it. Decaying gains keep units stochastic, and so exploring (section 4.4.1 of the thesis). In "
        r"single precision, a parameter that nothing else moves does not decay by less than some 1e-7 a step",
    )

    def init(self, policy: Policy) -> PyTree:
        self.learning_rates(trainable(policy))
        self._decays(trainable(policy))
        return self._scaling.init(trainable(policy))

    @property
    def _scaling(self) -> Any:
        """What becomes of minus the gradient before the learning rate scales it."""
        return optax.identity()

    def update(
        self, updates: Updates, state: PyTree, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, PyTree]:
        parameters = trainable(policy)
        direction, state = self._scaling.update(updates, state, parameters)
        moves = jax.tree.map(lambda g, rate: -rate * g, direction, self.learning_rates(parameters, steps))
        if self.weight_decay is not None:
            moves = jax.tree.map(lambda move, decay, p: move - decay * p, moves, self._decays(parameters), parameters)
        return moves, state

    def learning_rates(self, parameters: PyTree, steps: Steps = None) -> PyTree:
        """The learning rate of every parameter after so many steps, in their structure, with leaves that broadcast to
        them."""
        rate = self.learning_rate
        return by_group("learning rate", "of all", at(rate, steps) if isinstance(rate, Annealed) else rate, parameters)

    def _decays(self, parameters: PyTree) -> PyTree:
        decay = 0.0 if self.weight_decay is None else self.weight_decay
        return by_group("weight decay", "of all", decay, parameters, default=0.0)


def adam_scaling(b1: Scalar, b2: Scalar) -> Any:
    """Adam's step without its learning rate. Optax declares the decays as Python numbers; they may be arrays."""
    return optax.scale_by_adam(b1=b1, b2=b2)


class Adam(SGD):
    r"""Adam (Kingma & Ba, 2015), with learning rates and decoupled weight decay as in `SGD`."""

    b1: float = number(0.9, 0, 1, open_high=True, help="the decay of the mean of gradients")
    b2: float = number(0.999, 0, 1, open_high=True, help="the decay of the mean of squared gradients")

    @property
    def _scaling(self) -> Any:
        return adam_scaling(self.b1, self.b2)


class Optax(Optimizer):
    """Any optax transformation.

    An agent wraps one by itself: `Agent(policy, optimizer=optax.adam(1e-3))`. The transformation is static. Numbers
    that it takes from `optax.inject_hyperparams` are leaves of the tree, `hyperparameters`, which may differ by seed
    and change while the learner runs; those with a schedule of their own stay with optax. Its functions cannot be
    saved: to continue a run, pass the agent again.
    """

    transformation: Any = static(help="it receives minus the gradient, as optax minimises")
    hyperparameters: dict[str, Any] | None = number(
        None, groups=True, help="by default those of `optax.inject_hyperparams`, where the transformation is one"
    )

    def __init__(self, transformation: Any, hyperparameters: dict[str, Any] | None = None):
        if hyperparameters is None:
            state = transformation.init({"parameter": jnp.zeros(1)})
            found = getattr(state, "hyperparams", None)
            scheduled = getattr(state, "hyperparams_states", {})
            if found is not None:
                hyperparameters = {name: float(value) for name, value in found.items() if name not in scheduled}
        self.transformation = transformation
        self.hyperparameters = hyperparameters

    def init(self, policy: Policy) -> PyTree:
        return self.transformation.init(trainable(policy))

    def update(
        self, updates: Updates, state: PyTree, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, PyTree]:
        if self.hyperparameters is not None:
            given = {
                name: jnp.asarray(value, state.hyperparams[name].dtype) for name, value in self.hyperparameters.items()
            }
            state = state._replace(hyperparams={**state.hyperparams, **given})
        return self.transformation.update(updates, state, trainable(policy))


class PolyakAveraging(Transformation):
    r"""The mean $\bar\theta$ of the parameters over the last steps (Polyak & Juditsky, 1992).

    With a constant learning rate the parameters end in a cloud about the optimum; its centre is nearer. The learner
    acts by $\theta$; the policy that a run keeps and evaluates has $\bar\theta$.

    $\bar\theta$ is $\theta$ itself up to `start`. The n-th step after moves it by
    $\bar\theta \leftarrow \bar\theta + \max(1/n, \rho)\,(\theta - \bar\theta)$.
    """

    needs_steps: ClassVar[bool] = True

    start: int = count(0, 0, 2**31 - 2, unit="steps of the parameters", help="how many are left out")
    rate: float = number(
        0.0, 0, 1, help=r"$\rho$; 0 averages all steps since `start`, more has a memory of $1/\rho$ steps"
    )

    def init(self, policy: Policy) -> RunningMean:
        return running_mean(trainable(policy))._replace(mean=trainable(policy))

    def after_step(self, state: RunningMean, policy: Policy, steps: Steps) -> RunningMean:
        assert steps is not None  # as `needs_steps` says
        parameters = trainable(policy)
        late = steps > self.start
        averaged = add_sample(state, parameters, self.rate)
        copied = running_mean(parameters)._replace(mean=parameters)
        return jax.tree.map(lambda new, old: jnp.where(late, new, old), averaged, copied)

    def final_policy(self, state: RunningMean, policy: Policy) -> Policy:
        return eqx.combine(state.mean, split(policy)[1])

    def reset(self, state: RunningMean, policy: Policy) -> RunningMean:
        fresh = jax.tree.map(jnp.zeros_like, state)
        return fresh._replace(mean=trainable(policy))


class Chain(NamedTuple):
    """Transformations one after the other. Its state is the tuple of theirs."""

    stages: tuple[Transformation, ...]

    @property
    def needs_steps(self) -> bool:
        """Whether any stage needs the number of steps."""
        return any(stage.needs_steps for stage in self.stages)

    def init(self, policy: Policy) -> tuple[PyTree, ...]:
        return tuple(stage.init(policy) for stage in self.stages)

    def map(self, method: Callable[[Transformation, PyTree], PyTree], states: tuple[PyTree, ...]) -> tuple[PyTree, ...]:
        """The states after `method(stage, state)` of every stage."""
        return tuple(method(stage, state) for stage, state in zip(self.stages, states, strict=True))

    def decisions_until_due(self, states: tuple[PyTree, ...]) -> Int[Array, ""]:
        """The least number of coming decisions in which `solve` changes no stage."""
        counts = [stage.decisions_until_due(state) for stage, state in zip(self.stages, states, strict=True)]
        return functools.reduce(jnp.minimum, counts, jnp.asarray(NEVER, jnp.int32))

    def step(
        self,
        state: S,
        gradient: PyTree[Array],
        due: Flag = True,
        scale: Callable[[Updates], Updates] = lambda updates: updates,
    ) -> S:
        r"""The state of a learner after a step up a gradient, $\theta \leftarrow \theta + \alpha g$.

        **Arguments:** the `state`, which has the fields `policy`, `chain` (the states of the stages) and `steps`; the
        `gradient`; whether there is a step now, `due`, else the result is to be discarded; `scale`, what becomes of the
        step before it is limited as a whole.
        """
        policy: Policy = state.policy
        parameters, settings = split(policy)
        updates = jax.tree.map(jnp.negative, gradient)
        states = []
        for stage, own in zip(self.stages, state.chain, strict=True):
            updates, own = stage.update(updates, own, policy, state.steps, due)
            states.append(own)
        updates = scale(abilities.allowed(policy, updates))
        for stage, own in reversed(list(zip(self.stages, states, strict=True))):  # the innermost limit first
            updates = stage.constrain(updates, own, policy, state.steps, due)
        moved = abilities.limited(eqx.combine(eqx.apply_updates(parameters, updates), settings))
        steps = None if state.steps is None else counted_on(state.steps)
        chain = self.map(lambda stage, own: stage.after_step(own, moved, steps), tuple(states))
        return state._replace(policy=moved, chain=chain, steps=steps)

    def final_policy(self, states: tuple[PyTree, ...], policy: Policy) -> Policy:
        """The policy to keep."""
        for stage, state in zip(self.stages, states, strict=True):
            policy = stage.final_policy(state, policy)
        return policy
