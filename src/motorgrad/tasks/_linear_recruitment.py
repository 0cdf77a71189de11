"""Recruitment for a linear mapping from load to force (section 4.3.1 of the thesis)."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Float

from motorgrad._errors import check, choice
from motorgrad.tasks._recruitment import Pull, Recruitment
from motorgrad.tasks._task import Reading
from motorgrad.worlds import QueriedLoads, UniformLoads


@dataclasses.dataclass(frozen=True)
class LinearRecruitment(Recruitment):
    r"""Fire so many units that their force is a linear function of the load.

    Observed: the load $x$, from U[`low`, `high`]. Actions: each unit fires or not. Reward: $-(a - a^*)^2$ with the
    wanted force $a^* = c_1 x + c_2$, for the force $a$, which counts either the units that fire (`output="count"`; then
    $a^*$ is in units too) or the part of the pool that they are.

    **Arguments:** `units`, `size_ratio`, `drift` and `time_limit`, as of every recruitment task, and

    - `output`: `"count"` or `"ratio"`. They differ by the factor `units`² in the reward, and so in the step size.
    - `slope`: $c_1$, of the output as a ratio; above 0.
    - `intercept`: $c_2$, of the output as a ratio.
    - `low`: the least of the loads.
    - `high`: the greatest of the loads.
    - `loads`: `"uniform"`, as above; or `"queried"`: after the units' the action has one more number, the load that the
      learner asks to see next (`motorgrad.policies.Querying`).
    """

    name: ClassVar[str] = "linear-recruitment"
    reports: ClassVar[tuple[str, ...]] = ("error",)

    output: Literal["count", "ratio"] = "count"
    slope: float = 1.2
    intercept: float = -0.1
    low: float = 0.0
    high: float = 1.0
    loads: Literal["uniform", "queried"] = "uniform"

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("output", self.output, ("count", "ratio"))
        choice("loads", self.loads, ("uniform", "queried"))
        check(0 < self.slope < 1e6, "slope", self.slope, "above 0 and below 1e6")
        check(abs(self.intercept) < 1e6, "intercept", self.intercept, "a number between -1e6 and 1e6")
        check(-1e6 < self.low < self.high < 1e6, "low, high", (self.low, self.high), "an interval, low < high")

    @property
    def learner(self) -> Mapping[str, Any]:  # pyright: ignore[reportIncompatibleVariableOverride]
        policy = "motoneurons" if self.loads == "uniform" else "querying-motoneurons"
        return {"policy": policy, "decay": 0.0, "learning_rate": 2e-4}

    @property
    def action_size(self) -> int:
        return self.units + (self.loads == "queried")

    @property
    def takes(self) -> tuple[str, ...]:
        return super().takes if self.loads == "uniform" else ("querying",)

    @property
    def dynamics(self) -> UniformLoads | QueriedLoads:
        return (UniformLoads if self.loads == "uniform" else QueriedLoads)(self.low, self.high)

    def target(self, load: Any) -> Any:
        """The force that is wanted at a load, as a ratio; arrays of any shape."""
        return self.slope * load + self.intercept

    def effect(
        self, load: Float[Array, ""], ratio: Float[Array, ""], strength: Float[Array, ""] | float = 1.0
    ) -> Float[Array, ""]:
        """The force, as a ratio."""
        return strength * ratio

    def pay(self, load: Float[Array, ""], ratio: Float[Array, ""], effect: Float[Array, ""]) -> Float[Array, ""]:
        scale = self.units if self.output == "count" else 1
        return -jnp.square(scale * (effect - self.target(load)))

    def readings(self, memory: Pull, state: Float[Array, ""]) -> dict[str, Reading]:
        """`error`: how far the force is from the wanted one, as a ratio, without sign."""
        return {"error": (jnp.abs(memory.effect - self.target(memory.at)), True)}

    def ideal_thresholds(self, order: npt.ArrayLike | None = None) -> Float[np.ndarray, " units"]:
        r"""The best thresholds for units without noise, $y^*_i = (m_i - c_2)/c_1$.

        $m_i$ is the ratio half way between those before and after unit $i$ fires, for equal units $(i - ½)/N$.

        **Arguments:** `order`, the units in the order of their recruitment; by default from the smallest to the
        largest. For loads of one density every order is as good: a unit of size $s$ costs $s^3/12$ wherever it stands.

        **Returns:** the threshold of each unit, in the units' own order.
        """
        places = np.arange(self.units) if order is None else np.asarray(order)
        check(sorted(places.tolist()) == list(range(self.units)), "order", places.tolist(), "every unit once")
        sizes = self.sizes[places]
        found = np.empty(self.units)
        found[places] = (np.cumsum(sizes) - sizes / 2 - self.intercept) / self.slope
        return found


def spacing_error(thresholds: npt.ArrayLike, task: LinearRecruitment) -> Float[np.ndarray, "..."]:
    """How far the thresholds of pools are from the ideal ones, in spacings between those.

    **Arguments:** `thresholds` (..., units), of units with positive gains; the task.

    **Returns:** (...): the greatest distance of a threshold from the ideal one of a unit recruited at its place, as a
    part of the mean spacing 1 / (units × slope). Below 0.25 units count as equally spaced.
    """
    pools = np.asarray(thresholds, float)
    check(pools.shape[-1:] == (task.units,), "thresholds.shape", pools.shape, f"(..., {task.units})")
    flat = pools.reshape(-1, task.units)
    order = np.argsort(flat, axis=-1)
    ideal = np.array([task.ideal_thresholds(row) for row in order]).reshape(flat.shape)
    away = np.abs(flat - ideal).max(-1) * task.units * task.slope
    return away.reshape(pools.shape[:-1])
