"""What sinks that show something have in common."""

import abc
import dataclasses
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.lab._block import Ports
from motorgrad.lab._parameter import Setting
from motorgrad.lab._port import Port
from motorgrad.lab._record import Record
from motorgrad.lab._sink import Sink
from motorgrad.lab.blocks._named import check_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class Viewer(Sink):
    """A sink that shows what it saw. `drawing` tells an editor in which way: it draws the same from the settings."""

    category: ClassVar[str] = "sinks"
    drawing: ClassVar[str]

    @abc.abstractmethod
    def figure(self, record: Record, path: str) -> "Figure":
        """What it saw, as a matplotlib figure that a notebook shows.

        **Arguments:** a record of a run; the sink's `path` in the diagram, such as `"scope"`. **Raises** `ValueError`
        where the record has nothing of it.
        """

    def seen(self, record: Record, path: str, port: str) -> Float[np.ndarray, "seeds samples numbers"]:
        """What came in at a port, with the numbers of its shape in a row."""
        signal = record[f"{path}.{port}"]
        check(signal.shape[1] > 0, f"{path}.{port}", signal.shape, "a record of at least one sample")
        return signal.reshape(*signal.shape[:2], -1).astype(float)


@dataclasses.dataclass(frozen=True)
class Labelled(Viewer):
    """A sink whose inputs have names of the user's own, and one shape."""

    labels: Annotated[tuple[str, ...], Setting("the names of the inputs")] = ("u",)
    shape: Annotated[tuple[int, ...], Setting("shape of each of the signals")] = ()

    def validate(self) -> None:
        check_names("labels", self.labels, least=1)

    @property
    def inputs(self) -> Ports:
        return {label: Port(self.shape) for label in self.labels}

    def columns(self) -> list[str]:
        """A name for every number, such as `u` or `u[0]`."""
        places = [f"[{','.join(map(str, place))}]" if place else "" for place in np.ndindex(self.shape)]
        return [f"{label}{place}" for label in self.labels for place in places]


def check_limits(name: str, limits: Any) -> None:
    """Refuse what is neither `None` nor two finite numbers in rising order."""
    pair = isinstance(limits, tuple) and len(limits) == 2
    numbers = pair and all(isinstance(x, int | float) and not isinstance(x, bool) for x in limits or ())
    valid = limits is None or (numbers and -np.inf < limits[0] < limits[1] < np.inf)
    check(valid, name, limits, "None, or a list of two numbers, the lower first")
