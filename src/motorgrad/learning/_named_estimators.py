"""Estimators by the names of the literature."""

from typing import Literal

from motorgrad._settings import as_hinted
from motorgrad.learning._baselines import Baseline, MeanReward
from motorgrad.learning._critics import Critic
from motorgrad.learning._estimator import Estimator
from motorgrad.learning._traces import Exponential


def olgarb(decay: float = 0.9, baseline: Baseline | None = MeanReward()) -> Estimator:  # noqa: B008
    """OLGARB: online, exponential trace, average reward as the baseline (Weaver & Tao, 2001)."""
    return Estimator(Exponential(decay), baseline)


def olpomdp(decay: float = 0.9) -> Estimator:
    """OLPOMDP: online, exponential trace, no baseline (Baxter & Bartlett, 1999)."""
    return Estimator(Exponential(decay), None)


def gpomdp(decay: float = 0.9, baseline: Baseline | None = None) -> Estimator:
    r"""GPOMDP: the mean of $\delta z$ at fixed parameters, by default without a baseline (Baxter & Bartlett, 2001)."""
    return Estimator(Exponential(decay), baseline, improve="never")


def actor_critic(critic: Critic | None = None, decay: float = 0.9) -> Estimator:
    r"""AC(λ), the online actor-critic with differential values (Sutton & Barto, 2018).

    Temporal differences $\delta = r - \rho + v(y') - v(y)$ teach all three: the level,
    $\rho \leftarrow \rho + \kappa\delta$, the critic, $w \leftarrow w + \alpha\,\delta e$, and the actor, whose samples
    are $\delta z$ with a trace of `decay` $\lambda$. By default the critic is linear in the inputs, with a trace of
    0.5, $\alpha$ = 0.05 and $\kappa$ = 0.005.
    """
    if critic is None:
        given = as_hinted(Baseline, Estimator.presets["actor-critic"]["baseline"], "critic")
        assert isinstance(given, Critic)
        critic = given
    return gae(critic, decay, improve=1)


def gae(critic: Critic, decay: float = 0.9, improve: int | Literal["episode", "never"] = 160) -> Estimator:
    r"""Generalised advantage estimation (Schulman et al., 2016).

    A critic's temporal differences, each credited to the action of $k$ decisions before by $(\gamma\lambda)^k$, with
    the critic's $\gamma$ and `decay` $\lambda \in [0, 1]$; a step is the mean of `improve` samples. $\gamma\lambda = 1$
    needs a task with episodes.
    """
    return Estimator(Exponential(critic.horizon * decay), critic, improve=improve)
