"""The shapes of the signals that wires carry."""

from timlab.diagram._diagram import Diagram
from timlab.diagram._flat import Scope, flatten
from timlab.diagram._placed import DiagramError
from timlab.diagram._shapes import Shape


def wired_shapes(diagram: Diagram) -> dict[str, Shape]:
    """The shapes at both ends of every wire, of subsystems too, by `"block.port"`, as they follow from the wires. Ends
    without a known signal are left out.
    """
    leaves = {each.path: each.block for each in flatten(diagram)[0]}
    found: dict[str, Shape] = {}

    def visit(scope: Scope) -> None:
        for target, source in scope.diagram.wires.items():
            try:
                origin, (name, port) = scope.origin(source)
            except DiagramError:
                continue  # reported among the problems
            block = leaves.get(origin.path(name))
            if block is None or port not in block.outputs:
                continue
            given = block.outputs[port].shape
            reader = leaves.get(scope.path(target[0]))
            found[f"{scope.path(source[0])}.{source[1]}"] = given
            own = None if reader is None else reader.inputs.get(target[1])
            found[f"{scope.path(target[0])}.{target[1]}"] = given if own is None else own.shape
        for name, node in scope.diagram.nodes.items():
            if isinstance(node.block, Diagram):
                visit(Scope(node.block, scope, name))

    visit(Scope(diagram))
    return found
