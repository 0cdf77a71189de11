"""Numbers between NumPy and Arrow. pyarrow's own conversions load pandas where it is installed, for a fifth of a
second."""

from typing import TYPE_CHECKING

import numpy as np

from motorgrad._arrays import AnyArray

if TYPE_CHECKING:
    import pyarrow as pa  # loading it would slow down every command's start


def column_of(numbers: AnyArray) -> "pa.Array":
    """A vector of integers or real numbers as a column, in its memory."""
    import pyarrow as pa

    numbers = np.ascontiguousarray(numbers)
    return pa.Array.from_buffers(pa.from_numpy_dtype(numbers.dtype), len(numbers), [None, pa.py_buffer(numbers)])


def numbers_in(column: "pa.ChunkedArray") -> np.ndarray:
    """The numbers of a column without gaps, which may not be written to."""
    return np.from_dlpack(column.combine_chunks())
