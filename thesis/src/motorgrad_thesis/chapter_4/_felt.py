"""Exact rewards of pools that feel a load on the arm, and the best that what they feel allows."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.policies import Policy
from motorgrad.tasks import ArmRecruitment
from motorgrad_thesis._experiment import Values
from motorgrad_thesis.chapter_4._pools import count_chances, firing_probability
from motorgrad_thesis.chapter_4.figure_4_7 import rewards

LOADS = 1601  # spread evenly over the sweep
STRAINS = 1201  # at which policies are evaluated
TAIL = 6.0  # of the noise, in standard deviations
CLOSE = 1e-4  # of the full lift: heights that are told apart


def strained(task: ArmRecruitment, policies: Policy) -> Values:
    """Pools that feel one noisy strain, `(seeds, …)`: exact `reward`, and mean `activation` at each load.

    Also what the best number of active units for every strain earns, `best`, from the posterior of the load: that
    number, `best count`, over the strains `felt`; its mean activation at each load, `best activation`; and the strains
    from which on it calls for one, two … units, `best threshold`.
    """
    loads = np.linspace(task.low, task.high, LOADS)
    counts = np.arange(task.units + 1)
    paid = rewards(task, loads, counts / task.units).T
    strain = strains(task, loads)
    felt = np.linspace(strain[0] - TAIL * task.noise, strain[-1] + TAIL * task.noise, STRAINS)
    chance = np.exp(-0.5 * ((felt - strain[:, None]) / task.noise) ** 2)
    chance /= chance.sum(1, keepdims=True)
    worth = chance.T @ paid / len(loads)  # of each number, times the chance of the strain
    fires = firing_probability(policies, felt)
    best = worth.argmax(1)
    return {
        "reward": (count_chances(fires) * worth).sum((1, 2)),
        "activation": fires.mean(2) @ chance.T,
        "best": np.array(worth.max(1).sum()),
        "best activation": chance @ best / task.units,
        "best threshold": np.array([felt[best >= count].min() for count in counts[1:]]),
        "felt": felt,
        "best count": best,
    }


def strains(task: ArmRecruitment, loads: np.ndarray) -> np.ndarray:
    """The strain of every load without its noise, whose median is 0: `(loads,)`, in %."""

    def felt(load: jax.Array) -> jax.Array:
        return task.observe(task.init(jnp.zeros(0)), load, jnp.full(1, 0.5))[1][0]

    return np.asarray(jax.vmap(felt)(jnp.asarray(loads, jnp.float32)), float)


def lifted(task: ArmRecruitment, policies: Policy) -> Values:
    """Pools that feel their last lift of a load, `(seeds, …)`: exact `reward`, `by attempt`, and mean `activation` over
    the attempts at each load; and `best`, what a pool earns that uses all attempts at a load in the best way, which no
    pool that knows only the last one can exceed."""
    loads = np.linspace(task.low, task.high, LOADS)
    part = np.arange(task.units + 1) / task.units
    paid = rewards(task, loads, part).T
    height = heights(task, loads)
    seen = np.stack([height, np.broadcast_to(part, height.shape)], -1).reshape(-1, 2)
    seen = jnp.asarray(np.concatenate([np.zeros((1, 2)), seen]), jnp.float32)  # before the first attempt, and after
    fires = np.asarray(jax.vmap(lambda policy: jax.vmap(policy.prob)(seen))(policies), float)
    chances = count_chances(fires)
    first = np.repeat(chances[:, :1], len(loads), 1)  # (seeds, loads, counts)
    further = chances[:, 1:].reshape(len(fires), len(loads), len(part), len(part))
    now = first
    each = []
    for _ in range(task.attempts):
        each.append(now)
        now = np.einsum("sln,slnm->slm", now, further)
    earned = np.stack([(chance * paid).sum(2).mean(1) for chance in each], 1)
    return {
        "reward": earned.mean(1),
        "by attempt": earned,
        "activation": np.mean(each, 0) @ part,
        "best": np.array(best_of_lifts(paid, height, task.attempts)),
    }


def blind(task: ArmRecruitment, policies: Policy) -> Values:
    """Pools that sense a constant 0, `(seeds, …)`: exact `reward`, mean `activation` at each load, and what the `best`
    number of active units for all loads earns."""
    loads = np.linspace(task.low, task.high, LOADS)
    paid = rewards(task, loads, np.arange(task.units + 1) / task.units).mean(1)
    fires = firing_probability(policies, [0.0])
    return {
        "reward": count_chances(fires)[:, 0] @ paid,
        "activation": np.repeat(fires.mean(2), LOADS, 1),
        "best": np.array(paid.max()),
    }


def heights(task: ArmRecruitment, loads: np.ndarray) -> np.ndarray:
    """The height, as a fraction of the full lift, to which each number of active units lifts each load, `(loads,
    counts)`."""
    ratio = jnp.arange(task.units + 1) / task.units
    return np.asarray(task.effect(jnp.asarray(loads)[:, None], ratio[None]), float) / task.scale


def best_of_lifts(paid: np.ndarray, height: np.ndarray, attempts: int) -> float:
    """The mean reward over equally likely loads of the best attempts, each of which may depend on all before it.

    A lift tells apart the loads of different heights, so that after it the load is known up to one of these classes;
    the best numbers follow by recursion over classes.

    **Arguments:** `paid` and `height`, (loads, counts) each; the number of attempts.
    """
    kind = np.round(height / CLOSE).astype(int)

    @functools.cache
    def worth(left: int, rows: tuple[int, ...]) -> float:
        if left == 0:
            return 0.0
        here = paid[list(rows)]
        if len(rows) == 1:
            return left * float(here.max())
        found = []
        for count in range(paid.shape[1]):
            classes: dict[int, list[int]] = {}
            for row in rows:
                classes.setdefault(kind[row, count], []).append(row)
            # a lift that tells nothing is worth it only for its reward
            if len(classes) > 1 or count == here.sum(0).argmax():
                later = sum(worth(left - 1, tuple(each)) for each in classes.values())
                found.append(float(here[:, count].sum()) + later)
        return max(found)

    return worth(attempts, tuple(range(len(paid)))) / attempts / len(paid)
