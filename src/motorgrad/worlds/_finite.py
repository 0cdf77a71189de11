"""Finite Markov decision processes."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad.worlds._world import World


class FiniteMDP(World):
    """A finite MDP whose observation is a function of the state.

    The arrays are NumPy float64, exact to the oracle (see `motorgrad.worlds.oracle`); sampling runs in the learner's
    precision on the few successors that each state has.

    **Arguments:**

    - `transitions`: `(actions, states, states)`, rows sum to one.
    - `rewards`: `(states,)`, paid on entering a state; or `(actions, states)`, paid for an action taken in a state.
    - `observations`: `(states, inputs)`, what the policy sees.
    - `start`: the state in which an episode begins.

    **Raises:** `ValueError` for arrays of other shapes, for rows that are not probabilities (to 1e-12), and for a start
    that is no state.
    """

    uniforms: ClassVar[int] = 1

    def __init__(
        self, transitions: npt.ArrayLike, rewards: npt.ArrayLike, observations: npt.ArrayLike, start: int = 0
    ) -> None:
        self.transitions = np.asarray(transitions, float)
        self.rewards = np.asarray(rewards, float)
        self.observations = np.asarray(observations, float)
        self.start = start
        shape = self.transitions.shape
        check(len(shape) == 3 and shape[1] == shape[2], "transitions", shape, "of shape (actions, states, states)")
        states = shape[1]
        shapes = ((states,), shape[:2])
        check(self.rewards.shape in shapes, "rewards", self.rewards.shape, f"of shape {shapes[0]} or {shapes[1]}")
        seen = self.observations.shape
        check(len(seen) == 2 and seen[0] == states, "observations", seen, f"of shape ({states}, inputs)")
        check(0 <= start < states, "start", start, f"a state in 0 … {states - 1}")
        for name in ("rewards", "observations"):
            check(np.isfinite(getattr(self, name)).all(), name, getattr(self, name).tolist(), "finite numbers")
        low, off = self.transitions.min(), np.abs(self.transitions.sum(-1) - 1).max()
        check(low >= 0 and off < 1e-12, "transitions", f"least {low}, row sums off by {off}", "probabilities")
        self._successors, self._cumulative = _compact(self.transitions)

    @property
    def states(self) -> int:
        """Number of states."""
        return self.transitions.shape[1]

    @property
    def actions(self) -> int:
        """Number of actions."""
        return self.transitions.shape[0]

    def reset(self, uniforms: Float[Array, " 0"]) -> Int[Array, ""]:
        del uniforms
        return jnp.asarray(self.start, jnp.int32)

    def step(self, state: Int[Array, ""], action: Array, uniforms: Float[Array, " 1"]) -> Int[Array, ""]:
        """`action` is the action's index, or a vector of bits that spell it (most significant first)."""
        index = action_index(action)
        # The last successor needs no comparison, and rounding cannot lead outside the list.
        row = jnp.asarray(self._cumulative, uniforms.dtype)[index, state, :-1]
        which = jnp.sum(uniforms[0] >= row, dtype=jnp.int32)
        return jnp.asarray(self._successors)[index, state, which]

    def reward(self, before: Int[Array, ""], action: Array, after: Int[Array, ""]) -> Float[Array, ""]:
        """What the step from `before` to `after` by `action` pays."""
        rewards = jnp.asarray(self.rewards, jnp.result_type(float))
        return rewards[after] if rewards.ndim == 1 else rewards[action_index(action), before]

    @property
    def expected_rewards(self) -> Float[np.ndarray, "actions states"]:
        """The mean reward of each action in each state."""
        return self.rewards if self.rewards.ndim == 2 else self.transitions @ self.rewards


def action_index(action: Array) -> Int[Array, ""]:
    """The index of an action: itself if it is an integer scalar, or the number that a vector of bits spells."""
    if action.ndim == 0:
        return action.astype(jnp.int32)
    weights = 2 ** jnp.arange(action.shape[0] - 1, -1, -1)
    return jnp.sum(action.astype(jnp.int32) * weights, dtype=jnp.int32)


def _compact(transitions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each row's possible successors first, padded by repeating the last, and their cumulative probabilities."""
    possible = transitions > 0
    most = int(possible.sum(-1).max())
    order = np.argsort(~possible, axis=-1, kind="stable")[..., :most]
    probability = np.take_along_axis(transitions, order, axis=-1)
    count = possible.sum(-1, keepdims=True)
    last = np.take_along_axis(order, count - 1, axis=-1)
    successors = np.where(np.arange(most) < count, order, last).astype(np.int32)
    return successors, np.cumsum(probability, axis=-1)
