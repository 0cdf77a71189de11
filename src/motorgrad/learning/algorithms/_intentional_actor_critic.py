r"""Intentional actor-critic (Sharifnassab et al., 2026): steps of a given size in what they change, not in parameters.

The learner is `Agent`, with an `IntentionalStep`, which has the rule.
"""

from typing import Any

from motorgrad.learning.algorithms._presets import Learnable, PolicyTable, preset
from motorgrad.learning.algorithms._stream_actor_critic import stream_ac


@preset("intentional-ac", "learning from every decision once, with steps of an intended effect")
def intentional_ac(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Intentional actor-critic (Sharifnassab et al., 2026): two networks whose steps have a given size in the output.

    Networks, inputs, discount, traces and entropy are those of `stream_ac`. Every step of the critic takes back half of
    its error. Advantages are divided by their running root mean square; one of usual size changes the logarithm of the
    policy by 0.05. So rewards need no scaling. As nothing but the abstract of the paper was at hand, how traces enter
    the size of a step was derived anew: see `motorgrad.learning.IntentionalStep`.

    **Arguments**, **Returns** and **Raises:** as `natural`.

    ```python
    agent = mg.presets.intentional_ac("hopper", changes={"estimator.bound.change": 0.02})
    ```
    """
    table = stream_ac(task, steps, policy)
    own = table["estimator"]
    critic = table["estimator"]["baseline"]
    estimator = {
        **own,
        "baseline": {**critic, "fit": {"kind": "intentional-td", "fraction": 0.5}},
        "normalization": {"rate": 1 / 400},  # no advantage counts as more than 20
        "reward_scaling": None,
        "bound": {"kind": "intentional", "change": 0.05},
    }
    return {**table, "estimator": estimator}
