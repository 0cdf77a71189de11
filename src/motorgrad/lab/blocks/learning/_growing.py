"""A pool of local units that grows while it learns, as a block."""

import dataclasses
import functools
from typing import Annotated, Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import learning, policies
from motorgrad._errors import check
from motorgrad.lab.blocks.learning._counts import check_numbers
from motorgrad.lab.blocks.learning._gaussians import Gaussians
from motorgrad.lab.blocks.learning._policy import key_from
from motorgrad.lab.blocks.learning._traced import VALID, paid, where
from motorgrad.lab.blocks.learning._units import unflat
from motorgrad.lab.diagram import Moment, Port, Ports, Setting, Signals
from motorgrad.policies import Policy, split


class Growing(NamedTuple):
    """The pool, and what growth knows."""

    policy: policies.Masked
    growth: learning.GrowthState


@dataclasses.dataclass(frozen=True)
class GrowingGaussians(Gaussians):
    """Local Gaussian units that come one by one while they learn (section 6.4.3 of the thesis).

    A new unit starts wide, at `begin` or at a place lately seen, and shrinks from `wide` to `narrow`, learning faster
    meanwhile; then all learn alike until the next is due: by the clock, or once the reward no longer rises. `units` is
    the most there can be; the first is there from the start. `centre` and `width` are of those that are not there yet,
    and so of no account.
    """

    name: ClassVar[str] = "growing gaussians"

    grows: Annotated[str, Setting("when a unit is added", choices=("clock", "plateau"))] = "clock"
    interval: Annotated[int, Setting("from one unit to the next by the clock, in ticks")] = 10_000
    window: Annotated[int, Setting("over which the reward is averaged to see whether it rises, in ticks")] = 4_000
    patience: Annotated[int, Setting("after how many units in vain none is added")] = 3
    placed: Annotated[str, Setting("where a unit starts", choices=("begin", "visited"))] = "begin"
    begin: Annotated[tuple[float, ...] | float, Setting("that place, for all inputs or for each")] = 0.5
    wide: Annotated[float, Setting("width of a new unit")] = 1.0
    narrow: Annotated[float, Setting("width at the end of its adding phase")] = 0.15
    shrink: Annotated[float, Setting("what the width is multiplied by at every tick of it")] = 0.99975
    boost: Annotated[float, Setting("what a new unit's steps are multiplied by in it")] = 8.0
    damp: Annotated[float, Setting("what those of the others are multiplied by in it")] = 0.5

    def validate(self) -> None:
        super().validate()
        check_numbers(self, "interval", "window", "patience", whole=True)
        check_numbers(self, "wide", "narrow", "shrink", "boost", "damp")
        places = self.begin if isinstance(self.begin, tuple) else (self.begin,)
        numbers = all(isinstance(x, int | float) and abs(x) < 1e6 for x in places)
        fits = numbers and (not isinstance(self.begin, tuple) or len(places) == self.observed)
        check(fits, "begin", self.begin, f"one number, or {self.observed} of them, between -1e6 and 1e6")
        _ = self._growth

    @functools.cached_property
    def _growth(self) -> learning.Growth:
        by = (
            learning.Clock(self.interval)
            if self.grows == "clock"
            else learning.Plateau(self.window, 0.95, self.patience)
        )
        place = learning.Visited() if self.placed == "visited" else None
        return learning.Growth(by, None, self.begin, place, self.wide, self.narrow, self.shrink, self.boost, self.damp)

    @property
    def inputs(self) -> Ports:
        own = {"reward": Port(default=0.0, help="by which it sees whether units are wanted"), "valid": VALID}
        return {**super().inputs, **own}

    @property
    def outputs(self) -> Ports:
        return {**super().outputs, "units": Port((), "int", help="how many there are")}

    @property
    def init_uniforms(self) -> int:
        return super().init_uniforms + 1

    def start(self, uniforms: Float[Array, " numbers"]) -> Policy:
        return self._begin(uniforms).policy

    def _begin(self, uniforms: Float[Array, " numbers"]) -> Growing:
        pool = policies.Masked(self.pool(uniforms[:-1]), jnp.zeros(self.units, bool))
        state, policy = self._growth.init(pool, key_from(uniforms[-1:]))
        return Growing(policy, state)

    def init(self, uniforms: Float[Array, " numbers"]) -> Growing:
        return self._begin(uniforms)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        units = jnp.sum(self.acting(self.moved(state, inputs, now)).active, dtype=jnp.int32)
        return {**super().output(state, inputs, now), "units": units}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Growing:
        after = self.moved(state, inputs, now)
        return after._replace(growth=self._growth.see(after.growth, inputs["observation"]))

    def moved(self, state: Any, inputs: Signals, now: Moment) -> Growing:
        growth = where(paid(inputs, now), self._growth.watch(state.growth, inputs["reward"]), state.growth)
        parameters, settings = split(state.policy)
        step = self.thawed(state.policy, state.policy.allowed(unflat(parameters, inputs["step"])))
        step = self._growth.paced(growth, step)
        policy = eqx.combine(eqx.apply_updates(parameters, step), settings).limited()
        grown, policy_after, _ = self._growth.advance(growth, policy)
        return where(now.tick > 0, Growing(policy_after, grown), Growing(policy, growth))

    def acting(self, state: Any) -> policies.Masked:
        return state.policy
