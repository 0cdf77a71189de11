"""Demonstrated decisions, and whether a policy can see and do what is in them."""

import dataclasses
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from motorgrad._errors import check, counted
from motorgrad._random import key_of
from motorgrad.policies import BoundedUnits, Policy, abilities, split


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Demonstrations:
    """Demonstrated decisions, in the order in which they were made.

    **Arguments:**

    - `observations` (decisions, observation): what a policy saw, scaled as the task scales it.
    - `actions` (decisions, outputs) of units, or (decisions,) of alternatives, which are numbered from 0: what it did.
    - `episodes` (decisions,): the number of the episode of each decision, those of an episode side by side; by default
      all are of one episode.

    `mg.rollout(…).demonstrations()` has those of any policy on any task. `+` joins two.

    **Raises:** `ValueError` for none, for arrays of other or different lengths, for numbers that are not finite, and
    for an episode in several pieces.

    ```python
    seen = mg.rollout("chain", steps=20).demonstrations()
    other = mg.learning.Demonstrations(np.zeros((3, seen.observations.shape[1])), [0, 1, 0])
    print(len(seen + other) - len(seen))  # → 3
    ```
    """

    observations: Float[np.ndarray, "decisions observation"]
    actions: np.ndarray
    episodes: Int[np.ndarray, " decisions"] = dataclasses.field(default_factory=lambda: np.zeros(0, int))

    def __post_init__(self) -> None:
        seen = np.asarray(self.observations)
        done = np.asarray(self.actions)
        check(seen.ndim == 2 and len(seen), "observations.shape", seen.shape, "(decisions, observation), at least one")
        check(done.ndim in (1, 2), "actions.shape", done.shape, "(decisions, outputs), or (decisions,) of alternatives")
        episodes = np.asarray(self.episodes)
        episodes = np.zeros(len(seen), int) if episodes.shape == (0,) else episodes
        check(episodes.ndim == 1, "episodes.shape", episodes.shape, "(decisions,)")
        lengths = len(seen), len(done), len(episodes)
        check(len(set(lengths)) == 1, "observations, actions, episodes", lengths, "of the same length")
        for name, numbers in (("observations", seen), ("actions", done)):
            bad = np.flatnonzero(~np.isfinite(numbers).reshape(len(numbers), -1).all(axis=1))
            check(not len(bad), f"{name}[{bad[0] if len(bad) else 0}]", numbers[bad[:1]].tolist(), "finite numbers")
        begins = np.flatnonzero(np.append(True, np.diff(episodes) != 0))
        if done.ndim == 1:
            whole = done == np.rint(done)
            first = int(np.argmin(whole))
            check(whole.all(), f"actions[{first}]", done[first], "a whole number, or all (decisions, outputs) of units")
            done = done.astype(int)
        unbroken = len(begins) == len(np.unique(episodes))
        check(unbroken, "episodes", episodes[begins].tolist(), "numbers of which each stands in one place only")
        for name, numbers in (("observations", seen), ("actions", done), ("episodes", episodes)):
            object.__setattr__(self, name, numbers)

    def __len__(self) -> int:
        return len(self.observations)

    def __repr__(self) -> str:
        number = len(np.unique(self.episodes))
        return f"Demonstrations({counted(len(self), 'decision')} of {counted(number, 'episode')})"

    def __add__(self, other: Self) -> Self:
        before = self.by_episode()
        joined = [*before, *other.by_episode()]
        sizes = [(*seen.shape[1:], *done.shape[1:]) for seen, done in joined]
        check(len(set(sizes)) == 1, "sizes of observation and action", sizes[:: len(before)], "the same in both")
        numbers = np.repeat(np.arange(len(joined)), [len(seen) for seen, _ in joined])
        seen, done = (np.concatenate(parts) for parts in zip(*joined, strict=True))
        return type(self)(seen, done, numbers)

    def by_episode(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The observations and actions of each episode."""
        begins = np.flatnonzero(np.diff(self.episodes)) + 1
        parts = (np.split(each, begins) for each in (self.observations, self.actions))
        return list(zip(*parts, strict=True))

    def answered_by(self, policy: Policy, seed: int = 0) -> Self:
        """The same observations with the actions that a policy draws on them, as DAgger asks the demonstrator what it
        would have done where the learner came (Ross, Gordon & Bagnell, 2011).

        **Arguments:** `policy`, without a memory; `seed` of its random numbers.
        """
        check(not abilities.has_memory(policy), "policy", type(policy).__name__, "one without a memory")
        _check_observations(policy, self)
        uniforms = jax.random.uniform(key_of(seed, "answers"), (len(self), policy.uniforms))
        actions = np.asarray(_answers(policy, jnp.asarray(self.observations, jnp.result_type(float)), uniforms))
        return type(self)(self.observations, actions, self.episodes)


@eqx.filter_jit
def _answers(policy: Policy, observations: Array, uniforms: Array) -> Array:
    return jax.vmap(lambda *of: abilities.task_action(policy, policy.sample(*of)))(observations, uniforms)


def _check_observations(policy: Policy, demonstrations: Demonstrations) -> None:
    size = demonstrations.observations.shape[1]
    check(
        size == policy.observation_size, "size of an observation", size, f"{policy.observation_size}, as the policy's"
    )


def check_imitates(policy: Policy, demonstrations: Demonstrations) -> None:
    """Refuse policies that cannot imitate, and what a policy can neither see nor do."""
    kind = type(policy).__name__
    check(not abilities.has_hidden_units(policy), "policy", kind, "one without hidden units, which nobody demonstrates")
    if abilities.has_memory(policy):
        still = abilities.adapted(policy, jnp.zeros(policy.inputs)) is policy
        check(still, "policy", kind, "without a memory, or without statistics that it keeps of what it sees")
    check(jax.tree.leaves(split(policy)[0]), "policy", kind, "one with parameters that can be fitted")
    _check_observations(policy, demonstrations)
    actions = demonstrations.actions
    kinds = policy.actions
    if kinds == "discrete":
        check(actions.ndim == 1, "actions.shape", actions.shape, "(decisions,), the numbers of alternatives")
        wanted = f"from 0 to {policy.outputs - 1}, an alternative"
        _check_each(actions, (actions >= 0) & (actions < policy.outputs), wanted)
        return
    like = jax.eval_shape(lambda each: each.mode(jnp.zeros(each.inputs)), policy).shape
    check(actions.shape[1:] == like, "actions.shape", actions.shape, f"(decisions, {', '.join(map(str, like))})")
    if kinds == "querying":
        kinds = (*["binary"] * (like[0] - 1), "query")
    units = np.array([each == "binary" for each in (kinds if isinstance(kinds, tuple) else [kinds] * like[0])])
    _check_each(actions, np.isin(actions[:, units], (0, 1)).all(axis=1), "zeros and ones of binary units")
    if policy.actions != "querying":  # a query is the task's own, and its probability no part of the likelihood
        low, high = _bounds(policy)
        inside = (actions >= low) & (actions <= high)
        _check_each(actions, inside.all(axis=1), f"from {_line(low)} to {_line(high)}")


def _check_each(actions: np.ndarray, fine: Any, wanted: str) -> None:
    """Refuse the first decision whose action is not fine."""
    if not fine.all():
        first = int(np.argmin(fine))
        check(False, f"actions[{first}]", actions[first].tolist(), wanted)


def _bounds(policy: Policy) -> tuple[np.ndarray, np.ndarray]:
    """The least and the greatest number of every output; infinite without a bound. Where outputs cannot be told apart,
    those of all."""
    if isinstance(policy, BoundedUnits):
        low, high = (np.broadcast_to(np.asarray(each), policy.outputs) for each in (policy.low, policy.high))
        return low, high
    leaves = jax.tree.leaves(policy, is_leaf=lambda node: isinstance(node, Policy) and node is not policy)
    parts = [_bounds(part) for part in leaves if isinstance(part, Policy)]
    if not parts:
        return np.full(policy.outputs, -np.inf), np.full(policy.outputs, np.inf)
    low, high = (np.concatenate(each) for each in zip(*parts, strict=True))
    if len(low) == policy.outputs:
        return low, high
    return np.full(policy.outputs, low.min()), np.full(policy.outputs, high.max())


def _line(numbers: np.ndarray) -> str:
    return f"{numbers[0]:g}" if (numbers == numbers[0]).all() else str(numbers.tolist())
