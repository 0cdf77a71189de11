"""Between numbers and lists of them."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad._errors import check
from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Setting
from motorgrad.lab._port import Port, checked_shape

MOST = 1000  # ports of a block
HOW = ("sum", "mean", "product", "max", "min", "norm")


@dataclasses.dataclass(frozen=True)
class Join(Block):
    """Puts its inputs `u1`, `u2`, … of the given sizes one after the other into one list."""

    name: ClassVar[str] = "join"
    category: ClassVar[str] = "vectors"

    sizes: Annotated[tuple[int, ...], Setting("how many numbers each input has, 0 for one that is no list")] = (0, 0)

    def validate(self) -> None:
        _check_indices("sizes", self.sizes)

    @property
    def inputs(self) -> Ports:
        return {f"u{number}": Port((size,) if size else ()) for number, size in enumerate(self.sizes, 1)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port((sum(max(size, 1) for size in self.sizes),))}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": jnp.concatenate([jnp.atleast_1d(u) for u in inputs.values()])}


@dataclasses.dataclass(frozen=True)
class Select(Block):
    """Gives some entries of a list, in the order asked for; one as a number if `single`."""

    name: ClassVar[str] = "select"
    category: ClassVar[str] = "vectors"

    size: Annotated[int, Setting("how many numbers the input has")] = 2
    entries: Annotated[tuple[int, ...], Setting("which entries, from 0")] = (0,)
    single: Annotated[bool, Setting("whether one entry is given as a number, not as a list")] = True

    def validate(self) -> None:
        checked_shape("size", (self.size,))
        _check_indices("entries", self.entries)
        check(max(self.entries) < self.size, "entries", self.entries, f"below size = {self.size}")
        check(isinstance(self.single, bool), "single", self.single, "true or false")

    @property
    def inputs(self) -> Ports:
        return {"u": Port((self.size,))}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(() if self._one else (len(self.entries),))}

    @property
    def _one(self) -> bool:
        return self.single and len(self.entries) == 1

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        u = inputs["u"]
        return {"y": u[self.entries[0]] if self._one else jnp.stack([u[entry] for entry in self.entries])}


@dataclasses.dataclass(frozen=True)
class Reduce(Block):
    """Makes one number of all entries of a signal. `"norm"` is the Euclidean length."""

    name: ClassVar[str] = "reduce"
    category: ClassVar[str] = "vectors"

    how: Annotated[str, Setting("what is made of the entries", choices=HOW)] = "sum"
    shape: Annotated[tuple[int, ...], Setting("shape of the input")] = (2,)

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(())}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        function = {
            "sum": jnp.sum,
            "mean": jnp.mean,
            "product": jnp.prod,
            "max": jnp.max,
            "min": jnp.min,
            "norm": lambda u: jnp.sqrt(jnp.sum(u * u)),
        }[self.how]
        return {"y": function(inputs["u"])}


def _check_indices(name: str, given: Any) -> None:
    whole = isinstance(given, tuple) and all(isinstance(n, int) and not isinstance(n, bool) and n >= 0 for n in given)
    check(whole and 1 <= len(given) <= MOST, name, given, f"a list of 1 … {MOST} whole numbers from 0")
