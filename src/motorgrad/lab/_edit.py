"""The editor in a notebook, loaded when it is first asked for."""

from pathlib import Path
from typing import TYPE_CHECKING

from motorgrad.lab._diagram import Diagram

if TYPE_CHECKING:
    from motorgrad.lab.editor._widget import Editor


def edit(diagram: Diagram | None = None, file: Path | str | None = None) -> "Editor":
    """TimLab's editor in a cell of a notebook, in Jupyter or marimo: the same as `motorgrad lab` in a browser.

    **Arguments:** the diagram to begin with, which itself is not altered; by default that of the `file`, where it is
    saved, or an empty one.

    **Returns** a widget; its `diagram` is what has been made of the diagram so far. `close` ends it. **Raises**
    `ValueError` for a file that is no diagram.
    """
    from motorgrad.lab.editor._widget import edit

    return edit(diagram, file)
