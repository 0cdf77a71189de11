"""What every block is: named ports, parameters, state, and three pure functions of them.

A block is a frozen dataclass of plain numbers. What may change while a diagram runs is a `Parameter`; what decides
shapes or structure is a `Setting`. Inside the functions `self` has arrays in place of its parameters, so that one
compiled program serves all values, and one call all blocks of a type.
"""

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from jaxtyping import Array, Float, UInt32

from motorgrad._errors import check, choice
from motorgrad.lab._parameter import Parameter, Setting, nested, parameters_of, settings_of
from motorgrad.lab._port import Port, checked_shape

Timing = Literal["continuous", "discrete", "inherited"]
Ports = Mapping[str, Port]
"""Ports by name, in order."""
Signals = dict[str, Array]
"""What is at ports, by name."""


class Moment(NamedTuple):
    """When a block is asked, and the random numbers it is given."""

    tick: UInt32[Array, ""]
    """How many ticks the diagram has made."""
    time: Float[Array, ""]
    """Seconds since the start; within an RK4 step also halfway to the next tick."""
    step: Float[Array, ""]
    """Seconds from one evaluation of this block to the next."""
    uniforms: Float[Array, " uniforms"]
    """The block's own numbers from U[0, 1) for this tick: the same ones in `output` and in `update`."""


@dataclasses.dataclass(frozen=True)
class Block:
    """A part of a diagram. Subclasses are frozen dataclasses; see `motorgrad.lab` for how to write one.

    **Arguments**, by name, of every block: `every`, so many ticks lie between its evaluations; or `period`, so many
    seconds, a whole number of ticks. Between evaluations its outputs are held.
    """

    every: Annotated[int, Setting("evaluated once in so many ticks")] = dataclasses.field(default=1, kw_only=True)
    period: Annotated[float | None, Setting("evaluated once in so many seconds, in place of every")] = (
        dataclasses.field(default=None, kw_only=True)
    )

    name: ClassVar[str]
    """The type's name in the registry and in files."""
    category: ClassVar[str]
    """Under which heading an editor lists it."""
    timed: ClassVar[bool] = False
    """Whether it has no state but depends on time: it is continuous, unless given a sample period."""

    def __post_init__(self) -> None:
        for name, parameter in parameters_of(type(self)).items():
            object.__setattr__(self, name, parameter.plain(name, getattr(self, name)))
        for name, declared in settings_of(type(self)).items():
            object.__setattr__(self, name, nested(getattr(self, name)))
            if declared.choices:
                choice(name, getattr(self, name), declared.choices)
        whole = isinstance(self.every, int) and not isinstance(self.every, bool)
        check(whole and 1 <= self.every < 2**31, "every", self.every, "a whole number of ticks from 1")
        number = isinstance(self.period, int | float) and not isinstance(self.period, bool)
        valid = self.period is None or (number and 0 < self.period < np.inf)
        check(valid, "period", self.period, "None or a positive number of seconds")
        check(self.every == 1 or self.period is None, "period", self.period, "None where every is given")
        self.validate()
        _ = self.inputs, self.outputs  # ports are checked as they are made

    def validate(self) -> None:
        """Refuse what does not fit together, with `motorgrad._errors.check`; parameters are plain numbers here."""

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
        """How many numbers from U[0, 1) it is given at every tick."""
        return 0

    @property
    def init_uniforms(self) -> int:
        """How many numbers from U[0, 1) `init` is given."""
        return 0

    @property
    def timing(self) -> Timing:
        """When it is evaluated.

        - `"discrete"`: exactly once at every tick that is its own; its outputs are held in between. So is what has
          state or chance.
        - `"continuous"`: once at every tick and again inside an RK4 step. So is what has a `derivative` or is `timed`.
        - `"inherited"`: continuous where something continuous reaches it without delay, else discrete. So is all else.
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
        """Whether its state moves continuously."""
        return type(self).derivative is not Block.derivative

    def init(self, uniforms: Float[Array, " init_uniforms"]) -> Any:
        """The state before the first tick: a pytree of arrays, by default none. A continuous block's are floats."""
        del uniforms
        return ()

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        """The outputs by name. `inputs` has the ports with feedthrough only, as the others are not known yet."""
        del state, inputs, now
        return {}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        """The state after this evaluation; `inputs` has all ports.

        A continuous block's `state` is here the one at the end of the tick, integrated: it may be put back within
        limits. Its inputs are those at the tick's start.
        """
        del inputs, now
        return state

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        """The state's rate of change per second, in the state's structure; `inputs` has all ports."""
        raise NotImplementedError(f"{type(self).__name__} has no continuous state")

    def check_broadcasts(self, name: str, shape: tuple[int, ...]) -> None:
        """Refuse a parameter that does not broadcast to `shape`, and what is no shape."""
        shape = checked_shape("shape", shape)
        given = np.shape(getattr(self, name))
        fits = len(given) <= len(shape) and all(a in (1, b) for a, b in zip(given[::-1], shape[::-1], strict=False))
        check(fits, f"{name}: shape", given, f"one that broadcasts to {shape}")

    def ticks(self, tick: float) -> int:
        """How many ticks of `tick` seconds lie between evaluations. **Raises** `ValueError` if that is not whole."""
        return self.every if self.period is None else whole_ticks("period", self.period, tick)

    @property
    def parameters(self) -> Mapping[str, Parameter]:
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
        return {name: part.array(getattr(self, name)) for name, part in self.parameters.items()}

    def bound(self, values: Mapping[str, Any]) -> Self:
        """The block with these arrays in place of its parameters, unchecked: what the functions see as `self`."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.__dict__.update(values)
        return other


def whole_ticks(name: str, period: float, tick: float) -> int:
    """A period in ticks. **Raises** `ValueError` unless it is a whole number of them, to one part in a million."""
    ticks = round(period / tick)
    whole = ticks >= 1 and abs(period / tick - ticks) <= 1e-6 * ticks
    check(whole, name, period, f"a whole number of ticks of {tick:g} s")
    return ticks
