"""Units that learn in turn: at any time only some of a pool draw and learn, and the others rest."""

import itertools
from typing import Any, Literal, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from motorgrad._errors import check, check_integer, choice
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask
from motorgrad.policies._binary import BinaryUnits, InitialMotoneurons
from motorgrad.policies._parameters import fixed, in_structure, with_fields
from motorgrad.policies._policy import Composed, check_plain
from motorgrad.policies._starting import Initial, function_of, then
from motorgrad.schema import count, static

Rest = Literal["noisy", "quiet"]


class Alternating(Composed, BinaryUnits):
    r"""A pool whose units learn asynchronously: unit $i$ at its turn, $i \bmod T$, while the others rest (section 4.4
    of the thesis).

    A turn lasts `hold` decisions. The score of a unit that rests is 0. Resting units either fire as ever (`rest =
    "noisy"`) or each do what is more probable (`"quiet"`), so that they do not disturb those whose turn it is. Noisy
    ones leave the policy as it is: over all turns, scores average to $1/T$ of the pool's. Quiet ones make another
    policy of it, whose gradient is another one.

    The turn is the policy's own state: a learner moves it on by `adapted`, as it does statistics of observations. So
    the policy is for learners that take the score of every decision when it is made, such as the policy gradient with
    traces, and not for those that return to past decisions. What was learned is `pool`.

    **Arguments:** `pool`, independent units, each with parameters of its own, of one kind or several (`Factored`);
    `turns` $T$, and `hold`, whole numbers from 1; `rest`. `clock` is the number of decisions so far, up to a round of
    all turns.

    **Example:**

    ```python
    policy = Alternating(Motoneurons(threshold=[0.3, 0.6], gain=[5.0, 5.0]), rest="quiet")
    policy.prob(jnp.array([0.5]))  # [0.73, 0]: the second unit rests, silent
    policy.adapted(jnp.array([0.5])).prob(jnp.array([0.5]))  # [1, 0.38]: now the first one does, active
    ```
    """

    pool: BinaryUnits
    turns: int = eqx.field(static=True, default=2)
    hold: int = eqx.field(static=True, default=1)
    rest: Rest = eqx.field(static=True, default="noisy")
    clock: Int[Array, ""] = fixed(converter=lambda value: jnp.asarray(value, jnp.int32), default=0)

    def __check_init__(self) -> None:
        kind = type(self.pool).__name__
        check(isinstance(self.pool, BinaryUnits), "pool", kind, "a pool of binary units")
        check_plain("pool", self.pool)
        own = self.pool.independent and self.pool.separate
        check(own, "pool", kind, "a pool of independent units with parameters of their own")
        check_integer("turns", self.turns, 1)
        check(self.turns <= self.pool.outputs, "turns", self.turns, f"at most {self.pool.outputs}, the number of units")
        check_integer("hold", self.hold, 1)
        choice("rest", self.rest, ("noisy", "quiet"))

    @property
    def inputs(self) -> int:
        return self.pool.inputs

    @property
    def outputs(self) -> int:
        return self.pool.outputs

    @property
    def learning(self) -> Bool[Array, " units"]:
        """Whose turn it is."""
        return jnp.arange(self.outputs) % self.turns == self.clock // self.hold % self.turns

    def adapted(self, seen: Float[Array, " inputs"]) -> Self:
        """The policy at the next decision."""
        clock = (self.clock + 1) % (self.turns * self.hold)
        return with_fields(self, pool=abilities.adapted(self.pool, seen), clock=clock)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        p = self.pool.prob(observation)
        return p if self.rest == "noisy" else jnp.where(self.learning, p, self.pool.mode(observation))

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        terms = self.pool.log_probs(observation, action)
        if self.rest == "noisy":
            resting = jax.lax.stop_gradient(terms)
        else:
            resting = jnp.where(action == self.pool.mode(observation), 0, -jnp.inf)
        return jnp.where(self.learning, terms, resting)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        rows = abilities.blocks(self.pool, self.pool.score(observation, action))
        return in_structure(self, pool=abilities.from_blocks(self.pool, self._learning_rows(rows)))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The pool's matrices, zero for units that rest."""
        return self._learning_rows(abilities.fisher(self.pool, observation, action))

    def fisher_coordinates(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> Float[Array, " units"]:
        """The pool's, one for each unit, held constant for those that rest."""
        coordinates = abilities.fisher_coordinates(self.pool, observation, action)
        return jnp.where(self.learning, coordinates, jax.lax.stop_gradient(coordinates))

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return self.pool.entropy(observation) if self.rest == "noisy" else super().entropy(observation)

    def _learning_rows(self, blocks: tuple[Array, ...]) -> tuple[Array, ...]:
        """Arrays that lead with the units of each pool, 0 for those that rest."""
        ends = itertools.accumulate((len(block) for block in blocks), initial=0)
        masks = [self.learning[start:end] for start, end in itertools.pairwise(ends)]
        return tuple(
            jnp.where(mask.reshape(-1, *(1,) * (block.ndim - 1)), block, 0)
            for mask, block in zip(masks, blocks, strict=True)
        )


class InitialAlternatingMotoneurons(InitialMotoneurons):
    """The units of `motoneurons`, which learn in turn (see `Alternating`)."""

    turns: int = count(2, 1, help="after how many turns it is a unit's turn again")
    hold: int = count(1, 1, 1_000_000, unit="decisions", help="the length of a turn")
    rest: Rest = static(
        "noisy", help="noisy for units that fire as ever while they rest; quiet for ones that do what is more probable"
    )

    def start(self, task: SizedTask | int) -> Initial:
        def in_turn(pool: Any) -> Alternating:
            return Alternating(pool, self.turns, self.hold, self.rest)

        return then(in_turn, super().start(task))


alternating_motoneurons = function_of(InitialAlternatingMotoneurons)
