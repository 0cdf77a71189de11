"""Code that came with a diagram's file. It is shown to the user, who may let it run.

What was written in the page, or dropped on it, is not offered, nor what this session itself wrote to a file: whoever
has the page's address could then run programs.
"""

from typing import Any

from motorgrad._errors import check
from timlab.diagram import Diagram, Foreign, blocks_of


class Offers:
    """The code that the user may let run by a button, by its hash."""

    def __init__(self) -> None:
        self._keys: set[str] = set()

    def add(self, diagram: Diagram) -> None:
        """Offer to run the code of a diagram that somebody else wrote."""
        self._keys |= {block.key for block in _doubted(diagram).values()}

    def of(self, diagram: Diagram) -> list[dict[str, Any]]:
        """The code of a diagram that does not run yet: `path`, `type`, `code`, `key`, and whether it is `offered`."""
        return [
            {"path": path, "type": block.name, "code": block.code, "key": block.key, "offered": block.key in self._keys}
            for path, block in _doubted(diagram).items()
        ]

    def trust(self, diagram: Diagram, keys: tuple[str, ...]) -> None:
        """Let code of a diagram run. **Raises** `ValueError` for a key that is not offered."""
        for key in keys:
            check(key in self._keys, "trust", key, "the key of code that a file brought; --trust lets all code run")
        for block in _doubted(diagram).values():
            if block.key in keys:
                block.trust()


def _doubted(diagram: Diagram) -> dict[str, Any]:
    """The blocks with code that nobody has trusted, by path."""
    blocks = blocks_of(diagram).items()
    return {path: block for path, block in blocks if isinstance(block, Foreign) and not block.is_trusted}
