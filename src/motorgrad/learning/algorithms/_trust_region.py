r"""Trust region policy optimisation, TRPO (Schulman et al., 2015), without its line search.

$$\theta \leftarrow \theta + s\,x,\qquad (F + dI)\,x = \frac1n \sum_t \delta_t z_t,\qquad
\tfrac12 s^2\,x'Fx = \text{kl}$$

The learner is `Agent`, with a `ConjugateGradient` metric.
"""

from typing import Any

from motorgrad.learning.algorithms._presets import (
    Learnable,
    PolicyTable,
    fitted_returns,
    in_batches,
    large_batch,
    preset,
)


@preset("trpo", "comparison: batches, with a limit on the change of the policy")
def trpo(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Trust region policy optimisation (Schulman et al., 2015) without its line search: natural steps of 0.01 nats.

    Networks, critic, batches and advantages are those of `ppo`. The natural gradient is that of ten conjugate gradients
    with damping 0.1. Every step has the length of the limit.

    **Arguments**, **Returns** and **Raises:** as `natural`.
    """
    batch = large_batch(steps)
    fit = fitted_returns(batch, passes=40, learning_rate=1e-3)
    scale = {"rate": 1 / batch}
    table = in_batches(task, policy, batch=batch, decay=0.95, fit=fit, normalization=scale)
    metric = {"kind": "conjugate-gradient", "memory": batch, "iterations": 10, "damping": 0.1, "kl": 0.01}
    # far beyond the limit, which is therefore the length of every step
    return {**table, "metric": metric, "optimizer": {"kind": "sgd", "learning_rate": 100.0}}
