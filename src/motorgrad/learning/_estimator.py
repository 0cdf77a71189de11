r"""Gradient estimators: how rewards and scores become gradient samples $g = \delta z$."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad._goal import Goal
from motorgrad.learning._baselines import Advantage, Baseline, MeanReward, Transition
from motorgrad.learning._branching import Flag, where
from motorgrad.learning._overshooting import StepBound
from motorgrad.learning._scaling import NormalizationState, RewardScaling, RootMeanSquare, ScalingState
from motorgrad.learning._schedules import Annealed, Steps, at
from motorgrad.learning._surrogate import Batch, ClippedSurrogate, gradient_of
from motorgrad.learning._traces import Episodic, Exponential, Trace, credited
from motorgrad.policies import Policy, abilities, trainable
from motorgrad.schema import Part, count, inner, number, static


class EstimatorState(NamedTuple):
    r"""What an estimator carries from decision to decision.

    The state of the `trace`, of the `baseline` and of the `normalization` of advantages; `weight`, the discount
    $\gamma^t$ within the episode; the state of the `scaling` of rewards; the `batch` of decisions that are to be
    used again, without which there is a trace; the state of the `bound`; that of the target of the `entropy`. A part
    that is absent has the state `None`.
    """

    trace: PyTree[Array]
    baseline: PyTree
    normalization: NormalizationState | None
    weight: Float[Array, ""] | None
    scaling: ScalingState | None = None
    batch: PyTree = None
    bound: PyTree = None
    entropy: PyTree = None


class Estimator(Part):
    r"""How rewards and scores become gradient samples $g = \delta z$, and how many samples make a step.

    **Raises:** `ValueError` for a value out of range, for a `discount` with a critic of differential values, and for
    parts that do not fit a `reuse` or a trace that learns, with those that do.
    """

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "olgarb": {"baseline": "mean", "improve": 1},
        "olpomdp": {"baseline": "none", "improve": 1},
        "gpomdp": {"baseline": "none", "improve": "never"},
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
            "improve": 1,
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
    improve: int | Literal["episode", "never"] = count(
        1,
        1,
        help="after how many samples the parameters move; episode for once at its end, never for an estimate at fixed "
        "parameters",
    )
    batch: Literal["mean", "sum"] = static("mean", help="what a step of several samples uses of them")
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
    reuse: ClippedSurrogate | None = inner(
        None, help="none for one step of the mean of a batch; `ClippedSurrogate` for several steps from its decisions"
    )

    def validate(self) -> None:
        differential = getattr(self.baseline, "discount", self) is None
        wanted = "a number where estimator.discount is one, best the same"
        check(self.discount is None or not differential, "baseline.discount", None, wanted)
        if self.trace.learns:
            apart = self.baseline is not None and self.baseline.newest_apart
            name = type(self.trace).__name__
            words = f"one that credits all actions alike, such as MeanReward, with {name}"
            check(not apart, "baseline", type(self.baseline).__name__, words)
            check(self.entropy_in == "sample", "entropy_in", self.entropy_in, f"'sample' with {name}")
        if self.reuse is None:
            return
        whole = isinstance(self.improve, int) and self.improve > 1
        check(whole, "improve", self.improve, "the decisions of a batch, an integer of at least 2, for a reuse of it")
        parts = self.reuse.minibatches
        divides = int(self.improve) % parts == 0
        check(divides, "reuse.minibatches", parts, f"a divisor of improve = {self.improve}")
        summed = isinstance(self.trace, Exponential | Episodic)
        check(summed, "trace", type(self.trace).__name__, "Exponential or Episodic for a reuse of batches")
        weighted = self.baseline is not None and self.baseline.needs_eligibility
        words = "a critic, or one that does not see the eligibility, such as MeanReward, for a reuse of batches"
        check(not weighted, "baseline", type(self.baseline).__name__, words)
        check(self.bound is None, "bound", self.bound, "None for a reuse of batches, which has a limit of its own")
        check(self.entropy_in == "sample", "entropy_in", self.entropy_in, "'sample' for a reuse of batches")

    @property
    def one_stream(self) -> str | None:
        """The part that needs successive decisions of one environment, in words; `None` where none does."""
        if self.reuse is not None:
            return f"batches used again by {type(self.reuse).__name__}"
        fit = getattr(self.baseline, "fit", None)
        return f"a critic fitted by {type(fit).__name__}" if getattr(fit, "one_stream", False) else None

    @property
    def online(self) -> bool:
        """Whether every sample moves the parameters at once."""
        return self.improve == 1

    @property
    def needs_decision(self) -> bool:
        """Whether a decision must be remembered until its reward comes."""
        kept = self.entropy is not None or self.reuse is not None
        return kept or (self.baseline is not None and self.baseline.needs_decision)

    @property
    def needs_goal(self) -> str | None:
        """The setting that needs a task with a goal, by path; `None` where none does."""
        return None

    @property
    def needs_uniforms(self) -> bool:
        """Whether the random numbers of a decision must be remembered with it."""
        return False

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
            trace=None if self.reuse is not None else self.trace.init(parameters),
            baseline=None if self.baseline is None else self.baseline.start(policy, dtype, key),
            normalization=None if self.normalization is None else self.normalization.init(dtype),
            weight=None if self.discount is None else jnp.ones((), dtype),
            scaling=None if self.reward_scaling is None else self.reward_scaling.init(dtype),
            batch=None if self.reuse is None else self._empty_batch(policy, key),
            bound=None if self.bound is None else self.bound.init(parameters),
        )

    def act(self, state: EstimatorState, observation: Float[Array, " inputs"], score: PyTree[Array]) -> EstimatorState:
        """The state after an action was chosen on `observation`; its score enters the trace."""
        if self.baseline is not None:
            state = state._replace(baseline=self.baseline.observe(state.baseline, observation))
        if self.bound is not None:
            state = state._replace(bound=self.bound.observe(state.bound, score))
        return state if state.batch is not None else state._replace(trace=self.trace.update(state.trace, score))

    def sample(
        self, state: EstimatorState, policy: Policy, transition: Transition, steps: Steps = None
    ) -> tuple[PyTree[Array], EstimatorState]:
        r"""The gradient sample of a transition, $g = \delta z$, and the state after it; of a learner that uses batches
        again, the advantage alone, as the batch keeps the rest.

        A transition that diverged changes nothing learned, and its sample is to be dropped.
        """
        advantage, state = self._advantage(state, policy, transition)
        if self.reuse is not None:
            return advantage.value, self._stored(state, transition, advantage)
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
        scaling, batch, weight = state.scaling, state.batch, state.weight
        return state._replace(
            trace=None if self.reuse is not None else self.trace.restart(state.trace, trainable(policy)),
            baseline=None if self.baseline is None else self.baseline.restart(state.baseline),
            weight=None if weight is None else jnp.ones_like(weight),
            scaling=scaling if self.reward_scaling is None or scaling is None else self.reward_scaling.restart(scaling),
            batch=batch if self.reuse is None or batch is None else self.reuse.restart(batch),
        )

    def level(self, state: EstimatorState) -> Float[Array, ""]:
        """The level of rewards that the baseline has found; 0 without one."""
        return jnp.zeros(()) if self.baseline is None else self.baseline.level(state.baseline)

    def solve(self, state: EstimatorState) -> EstimatorState:
        """Do the work of a critic that is due once in many decisions."""
        return state if self.baseline is None else state._replace(baseline=self.baseline.solve(state.baseline))

    @property
    def climbs(self) -> bool:
        """Whether the parameters make several steps at a time, from decisions that are kept: `climb`, not `sample`,
        finds the gradients."""
        return self.reuse is not None

    @property
    def seeds_in_turn(self) -> bool:
        """Whether `climb` takes the seeds one after the other, where they learn side by side."""
        return False

    def ready(self, batch: PyTree) -> Flag:
        """Whether enough decisions are kept for `climb`."""
        del batch
        return True

    def drawn(self, batch: PyTree, goal: Goal | None) -> PyTree:
        """What `climb` uses of the decisions that were kept; by default all. The `goal` is that of the task, where it
        has one."""
        del goal
        return batch

    def climb(self, state: PyTree, drawn: PyTree, step: Callable[[PyTree, PyTree[Array]], PyTree]) -> PyTree:
        """The state of a learner after all steps from decisions that were kept.

        **Arguments:** the `state` of the learner, whose estimator does not hold the batch; what `drawn` found; `step`,
        which makes one step, `step(state, gradient)`.
        """
        reuse = self.reuse
        assert reuse is not None

        def bonus(state: PyTree) -> Float[Array, ""] | None:
            return None if self.entropy is None else at(self.entropy, state.steps)

        decay = self.trace.decay if isinstance(self.trace, Exponential) else 1.0
        return reuse.climb(drawn, state.policy, decay, bonus, state, step)

    def used(self, batch: PyTree) -> PyTree:
        """What is kept of a batch after `climb`."""
        assert self.reuse is not None
        return self.reuse.emptied(batch)

    def _empty_batch(self, policy: Policy, key: jax.Array) -> Batch:
        assert self.reuse is not None
        allowed = "one whose memory does not depend on its parameters, for a reuse of batches"
        check(not abilities.remembers_parameters(policy), "policy", type(policy).__name__, allowed)
        return self.reuse.init(policy, int(self.improve), jax.random.fold_in(key, 1))

    def _advantage(
        self, state: EstimatorState, policy: Policy, transition: Transition
    ) -> tuple[Advantage, EstimatorState]:
        """The advantage of a transition, normalized and discounted, and the state after it, except for the trace."""
        dropped, scaling, normalization = transition.diverged, state.scaling, state.normalization
        if self.reward_scaling is not None and scaling is not None:
            scaling = where(dropped, scaling, self.reward_scaling.update(scaling, transition.reward))
            transition = transition._replace(reward=self.reward_scaling.factor(scaling) * transition.reward)
        advantage, baseline = self._above_baseline(state, policy, transition)
        if self.normalization is not None and normalization is not None:
            updated = self.normalization.update(normalization, advantage.value)
            advantage = _times(self.normalization.factor(updated), advantage)
            normalization = where(dropped, normalization, updated)
        weight = state.weight
        if weight is not None and self.discount is not None:
            advantage = _times(weight, advantage)
            weight = weight * self.discount
        found = state._replace(baseline=baseline, normalization=normalization, weight=weight, scaling=scaling)
        return advantage, found

    def _above_baseline(
        self, state: EstimatorState, policy: Policy, transition: Transition
    ) -> tuple[Advantage, PyTree]:
        """The advantage as the baseline tells it, and the state of the baseline after it."""
        if self.baseline is None:
            return Advantage(transition.reward, transition.reward), None
        if self.baseline.needs_eligibility:
            transition = transition._replace(eligibility=self.trace.value(state.trace))
        found = self.baseline.update(state.baseline, policy, transition)
        if not (isinstance(found, tuple) and len(found) == 2 and isinstance(found[0], Advantage)):
            raise TypeError(f"baseline {type(self.baseline).__name__}: update must return (Advantage, state)")
        return found

    def _stored(self, state: EstimatorState, transition: Transition, advantage: Advantage) -> EstimatorState:
        """The state with a decision in the batch that is to be used again."""
        assert self.reuse is not None
        assert state.batch is not None
        newest = 0 if advantage.newest is None else advantage.newest
        entry = (transition.observation, transition.action, advantage.trace, newest)
        return state._replace(batch=self.reuse.add(state.batch, *entry, transition.diverged))

    def _alone(self, policy: Policy, score: PyTree[Array]) -> PyTree:
        """The trace of one score. A trace is linear, so it can be added to that of the scores before."""
        return self.trace.update(self.trace.init(trainable(policy)), score)


def _times(factor: Float[Array, ""], advantage: Advantage) -> Advantage:
    return jax.tree.map(lambda each: factor * each, advantage)


def entropy_gradient(policy: Policy, observation: Float[Array, " inputs"]) -> PyTree[Array]:
    r"""$\nabla_\theta H(\pi(\cdot \mid y))$, the entropy of the action of all units together, in nats; in the structure
    of the trainable part."""
    return gradient_of(lambda present: present.entropy(observation), policy)
