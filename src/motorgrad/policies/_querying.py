"""Active learning: policies that also request the next input."""

from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask
from motorgrad.policies._binary import BinaryUnits, InitialMotoneurons, Motoneurons
from motorgrad.policies._parameters import fixed, in_structure
from motorgrad.policies._policy import Composed
from motorgrad.policies._starting import Initial, check_interval, function_of
from motorgrad.schema import Range, count, static


class Querying(Composed):
    r"""A policy of one input that requests its next input: the less certain it is of an input, the more often
    (section 4.4.1 of the thesis).

    The last number of an action is the query. The interval [`low`, `high`] is divided into equal cells. A cell is drawn
    with probability proportional to the entropy $\mathcal H$ of `policy` at its centre, and the query uniformly within
    the cell. A fraction `explore` of the queries is uniform over the whole interval, so that no part of it is
    neglected.

    The query depends on the parameters, but counts as chosen by the task: log-probability, score and entropy are those
    of `policy` alone. Learning then maximises the reward under the distribution of requested inputs.

    **Arguments:** `policy`, a pool of binary units with one input; `low` and `high`; `explore`, in [0, 1]; `cells`,
    from 1 to 10,000.

    **Example:**

    ```python
    policy = Querying(Motoneurons(threshold=[0.5], gain=[20.0]), cells=4)
    policy.query_probabilities()  # highest in the two middle cells, next to the threshold
    ```
    """

    policy: BinaryUnits
    low: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.0)
    high: Float[Array, ""] = fixed(converter=jnp.asarray, default=1.0)
    explore: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.1)
    cells: int = eqx.field(static=True, default=32)

    def __check_init__(self) -> None:
        check(isinstance(self.policy, BinaryUnits), "policy", type(self.policy).__name__, "a pool of binary units")
        check(self.policy.inputs == 1, "policy.inputs", self.policy.inputs, "1")
        check(1 <= self.cells <= 10_000, "cells", self.cells, "from 1 to 10,000")
        if not any(isinstance(value, Tracer) for value in (self.low, self.high, self.explore)):
            low, high, share = (float(np.asarray(value)) for value in (self.low, self.high, self.explore))
            check_interval(low, high)
            check(0 <= share <= 1, "explore", share, "in [0, 1]")

    @property
    def actions(self) -> str:
        return "querying"

    @property
    def inputs(self) -> int:
        return self.policy.inputs

    @property
    def outputs(self) -> int:
        return self.policy.outputs + 1

    @property
    def uniforms(self) -> int:
        return self.policy.uniforms + 1

    def query_probabilities(self) -> Float[Array, " cells"]:
        """The probability that the next input is requested from each cell."""
        middle = (jnp.arange(self.cells) + 0.5) / self.cells
        entropy = jax.vmap(self.policy.entropy)((self.low + (self.high - self.low) * middle)[:, None])
        total = jnp.sum(entropy)
        certain = total <= 0  # of its action everywhere: all cells are equally informative
        share = jnp.where(certain, 1 / self.cells, entropy / jnp.where(certain, 1, total))
        return self.explore / self.cells + (1 - self.explore) * share

    def query(self, uniform: Float[Array, ""]) -> Float[Array, ""]:
        """The requested input, as a function of a number from U[0, 1)."""
        ends = jnp.cumsum(self.query_probabilities())
        target = uniform * ends[-1]
        cell = jnp.minimum(jnp.sum(target >= ends), self.cells - 1)
        start = jnp.where(cell > 0, ends[cell - 1], 0)
        inside = (target - start) / jnp.maximum(ends[cell] - start, jnp.finfo(ends.dtype).tiny)
        return self.low + (self.high - self.low) * (cell + jnp.clip(inside, 0, 1)) / self.cells

    def prob(self, observation: Float[Array, " 1"]) -> Float[Array, " units"]:
        """Firing probability of each unit, without an entry for the query."""
        return self.policy.prob(observation)

    def sample(self, observation: Float[Array, " 1"], uniforms: Float[Array, " units+1"]) -> Float[Array, " units+1"]:
        return self._with_query(self.policy.sample(observation, uniforms[:-1]), self.query(uniforms[-1]))

    def mode(self, observation: Float[Array, " 1"]) -> Float[Array, " units+1"]:
        """The most probable action, and the centre of the most probable cell."""
        middle = (jnp.argmax(self.query_probabilities()) + 0.5) / self.cells
        return self._with_query(self.policy.mode(observation), self.low + (self.high - self.low) * middle)

    @staticmethod
    def _with_query(action: Float[Array, " units"], query: Float[Array, ""]) -> Float[Array, " units+1"]:
        return jnp.append(action, query.astype(action.dtype))

    def log_prob(self, observation: Float[Array, " 1"], action: Float[Array, " units+1"]) -> Float[Array, ""]:
        return self.policy.log_prob(observation, action[:-1])

    def score(self, observation: Float[Array, " 1"], action: Float[Array, " units+1"]) -> Self:
        return in_structure(self, policy=self.policy.score(observation, action[:-1]))

    def fisher(
        self, observation: Float[Array, " 1"], action: Float[Array, " units+1"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        return abilities.fisher(self.policy, observation, action[:-1])

    def entropy(self, observation: Float[Array, " 1"]) -> Float[Array, ""]:
        return self.policy.entropy(observation)

    def enumerate(self) -> Array:
        raise ValueError("Querying: has infinitely many actions: the query is a real number; enumerate its policy's")


class InitialQueryingMotoneurons(InitialMotoneurons):
    """The units of `motoneurons` for all actions but the last, which requests the next input.

    They request inputs from [`low`, `high`] in proportion to their entropy in each of `cells`, and a fraction `explore`
    uniformly.
    """

    units: int | None = count(None, 1, help="the length of an action, the request included, by default the task's")
    low: float = static(0.0, help="the lower end of the range of the thresholds and of the requests")
    explore: float = static(0.1, allowed=Range(0, 1), help="the share of requests that are uniform")
    cells: int = count(32, 1, 10_000, help="the number of cells in which entropy is measured")

    def start(self, task: SizedTask | int) -> Initial:
        outputs = self.outputs(task)
        check(outputs > 1, "outputs", outputs, "at least 2: the last is the requested input")

        def initial(key: jax.Array) -> Querying:
            pool = Motoneurons(self.thresholds(key, outputs - 1), jnp.zeros(outputs - 1))
            low, high, share = jnp.asarray([self.low, self.high, self.explore], jnp.result_type(float))
            return Querying(pool, low, high, share, self.cells)

        return initial


querying_motoneurons = function_of(InitialQueryingMotoneurons)
