r"""Stream-AC(λ): actor and critic with hidden layers that learn from every decision, and store none (Elsayed, Vasan &
Mahmood, 2024).

$$z \leftarrow \gamma\lambda z + \nabla\log\pi + \kappa\,\operatorname{sign}(\delta)\,\nabla H,\qquad
\theta \leftarrow \theta + \frac{\delta z}{\max(1, \kappa_\pi \max(|\delta|, 1)\,\lVert z\rVert_1)}$$

The learner is `Agent`, with an `OvershootingBound`.
"""

from typing import Any

from motorgrad.learning.algorithms._presets import DISCOUNT, Learnable, PolicyTable, behind_layers, preset


@preset("stream-ac", "learning from every decision once, storing none")
def stream_ac(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Stream-AC(λ) (Elsayed, Vasan & Mahmood, 2024): two networks that learn from every decision, once.

    Policy and critic have two hidden layers of 128 units each, with layer normalisation, leaky rectifiers and sparse
    initial weights. Both see inputs relative to their running mean and deviation. Rewards are divided by the deviation
    of their discounted sum. Both have traces of $\gamma\lambda = 0.99 \cdot 0.8$, and steps bounded so that they do not
    overshoot; entropy is favoured within the trace. It stores no decision. Its numbers are those of the paper for all
    tasks: nothing scales with the `steps`. Unlike in the paper, output units start at 0, and values are bootstrapped
    where an episode was truncated. The kind of policy is that of `natural_network`.

    **Arguments**, **Returns** and **Raises:** as `natural`.

    ```python
    task = mg.tasks.from_gymnasium("CartPole-v1")
    run = mg.train(task, mg.presets.stream_ac(task), steps=50_000, seeds=10)
    ```
    """
    decay = 0.8
    network = {"hidden": [128, 128], "standardise": True}
    return {
        "policy": behind_layers(task, network, policy),
        "estimator": {
            "trace": {"kind": "exponential", "decay": DISCOUNT * decay},
            "baseline": {
                "kind": "network-critic",
                "discount": DISCOUNT,
                "decay": decay,
                "network": network,
                "fit": {"kind": "bounded-td", "scaling": 2.0},
            },
            "entropy": 0.01,
            "entropy_in": "trace",
            "reward_scaling": {"discount": DISCOUNT},
            "bound": {"kind": "overshooting", "scaling": 3.0},
        },
        "optimizer": {"kind": "sgd", "learning_rate": 1.0},
    }
