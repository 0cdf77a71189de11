"""C functions in machine code, from numba's cache on disk where an earlier process compiled them.

numba keeps its cache in the folder `NUMBA_CACHE_DIR`, else beside the source file, else, where that cannot be written,
in the user's cache folder. An entry belongs to a version of numba and to a processor; entries are written elsewhere and
moved into place, so several processes may share them.
"""

import contextlib
import functools
import hashlib
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from motorgrad._program_store import kept

TRIED = ("0.68.",)  # versions of numba in which machine code needs nothing but its runtime


def compiled(function: Callable[..., float], signature: Any) -> Any:
    """A function of this package compiled as a C function, or read from the cache: numba's `CFunc`.

    **Arguments:** a function, which may call others by its closure; its signature in numba's types.
    """
    import numba  # imported late, as it takes long
    from numba.core.caching import FunctionCache, IndexDataCacheFile
    from numba.core.ccallback import CFunc
    from numba.core.runtime.nrt import rtsys

    class Cache(FunctionCache):
        """The cache of a function whose closure holds compiled functions. In numba's own key these differ from process
        to process. Here the source of all that they are made of stands for them."""

        def __init__(self, function: Callable[..., float]):
            super().__init__(function)
            self._cache_file = IndexDataCacheFile(self.cache_path, self._impl.filename_base, source_stamp=_source())

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            """The function, without what numba would load to compile others, which takes longer than all else."""
            if not numba.__version__.startswith(TRIED):
                return super().load_overload(sig, target_context)
            rtsys.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)

        def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
            return sig, codegen.magic_tuple()

    made = CFunc(function, (signature.args, signature.return_type), locals={}, options={"error_model": "numpy"})
    if kept():
        with contextlib.suppress(RuntimeError):  # no folder can be written
            made._cache = Cache(function)  # pyright: ignore[reportAttributeAccessIssue]
    made.compile()
    return made


@functools.cache
def _source() -> str:
    """A hash of all that the machine code follows from, but numba and the processor."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    made_of = [file.read_bytes() for file in files]
    made_of += [f"{name} {version(name)}".encode() for name in ("mujoco", "llvmlite", "numpy")]
    return hashlib.sha256(b"\0".join(made_of)).hexdigest()
