r"""A learner for thousands of local units, which at every decision updates only those near the observation.

Between two updates a unit's trace only decays, $z_t = \beta^{t-s} z_s$, so what it learns meanwhile is a sum that all
units share. With the scale $B_t = \beta^{t - t_0}$ and the sum $S_t = \sum_{s \le t} B_s \delta_s$ since a common
decision $t_0$, a unit of base $b$ and slope $v = \alpha z/B$ has the parameters

$$\theta_t = b + v S_t .$$

An update adds the score to the slope, $v \leftarrow v + \alpha\nabla\log\pi/B$, and moves the base so that $\theta$
stays where it is. Every few tens of decisions all units are brought up to date, and $t_0$ is now ("rebase"). Each
episode within that time has a sum of its own; a unit that was last updated in an earlier episode stays where its end
left it.
"""

import functools
import math
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import Flag, Scalar, any_of, where, where_any
from motorgrad.learning._advantages import Advantages, times
from motorgrad.learning._baselines import MeanReward, ScalarBaseline
from motorgrad.learning._chain import SGD
from motorgrad.learning._learner import Learner, Needs, Transition
from motorgrad.learning._reward_criteria import Accumulated, RewardCriterion, check_criterion, criterion_field
from motorgrad.learning._scaling import NormalizationState, RootMeanSquare
from motorgrad.learning._schedules import changes
from motorgrad.learning._traces import Episodic, Exponential, credited
from motorgrad.learning.algorithms._policy_gradient import Agent
from motorgrad.learning.sparse._index import SpatialIndex
from motorgrad.learning.sparse._rows import greatest, write_rows
from motorgrad.policies import LocalGaussians, abilities, split, trainable
from motorgrad.schema import inner, number, register

MIN_SCALE = 1e-3  # of B: below, single precision would lose what a touch adds
STEP = 16  # units, by which the room in a table grows
HEADROOM = 1.1
MOVED = 0.75  # of the margin: a table is made anew once a unit has moved so far


class IndexState(NamedTuple):
    r"""The state of a sparse learner beside its policy, which is up to date only after `publish`.

    - `rows`: of each unit the base, the slope, and the episode in which it was last updated.
    - `sums`: $S$ of each episode since the rebase; `travel`, the same of $|\delta|$; `limit`, the travel at which a
      unit may have used up its margin, at the earliest.
    - `episode`: the present episode; `count`, decisions up to the next rebase.
    - `table`: as `SpatialIndex.table` makes it, with `room` for so many units, for units where `reference` has them and
      a grid at `low` of cells of `size`.
    - `moved`: the greatest strain of any unit at the last rebase.
    """

    rows: Float[Array, "units row"]
    sums: Float[Array, " episodes"]
    travel: Float[Array, " episodes"]
    limit: Float[Array, " episodes"]
    episode: Int[Array, ""]
    count: Int[Array, ""]  # pyright: ignore[reportIncompatibleMethodOverride]
    table: Int[Array, "cells room"]
    room: Int[Array, ""]
    reference: Float[Array, "units parameters"]
    low: Float[Array, " inputs"]
    size: Float[Array, " inputs"]
    moved: Float[Array, ""]


class SparseState(NamedTuple):
    r"""The policy, which is up to date only after `publish`; the weights of the episodes in the trace; the `index`; the
    states of the `baseline` and of the `normalization` of advantages; the discount $\gamma^t$ within the episode,
    `weight`; between `observe` and `update` the `sample`, which is $\delta$ times the trace; what the `criterion` has
    accumulated."""

    policy: LocalGaussians
    trace: Float[Array, " episodes"]
    index: IndexState  # pyright: ignore[reportIncompatibleMethodOverride]
    baseline: PyTree = None
    normalization: NormalizationState | None = None
    scaling: None = None
    weight: Float[Array, ""] | None = None
    sample: Float[Array, " episodes"] | None = None
    criterion: Accumulated | None = None


