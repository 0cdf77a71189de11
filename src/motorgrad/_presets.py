"""Learners that are described once, as tables of settings, for tasks of ours and for those of others."""

import math
from collections.abc import Callable, Mapping
from typing import Any

STEPS = 100_000
"""Decisions per seed of a training, unless said otherwise."""
FEATURES = {"nonlinear": 128}
"""What policy and critic see beside their inputs."""
NETWORK = {"kind": "perceptron", "hidden": [128, 128], "activation": "tanh", "sparsity": 0.5}
"""Hidden layers of a policy."""
MOST_PRODUCTS = 40
"""Inputs up to which the critic sees the products of all pairs: they are 820 then."""
POLICIES: dict[str, dict[str, Any]] = {
    "binary": {"kind": "hyperplanes", "features": FEATURES},
    "discrete": {"kind": "softmax", "features": FEATURES},
    "graded": {"kind": "bounded-hyperplanes", "density": "squashed", "deviation": 1.5, "features": FEATURES},
    "mixed": {"kind": "mixed", "density": "squashed", "deviation": 1.5, "features": FEATURES},
}
"""The policy for a task's kind of actions."""


def natural_actor_critic(
    policy: str | Mapping[str, Any],
    *,
    batch: int,
    updates: int,
    discount: float,
    decay: float,
    memory: float,
    features: Mapping[str, Any],
    damping: float,
    kl: tuple[float, float],
    entropy: float,
) -> dict[str, Any]:
    r"""The natural actor-critic as a table: generalised advantages from a least-squares critic, normalised, and steps
    along the natural gradient that change the policy by a given divergence, which is annealed.

    **Arguments:**

    - `policy`: the initial policy.
    - `batch` (decisions): from one step of the parameters to the next.
    - `updates` (steps of the parameters): after which annealing ends; the last eighth is averaged.
    - `discount`: of the critic.
    - `decay`: of the trace: the discount times the lambda of generalised advantages.
    - `memory` (batches): of the critic's and the Fisher matrix's means.
    - `features`: what the critic sees.
    - `damping`: of the Fisher matrix.
    - `kl` (nats): how far the first and the last step may change the policy.
    - `entropy`: what a nat of entropy is worth at the start, in usual advantages; 0 at the end.
    """
    rate = 1 / (memory * batch)
    return {
        "policy": policy,
        "estimator": {
            "trace": {"kind": "exponential", "decay": decay},
            "baseline": {
                "kind": "critic",
                "features": features,
                "discount": discount,
                "fit": {"kind": "least-squares", "rate": rate, "interval": batch},
            },
            "improve": batch,
            "normalization": {"rate": 1 / (10 * batch)},
            "entropy": annealed(entropy, 0.0, updates),
        },
        "metric": {
            "kind": "fisher",
            "rate": rate,
            "initial": 0.05,
            "damping": damping,
            "kl": annealed(*kl, updates),
        },
        # the step's length is that of the KL limit: the natural gradient of a batch this small is longer
        "optimizer": {"kind": "sgd", "learning_rate": 1.0},
        "averaging": {"start": updates - updates // 8},
    }


def annealed(start: float, end: float, steps: int) -> dict[str, Any]:
    """A number that moves from `start` to `end` in so many steps of the parameters, as a table."""
    return {"kind": "annealed", "start": start, "end": end, "steps": steps}


def natural(task: Any, steps: int, policy: Any = None, share: float = 1 / 2, entropy: float = 0.3) -> dict[str, Any]:
    """The preset `"natural"`: the natural actor-critic for any task, in proportion to a budget of `steps` decisions.

    The critic looks ahead for a `share` of an episode: what comes later hardly depends on the decision, but adds its
    noise.
    """
    batch = min(1000, max(100, steps // 100))
    horizon = min(100.0, max(10.0, share * (task.longest_episode or 200)))
    products = task.observation_size <= MOST_PRODUCTS
    # the divergences of independent units add
    units = 1 if task.actions == "discrete" else task.action_size
    return natural_actor_critic(
        POLICIES.get(task.actions, POLICIES["mixed"]) if policy is None else policy,
        batch=batch,
        updates=max(1, steps // batch),
        discount=1 - 1 / horizon,
        decay=1 - 6 / horizon,
        memory=10,
        features={"squares": True, "products": products, "actions": True, **FEATURES},
        damping=0.03,
        kl=(0.05 * math.sqrt(units), 0.005),
        entropy=entropy,
    )


def natural_network(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"natural-network"`: the preset `"natural"` with hidden layers in place of the policy's features, and
    with conjugate gradients, which need no matrix of all their parameters."""
    found = natural(task, steps, policy, share=1 / 5, entropy=0.1)
    given, batch, kl = found["policy"], found["estimator"]["improve"], found["metric"]["kl"]
    kind = {"kind": given} if isinstance(given, str) else {key: given[key] for key in given if key != "features"}
    metric = {"kind": "conjugate-gradient", "memory": batch, "iterations": 5, "damping": 0.1, "kl": kl}
    return {**found, "policy": {**kind, "network": NETWORK}, "metric": metric}


PRESETS: dict[str, Callable[..., dict[str, Any]]] = {"natural": natural, "natural-network": natural_network}
"""Presets by name: functions of a task, the decisions of a training, and the task's own policy, if it has one."""
