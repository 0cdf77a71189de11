"""The policy that acts, put together again from the flat parameters of a snapshot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from motorgrad.policies import Policy
    from motorgrad.sim.live import Session


class PresentPolicy:
    """The policy of a session at any moment.

    What is not learnt is taken from the policy with which the run began.
    """

    def __init__(self, session: Session) -> None:
        assert session.agent is not None
        import jax
        from jax.flatten_util import ravel_pytree

        from motorgrad.policies import split

        given = session.setup.initial
        if given is None:
            whole = session.agent.init(jax.random.key(session.setup.seed)).policy
        else:
            whole = jax.tree.map(lambda leaf: leaf[0], given)
        learnt, self._fixed = split(whole)
        self._size = ravel_pytree(learnt)[0].size
        self._unravel = ravel_pytree(learnt)[1]

    def of(self, parameters: np.ndarray) -> Policy | None:
        """The policy with these parameters `(parameters,)`; None where it has grown since the run began."""
        import equinox as eqx
        import jax.numpy as jnp

        if parameters.shape != (self._size,):
            return None
        return eqx.combine(self._unravel(jnp.asarray(parameters, jnp.result_type(float))), self._fixed)


def weights_of(policy: Any) -> np.ndarray | None:
    """Weights `(units, inputs + 1)`, the last column the biases, of pools that have such; None of others."""
    pools = getattr(policy, "pools", (policy,))
    rows = []
    for pool in pools:
        weights = getattr(pool, "weights", None)
        if getattr(weights, "shape", None) != (pool.outputs, pool.inputs):
            return None
        bias = getattr(pool, "bias", None)
        bias = np.zeros(pool.outputs) if bias is None else np.asarray(bias, float)
        rows.append(np.concatenate([np.asarray(weights, float), bias[:, None]], axis=1))
    return np.concatenate(rows)