class SparseLearner(Learner):
    r"""An online learner of local Gaussian units, which at every decision updates only those that can fire there.

    It is the policy gradient with traces (`Agent`), $z \leftarrow \beta z + \nabla\log\pi$ and
    $\theta \leftarrow \theta + \alpha\delta z$, for the policy without what the index neglects: a unit that is not
    listed where the learner is does not fire there, and has no score. It learns what the plain learner of that policy
    learns, within rounding, but for limits of log-widths, which apply to a unit when it is updated.

    Tables are made outside compiled code. Where `due` says so, call `refresh` before the next `act`, which consumes as
    many uniforms as the table has room for. `publish` brings the policy up to date, for others to read.

    **Raises:** from `init`, `ValueError` for a policy that is no `LocalGaussians`.
    """

    critic: ClassVar[str | None] = "baseline"

    decay: float = number(0.9, 0, 1, help=r"$\beta$, the decay of the trace; 1 needs a task with episodes")
    baseline: ScalarBaseline | None = inner(
        MeanReward(), help="what rewards are compared with; none for the rewards themselves"
    )
    discount: float | None = number(
        None,
        0,
        1,
        open_low=True,
        help=r"none where all decisions count alike; $\gamma$ for the discounted return of an episode",
    )
    normalization: RootMeanSquare | None = inner(
        None, help=r"none for advantages $\delta$ as they are, or `RootMeanSquare` to normalize them"
    )
    learning_rate: float | dict[str, Any] = number(
        1e-3, 0, groups=True, help=r"$\alpha$, for all parameters or for each of the policy's fields, as of `SGD`"
    )
    index: SpatialIndex = inner(SpatialIndex(), help="what is neglected and when tables are made")
    criterion: RewardCriterion | None = criterion_field()

    def validate(self) -> None:
        super().validate()
        check_criterion(self.criterion, self.discount)

    @classmethod
    def settings_from(cls, other: Learner) -> dict[str, Any]:
        found = super().settings_from(other)
        if not isinstance(other, Agent):
            return found
        estimator = other.estimator
        found["discount"] = estimator.discount
        found["normalization"] = estimator.normalization
        found["criterion"] = estimator.criterion
        if isinstance(estimator.trace, Exponential | Episodic):
            found["decay"] = estimator.trace.decay if isinstance(estimator.trace, Exponential) else 1.0
        if estimator.baseline is None or isinstance(estimator.baseline, ScalarBaseline):
            found["baseline"] = estimator.baseline
        if type(other.optimizer) is SGD and not changes(other.optimizer.learning_rate):
            found["learning_rate"] = other.optimizer.learning_rate
        return found

    @property
    def advantages(self) -> Advantages:
        """The parts that make advantages of rewards."""
        return Advantages(self.baseline, None, self.normalization, self.criterion)

    @property
    def needs(self) -> Needs:
        found = ["decay = 1"] if isinstance(self.decay, float) and self.decay == 1 else []
        if self.discount is not None:
            found.append(f"discount = {self.discount}")
        if self.criterion is not None:
            found.append("criterion")
        return Needs(tuple(found), single_stream=f"the index of {type(self).__name__}", score=True)

    @property
    def rebase(self) -> Int[Array, ""]:
        """Decisions from one rebase to the next."""
        decay = jnp.asarray(self.decay)
        within = (decay > 0) & (decay < 1)
        most = jnp.log(MIN_SCALE) / jnp.log(jnp.where(within, decay, 0.5))
        return jnp.where(within, jnp.clip(most.astype(jnp.int32), 1, self.index.rebase), self.index.rebase)

    def init(self, key: jax.Array) -> SparseState:
        pool = self.first_policy(key)
        if not isinstance(pool, LocalGaussians):
            raise ValueError(f"policy = {type(pool).__name__!r}: must be LocalGaussians where units are indexed")
        (theta,) = abilities.blocks(pool, trainable(pool))
        cells = self.index.sides(pool.outputs, pool.inputs) ** pool.inputs
        episodes = self.index.rebase + 1
        dtype = theta.dtype
        none = jnp.zeros((), jnp.int32)
        index = IndexState(
            rows=_rows(theta, jnp.zeros_like(theta)),
            sums=jnp.zeros(episodes, dtype),
            travel=jnp.zeros(episodes, dtype),
            limit=jnp.full(episodes, jnp.inf, dtype),
            episode=none,
            count=none,
            table=jnp.zeros((cells, 0), jnp.int32),
            room=none,
            reference=theta,
            low=jnp.zeros(pool.inputs, dtype),
            size=jnp.ones(pool.inputs, dtype),
            moved=jnp.full((), jnp.inf, dtype),
        )
        return SparseState(
            policy=pool,
            trace=jax.nn.one_hot(0, episodes, dtype=dtype),
            index=index,
            weight=None if self.discount is None else jnp.ones((), dtype),
            **self.advantages.init(pool, jax.random.fold_in(key, 2)),
        )

    def act(
        self, state: SparseState, observation: Float[Array, " inputs"], uniforms: Float[Array, " room"]
    ) -> tuple[SparseState, Array]:
        """What `Agent.act` does, for the units alone that are listed where the observation is."""
        decay = jnp.asarray(self.decay)
        decayed = state._replace(trace=decay * state.trace)
        state = self._begin(decayed, decay <= 0)  # without memory, every decision is an episode of its own
        index = state.index
        units = state.policy.outputs
        trace = state.trace
        rates = SGD(self.learning_rate).learning_rates(trainable(state.policy))
        near = index.table[self.index.cell(observation, index.low, index.size, units)]
        there = near < units
        few = jax.tree.map(lambda leaf: _rows_of(leaf, near, units, 1), state.policy)
        base, slope, since = _parts(index.rows.at[near].get(mode="clip"))
        since = since.astype(jnp.int32)
        pool = _with(few, base + slope * index.sums[since][:, None])
        fired = jnp.where(there, pool.sample(observation, uniforms), 0)

        now = jax.nn.one_hot(index.episode, len(index.sums), dtype=slope.dtype)
        scale = jnp.sum(now * trace)
        total = jnp.sum(now * index.sums)
        (gain,) = abilities.blocks(
            pool,
            jax.tree.map(
                lambda score, rate: (_rows_of(rate, near, units, score.ndim) / scale) * score,
                pool.score(observation, fired),
                rates,
            ),
        )
        slope = jnp.where((since == index.episode)[:, None], slope, 0) + gain
        (theta,) = abilities.blocks(pool, trainable(pool))
        rows = _rows(theta - slope * total, slope, index.episode)

        _, left = self._left(_with(few, index.reference.at[near].get(mode="clip")), pool, slope)
        limit = index.travel + jnp.min(jnp.where(there, left, jnp.inf), initial=jnp.inf)
        limit = jnp.where(now > 0, jnp.minimum(index.limit, limit), index.limit)
        count = jnp.sum(there)
        index = index._replace(rows=write_rows(index.rows, near, rows, count), limit=limit)
        return state._replace(index=index), write_rows(jnp.zeros(units, fired.dtype), near, fired, count)

    def observe(self, state: SparseState, transition: Transition) -> SparseState:
        r"""Turn a reward into $\delta$ times the trace. The end of an episode restarts the trace."""
        diverged = transition.diverged
        transition, state = self.advantages.paid(state, transition)
        advantage, state = self.advantages.update(state, state.policy, transition)
        if self.discount is not None and state.weight is not None:
            advantage = times(state.weight, advantage)
            state = state._replace(weight=state.weight * self.discount)
        sample = credited(state.trace, advantage.trace)
        state = state._replace(sample=where(diverged, jnp.zeros_like(sample), sample))
        ended = any_of(transition.terminated, transition.truncated, diverged)
        if ended is False:
            return state
        fresh = self.advantages.restart(state)
        if state.weight is not None:
            fresh = fresh._replace(weight=jnp.ones_like(state.weight))
        return self._begin(where(ended, fresh, state), jnp.logical_and(ended, jnp.asarray(self.decay) > 0))

    def update(self, state: SparseState) -> SparseState:
        """Let all units learn from the newest sample, and bring them up to date where that is due."""
        sample = state.sample
        assert sample is not None
        count = (state.index.count + 1) % self.rebase
        travel = state.index.travel + jnp.abs(sample)
        index = state.index._replace(sums=state.index.sums + sample, count=count, travel=travel)
        due = (count == 0) | jnp.any(travel > index.limit)
        rebased = functools.partial(self._rebased, state.policy)
        index, trace = where_any(due, rebased, (index, state.trace))
        return state._replace(trace=trace, index=index, sample=None)

    def readings(self, state: SparseState) -> dict[str, Array]:
        """The level of rewards, `baseline`."""
        return {"baseline": self.advantages.level(state)}

    def publish(self, state: SparseState) -> SparseState:
        """The state with its policy as it is now. What is learned from there is the same, published or not."""
        return state._replace(policy=_with(state.policy, _caught_up(state.index)))

    def take_up(self, state: SparseState) -> SparseState:
        """The inverse of `publish`, for a policy that was put in place: learning continues from it, without a trace."""
        (theta,) = abilities.blocks(state.policy, trainable(state.policy))
        index = state.index
        moved = jnp.full_like(index.moved, jnp.inf)
        rows = _rows(theta, jnp.zeros_like(theta))
        return state._replace(index=index._replace(rows=rows, moved=moved, limit=jnp.full_like(index.limit, jnp.inf)))

    def due(self, state: SparseState) -> Bool[Array, "*seeds"]:
        """Whether a table must be made before the next action: see `refresh`."""
        return state.index.moved > MOVED

    def _begin(self, state: SparseState, ended: Flag) -> SparseState:
        """The state where another episode begins if the last has `ended`."""
        episode = state.index.episode + jnp.asarray(ended, jnp.int32)
        fresh = jax.nn.one_hot(episode, len(state.index.sums), dtype=state.trace.dtype)
        return state._replace(trace=jnp.where(ended, fresh, state.trace), index=state.index._replace(episode=episode))

    def _rebased(self, policy: Any, state: tuple[IndexState, Array]) -> tuple[IndexState, Array]:
        """All units caught up with, and what they have moved since the table was made."""
        index, trace = state
        pool = _with(policy, _caught_up(index))
        (theta,) = abilities.blocks(pool, trainable(pool))
        _, slope, since = _parts(index.rows)
        now = jax.nn.one_hot(index.episode, len(index.sums), dtype=theta.dtype)
        scale = jnp.sum(now * trace)
        slope = jnp.where((since == index.episode)[:, None], slope * scale, 0)
        strain, left = self._left(_with(policy, index.reference), pool, slope)
        first = jax.nn.one_hot(0, len(index.sums), dtype=theta.dtype)
        index = index._replace(
            rows=_rows(theta, slope),
            sums=jnp.zeros_like(index.sums),
            travel=jnp.zeros_like(index.sums),
            limit=jnp.where(first > 0, -greatest(-left), jnp.inf),
            episode=jnp.zeros_like(index.episode),
            moved=greatest(strain),
        )
        return index, first

    def _left(self, before: LocalGaussians, pool: LocalGaussians, slope: Float[Array, "units row"]) -> Any:
        """How strained units are, and how far they travel before they have used up their margins, at the earliest."""
        strain = self.index.strain(before, pool)
        pace = self.index.pace(pool, abilities.from_blocks(pool, (slope,)))
        return strain, jnp.maximum(1 - strain, 0) / jnp.maximum(pace, 1e-30)

    def refresh(self, index: IndexState, policy: LocalGaussians) -> IndexState:
        """The tables that are due, and those that a saved state is without. It is done outside compiled code.

        **Arguments:** the index of many seeds, along a leading axis, which is used up, and their policies, for what is
        not learned. Where a cell has more units than there was room for, all tables grow, and the program is
        compiled again.
        """
        due = np.asarray(index.moved) > MOVED
        room = int(np.max(index.room))
        units = index.rows.shape[1]
        width = index.reference.shape[-1]
        lost = index.table.shape[-1] < room
        made = {}
        for seed in np.flatnonzero(due | lost).tolist():
            theta = np.asarray(index.rows[seed, :, :width] if due[seed] else index.reference[seed])
            pool = _with(jax.tree.map(lambda leaf, seed=seed: leaf[seed], policy), theta)
            low, size = self.index.grid(pool)
            moved = np.where(due[seed], 0, index.moved[seed]).astype(theta.dtype)
            made[seed] = (self.index.table(pool, low, size), theta, low, size, moved)
        most = max((len(table[0]) for table, *_ in made.values()), default=0)
        if most > room:
            room = min(units, STEP * math.ceil(HEADROOM * most / STEP))
        if room > index.table.shape[-1]:
            more = ((0, 0), (0, 0), (0, room - index.table.shape[-1]))
            table = jnp.pad(index.table, more, constant_values=units)
            index = index._replace(table=table, room=jnp.full_like(index.room, room))
        for seed, (table, *rest) in made.items():
            table = np.pad(table, ((0, 0), (0, room - table.shape[1])), constant_values=units)
            new = dict(zip(("table", "reference", "low", "size", "moved"), (table, *rest), strict=True))
            old = {name: getattr(index, name) for name in new}
            index = index._replace(**_place(old, new, seed))
        return index


