"""Shapes that follow from wires: a block whose `shape` is left at `()` takes the one that its neighbours have."""

import dataclasses
from collections.abc import Sequence

from timlab.diagram._block import Block
from timlab.diagram._declarations import settings_of
from timlab.diagram._placed import Placed

Shape = tuple[int, ...]


def fitted(block: Block, side: str, port: str, shape: Shape) -> Block | None:
    """The block with another `shape`, if its own is `()`, such that one of its ports has that shape; `None` if there
    is none. `side` is `"inputs"` or `"outputs"`.
    """
    if "shape" not in settings_of(type(block)) or block.shape != ():  # type: ignore[attr-defined]
        return None
    try:
        other = block.retuned({"shape": shape})
        ports = getattr(other, side)
    except ValueError:
        return None
    return other if port in ports and ports[port].shape == shape else None


def with_shapes(placed: Sequence[Placed]) -> list[Placed]:
    """The flat list of blocks with shapes that follow from the wires: at a wire between two shapes, the block that it
    leads to takes that of the signal, or else the block that it comes from takes the one that is asked of it.
    """
    blocks = [each.block for each in placed]
    changed = True
    while changed:  # each round that is not the last one fits a block, and no block is fitted twice
        changed = False
        for i, each in enumerate(placed):
            for port, source in each.sources.items():
                if port not in blocks[i].inputs or source.port not in blocks[source.block].outputs:
                    continue
                wanted = blocks[i].inputs[port].shape
                given = blocks[source.block].outputs[source.port].shape
                if wanted == given:
                    continue
                for place, side, name, shape in (
                    (i, "inputs", port, given),
                    (source.block, "outputs", source.port, wanted),
                ):
                    other = fitted(blocks[place], side, name, shape)
                    if other is not None:
                        blocks[place] = other
                        changed = True
                        break
    return [dataclasses.replace(each, block=block) for each, block in zip(placed, blocks, strict=True)]
