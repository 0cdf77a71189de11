"""What experiments with pools of motoneurons ask of what was learnt."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.policies import Motoneurons, Policy
from motorgrad.tasks import LinearRecruitment
from motorgrad.training import Run

NATURAL = {"metric": "fisher", "metric_rate": 3e-4, "rate": 1e-4, "rates": None, "dampings": {"threshold": 0.05}}
"""The natural gradient for loads from 0 to 1, as on the page about it: where the plain one would take too long."""


def firing(policies: Policy, loads: Any) -> np.ndarray:
    """The probability with which each unit fires at each load, `(seeds, loads, units)`; policies lead."""
    seen = jnp.asarray(loads, jnp.float32)[:, None]
    return np.asarray(jax.vmap(lambda policy: jax.vmap(policy.prob)(seen))(policies))


def entropy(threshold: Any, gain: Any, loads: Any) -> np.ndarray:
    """Entropy of the action, in bits for each unit, averaged over the loads: 1 where chance alone decides.

    **Arguments:** `threshold` and `gain`, `(…, units)`; `loads`. **Returns:** `(…)`.
    """
    seen = jnp.asarray(loads, jnp.float32)[:, None]

    def of(threshold: jax.Array, gain: jax.Array) -> jax.Array:
        return jax.vmap(Motoneurons(threshold, gain).entropy)(seen).mean() / (threshold.shape[0] * jnp.log(2.0))

    parts = [jnp.asarray(part, jnp.float32).reshape(-1, np.shape(part)[-1]) for part in (threshold, gain)]
    return np.asarray(jax.vmap(of)(*parts)).reshape(np.shape(threshold)[:-1])


def numbers(policies: Policy) -> tuple[np.ndarray, np.ndarray]:
    """Thresholds and gains, `(seeds, units)` each, of pools of motoneurons."""
    assert isinstance(policies, Motoneurons)
    return np.asarray(policies.threshold), np.asarray(policies.gain)


def parameters(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Thresholds and gains at every record, `(seeds, records, units)` each."""
    rows = np.stack(run.metrics["parameters"].to_pylist())
    both = rows.reshape(-1, len(run.seeds), 2, rows.shape[1] // 2).transpose(2, 1, 0, 3)
    return both[0], both[1]


def final(run: Run, quantity: str, share: float = 0.25) -> np.ndarray:
    """The mean of a quantity over the last part of training, for each seed."""
    values = run.curve(quantity)[1]
    return values[:, -max(1, round(share * values.shape[1])) :].mean(axis=1)


def least_error(task: LinearRecruitment, strength: float) -> float:
    """The mean error of the force, as a ratio, with the best number of units at each load, for a muscle so strong."""
    loads, parts = np.linspace(task.low, task.high, 2001), np.arange(task.units + 1) / task.units
    return float(np.abs(strength * parts - task.target(loads)[:, None]).min(axis=1).mean())
