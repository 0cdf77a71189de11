"""Types of arguments for functions of numbers and arrays, which NumPy and JAX may both evaluate."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Array

AnyArray = np.ndarray | Array
"""An array of NumPy or JAX, or one that JAX traces."""
Real = float | AnyArray
"""A number, or an array of numbers."""
Vector = Sequence[float] | np.ndarray
"""A few numbers, such as a point in space."""
