"""What is wrong with a diagram: at which block and port."""

from collections.abc import Sequence
from typing import NamedTuple


class DiagramError(ValueError):
    """A diagram that cannot run. `problems` has all that was found; the message is the first of them."""

    def __init__(self, problems: Sequence["Problem"]):
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        super().__init__(f"{problems[0]}{more}")
        self.problems = tuple(problems)


class Problem(NamedTuple):
    """Something wrong at a block, by its path, and perhaps at one of its ports."""

    path: str
    port: str | None
    message: str

    def __str__(self) -> str:
        return f"{self.path}{f'.{self.port}' if self.port else ''}: {self.message}"

    @classmethod
    def error(cls, path: str, port: str | None, message: str) -> DiagramError:
        """The exception of one problem."""
        return DiagramError([cls(path, port, message)])
