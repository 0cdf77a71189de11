"""The diagram that is worked on, and how it came to be so."""

import dataclasses
from pathlib import Path
from typing import Any

from motorgrad._errors import check
from motorgrad.lab.diagram import Diagram

LONGEST = 500  # changes that can be taken back
TOGETHER = 1.0  # seconds within which changes of one thing are taken back as one


@dataclasses.dataclass(frozen=True)
class Version:
    """The document at one time: nothing of it is altered afterwards."""

    diagram: Diagram
    file: Path | None = None


class Document:
    """A diagram and its history, each version of which shares with the one before what did not change.

    `revision` counts the changes, and those taken back too; `saved` says whether the diagram is as its file has it.
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

    def update(self, diagram: Diagram, key: Any = None, time: float = 0.0) -> None:
        """Another version of the diagram. Those with the same `key`, soon after each other, count as one change."""
        together = key is not None and self._last[0] == key and time - self._last[1] < TOGETHER and not self._after
        self._step(Version(diagram, self.now.file), bool(together and self._before))
        self._last = key, time

    def open(self, diagram: Diagram, file: Path | None, saved: bool = True) -> None:
        """Another document in place of this one; `saved` says whether it is somewhere else too."""
        self._step(Version(diagram, file), False)
        self._saved = diagram if saved else None

    def mark_saved(self, file: Path) -> None:
        """Note that the file is as the diagram is now."""
        self.now = Version(self.diagram, file)
        self._saved = self.diagram
        self._last = None, 0.0

    def undo(self) -> None:
        """Take back the last change. **Raises** `ValueError` where there is none."""
        check(self._before, "undo", "", "after a change")
        self._after.append(self.now)
        self.now = self._before.pop()
        self._count_revision()

    def redo(self) -> None:
        """Make the last change again that was taken back."""
        check(self._after, "redo", "", "after an undo")
        self._before.append(self.now)
        self.now = self._after.pop()
        self._count_revision()

    @property
    def flags(self) -> dict[str, Any]:
        """What clients show of it beside the diagram."""
        return {
            "revision": self.revision,
            "file": self.now.file.name if self.now.file else None,
            "saved": self.saved,
            "can_undo": bool(self._before),
            "can_redo": bool(self._after),
        }

    def _step(self, version: Version, together: bool) -> None:
        if not together:
            self._before = [*self._before[-LONGEST + 1 :], self.now]
        self._after = []
        self.now = version
        self._count_revision()

    def _count_revision(self) -> None:
        self.revision += 1
        self._last = None, 0.0
