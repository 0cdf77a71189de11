"""Files of a session: the folder of its diagrams, and journals of unsaved work that survive a killed process.

A journal starts with the diagram before the first change, and has one line per change. It is created at the first
change, locked while its session lives, and deleted when the work is saved. Journals of dead processes are offered to
the next session.
"""

import contextlib
import glob
import hashlib
import json
import stat
import time
from pathlib import Path
from typing import Any, TextIO

import platformdirs
from filelock import FileLock, Timeout

from motorgrad._errors import check, unknown
from motorgrad._files import check_writable, read_content, remove_partials
from motorgrad._limits import MAX_DIAGRAM_CHARACTERS
from timlab.diagram import FORMAT, Diagram, dumps, load, save
from timlab.editor._edits import Change
from timlab.editor._protocol import Operation, operation_data
from timlab.editor._unsaved import JOURNAL_FORMAT, read_unsaved

SUFFIX = ".json"


class Folder:
    """The folder in which a session opens and saves diagrams. Nothing outside it can be named."""

    def __init__(self, folder: Path):
        self.folder = folder.resolve()
        self._known: dict[Path, str] = {}
        self._written: set[str] = set()

    def names(self) -> list[str]:
        """The files in the folder that look like diagrams."""
        return sorted(path.name for path in self.folder.glob(f"*{SUFFIX}") if path.is_file() and _is_diagram(path))

    def load(self, name: str) -> tuple[Diagram, Path]:
        """Load a diagram from a file."""
        path = self._path(name)
        if not path.is_file():
            raise unknown("file", name, self.names())
        self._known[path] = _digest(path)
        return load(path), path

    def save(self, diagram: Diagram, name: str, over: bool) -> Path:
        """Write a diagram. **Raises** `ValueError` if that would replace a file that this session has not seen in its
        current state, unless `over` is true.
        """
        path = self._path(name)
        check_writable("file", path)
        seen = not path.exists() or self._known.get(path) == _digest(path)
        check(over or seen, "file", name, "new, or unchanged since it was opened: confirm to replace it")
        save(diagram, path)
        self._known[path] = _digest(path)
        self._written.add(self._known[path])
        return path

    def wrote(self, name: str) -> bool:
        """Whether this session wrote the content that the file had when it was last loaded or saved."""
        return self._known[self._path(name)] in self._written

    def contains(self, path: Path) -> bool:
        """Whether the session may save a file at this path."""
        try:
            return path.parent.resolve() == self.folder and self._path(path.name).name == path.name
        except (OSError, ValueError):  # its name is none, or it is a link that leads out of the folder
            return False

    def mark_seen(self, path: Path) -> None:
        """Record the current content of a file as seen."""
        if path.exists():
            self._known[path.resolve()] = _digest(path)

    def _path(self, name: str) -> Path:
        plain = name == Path(name).name and name.isprintable() and not name.startswith(".") and "\\" not in name
        check(plain and 0 < len(name) <= 200, "file", name, f"the name of a file in {self.folder}")
        path = self.folder / (name if Path(name).suffix == SUFFIX else f"{name}{SUFFIX}")
        check(
            path.resolve().is_relative_to(self.folder),
            "file",
            name,
            f"in {self.folder}, not a link that leads out of it",
        )
        return path


def _digest(path: Path) -> str:
    return hashlib.sha256(read_content(path, 4 * MAX_DIAGRAM_CHARACTERS)).hexdigest()


