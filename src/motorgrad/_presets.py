"""Learners described once, as tables of settings, for tasks of the library and of others."""

import math
from collections.abc import Callable, Mapping
from typing import Any

STEPS = 100_000
"""Decisions per seed of a training, unless said otherwise."""
FEATURES = {"nonlinear": 128}
"""What policy and critic see beside their inputs."""
NETWORK = {"kind": "perceptron", "hidden": [128, 128], "activation": "tanh", "sparsity": 0.5}
"""Hidden layers of a policy that follows the natural gradient."""
SMALL = {"hidden": [64, 64], "activation": "tanh", "layer_norm": False, "sparsity": 0.0, "standardise": True}
"""Hidden layers of policy and critic of batch methods."""
DISCOUNT = 0.99
"""Of the critics with hidden layers, and of the sum by which their rewards are scaled."""
MAX_REPLAY_CAPACITY = 300_000
"""Observations that a learner with replay keeps."""
MAX_PRODUCT_INPUTS = 40
"""Inputs of which the critic sees the products of all pairs: they are 820 then."""
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
    - `batch` (decisions): number of decisions from one step of the parameters to the next.
    - `updates` (steps of the parameters): end of annealing; the last eighth is averaged.
    - `discount`: discount of the critic.
    - `decay`: decay of the trace: the discount times the lambda of generalised advantages.
    - `memory` (batches): memory of the critic's and the Fisher matrix's means.
    - `features`: what the critic sees.
    - `damping`: damping of the Fisher matrix.
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
    """A number that moves from `start` to `end` within this number of steps of the parameters, as a table."""
    return {"kind": "annealed", "start": start, "end": end, "steps": steps}


def horizon(task: Any, share: float) -> float:
    """How many decisions a critic looks ahead: a `share` of an episode. What comes later hardly depends on a decision,
    but adds its noise."""
    return min(100.0, max(10.0, share * (task.longest_episode or 200)))


def natural(task: Any, steps: int, policy: Any = None, share: float = 1 / 2, entropy: float = 0.3) -> dict[str, Any]:
    """The preset `"natural"`: the natural actor-critic for any task, in proportion to a budget of `steps` decisions,
    with a horizon of a `share` of an episode."""
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


def behind_layers(task: Any, network: Mapping[str, Any], policy: Any = None) -> dict[str, Any]:
    """A policy that sees the output of hidden layers in place of fixed features: `policy`, or that for the task's kind
    of actions. One that takes no layers is refused when it is made."""
    given = POLICIES.get(task.actions, POLICIES["mixed"]) if policy is None else policy
    kept = {"kind": given} if isinstance(given, str) else {key: given[key] for key in given if key != "features"}
    return {**kept, "network": network}


