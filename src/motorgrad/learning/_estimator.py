r"""Gradient estimators: how rewards and scores become gradient samples $g = \delta z$."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._branching import where
from motorgrad._errors import check
from motorgrad.learning._accuracy import Accuracy
from motorgrad.learning._advantages import Advantages, times
from motorgrad.learning._baselines import Baseline, MeanReward
from motorgrad.learning._gradients import gradient_of
from motorgrad.learning._learner import Transition
from motorgrad.learning._overshooting import StepBound
from motorgrad.learning._reward_criteria import Accumulated, RewardCriterion, check_criterion, criterion_field
from motorgrad.learning._scaling import NormalizationState, RewardScaling, RootMeanSquare, ScalingState
from motorgrad.learning._schedules import Annealed, Steps, at
from motorgrad.learning._traces import Exponential, Trace, credited
from motorgrad.policies import Policy, trainable
from motorgrad.schema import Part, count, inner, number, static


class EstimatorState(NamedTuple):
    r"""What an estimator carries from decision to decision.

    The state of the `trace`, of the `baseline` and of the `normalization` of advantages; `weight`, the discount
    $\gamma^t$ within the episode; the state of the `scaling` of rewards; that of the `bound`; what the `criterion` has
    accumulated. A part that is absent has the state `None`.
    """

    trace: PyTree[Array]
    baseline: PyTree
    normalization: NormalizationState | None
    weight: Float[Array, ""] | None
    scaling: ScalingState | None = None
    bound: PyTree = None
    criterion: Accumulated | None = None


class Estimator(Part):
    r"""How rewards and scores become gradient samples $g = \delta z$, and how many samples make a step.

    **Raises:** `ValueError` for a value out of range, for a `discount` with a critic of differential values or with a
    `criterion`, and for parts that do not fit a trace that learns, with those that do.
    """

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "olgarb": {"baseline": "mean", "update_every": 1},
        "olpomdp": {"baseline": "none", "update_every": 1},
        "gpomdp": {"baseline": "none", "update_every": "never"},
        "actor-critic": {
            "baseline": {
                "kind": "critic",
                "features": {"kind": "features", "bias": False},
                "discount": "none",
                "decay": 0.5,
                "fit": {"kind": "td", "learning_rate": 0.05},
                "centring": {"kind": "value-based", "rate": 0.005},
            },
            "discount": "none",
            "update_every": 1,
        },
    }
    """Named estimators as changes of settings, for configurations and the command line."""

    trace: Trace = inner(Exponential(), help="the eligibility trace")
    baseline: Baseline | None = inner(
        MeanReward(), help="what rewards are compared with, a baseline or a critic; none for the rewards themselves"
    )
    discount: float | None = number(
        None,
        0,
        1,
        open_low=True,
        help=r"none where all decisions count alike, as for the average reward; $\gamma$ for the discounted return of "
        r"an episode, $\sum_t \gamma^t r_{t+1}$ from its start (section 2.5), whose samples are $\gamma^t \delta z$. "
        r"These weights discount later rewards already, so the decay of the trace is $\lambda$ then, and not "
        r"$\gamma\lambda$; 1, or `Episodic`, leaves no bias",
    )
    update_every: int | Literal["episode", "never"] = count(
        1,
        1,
        help="after how many samples the parameters move; episode for once at its end, never for an estimate at fixed "
        "parameters",
    )
    reduction: Literal["mean", "sum"] = static("mean", help="what a step of several samples uses of them")
    normalization: RootMeanSquare | None = inner(
        None, help=r"none for advantages $\delta$ as they are, or `RootMeanSquare` to normalize them"
    )
    entropy: float | Annealed | None = number(
        None,
        0,
        help=r"none, or $\kappa$, what a nat of entropy is worth in reward, or in normalized advantages. Every sample "
        r"has $\kappa\,\nabla H(\pi(\cdot \mid y_t))$ added (Williams & Peng, 1991)",
    )
    entropy_in: Literal["sample", "trace"] = static(
        "sample",
        help=r"sample as above; with trace, $\kappa\,\operatorname{sign}(\delta_t)\,\nabla H$ is added to the newest "
        r"score in the trace, where $\delta$ multiplies it (Elsayed, Vasan & Mahmood, 2024): the bonus grows with the "
        r"size of the advantage and decays with the trace",
    )
    reward_scaling: RewardScaling | None = inner(
        None, help="none, or `RewardScaling` of rewards before anything else sees them"
    )
    bound: StepBound | None = inner(
        None,
        help="none, or what limits each sample, the entropy's part included: `OvershootingBound`, a safeguard for "
        "networks that learn online, or `IntentionalStep`",
    )
    criterion: RewardCriterion | None = criterion_field()
    accuracy: Accuracy | None = inner(
        None,
        help="none for batches of one length, or `Accuracy`: a step once the mean gradient is accurate enough, and "
        "`update_every` is the greatest length of a batch",
    )

    def validate(self) -> None:
        differential = getattr(self.baseline, "discount", self) is None
        wanted = "a number where estimator.discount is one, best the same"
        check(self.discount is None or not differential, "baseline.discount", None, wanted)
        check_criterion(self.criterion, self.discount)
        if self.accuracy is not None:
            self.accuracy.check(self.update_every)
        if self.trace.learns:
            apart = self.baseline is not None and self.baseline.newest_apart
            name = type(self.trace).__name__
            words = f"one that credits all actions alike, such as MeanReward, with {name}"
            check(not apart, "baseline", type(self.baseline).__name__, words)
            check(self.entropy_in == "sample", "entropy_in", self.entropy_in, f"'sample' with {name}")

    @property
    def advantages(self) -> Advantages:
        """The parts that make advantages of rewards."""
        return Advantages(self.baseline, self.reward_scaling, self.normalization, self.criterion)

    @property
    def single_stream(self) -> str | None:
        """The part that needs successive decisions of one environment, in words; `None` where none does."""
        return self.advantages.single_stream

    @property
    def online(self) -> bool:
        """Whether every sample moves the parameters at once."""
        return self.update_every == 1

    def needs_episodes(self) -> list[str]:
        """The settings that need a task with episodes, by path."""
        found = []
        if self.trace.needs_episodes:
            found.append(f"trace.{self.trace.needs_episodes}")
        if self.baseline is not None and self.baseline.needs_episodes:
            found.append(f"baseline.{self.baseline.needs_episodes}")
        if self.discount is not None:
            found.append(f"discount = {self.discount}")
        elif self.update_every == "episode":
            found.append("update_every = 'episode'")
        if self.criterion is not None:
            found.append("criterion")
        return found

    def init(self, policy: Policy, key: jax.Array | None = None) -> EstimatorState:
        """The state before the first decision. The `key` matters where the baseline starts from random numbers."""
        parameters = trainable(policy)
        return EstimatorState(
            trace=self.trace.init(parameters),
            weight=None if self.discount is None else jnp.ones((), jax.tree.leaves(parameters)[0].dtype),
            bound=None if self.bound is None else self.bound.init(parameters),
            **self.advantages.init(policy, jax.random.key(0) if key is None else key),
        )

    def act(self, state: EstimatorState, observation: Float[Array, " inputs"], score: PyTree[Array]) -> EstimatorState:
        """The state after an action was chosen on `observation`; its score enters the trace."""
        state = self.advantages.observe(state, observation)
        if self.bound is not None:
            state = state._replace(bound=self.bound.observe(state.bound, score))
        return state._replace(trace=self.trace.update(state.trace, score))

    def paid(self, state: EstimatorState, transition: Transition) -> tuple[Transition, EstimatorState]:
        """The transition with what it pays by the criterion in place of its reward, and the state after it."""
        return self.advantages.paid(state, transition)

    def sample(
        self, state: EstimatorState, policy: Policy, transition: Transition, steps: Steps = None
    ) -> tuple[PyTree[Array], EstimatorState]:
        r"""The gradient sample of a transition as it is `paid`, $g = \delta z$, and the state after it.

        A transition that diverged changes nothing learned, and its sample is to be dropped.
        """
        if self.baseline is not None and self.baseline.needs_eligibility:
            transition = transition._replace(eligibility=self.trace.value(state.trace))
        advantage, state = self.advantages.update(state, policy, transition)
        if self.discount is not None and state.weight is not None:
            advantage = times(state.weight, advantage)
            state = state._replace(weight=state.weight * self.discount)
        entropy = None
        entropy_coefficient = jnp.zeros(())
        if self.entropy is not None:
            entropy = entropy_gradient(policy, transition.observation)
            entropy_coefficient = at(self.entropy, steps)
        if entropy is not None and self.entropy_in == "trace":
            signed = jax.tree.map(
                lambda h: (jnp.sign(advantage.value) * entropy_coefficient * h).astype(h.dtype), entropy
            )
            state = state._replace(trace=jax.tree.map(jnp.add, state.trace, self._alone(policy, signed)))
        eligibility = self.trace.value(state.trace)
        sample = credited(eligibility, advantage.trace)
        if advantage.newest is not None:
            score = policy.score(transition.observation, transition.action)
            newest = self.trace.value(self._alone(policy, score))
            sample = jax.tree.map(jnp.add, sample, credited(newest, advantage.newest))
        if entropy is not None and self.entropy_in == "sample":
            sample = jax.tree.map(lambda g, h: (g + entropy_coefficient * h).astype(g.dtype), sample, entropy)
        if self.trace.learns:
            learned = self.trace.learn(state.trace, advantage.trace)
            state = state._replace(trace=where(transition.diverged, state.trace, learned))
        if self.bound is not None:
            sample = self.bound.bounded(state.bound, sample, advantage.value, eligibility)
        return sample, state

    def restart(self, state: EstimatorState, policy: Policy) -> EstimatorState:
        """The state at the start of an episode: the trace is empty and the discount starts again from 1."""
        return self.advantages.restart(state)._replace(
            trace=self.trace.restart(state.trace, trainable(policy)),
            weight=None if state.weight is None else jnp.ones_like(state.weight),
        )

    def level(self, state: EstimatorState) -> Float[Array, ""]:
        """The level of rewards that the baseline has found; 0 without one."""
        return self.advantages.level(state)

    def solve(self, state: EstimatorState) -> EstimatorState:
        """Do the work of a critic that is due once in many decisions."""
        return self.advantages.solve(state)

    def _alone(self, policy: Policy, score: PyTree[Array]) -> PyTree:
        """The trace of one score. A trace is linear, so it can be added to that of the scores before."""
        return self.trace.update(self.trace.init(trainable(policy)), score)


def entropy_gradient(policy: Policy, observation: Float[Array, " inputs"]) -> PyTree[Array]:
    r"""$\nabla_\theta H(\pi(\cdot \mid y))$, the entropy of the action of all units together, in nats; in the structure
    of the trainable part."""
    return gradient_of(lambda present: present.entropy(observation), policy)
