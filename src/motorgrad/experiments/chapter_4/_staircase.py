"""How well pools of motoneurons lift all loads, and when something happened first."""

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.policies import Motoneurons
from motorgrad.tasks import LinearRecruitment

LOADS = 200  # at which the force is looked at, in the middles of as many cells


def force_error(threshold: np.ndarray, gain: np.ndarray, task: LinearRecruitment) -> np.ndarray:
    """The root mean square error of the force, as a ratio, over loads that are all as frequent. It is
    exact: no action is drawn.

    **Arguments:** `threshold` and `gain`, `(…, units)`; the task. **Returns:** `(…)`.
    """
    loads = task.low + (task.high - task.low) * (jnp.arange(LOADS) + 0.5) / LOADS
    sizes = jnp.asarray(task.sizes, jnp.float32)

    def of(threshold: jax.Array, gain: jax.Array) -> jax.Array:
        fires = jax.vmap(Motoneurons(threshold, gain).prob)(loads[:, None])
        bias = (fires * sizes).sum(-1) - task.target(loads)
        noise = (fires * (1 - fires) * sizes**2).sum(-1)
        return jnp.sqrt(jnp.mean(bias**2 + noise))

    parts = [jnp.asarray(part, jnp.float32).reshape(-1, part.shape[-1]) for part in (threshold, gain)]
    return np.asarray(jax.jit(jax.vmap(of))(*parts)).reshape(threshold.shape[:-1])


def first_time(decision: np.ndarray, happened: np.ndarray) -> np.ndarray:
    """When something happened first, NaN where it never did: `(records,)` and `(…, records)` to `(…)`."""
    return np.where(happened.any(-1), decision[happened.argmax(-1)], np.nan)
