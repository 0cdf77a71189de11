"""The editor in a cell of a notebook: anywidget carries the same messages as the WebSocket does."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import anywidget

from motorgrad.lab._diagram import Diagram
from motorgrad.lab.editor._built import STATIC
from motorgrad.lab.editor._session import Session

BUILT = STATIC / "widget.js", STATIC / "widget.css"


class Editor(anywidget.AnyWidget):
    """A session in a notebook; several cells may show the same.

    `diagram` is what has been made of the diagram so far.
    """

    _end: Callable[[], None] | None = None
    _esm = BUILT[0] if BUILT[0].exists() else "export default { render({ el }) { el.textContent = 'Not built.'; } }"
    _css = BUILT[1] if BUILT[1].exists() else ""

    def __init__(self, session: Session):
        super().__init__()
        self.session = session
        self._end = session.listen(self._tell)
        self.on_msg(self._hear)

    @property
    def diagram(self) -> Diagram:
        """A copy of the diagram as it stands."""
        return self.session.diagram

    def close(self) -> None:
        """End the session; the cell shows nothing more."""
        if self._end is not None:
            self._end()
            self.session.close(keep=False)
            self._end = None
        super().close()

    def _tell(self, event: dict[str, Any]) -> None:
        self.send(json.dumps(event, ensure_ascii=False, allow_nan=False))

    def _hear(self, widget: Any, content: Any, buffers: Any) -> None:
        if isinstance(content, str):
            self.session.handle(content, self._tell)


def edit(diagram: Diagram | None = None, file: Path | str | None = None) -> Editor:
    """What `motorgrad.lab.edit` gives; see there."""
    return Editor(Session(diagram, None if file is None else Path(file).absolute()))
