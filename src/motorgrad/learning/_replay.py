r"""Experience that is used many times: a buffer of decisions, and targets in hindsight.

A learner that follows scores learns from a decision once, or from a batch of the newest. One that knows the value of
*any* action, $Q(y, a)$, may learn from decisions of any age, whoever made them. It keeps them, and draws from them.

Where a task draws a target for each episode, an episode that missed its own target has still reached other places. Had
one of them been the target, the decisions would have been good ones. *Hindsight* relabels them so (Andrychowicz et al.,
2017): the movement stays, and errors and rewards are those for the place that was reached.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from motorgrad._branching import Flag, where
from motorgrad._errors import check
from motorgrad._goal import Goal
from motorgrad.schema import Part, count, inner, number

LAST = 2**31 - 1  # the number of an episode, after which they begin again from 0


class Experience(NamedTuple):
    """A ring of rows, one for each observation. The row of a decision has what it led to, and its next observation is
    that of the row after it; the last observation of an episode has a row without a decision.

    `place` is the row of the present observation, `filled` the number of rows in use, `episode` the number of each
    row's episode, −1 for a row that is not in use. `begun` says whether the present episode has a decision. `key` draws
    what is used.
    """

    observations: Float[Array, "rows inputs"]
    actions: Float[Array, "rows actions"]
    rewards: Float[Array, " rows"]
    terminated: Bool[Array, " rows"]
    decided: Bool[Array, " rows"]
    episode: Int[Array, " rows"]
    place: Int[Array, ""]
    filled: Int[Array, ""]
    present: Int[Array, ""]
    begun: Bool[Array, ""]
    key: UInt32[Array, " words"]


class Drawn(NamedTuple):
    """Decisions drawn from experience. The `weight` of one is 0 where the row that was drawn has no decision."""

    observation: Float[Array, "batch inputs"]
    action: Float[Array, "batch actions"]
    reward: Float[Array, " batch"]
    next_observation: Float[Array, "batch inputs"]
    terminated: Bool[Array, " batch"]
    weight: Float[Array, " batch"]

    def mean(self, values: Float[Array, " batch"]) -> Float[Array, ""]:
        """The mean of one number for each decision."""
        return jnp.sum(self.weight * values) / jnp.maximum(jnp.sum(self.weight), 1)


class Hindsight(Part):
    r"""Some of the decisions that are drawn get another target: a place that the body reached later in the same episode
    (Andrychowicz et al., 2017, the strategy "future"), or the target of another episode.

    With the error $e_t$, wanted − actual, and the place reached at a later time $k$ as the target, the error is
    $e_t - e_k$; with the target $g'$ in place of $g$ it is $e_t + g' - g$. The reward changes by what depends on the
    error; all other parts of it, and ends of episodes, stay.

    **Raises:** `ValueError` for a value out of range.
    """

    share: float = number(0.67, 0, 1, help="the share of decisions that get another target")
    ahead: float = number(
        20.0,
        1,
        unit="decisions",
        help="how much later the body reached it, on average. The number is drawn from a geometric distribution. A "
        "decision whose episode ends before keeps its own target",
    )
    others: float = number(
        0.5,
        0,
        1,
        help="the share of those that get the target of another decision that is kept, in place of a place reached "
        "later. They keep their own where observations do not show it: see `Goal.target`",
    )

    def relabelled(
        self, experience: Experience, rows: Int[Array, " batch"], drawn: Drawn, goal: Goal, key: jax.Array
    ) -> Drawn:
        """The decisions of these `rows`, some of them for another target."""
        which, one, other = jax.random.uniform(key, (3, len(rows)), drawn.reward.dtype)
        size = len(experience.rewards)
        kept = experience.observations
        stay = jnp.maximum(1 - 1 / self.ahead, 1e-9)
        later = 1 + jnp.floor(jnp.log(jnp.maximum(one, 1e-30)) / jnp.log(stay)).astype(jnp.int32)
        reached = (rows + later) % size
        same = (experience.episode[reached] == experience.episode[rows]) & (later < size)
        places = jnp.asarray(goal.errors)
        targets = jnp.asarray(goal.targets, jnp.int32)
        border = self.share * self.others
        shift = jnp.where((same & (which >= border) & (which < self.share))[:, None], kept[reached][:, places], 0)
        row = jnp.floor(other * experience.filled).astype(jnp.int32)
        own = goal.target(drawn.observation)
        wanted = goal.target(kept[row])
        if own is not None and wanted is not None:
            moves = (experience.episode[row] >= 0) & (which < border)
            shift = jnp.where(moves[:, None], own - wanted, shift)
        before = drawn.next_observation[:, places]
        reward = jax.vmap(goal.reward)

        def moved(observation: Array) -> Array:
            observation = observation.at[:, places].add(-shift)
            return observation.at[:, targets].add(-shift) if goal.targets else observation

        return drawn._replace(
            observation=moved(drawn.observation),
            next_observation=moved(drawn.next_observation),
            reward=drawn.reward + (reward(before - shift) - reward(before)).astype(drawn.reward.dtype),
        )


class Replay(Part):
    """A buffer of the newest decisions, from which batches are drawn at random (Lin, 1992).

    **Raises:** `ValueError` for a value out of range.
    """

    capacity: int = count(
        300_000, 2, 100_000_000, help="number of observations that are kept; the oldest make room for new ones"
    )
    start: int = count(1_000, 2, 100_000_000, help="number of observations from which a learner begins to move")
    batch: int = count(256, 1, 1_000_000, help="number of decisions of a step")
    updates: int = count(1, 1, 1_000_000, help="number of batches of each update")
    hindsight: Hindsight | None = inner(None, help="none, or `Hindsight` for a task with a target")

    def validate(self) -> None:
        check(self.start <= self.capacity, "start", self.start, f"at most capacity = {self.capacity}")

    def init(
        self, observation: Float[Array, " inputs"], action: Float[Array, " actions"], key: jax.Array
    ) -> Experience:
        """No experience, for observations and actions of these shapes."""
        rows = self.capacity
        zero = jnp.zeros((), jnp.int32)
        return Experience(
            observations=jnp.zeros((rows, *observation.shape), observation.dtype),
            actions=jnp.zeros((rows, *action.shape), action.dtype),
            rewards=jnp.zeros(rows, observation.dtype),
            terminated=jnp.zeros(rows, bool),
            decided=jnp.zeros(rows, bool),
            episode=jnp.full(rows, -1, jnp.int32),
            place=zero,
            filled=zero,
            present=zero,
            begun=jnp.zeros((), bool),
            key=jax.random.key_data(key),
        )

    def add(
        self,
        kept: Experience,
        seen: Array,
        action: Array,
        reward: Array,
        following: Array,
        terminated: Flag,
        dropped: Flag,
    ) -> Experience:
        """The experience after one more decision; one that is `dropped` leaves only what was seen before it."""
        here = kept.place
        after = (kept.place + 1) % self.capacity

        def put(rows: Array, place: Array, value: Array | Flag | float) -> Array:
            return rows.at[place].set(jnp.asarray(value, rows.dtype))

        following = where(dropped, jnp.zeros_like(following), following)  # it may not be finite
        episode = put(kept.episode, here, kept.present)
        return kept._replace(
            observations=put(put(kept.observations, here, seen), after, following),
            actions=put(kept.actions, here, action),
            rewards=put(kept.rewards, here, where(dropped, 0.0, reward)),
            terminated=put(kept.terminated, here, terminated),
            decided=put(put(kept.decided, here, jnp.logical_not(dropped)), after, False),
            episode=put(episode, after, where(dropped, -1, kept.present)),
            place=where(dropped, here, after),
            filled=jnp.minimum(jnp.maximum(kept.filled, here + 2), self.capacity),
            begun=jnp.logical_or(kept.begun, jnp.logical_not(dropped)),
        )

    def restart(self, kept: Experience) -> Experience:
        """The experience where an episode ends: its last observation keeps its row."""
        begun = kept.begun
        return kept._replace(
            place=jnp.where(begun, (kept.place + 1) % self.capacity, kept.place),
            present=(kept.present + begun) & LAST,  # far more than there is room for at a time
            begun=jnp.zeros_like(begun),
        )

    def ready(self, kept: Experience) -> Bool[Array, ""]:
        """Whether there is enough experience to learn from."""
        return kept.filled >= self.start

    def draw(self, kept: Experience, key: jax.Array, goal: Goal | None = None) -> Drawn:
        """A batch of decisions, with observations as policies see them; the `goal` of the task for hindsight, where
        they are kept in the task's own units."""
        row_key, own = jax.random.split(key)
        rows = jax.random.randint(row_key, (self.batch,), 0, jnp.maximum(kept.filled, 1))
        drawn = Drawn(
            observation=kept.observations[rows],
            action=kept.actions[rows],
            reward=kept.rewards[rows],
            next_observation=kept.observations[(rows + 1) % self.capacity],
            terminated=kept.terminated[rows],
            weight=kept.decided[rows].astype(kept.rewards.dtype),
        )
        if self.hindsight is None or goal is None:
            return drawn
        drawn = self.hindsight.relabelled(kept, rows, drawn, goal, own)
        if goal.shown is None:
            return drawn
        show = jax.vmap(goal.shown)
        return drawn._replace(observation=show(drawn.observation), next_observation=show(drawn.next_observation))

    def renewed(self, kept: Experience) -> Experience:
        """The experience after it was used: the next draws differ."""
        key = jax.random.fold_in(jax.random.wrap_key_data(kept.key), 1)
        return kept._replace(key=jax.random.key_data(key))
