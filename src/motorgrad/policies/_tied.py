"""Units whose activation is correlated: groups of them that share one draw and their parameters."""

from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, python_numbers
from motorgrad.policies._binary import BinaryUnits, InitialMotoneurons, Motoneurons
from motorgrad.policies._parameters import in_structure
from motorgrad.policies._policy import Composed, check_plain, has_rows
from motorgrad.policies._starting import Initial, function_of
from motorgrad.schema import count


class Tied(Composed, BinaryUnits):
    r"""A pool of $N$ units in $G$ groups, each of which fires as one (section 4.4 of the thesis).

    The units of a group share a draw and their parameters: unit $i$ does what unit $g_i$ of the `pool` does, so
    $\log\pi(a \mid y) = \sum_g \log p_g(a_g \mid y)$, with one term for each group. An action in which units of a group
    differ has probability 0. The ratio of active units then takes the values $0, 1/G, …, 1$ and is spread widely: that
    of $N$ independent units that fire with probability ½ has a standard deviation of $1/(2\sqrt N)$, that of groups of
    one size $1/(2\sqrt G)$. `halved` makes the groups finer.

    **Arguments:** `pool`, independent units, one for each group; `groups` $g$, that of each unit from 0 to $G - 1$,
    each named at least once.

    **Example:**

    ```python
    policy = Tied(Motoneurons(threshold=[0.3, 0.6], gain=[5.0, 5.0]), groups=[0, 0, 1, 1])
    policy.sample(jnp.array([0.5]), jnp.array([0.7, 0.7]))  # [1, 1, 0, 0]
    policy.halved().groups  # (0, 1, 2, 3)
    ```
    """

    pool: BinaryUnits
    groups: tuple[int, ...] = eqx.field(converter=python_numbers, static=True)

    def __check_init__(self) -> None:
        kind = type(self.pool).__name__
        check(isinstance(self.pool, BinaryUnits), "pool", kind, "a pool of binary units")
        check_plain("pool", self.pool)
        check(self.pool.independent, "pool", kind, "a pool of independent units")
        last = self.pool.outputs - 1
        wanted = f"the group of each unit, from 0 to {last}, and each group at least once"
        check(set(self.groups) == set(range(last + 1)), "groups", self.groups, wanted)

    @property
    def inputs(self) -> int:
        return self.pool.inputs

    @property
    def outputs(self) -> int:
        return len(self.groups)

    @property
    def uniforms(self) -> int:
        return self.pool.uniforms

    @property
    def independent(self) -> bool:
        return len(self.groups) == self.pool.outputs

    @property
    def separate(self) -> bool:
        return self.independent and self.pool.separate

    @property
    def _firsts(self) -> list[int]:
        """The first unit of each group."""
        return [self.groups.index(group) for group in range(self.pool.outputs)]

    def _of_units(self, values: Float[Array, " groups"]) -> Float[Array, " units"]:
        return values[np.array(self.groups)]

    def _of_groups(self, values: Float[Array, " units"]) -> Float[Array, " groups"]:
        return values[np.array(self._firsts)]

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return self._of_units(self.pool.prob(observation))

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " groups"]) -> Float[Array, " units"]:
        return self._of_units(self.pool.sample(observation, uniforms))

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        """The term of each group, at its first unit; 0 for the others, or −∞ where one differs from the first."""
        leading = self._of_groups(action)
        follows = jnp.where(action == self._of_units(leading), 0, -jnp.inf)
        return follows.at[np.array(self._firsts)].add(self.pool.log_probs(observation, leading))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        return in_structure(self, pool=self.pool.score(observation, self._of_groups(action)))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "groups parameters parameters"], ...]:
        """The pool's matrices."""
        return abilities.fisher(self.pool, observation, self._of_groups(action))

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "groups parameters parameters"], ...]:
        return abilities.fisher_sum(self.pool, observations, actions[:, np.array(self._firsts)], weights)

    def fisher_coordinates(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> Float[Array, " coordinates"]:
        return abilities.fisher_coordinates(self.pool, observation, self._of_groups(action))

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return self.pool.entropy(observation)

    def enumerate(self) -> Float[Array, "actions units"]:
        """All $2^G$ actions in which the units of each group agree."""
        return self.pool.enumerate()[:, np.array(self.groups)]

    def halved(self) -> "Tied":
        """Each group of several units split into two, which start with its parameters and draw independently.

        **Raises:** `ValueError` for a pool whose units share parameters.
        """
        wanted = "units of one kind, with parameters of their own"
        check(has_rows(self.pool), "pool", type(self.pool).__name__, wanted)
        groups = np.array(self.groups)
        parents: list[int] = []
        finer = np.zeros_like(groups)
        for group in range(self.pool.outputs):
            members = np.flatnonzero(groups == group)
            for half in filter(len, np.array_split(members, 2)):
                finer[half] = len(parents)
                parents.append(group)

        def inherited(leaf: Any) -> Any:
            return leaf[np.array(parents)] if leaf.shape[:1] == (self.pool.outputs,) else leaf

        return Tied(jax.tree.map(inherited, self.pool), finer)


class InitialTiedMotoneurons(InitialMotoneurons):
    """The units of `motoneurons` in groups of consecutive ones, each of which fires as one (see `Tied`)."""

    groups: int = count(2, 1, help="the number of groups, at most that of the units")

    def start(self, task: SizedTask | int) -> Initial:
        units = self.outputs(task)
        check(self.groups <= units, "groups", self.groups, f"at most {units}, the number of units")
        of = np.arange(units) * self.groups // units
        return lambda key: Tied(Motoneurons(self.thresholds(key, self.groups), jnp.zeros(self.groups)), of)


tied_motoneurons = function_of(InitialTiedMotoneurons)
