"""A pool of local units that grows while it learns, as a block."""

import dataclasses
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad import learning, policies
from motorgrad.policies import Policy, abilities, split
from motorgrad.schema import Declared
from timlab.blocks.learning._parts import PartBlock, block_of
from timlab.blocks.learning._shared import VALID, is_paid, where
from timlab.blocks.learning._units import Gaussians, key_from, unflat
from timlab.diagram import Moment, Port, Ports, Signals


class Growing(NamedTuple):
    """The pool, and what growth remembers."""

    policy: policies.Masked
    growth: learning.GrowthState


@dataclasses.dataclass(frozen=True)
class _GrowingGaussians(PartBlock, Gaussians):
    """The block is such a pool of local Gaussian units. `units` is the size of the pool; the first unit is there from
    the start. `centre` and `width` are those of units that are not active yet, and have no effect."""

    category: ClassVar[str] = "learning"

    def number_shape(self, declared: Declared) -> tuple[int, ...]:
        return (self.observed,) if declared.groups else ()

    @property
    def inputs(self) -> Ports:
        reward = Port(default=0.0, help="for a criterion that depends on it")
        return {**super().inputs, "reward": reward, "valid": VALID}

    @property
    def outputs(self) -> Ports:
        return {**super().outputs, "units": Port((), "int", help="number of active units")}

    @property
    def init_uniforms(self) -> int:
        return super().init_uniforms + 1

    def start(self, uniforms: Float[Array, " numbers"]) -> Policy:
        return self._begin(self.template, uniforms).policy

    def _begin(self, growth: learning.Growth, uniforms: Float[Array, " numbers"]) -> Growing:
        pool = policies.Masked(self.pool(uniforms[:-1]), jnp.zeros(self.units, bool))
        state, policy = growth.init(pool, key_from(uniforms[-1:]))
        return Growing(policy, state)

    def init(self, uniforms: Float[Array, " numbers"]) -> Growing:
        return self._begin(self.bound_part, uniforms)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        units = jnp.sum(self.acting(self.moved(state, inputs, now)).active, dtype=jnp.int32)
        return {**super().output(state, inputs, now), "units": units}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Growing:
        after = self.moved(state, inputs, now)
        return after._replace(growth=self.bound_part.observe(after.growth, inputs["observation"]))

    def moved(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Growing:
        rule: learning.Growth = self.bound_part
        growth = where(is_paid(inputs, now), rule.add_reward(state.growth, inputs["reward"]), state.growth)
        parameters, settings = split(state.policy)
        step = self.thawed(state.policy, abilities.allowed(state.policy, unflat(parameters, inputs["step"])))
        step = rule.scale_updates(growth, step)
        policy = abilities.limited(eqx.combine(eqx.apply_updates(parameters, step), settings))
        grown, policy_after, _ = rule.advance(growth, policy)
        return where(now.tick > 0, Growing(policy_after, grown), Growing(policy, growth))

    def acting(self, state: PyTree[Array]) -> policies.Masked:
        return state.policy


GrowingGaussians = block_of(_GrowingGaussians, learning.Growth, "growing gaussians")
