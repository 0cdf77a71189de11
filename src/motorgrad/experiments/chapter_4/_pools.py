"""What experiments with pools of motoneurons ask of what was learnt."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.policies import Motoneurons, Policy, grow
from motorgrad.tasks import LinearRecruitment
from motorgrad.training import Run

NATURAL = {"metric": "fisher", "metric_rate": 3e-4, "rate": 1e-4, "rates": None, "dampings": {"threshold": 0.05}}
"""The natural gradient for loads from 0 to 1, as on the page about it: where the plain one would take too long."""
NORMAL: dict[str, Any] = {
    "metric": "fisher",
    "metric_rate": 3e-4,
    "dampings": {"threshold": 0.05, "gain": 1e-6},
    "baseline": "binned",
    "baseline_bins": 64,
    "baseline_rate": 0.02,
    "advantages": "normalised",
    "rate": 1e-3,
}
"""What learns pools of any size: the natural step with a baseline that sees the load, advantages in units of their own
spread, and a little damping of the gain too."""
LOADS = 200  # at which the force is looked at, in the middles of as many cells


def firing(policies: Policy, loads: Any) -> np.ndarray:
    """The probability with which each unit fires at each load, `(seeds, loads, units)`; policies lead."""
    seen = jnp.asarray(loads, jnp.float32)[:, None]
    return np.asarray(jax.vmap(lambda policy: jax.vmap(policy.prob)(seen))(policies))


def entropy(threshold: Any, gain: Any, loads: Any) -> np.ndarray:
    """Entropy of the action, in bits for each unit, averaged over the loads: 1 where chance alone decides.

    **Arguments:** `threshold` and `gain`, `(…, units)`; `loads`. **Returns:** `(…)`.
    """
    seen = jnp.asarray(loads, jnp.float32)[:, None]

    def of(pool: Motoneurons) -> jax.Array:
        return jax.vmap(pool.entropy)(seen).mean() / (pool.outputs * jnp.log(2.0))

    return _of_each(of, threshold, gain)


def force_error(threshold: Any, gain: Any, task: LinearRecruitment) -> np.ndarray:
    """The root mean square error of the force, as a ratio, over loads that are all as frequent. It is
    exact: no action is drawn.

    **Arguments:** `threshold` and `gain`, `(…, units)`; the task. **Returns:** `(…)`.
    """
    loads = task.low + (task.high - task.low) * (jnp.arange(LOADS) + 0.5) / LOADS
    sizes = jnp.asarray(task.sizes, jnp.float32)

    def of(pool: Motoneurons) -> jax.Array:
        fires = jax.vmap(pool.prob)(loads[:, None])
        bias = (fires * sizes).sum(-1) - task.target(loads)
        noise = (fires * (1 - fires) * sizes**2).sum(-1)
        return jnp.sqrt(jnp.mean(bias**2 + noise))

    return _of_each(of, threshold, gain)


def _of_each(function: Callable[[Motoneurons], jax.Array], threshold: Any, gain: Any) -> np.ndarray:
    """A number for every pool, whatever axes lead."""
    parts = [jnp.asarray(part, jnp.float32).reshape(-1, np.shape(part)[-1]) for part in (threshold, gain)]
    found = jax.jit(jax.vmap(lambda threshold, gain: function(Motoneurons(threshold, gain))))(*parts)
    return np.asarray(found).reshape(np.shape(threshold)[:-1])


def numbers(policies: Policy) -> tuple[np.ndarray, np.ndarray]:
    """Thresholds and gains, `(seeds, units)` each, of pools of motoneurons."""
    assert isinstance(policies, Motoneurons)
    return np.asarray(policies.threshold), np.asarray(policies.gain)


def parameters(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Thresholds and gains at every record, `(seeds, records, units)` each."""
    threshold, gain = history(run, 2)
    return threshold, gain


def history(run: Run, fields: int) -> np.ndarray:
    """All parameters at every record, `(fields, seeds, records, units)`, of units with so many each."""
    rows = np.stack(run.metrics["parameters"].to_pylist())
    return rows.reshape(-1, len(run.seeds), fields, rows.shape[1] // fields).transpose(2, 1, 0, 3)


def with_another(pools: Policy, threshold: Any, gain: float = 0.0) -> Motoneurons:
    """The pools of all seeds, each with one more unit; its threshold is one number, or one for each seed."""
    thresholds = jnp.broadcast_to(jnp.asarray(threshold, jnp.float32), jax.tree.leaves(pools)[0].shape[:1])
    grown = jax.vmap(lambda pool, at: grow(pool, Motoneurons(at[None], jnp.full(1, gain))))(pools, thresholds)
    assert isinstance(grown, Motoneurons)
    return grown


def least_error(task: LinearRecruitment, strength: float = 1.0) -> float:
    """The mean error of the force, as a ratio, of equal units without noise with the best number of them at each load;
    for a muscle so strong."""
    loads = task.low + (task.high - task.low) * (np.arange(20_000) + 0.5) / 20_000
    parts = np.arange(task.units + 1) / task.units
    return float(np.abs(strength * parts - task.target(loads)[:, None]).min(axis=1).mean())
