"""Functions given by tables."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._shaped import Shaped

BEYOND = "what it gives beyond the table: its end, or on along the last line"


def _check_points(name: str, points: Any) -> None:
    rising = np.ndim(points) == 1 and len(points) >= 2 and np.all(np.diff(np.asarray(points, np.float32)) > 0)
    check(rising, name, points, "a list of at least two numbers that rise, in single precision")


def _place(u: Any, points: Any, beyond: str) -> tuple[Any, Any]:
    """Between which points a number is: the index of the lower, and how far it is to the next."""
    lower = jnp.clip(jnp.searchsorted(points, u, side="right") - 1, 0, points.shape[0] - 2)
    part = (u - points[lower]) / (points[lower + 1] - points[lower])
    return lower, part if beyond == "extend" else jnp.clip(part, 0.0, 1.0)


@dataclasses.dataclass(frozen=True)
class LookUp(Shaped):
    """A function of one number, given at rising points and linear in between; element by element."""

    name: ClassVar[str] = "look-up table"
    category: ClassVar[str] = "nonlinear"

    points: Annotated[Any, Parameter("where it is given, rising")] = (0.0, 1.0)
    results: Annotated[Any, Parameter("what it gives there")] = (0.0, 1.0)
    beyond: Annotated[str, Setting(BEYOND, choices=("stay", "extend"))] = "stay"

    def validate(self) -> None:
        _check_points("points", self.points)
        check(
            np.shape(self.results) == np.shape(self.points),
            "results",
            self.results,
            f"{len(self.points)} numbers, as points",
        )

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        lower, part = _place(inputs["u"], self.points, self.beyond)
        return {"y": (1 - part) * self.results[lower] + part * self.results[lower + 1]}


@dataclasses.dataclass(frozen=True)
class LookUp2D(Shaped):
    """A function of two numbers, given on a grid and bilinear in between; element by element."""

    name: ClassVar[str] = "look-up table 2-D"
    category: ClassVar[str] = "nonlinear"

    points1: Annotated[Any, Parameter("where it is given along u1, rising")] = (0.0, 1.0)
    points2: Annotated[Any, Parameter("where it is given along u2, rising")] = (0.0, 1.0)
    results: Annotated[Any, Parameter("what it gives there: a row for each point of u1")] = ((0.0, 0.0), (0.0, 1.0))
    beyond: Annotated[str, Setting(BEYOND, choices=("stay", "extend"))] = "stay"

    def validate(self) -> None:
        for name in ("points1", "points2"):
            _check_points(name, getattr(self, name))
        rows, columns = len(self.points1), len(self.points2)
        check(
            np.shape(self.results) == (rows, columns),
            "results",
            self.results,
            f"{rows} rows of {columns} numbers, as points",
        )

    @property
    def inputs(self) -> Ports:
        return {"u1": Port(self.shape), "u2": Port(self.shape)}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        row, down = _place(inputs["u1"], self.points1, self.beyond)
        column, along = _place(inputs["u2"], self.points2, self.beyond)
        upper = (1 - along) * self.results[row, column] + along * self.results[row, column + 1]
        lower = (1 - along) * self.results[row + 1, column] + along * self.results[row + 1, column + 1]
        return {"y": (1 - down) * upper + down * lower}
