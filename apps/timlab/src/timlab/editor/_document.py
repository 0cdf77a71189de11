"""The edited diagram and its history."""

import dataclasses
from pathlib import Path
from typing import Any

from motorgrad._errors import check
from timlab.diagram import Diagram

MAX_UNDOABLE_CHANGES = 500
TOGETHER = 1.0  # seconds within which changes with the same key are undone together


@dataclasses.dataclass(frozen=True)
class Version:
    """The document at one point in its history; it is never modified."""

    diagram: Diagram
    file: Path | None = None


class Document:
    """A diagram and its history. Successive versions share what did not change.

    `revision` counts changes, including undone ones; `saved` tells whether the diagram equals the content of its file.
    """

    def __init__(self, diagram: Diagram, file: Path | None = None):
        self.now = Version(diagram, file)
        self.revision = 0
        self._before: list[Version] = []
        self._after: list[Version] = []
        self._last: tuple[Any, float] = (None, 0.0)
        self._saved: Diagram | None = diagram

    @property
    def diagram(self) -> Diagram:
        return self.now.diagram

    @property
    def saved(self) -> bool:
        return self._saved is not None and (self._saved is self.diagram or self._saved == self.diagram)

    def update(self, diagram: Diagram, key: object = None, time: float = 0.0) -> None:
        """Add a version of the diagram. Versions with the same `key` in quick succession count as one change."""
        together = key is not None and self._last[0] == key and time - self._last[1] < TOGETHER and not self._after
        self._step(Version(diagram, self.now.file), bool(together and self._before))
        self._last = key, time

    def open(self, diagram: Diagram, file: Path | None, saved: bool = True) -> None:
        """Replace the document with another one; `saved` says whether it also exists elsewhere."""
        self._step(Version(diagram, file), False)
        self._saved = diagram if saved else None

    def mark_saved(self, file: Path) -> None:
        """Record that the file contains the current diagram."""
        self.now = Version(self.diagram, file)
        self._saved = self.diagram
        self._last = None, 0.0

    def undo(self) -> None:
        """Undo the last change. **Raises** `ValueError` if there is none."""
        check(self._before, "undo", "", "after a change")
        self._after.append(self.now)
        self.now = self._before.pop()
        self._count_revision()

    def redo(self) -> None:
        """Redo the last change that was undone."""
        check(self._after, "redo", "", "after an undo")
        self._before.append(self.now)
        self.now = self._after.pop()
        self._count_revision()

    @property
    def flags(self) -> dict[str, Any]:
        """What clients show besides the diagram."""
        return {
            "revision": self.revision,
            "file": self.now.file.name if self.now.file else None,
            "saved": self.saved,
            "can_undo": bool(self._before),
            "can_redo": bool(self._after),
        }

    def _step(self, version: Version, together: bool) -> None:
        if not together:
            self._before = [*self._before[-MAX_UNDOABLE_CHANGES + 1 :], self.now]
        self._after = []
        self.now = version
        self._count_revision()

    def _count_revision(self) -> None:
        self.revision += 1
        self._last = None, 0.0
