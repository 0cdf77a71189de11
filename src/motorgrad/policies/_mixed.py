"""Binary and graded units side by side in one policy."""

import itertools

import equinox as eqx

from motorgrad._errors import check
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._binary import zero_hyperplanes
from motorgrad.policies._bounded import InitialBounded, bounds_of
from motorgrad.policies._composed import Pools
from motorgrad.policies._featured import InitialFeatured
from motorgrad.policies._policy import Policy
from motorgrad.policies._starting import Initial, InitialPolicy, function_of
from motorgrad.schema import count


class Mixed(Pools):
    r"""Pools of binary and of graded units side by side on one observation: $\log\pi = \sum_k \log\pi_k$.

    The action is a vector of the pools' actions one after the other: zeros and ones of binary pools, real numbers of
    graded ones. `actions` tells the kind of each.

    **Arguments:** `pools`, at least one pool of binary or graded units, over observations of the same length.

    **Example:**

    ```python
    grasp = Hyperplanes(weights=[[1.0, 0.0]], bias=[0.0])
    muscles = BoundedHyperplanes(weights=[[0.5, 1.0]], bias=[0.2], log_deviation=[-1.0], low=0.0)
    Mixed([grasp, muscles]).actions  # ("binary", "continuous")
    ```
    """

    pools: tuple[Policy, ...] = eqx.field(converter=tuple)

    def __check_init__(self) -> None:
        super().__check_init__()
        kinds = [pool.actions for pool in self.pools]
        vectors = all(isinstance(kind, tuple) or kind in ("binary", "continuous") for kind in kinds)
        check(vectors, "pools", kinds, "pools of binary or graded units")

    @property
    def actions(self) -> str | tuple[str, ...]:
        """The kind of each number; only one if all are of it."""
        kinds: list[str] = []
        for pool in self.pools:
            kinds += pool.actions if isinstance(pool.actions, tuple) else [pool.actions] * pool.outputs
        return tuple(kinds) if len(set(kinds)) > 1 else kinds[0]


class InitialPartlyBinary(InitialPolicy):
    """Units of which some are binary."""

    binary: int = count(
        1, 1, help="how many of the first units are binary, where the task does not tell the kind of each action"
    )


class InitialMixed(InitialFeatured, InitialBounded, InitialPartlyBinary):
    """Hyperplanes for the binary actions of a task, and bounded ones for its continuous ones, all with zero weights."""

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        kinds = getattr(task, "actions", None)
        if not isinstance(kinds, tuple):
            wanted = f"from 1 to {outputs - 1}, fewer than the {outputs} units"
            check(self.binary < outputs, "binary", self.binary, wanted)
            kinds = ("binary",) * self.binary + ("continuous",) * (outputs - self.binary)
        check(len(kinds) == outputs, "units", outputs, f"{len(kinds)}, one for each action of the task")
        ranges = bounds_of(task, outputs)

        def pools(seen: int) -> Mixed:
            found: list[Policy] = []
            for continuous, run in itertools.groupby(
                zip(kinds, ranges, strict=True), lambda pair: pair[0] == "continuous"
            ):
                own = [bounds for _, bounds in run]
                found.append(self.within(own, seen) if continuous else zero_hyperplanes(seen, len(own)))
            return Mixed(found)

        return self.behind(inputs, pools)


mixed = function_of(InitialMixed)
