"""The natural actor-critic as a table of settings: the learner that tasks name, which know nothing of learning."""

import math
from collections.abc import Mapping
from typing import Any, Protocol

STEPS = 100_000
"""Decisions per seed of a training, unless said otherwise."""
FEATURES = {"nonlinear": 128}
"""What policy and critic see beside their inputs."""
MAX_PRODUCT_INPUTS = 40
"""Inputs of which the critic sees the products of all pairs: they are 820 then."""
POLICIES: dict[str | tuple[str, ...], dict[str, Any]] = {
    "binary": {"kind": "hyperplanes", "features": FEATURES},
    "discrete": {"kind": "softmax", "features": FEATURES},
    "continuous": {"kind": "bounded-hyperplanes", "density": "squashed", "deviation": 1.5, "features": FEATURES},
    "mixed": {"kind": "mixed", "density": "squashed", "deviation": 1.5, "features": FEATURES},
}
"""The policy for a task's kind of actions."""
PolicyTable = str | Mapping[str, Any]
"""An initial policy by the name of its kind, or as a table with its settings."""


class Learnable(Protocol):
    """The attributes of a task (`motorgrad.tasks.Task`) with which its learner goes."""

    @property
    def actions(self) -> str | tuple[str, ...]: ...
    @property
    def observation_size(self) -> int: ...
    @property
    def action_size(self) -> int: ...
    @property
    def longest_episode(self) -> int | None: ...
    @property
    def goal(self) -> object: ...


def natural_actor_critic(
    policy: PolicyTable,
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
    """The natural actor-critic as a table: generalised advantages from a least-squares critic, normalised, and steps
    along the natural gradient that change the policy by a given divergence, which is annealed.

    **Arguments:** the initial `policy`; the decisions of a `batch`, from one step of the parameters to the next; the
    number of `updates`, over which it anneals, and averages the last eighth; the critic's `discount`; the trace's
    `decay`, the discount times the lambda of generalised advantages; the `memory` of the critic's and the Fisher
    matrix's means, in batches; the `features` that the critic sees; the `damping` of the Fisher matrix; how far the
    first and the last step may change the policy (`kl`, nats); what a nat of `entropy` is worth at the start, in usual
    advantages.
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
            "update_every": batch,
            "normalization": {"rate": 1 / (10 * batch)},
            "entropy": annealed(entropy, 0.0, updates),
        },
        "metric": {"kind": "fisher", "rate": rate, "initial": 0.05, "damping": damping, "kl": annealed(*kl, updates)},
        # the step's length is that of the KL limit: the natural gradient of a batch this small is longer
        "optimizer": {"kind": "sgd", "learning_rate": 1.0},
        "averaging": {"start": updates - updates // 8},
    }


def annealed(start: float, end: float, steps: int) -> dict[str, Any]:
    """A number that moves from `start` to `end` within this number of steps of the parameters, as a table."""
    return {"kind": "annealed", "start": start, "end": end, "steps": steps}


def horizon(task: Learnable, share: float) -> float:
    """How many decisions a critic looks ahead: a `share` of an episode. What comes later hardly depends on a decision,
    but adds its noise."""
    return min(100.0, max(10.0, share * (task.longest_episode or 200)))


def natural_learner(
    task: Learnable, steps: int, policy: PolicyTable | None = None, share: float = 1 / 2, entropy: float = 0.3
) -> dict[str, Any]:
    """The preset `"natural"` as a table: the natural actor-critic for any task, in proportion to a budget of `steps`
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