register(Learner, "sparse", SparseLearner)


@functools.partial(jax.jit, donate_argnums=0)
def _place(old: PyTree, new: PyTree, seed: int) -> PyTree:
    return jax.tree.map(lambda all, one: all.at[seed].set(one), old, new)


def _rows(base: Array, slope: Array, episode: Scalar = 0) -> Float[Array, "units row"]:
    since = jnp.broadcast_to(jnp.asarray(episode, base.dtype), (base.shape[0], 1))
    return jnp.concatenate([base, slope, since], axis=1)


def _parts(rows: Float[Array, "units row"]) -> tuple[Array, Array, Float[Array, " units"]]:
    width = rows.shape[1] // 2
    return rows[:, :width], rows[:, width:-1], rows[:, -1]


def _caught_up(index: IndexState) -> Float[Array, "units parameters"]:
    base, slope, since = _parts(index.rows)
    return base + slope * index.sums[since.astype(jnp.int32)][:, None]


def _with(policy: Any, theta: Float[Array | np.ndarray, "units parameters"]) -> Any:
    """A pool with these parameters, within their limits."""
    return abilities.limited(eqx.combine(abilities.from_blocks(policy, (theta,)), split(policy)[1]))


def _rows_of(leaf: Array, units: Int[Array, " room"], all: int, dimensions: int) -> Array:
    """The rows of some units, of an array that has a row for each; another is as it is."""
    has = leaf.ndim >= dimensions and leaf.shape[:1] == (all,)
    return leaf.at[units].get(mode="clip") if has else leaf
