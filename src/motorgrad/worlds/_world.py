"""What every world is: dynamics written in JAX that own their state and know nothing of rewards or learning."""

import abc
from typing import Any, ClassVar

from jaxtyping import Array, Float


class World(abc.ABC):
    """Dynamics as two pure functions, run inside a compiled loop and mapped over seeds.

    Randomness is explicit: `reset` and `step` consume `reset_uniforms` and `uniforms` numbers from U[0, 1), so that the
    numbers of a whole block of steps can be drawn at once.
    """

    uniforms: ClassVar[int] = 0
    reset_uniforms: ClassVar[int] = 0

    @abc.abstractmethod
    def reset(self, uniforms: Float[Array, " reset_uniforms"]) -> Any:
        """A state in which an episode begins."""

    @abc.abstractmethod
    def step(self, state: Any, action: Array, uniforms: Float[Array, " uniforms"]) -> Any:
        """The next state."""
