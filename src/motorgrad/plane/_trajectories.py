"""Trajectories of a particle under a policy, and how often each place is visited."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad.policies import abilities

if TYPE_CHECKING:
    from motorgrad.policies import Policy
    from motorgrad.tasks import ParticleTask
    from motorgrad.worlds import ParticleState


def trajectories(
    task: ParticleTask, policy: Policy, episodes: int = 10, seed: int = 0, decisions: int = 200
) -> list[Float[np.ndarray, "decisions+1 2"]]:
    """The particle's positions in some episodes under a policy that is sampled and does not learn, each at its start
    and after every decision, including the last.

    The seed alone determines the starts. An episode lasts until the task ends it, but at most `decisions`; a task
    without episodes runs for exactly that long. **Raises** `ValueError` for a policy that does not fit the task.
    """
    check_arguments(trajectories, locals())
    track, lengths = _simulate(task, policy, episodes, seed, decisions)
    return [track[: length + 1, episode].copy() for episode, length in enumerate(lengths)]


def occupancy(
    task: ParticleTask, policy: Policy, episodes: int = 15_000, seed: int = 0, decisions: int = 200, cells: int = 100
) -> Float[np.ndarray, "cells cells"]:
    """The share of time that the particle spends in each of `(cells, cells)` over its box, rows from the bottom and
    columns from the left: a sample of the stationary distribution. The sum is 1; other arguments are as of
    `trajectories`.

    Each transition is spread evenly over the cells that it crosses, and the result is blurred by a Gaussian with a
    variance of one cell (section 6.3 of the thesis); no share leaves the box.
    """
    check_arguments(occupancy, locals())
    from scipy.ndimage import gaussian_filter

    check(isinstance(cells, int) and 1 <= cells <= 10_000, "cells", cells, "from 1 to 10,000 along each side")
    track, _ = _simulate(task, policy, episodes, seed, decisions)
    (left, right), (bottom, top) = task.physics.walls.spans
    places = (track - np.array((left, bottom))) / np.array((right - left, top - bottom)) * cells
    went = np.isfinite(places[1:, :, 0])
    before = places[:-1][went]
    after = places[1:][went]
    # sample points at most half a cell apart
    points = max(1, int(np.ceil(2 * np.abs(after - before).max())))
    counts = np.zeros(cells * cells)
    for point in range(points):
        at = before + (after - before) * ((point + 0.5) / points)
        column, row = np.clip(at.astype(int), 0, cells - 1).T
        counts += np.bincount(row * cells + column, minlength=cells * cells)
    blurred = gaussian_filter(counts.reshape(cells, cells), sigma=1.0, mode="reflect")
    return blurred / blurred.sum()


def _simulate(
    task: ParticleTask, policy: Policy, episodes: int, seed: int, decisions: int
) -> tuple[Float[np.ndarray, "decisions+1 episodes 2"], np.ndarray]:
    """Positions, NaN after the end of each episode, and the number of decisions of each."""
    check(isinstance(episodes, int | np.integer) and episodes >= 1, "episodes", episodes, "a positive integer")
    check(isinstance(decisions, int | np.integer) and decisions >= 1, "decisions", decisions, "a positive integer")
    sizes = (policy.observation_size, policy.outputs)
    fits = sizes == (task.observation_size, task.action_size)
    check(fits, "policy", sizes, f"of {task.observation_size} inputs and {task.action_size} units, as the task")
    longest = min(decisions, task.episode_limit or decisions)
    track, lengths = _compiled_episodes(task, episodes, longest)(policy, seed)
    return np.asarray(track, float), np.asarray(lengths)


@functools.lru_cache(maxsize=32)
def _compiled_episodes(task: ParticleTask, episodes: int, longest: int) -> Any:
    """The compiled simulation of a number of episodes. It stops when the last one ends."""
    import jax
    import jax.numpy as jnp

    world = task.dynamics

    def walk(policy: Policy, seed: Int[Array, ""]) -> tuple[Any, Any]:
        starts, moves = jax.random.split(jax.random.key(seed))
        numbers = functools.partial(_uniforms, episodes=episodes)
        first = numbers(starts, (world.reset_uniforms, task.init_uniforms, task.uniforms))
        state = jax.vmap(world.reset)(first[0])
        memory, seen = jax.vmap(task.observe)(jax.vmap(task.init)(first[1]), state, first[2])
        track = jnp.full((longest + 1, episodes, 2), jnp.nan).at[0].set(state.position)
        sizes = (policy.uniforms, world.uniforms, task.uniforms)

        def decide(
            memory: PyTree, state: ParticleState, seen: Array, kept: PyTree, choose: Array, move: Array, uniforms: Array
        ) -> Any:
            units = abilities.observation_with_memory(policy, kept, seen)
            drawn = policy.sample(units, choose)
            kept = abilities.remember(policy, units, drawn)
            action = abilities.task_action(policy, drawn)
            state = world.step(state, action, move)
            memory, _, terminated = task.reward(memory, state, action)
            ended = jnp.logical_or(terminated, task.truncated(memory, state))
            return *task.observe(memory, state, uniforms), kept, state, ended

        def step(carry: tuple[Any, ...]) -> Any:
            t, memory, state, seen, kept, alive, lengths, track = carry
            drawn = numbers(jax.random.fold_in(moves, t), sizes)
            memory, seen, kept, state, ended = jax.vmap(decide)(memory, state, seen, kept, *drawn)
            track = track.at[t + 1].set(jnp.where(alive[:, None], state.position, jnp.nan))
            return t + 1, memory, state, seen, kept, alive & ~ended, lengths + alive, track

        alive = jnp.ones(episodes, bool)
        lengths = jnp.zeros(episodes, jnp.int32)
        kept = jax.tree.map(
            lambda leaf: jnp.broadcast_to(leaf, (episodes, *leaf.shape)), abilities.initial_memory(policy)
        )
        carry = (0, memory, state, seen, kept, alive, lengths, track)
        carry = jax.lax.while_loop(lambda c: (c[0] < longest) & c[5].any(), step, carry)
        return carry[-1], carry[-2]

    return jax.jit(walk)


def _uniforms(key: Array, sizes: tuple[int, ...], episodes: int) -> list[Any]:
    """Numbers from U[0, 1) for every episode, `(episodes, size)` for each size."""
    import jax

    keys = jax.random.split(key, len(sizes))
    return [jax.random.uniform(each, (episodes, size)) for each, size in zip(keys, sizes, strict=True)]
