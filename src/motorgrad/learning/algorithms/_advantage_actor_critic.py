r"""Advantage actor-critic, A2C (Mnih et al., 2016): the policy gradient with traces, in batches, with a fitted critic.

$$\theta \leftarrow \theta + \frac{\alpha}{n} \sum_t \delta_t z_t,\qquad
z_t = \gamma\lambda z_{t-1} + \nabla\log\pi(a_t \mid y_t),\qquad
\delta_t = r_{t+1} + \gamma v(y_{t+1}) - v(y_t)$$

The sum over a batch of errors times traces is that of generalised advantages times scores (Schulman et al., 2016), but
for those decisions whose consequences reach into the next batch. The learner is `Agent`.
"""

from typing import Any

from motorgrad.learning.algorithms._presets import Learnable, PolicyTable, fitted_returns, in_batches, preset


@preset("a2c", "comparison: batches of a few decisions")
def a2c(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Advantage actor-critic (Mnih et al., 2016): for every 64 decisions, Adam makes a step of policy and of critic.

    Networks, scaled rewards and standardised inputs are those of `ppo`; a nat of entropy is worth 0.01 scaled rewards.

    **Arguments**, **Returns** and **Raises:** as `natural`.
    """
    fit = fitted_returns(64, passes=1, learning_rate=2e-3)
    table = in_batches(task, policy, batch=64, decay=0.95, fit=fit, entropy=0.01)
    return {**table, "optimizer": {"kind": "adam", "learning_rate": 2e-3}}
