"""CMA-ES, as implemented in evosax."""

# pyright: reportMissingImports=false
# (evosax is of the extra `search`)

import dataclasses
import functools
import importlib.util
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, check_integer
from motorgrad.search._methods import Method, Places, State
from motorgrad.search._space import reflected


@dataclasses.dataclass(frozen=True)
class CmaEs(Method):
    r"""Covariance matrix adaptation (Hansen, *The CMA Evolution Strategy: A Tutorial*, 2016), from the package evosax.

    The candidates of a round are drawn from a Gaussian, whose mean and covariance then move towards the better half and
    away from the worse. Only the order of the scores matters. Failed candidates rank last; a round in which all fail
    changes nothing. The Gaussian is unbounded: a candidate beyond a bound is reflected into the range, and the Gaussian
    is updated with the original.

    - `population`: candidates per round, at least 4; by default $4 + \lfloor 3 \ln n \rfloor$ for $n$ numbers. A larger
      population tolerates more noise.
    - `width`: initial standard deviation, above 0, as a fraction of every number's range.

    **Raises:** `RuntimeError` if evosax is missing (`motorgrad[search]`).
    """

    population: int | None = None
    width: float = 0.2

    def __post_init__(self) -> None:
        if self.population is not None:
            check_integer("CmaEs.population", self.population, 4)
        check(0.0 < self.width < math.inf, "CmaEs.width", self.width, "a finite number above 0")
        if importlib.util.find_spec("evosax") is None:
            raise RuntimeError("CMA-ES needs the package evosax: pip install 'motorgrad[search]'")

    def batch(self, size: int) -> int:
        return self.population or 4 + int(3.0 * math.log(size))

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
        # evosax minimises, and gives equal scores an average rank, so that its weights would not sum up correctly
        worse = np.where(np.isfinite(scores), -np.asarray(scores, float), np.inf)
        rank = worse.argsort(kind="stable").argsort()
        strategy, params = self._strategy(drawn.shape[1])
        told = (jnp.asarray(drawn), jnp.asarray(rank, jnp.float32), self._like_evosax(before), params)
        return _arrays(strategy.tell(jax.random.key(0), *told)[0])

    def _strategy(self, size: int) -> tuple[Any, Any]:
        strategy, params = _compiled(self.batch(size), size)
        return strategy, params.replace(std_init=jnp.asarray(self.width, jnp.float32))

    def _like_evosax(self, state: State) -> Any:
        size = len(state["mean"])
        strategy, params = self._strategy(size)
        like = strategy.init(jax.random.key(0), jnp.zeros(size), params)
        return like.replace(**{name: jnp.asarray(value) for name, value in state.items()})


@functools.lru_cache
def _compiled(population: int, size: int) -> tuple[Any, Any]:
    """One strategy per shape, because evosax compiles every instance anew."""
    from evosax.algorithms import CMA_ES

    strategy = CMA_ES(population_size=population, solution=jnp.zeros(size))
    return strategy, strategy.default_params


def _arrays(state: Any) -> State:
    return {field.name: np.asarray(getattr(state, field.name)) for field in dataclasses.fields(state)}
