"""Blocks in the flat list of a diagram, and what can be wrong with them."""

import dataclasses
import zlib
from collections.abc import Sequence
from typing import NamedTuple

from timlab.diagram._block import Block


class DiagramError(ValueError):
    """A diagram that cannot run. `problems` lists everything that was found; the message is the first of them."""

    def __init__(self, problems: Sequence["Problem"]):
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        super().__init__(f"{problems[0]}{more}")
        self.problems = tuple(problems)


class Problem(NamedTuple):
    """Something wrong at a block, given by its path, and possibly at one of its ports."""

    path: str
    port: str | None
    message: str

    def __str__(self) -> str:
        return f"{self.path}{f'.{self.port}' if self.port else ''}: {self.message}"

    @classmethod
    def error(cls, path: str, port: str | None, message: str) -> DiagramError:
        """The exception for a single problem."""
        return DiagramError([cls(path, port, message)])


class Source(NamedTuple):
    """An output of a block, given by the block's index in the list."""

    block: int
    port: str


@dataclasses.dataclass(frozen=True)
class Placed:
    """A block of the flat list, with its `path` of names, its `identity` (path of ids), the sources of its inputs, and
    the ticks between its evaluations.
    """

    path: str
    identity: str
    block: Block
    sources: dict[str, Source]
    ticks: int

    @property
    def stream(self) -> int:
        """The key of its random numbers: 32 bits of its identity."""
        return zlib.crc32(self.identity.encode())
