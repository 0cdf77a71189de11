"""The interface of worlds, and their numerical integrator."""

import abc
from collections.abc import Callable
from typing import ClassVar, TypeVar

import jax
from jaxtyping import Array, Float, PyTree

T = TypeVar("T")


class World(abc.ABC):
    """Dynamics as two pure functions, written in JAX, run inside a compiled loop and mapped over seeds.

    A world owns its state, and knows nothing of rewards or learning. Randomness is explicit: `reset` and `step` consume
    `reset_uniforms` and `uniforms` numbers from U[0, 1), so the numbers of a whole block of steps can be drawn at once.
    """

    uniforms: ClassVar[int] = 0
    reset_uniforms: ClassVar[int] = 0

    @abc.abstractmethod
    def reset(self, uniforms: Float[Array, " reset_uniforms"]) -> PyTree:
        """The initial state of an episode."""

    @abc.abstractmethod
    def step(self, state: PyTree, action: Array, uniforms: Float[Array, " uniforms"]) -> PyTree:
        """The next state."""


def runge_kutta(rate: Callable[[T], T], state: T, timestep: float) -> T:
    """Advance a state, any pytree, by one time step of the classical fourth-order Runge–Kutta method.

    **Arguments:** `rate`, which maps a state to its time derivative; the state; the time step in s.

    The stages lie at half and at the end of the time step. (As printed in appendix A.3 of the thesis, they would lie at
    1/2 and 1 second.)
    """

    def advance(time: float, slope: T) -> T:
        return jax.tree.map(lambda at, per: at + time * per, state, slope)

    first = rate(state)
    second = rate(advance(timestep / 2, first))
    third = rate(advance(timestep / 2, second))
    last = rate(advance(timestep, third))
    mean = jax.tree.map(lambda a, b, c, d: (a + 2 * b + 2 * c + d) / 6, first, second, third, last)
    return advance(timestep, mean)
