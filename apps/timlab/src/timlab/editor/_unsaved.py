"""Reading a journal of unsaved work, of which others or a failing disk may have spoilt a part."""

from pathlib import Path
from typing import Any, NamedTuple

from motorgrad._errors import check
from motorgrad._limits import MAX_DIAGRAM_CHARACTERS, MAX_JOURNAL_BYTES
from motorgrad._reading import content_of, json_in
from timlab.diagram import Diagram, loads
from timlab.editor._edits import Change
from timlab.editor._protocol import operation_from

JOURNAL_FORMAT = "motorgrad journal"


class Unsaved(NamedTuple):
    """A journal.

    - `file`: that of the diagram, or None.
    - `start`: the diagram before the first change, as text.
    - `changes`: one entry per change.
    - `bad`: the number of the first line that makes no sense, from which on all are left out; 0 for none.
    """

    file: str | None
    start: str
    changes: list[dict[str, Any]]
    bad: int

    @property
    def title(self) -> str:
        """The title of the outermost diagram after the last change; empty where that cannot be read."""
        title = _title(self.start)
        for change in self.changes:
            if "diagram" in change:
                title = _title(change["diagram"])
                continue
            own = change["do"]
            if own.get("op") == "set" and own.get("at") == [] and own.get("name") is None:
                fields = own.get("fields")
                if isinstance(fields, dict):
                    title = fields.get("title", title)
                title = own.get("value") if own.get("field") == "title" else title
        return title if isinstance(title, str) else ""

    def diagram(self) -> tuple[Diagram, int]:
        """The diagram after the changes, and the line of the first change that could not be made, or 0."""
        diagram = loads(self.start)
        for line, change in enumerate(self.changes, start=2):
            try:
                diagram = _changed(diagram, change)
            except Exception:  # a block's own code may raise anything
                return diagram, line
        return diagram, self.bad


def read_unsaved(path: Path) -> Unsaved | None:
    """Read a journal. None if its process was killed before the first change.

    **Raises** `OSError` and `ValueError` for a file that is no journal.
    """
    *lines, cut = content_of(path, MAX_JOURNAL_BYTES).decode("utf-8", "replace").split("\n")
    if not lines:  # killed while it wrote the first line
        return None
    head = _object(lines[0]) or {}
    known = head.get("format") == JOURNAL_FORMAT and isinstance(head.get("diagram"), str)
    check(known and isinstance(head.get("file"), str | None), "first line", lines[0], "that of a journal of TimLab")
    # the last line is complete where only its end is missing
    lines += [cut] if _is_change(_object(cut)) else []
    changes = [_object(line) for line in lines[1:]]
    good = next((place for place, change in enumerate(changes) if not _is_change(change)), len(changes))
    sound = [change for change in changes[:good] if change is not None]
    if not changes:
        return None
    return Unsaved(head.get("file"), head["diagram"], sound, 0 if good == len(changes) else good + 2)


def _object(line: str) -> dict[str, Any] | None:
    """The JSON object of a line, if it is one."""
    try:
        found = json_in(line, 8 * MAX_DIAGRAM_CHARACTERS)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _is_change(change: dict[str, Any] | None) -> bool:
    return change is not None and (isinstance(change.get("diagram"), str) or isinstance(change.get("do"), dict))


def _title(text: str) -> object:
    found = _object(text)
    return "" if found is None else found.get("title", "")


def _changed(diagram: Diagram, change: dict[str, Any]) -> Diagram:
    if isinstance(change.get("diagram"), str):
        return loads(change["diagram"])
    operation = operation_from(change["do"])
    check(isinstance(operation, Change), "op", operation.op, "a change of the diagram")
    assert isinstance(operation, Change)
    return operation.apply(diagram)
