"""A signed sum."""

import dataclasses
from typing import Annotated, Any, ClassVar

from motorgrad._errors import check
from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Setting
from motorgrad.lab._port import Port


@dataclasses.dataclass(frozen=True)
class Sum(Block):
    """Adds its inputs `u1`, `u2`, …, each with its sign."""

    name: ClassVar[str] = "sum"
    category: ClassVar[str] = "mathematics"

    signs: Annotated[str, Setting("a + or - for each input")] = "++"
    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

    def validate(self) -> None:
        valid = isinstance(self.signs, str) and self.signs and set(self.signs) <= {"+", "-"}
        check(valid, "signs", self.signs, "a text of + and -, one for each input")

    @property
    def inputs(self) -> Ports:
        return {f"u{number}": Port(self.shape) for number, _ in enumerate(self.signs, 1)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape)}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        signed = [-u if sign == "-" else u for sign, u in zip(self.signs, inputs.values(), strict=True)]
        total = signed[0]
        for more in signed[1:]:
            total = total + more
        return {"y": total}
