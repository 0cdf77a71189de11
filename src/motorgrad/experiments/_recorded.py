"""The policies of a run as they were while it learnt, from its records."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Float, Int

from motorgrad._errors import check
from motorgrad.policies import Masked, Policy, split
from motorgrad.training import Run


def recorded(run: Run, records: Sequence[int] | Int[np.ndarray, " _"], seed: int | None = None) -> Any:
    """The policies as they were at some records, along a leading axis; of one seed, or of all along a second axis.

    **Arguments:** `run`; `records`, by number from 0, or from the end if negative; `seed`.
    """
    count, seeds = len(run.seeds), run.seeds if seed is None else [seed]
    check(set(seeds) <= set(run.seeds), "seed", seed, f"one of the run's seeds, {', '.join(map(str, run.seeds))}")
    rows, which = np.array([run.seeds.index(each) for each in seeds]), np.asarray(records, int)
    total = run.metrics.num_rows // count
    inside = bool(np.all((-total <= which) & (which < total)))
    check(inside, "records", which.tolist(), f"of the {total} that the run has")
    column = run.metrics["parameters"].combine_chunks()
    numbers = column.flatten().to_numpy().reshape(total, count, -1)[which][:, rows]
    initial = jax.tree.map(lambda leaf: jnp.asarray(leaf[rows]), run.initial)
    policies: Any = jax.vmap(jax.vmap(_with), (None, 0))(initial, jnp.asarray(numbers))
    if "units" in run.metrics.column_names:
        policies = _switched(policies, run.curve("units")[1][rows][:, which].T)
    return policies if seed is None else jax.tree.map(lambda leaf: leaf[:, 0], policies)


def _with(policy: Policy, numbers: Float[jax.Array, " parameters"]) -> Policy:
    """A policy with other parameters."""
    learnt, fixed = split(policy)
    return eqx.combine(ravel_pytree(learnt)[1](numbers), fixed)


def _switched(policies: Masked, units: Float[np.ndarray, "records seeds"]) -> Masked:
    """Growing pools with so many units: growth switches on the first unit that is off."""
    start = np.asarray(policies.active)
    place_in_queue = np.cumsum(~start, axis=-1) * ~start
    active = place_in_queue <= (units - start.sum(-1))[..., None]
    return eqx.tree_at(lambda each: each.active, policies, jnp.asarray(active))
