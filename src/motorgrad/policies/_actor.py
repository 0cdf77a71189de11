"""A policy that acts in the environment itself, on raw observations."""

from collections.abc import Callable
from typing import Generic, NamedTuple, Protocol, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import ArrayLike

from motorgrad._errors import check
from motorgrad._interface import Interface
from motorgrad.policies import abilities


class Decider(Protocol):
    """What of a `Policy` makes decisions in an environment."""

    @property
    def interface(self) -> Interface | None: ...
    @property
    def uniforms(self) -> int: ...
    def mode(self, observation: Array) -> Array: ...
    def sample(self, observation: Array, uniforms: Array) -> Array: ...


P = TypeVar("P", bound=Decider)


class Decision(NamedTuple):
    """The `action` that a task gets, and the policy's `memory` after it."""

    action: Array
    memory: Array | None


def decide(policy: Decider, memory: Array | None, raw: Array, uniforms: Array | None = None) -> Decision:
    """The decision of a policy on a raw observation. A pure function, which JAX can trace.

    **Arguments:** `policy`: with its `interface`, or without one, for observations as it sees them; `memory`: the
    policy's, or `None`; `raw`: the observation, flattened; `uniforms`: numbers from U[0, 1) by which the action is
    drawn, by default the most probable one.

    **Returns** the policy's own action, before `interface.decode`, and its memory after it.
    """
    observation = raw if policy.interface is None else policy.interface.encode(raw)
    seen = abilities.observation_with_memory(policy, memory, observation)
    action = policy.mode(seen) if uniforms is None else policy.sample(seen, uniforms)
    return Decision(abilities.task_action(policy, action), abilities.remember(policy, seen, action))


_decided: Callable[..., Decision] = eqx.filter_jit(decide)


@eqx.filter_jit
def _decided_all(policy: Decider, raw: Array | np.ndarray, uniforms: Array | None) -> Array:
    return jax.vmap(lambda *of: decide(policy, None, *of).action)(raw, uniforms)


class Actor(Generic[P]):
    """A policy of a run that acts in an environment: raw observations in, raw actions out. It keeps the memory of the
    policy from decision to decision, where that has one.

    **Arguments:** `policy`: of one seed, with its `interface`, as `run.policy(seed)` returns it.

    **Raises:** `ValueError` for a policy without an interface, or without the running statistics that it needs.

    ```python
    environment = gymnasium.make("Pendulum-v1")
    actor = mg.policies.Actor(run.policy())
    observation, _ = environment.reset(seed=1)
    actor.reset()
    observation, *_ = environment.step(actor.act(observation))
    ```
    """

    def __init__(self, policy: P):
        self.policy = policy
        self.interface = known_interface(policy)
        self.reset()

    def reset(self) -> None:
        """Begin an episode: the memory is as at the start of one. A policy without a memory needs no call."""
        self.memory = abilities.initial_memory(self.policy)

    def act(self, observation: ArrayLike, uniforms: ArrayLike | None = None) -> np.ndarray:
        """The raw action for a raw observation; see `Policy.act`. Without a memory there may be leading axes."""
        code = self.interface.observations
        shape = np.shape(observation)
        ends = len(shape) - len(code.shape)
        several = shape[:ends] if ends > 0 else ()
        single = abilities.has_memory(self.policy)
        right = shape[len(several) :] == code.shape and not (several and single)
        check(right, "observation.shape", shape, f"{code.shape}{'' if single else ', after any axes'}")
        raw = np.asarray(observation, np.float32).reshape(*several, code.size)
        check(np.isfinite(raw).all(), "observation", np.asarray(observation).tolist(), "finite numbers")
        drawn = None if uniforms is None else jnp.asarray(uniforms, jnp.result_type(float))
        if not several:
            action, self.memory = _decided(self.policy, self.memory, raw, drawn)
            return self.interface.actions.native(action)
        rows = raw.reshape(-1, code.size)
        chance = None if drawn is None else drawn.reshape(len(rows), self.policy.uniforms)
        action = np.asarray(_decided_all(self.policy, rows, chance))
        return self.interface.actions.native(action.reshape(*several, *action.shape[1:]))


def known_interface(policy: Decider) -> Interface:
    """The interface of a policy. **Raises** `ValueError` where it has none, or is without its statistics."""
    kind = type(policy).__name__
    wanted = "one of a run, run.policy(seed), which knows the scale of observations and the code of actions"
    interface = policy.interface
    check(interface is not None, "policy", f"{kind} without an interface", wanted)
    assert interface is not None
    fine = interface.statistics is not None or not interface.running
    check(fine, "policy", f"{kind} without the running statistics of its observations", wanted)
    return interface
