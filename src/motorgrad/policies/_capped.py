"""Units given by the log-probability of firing, capped where silence would be impossible."""

import abc

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad.policies._binary import BinaryUnits

CAP = 1e-6  # the closest to 1 that a probability comes, for sampling and for the score alike


class CappedUnits(BinaryUnits):
    r"""Units with a log-probability of firing $\log p_i(y)$ that may reach 0.

    $p$ is capped at $1 - 10^{-6}$, where the score is 0: of a unit that always fires the score of silence has no finite
    value. Elsewhere it is $\nabla\log p$ for firing and $-p/(1 - p)$ times that for silence (appendix A.1).
    """

    @abc.abstractmethod
    def _log_fire(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """Log-probability of firing, before the cap."""

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.minimum(jnp.exp(self._log_fire(observation)), 1 - CAP)

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        log_fire = jnp.minimum(self._log_fire(observation), jnp.log1p(-CAP))
        return jnp.where(action > 0, log_fire, jnp.log(-jnp.expm1(log_fire)))

    def _surprise(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        """d log π / d log p: 1 for firing, −p/(1 − p) for silence, 0 where p is capped."""
        log_fire = self._log_fire(observation)
        capped = log_fire >= jnp.log1p(-CAP)
        safe = jnp.where(capped, -1.0, log_fire)
        # −p/(1 − p) = 1/(1 − 1/p); with expm1 it is exact at both ends of (0, 1).
        silence = jnp.exp(safe) / jnp.expm1(safe)
        return jnp.where(capped, 0.0, jnp.where(action > 0, 1.0, silence))
