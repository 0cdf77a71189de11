"""Arrays in memory that two processes share, with one writer that never waits."""

import contextlib
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.shared_memory import SharedMemory
from typing import Any

import numpy as np

WORD = 8  # bytes, of a double and of the count
PATIENCE = 10.0  # seconds, far more than a write takes, even on a machine that is much too busy


class Shared:
    """Named arrays of doubles in one block, guarded by a sequence lock: the count in its first word is odd while the
    writer is at work, so a reader that finds it odd, or changed, reads again. The writer waits for nobody.

    **Arguments:** the shapes by name; the block's `name`, to attach to one that is there, or None to make it.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]], name: str | None = None):
        size = WORD * (1 + sum(math.prod(shape) for shape in shapes.values()))
        self._memory = SharedMemory(name, create=name is None, size=size)
        self.owner, self.name = name is None, self._memory.name
        memory: Any = self._memory.buf
        self._sequence = np.frombuffer(memory, np.int64, 1)
        self.arrays: dict[str, np.ndarray] = {}
        place = WORD
        for key, shape in shapes.items():
            count = math.prod(shape)
            self.arrays[key] = np.frombuffer(memory, np.float64, count, place).reshape(shape)
            place += WORD * count

    @contextmanager
    def writing(self) -> Iterator[dict[str, np.ndarray]]:
        """The arrays, to be changed; readers will not take what they see meanwhile."""
        self._sequence[0] += 1
        try:
            yield self.arrays
        finally:
            self._sequence[0] += 1

    def read(self) -> dict[str, np.ndarray]:
        """Copies of the arrays as one write left them.

        **Raises** `RuntimeError` where the writer stopped in the middle of a write.
        """
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            before = int(self._sequence[0])
            if before % 2 == 0:
                copies = {name: array.copy() for name, array in self.arrays.items()}
                if int(self._sequence[0]) == before:
                    return copies
            time.sleep(0)
        raise RuntimeError("shared memory: the simulation stopped while it was writing")

    def close(self) -> None:
        """Let go of the block; who made it takes it away."""
        self.arrays.clear()
        self._sequence = np.empty(0)
        with contextlib.suppress(BufferError):  # someone is just reading; it goes with the last view
            self._memory.close()
        if self.owner:
            self._memory.unlink()
