r"""Batches that are learned from at once: the sums over decisions are products of matrices.

Between two steps of the parameters a batch learner acts in the same way, whatever it has learned since. So it may as
well gather its decisions, and find all samples $g_t = \delta_t z_t$ of a batch when it is full. What is left of a
decision is to act and to keep a row. The rest changes places: a trace of decay $\beta$ credits every score with the sum
of later errors,

$$\sum_t \delta_t z_t = \sum_t A_t s_t + \beta A_0 z_{-1}, \qquad A_t = \delta_t + \beta A_{t+1},$$

where $z_{-1}$ is the trace of the batch before. Nothing else is approximated: the result is that of one decision after
the other but for rounding.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import Flag, where
from motorgrad.learning._centring import SimpleCentring
from motorgrad.learning._critic_fits import LeastSquares
from motorgrad.learning._critics import CriticState, Features, LinearCritic, as_vector
from motorgrad.learning._estimator import Estimator, EstimatorState
from motorgrad.learning._gradients import empty_rows, gradient_of
from motorgrad.learning._learner import Transition
from motorgrad.learning._schedules import Steps, at
from motorgrad.learning._traces import Exponential
from motorgrad.policies import Policy, abilities


class Gathered(NamedTuple):
    """The decisions of a batch in `rows`, of which the first `waiting` are filled in.

    A row has the observation, the action, the observation and the reward that followed, and two flags: whether the
    episode terminated, and whether one had begun with this decision. `fresh` says whether one begins with the next.
    """

    rows: Float[Array, "batch numbers"]
    waiting: Int[Array, ""]
    fresh: Bool[Array, ""]

    @classmethod
    def empty(cls, policy: Policy, size: int) -> "Gathered":
        """A batch of this size without decisions."""
        observations, actions = empty_rows(policy, size)
        width = 2 * observations.shape[1] + actions[0].size + 3
        return cls(jnp.zeros((size, width), observations.dtype), jnp.zeros((), jnp.int32), jnp.zeros((), bool))

    def add(self, transition: Transition) -> "Gathered":
        """The batch with one more decision. One that diverged is written, too, and overwritten by the next."""
        observed = transition.observation, transition.action, transition.next_observation
        parts = [*observed, transition.reward, transition.terminated, self.fresh]
        row = jnp.concatenate([jnp.ravel(jnp.asarray(part)).astype(self.rows.dtype) for part in parts])
        counted = where(transition.diverged, self.waiting, self.waiting + 1)
        return Gathered(_put(self.rows, self.waiting, row), counted, jnp.zeros_like(self.fresh))

    def restart(self, ended: Flag) -> "Gathered":
        """The batch where an episode has `ended` with the newest decision."""
        return self._replace(fresh=self.fresh | ended)

    def dropped(self) -> "Gathered":
        """The batch without its decisions, as at the start of an episode; of one seed or of many."""
        return self._replace(waiting=jnp.zeros_like(self.waiting), fresh=jnp.ones_like(self.fresh))

    def emptied(self, due: Flag) -> "Gathered":
        """The batch after it was used, where that was `due`."""
        return self._replace(waiting=jnp.where(due, 0, self.waiting))


@jax.custom_batching.custom_vmap
def _put(rows: Array, place: Array, row: Array) -> Array:
    """Rows with one in its place. Mapped over seeds, whose places differ, this would be a scatter, which XLA leaves out
    of loops that it compiles whole: a decision of eight seeds would take five times as long. So it is a loop of its
    own."""
    return jax.lax.dynamic_update_index_in_dim(rows, row, place, 0)


@_put.def_vmap
def _put_each(seeds: int, batched: list[bool], *given: Array) -> tuple[Array, bool]:
    each = [x if own else jnp.broadcast_to(x, (seeds, *x.shape)) for x, own in zip(given, batched, strict=True)]
    rows, places, row = each

    def put(seed: Array, rows: Array) -> Array:
        return jax.lax.dynamic_update_slice(rows, row[seed][None, None], (seed, places[seed], 0))

    return jax.lax.fori_loop(0, seeds, put, rows), True


class Decisions(NamedTuple):
    """The decisions of a full batch: what `Gathered` has, by name. After an `end` another episode began."""

    observations: Float[Array, "batch inputs"]
    actions: Array
    following: Float[Array, "batch inputs"]
    rewards: Float[Array, " batch"]
    terminated: Bool[Array, " batch"]
    begins: Bool[Array, " batch"]
    ends: Bool[Array, " batch"]


def decisions_of(policy: Policy, gathered: Gathered) -> Decisions:
    """The decisions of a full batch, as the policy sees and takes them."""
    size = len(gathered.rows)
    observations, actions = jax.eval_shape(lambda: empty_rows(policy, size))
    inputs = observations.shape[1]
    behind = inputs + math.prod(actions.shape[1:])
    cuts = [inputs, behind, behind + inputs, behind + inputs + 1, behind + inputs + 2]
    seen, acted, following, rewards, terminated, begins = jnp.split(gathered.rows, cuts, axis=1)
    begins = begins[:, 0] > 0
    ends = jnp.append(begins[1:], gathered.fresh)
    acted = acted.reshape(actions.shape).astype(actions.dtype)
    return Decisions(seen, acted, following, rewards[:, 0], terminated[:, 0] > 0, begins, ends)


def may_gather(estimator: Estimator) -> bool:
    """Whether all parts of an estimator know how to learn from a batch at once: a trace that forgets exponentially, and
    a linear critic by least squares over whole batches."""
    critic = estimator.baseline
    if estimator.online or not isinstance(critic, LinearCritic) or not isinstance(critic.fit, LeastSquares):
        return False
    return (
        type(critic.features) is Features
        and type(estimator.trace) is Exponential
        and critic.fit.interval == estimator.update_every
        and estimator.entropy_in == "sample"
        and all(part is None for part in (estimator.discount, estimator.bound, estimator.criterion, estimator.accuracy))
    )


def may_be_judged_later(policy: Policy) -> bool:
    """Whether the decisions of a policy can be judged when the batch is full: they depend on its parameters and the
    present observation alone, and it adds up many at a time."""
    adapts = abilities.adapted(policy, jnp.zeros(policy.inputs)) is not policy
    remembers = abilities.has_memory(policy) or abilities.has_hidden_units(policy)
    return abilities.sums_batches(policy) and not (remembers or adapts)


def without_rows(state: EstimatorState) -> EstimatorState:
    """The state of an estimator that gathers: its critic keeps no rows of its own."""
    return state._replace(baseline=state.baseline._replace(fit=state.baseline.fit._replace(waiting=())))


def learn_at_once(
    estimator: Estimator, state: EstimatorState, policy: Policy, rows: Decisions, steps: Steps
) -> tuple[PyTree[Array], EstimatorState]:
    """The mean of the samples of a whole batch, in the structure of the parameters, and the state after it."""
    errors, state = _errors(estimator, state, policy, rows)
    decay: Any = estimator.trace.decay  # type: ignore[attr-defined]

    def back(later: tuple[Array, Array], decision: tuple[Array, Array]) -> tuple[tuple[Array, Array], Any]:
        advantage, kept = later
        error, end = decision
        advantage = error + jnp.where(end, 0, decay * advantage).astype(error.dtype)
        share = jnp.where(end, 0, kept)
        return (advantage, (decay * share).astype(error.dtype)), (advantage, share)

    start = jnp.zeros((), errors.dtype), jnp.ones((), errors.dtype)
    (first, kept), (advantages, shares) = jax.lax.scan(back, start, (errors, rows.ends), reverse=True)
    learned, eligible = _sums(estimator, policy, rows, advantages, shares, steps)
    before = jax.tree.map(lambda z: jnp.where(rows.begins[0], 0, z), state.trace)
    gradient = jax.tree.map(lambda g, z: ((g + decay * first * z) / len(errors)).astype(g.dtype), learned, before)
    return gradient, state._replace(trace=jax.tree.map(lambda new, z: new + kept * z, eligible, before))


def _errors(
    estimator: Estimator, state: EstimatorState, policy: Policy, rows: Decisions
) -> tuple[Float[Array, " batch"], EstimatorState]:
    r"""The temporal differences $\delta_t$ of a batch, normalized, and the state after it, in which the critic has
    learned from them."""
    critic: Any = estimator.baseline
    own: CriticState = state.baseline
    dtype = own.features.dtype
    taken = jax.vmap(lambda action: as_vector(policy, action, dtype))(rows.actions)
    previous = jnp.where(rows.begins[:, None], 0, jnp.concatenate([own.previous[None], taken[:-1]]))
    see = jax.vmap(lambda observation: abilities.critic_observation(policy, observation))
    features = critic.features(see(rows.observations).astype(dtype), previous)
    following = critic.features(see(rows.following).astype(dtype), taken)
    following = jnp.where(rows.terminated[:, None], 0, following)
    changes = features - critic.horizon * following
    falls = changes @ own.weights
    centring = SimpleCentring() if critic.centring is None else critic.centring

    def forth(carried: tuple[Any, ...], decision: tuple[Array, ...]) -> tuple[tuple[Any, ...], Any]:
        scaling, level, normalization = carried
        reward, fall, end = decision
        if estimator.reward_scaling is not None:
            scaling = estimator.reward_scaling.update(scaling, reward)
            reward = (estimator.reward_scaling.factor(scaling) * reward).astype(dtype)
            scaling = where(end, estimator.reward_scaling.restart(scaling), scaling)
        error = (reward - critic.compared(own._replace(reward=level)) - fall).astype(dtype)
        level = centring.follow(level, reward, error, critic.fit.mean_rate)
        normalized = error
        if estimator.normalization is not None:
            normalization = estimator.normalization.update(normalization, error)
            normalized = (estimator.normalization.factor(normalization) * error).astype(dtype)
        return (scaling, level, normalization), (normalized, reward)

    carried = state.scaling, own.reward, state.normalization
    (scaling, level, normalization), (errors, rewards) = jax.lax.scan(forth, carried, (rows.rewards, falls, rows.ends))
    critic_state = own._replace(previous=jnp.where(rows.ends[-1], 0, taken[-1]), reward=level)
    traces, trace = _traces(critic, own.fit.trace, features, rows.begins)
    sums = traces.T @ changes, rewards @ traces, jnp.sum(traces, axis=0)
    fit = own.fit._replace(trace=jnp.where(rows.ends[-1], 0, trace))
    weights, fit = critic.fit.take_in(own.weights, fit, sums, critic.compared(critic_state))
    learned = critic_state._replace(weights=weights, fit=fit)
    return errors, state._replace(baseline=learned, scaling=scaling, normalization=normalization)


def _traces(
    critic: LinearCritic, trace: Float[Array, " features"], features: Float[Array, "batch features"], begins: Array
) -> tuple[Float[Array, "batch features"], Float[Array, " features"]]:
    """The critic's trace at every decision of a batch, and the last one."""

    def forth(trace: Array, decision: tuple[Array, Array]) -> tuple[Array, Array]:
        seen, begin = decision
        trace = (jnp.where(begin, 0, critic.horizon * critic.decay * trace) + seen).astype(seen.dtype)
        return trace, trace

    last, traces = jax.lax.scan(forth, trace, (features, begins))
    return traces, last


def _sums(
    estimator: Estimator, policy: Policy, rows: Decisions, advantages: Array, shares: Array, steps: Steps
) -> tuple[PyTree[Array], PyTree[Array]]:
    """The sums over a batch of its scores by `advantages`, with the gradient of the entropy, and by `shares`."""
    weights = jnp.stack([advantages, shares], axis=1)
    sums = abilities.score_sum(policy, rows.observations, rows.actions, weights)
    learned, eligible = (jax.tree.map(lambda both, i=i: both[i], sums) for i in range(2))
    if estimator.entropy is None:
        return learned, eligible
    slope = gradient_of(lambda present: abilities.entropy_sum(present, rows.observations), policy)
    bonus = at(estimator.entropy, steps)
    return jax.tree.map(lambda g, h: (g + bonus * h).astype(g.dtype), learned, slope), eligible
