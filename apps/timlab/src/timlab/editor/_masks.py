"""Changes of a diagram's parameters, and of the block settings that they set."""

import dataclasses
from typing import Any

from motorgrad._errors import check, unknown
from timlab.diagram import Diagram, Node
from timlab.editor._edits import Edit
from timlab.editor._subsystems import with_parameter


@dataclasses.dataclass(frozen=True)
class Declare(Edit):
    """Give the diagram a parameter, by default with the value 0; or give one that it has another value, or the name
    `to`.
    """

    parameter: str
    value: Any = None
    to: str | None = None

    def change(self, scope: Diagram, document: Diagram) -> None:
        name = self.parameter if self.to is None else self.to
        if self.to is not None:
            _check_known(scope, self.parameter)
            check(name == self.parameter or name not in scope.parameters, "to", name, "a new name of a parameter")
        value = scope.parameters.get(self.parameter, 0.0) if self.value is None else self.value
        parameters = {**scope.parameters, self.parameter: value}
        parameters = {name if each == self.parameter else each: own for each, own in parameters.items()}
        uses = {address: name if used == self.parameter else used for address, used in scope.uses.items()}
        checked = Diagram(parameters=parameters, uses=uses)
        scope.parameters, scope.uses = checked.parameters, checked.uses

    def follow(self, outer: Diagram, name: str) -> None:
        old, new = (f"{name}.{own}" for own in (self.parameter, self.to or self.parameter))
        outer.uses = {new if address == old else address: used for address, used in outer.uses.items()}
        super().follow(outer, name)


@dataclasses.dataclass(frozen=True)
class Undeclare(Edit):
    """Remove a parameter of the diagram; blocks that used it keep its value."""

    parameter: str

    def change(self, scope: Diagram, document: Diagram) -> None:
        _check_known(scope, self.parameter)
        for address in [address for address, used in scope.uses.items() if used == self.parameter]:
            _release(scope, address)
        scope.parameters = {name: own for name, own in scope.parameters.items() if name != self.parameter}


@dataclasses.dataclass(frozen=True)
class Use(Edit):
    """Let a parameter of the diagram stand for the parameter `field` of a block or subsystem. A parameter that the
    diagram does not have begins with the block's value. With `null`, the block has a value of its own again, at first
    that of the parameter.
    """

    name: str
    field: str
    parameter: str | None = None

    def change(self, scope: Diagram, document: Diagram) -> None:
        address = f"{self.name}.{self.field}"
        if self.parameter is not None:
            scope.use(address, self.parameter)
            return
        check(address in scope.uses, "field", self.field, "one for which a parameter of the diagram stands")
        _release(scope, address)


def _check_known(scope: Diagram, parameter: str) -> None:
    if parameter not in scope.parameters:
        raise unknown("parameter of the diagram", parameter, scope.parameters)


def _release(scope: Diagram, address: str) -> None:
    """Let a block use its own parameter again. It keeps the value of the diagram's parameter."""
    name, _, field = address.partition(".")
    node = scope.nodes[name]
    used = scope.uses[address]
    scope.uses = {other: each for other, each in scope.uses.items() if other != address}
    scope.nodes[name] = Node(with_parameter(node.block, field, scope.parameters[used]), node.id)
