"""The diagrams of one folder."""

import hashlib
from pathlib import Path

from motorgrad._errors import check, unknown
from motorgrad._files import check_writable
from motorgrad.lab import _files
from motorgrad.lab._diagram import Diagram

SUFFIX = ".json"


class Folder:
    """Where a session opens and saves. Nothing outside it can be named."""

    def __init__(self, folder: Path):
        self.folder = folder.resolve()
        self._known: dict[Path, str] = {}

    def names(self) -> list[str]:
        """The files in it that begin as diagrams do."""
        return sorted(path.name for path in self.folder.glob(f"*{SUFFIX}") if path.is_file() and _is_diagram(path))

    def load(self, name: str) -> tuple[Diagram, Path]:
        """The diagram of a file."""
        path = self._path(name)
        if not path.is_file():
            raise unknown("file", name, self.names())
        diagram = _files.load(path)
        self._known[path] = _digest(path)
        return diagram, path

    def save(self, diagram: Diagram, name: str, over: bool) -> Path:
        """Write a diagram. **Raises** `ValueError` where that would replace what this session has not seen, unless it
        may go `over` that."""
        path = self._path(name)
        check_writable("file", path)
        seen = not path.exists() or self._known.get(path) == _digest(path)
        check(over or seen, "file", name, "new, or as it was when it was opened: to replace it, say so")
        _files.save(diagram, path)
        self._known[path] = _digest(path)
        return path

    def know(self, path: Path) -> None:
        """Take a file as seen."""
        if path.exists():
            self._known[path.resolve()] = _digest(path)

    def _path(self, name: str) -> Path:
        plain = name == Path(name).name and name.isprintable() and not name.startswith(".") and "\\" not in name
        check(plain and 0 < len(name) <= 200, "file", name, f"the name of a file in {self.folder}")
        return self.folder / (name if Path(name).suffix else f"{name}{SUFFIX}")


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _is_diagram(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return f'"format": "{_files.FORMAT}"'.encode() in file.read(200)
    except OSError:
        return False
