"""Binary and graded units side by side in one policy."""

import itertools

import equinox as eqx
from jaxtyping import Array

from motorgrad._errors import check
from motorgrad.policies._architectures import Architecture
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._binary import zero_hyperplanes
from motorgrad.policies._bounded import Shape, bounds_of, start_bounded
from motorgrad.policies._composed import Pools
from motorgrad.policies._featured import featured
from motorgrad.policies._features import INPUTS, FeatureMap
from motorgrad.policies._policy import Policy
from motorgrad.policies._starting import Initial, InitialPolicy, function_of
from motorgrad.schema import static


class Mixed(Pools):
    r"""Pools of binary and of graded units side by side on one observation: $\log\pi = \sum_k \log\pi_k$.

    The action is a vector of the pools' actions one after the other: zeros and ones of binary pools, real numbers of
    graded ones. `actions` tells the kind of each.

    **Arguments:** `pools`, at least one pool of binary or graded units, over observations of the same length.

    **Example:**

    ```python
    grasp = Hyperplanes(weights=[[1.0, 0.0]], bias=[0.0])
    muscles = BoundedHyperplanes(weights=[[0.5, 1.0]], bias=[0.2], log_deviation=[-1.0], low=0.0)
    Mixed([grasp, muscles]).actions  # ("binary", "graded")
    ```
    """

    pools: tuple[Policy, ...] = eqx.field(converter=tuple)

    def __check_init__(self) -> None:
        super().__check_init__()
        kinds = [pool.actions for pool in self.pools]
        vectors = all(isinstance(kind, tuple) or kind in ("binary", "graded") for kind in kinds)
        check(vectors, "pools", kinds, "pools of binary or graded units")

    @property
    def actions(self) -> str | tuple[str, ...]:
        """The kind of each number; only one if all are of it."""
        kinds: list[str] = []
        for pool in self.pools:
            kinds += pool.actions if isinstance(pool.actions, tuple) else [pool.actions] * pool.outputs
        return tuple(kinds) if len(set(kinds)) > 1 else kinds[0]

    def enumerate(self) -> Array:
        raise ValueError(f"{type(self).__name__}: has infinitely many actions: real numbers")


class InitialMixed(InitialPolicy):
    """Hyperplanes for the binary actions of a task, and bounded ones for its graded actions, all with zero weights.

    **Arguments:**

    - `units`: the number of units, by default one for each action of the task.
    """

    binary: int = static(
        1, help="how many of the first units are binary, where the task does not tell the kind of each action"
    )
    density: Shape = static(
        "squashed", help="density of a graded activation: squashed, clipped or truncated normal, or beta"
    )
    level: float = static(
        0.0, help="the most probable graded activation at the start, as a fraction of half the range from its middle"
    )
    deviation: float = static(0.5, help="the spread of graded activations at the start, in units of half the range")
    floor: float = static(0.02, help="the least spread that learning may reach")
    features: FeatureMap = static(INPUTS, help="what the units see beside the inputs; by default nothing")
    network: Architecture | None = static(
        None,
        help="hidden layers between these inputs and the units; by default none. With them, the result is a "
        "function from a key to a `Network`",
    )

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        kinds = getattr(task, "actions", None)
        if not isinstance(kinds, tuple):
            check(
                0 < self.binary < outputs,
                "binary",
                self.binary,
                f"from 1 to {outputs - 1}, fewer than the {outputs} units",
            )
            kinds = ("binary",) * self.binary + ("graded",) * (outputs - self.binary)
        check(len(kinds) == outputs, "units", outputs, f"{len(kinds)}, one for each action of the task")
        ranges = bounds_of(task, outputs)

        def pools(inputs: int) -> Mixed:
            start = 0
            found = []
            for kind, run in itertools.groupby(kinds):
                own = ranges[start : start + len(list(run))]
                graded = kind == "graded"
                found.append(
                    start_bounded(inputs, own, self.density, self.level, self.deviation, self.floor)
                    if graded
                    else zero_hyperplanes(inputs, len(own))
                )
                start += len(own)
            return Mixed(found)

        return featured(self.features, inputs, pools, self.network)


mixed = function_of(InitialMixed)
