"""The time of an evaluation, exact also where signals have single precision."""

import contextlib
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, UInt32


class Moment(NamedTuple):
    """The time of an evaluation, and its random numbers."""

    tick: UInt32[Array, ""]
    """Number of completed ticks."""
    time: Float[Array, ""]
    """Seconds since the start; inside a step of the solver possibly between two ticks."""
    step: Float[Array, ""]
    """Seconds between two evaluations of this block."""
    uniforms: Float[Array, " uniforms"]
    """The block's numbers from U[0, 1) for this tick: the same in `output` and in `update`."""
    start: Float[Array, ""]
    """The time at which the current step of the solver began; elsewhere the same as `time`. What jumps in time goes by
    `start`, so that a jump at the end of a step is left to the next one."""
    rest: Float[Array, ""] | float = 0.0
    """What rounding took from `time`: their sum is exact to some nanoseconds after years. See `cycles`."""
    within: Float[Array, ""] | float = 0.0
    """Seconds since the tick."""
    above: Bool[Array, " crossings"] | None = None
    """Which of the block's `crossings` count as at least 0. They are held during a step of a solver that locates zero
    crossings; elsewhere `None`, and the block uses its inputs."""
    turned: Bool[Array, " crossings"] | None = None
    """In `crossed`: which of them have just changed."""
    begun: Float[Array, ""] | float = 0.0
    """Seconds from the tick to `start`."""

    def cycles(self, frequency: Any) -> Any:
        """The cycles of this frequency (Hz) since the start, without the whole ones: from 0 to 1, exact to single
        precision after years, where `frequency * time` is not.
        """
        return self.exactly(lambda time, frequency: frequency * time % 1.0, frequency)

    def exactly(self, function: Callable[..., Any], *values: Any, at: str = "time") -> Any:
        """A function of the seconds since the start, and of `values`, computed in double precision: the seconds `at`
        `"time"`, or at the `"start"` of the step.
        """
        real = jnp.result_type(float)
        with jax.enable_x64(True):
            return function(self._seconds(at), *(jnp.asarray(each).astype(jnp.float64) for each in values)).astype(real)

    def later(self, seconds: Any) -> Any:
        """The time this number of seconds after `start`, in double precision: what `next_jump` returns."""
        with jax.enable_x64(True):
            return self._seconds("start") + jnp.asarray(seconds).astype(jnp.float64)

    def _seconds(self, at: str) -> Any:
        parts = (self.time, self.rest, self.within, self.begun)
        time, rest, within, begun = (jnp.asarray(each).astype(jnp.float64) for each in parts)
        return time + rest if at == "time" else time + rest - within + begun

    def sides(self, levels: Any) -> Any:
        """Whether each of `levels`, the block's crossings in their shape, is at least 0, held during a step."""
        return levels >= 0 if self.above is None else self.above.reshape(levels.shape)

    @property
    def rising(self) -> Any:
        """In `crossed`: which of the crossings have just risen to 0 or above."""
        assert self.above is not None
        assert self.turned is not None
        return self.turned & self.above


def clock(tick: Any, length: float, within: Any) -> tuple[Any, Any]:
    """The time `within` seconds of a tick of `length` seconds, rounded to the precision of signals, and the rest."""
    real = jnp.result_type(float)
    with jax.enable_x64(True):
        exact = jnp.asarray(tick).astype(jnp.float64) * length + jnp.asarray(within).astype(jnp.float64)
        time = exact.astype(real)
        return time, (exact - time.astype(jnp.float64)).astype(real)


def in_precision(precision: str) -> Any:
    """A context in which floats have this precision. `"single"` leaves JAX's setting unchanged."""
    return jax.enable_x64(True) if precision == "double" else contextlib.nullcontext()


def rounding() -> float:
    """The relative error of a time by rounding: what misses a jump by as little counts as on it."""
    return 2.1 * float(jnp.finfo(jnp.result_type(float)).eps)
