r"""The natural actor-critic (Peters & Schaal, 2008), which learned to walk on 24 muscles.

$$\theta \leftarrow \theta + s\,(F + dI)^{-1}\,\frac1n \sum_t \Big(\frac{\delta_t}{\sigma} z_t + \kappa \nabla H\Big),
\qquad \text{with } s \le 1 \text{ such that the divergence is at most a limit}$$

The learner is `Agent`, with a least-squares critic, and with the Fisher matrix of each unit or of all parameters.
"""

import math
from typing import Any

from motorgrad._natural import natural_actor_critic
from motorgrad.learning.algorithms._presets import (
    FEATURES,
    POLICIES,
    Learnable,
    PolicyTable,
    behind_layers,
    horizon,
    preset,
)

MAX_PRODUCT_INPUTS = 40
"""Inputs of which the critic sees the products of all pairs: they are 820 then."""
NETWORK = {"kind": "perceptron", "hidden": [128, 128], "activation": "tanh", "sparsity": 0.5}
"""Hidden layers of a policy that follows the natural gradient."""


@preset("natural", "any task; the usual choice for actions that are binary or alternatives")
def natural(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""The natural actor-critic (Peters & Schaal, 2008), which learned to walk on 24 muscles, for any task.

    It is made of generalised advantages (Schulman et al., 2016) from a least-squares critic (Boyan, 2002), which are
    divided by their running root mean square; of the natural gradient of each unit, which is followed as far as a limit
    on the Kullback-Leibler divergence allows; and of the average of the last parameters. The policy is that of the
    task's own learner; or it goes with the task's actions: softmax for discrete ones, hyperplanes for binary and
    squashed normal units for graded ones. These see 128 fixed random features beside their inputs. So does the critic,
    which also sees the last action and, of up to 40 inputs, all products of two.

    What depends on the length of a training scales with it: a batch is a hundredth of the `steps`, from 100 to 1,000
    decisions. Over the training, the limit on the divergence of n units falls from 0.05 sqrt(n) to 0.005 nats, and the
    worth of a nat of entropy from 0.3 usual advantages to nothing. Averaging begins with the last eighth.
    Critic and metric have a memory of ten batches. The discount is 1 - 1/h, and the trace's decay 1 - 6/h, with a
    horizon h of half the longest episode, from 10 to 100 decisions: 0.99 and 0.94, or 0.98 and 0.88 for episodes of 100
    decisions.

    **Arguments:**

    - `task`: a task, or the name of one.
    - `steps` (decisions): length of the training, per seed.
    - `changes`, `more`: settings to be changed, by path, by short name or as parts, as in `agent_for`.

    **Returns** a `Learner`.

    **Raises:** `ValueError` as `agent_for`.

    ```python
    task = mg.tasks.from_gymnasium("CartPole-v1")
    agent = mg.presets.natural(task, steps=50_000, damping=0.02)
    run = mg.train(task, agent, steps=50_000, seeds=10)
    ```
    """
    return _natural(task, steps, policy)


@preset("natural-network", "bodies with many muscles that are on or off, where `natural` stops short of the goal")
def natural_network(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""The natural actor-critic of `natural`, whose policy has hidden layers that learn.

    It differs from `natural` in four respects. The units stand behind two layers of 128 hyperbolic tangents, layer
    norms and sparse initial weights in place of fixed features; the critic stays linear in features. The natural
    gradient is found by conjugate gradients over the decisions of a batch (`motorgrad.learning.ConjugateGradient`).
    The horizon is a fifth of the longest episode, from 10 to 100 decisions, and a nat of entropy is worth 0.1 usual
    advantages at the start.

    Choose it for bodies with many muscles, or where `natural` stops short of the goal. On small bodies a decision takes
    longer than with `natural`.

    **Arguments**, **returns** and **raises** as `natural`.

    ```python
    task = mg.tasks.myosuite("myoHandReachRandom-v0")
    agent = mg.presets.natural_network(task, steps=3_000_000)
    ```
    """
    found = _natural(task, steps, behind_layers(task, NETWORK, policy), share=1 / 5, entropy=0.1)
    batch = found["estimator"]["update_every"]
    kl = found["metric"]["kl"]
    metric = {"kind": "conjugate-gradient", "memory": batch, "iterations": 5, "damping": 0.1, "kl": kl}
    return {**found, "metric": metric}


def _natural(
    task: Learnable, steps: int, policy: PolicyTable | None = None, share: float = 1 / 2, entropy: float = 0.3
) -> dict[str, Any]:
    """The preset `natural` as a table: the natural actor-critic for any task, in proportion to a budget of `steps`
    decisions, with a horizon of a `share` of an episode."""
    batch = min(1000, max(100, steps // 100))
    ahead = horizon(task, share)
    products = task.observation_size <= MAX_PRODUCT_INPUTS
    # the divergences of independent units add
    units = 1 if task.actions == "discrete" else task.action_size
    return natural_actor_critic(
        POLICIES.get(task.actions, POLICIES["mixed"]) if policy is None else policy,
        batch=batch,
        updates=max(1, steps // batch),
        discount=1 - 1 / ahead,
        decay=1 - 6 / ahead,
        memory=10,
        features={"squares": True, "products": products, "actions": True, **FEATURES},
        damping=0.03,
        kl=(0.05 * math.sqrt(units), 0.005),
        entropy=entropy,
    )