def _is_diagram(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return f'"format": "{FORMAT}"'.encode() in file.read(200)
    except OSError:
        return False


class Journal:
    """The journal of one session.

    **Arguments:** the `file` of the diagram, beside which the journal lies; without a file, or if nothing can be
    written there, it lies in `folder`, by default in the user's state directory.
    """

    def __init__(self, file: Path | None, folder: Path | None = None):
        self._states = folder or platformdirs.user_state_path("motorgrad", appauthor=False) / "lab"
        self._file = file
        self._lock: FileLock | None = None
        self._path: Path | None = None
        self._stream: TextIO | None = None
        self._clean()

    def record(self, before: Diagram, after: Diagram, operation: Operation) -> None:
        """Record a change. **Raises** `OSError` if it cannot be written."""
        if self._stream is None:
            self._create(before)
        small = isinstance(operation, Change)
        self._write({"do": operation_data(operation)} if small else {"diagram": dumps(after)})

    def switch(self, file: Path | None, keep: bool) -> None:
        """Continue with another document, that of `file`; the journal so far is kept for recovery, or deleted."""
        self.close(keep)
        self._file = file

    def others(self) -> tuple[list[dict[str, Any]], list[str]]:
        """The journals of sessions that have ended: `id`, the title after the last change, number of changes, time of
        the last one, and the name of the file. And what is to be said of those that are skipped, in whole or in part.
        """
        found = []
        skipped = []
        for path in self._journals():
            try:
                if path == self._path:
                    continue
                _refuse_odd(path)
                if self._is_locked(path):
                    continue
                unsaved = read_unsaved(path)
                if unsaved is None:
                    path.unlink(missing_ok=True)  # the process was killed before the first change
                    continue
                changed = path.stat().st_mtime
            except (OSError, ValueError) as error:
                skipped.append(f"unsaved work is skipped: {path}: {' '.join(str(error).split())}")
                continue
            if unsaved.bad:
                skipped.append(f"unsaved work is cut off: {path}: line {unsaved.bad} makes no sense")
            name = None if unsaved.file is None else Path(unsaved.file).name
            about = {"id": path.name, "file": name, "title": unsaved.title}
            found.append({**about, "changes": len(unsaved.changes), "changed": changed})
        return sorted(found, key=lambda each: -each["changed"]), skipped

    def recovered(self, id: str) -> tuple[Diagram, str | None, int]:
        """The diagram at the end of a journal, the file that it belongs to, and the line of the first change that is
        missing, or 0.
        """
        path = self._other(id)
        try:
            unsaved = read_unsaved(path)
            check(unsaved is not None, "journal", id, "one with a change")
            assert unsaved is not None
            diagram, bad = unsaved.diagram()
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        return diagram, unsaved.file, bad

    def drop(self, id: str) -> None:
        """Delete a journal of another session."""
        self._other(id).unlink(missing_ok=True)

    def close(self, keep: bool = True) -> None:
        """Release the journal; it is kept on disk or deleted."""
        if keep:
            self._release()
        else:
            self._delete()

    def _other(self, id: str) -> Path:
        known = {path.name: path for path in self._journals() if path != self._path}
        if id not in known:
            raise unknown("journal", id, known)
        _refuse_odd(known[id])
        check(not self._is_locked(known[id]), "journal", id, "of a session that has ended")
        return known[id]

    def _journals(self, suffix: str = "") -> list[Path]:
        pattern = f"*.journal{suffix}"
        beside = (
            [] if self._file is None else sorted(self._file.parent.glob(f".{glob.escape(self._file.name)}{pattern}"))
        )
        return [*beside, *sorted(self._states.glob(pattern))]

    def _clean(self) -> None:
        """Delete what killed processes leave behind: half-written files, and locks without a journal."""
        if self._file is not None:
            remove_partials(self._file.parent, self._file.name)
        for lock in self._journals(".lock"):
            journal = lock.with_suffix("")
            if not journal.exists():
                with contextlib.suppress(OSError, ValueError):  # a link, or another user's: it is in nobody's way
                    _refuse_odd(lock)
                    self._is_locked(journal)  # deletes the lock unless a living session holds it

    def _create(self, diagram: Diagram) -> None:
        """Create the file, and lock it."""
        for folder, stem in self._places():
            try:
                folder.mkdir(parents=True, exist_ok=True)
                number = 1
                while not self._lock_new(folder / (f"{stem}.journal" if number == 1 else f"{stem}.{number}.journal")):
                    number += 1
                assert self._path is not None
                self._stream = self._path.open("x", encoding="utf-8")
            except OSError:
                self._release()
                if folder == self._states:
                    raise
                continue
            file = str(self._file) if self._file else None
            self._write({"format": JOURNAL_FORMAT, "version": 1, "file": file, "diagram": dumps(diagram)})
            return

    def _places(self) -> list[tuple[Path, str]]:
        here = [] if self._file is None else [(self._file.parent, f".{self._file.name}")]
        return [*here, (self._states, time.strftime("%Y-%m-%d-%H%M%S"))]

    def _lock_new(self, path: Path) -> bool:
        """Lock a journal that does not exist yet."""
        if Path(f"{path}.lock").is_symlink():
            return False
        lock = FileLock(f"{path}.lock")
        try:
            lock.acquire(blocking=False)
        except Timeout:
            return False
        if path.exists():
            lock.release()
            return False
        self._lock, self._path = lock, path
        return True

    def _write(self, line: dict[str, Any]) -> None:
        assert self._stream is not None
        self._stream.write(json.dumps(line, ensure_ascii=False) + "\n")
        self._stream.flush()

    def _delete(self) -> None:
        path = self._path
        self._release()
        if path is not None:
            path.unlink(missing_ok=True)

    def _release(self) -> None:
        if self._stream is not None:
            self._stream.close()
        if self._lock is not None:
            self._lock.release()
            Path(self._lock.lock_file).unlink(missing_ok=True)
        self._stream = None
        self._lock = None
        self._path = None

    @staticmethod
    def _is_locked(path: Path) -> bool:
        """Whether a living session has locked a journal. One whose lock is a link is not ours to touch."""
        if Path(f"{path}.lock").is_symlink():
            return True
        lock = FileLock(f"{path}.lock")
        try:
            lock.acquire(blocking=False)
        except Timeout:
            return True
        lock.release()
        Path(lock.lock_file).unlink(missing_ok=True)
        return False


def _refuse_odd(path: Path) -> None:
    """Refuse what is no file of ours: a folder that somebody else made could have us write elsewhere."""
    check(stat.S_ISREG(path.lstat().st_mode), "file", str(path), "a regular file, not a link, a pipe or a device")
