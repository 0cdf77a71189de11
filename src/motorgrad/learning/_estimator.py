r"""Gradient estimators: how rewards and scores become gradient samples $g = \delta z$."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._tree import Part, count, number, static
from motorgrad.learning._baselines import Advantage, Baseline, MeanReward, Transition
from motorgrad.learning._branching import where
from motorgrad.learning._critics import Critic
from motorgrad.learning._overshooting import OvershootingBound
from motorgrad.learning._schedules import Annealed, at
from motorgrad.learning._traces import Exponential, Trace
from motorgrad.policies import Policy, split, trainable


class NormalizationState(NamedTuple):
    """The decaying sum of squared advantages, and that of their `weight`, which tends to 1."""

    squares: Float[Array, ""]
    weight: Float[Array, ""]


class RootMeanSquare(Part):
    r"""Advantage normalization: divides advantages $\delta$ by $\sqrt{v}$, where $v$ is a running mean of $\delta^2$.

    A learning rate then says how far an advantage of usual size moves the parameters. It means the same for rewards of
    any unit, and steps keep their length where rewards spread less and less while a task is learned. The mean forgets
    as $v \leftarrow v + \gamma\,(\delta^2 - v)$ and is corrected for its start as Adam's is (Kingma & Ba, 2015), so
    that the first advantage counts as one. The mean includes the newest advantage, so none counts as more than
    $1/\sqrt\gamma$; this couples the two, a bias of the order of $\gamma$.

    **Arguments:**

    - `rate`: $\gamma \in (0, 1)$, per reward.
    """

    rate: float = number(1e-3, 0, 1, open_low=True, open_high=True)

    def init(self, dtype: Any) -> NormalizationState:
        """The state before any advantage."""
        return NormalizationState(jnp.zeros((), dtype), jnp.zeros((), dtype))

    def update(self, state: NormalizationState, advantage: Float[Array, ""]) -> NormalizationState:
        """The state after an advantage."""
        return NormalizationState(
            state.squares + self.rate * (jnp.square(advantage) - state.squares),
            state.weight + self.rate * (1 - state.weight),
        )

    def factor(self, state: NormalizationState) -> Float[Array, ""]:
        """What an advantage is multiplied by; 0 where all of them have been 0."""
        some = state.squares > 0
        return jnp.where(some, jnp.sqrt(state.weight / jnp.where(some, state.squares, 1)), 0)


class EstimatorState(NamedTuple):
    r"""What an estimator carries from decision to decision.

    The state of the `trace`, of the `baseline` and of the `normalization` of advantages; `weight`, the discount
    $\gamma^t$ within the episode. A part that is absent has the state `None`.
    """

    trace: PyTree[Array]
    baseline: Any
    normalization: NormalizationState | None
    weight: Float[Array, ""] | None


class Estimator(Part):
    r"""How rewards and scores become gradient samples $g = \delta z$, and how many samples make a step.

    **Arguments:**

    - `trace`: the eligibility trace.
    - `baseline`: what rewards are compared with, a baseline or a critic; none for the rewards themselves.
    - `discount`: none for the average reward; $\gamma \in (0, 1]$ for the discounted return of an episode,
      $\sum_t \gamma^t r_{t+1}$ from its start (section 2.5), whose samples are $\gamma^t \delta z$.
    - `improve`: after how many samples the parameters move; `"episode"` for once at the end of each episode, `"never"`
      for an estimate at fixed parameters.
    - `batch`: whether a step of several samples uses their `"mean"` or their `"sum"`.
    - `normalization`: none for advantages $\delta$ as they are, or `RootMeanSquare` to normalize them.
    - `entropy`: none, or $\kappa \ge 0$, what a nat of entropy is worth in reward, or in normalized advantages. Every
      sample has $\kappa\,\nabla H(\pi(\cdot \mid y_t))$ added (Williams & Peng, 1991). It may be `Annealed`.
    - `bound`: none, or an `OvershootingBound` of each sample, the entropy's part included: a safeguard for networks
      that learn online.
    """

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "olgarb": {"baseline": "mean", "improve": 1},
        "olpomdp": {"baseline": "none", "improve": 1},
        "gpomdp": {"baseline": "none", "improve": "never"},
    }
    """Named estimators as changes of settings, for configurations and the command line."""

    trace: Trace = Exponential()
    baseline: Baseline | None = MeanReward()
    discount: float | None = number(None, 0, 1, open_low=True)
    improve: int | Literal["episode", "never"] = count(1, 1)
    batch: Literal["mean", "sum"] = static("mean")
    normalization: RootMeanSquare | None = None
    entropy: float | Annealed | None = number(None, 0)
    bound: OvershootingBound | None = None

    @property
    def online(self) -> bool:
        """Whether every sample moves the parameters at once."""
        return self.improve == 1

    @property
    def needs_decision(self) -> bool:
        """Whether a decision must be remembered until its reward comes."""
        return self.entropy is not None or (self.baseline is not None and self.baseline.needs_decision)

    def needs_episodes(self) -> dict[str, str]:
        """The settings that need a task with episodes, by path."""
        found = {
            "trace": self.trace.needs_episodes,
            "baseline": None if self.baseline is None else self.baseline.needs_episodes,
            "": "improve = 'episode'" if self.improve == "episode" else None,
        }
        if self.discount is not None:
            found[""] = f"discount = {self.discount}"
        return {f"{path}.{setting}" if path else setting: setting for path, setting in found.items() if setting}

    def init(self, policy: Policy, key: jax.Array | None = None) -> EstimatorState:
        """The state before the first decision. The `key` matters where the baseline starts from random numbers."""
        key = jax.random.key(0) if key is None else key
        parameters = trainable(policy)
        dtype = jax.tree.leaves(parameters)[0].dtype
        return EstimatorState(
            trace=self.trace.init(parameters),
            baseline=None if self.baseline is None else self.baseline.start(policy, dtype, key),
            normalization=None if self.normalization is None else self.normalization.init(dtype),
            weight=None if self.discount is None else jnp.ones((), dtype),
        )

    def act(self, state: EstimatorState, observation: Float[Array, " inputs"], score: PyTree[Array]) -> EstimatorState:
        """The state after an action was chosen on `observation`; its score enters the trace."""
        if self.baseline is not None:
            state = state._replace(baseline=self.baseline.observe(state.baseline, observation))
        return state._replace(trace=self.trace.update(state.trace, score))

    def sample(
        self, state: EstimatorState, policy: Policy, transition: Transition, steps: Any = None
    ) -> tuple[PyTree[Array], EstimatorState]:
        r"""The gradient sample of a transition, $g = \delta z$, and the state after it.

        A transition that diverged changes nothing learned, and its sample is to be dropped.
        """
        advantage, baseline = self._advantage(state, policy, transition)
        factors, normalization = [], state.normalization
        if self.normalization is not None and normalization is not None:
            updated = self.normalization.update(normalization, advantage.value)
            factors.append(self.normalization.factor(updated))
            normalization = where(transition.diverged, normalization, updated)
        if state.weight is not None:
            factors.append(state.weight)

        def credited(eligibility: PyTree[Array], worth: Float[Array, ""]) -> PyTree[Array]:
            for factor in factors:
                worth = factor * worth
            return jax.tree.map(lambda z: worth * z, eligibility)

        sample = credited(self.trace.value(state.trace), advantage.trace)
        if advantage.newest is not None:
            score = policy.score(transition.observation, transition.action)
            newest = self.trace.value(self.trace.update(self.trace.init(trainable(policy)), score))
            sample = jax.tree.map(jnp.add, sample, credited(newest, advantage.newest))
        if self.entropy is not None:
            bonus, slope = at(self.entropy, steps), entropy_gradient(policy, transition.observation)
            sample = jax.tree.map(lambda g, h: (g + bonus * h).astype(g.dtype), sample, slope)
        if self.bound is not None:
            worth = math.prod(factors, start=advantage.value)
            bounded = self.bound.factor(worth, self.trace.value(state.trace))
            sample = jax.tree.map(lambda g: (bounded * g).astype(g.dtype), sample)
        weight = None if state.weight is None or self.discount is None else state.weight * self.discount
        return sample, EstimatorState(state.trace, baseline, normalization, weight)

    def restart(self, state: EstimatorState, policy: Policy) -> EstimatorState:
        """The state at the start of an episode: the trace is empty and the discount starts again from 1."""
        return EstimatorState(
            trace=self.trace.init(trainable(policy)),
            baseline=None if self.baseline is None else self.baseline.restart(state.baseline),
            normalization=state.normalization,
            weight=None if state.weight is None else jnp.ones_like(state.weight),
        )

    def level(self, state: EstimatorState) -> Float[Array, ""]:
        """The level of rewards that the baseline has found; 0 without one."""
        return jnp.zeros(()) if self.baseline is None else self.baseline.level(state.baseline)

    def solve(self, state: EstimatorState) -> EstimatorState:
        """Do the work of a critic that is due once in many decisions."""
        return state if self.baseline is None else state._replace(baseline=self.baseline.solve(state.baseline))

    def _advantage(self, state: EstimatorState, policy: Policy, transition: Transition) -> tuple[Advantage, Any]:
        if self.baseline is None:
            return Advantage(transition.reward, transition.reward), None
        found = self.baseline.update(state.baseline, policy, transition)
        if not (isinstance(found, tuple) and len(found) == 2 and isinstance(found[0], Advantage)):
            raise TypeError(f"baseline {type(self.baseline).__name__}: update must return (Advantage, state)")
        return found


def entropy_gradient(policy: Policy, observation: Float[Array, " inputs"]) -> PyTree[Array]:
    r"""$\nabla_\theta H(\pi(\cdot \mid y))$, the entropy of the action of all units together, in nats; in the structure
    of the trainable part."""
    parameters, settings = split(policy)
    return jax.grad(lambda theta: eqx.combine(theta, settings).entropy(observation))(parameters)


def olgarb(decay: float = 0.9, baseline: Baseline | None = MeanReward()) -> Estimator:  # noqa: B008
    """OLGARB: online, exponential trace, average reward as the baseline (Weaver & Tao, 2001)."""
    return Estimator(Exponential(decay), baseline)


def olpomdp(decay: float = 0.9) -> Estimator:
    """OLPOMDP: online, exponential trace, no baseline (Baxter & Bartlett, 1999)."""
    return Estimator(Exponential(decay), None)


def gpomdp(decay: float = 0.9, baseline: Baseline | None = None) -> Estimator:
    r"""GPOMDP: the mean of $\delta z$ at fixed parameters, by default without a baseline (Baxter & Bartlett, 2001)."""
    return Estimator(Exponential(decay), baseline, improve="never")


def gae(critic: Critic, decay: float = 0.9, improve: int | Literal["episode", "never"] = 160) -> Estimator:
    r"""Generalised advantage estimation (Schulman et al., 2016).

    A critic's temporal differences, each credited to the action of $k$ decisions before by $(\gamma\lambda)^k$, with
    the critic's $\gamma$ and `decay` $\lambda \in [0, 1]$; a step is the mean of `improve` samples. $\gamma\lambda = 1$
    needs a task with episodes.
    """
    return Estimator(Exponential(critic.horizon * decay), critic, improve=improve)
