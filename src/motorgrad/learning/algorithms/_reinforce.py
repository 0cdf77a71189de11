r"""REINFORCE with a baseline (Williams, 1992): a step for each episode.

$$\theta \leftarrow \theta + \alpha \sum_t \big(G_t - v(y_t)\big)\,\nabla\log\pi(a_t \mid y_t)$$

The sum is that of errors times a trace of decay $\gamma$, as each return $G_t$ is the sum of the later errors. The
learner is `Agent`.
"""

from typing import Any

from motorgrad.learning.algorithms._presets import Learnable, PolicyTable, in_batches, preset


@preset("reinforce", "comparison: whole episodes, without a critic that bootstraps")
def reinforce(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""REINFORCE with a baseline (Williams, 1992; Sutton & Barto, 2018): a step of Adam for each episode.

    Networks, scaled rewards and standardised inputs are those of `ppo`. The critic learns from every decision by TD(1)
    with bounded steps, so the advantages of an episode add up to its discounted returns above the values.

    **Arguments** and **Returns:** as `natural`.

    **Raises:** as `natural`; when trained, for a task without episodes.
    """
    fit = {"kind": "bounded-td", "learning_rate": 1.0, "scaling": 2.0}
    table = in_batches(task, policy, batch="episode", decay=1.0, fit=fit)
    return {**table, "optimizer": {"kind": "adam", "learning_rate": 2e-3}}
