"""The compiled programs of the tests: their own store, which outlives a run, and their memory.

Compilation dominates the time of the tests. They use the library's store of programs, with other bounds.
"""

import contextlib
import ctypes
import functools
import gc
import resource
from pathlib import Path

from motorgrad import _program_store
from motorgrad._program_store import FOLDER, VARIABLE, environment

__all__ = ["FOLDER", "VARIABLE", "close_run", "drop_programs", "environment", "open_run", "resident", "share_context"]

STORE = Path(__file__).parent.parent / ".cache" / "tests" / "jax"
MOST_BYTES = 1 << 30
MOST_ENTRIES = 100_000


def open_run() -> Path:
    """Makes the folder of a run, with the entries of the tests' store in it."""
    return _program_store.open_run(STORE)


def close_run(run: Path) -> None:
    """Moves what a run has compiled into the tests' store, bounds the store and removes the folder."""
    _program_store.close_run(run, STORE, MOST_BYTES, MOST_ENTRIES)


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
