"""What all blocks of units are: a policy of the library that acts, gives its score, and takes steps."""

import abc
import dataclasses
import functools
from typing import Annotated, Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from motorgrad.lab.diagram import Block, Kind, Moment, Parameter, Port, Ports, Setting, Signals
from motorgrad.policies import Policy, split, trainable


class _Shapes(NamedTuple):
    policy: Policy
    action: jax.ShapeDtypeStruct
    parameters: int
    units: int
    """How many rows of parameters there are that could move without the others."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Units(Block, abc.ABC):
    r"""Stochastic units, a policy $\pi(a \mid y, \theta)$ of `motorgrad.policies`.

    They act on what they observe, and give the score $\nabla_\theta \log \pi$ of that action. Their parameters
    $\theta$ are their own: they add the `step` that comes in, which acts at once, and keep to their limits. Or the
    parameters come by a wire: several blocks may then share those of one, or they are learnt by other means.

    `score`, `step` and `parameters` are vectors in the order of the policy's fields.
    """

    category: ClassVar[str] = "learning"

    greedy: Annotated[Any, Parameter("take the most probable action, not one by chance", kind="bool")] = False
    source: Annotated[str, Setting("where parameters come from", choices=("own", "wire"))] = "own"
    frozen: Annotated[Any, Parameter("take no steps: all units, or each as a list says", kind="bool")] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_broadcasts("frozen", (self._shapes.units,))

    @abc.abstractmethod
    def start(self, uniforms: Float[Array, " init_uniforms"]) -> Policy:
        """The policy at the start."""

    @functools.cached_property
    def _shapes(self) -> _Shapes:
        real = jnp.result_type(float)
        policy = jax.eval_shape(self.start, jax.ShapeDtypeStruct((self.init_uniforms,), real))
        action = jax.eval_shape(lambda p, y: p.mode(y), policy, jax.ShapeDtypeStruct((policy.inputs,), real))
        rows = jax.eval_shape(lambda p: p.blocks(trainable(p)), policy)
        return _Shapes(policy, action, size_of(policy), sum(row.shape[0] for row in rows))

    def values(self) -> dict[str, np.ndarray]:
        found = super().values()  # of every unit, so that one can be frozen while it runs
        return found | {"frozen": np.broadcast_to(found["frozen"], (self._shapes.units,))}

    @property
    def inputs(self) -> Ports:
        policy, _, size, _ = self._shapes
        moved = {
            "own": {"step": Port((size,), default=0.0, help="what is added to the parameters, at once")},
            "wire": {"parameters": Port((size,))},
        }
        return {"observation": Port((policy.inputs,), help="what the units see"), **moved[self.source]}

    @property
    def outputs(self) -> Ports:
        policy, action, size, _ = self._shapes
        return {
            "action": Port(action.shape, kind_of(action.dtype), help="what the units do"),
            "score": Port((size,), help="gradient of the action's log-probability"),
            "probability": Port((policy.outputs,), help="of each unit's firing, or of each alternative"),
            "parameters": Port((size,), help="as they are at this tick"),
        }

    @property
    def uniforms(self) -> int:
        return self._shapes.policy.uniforms

    def init(self, uniforms: Float[Array, " init_uniforms"]) -> Any:
        return self.start(uniforms)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        policy = self.acting(self.moved(state, inputs, now))
        observation = inputs["observation"]
        drawn, likely = policy.sample(observation, now.uniforms), policy.mode(observation)
        action = jnp.where(self.greedy, likely, drawn)
        return {
            "action": action,
            "score": flat(policy.score(observation, action)),
            "probability": policy.prob(observation),
            "parameters": flat(trainable(policy)),
        }

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self.moved(state, inputs, now)

    def moved(self, state: Any, inputs: Signals, now: Moment) -> Any:
        """The state once it has taken in the step of this tick."""
        parameters, settings = split(state)
        if self.source == "wire":
            return eqx.combine(unflat(parameters, inputs["parameters"]), settings).limited()
        step = self.thawed(state, state.allowed(unflat(parameters, inputs["step"])))
        return eqx.combine(eqx.apply_updates(parameters, step), settings).limited()

    def thawed(self, policy: Policy, step: Any) -> Any:
        """A step without that of frozen units."""
        rows, start, moving = policy.blocks(step), 0, []
        for row in rows:
            free = ~self.frozen[start : start + len(row)]
            moving.append(jnp.broadcast_to(free[:, None], row.shape).astype(row.dtype))
            start += len(row)
        return jax.tree.map(lambda x, free: jnp.where(free > 0, x, 0), step, policy.from_blocks(tuple(moving)))

    def acting(self, state: Any) -> Policy:
        """The policy in a state."""
        return state


def kind_of(dtype: Any) -> Kind:
    """The kind of signal that arrays of a type are."""
    return "bool" if np.dtype(dtype) == np.dtype(bool) else "float" if jnp.issubdtype(dtype, jnp.floating) else "int"


def flat(tree: Any) -> Float[Array, " parameters"]:
    """The numbers of a score or of parameters as one vector."""
    return ravel_pytree(tree)[0]


def size_of(policy: Any) -> int:
    """How many trainable numbers a policy has; its shapes are enough."""
    return jax.eval_shape(lambda each: flat(trainable(each)), policy).size


def unflat(like: Any, vector: Float[Array, " parameters"]) -> Any:
    """The inverse of `flat`, in the structure of `like`."""
    return ravel_pytree(like)[1](vector)


def spread(level: Any, width: Any, uniforms: Float[Array, " numbers"], shape: tuple[int, ...]) -> Array:
    """Numbers drawn from `level` ± `width`."""
    level = jnp.broadcast_to(jnp.asarray(level, uniforms.dtype), shape)
    return level + jnp.asarray(width, uniforms.dtype) * (2 * uniforms.reshape(shape) - 1)
