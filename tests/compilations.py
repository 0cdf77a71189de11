"""The compilation cache of the tests: a bounded store that outlives a run, and one folder per run on top of it.

Compilation dominates the time of the tests. JAX writes its entries in place, so a process that dies leaves half an
entry behind, and two runs at once would write and prune the same folder. Therefore a run works in a folder of its own,
filled with hard links to the store; when it ends, the complete entries that it added move into the store.
"""

import contextlib
import ctypes
import functools
import gc
import hashlib
import os
import platform
import resource
import shutil
import tempfile
import time
import zlib
from importlib.metadata import version
from pathlib import Path

STORE = Path(__file__).parent.parent / ".cache" / "tests" / "jax"
MOST_BYTES = 1 << 30
_ABANDONED = 24 * 3600  # s, the age at which the folder of a run that was killed goes
FOLDER = "JAX_COMPILATION_CACHE_DIR"
_RUN = "run-"


def _key() -> str:
    """Versions, and a hash of the processor's features: machine code for one processor need not run on another."""
    features = platform.processor() + platform.machine()
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        features += next((line for line in lines if line.startswith(("flags", "Features"))), "")
    versions = "-".join(f"{name}{version(name)}" for name in ("jax", "jaxlib"))
    return f"python{platform.python_version()}-{versions}-{hashlib.sha256(features.encode()).hexdigest()[:12]}"


def _is_complete(entry: Path) -> bool:
    """Whether an entry decompresses, with the same library that JAX chooses."""
    try:
        import zstandard
    except ImportError:
        decompress, error = zlib.decompress, zlib.error
    else:
        decompress, error = zstandard.ZstdDecompressor().decompress, zstandard.ZstdError
    try:
        return bool(decompress(entry.read_bytes()))
    except error:
        return False


def _remove_oldest(folder: Path, most_bytes: int) -> None:
    """Removes the entries that were read or written longest ago, until the rest fits."""
    found = [(max(status.st_atime, status.st_mtime), status.st_size, entry.path) for entry, status in _entries(folder)]
    total = sum(size for _, size, _ in found)
    for _, size, path in sorted(found):
        if total <= most_bytes:
            break
        Path(path).unlink(missing_ok=True)
        total -= size


def _entries(folder: Path) -> list[tuple[os.DirEntry, os.stat_result]]:
    return [(entry, entry.stat()) for entry in os.scandir(folder) if entry.is_file()]


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except FileNotFoundError:  # another run has pruned it
        pass
    except OSError:  # a file system without hard links
        shutil.copy2(source, target)


def environment(run: Path) -> dict[str, str]:
    """The variables by which JAX, when it is imported, chooses the folder of a run for all that it compiles."""
    return {
        FOLDER: str(run),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
        # Caches for GPUs would make the folder's path a part of every key, and no run would find another's entries.
        "JAX_PERSISTENT_CACHE_ENABLE_XLA_CACHES": "none",
    }


def open_run(store: Path = STORE) -> Path:
    """Makes the folder of a run, with the store's entries in it."""
    entries = store / _key()
    entries.mkdir(parents=True, exist_ok=True)
    for other in store.iterdir():
        old = time.time() - other.stat().st_mtime > _ABANDONED
        if other.is_dir() and other != entries and (old or not other.name.startswith(_RUN)):
            shutil.rmtree(other, ignore_errors=True)  # of another version, or of a run that was killed
    run = Path(tempfile.mkdtemp(prefix=_RUN, dir=store))
    for entry, _ in _entries(entries):
        _link(Path(entry.path), run / entry.name)
    return run


def close_run(run: Path, store: Path = STORE, most_bytes: int = MOST_BYTES) -> None:
    """Moves what a run has compiled into the store, bounds the store and removes the folder."""
    entries = store / _key()
    entries.mkdir(parents=True, exist_ok=True)
    for entry, _ in _entries(run):
        kept = entries / entry.name
        if not kept.exists() and _is_complete(Path(entry.path)):
            with contextlib.suppress(OSError):
                os.replace(entry.path, kept)
    _remove_oldest(entries, most_bytes)
    shutil.rmtree(run, ignore_errors=True)


def share_context() -> None:
    """Has all programs that this process compiles from now on share one context of MLIR, the compiler's language.

    JAX makes one for each program, with all dialects, and keeps it as long as the program. That takes some 4 ms and
    1.2 MB: for a small program four fifths of either. Several threads may use one. A test sees that it is shared.
    """
    from jax._src.interpreters import mlir  # not before `environment` is in force

    make = getattr(mlir, "make_ir_context", None)
    if make is not None:
        mlir.make_ir_context = functools.cache(getattr(make, "__wrapped__", make))


def resident() -> int:
    """The memory of this process that is in use, in bytes; 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return 0
    return pages * resource.getpagesize()


def drop_programs(most_bytes: int) -> bool:
    """Drops all compiled programs of this process, and returns their memory, if it uses more than `most_bytes`.

    A program takes a quarter of a megabyte and more, and the tests compile thousands. Linux also limits a process to
    65,530 mapped regions of memory, of which every program takes some.
    """
    if resident() <= most_bytes:
        return False
    import jax  # not before `environment` is in force

    from motorgrad.training import clear_programs

    clear_programs()
    jax.clear_caches()
    share_context()  # with a new one: it keeps the constants of all programs
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):  # where the C library is another than glibc
        ctypes.CDLL(None).malloc_trim(0)  # the Makefile has it keep what is freed
    return True
