"""What the search for faults and linearisation read of a run."""

from typing import Any, Protocol

import numpy as np
from jaxtyping import Array, PyTree

from timlab.compiler import Carry, Plan, Stacks, Step, Values


class Compiled(Protocol):
    """A compiled diagram at a tick, with the parameters and states of many seeds; see `Run`."""

    plan: Plan
    seeds: np.ndarray
    tick: int

    @property
    def values(self) -> Values: ...

    @property
    def stacks(self) -> Stacks: ...

    @property
    def last_of_hosts(self) -> dict[int, dict[str, np.ndarray]]: ...

    def __getitem__(self, address: str) -> Any: ...

    def functions_at(self, row: int) -> tuple[Step, Values, Carry]: ...

    def functions_of(self, carry: Carry, row: int) -> tuple[Step, Values, Carry]: ...

    def sound(self, carry: Carry, seen: PyTree[np.ndarray], whole: Array | np.ndarray) -> bool: ...

    def not_finite(self) -> list[str]: ...

    def unstable_steps(self) -> list[str]: ...
