"""Stochastic units as blocks: policies of the library that act, output their score, and take steps."""

import abc
import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jax.typing import ArrayLike, DTypeLike
from jaxtyping import Array, Float, PyTree

from motorgrad import policies
from motorgrad._errors import check
from motorgrad.policies import Policy, abilities, split, trainable
from motorgrad.schema import Kind, Range, count, number, static
from motorgrad.tasks import Task
from timlab.blocks.learning._shared import MAX_UNITS, where
from timlab.diagram import Block, Moment, Port, Ports, Signals


class _Shapes(NamedTuple):
    policy: Policy
    action: jax.ShapeDtypeStruct
    parameters: int
    units: int
    """The number of rows of parameters that can move without the others."""
    hidden: int
    """How many numbers are drawn that the task does not get."""
    memory: tuple[int, ...]
    """The shape of what is remembered, empty without a memory."""


class Remembering(NamedTuple):
    """The state of units with a memory."""

    policy: Policy
    memory: Float[Array, " memory"] | None


@dataclasses.dataclass(frozen=True, kw_only=True)
class Units(Block, abc.ABC):
    r"""Stochastic units, a policy $\pi(a \mid y, \theta)$ of `motorgrad.policies`.

    They act on an observation, and output the score $\nabla_\theta \log \pi$ of the action. They own their parameters
    $\theta$: a `step` that comes in is added before they act, within the limits of the parameters. Or the parameters
    come by a wire, so that several blocks share those of one, or they are learned by other means.

    `score`, `step` and `parameters` are vectors in the order of the policy's fields.
    """

    category: ClassVar[str] = "learning"

    greedy: Any = number(False, kind="bool", help="take the most probable action, not a random one")
    source: Literal["own", "wire"] = static("own", help="where parameters come from")
    frozen: Any = number(False, kind="bool", help="take no steps: all units, or each as a list says")

    def validate(self) -> None:
        super().validate()
        self.check_broadcasts("frozen", (self._shapes.units,))

    @abc.abstractmethod
    def start(self, uniforms: Float[Array, " init_uniforms"]) -> Policy:
        """The initial policy."""

    @functools.cached_property
    def _shapes(self) -> _Shapes:
        real = jnp.result_type(float)
        policy = jax.eval_shape(self.start, jax.ShapeDtypeStruct((self.init_uniforms,), real))
        seen = jax.ShapeDtypeStruct((policy.inputs,), real)
        drawn = jax.eval_shape(lambda p, y: p.mode(y), policy, seen)
        action = jax.eval_shape(abilities.task_action, policy, drawn)
        rows = jax.eval_shape(lambda p: abilities.blocks(p, trainable(p)), policy)
        units = sum(row.shape[0] for row in rows)
        memory = jax.eval_shape(abilities.initial_memory, policy)
        hidden = drawn.size - action.size
        shape = () if memory is None else memory.shape
        return _Shapes(policy, action, size_of(policy), units, hidden, shape)

    def values(self) -> dict[str, np.ndarray]:
        found = super().values()  # for every unit, so that one can be frozen while the diagram runs
        return found | {"frozen": np.broadcast_to(found["frozen"], (self._shapes.units,))}

    @property
    def inputs(self) -> Ports:
        policy, size = self._shapes.policy, self._shapes.parameters
        moved = {
            "own": {"step": Port((size,), default=0.0, help="added to the parameters at once")},
            "wire": {"parameters": Port((size,))},
        }
        restart = {"restart": Port((), "bool", default=0.0, help="forget: an episode begins")}
        return {
            "observation": Port((policy.observation_size,)),
            **moved[self.source],
            **(restart if abilities.has_memory(policy) else {}),
        }

    @property
    def outputs(self) -> Ports:
        policy, action, size, _, hidden, memory = self._shapes
        ports = {
            "action": Port(action.shape, kind_of(action.dtype)),
            "score": Port((size,), help="gradient of the action's log-probability"),
            "probability": Port((policy.outputs,), help="that each unit fires, or of each alternative"),
            "parameters": Port((size,), help="at this tick"),
        }
        if abilities.has_hidden_units(policy):
            ports["hidden"] = Port((hidden,), help="what the hidden units drew")
        if abilities.has_memory(policy):
            ports["memory"] = Port(memory, help="what is remembered for the next decision")
        return ports

    @property
    def uniforms(self) -> int:
        return self._shapes.policy.uniforms

    def init(self, uniforms: Float[Array, " init_uniforms"]) -> PyTree[Array]:
        policy = self.start(uniforms)
        return Remembering(policy, abilities.initial_memory(policy)) if abilities.has_memory(policy) else policy

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        policy, seen, action = self._acted(state, inputs, now)
        shown: dict[str, Any] = {
            "action": abilities.task_action(policy, action),
            "score": flat(policy.score(seen, action)),
            "probability": policy.prob(seen),
            "parameters": flat(trainable(policy)),
        }
        if abilities.has_hidden_units(policy):
            shown["hidden"] = action[: self._shapes.hidden]  # what the task gets comes last
        if abilities.has_memory(policy):
            shown["memory"] = abilities.remember(policy, seen, action)
        return shown

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        policy, seen, action = self._acted(state, inputs, now)
        after = where(jnp.all(self.frozen), policy, abilities.adapted(policy, seen))
        return Remembering(after, abilities.remember(policy, seen, action)) if abilities.has_memory(policy) else after

    def _acted(self, state: PyTree[Array], inputs: Signals, now: Moment) -> tuple[Policy, Array, Array]:
        """The policy, what its units see, and what they draw."""
        policy = self.acting(self.moved(state, inputs, now))
        memory = None
        if isinstance(state, Remembering):
            memory = where(inputs["restart"], abilities.initial_memory(policy), state.memory)
        seen = abilities.observation_with_memory(policy, memory, inputs["observation"])
        drawn = policy.sample(seen, now.uniforms)
        likely = policy.mode(seen)
        return policy, seen, jnp.where(self.greedy, likely, drawn)

    def moved(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Any:
        """The state after the step of this tick."""
        if isinstance(state, Remembering):
            return state._replace(policy=self.moved(state.policy, inputs, now))
        parameters, settings = split(state)
        if self.source == "wire":
            return abilities.limited(eqx.combine(unflat(parameters, inputs["parameters"]), settings))
        step = self.thawed(state, abilities.allowed(state, unflat(parameters, inputs["step"])))
        return abilities.limited(eqx.combine(eqx.apply_updates(parameters, step), settings))

    def thawed(self, policy: Policy, step: PyTree[Array]) -> PyTree[Array]:
        """A step without that of frozen units."""
        rows = abilities.blocks(policy, step)
        start = 0
        moving = []
        for row in rows:
            free = ~self.frozen[start : start + len(row)]
            moving.append(jnp.broadcast_to(free[:, None], row.shape).astype(row.dtype))
            start += len(row)
        free_entries = abilities.from_blocks(policy, tuple(moving))
        return jax.tree.map(lambda x, free: jnp.where(free > 0, x, 0), step, free_entries)

    def acting(self, state: PyTree[Array]) -> Policy:
        """The policy in a state."""
        return state.policy if isinstance(state, Remembering) else state


@dataclasses.dataclass(frozen=True)
class Motoneurons(Units):
    r"""A pool of motoneurons on one input, $p_i = \sigma(k_i\,(y - y^*_i))$ (section 4.2.2 of the thesis).

    Parameters: the thresholds $y^*$, then the gains $k$. The initial thresholds are drawn from `threshold` ± `spread`.
    """

    name: ClassVar[str] = "motoneurons"

    units: int = count(1, 1, MAX_UNITS, help="number of units")
    threshold: Any = number(0.5, help="initial $y^*$, for all or for each")
    gain: Any = number(0.0, help="initial $k$, for all or for each")
    spread: Any = number(0.0, 0, help="largest initial distance from `threshold`")

    def validate(self) -> None:
        for name in ("threshold", "gain", "spread"):
            self.check_broadcasts(name, (self.units,))

    @property
    def init_uniforms(self) -> int:
        return self.units

    def start(self, uniforms: Float[Array, " units"]) -> policies.Motoneurons:
        threshold = spread(self.threshold, self.spread, uniforms, (self.units,))
        return policies.Motoneurons(threshold, jnp.broadcast_to(jnp.asarray(self.gain, uniforms.dtype), (self.units,)))


@dataclasses.dataclass(frozen=True)
class Hyperplanes(Units):
    r"""Units that fire on one side of a soft boundary, $p_i = \sigma(w_i \cdot y + b_i)$ (section 5.2 of the thesis).

    Parameters: the weights $w$, unit by unit, then the biases $b$. With zero weights every unit fires half of the time.
    """

    name: ClassVar[str] = "hyperplanes"

    units: int = count(1, 1, MAX_UNITS, help="number of units")
    observed: int = count(1, 1, MAX_UNITS, help="number of observed numbers")
    weights: Any = number(0.0, help="initial $w$, for all or (units, observed)")
    bias: Any = number(0.0, help="initial $b$, for all or for each")
    spread: Any = number(0.0, 0, help="largest initial distance from `weights`")

    def validate(self) -> None:
        for name in ("weights", "spread"):
            self.check_broadcasts(name, (self.units, self.observed))
        self.check_broadcasts("bias", (self.units,))

    @property
    def init_uniforms(self) -> int:
        return self.units * self.observed

    def start(self, uniforms: Float[Array, " weights"]) -> policies.Hyperplanes:
        weights = spread(self.weights, self.spread, uniforms, (self.units, self.observed))
        return policies.Hyperplanes(weights, jnp.broadcast_to(jnp.asarray(self.bias, weights.dtype), (self.units,)))


@dataclasses.dataclass(frozen=True)
class Softmax(Units):
    r"""One of several alternatives, $\pi_k \propto \exp(w_k \cdot y)$. The action is the index of one, from 0.

    Parameters: the weights $w$, alternative by alternative.
    """

    name: ClassVar[str] = "softmax"

    alternatives: int = count(2, 1, MAX_UNITS, help="number of alternatives")
    observed: int = count(1, 1, MAX_UNITS, help="number of observed numbers")
    weights: Any = number(0.0, help="initial $w$, for all or (alternatives, observed)")
    spread: Any = number(0.0, 0, help="largest initial distance from `weights`")

    def validate(self) -> None:
        for name in ("weights", "spread"):
            self.check_broadcasts(name, (self.alternatives, self.observed))

    @property
    def init_uniforms(self) -> int:
        return self.alternatives * self.observed

    def start(self, uniforms: Float[Array, " weights"]) -> policies.Softmax:
        return policies.Softmax(spread(self.weights, self.spread, uniforms, (self.alternatives, self.observed)))


@dataclasses.dataclass(frozen=True)
class Gaussians(Units):
    r"""Units that fire only near their centres, $p_i = p_\max \exp(-\frac12 \sum_j ((y_j - \mu_j)/\sigma_j)^2)$
    (section 6.2 of the thesis).

    Parameters: the centres $\mu$, unit by unit, then the logarithms of the widths $\sigma$. The initial centres are
    drawn from `centre` ± `spread`.
    """

    name: ClassVar[str] = "gaussians"

    units: int = count(1, 1, MAX_UNITS, help="number of units")
    observed: int = count(1, 1, MAX_UNITS, help="number of observed numbers")
    centre: Any = number(0.0, help=r"initial $\mu$, for all or (units, observed)")
    width: Any = number(0.5, 0, open_low=True, help=r"initial $\sigma$, for all or (units, observed)")
    height: Any = number(1.0, 1e-6, 1, help=r"$p_\max$, for all or for each")
    spread: Any = number(0.0, 0, help="largest initial distance from `centre`")
    limits: tuple[float, float] | None = static(
        (0.0183, 7.39),
        allowed=Range(0, 1e6, open_low=True, open_high=True),
        help="smallest and largest width that learning may reach, or none",
    )

    def validate(self) -> None:
        for name in ("centre", "width", "spread"):
            self.check_broadcasts(name, (self.units, self.observed))
        self.check_broadcasts("height", (self.units,))
        right = self.limits is None or self.limits[0] < self.limits[1]
        check(right, "limits", self.limits, "None, or two widths, the lower first")

    @property
    def init_uniforms(self) -> int:
        return self.units * self.observed

    def start(self, uniforms: Float[Array, " centres"]) -> policies.Policy:
        return self.pool(uniforms)

    def pool(self, uniforms: Float[Array, " centres"]) -> policies.LocalGaussians:
        """The initial units."""
        shape = (self.units, self.observed)
        centre = spread(self.centre, self.spread, uniforms, shape)
        width = jnp.broadcast_to(jnp.log(jnp.asarray(self.width, centre.dtype)), shape)
        height = jnp.broadcast_to(jnp.asarray(self.height, centre.dtype), (self.units,))
        limits = None if self.limits is None else (float(np.log(self.limits[0])), float(np.log(self.limits[1])))
        return policies.LocalGaussians(centre, width, p_max=height, log_width_limits=limits)


@dataclasses.dataclass(frozen=True)
class Sizes(Task):
    """The sizes of observations and actions in a diagram, in the place of a task, for policies and learners."""

    name: ClassVar[str] = "diagram"
    learner: ClassVar[Mapping[str, Any]] = {}

    observed: int
    acted: int

    @property
    def dynamics(self) -> Any:
        raise NotImplementedError("the dynamics are the diagram")

    @property
    def observation_size(self) -> int:
        return self.observed

    @property
    def action_size(self) -> int:
        return self.acted

    def observe(self, memory: PyTree[Array], state: PyTree[Array], uniforms: Array) -> Any:
        raise NotImplementedError("the diagram observes")

    def reward(self, memory: PyTree[Array], state: PyTree[Array], action: Array) -> Any:
        raise NotImplementedError("the diagram rewards")


def key_from(uniforms: Float[Array, " 1"]) -> jax.Array:
    """A key for functions of the library that draw their own random numbers."""
    return jax.random.key((uniforms[0] * 2**24).astype(jnp.uint32))


def kind_of(dtype: DTypeLike) -> Kind:
    """The kind of signal that arrays of a type are."""
    return "bool" if np.dtype(dtype) == np.dtype(bool) else "float" if jnp.issubdtype(dtype, jnp.floating) else "int"


def flat(tree: PyTree[Array]) -> Float[Array, " parameters"]:
    """The numbers of a score or of parameters as one vector."""
    return ravel_pytree(tree)[0]


def size_of(policy: Policy) -> int:
    """The number of trainable numbers of a policy, from its shapes alone."""
    return jax.eval_shape(lambda each: flat(trainable(each)), policy).size


def unflat(like: PyTree[Array], vector: Float[Array, " parameters"]) -> PyTree[Array]:
    """The inverse of `flat`, in the structure of `like`."""
    return ravel_pytree(like)[1](vector)


def spread(level: ArrayLike, width: ArrayLike, uniforms: Float[Array, " numbers"], shape: tuple[int, ...]) -> Array:
    """Numbers drawn from `level` ± `width`."""
    level = jnp.broadcast_to(jnp.asarray(level, uniforms.dtype), shape)
    return level + jnp.asarray(width, uniforms.dtype) * (2 * uniforms.reshape(shape) - 1)
