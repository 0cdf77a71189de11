"""Recruitment of motor units for a load, by a linear mapping or an arm (chapter 4 of the thesis)."""

import abc
import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad.schema import Range, Settings, count, inner, number, static
from motorgrad.tasks._senses import FULL_STRAIN, Sense, noisy, strain, strain_rates
from motorgrad.tasks._task import Flag, Metric, Scalar, Task
from motorgrad.worlds import Attempt, QueriedLoads, RepeatedLoads, UniformLoads, World

WITHIN = Range(-1e6, 1e6, open_low=True, open_high=True)
N = TypeVar("N", float, np.ndarray, Array)


@dataclasses.dataclass(frozen=True)
class Drift(Settings):
    r"""A periodic change over time $t$ of the muscle's strength, or of an unobserved additional load (section 4.4.1 of
    the thesis)."""

    amount: float = static(
        0.0,
        allowed=WITHIN,
        help="$A$, the greatest change; 0 for none. For the strength a fraction above −1, such as −0.3 for a "
        "muscle that loses 30 % and regains it; for the load in units of the load",
    )
    period: int = count(1_000_000, 2, unit="decisions", help="$T$, the period of the change")
    form: Literal["sine", "steps"] = static(
        "sine",
        help=r'`"sine"`, $A f(t)$ with $f = \tfrac12 (1 - \cos 2\pi t/T)$; `"steps"`, 0 in the first half of '
        r"each period and $A$ in the second",
    )
    of: Literal["strength", "load"] = static(
        "strength",
        help='`"strength"`, a factor of the muscle\'s force, from 1 to $1 + A$; or `"load"`, an additional '
        "load from 0 to $A$, which is not observed: the arm has become heavier, or holds a tool",
    )

    def validate(self) -> None:
        within = self.of == "load" or -1 < self.amount < 100
        check(within, "amount", self.amount, "above -1 and below 100, of the strength")

    def strength(self, clock: Int[Array, ""] | None) -> Scalar | float:
        """The factor of the muscle's force at a decision of the period, counted from 0; 1 without a clock."""
        return self._course(1.0, clock) if self.of == "strength" else 1.0

    def load(self, clock: Int[Array, ""] | None) -> Scalar | float:
        """The additional load at a decision of the period; 0 without a clock."""
        return self._course(0.0, clock) if self.of == "load" else 0.0

    def start(self) -> Int[Array, ""] | None:
        """The clock at the first decision; `None` without drift."""
        return jnp.zeros((), jnp.int32) if self.amount else None

    def tick(self, clock: Int[Array, ""] | None) -> Int[Array, ""] | None:
        """The clock at the next decision."""
        return None if clock is None else (clock + 1) % self.period

    def _course(self, start: float, clock: Int[Array, ""] | None) -> Scalar | float:
        """From `start` to `start` + `amount` and back."""
        if clock is None:
            return start
        if self.form == "steps":
            return jnp.where(clock < self.period // 2, start, start + self.amount)
        return start + 0.5 * self.amount * (1.0 - jnp.cos(2.0 * jnp.pi * clock / self.period))


class RecruitmentMemory(NamedTuple):
    """The memory of a recruitment task: the `load` of the next action, without the drift; for the last action the load
    it acted `at` (with the drift), its `ratio` (the fraction of the pool that fired, by size) and its `effect`; and the
    `clock` of the drift, or `None`."""

    load: Scalar
    at: Scalar
    ratio: Scalar
    effect: Scalar
    clock: Int[Array, ""] | None


@dataclasses.dataclass(frozen=True)
class Recruitment(Task):
    """A pool of motor units that pull together at a load, which all motoneurons observe, or feel in one way."""

    learner: ClassVar[Mapping[str, Any]] = {}
    clips_actions: ClassVar[bool] = True

    units: int = count(4, 1, 10_000, help="number of units in the pool")
    size_ratio: float = number(
        1.0,
        1,
        1e6,
        help="ratio of the largest unit's force to the smallest's; sizes grow exponentially from the first "
        "unit to the last. 1 for equal units",
    )
    strengths: tuple[float, ...] = static(
        (),
        allowed=Range(0, 1e6, open_low=True),
        help="the force of each unit relative to the others, in any measure, for units of any sizes (section 4.1.2); "
        "empty for sizes by `size_ratio`",
    )
    drift: Drift = inner(
        factory=Drift,
        help="how the muscle's strength, or an additional load, changes over time; by default neither does",
    )
    time_limit: int | None = count(
        None, 1, unit="decisions", help="length at which an episode is cut; `None` for never"
    )
    senses: Sense = static(
        "load",
        help='what the pool observes: `"load"`, the load itself; or, where the load is hidden, `"strain"`, by how much '
        'it stretches the tendon of the muscle before the action, in % of its length; `"lifts"`, only on an arm, the '
        "height and the activity of the last attempt at the same load, each from 0 to 1, and twice 0 before the first; "
        '`"nothing"`, a constant 0',
    )
    noise: float = number(
        0.0, 0, 1e3, unit="%", help="standard deviation of the noise of a strain that is felt; drawn at each decision"
    )
    attempts: int = count(1, 1, 10_000, unit="decisions", help="how long each load stays; at least 2 to sense lifts")

    def validate(self) -> None:
        super().validate()
        given = len(self.strengths)
        check(
            given in (0, self.units), "strengths", self.strengths, f"empty, or a force for each of {self.units} units"
        )
        once = given == 0 or self.size_ratio == 1
        check(once, "size_ratio", self.size_ratio, "1 where strengths are given")
        strained = self.senses == "strain"
        check(strained or self.noise == 0, "noise", self.noise, "0 unless the strain is sensed")
        check(not strained or self.heaviest > 0, "high", self.heaviest, "above 0 to be felt as a strain")

    @property
    @abc.abstractmethod
    def heaviest(self) -> float:
        """The greatest load. It pulls at the tendon with the greatest isometric force of the muscle."""

    @property
    def uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """One for the noise of a strain."""
        return 1 if self.noise else 0

    @property
    def observation_size(self) -> int:
        return 1

    @property
    def observation_names(self) -> tuple[str, ...]:
        return ("strain",) if self.senses == "strain" else super().observation_names

    @property
    def observation_units(self) -> tuple[str, ...]:
        return ("%",) if self.senses == "strain" else super().observation_units

    @property
    def action_size(self) -> int:
        return self.units

    @property
    def accepted_actions(self) -> tuple[str, ...]:
        return ("binary", "continuous")

    @property
    def action_range(self) -> tuple[tuple[float, float], ...]:
        return ((0.0, 1.0),) * self.action_size

    @property
    def episode_limit(self) -> int | None:
        return self.time_limit

    @functools.cached_property
    def sizes(self) -> Float[np.ndarray, " units"]:
        """Each unit's fraction of the whole pool's force; they sum to 1."""
        forces = np.array(self.strengths)
        if not self.strengths:
            forces = self.size_ratio ** (np.arange(self.units) / max(1, self.units - 1))
        return forces / forces.sum()

    @abc.abstractmethod
    def effect(self, load: Scalar, ratio: Scalar, strength: Scalar | float = 1.0) -> Scalar:
        """The effect of pulling at a load with a fraction `ratio` of the pool, for a muscle whose force has changed by
        the factor `strength`."""

    @abc.abstractmethod
    def pay(self, load: Scalar, ratio: Scalar, effect: Scalar) -> Scalar:
        """The reward for an effect."""

    def ratio(self, action: Float[Array, " units"]) -> Scalar:
        """The fraction of the pool that fires, by size, from 0 to 1. Graded activations are clipped to that range
        individually."""
        action = jnp.clip(action[: self.units], 0, 1)
        if self.size_ratio == 1 and not self.strengths:
            return jnp.sum(action) / self.units
        return jnp.sum(action * jnp.asarray(self.sizes, action.dtype))

    def init(self, uniforms: Float[Array, " 0"]) -> RecruitmentMemory:
        zero = jnp.zeros(())
        return RecruitmentMemory(zero, zero, zero, zero, self.drift.start())

    def renew(self, memory: RecruitmentMemory, uniforms: Float[Array, " 0"]) -> RecruitmentMemory:
        """The drift continues from one episode to the next."""
        return self.init(uniforms)._replace(clock=memory.clock)

    def observe(
        self, memory: RecruitmentMemory, state: Scalar | Attempt, uniforms: Float[Array, " uniforms"]
    ) -> tuple[RecruitmentMemory, Float[Array, " observation_size"]]:
        load = load_in(state)
        memory = memory._replace(load=load)
        if self.senses == "load":
            return memory, load[None]
        if self.senses == "nothing":
            return memory, jnp.zeros_like(load)[None]
        # who holds a tool feels its weight
        felt = strain((load + self.drift.load(memory.clock)) / self.heaviest)
        return memory, noisy(felt, self.noise, uniforms)[None]

    def reward(
        self, memory: RecruitmentMemory, state: Scalar | Attempt, action: Float[Array, " units"]
    ) -> tuple[RecruitmentMemory, Scalar, Flag]:
        ratio = self.ratio(action)
        load = memory.load + self.drift.load(memory.clock)
        effect = self.effect(load, ratio, self.drift.strength(memory.clock))
        memory = RecruitmentMemory(memory.load, load, ratio, effect, self.drift.tick(memory.clock))
        return memory, self.pay(load, ratio, effect), self.over(load_in(state))

    def over(self, load: Scalar) -> Flag:
        """Whether the episode ends if this is the next load."""
        del load
        return False

    def immediate(self, observation: Float[Array, " 1"], action: Float[Array, " action_size"]) -> Scalar:
        """The reward of an action at an observed load, as `motorgrad.worlds.mean_field` expects it (without drift).

        **Raises** `ValueError` where the load is not what is observed.
        """
        check(self.senses == "load", "senses", self.senses, "'load', for the reward of what is observed")
        ratio = self.ratio(action)
        return self.pay(observation[0], ratio, self.effect(observation[0], ratio))

    def lasting(self, loads: World) -> World:
        """These loads, each of which stays for as many decisions as there are attempts at it."""
        return loads if self.attempts == 1 else RepeatedLoads(loads, self.attempts)


def load_in(state: Scalar | Attempt) -> Scalar:
    """The load in a state of the task's world."""
    return state.load if isinstance(state, Attempt) else state


@dataclasses.dataclass(frozen=True)
class LinearRecruitment(Recruitment):
    """Recruit as many units as make the force a linear function of the load (section 4.3.1 of the thesis).

    Observed: the load $x$, from U[`low`, `high`], or the strain by which it is felt. Actions: each unit fires or not.
    Reward: $-(a - a^*)^2$ with the target force $a^* = c_1 x + c_2$. The force $a$ is either the number of active units
    (`output="count"`; then $a^*$ is in units too) or their fraction of the pool.
    """

    name: ClassVar[str] = "linear-recruitment"
    metric_names: ClassVar[tuple[str, ...]] = ("error",)
    metric_units: ClassVar[Mapping[str, str]] = {"error": "1"}

    output: Literal["count", "ratio"] = static(
        "count",
        help='`"count"` or `"ratio"`. They differ by the factor `units`² in the reward, and so in the step size',
    )
    slope: float = number(1.2, 0, 1e6, open_low=True, open_high=True, help="$c_1$, for the output as a ratio")
    intercept: float = static(-0.1, allowed=WITHIN, help="$c_2$, for the output as a ratio")
    low: float = static(0.0, allowed=WITHIN, help="the least load")
    high: float = static(1.0, allowed=WITHIN, help="the greatest load")
    loads: Literal["uniform", "queried"] = static(
        "uniform",
        help='`"uniform"`, as above; or `"queried"`: the action has one more number at its end, the load that '
        "the learner asks to observe next (`motorgrad.policies.Querying`)",
    )

    def validate(self) -> None:
        super().validate()
        check(self.low < self.high, "low, high", (self.low, self.high), "an interval, low < high")
        check(self.senses != "lifts", "senses", self.senses, "'load', 'strain' or 'nothing': a pull has no height")
        told = self.loads == "uniform" or (self.senses == "load" and self.attempts == 1)
        check(told, "senses, attempts", (self.senses, self.attempts), "'load' and 1 for loads that are queried")

    @property
    def heaviest(self) -> float:
        return self.high

    @property
    def learner(self) -> Mapping[str, Any]:  # pyright: ignore[reportIncompatibleVariableOverride]
        if self.senses == "strain":
            policy = {"kind": "motoneurons", "high": FULL_STRAIN}
            return {"policy": policy, "decay": 0.0, "learning_rate": strain_rates(2e-4, 2e-4, self.high)}
        policy = "motoneurons" if self.loads == "uniform" else "querying-motoneurons"
        return {"policy": policy, "decay": 0.0, "learning_rate": 2e-4}

    @property
    def action_size(self) -> int:
        return self.units + (self.loads == "queried")

    @property
    def accepted_actions(self) -> tuple[str, ...]:
        return super().accepted_actions if self.loads == "uniform" else ("querying",)

    @property
    def dynamics(self) -> World:
        return self.lasting((UniformLoads if self.loads == "uniform" else QueriedLoads)(self.low, self.high))

    def target(self, load: N) -> N:
        """The target force at a load, as a ratio; arrays of any shape."""
        return self.slope * load + self.intercept

    def effect(self, load: Scalar, ratio: Scalar, strength: Scalar | float = 1.0) -> Scalar:
        """The force, as a ratio."""
        return strength * ratio

    def pay(self, load: Scalar, ratio: Scalar, effect: Scalar) -> Scalar:
        scale = self.units if self.output == "count" else 1
        return -jnp.square(scale * (effect - self.target(load)))

    def metrics(self, memory: RecruitmentMemory, state: Scalar) -> dict[str, Metric]:
        """`error`: the absolute difference between force and target, as a ratio."""
        return {"error": (jnp.abs(memory.effect - self.target(memory.at)), True)}

    def ideal_thresholds(self, order: npt.ArrayLike | None = None) -> Float[np.ndarray, " units"]:
        """The best thresholds for units without noise, $y^*_i = (m_i - c_2)/c_1$.

        $m_i$ is the mean of the ratios before and after unit $i$ fires, $(i - ½)/N$ for equal units.

        **Arguments:** `order`, the units in the order of their recruitment; by default from the smallest to the
        largest. For uniformly distributed loads every order is equally good: a unit of size $s$ costs $s^3/12$ in any
        place.

        **Returns:** the threshold of each unit, in the units' own order.
        """
        places = np.arange(self.units) if order is None else np.asarray(order)
        check(sorted(places.tolist()) == list(range(self.units)), "order", places.tolist(), "every unit once")
        sizes = self.sizes[places]
        found = np.empty(self.units)
        found[places] = (np.cumsum(sizes) - sizes / 2 - self.intercept) / self.slope
        return found


def spacing_error(thresholds: npt.ArrayLike, task: LinearRecruitment) -> Float[np.ndarray, "..."]:
    """The greatest deviation of pools' thresholds from the ideal ones, relative to the spacing of the latter.

    **Arguments:** `thresholds` (..., units), of units with positive gains; the task.

    **Returns:** (...): the greatest distance of a threshold from the ideal one of a unit recruited in its place,
    divided by the mean spacing 1 / (units × slope). Below 0.25, units count as equally spaced.
    """
    pools = np.asarray(thresholds, float)
    check(pools.shape[-1:] == (task.units,), "thresholds.shape", pools.shape, f"(..., {task.units})")
    flat = pools.reshape(-1, task.units)
    order = np.argsort(flat, axis=-1)
    ideal = np.array([task.ideal_thresholds(row) for row in order]).reshape(flat.shape)
    away = np.abs(flat - ideal).max(-1) * task.units * task.slope
    return away.reshape(pools.shape[:-1])
