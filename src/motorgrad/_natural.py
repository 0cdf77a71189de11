"""The natural actor-critic as a table of settings: the learner that walks on 24 muscles, which tasks name that know
nothing of learning."""

from collections.abc import Mapping
from typing import Any


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
