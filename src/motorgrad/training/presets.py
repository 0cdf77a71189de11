"""The presets, each as one table of settings. `preset` registers it by its name, and makes of it the function of
`motorgrad.presets` that returns an `Agent`."""

from collections.abc import Mapping
from typing import Any

from motorgrad._natural import POLICIES, Learnable, PolicyTable, horizon, natural_learner
from motorgrad.training._agents import PRESETS as PRESETS
from motorgrad.training._agents import preset

NETWORK = {"kind": "perceptron", "hidden": [128, 128], "activation": "tanh", "sparsity": 0.5}
"""Hidden layers of a policy that follows the natural gradient."""
SMALL = {"hidden": [64, 64], "activation": "tanh", "layer_norm": False, "sparsity": 0.0, "standardise": True}
"""Hidden layers of policy and critic of batch methods."""
DISCOUNT = 0.99
"""Of the critics with hidden layers, and of the sum by which their rewards are scaled."""
MAX_REPLAY_CAPACITY = 300_000
"""Observations that a learner with replay keeps."""


@preset("a2c")
def a2c(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Advantage actor-critic (Mnih et al., 2016): for every 64 decisions, Adam makes a step of policy and of critic.

    Networks, scaled rewards and standardised inputs are those of `ppo`; a nat of entropy is worth 0.01 scaled rewards.

    **Arguments**, **Returns** and **Raises:** as `natural`.
    """
    fit = _fitted_returns(64, passes=1, learning_rate=2e-3)
    table = _in_batches(task, policy, batch=64, decay=0.95, fit=fit, entropy=0.01)
    return {**table, "optimizer": {"kind": "adam", "learning_rate": 2e-3}}


@preset("avg")
def avg(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Action value gradient (Vasan et al., 2024): climbs the learned value of an action, through the action.

    For tasks with real-valued actions. Policy and action values have two hidden layers of 256 leaky rectifiers each,
    whose last output has length 1, and see inputs relative to their running mean and deviation. Both learn from every
    decision, once, by Adam without momentum: $\gamma$ = 0.99, rates 3e-4 and 1e-3. A nat of entropy is worth 0.05
    scaled rewards. The paper has other rates and entropies for every few tasks; here one setting is meant to serve,
    with rewards divided by the deviation of their discounted sum. The deviation of a unit is its own, and not a
    function of the input.

    **Arguments** and **Returns:** as `natural`.

    **Raises:** as `natural`; for a task whose actions are not all real numbers.
    """
    network = {"hidden": [256, 256], "layer_norm": False, "sparsity": 0.0, "standardise": True, "unit_length": True}
    return {
        "policy": _behind_layers(task, network, policy),
        "estimator": {
            "kind": "action-value-gradient",
            "values": {"discount": DISCOUNT, "learning_rate": 1e-3, "network": network},
            "entropy": 0.05,
            "reward_scaling": {"discount": DISCOUNT},
        },
        "optimizer": {"kind": "adam", "learning_rate": 3e-4, "b1": 0.0},
    }


@preset("intentional-ac")
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
    table = PRESETS["stream-ac"](task, steps, policy)
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


@preset("natural")
def natural(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""The natural actor-critic (Peters & Schaal, 2008), which learned to walk on 24 muscles, for any task.

    It is made of generalised advantages (Schulman et al., 2016) from a least-squares critic (Boyan, 2002), which are
    divided by their running root mean square; of the natural gradient of each unit, which is followed as far as a limit
    on the Kullback-Leibler divergence allows; and of the average of the last parameters. The policy is that of the
    task's own learner; or it goes with the task's actions: softmax for discrete ones, hyperplanes for binary and
    squashed normal units for continuous ones. These see 128 fixed random features beside their inputs. So does the
    critic, which also sees the last action and, of up to 40 inputs, all products of two.

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

    **Returns** an `Agent`.

    **Raises:** `ValueError` as `agent_for`.

    ```python
    task = mg.tasks.from_gymnasium("CartPole-v1")
    agent = mg.presets.natural(task, steps=50_000, damping=0.02)
    run = mg.train(task, agent, steps=50_000, seeds=10)
    ```
    """
    return natural_learner(task, steps, policy)


@preset("natural-network")
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
    found = natural_learner(task, steps, _behind_layers(task, NETWORK, policy), share=1 / 5, entropy=0.1)
    batch = found["estimator"]["improve"]
    kl = found["metric"]["kl"]
    metric = {"kind": "conjugate-gradient", "memory": batch, "iterations": 5, "damping": 0.1, "kl": kl}
    return {**found, "metric": metric}


@preset("ppo")
def ppo(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Proximal policy optimisation (Schulman et al., 2017): ten epochs of the clipped surrogate over each batch.

    Policy and critic have two hidden layers of 64 units each. Both see inputs relative to their running mean and
    deviation, and rewards are divided by the deviation of their discounted sum. A batch is a fiftieth of the `steps`,
    from 256 to 2,048 decisions; minibatches have 64. Advantages are generalised ones with $\gamma = 0.99$ and
    $\lambda = 0.95$, standardised by batch. Adam's learning rate is 3e-4 for the policy. The critic is fitted to the
    $\lambda$-returns of each batch by 40 steps of Adam with a learning rate of 1e-3.

    **Arguments**, **Returns** and **Raises:** as `natural`.

    ```python
    agent = mg.presets.ppo("hopper", 200_000, {"estimator.reuse.epochs": 4})
    ```
    """
    return _proximal(task, steps, policy)


@preset("ppo-short-horizon")
def ppo_short_horizon(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""The preset `ppo` for bodies with many muscles: it looks ahead for a fifth of an episode.

    With a horizon h of a fifth of the longest episode, from 10 to 100 decisions, $\gamma = 1 - 1/h$, so 0.95 for
    episodes of 100 decisions, and $\lambda = 0.9$. All else is as in `ppo`.

    Choose it for bodies with dozens of muscles, such as a hand, and a budget of a million decisions and more. With
    fewer decisions, and on a finger, `natural_network` learned more.

    **Arguments**, **Returns** and **Raises:** as `natural`.

    ```python
    task = mg.tasks.myosuite("myoHandReachRandom-v0")
    agent = mg.presets.ppo_short_horizon(task, steps=9_000_000)
    ```
    """
    ahead = horizon(task, 1 / 5)
    table = _proximal(task, steps, policy, discount=1 - 1 / ahead, decay=0.9)
    if table["policy"]["kind"] in ("bounded-hyperplanes", "graded-hyperplanes"):
        table["policy"] = {"autocorrelation": 1 - 4 / ahead, **table["policy"]}
    return table


@preset("reinforce")
def reinforce(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""REINFORCE with a baseline (Williams, 1992; Sutton & Barto, 2018): a step of Adam for each episode.

    Networks, scaled rewards and standardised inputs are those of `ppo`. The critic learns from every decision by TD(1)
    with bounded steps, so the advantages of an episode add up to its discounted returns above the values.

    **Arguments** and **Returns:** as `natural`.

    **Raises:** as `natural`; when trained, for a task without episodes.
    """
    fit = {"kind": "bounded-td", "learning_rate": 1.0, "scaling": 2.0}
    table = _in_batches(task, policy, batch="episode", decay=1.0, fit=fit)
    return {**table, "optimizer": {"kind": "adam", "learning_rate": 2e-3}}


@preset("sac")
def sac(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Soft actor-critic (Haarnoja et al., 2018) with replay, lasting noise, and targets in hindsight.

    For tasks with real-valued actions. Policy and two action values have two hidden layers of 128 rectifiers each, with
    layer norms, and see inputs relative to their running mean and deviation. After every 40 decisions, ten batches of
    256 are drawn from the newest 300,000 observations, and each makes a step of Adam with a learning rate of 5e-4 for
    values and policy. $\gamma = 1 - 1/h$ with a horizon $h$ of a fifth of the longest episode, from 10 to 100
    decisions; rewards are divided by the deviation of their discounted sum.

    There is no entropy bonus. The deviation of a squashed number starts at 0.5 and shrinks to 0.3 at most; noise has
    the autocorrelation $1 - 15/h$, at least 0. Averaging begins with the last eighth of the `steps`. On a task with
    `goal`, such as `compose` and `myosuite` make with `scaling="none"`, a third of the drawn decisions get the
    place that was reached some $h$ decisions later as their target (Andrychowicz et al., 2017), and a third the target
    of another episode.

    **Arguments** and **Returns:** as `natural`.

    **Raises:** as `natural`; for a task whose actions are not all real numbers.

    ```python
    task = mg.tasks.myosuite("myoHandReachRandom-v0", scaling="none")
    run = mg.train(task, mg.presets.sac(task, steps=300_000), steps=300_000)
    ```
    """
    ahead = horizon(task, 1 / 5)
    network = {"hidden": [128, 128], "activation": "relu", "sparsity": 0.0, "standardise": True}
    own = _behind_layers(task, network, policy)
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
                "hindsight": None if task.goal is None else hindsight,
            },
            "reward_scaling": {"discount": 1 - 1 / ahead},
        },
        "optimizer": {"kind": "adam", "learning_rate": 5e-4},
        "averaging": {"start": max(0, updates - last)},
    }


@preset("stream-ac")
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
        "policy": _behind_layers(task, network, policy),
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


@preset("trpo")
def trpo(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Trust region policy optimisation (Schulman et al., 2015) without its line search: natural steps of 0.01 nats.

    Networks, critic, batches and advantages are those of `ppo`. The natural gradient is that of ten conjugate gradients
    with damping 0.1. Every step has the length of the limit.

    **Arguments**, **Returns** and **Raises:** as `natural`.
    """
    batch = _large_batch(steps)
    fit = _fitted_returns(batch, passes=40, learning_rate=1e-3)
    scale = {"rate": 1 / batch}
    table = _in_batches(task, policy, batch=batch, decay=0.95, fit=fit, normalization=scale)
    metric = {"kind": "conjugate-gradient", "memory": batch, "iterations": 10, "damping": 0.1, "kl": 0.01}
    # far beyond the limit, which is therefore the length of every step
    return {**table, "metric": metric, "optimizer": {"kind": "sgd", "learning_rate": 100.0}}


def _behind_layers(task: Learnable, network: Mapping[str, Any], policy: PolicyTable | None = None) -> dict[str, Any]:
    """A policy that sees the output of hidden layers in place of fixed features: `policy`, or that for the task's kind
    of actions. One that takes no layers is refused when it is made."""
    given = POLICIES.get(task.actions, POLICIES["mixed"]) if policy is None else policy
    kept = {"kind": given} if isinstance(given, str) else {key: given[key] for key in given if key != "features"}
    return {**kept, "network": network}


def _in_batches(
    task: Learnable,
    policy: PolicyTable | None,
    *,
    batch: int | str,
    decay: float,
    fit: Mapping[str, Any],
    discount: float = DISCOUNT,
    **estimator: object,
) -> dict[str, Any]:
    """A batch method as a table: networks, scaled rewards, and generalised advantages from a critic, with the policy
    updated every `batch` decisions, the lambda `decay`, the critic's `fit`, and further settings of the `estimator`."""
    return {
        "policy": _behind_layers(task, SMALL, policy),
        "estimator": {
            "trace": {"kind": "exponential", "decay": discount * decay},
            "baseline": {"kind": "network-critic", "discount": discount, "decay": decay, "network": SMALL, "fit": fit},
            "improve": batch,
            "reward_scaling": {"discount": discount},
            **estimator,
        },
    }


def _fitted_returns(batch: int, passes: int, learning_rate: float) -> dict[str, Any]:
    """A critic's fit to the returns of each batch, a step for each pass over it."""
    return {"kind": "fitted-returns", "interval": batch, "passes": passes, "learning_rate": learning_rate}


def _large_batch(steps: int) -> int:
    """The decisions of a batch of PPO and TRPO: a fiftieth of a training, from 256 to 2,048, a multiple of 64."""
    return 64 * (min(2048, max(256, steps // 50)) // 64)


def _proximal(
    task: Learnable, steps: int, policy: PolicyTable | None = None, discount: float = DISCOUNT, decay: float = 0.95
) -> dict[str, Any]:
    """Proximal policy optimisation as a table: the clipped surrogate, ten times over each batch."""
    batch = _large_batch(steps)
    reuse = {"clip": 0.2, "epochs": 10, "minibatches": batch // 64}
    fit = _fitted_returns(batch, passes=40, learning_rate=1e-3)
    table = _in_batches(task, policy, batch=batch, decay=decay, fit=fit, discount=discount, reuse=reuse)
    return {**table, "optimizer": {"kind": "adam", "learning_rate": 3e-4}}
