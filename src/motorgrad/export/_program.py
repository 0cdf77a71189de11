"""A function as a list of operations on arrays."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np


class Operation(NamedTuple):
    """One array, and how it is made.

    - `kind`: what makes it, such as `"add"`, `"sum"` or `"take"`; `"input"` and `"constant"` are given.
    - `operands`: the places of the arrays that it is made of, in the list of operations.
    - `shape`, `dtype`: of the array.
    - `attributes`: what else its kind needs, such as `axes`.
    """

    kind: str
    operands: tuple[int, ...]
    shape: tuple[int, ...]
    dtype: np.dtype
    attributes: dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Program:
    """A pure function of named arrays. Its `operations` are in an order in which they can be computed, without any that
    no output needs; `inputs` and `outputs` are their places, by name."""

    operations: tuple[Operation, ...]
    inputs: dict[str, int]
    outputs: dict[str, int]


class Untranslatable(ValueError):
    """A function uses an operation that an export does not know."""
