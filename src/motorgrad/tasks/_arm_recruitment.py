"""Recruitment for an arm that lifts loads (section 4.3.2 of the thesis)."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.bodies import Arm, LiftTable, lift, lift_table
from motorgrad.schema import inner, number, static
from motorgrad.tasks._recruitment import WITHIN, Recruitment, RecruitmentMemory, load_in
from motorgrad.tasks._senses import strain, strain_rates
from motorgrad.tasks._task import Flag, Metric, Scalar
from motorgrad.worlds import Attempt, SweepingLoads, World

COMPLETE = 0.999  # of the full lift, the accuracy to which simulation and table agree
THRESHOLD = 10.0  # kg, the greatest at the start
RATES: Mapping[str, float] = {"gain": 2e-4, "threshold": 4e-4}
"""The thesis's step sizes, for loads in kg."""
METRIC: Mapping[str, Any] = {"kind": "fisher", "rate": 3e-4, "damping": 1e-3}
"""Of hyperplanes that sense lifts, whose plain steps end where all units fire at every load."""


@dataclasses.dataclass(frozen=True)
class ArmRecruitment(Recruitment):
    """Lift each load as high as it is worth, with as few units as possible (section 4.3.2 of the thesis).

    Observed: the load, in kg, of which negative ones mean no load; or what can be felt of it. Actions: each unit of the
    flexor's pool fires or not. Reward: the height of the lift, from 0 to `scale`, minus `cost` × the fraction of the
    pool that fires. An episode is a sweep: the load starts at `low`, grows by U[`least`, `most`] after as many
    `attempts` as it stays for, and the sweep ends when it exceeds `high`.
    """

    name: ClassVar[str] = "arm-recruitment"
    metric_names: ClassVar[tuple[str, ...]] = ("height", "active")
    metric_units: ClassVar[Mapping[str, str]] = {"active": "1"}
    episodic: ClassVar[bool] = True

    body: Arm = inner(factory=Arm, help="the arm (`motorgrad.bodies.Arm`); its own `load` is ignored")
    height: Literal["table", "direct"] = static(
        "table", help='from the `"table"` of simulated lifts, or by `"direct"` simulation of each (some 50 per second)'
    )
    reward_type: Literal["height", "complete"] = static(
        "height",
        help='`"height"`, the reward grows with the height; or `"complete"`, a lift that is not complete '
        "counts as none",
    )
    scale: float = static(10.0, allowed=WITHIN, help="the height of the full lift")
    cost: float = static(4.0, allowed=WITHIN, help="cost of the whole pool's firing")
    unloaded: float = static(0.0, allowed=WITHIN, help="the height credited for loads of 0 and below, whatever fires")
    low: float = number(-2.0, -1e6, open_low=True, unit="kg", help="the load at the start of a sweep")
    high: float = number(
        14.0, high=LiftTable.heaviest, unit="kg", help="the load, including drift, above which a sweep ends"
    )
    least: float = number(0.1, 0, open_low=True, unit="kg", help="the least increase of the load per decision")
    most: float = number(
        0.3, 0, 1e6, open_low=True, open_high=True, unit="kg", help="the greatest increase of the load per decision"
    )

    def validate(self) -> None:
        super().validate()
        check(self.low < self.high, "low, high", (self.low, self.high), "an interval, low < high")
        most = LiftTable.heaviest
        if self.drift.of == "load":
            heaviest = self.high + self.drift.amount
            allowed = f"such that high + drift.amount <= {most:g} kg"
            check(heaviest <= most, "drift.amount", self.drift.amount, allowed)
        check(self.least <= self.most, "least, most", (self.least, self.most), "least <= most")
        if self.senses == "lifts":
            check(self.attempts > 1, "attempts", self.attempts, "at least 2, to sense the lift before")
            check(self.scale != 0, "scale", self.scale, "other than 0, to sense lifts")

    @property
    def heaviest(self) -> float:
        return self.high

    @property
    def learner(self) -> Mapping[str, Any]:  # pyright: ignore[reportIncompatibleVariableOverride]
        sweep = {"decay": 0.0, "update_every": "episode", "reduction": "sum"}
        if self.senses == "lifts":
            return {"policy": "hyperplanes", **sweep, "learning_rate": 1e-4, "metric": dict(METRIC)}
        high = THRESHOLD
        rates = dict(RATES)
        if self.senses == "strain":
            high = round(float(strain(THRESHOLD / self.high)), 3)
            rates = strain_rates(**RATES, heaviest=self.high)
        return {"policy": {"kind": "motoneurons", "low": 0.0, "high": high}, **sweep, "learning_rate": rates}

    @property
    def observation_size(self) -> int:
        return 2 if self.senses == "lifts" else 1

    @property
    def observation_names(self) -> tuple[str, ...]:
        return ("height", "activity") if self.senses == "lifts" else super().observation_names

    @property
    def observation_units(self) -> tuple[str, ...]:
        own = {"load": ("kg",), "lifts": ("1", "1")}
        return own.get(self.senses) or super().observation_units

    @property
    def dynamics(self) -> World:
        return self.lasting(SweepingLoads(self.low, self.least, self.most))

    def observe(
        self, memory: RecruitmentMemory, state: Scalar | Attempt, uniforms: Float[Array, " uniforms"]
    ) -> tuple[RecruitmentMemory, Float[Array, " observation_size"]]:
        if self.senses != "lifts":
            return super().observe(memory, state, uniforms)
        assert isinstance(state, Attempt)
        last = jnp.stack([memory.effect / self.scale, memory.ratio])
        return memory._replace(load=load_in(state)), jnp.where(state.attempt > 0, last, 0.0)

    def over(self, load: Scalar) -> Flag:
        return load > self.high

    def effect(self, load: Scalar, ratio: Scalar, strength: Scalar | float = 1.0) -> Scalar:
        """H, the height to which a fraction of the pool lifts a load; JAX arrays, which broadcast."""
        force = self.body.full_force * strength * ratio
        lifted = lift_table(self.body).lift if self.height == "table" else functools.partial(_simulated, self.body)
        part = lifted(load, force)
        if self.reward_type == "complete":
            part = jnp.where(part > COMPLETE, part, 0.0)
        return jnp.where(load > 0, self.scale * part, self.unloaded)

    def pay(self, load: Scalar, ratio: Scalar, effect: Scalar) -> Scalar:
        return effect - self.cost * ratio

    def metrics(self, memory: RecruitmentMemory, state: Scalar) -> dict[str, Metric]:
        """`height`: of the lift, if there was a load. `active`: the fraction of the pool that fired."""
        return {"height": (memory.effect, memory.at > 0), "active": (memory.ratio, True)}


def _simulated(body: Arm, load: Array, force: Array) -> Array:
    """`motorgrad.bodies.lift` called from compiled code, for all seeds at once."""

    def host(load: npt.ArrayLike, force: npt.ArrayLike) -> np.ndarray:
        return lift(body, np.maximum(load, 0.0), force).astype(np.float32)

    load, force = jnp.broadcast_arrays(jnp.asarray(load, jnp.float32), jnp.asarray(force, jnp.float32))
    shape = jax.ShapeDtypeStruct(load.shape, jnp.float32)
    return jax.pure_callback(host, shape, load, force, vmap_method="broadcast_all")
