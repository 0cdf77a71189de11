"""Programs that JAX compiled for earlier processes: a bounded store on disk, and one folder per process on top of it.

Compilation is most of what a short training takes. JAX writes its entries in place, so a process that dies leaves half
an entry behind, and two processes at once would write and prune the same folder. Therefore a process works in a folder
of its own, its *run*, filled with hard links to the store; when it ends, the complete entries that it added move into
the store.
"""

# pyright: reportAttributeAccessIssue=false
# (JAX makes the attributes of its configuration as it is imported.)

import atexit
import contextlib
import functools
import hashlib
import os
import platform
import shutil
import sys
import tempfile
import time
import warnings
import zlib
from importlib.metadata import version
from pathlib import Path

VARIABLE = "MOTORGRAD_PROGRAMS"
"""The environment variable that names another folder for the store, or is `off`: then nothing is stored."""
NOTHING_KEPT = {VARIABLE: "off"}
MOST_BYTES = 512 << 20
MOST_ENTRIES = 5000  # which a run links in some 0.1 s
FOLDER = "JAX_COMPILATION_CACHE_DIR"
_SETTINGS = {
    "jax_persistent_cache_min_compile_time_secs": 0,
    "jax_persistent_cache_min_entry_size_bytes": -1,
    # Caches for GPUs would make the folder's path a part of every key, and no run would find another's entries.
    "jax_persistent_cache_enable_xla_caches": "none",
}
_KILLED = 3600  # s, the age at which the folder of a run goes whose process is not to be seen
_ABANDONED = 7 * 24 * 3600  # s, likewise where that cannot be told: trainings take days
_UNUSED = 30 * 24 * 3600  # s, likewise of what other versions and processors compiled: they may share a home
_RUN = "run-"

_own: list[tuple[int, Path, Path]] = []  # this process's run: the id of the process, its folder and the store


def kept() -> bool:
    """Whether compiled programs may be kept on disk: unless the user has turned it off."""
    return os.environ.get(VARIABLE, "").strip().lower() != "off"


@functools.cache
def keep_programs() -> None:
    """Let JAX find what earlier processes compiled, and keep for later ones what it compiles from now on.

    A user's own choice of a cache holds, whether by JAX's variables or in `jax.config`. Where the store cannot be
    written, a warning says so, and everything is compiled anew.
    """
    import jax
    from jax.experimental.compilation_cache import compilation_cache

    if not kept() or jax.config.jax_compilation_cache_dir or not jax.config.jax_enable_compilation_cache:
        return
    folder = store_folder()
    try:
        make_private(folder)
        run = open_run(folder)
    except OSError as error:
        message = f"compiled programs cannot be kept in {folder}: {error.strerror or error}"
        warnings.warn(f"{message}; {VARIABLE} names another folder, or is off", stacklevel=3)
        return
    _own.append((os.getpid(), run, folder))
    atexit.register(end)
    jax.config.update("jax_compilation_cache_dir", str(run))
    for name, value in _SETTINGS.items():
        jax.config.update(name, value)
    compilation_cache.reset_cache()  # JAX decides with its first program whether there is a cache


def end() -> None:
    """Move what this process has compiled into the store; for its end, after which nothing is kept."""
    while _own:
        process, run, folder = _own.pop()
        if process == os.getpid():  # a fork has its parent's run, which is not its own to close
            with contextlib.suppress(OSError):  # another process has pruned, or the disk is full
                close_run(run, folder)


def store_folder() -> Path:
    """The folder of the store: in the user's cache folder, unless the variable names another."""
    named = os.environ.get(VARIABLE, "").strip()
    if named:
        return Path(named).expanduser().absolute()
    home = Path(os.path.expanduser("~"))
    if sys.platform == "darwin":
        cache = home / "Library" / "Caches"
    elif os.name == "nt":
        cache = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    else:
        named = os.environ.get("XDG_CACHE_HOME", "")
        cache = Path(named) if os.path.isabs(named) else home / ".cache"
    return cache / "motorgrad" / "programs"


