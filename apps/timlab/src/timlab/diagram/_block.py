"""What a block is: named ports, parameters, a state, and pure functions of them.

A block is a frozen dataclass of plain numbers. In its functions `self` has arrays in place of parameters, so that one
compiled program serves all parameter values, and one call evaluates all blocks of a type. A `Sink` only records; a
`HostBlock` runs on the host instead of in compiled code.
"""

import abc
import dataclasses
from collections import ChainMap
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad.schema import Declared, Range, Settings, check_fields, count, hints_of, static
from timlab.diagram._declarations import (
    Port,
    checked_shape,
    dtype_of,
    nested,
    parameters_of,
    settings_of,
)
from timlab.diagram._moment import Moment

Timing = Literal["continuous", "discrete", "inherited"]
Ports = Mapping[str, Port]
"""Ports by name, in order."""
Signals = dict[str, Array]
"""Values at ports, by name."""


@dataclasses.dataclass(frozen=True)
class Block(Settings):
    """Base class of all blocks. Subclasses are frozen dataclasses; `timlab` explains how to write one.

    Every block has two keyword arguments: `every`, the number of ticks between two evaluations, or `period`, the same
    in seconds, a whole number of ticks. Outputs are held between evaluations.
    """

    _: dataclasses.KW_ONLY
    every: int = count(1, 1, help="number of ticks between evaluations")
    period: float | None = static(
        None, allowed=Range(0, open_low=True), unit="s", help="time between evaluations, in place of `every`"
    )

    name: ClassVar[str]
    """The type's name in the registry and in files."""
    category: ClassVar[str]
    """The heading under which the editor lists the block."""
    timed: ClassVar[bool] = False
    """Whether a stateless block depends on time. Such a block is continuous unless it has a sample period."""

    def __post_init__(self) -> None:
        for name in settings_of(type(self)):
            if hints_of(type(self))[name] is Any:  # the type does not say that lists become tuples
                object.__setattr__(self, name, nested(getattr(self, name)))
        check_fields(self)
        self.validate()
        check(self.every == 1 or self.period is None, "period", self.period, "None where every is given")
        _ = self.inputs, self.outputs  # making the ports checks them

    def validate(self) -> None:
        """Check how fields fit together, with `motorgrad._errors.check`. Each is checked already; parameters are plain
        numbers here.
        """

    @property
    def inputs(self) -> Ports:
        """The input ports by name, in order. They may depend on settings, not on parameters."""
        return {}

    @property
    def outputs(self) -> Ports:
        """The output ports by name, in order."""
        return {}

    @property
    def uniforms(self) -> int:
        """How many numbers from U[0, 1) the block consumes per tick."""
        return 0

    @property
    def init_uniforms(self) -> int:
        """How many numbers from U[0, 1) `init` consumes."""
        return 0

    @property
    def timing(self) -> Timing:
        """When the block is evaluated.

        - `"discrete"`: exactly once at each of its ticks; outputs are held in between. Blocks with discrete state or
          random numbers.
        - `"continuous"`: once per tick and again inside an RK4 step. Blocks with a `derivative`, and `timed` ones.
        - `"inherited"`: continuous if a continuous block reaches it without delay, else discrete. All other blocks.
        """
        if self.is_continuous:
            return "continuous"
        kind = type(self)
        stateful = kind.update is not Block.update or kind.init is not Block.init or self.uniforms > 0
        if stateful or self.every > 1 or self.period is not None:
            return "discrete"
        return "continuous" if self.timed else "inherited"

    @property
    def is_continuous(self) -> bool:
        """Whether the block has a continuous state."""
        return type(self).derivative is not Block.derivative

    def init(self, uniforms: Float[Array, " init_uniforms"]) -> PyTree[Array]:
        """The state before the first tick: a pytree of arrays, empty by default. A continuous block's leaves are
        floats.
        """
        del uniforms
        return ()

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        """The outputs by name. `inputs` contains only the ports with feedthrough; the others are not known yet."""
        del state, inputs, now
        return {}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        """The state after this evaluation; `inputs` contains all ports.

        For a continuous block `state` is the integrated state at the end of the tick, which may be projected, for
        example onto limits; the inputs are those at the start of the tick.
        """
        del inputs, now
        return state

    def derivative(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        """The time derivative of the state, per second, in the state's structure; `inputs` contains all ports."""
        raise NotImplementedError(f"{type(self).__name__} has no continuous state")

    def next_jump(self, now: Moment) -> Float[Array, ""]:
        """The first time after `now.start` at which an output jumps, in seconds; infinite if there is none.

        A `timed` block that jumps declares it, and decides by `now.start`. RK4 steps are then split at the jumps.
        """
        raise NotImplementedError(f"{type(self).__name__} does not declare jumps")

    @property
    def jumps(self) -> bool:
        """Whether the block declares its jumps."""
        return type(self).next_jump is not Block.next_jump

    def crossings(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Float[Array, " crossings"]:
        """Numbers that a solver with adaptive steps watches: where one changes between negative and not negative, it
        locates the zero and begins a new step there. `inputs` contains all ports.

        During a step the block uses `now.above` or `now.sides`, so that nothing jumps inside the step. With RK4,
        only blocks with a continuous state and `crossed` have crossings, and they are found at ticks.
        """
        del state, inputs, now
        return jnp.zeros(0)

    def crossed(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        """The state just after some of the crossings, `now.turned`, have changed to `now.above`: a reset, or another
        mode. Before the first tick all of them count as negative. `inputs` contains all ports.
        """
        del inputs, now
        return state

    @property
    def switches(self) -> bool:
        """Whether a crossing changes the block's state."""
        return type(self).crossed is not Block.crossed

    @property
    def slides(self) -> slice:
        """Which of the crossings may be held where they are reached without end, in ever shorter times.

        A block with two modes then outputs `now.between` them, the mean by the share of each that keeps the crossing at
        zero (Filippov, 1988). A block with a continuous state rests: its state is held where `crossed` leads to.
        """
        return slice(0, 0)

    @property
    def falls(self) -> bool:
        """Whether those crossings are held where they fall: reached from above."""
        return False

    def check_broadcasts(self, name: str, shape: tuple[int, ...]) -> None:
        """Refuse a parameter that does not broadcast to `shape`, and an invalid shape."""
        shape = checked_shape("shape", shape)
        given = np.shape(getattr(self, name))
        fits = len(given) <= len(shape) and all(a in (1, b) for a, b in zip(given[::-1], shape[::-1], strict=False))
        check(fits, f"{name}: shape", given, f"one that broadcasts to {shape}")

    def ticks(self, tick: float) -> int:
        """The number of ticks of `tick` seconds between two evaluations. **Raises** `ValueError` if it is not whole."""
        return self.every if self.period is None else whole_ticks("period", self.period, tick)

    @property
    def parameters(self) -> Mapping[str, Declared]:
        """The parameters that are present, by name. Settings may add parameters to those of the type; such names may
        have dots."""
        declared = parameters_of(type(self))
        return {name: part for name, part in declared.items() if getattr(self, name) is not None}

    @property
    def structure(self) -> Any:
        """What, beside their type and the shapes of their parameters, blocks have in common that are compiled as one;
        it can be hashed."""
        settings = (name for name in settings_of(type(self)) if name not in ("every", "period"))
        return tuple((name, repr(getattr(self, name))) for name in settings)

    def retuned(self, values: Mapping[str, Any]) -> Self:
        """The block with other values of some parameters or settings, by name, checked as a new one is."""
        return dataclasses.replace(self, **values)

    def values(self) -> dict[str, np.ndarray]:
        """The parameters that are present by name, as arrays."""
        return {name: np.asarray(getattr(self, name), dtype_of(part.kind)) for name, part in self.parameters.items()}

    def bound(self, values: Mapping[str, Any]) -> Self:
        """The block with arrays in place of its parameters, unchecked: the `self` of its functions in compiled code."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.__dict__.update(values)
        return other


def whole_ticks(name: str, period: float, tick: float) -> int:
    """A period in ticks. **Raises** `ValueError` unless it is a whole number of ticks, to one part in a million."""
    check_arguments(whole_ticks, locals())
    ticks = round(min(period / tick, 2**62))  # their quotient may be infinite
    whole = ticks >= 1 and abs(period / tick - ticks) <= 1e-6 * ticks
    check(whole, name, period, f"a whole number of ticks of {tick:g} s")
    return ticks


@dataclasses.dataclass(frozen=True)
class Sink(Block):
    """A block without outputs, whose inputs are recorded at each of its ticks.

    None of its code runs in a tick. What it shows is made from a `Record` afterwards.
    """


class HostMoment(NamedTuple):
    """The time of an evaluation and its random numbers on the host: a `Moment` for all seeds."""

    tick: int
    time: float
    step: float
    uniforms: Float[np.ndarray, "seeds uniforms"]


class Host(abc.ABC):
    """The running part of a host block: one object for all seeds, which lead in every array.

    `block` is the block with its current parameters as arrays; they may change between two calls.
    """

    @abc.abstractmethod
    def output(self, block: "HostBlock", inputs: dict[str, np.ndarray], now: HostMoment) -> dict[str, np.ndarray]:
        """The outputs by name, each of shape `(seeds, …)`. `inputs` contains only the ports with feedthrough."""

    @abc.abstractmethod
    def update(self, block: "HostBlock", inputs: dict[str, np.ndarray], now: HostMoment) -> None:
        """Advance to the next evaluation; `inputs` contains all ports."""

    @abc.abstractmethod
    def snapshot(self) -> dict[str, np.ndarray]:
        """A copy of everything that `restore` needs, by name; seeds lead."""

    @abc.abstractmethod
    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """Return to a snapshot."""

    def close(self) -> None:  # noqa: B027  (most hosts have nothing to release)
        """Release resources."""


@dataclasses.dataclass(frozen=True)
class HostBlock(Block, abc.ABC):
    """A block whose functions run on the host, for all seeds at once, exactly once at each of its ticks.

    Its inputs should have no feedthrough where possible: a tick is then a single compiled call. Its `Host` takes the
    place of `init`, `output` and `update`. Parameters are the same for all seeds.
    """

    @property
    def timing(self) -> Timing:
        return "discrete"

    @property
    def no_restore(self) -> str | None:
        """Why its state cannot be saved and restored; `None` where it can."""
        return None

    @abc.abstractmethod
    def start(self, seeds: np.ndarray, uniforms: Float[np.ndarray, "seeds init_uniforms"], threads: int = 0) -> Host:
        """The host for these seeds before the first tick. `threads` is the number of threads that it may use, 0 for one
        per processor.
        """


BLOCKS: ChainMap[str, type[Block]] = ChainMap({})
"""Every block type by its name in files. `timlab.blocks` fills it; you may add types of your own."""
