"""Methods as implemented in evosax: CMA-ES and evolution strategies."""

# pyright: reportMissingImports=false
# (evosax is of the extra `search`)

import abc
import dataclasses
import functools
import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Float, PyTree

from motorgrad._errors import check
from motorgrad._extras import require
from motorgrad.schema import count, number, path_of
from motorgrad.search._methods import Method, Places, State
from motorgrad.search._space import reflected


class _Evosax(Method):
    """A method of evosax, whose candidates are drawn from an unbounded distribution and reflected into the range."""

    title: ClassVar[str]

    def validate(self) -> None:
        require(f"{self.title} needs", "evosax", "search")

    @abc.abstractmethod
    def _strategy(self, size: int) -> tuple[Any, Any]:
        """evosax's strategy for this number of parameters, and its settings."""

    @abc.abstractmethod
    def _costs(self, scores: Float[np.ndarray, " batch"]) -> Float[np.ndarray, " batch"]:
        """The scores in the form that evosax minimises."""

    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        strategy, params = self._strategy(len(start))
        return _arrays(strategy.init(jax.random.key(0), jnp.asarray(start, jnp.float32), params))

    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        strategy, params = self._strategy(len(state["mean"]))
        key = jax.random.key(int(random.integers(2**32)))
        drawn, after = strategy.ask(key, self._like_evosax(state), params)
        return reflected(np.asarray(drawn, float)), {**_arrays(after), "drawn": np.asarray(drawn)}

    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        del candidates  # reflected ones
        drawn = state["drawn"]
        before = {name: value for name, value in state.items() if name != "drawn"}
        if not np.isfinite(scores).any():
            return before
        worse = np.where(np.isfinite(scores), -np.asarray(scores, float), np.inf)
        strategy, params = self._strategy(drawn.shape[1])
        arguments = (
            jnp.asarray(drawn),
            jnp.asarray(self._costs(worse), jnp.float32),
            self._like_evosax(before),
            params,
        )
        return _arrays(strategy.tell(jax.random.key(0), *arguments)[0])

    def _like_evosax(self, state: State) -> Any:
        size = len(state["mean"])
        strategy, params = self._strategy(size)
        like = strategy.init(jax.random.key(0), jnp.zeros(size), params)
        return jax.tree_util.tree_map_with_path(lambda path, _: jnp.asarray(state[path_of(path)]), like)


@dataclasses.dataclass(frozen=True)
class CmaEs(_Evosax):
    r"""Covariance matrix adaptation (Hansen, *The CMA Evolution Strategy: A Tutorial*, 2016), from the package evosax.

    The candidates of a round are drawn from a Gaussian, whose mean and covariance then move towards the better half and
    away from the worse. Only the order of the scores matters. Failed candidates rank last; a round in which all fail
    changes nothing. The Gaussian is unbounded: a candidate beyond a bound is reflected into the range, and the Gaussian
    is updated with the original.

    **Raises:** `RuntimeError` if evosax is missing (`motorgrad[search]`).
    """

    title: ClassVar[str] = "CMA-ES"

    population: int | None = count(
        None,
        4,
        help=r"candidates per round; by default $4 + \lfloor 3 \ln n \rfloor$ for $n$ numbers. A larger population "
        "tolerates more noise",
    )
    width: float = number(
        0.2, 0, open_low=True, help="initial standard deviation, as a fraction of every number's range"
    )

    def batch(self, size: int) -> int:
        return self.population or 4 + int(3.0 * math.log(size))

    def _costs(self, scores: Float[np.ndarray, " batch"]) -> Float[np.ndarray, " batch"]:
        # evosax gives equal scores an average rank, so that its weights would not sum up correctly
        return scores.argsort(kind="stable").argsort()

    def _strategy(self, size: int) -> tuple[Any, Any]:
        strategy, params = _cma_es(self.batch(size), size)
        return strategy, params.replace(std_init=jnp.asarray(self.width, jnp.float32))


@dataclasses.dataclass(frozen=True)
class EvolutionStrategy(_Evosax):
    r"""Evolution strategies in the form of Salimans et al. (2017), from the package evosax.

    The candidates of a round are pairs $\mu \pm \sigma\epsilon_i$ with standard normal $\epsilon_i$ (Brockhoff et al.,
    2010). With scores replaced by their ranks $u$, spread evenly over $[-\frac12, \frac12]$,

    $$ g = \frac{1}{n\sigma} \sum_i u_i\,\epsilon_i $$

    estimates the gradient of the mean score of the Gaussian about $\mu$, which Adam climbs. $\sigma$ is constant. There
    is no covariance matrix, so time and memory grow in proportion to the number of numbers. Equal scores have equal
    ranks, failed candidates the lowest; a round in which all fail changes nothing. Candidates beyond a bound are
    reflected into the range.

    **Raises:** `RuntimeError` if evosax is missing (`motorgrad[search]`).
    """

    title: ClassVar[str] = "an evolution strategy"

    population: int = count(32, 2, help="candidates per round, an even number")
    width: float = number(0.05, 0, open_low=True, help=r"$\sigma$, as a fraction of every number's range")
    learning_rate: float = number(0.02, 0, open_low=True, help="learning rate of Adam, in the same units")

    def validate(self) -> None:
        super().validate()
        check(self.population % 2 == 0, "population", self.population, "an even number")

    def batch(self, size: int) -> int:
        return self.population

    def _costs(self, scores: Float[np.ndarray, " batch"]) -> Float[np.ndarray, " batch"]:
        from scipy.stats import rankdata  # loading it would slow down every command's start

        return (rankdata(scores) - 1) / (len(scores) - 1) - 0.5

    def _strategy(self, size: int) -> tuple[Any, Any]:
        return _evolution_strategy(self.population, size, self.width, self.learning_rate)


@functools.lru_cache
def _cma_es(population: int, size: int) -> tuple[Any, Any]:
    """The strategy of a shape and its settings, kept as evosax compiles every instance anew."""
    from evosax.algorithms import CMA_ES

    strategy = CMA_ES(population_size=population, solution=jnp.zeros(size))
    return strategy, strategy.default_params


@functools.lru_cache
def _evolution_strategy(population: int, size: int, width: float, rate: float) -> tuple[Any, Any]:
    from evosax.algorithms import Open_ES

    strategy = Open_ES(
        population_size=population,
        solution=jnp.zeros(size),
        optimizer=optax.adam(rate),
        std_schedule=optax.constant_schedule(width),
        fitness_shaping_fn=lambda population, fitness, state, params: fitness,
    )
    return strategy, strategy.default_params


def _arrays(state: PyTree) -> State:
    return {path_of(path): np.asarray(leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(state)}