def make_private(folder: Path) -> None:
    """Make the folder of the store. **Raises** `OSError` where others could put programs into it, which would run."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    about = folder.stat()
    if os.name != "nt" and (about.st_uid != os.getuid() or about.st_mode & 0o022):
        raise PermissionError("others may write to it")


def key() -> str:
    """Versions, and a hash of the processor's features: machine code for one processor need not run on another."""
    features = platform.machine()
    try:
        with open("/proc/cpuinfo") as lines:
            features += next((line for line in lines if line.startswith(("flags", "Features"))), "")
    except OSError:
        features += platform.processor()
    versions = "-".join(f"{name}{version(name)}" for name in ("jax", "jaxlib"))
    return f"python{platform.python_version()}-{versions}-{hashlib.sha256(features.encode()).hexdigest()[:12]}"


def environment(run: Path) -> dict[str, str]:
    """The variables by which JAX, when it is imported, chooses the folder of a run for all that it compiles."""
    return {FOLDER: str(run)} | {name.upper(): str(value) for name, value in _SETTINGS.items()}


def open_run(store: Path) -> Path:
    """Make the folder of a run, with the store's entries in it."""
    entries = store / key()
    entries.mkdir(parents=True, exist_ok=True)
    os.utime(entries)
    for other in store.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another run has removed it
            age = time.time() - other.stat().st_mtime
            if other.is_dir() and age > (_longest(other.name) if other.name.startswith(_RUN) else _UNUSED):
                shutil.rmtree(other, ignore_errors=True)
    run = Path(tempfile.mkdtemp(prefix=f"{_here()}{os.getpid()}-", dir=store))
    for entry, _ in _entries(entries):
        _link(Path(entry.path), run / entry.name)
    return run


def close_run(run: Path, store: Path, most_bytes: int = MOST_BYTES, most_entries: int = MOST_ENTRIES) -> None:
    """Move what a run has compiled into the store, bound the store and remove the folder."""
    entries = store / key()
    entries.mkdir(parents=True, exist_ok=True)
    for entry, _ in _entries(run):
        stored = entries / entry.name
        if not stored.exists() and _is_complete(Path(entry.path)):
            with contextlib.suppress(OSError):
                os.replace(entry.path, stored)
    _remove_oldest(entries, most_bytes, most_entries)
    shutil.rmtree(run, ignore_errors=True)


def _here() -> str:
    """How the names of the runs of this machine begin; the id of the process follows."""
    return f"{_RUN}{hashlib.sha256(platform.node().encode()).hexdigest()[:8]}-"


def _longest(run: str) -> float:
    """The age in s that the folder of a run may have, by its name. A process of this machine that is not to be seen has
    ended, or is one of another container."""
    process = run.removeprefix(_here()).partition("-")[0]
    if os.name != "nt" and process.isdecimal():
        try:
            os.kill(int(process), 0)
        except ProcessLookupError:
            return _KILLED
        except OSError:  # another user's
            pass
    return _ABANDONED


def _is_complete(entry: Path) -> bool:
    """Whether an entry decompresses, with the same library that JAX chooses."""
    try:
        return bool(_decompress(entry.read_bytes()))
    except Exception:  # each library raises its own errors
        return False


def _decompress(content: bytes) -> bytes:
    with contextlib.suppress(ImportError):
        from compression import zstd  # pyright: ignore[reportMissingImports] - from Python 3.14 on

        return zstd.decompress(content)
    with contextlib.suppress(ImportError):
        import zstandard

        return zstandard.ZstdDecompressor().decompress(content)
    return zlib.decompress(content)


def _remove_oldest(folder: Path, most_bytes: int, most_entries: int) -> None:
    """Remove the entries that were read or written longest ago, until the rest fits."""
    found = [(max(status.st_atime, status.st_mtime), status.st_size, entry.path) for entry, status in _entries(folder)]
    total = sum(size for _, size, _ in found)
    count = len(found)
    for _, size, path in sorted(found):
        if total <= most_bytes and count <= most_entries:
            break
        Path(path).unlink(missing_ok=True)
        total -= size
        count -= 1


def _entries(folder: Path) -> list[tuple[os.DirEntry[str], os.stat_result]]:
    found = []
    for entry in os.scandir(folder):
        with contextlib.suppress(FileNotFoundError):  # another run has pruned it
            if entry.is_file():
                found.append((entry, entry.stat()))
    return found


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except FileNotFoundError:  # another run has pruned it
        pass
    except OSError:  # a file system without hard links
        shutil.copy2(source, target)
