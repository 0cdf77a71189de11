"""A watch over what Python is asked to do: who reads a stranger's file must run, import, connect and write nothing."""

import contextlib
import io
import os
import sys
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path

_RUNS = {"marshal.loads", "code.__new__", "pickle.find_class", "ctypes.dlopen", "os.system", "os.exec", "os.fork"}
_RUNS |= {
    "os.forkpty",
    "os.spawn",
    "os.posix_spawn",
    "os.startfile",
    "subprocess.Popen",
    "pty.spawn",
    "webbrowser.open",
}
_RUNS |= {"socket.connect", "socket.bind", "socket.sendto", "socket.getaddrinfo"}
_CHANGES = {"os.remove", "os.rename", "os.link", "os.symlink", "os.mkdir", "os.rmdir", "os.chmod", "os.chown"}
_CHANGES |= {"os.truncate", "os.utime", "shutil.rmtree", "shutil.move", "shutil.copyfile"}
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class _Watch:
    """An audit hook cannot be taken away, so there is one, which is turned on and off."""

    def __init__(self) -> None:
        self.on = False
        self.seen: list[str] = []
        sys.addaudithook(self._heard)

    def _heard(self, event: str, arguments: tuple) -> None:
        if not self.on:
            return
        if event == "import":
            bad = arguments[0].partition(".")[0] not in sys.modules
        elif event == "open":
            path, _, flags = arguments
            bad = isinstance(path, str | bytes | os.PathLike) and bool((flags or 0) & _WRITES)
        elif event == "exec":  # of dataclasses, the methods: options of a command depend on its task
            bad = sys._getframe(1).f_globals.get("__name__") != "dataclasses"
        else:
            bad = event in _RUNS or event in _CHANGES
        if bad:
            self.seen.append(f"{event}{arguments!r}"[:300])


_WATCH: list[_Watch] = []


@contextlib.contextmanager
def nothing_happens() -> Iterator[None]:
    """What is done within may read files and compute. **Raises** `AssertionError` that lists anything else.

    Do it once before with a good file: what is imported when first used is so then.
    """
    if not _WATCH:
        _WATCH.append(_Watch())
    watch = _WATCH[0]
    watch.seen = []
    watch.on = True
    try:
        yield
    finally:
        watch.on = False
    assert not watch.seen, "\n".join(watch.seen[:10])


def mutations(content: bytes, count: int, random) -> Iterator[bytes]:
    """Contents with something in them changed: a bit, a byte, a piece lost, doubled, moved or replaced by a trap."""
    traps = [
        b"os:system",
        b'"O"',
        b"|O8",
        b"../../x",
        b"/etc/passwd",
        b"cos\nsystem\n",
        b"1e999",
        b"9" * 400,
        b"[" * 300,
    ]
    for _ in range(count):
        changed = bytearray(content)
        at = random.randrange(len(content))
        piece = bytes(changed[at : at + random.randint(1, 60)])
        way = random.randrange(5)
        if way == 0:
            changed[at] ^= 1 << random.randrange(8)
        elif way == 1:
            changed[at] = random.randrange(256)
        elif way == 2:
            del changed[at : at + len(piece)]
        elif way == 3:
            place = random.randrange(len(content))
            changed[place:place] = piece
        else:
            changed[at : at + random.choice([0, 1, 9])] = random.choice(traps)
        yield bytes(changed)


def zipped(parts: Mapping[str, str | bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """An archive of these entries."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", method) as file:
        for name, part in parts.items():
            file.writestr(name, part)
    return content.getvalue()


def trap_module(folder: Path) -> str:
    """A module in a folder that notes its import, to be named by files; its name."""
    name = f"trap_{os.getpid()}"
    (folder / f"{name}.py").write_text("raise SystemExit('a stranger was imported')\n")
    return name
