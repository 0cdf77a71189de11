"""The time of an evaluation, exact also where signals have single precision."""

import contextlib
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, UInt32

Seconds = Array | float


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
    shares: Float[Array, " crossings"] | None = None
    """For a block that slides on crossings: the share of its present mode there, from 0 to 1, and −1 where it is in one
    mode; see `Block.slides`."""

    def cycles(self, frequency: ArrayLike) -> Array:
        """The cycles of this frequency (Hz) since the start, without the whole ones: from 0 to 1, exact to single
        precision after years, where `frequency * time` is not.
        """
        return self.exactly(lambda time, frequency: frequency * time % 1.0, frequency)

    def exactly(self, function: Callable[..., Any], *values: ArrayLike, at: str = "time") -> Array:
        """A function of the seconds since the start, and of `values`, computed in double precision: the seconds `at`
        `"time"`, or at the `"start"` of the step. Values of single precision count as they were written, 0.1 as 0.1.
        """
        real = jnp.result_type(float)
        with jax.enable_x64(True):
            return self.doubled(function, *values, at=at).astype(real)

    def doubled(self, function: Callable[..., Any], *values: ArrayLike, at: str = "start") -> Any:
        """As `exactly`, but the result stays as it is: a condition, or a time in double precision."""
        with jax.enable_x64(True):
            return function(self._seconds(at), *map(as_written, values))

    def later(self, seconds: ArrayLike) -> Array:
        """The time this number of seconds after `start`, in double precision: what `next_jump` returns."""
        return self.doubled(lambda start: start + jnp.asarray(seconds).astype(jnp.float64))

    @property
    def blur(self) -> Array:
        """How far from the true ones the seconds of `exactly` may be by rounding, in seconds."""
        return blur(self.time, self.step)

    def spent(self, evaluations: ArrayLike) -> Array:
        """The seconds that this number of evaluations of the block takes, in double precision."""
        with jax.enable_x64(True):
            ticks = jnp.asarray(self.tick).astype(jnp.float64)
            step = jnp.asarray(self.step).astype(jnp.float64)
            length = jnp.where(ticks > 0, self.doubled(lambda start: start) / jnp.maximum(ticks, 1), step)
            return jnp.asarray(evaluations).astype(jnp.float64) * jnp.rint(step / length) * length

    def _seconds(self, at: str) -> Any:
        parts = (self.time, self.rest, self.within, self.begun)
        time, rest, within, begun = map(_wide, parts)
        return time + rest if at == "time" else time + rest - within + begun

    def sides(self, levels: Array) -> Array:
        """Whether each of `levels`, the block's crossings in their shape, is at least 0, held during a step."""
        return levels >= 0 if self.above is None else self.above.reshape(levels.shape)

    def between(self, present: Array, other: Array) -> Array:
        """The value of the present mode; where a block slides on a crossing, the mean of both by their shares."""
        if self.shares is None:
            return present
        shares = self.shares.reshape(jnp.shape(present))
        return self.unless_held(present, shares * present + (1 - shares) * other)

    def unless_held(self, free: Array, held: Array) -> Array:
        """One value where a block is free, another where it slides on its crossing."""
        return free if self.shares is None else jnp.where(self.shares.reshape(jnp.shape(free)) >= 0, held, free)

    @property
    def rising(self) -> Array:
        """In `crossed`: which of the crossings have just risen to 0 or above."""
        assert self.above is not None
        assert self.turned is not None
        return self.turned & self.above


def clock(tick: ArrayLike, length: float, within: ArrayLike) -> tuple[Any, Any]:
    """The time `within` seconds of a tick of `length` seconds, rounded to the precision of signals, and the rest."""
    real = jnp.result_type(float)
    with jax.enable_x64(True):
        exact = jnp.asarray(tick).astype(jnp.float64) * length + jnp.asarray(within).astype(jnp.float64)
        time = exact.astype(real)
        return time, (exact - time.astype(jnp.float64)).astype(real)


def in_precision(precision: str) -> Any:
    """A context in which floats have this precision. `"single"` leaves JAX's setting unchanged."""
    return jax.enable_x64(True) if precision == "double" else contextlib.nullcontext()


def blur(time: Array, step: Array | float) -> Array:
    """How far a `time` with its rest, within a `step`, may be from the true one by rounding, in seconds: what misses a
    jump by as little counts as on it.
    """
    own = float(jnp.finfo(jnp.asarray(time).dtype).eps)
    double = float(jnp.finfo(jnp.float64).eps)
    return 2.1 * own * step + (own**2 + 2.1 * double) * abs(time)


MAX_DECIMALS = 9


def as_written(value: ArrayLike) -> Any:
    """A number in double precision: one of single precision as the shortest decimal that rounds to it, the one that was
    written. So 0.1 Hz is 0.1 Hz, and not 0.100000001490116 Hz, which is a hundredth of a radian off after 10⁶ s.
    """
    traced = isinstance(value, Tracer)
    wide = _wide(value)
    given, xp = (value, jnp) if traced else (np.asarray(value), np)
    if given.dtype != xp.float32:
        return wide
    found = wide
    done = xp.zeros(given.shape, bool)
    for digits in range(MAX_DECIMALS + 1):
        decimal = xp.rint(wide * 10.0**digits) / 10.0**digits
        fits = decimal.astype(xp.float32) == given
        found = xp.where(fits & ~done, decimal, found)
        done = done | fits
        if not traced and done.all():
            break
    if not traced:
        return found
    return jax.lax.stop_gradient(found) + (wide - jax.lax.stop_gradient(wide))  # with the derivative of `wide`


def _wide(value: ArrayLike) -> Any:
    """A number in double precision, of NumPy where nothing is compiled: it is faster there."""
    return value.astype(jnp.float64) if isinstance(value, Tracer) else np.asarray(value, np.float64)
