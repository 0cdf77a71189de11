"""Estimators by the names of the literature: those of `Estimator.presets`, as functions of their numbers and parts."""

import dataclasses
from typing import Literal

from motorgrad._errors import check
from motorgrad.learning._baselines import Baseline, MeanReward
from motorgrad.learning._critics import Critic
from motorgrad.learning._estimator import Estimator
from motorgrad.learning._traces import Exponential
from motorgrad.schema import as_hinted


def _named(name: str, decay: float) -> Estimator:
    """The estimator that settings call by this name, with a trace of this decay."""
    return as_hinted(Estimator, name, "estimator", Estimator(Exponential(decay)))


def olgarb(decay: float = 0.9, baseline: Baseline | None = MeanReward()) -> Estimator:  # noqa: B008
    """OLGARB: online, exponential trace, average reward as the baseline (Weaver & Tao, 2001)."""
    return dataclasses.replace(_named("olgarb", decay), baseline=baseline)


def olpomdp(decay: float = 0.9) -> Estimator:
    """OLPOMDP: online, exponential trace, no baseline (Baxter & Bartlett, 1999)."""
    return _named("olpomdp", decay)


def gpomdp(decay: float = 0.9, baseline: Baseline | None = None) -> Estimator:
    r"""GPOMDP: the mean of $\delta z$ at fixed parameters, by default without a baseline (Baxter & Bartlett, 2001)."""
    return dataclasses.replace(_named("gpomdp", decay), baseline=baseline)


def actor_critic(
    critic: Critic | None = None, decay: float = 0.9, discount: float | None = None, from_start: bool = False
) -> Estimator:
    r"""AC(λ), the online actor-critic (Sutton & Barto, 2018), with differential values or discounted ones.

    Temporal differences $\delta = r - \rho + \gamma v(y') - v(y)$ teach all three: the level,
    $\rho \leftarrow \rho + \kappa\delta$, the critic, $w \leftarrow w + \alpha\,\delta e$, and the actor, whose samples
    are $\delta z$. By default the critic is linear in the inputs, with a trace of 0.5, $\alpha$ = 0.05 and $\kappa$ =
    0.005.

    **Arguments:**

    - `critic`: none for the default.
    - `decay`: $\lambda \in [0, 1]$ of the actor.
    - `discount`: none for that of the critic, by default none: differential values and the gradient of the average
      reward. $\gamma \in [0, 1]$ gives the critic discounted values.
    - `from_start`: what is climbed with discounted values. `False`: every decision by its discounted consequences, all
      decisions alike. The trace has the decay $\gamma\lambda$. `True`: the discounted return from the start of an
      episode, whose gradient weights the decision at time $t$ by $\gamma^t$. The estimator has the `discount` then, and
      the trace has the decay $\lambda$.

    **Raises:** `ValueError` for a value out of range, and for `from_start` without a discount.
    """
    if critic is None:
        found = _named("actor-critic", decay).baseline
        assert isinstance(found, Critic)
        critic = found
    if discount is not None:
        critic = dataclasses.replace(critic, discount=discount)
    if not from_start:
        return gae(critic, decay, update_every=1)
    check(critic.discount is not None, "discount", None, "in (0, 1] with from_start")
    return Estimator(Exponential(decay), critic, discount=critic.discount)


def gae(critic: Critic, decay: float = 0.9, update_every: int | Literal["episode", "never"] = 160) -> Estimator:
    r"""Generalised advantage estimation (Schulman et al., 2016).

    A critic's temporal differences, each credited to the action of $k$ decisions before by $(\gamma\lambda)^k$, with
    the critic's $\gamma$ and `decay` $\lambda \in [0, 1]$; a step is the mean of `update_every` samples.
    $\gamma\lambda = 1$ needs a task with episodes.
    """
    return Estimator(Exponential(critic.horizon * decay), critic, update_every=update_every)
