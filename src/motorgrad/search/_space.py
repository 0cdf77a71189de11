"""The search space: named numbers, each within bounds."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.schema import Settings, number, static


@dataclasses.dataclass(frozen=True)
class Range(Settings):
    """The range of one number, in its own unit."""

    # integers stay such, as a stored search knows its space by how this is written
    low: int | float = number(help="the lower bound, which is included")
    high: int | float = number(help="the upper bound, which is included")
    start: int | float | None = number(None, help="where a search starts; by default in the middle")
    log: bool = static(False, help="whether the scale is logarithmic; then both bounds are above 0")

    def validate(self) -> None:
        check(self.low > 0 or not self.log, "low", self.low, "above 0, as the scale is logarithmic")
        check(self.high > self.low, "high", self.high, f"above low = {self.low!r}")
        if self.start is not None:
            check(self.low <= self.start <= self.high, "start", self.start, f"from {self.low!r} to {self.high!r}")

    def number(self, place: float | np.ndarray) -> Any:
        """The numbers at places from 0, the lower bound, to 1, the upper one; of any shape."""
        if not self.log:
            return self.low + place * (self.high - self.low)
        return np.exp(math.log(self.low) + place * (math.log(self.high) - math.log(self.low)))

    def slope(self, place: float | np.ndarray) -> Any:
        """The derivative of `number` at places."""
        if not self.log:
            return np.full(np.shape(place), self.high - self.low)
        return self.number(place) * (math.log(self.high) - math.log(self.low))

    def place(self, number: float | np.ndarray) -> Any:
        """The inverse of `number`."""
        if not self.log:
            return (number - self.low) / (self.high - self.low)
        return (np.log(number) - math.log(self.low)) / (math.log(self.high) - math.log(self.low))


@dataclasses.dataclass(frozen=True)
class Space(Settings):
    """Named numbers within bounds. Search methods see *places* from 0 to 1, score functions see the numbers themselves.

    ```python
    space = Space({"rate": Range(1e-4, 1e-2, log=True), "decay": Range(0.9, 0.999)})
    ```
    """

    ranges: Mapping[str, Range] = static(help="a `Range` for every name")

    def validate(self) -> None:
        check(self.ranges, "ranges", self.ranges, "at least one Range by name")

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the numbers, in the order of all arrays."""
        return tuple(self.ranges)

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return len(self.ranges)

    @property
    def start(self) -> Float[np.ndarray, " size"]:
        """The places at which a search starts."""
        starts = ((each, each.start) for each in self.ranges.values())
        return np.array([0.5 if start is None else each.place(start) for each, start in starts], float)

    def numbers(self, places: npt.ArrayLike) -> Float[np.ndarray, "*batch size"]:
        """Convert places (…, size) to numbers in their own units."""
        places = self._of_its_size("places", places)
        return np.stack([each.number(places[..., i]) for i, each in enumerate(self.ranges.values())], axis=-1)

    def places(self, numbers: npt.ArrayLike) -> Float[np.ndarray, "*batch size"]:
        """The inverse of `numbers`."""
        numbers = self._of_its_size("numbers", numbers)
        return np.stack([each.place(numbers[..., i]) for i, each in enumerate(self.ranges.values())], axis=-1)

    def slopes(self, places: npt.ArrayLike) -> Float[np.ndarray, "*batch size"]:
        """The derivative of each number by its place, at places (…, size)."""
        places = self._of_its_size("places", places)
        return np.stack([each.slope(places[..., i]) for i, each in enumerate(self.ranges.values())], axis=-1)

    def named(self, places: npt.ArrayLike) -> dict[str, float]:
        """The numbers at one candidate's places (size,), by name."""
        return dict(zip(self.names, self.numbers(places).tolist(), strict=True))

    def _of_its_size(self, name: str, values: npt.ArrayLike) -> np.ndarray:
        values = np.asarray(values, float)
        shape = values.shape
        check(values.ndim > 0 and shape[-1] == self.size, f"{name}.shape", shape, f"(…, {self.size})")
        return values


def reflected(places: npt.ArrayLike) -> Float[np.ndarray, "*batch size"]:
    """Reflect arbitrary places at the bounds into 0 … 1."""
    return 1.0 - np.abs(1.0 - np.mod(places, 2.0))
