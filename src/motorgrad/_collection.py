"""Python's collection of garbage, while much is made that stays: modules, and what JAX traces."""

import contextlib
import gc
from collections.abc import Iterator

_SELDOM = (50_000, 20, 100)


@contextlib.contextmanager
def collecting_seldom() -> Iterator[None]:
    """Look for garbage seldom, unless that is so already. By default Python looks after every 700 new objects, and
    again and again through all that live, which is a tenth of the time until a first decision."""
    before = gc.get_threshold()
    if not 0 < before[0] < _SELDOM[0]:
        yield
        return
    gc.set_threshold(*_SELDOM)
    try:
        yield
    finally:
        gc.set_threshold(*before)