def natural_network(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"natural-network"`: the preset `"natural"` with hidden layers in place of the policy's features, and
    with conjugate gradients, which need no matrix of all their parameters."""
    found = natural(task, steps, behind_layers(task, NETWORK, policy), share=1 / 5, entropy=0.1)
    batch = found["estimator"]["improve"]
    kl = found["metric"]["kl"]
    metric = {"kind": "conjugate-gradient", "memory": batch, "iterations": 5, "damping": 0.1, "kl": kl}
    return {**found, "metric": metric}


def stream_actor_critic(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"stream-ac"`: stream-AC(lambda) with the numbers of its paper, which scale with nothing."""
    del steps
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


def intentional_actor_critic(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"intentional-ac"`: the streaming learner with steps of a given size in the output."""
    table = stream_actor_critic(task, steps, policy)
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


def action_value_gradient(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"avg"`: the gradient of an action's value, learned from every decision."""
    del steps
    network = {"hidden": [256, 256], "layer_norm": False, "sparsity": 0.0, "standardise": True, "unit_length": True}
    return {
        "policy": behind_layers(task, network, policy),
        "estimator": {
            "kind": "action-value-gradient",
            "values": {"discount": DISCOUNT, "learning_rate": 1e-3, "network": network},
            "entropy": 0.05,
            "reward_scaling": {"discount": DISCOUNT},
        },
        "optimizer": {"kind": "adam", "learning_rate": 3e-4, "b1": 0.0},
    }


def soft_actor_critic(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"sac"`: the gradient of an action's value, learned from experience of any age, and in hindsight where
    the task has a goal. Noise that lasts a little explores."""
    ahead = horizon(task, 1 / 5)
    network = {"hidden": [128, 128], "activation": "relu", "sparsity": 0.0, "standardise": True}
    own = behind_layers(task, network, policy)
    if own["kind"] in ("bounded-hyperplanes", "graded-hyperplanes"):
        # The filter of noise that lasts as long as that of "ppo-short-horizon" would delay actions, and a limb would
        # swing about its target in place of holding it (docs/myosuite.md).
        own = {**own, "deviation": 0.5, "floor": 0.3, "autocorrelation": max(0.0, 1 - 15 / ahead)}
    hindsight = {"kind": "hindsight", "share": 2 / 3, "ahead": ahead, "others": 0.5}
    start = 1_000
    every = 40
    batches = 10
    updates, last = (decisions // every * batches for decisions in (max(0, steps - start), steps // 8))
    return {
        "policy": own,
        "estimator": {
            "kind": "soft-actor-critic",
            "improve": every,
            "values": {"discount": 1 - 1 / ahead, "network": network},
            "replay": {
                "capacity": min(MAX_REPLAY_CAPACITY, max(1_000, 5 * steps // 4)),
                "start": start,
                "updates": batches,
                "hindsight": None if task.hindsight is None else hindsight,
            },
            "reward_scaling": {"discount": 1 - 1 / ahead},
        },
        "optimizer": {"kind": "adam", "learning_rate": 5e-4},
        "averaging": {"start": max(0, updates - last)},
    }


def batch_actor_critic(
    task: Any,
    policy: Any,
    *,
    batch: int | str,
    decay: float,
    fit: Mapping[str, Any],
    discount: float = DISCOUNT,
    **estimator: Any,
) -> dict[str, Any]:
    """A batch method as a table: networks, scaled rewards, and generalised advantages from a critic.

    **Arguments:**

    - `task`, `policy`: as of a preset.
    - `batch` (decisions): number of decisions between two updates of the policy.
    - `decay`: the lambda of critic and advantages.
    - `fit`: how the critic learns.
    - `discount`: discount of the critic, and of the sum by which rewards are scaled.
    - `estimator`: further settings of the estimator.
    """
    return {
        "policy": behind_layers(task, SMALL, policy),
        "estimator": {
            "trace": {"kind": "exponential", "decay": discount * decay},
            "baseline": {"kind": "network-critic", "discount": discount, "decay": decay, "network": SMALL, "fit": fit},
            "improve": batch,
            "reward_scaling": {"discount": discount},
            **estimator,
        },
    }


def fitted_returns(batch: int, passes: int, learning_rate: float) -> dict[str, Any]:
    """A critic's fit to the returns of each batch, a step for each pass over it."""
    return {"kind": "fitted-returns", "interval": batch, "passes": passes, "learning_rate": learning_rate}


def large_batch(steps: int) -> int:
    """The decisions of a batch of PPO and TRPO: a fiftieth of a training, from 256 to 2,048, a multiple of 64."""
    return 64 * (min(2048, max(256, steps // 50)) // 64)


def proximal(
    task: Any, steps: int, policy: Any = None, discount: float = DISCOUNT, decay: float = 0.95
) -> dict[str, Any]:
    """The preset `"ppo"`: the clipped surrogate, ten times over each batch."""
    batch = large_batch(steps)
    reuse = {"clip": 0.2, "epochs": 10, "minibatches": batch // 64}
    fit = fitted_returns(batch, passes=40, learning_rate=1e-3)
    table = batch_actor_critic(task, policy, batch=batch, decay=decay, fit=fit, discount=discount, reuse=reuse)
    return {**table, "optimizer": {"kind": "adam", "learning_rate": 3e-4}}


def proximal_short_horizon(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"ppo-short-horizon"`: the preset `"ppo"` that looks ahead for a fifth of an episode, with noise of
    graded hyperplanes that lasts for a quarter of that."""
    ahead = horizon(task, 1 / 5)
    table = proximal(task, steps, policy, discount=1 - 1 / ahead, decay=0.9)
    if table["policy"]["kind"] in ("bounded-hyperplanes", "graded-hyperplanes"):
        table["policy"] = {"autocorrelation": 1 - 4 / ahead, **table["policy"]}
    return table


def trust_region(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"trpo"`: natural steps of a given divergence."""
    batch = large_batch(steps)
    fit = fitted_returns(batch, passes=40, learning_rate=1e-3)
    scale = {"rate": 1 / batch}
    table = batch_actor_critic(task, policy, batch=batch, decay=0.95, fit=fit, normalization=scale)
    metric = {"kind": "conjugate-gradient", "memory": batch, "iterations": 10, "damping": 0.1, "kl": 0.01}
    # far beyond the limit, which is therefore the length of every step
    return {**table, "metric": metric, "optimizer": {"kind": "sgd", "learning_rate": 100.0}}


def advantage_actor_critic(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"a2c"`: a step of policy and critic for each small batch."""
    del steps
    fit = fitted_returns(64, passes=1, learning_rate=2e-3)
    table = batch_actor_critic(task, policy, batch=64, decay=0.95, fit=fit, entropy=0.01)
    return {**table, "optimizer": {"kind": "adam", "learning_rate": 2e-3}}


def reinforce(task: Any, steps: int, policy: Any = None) -> dict[str, Any]:
    """The preset `"reinforce"`: a step for each episode, of its returns above a mean that depends on the state."""
    del steps
    fit = {"kind": "bounded-td", "learning_rate": 1.0, "scaling": 2.0}
    table = batch_actor_critic(task, policy, batch="episode", decay=1.0, fit=fit)
    return {**table, "optimizer": {"kind": "adam", "learning_rate": 2e-3}}


PRESETS: dict[str, Callable[[Any, int, Any], dict[str, Any]]] = {
    "a2c": advantage_actor_critic,
    "avg": action_value_gradient,
    "intentional-ac": intentional_actor_critic,
    "natural": natural,
    "natural-network": natural_network,
    "ppo": proximal,
    "ppo-short-horizon": proximal_short_horizon,
    "reinforce": reinforce,
    "sac": soft_actor_critic,
    "stream-ac": stream_actor_critic,
    "trpo": trust_region,
}
"""Presets by name: functions of a task, the decisions of a training, and the task's own policy or `None`."""
