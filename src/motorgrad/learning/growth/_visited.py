"""A sample of the recent observations of a learner, at which new units may be placed."""

from typing import NamedTuple

import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float, UInt32

from motorgrad._running import counted_round
from motorgrad.schema import Part, count


class VisitedState(NamedTuple):
    """`looks`: the observations kept, in a ring buffer; `seen`: how many decisions there were; `kept`: how many of them
    were kept.

    `seen` begins again from 0 after 2³² decisions: it only chooses, by a hash. `kept` omits rounds of the ring."""

    looks: Float[Array, "slots inputs"]
    seen: UInt32[Array, ""]
    kept: UInt32[Array, ""]


class Visited(Part):
    """A uniform sample of recent observations: one of every `every` decisions; the last `slots` of them are kept.

    An integer hash of the seed's `salt` chooses the decision, so no random number is drawn, and growth changes no other
    random number.
    """

    slots: int = count(64, 1, 100_000, help="number of observations that are kept")
    every: int = count(
        100, 1, unit="decisions", help="distance between two kept observations; the memory is `slots` times as long"
    )

    def init(self, inputs: int, dtype: DTypeLike) -> VisitedState:
        """The empty memory."""
        none = jnp.zeros((), jnp.uint32)
        return VisitedState(jnp.zeros((self.slots, inputs), dtype), none, none)

    def observe(
        self, state: VisitedState, observation: Float[Array, " inputs"], salt: UInt32[Array, ""]
    ) -> VisitedState:
        """The memory after an observation; one that is not finite is never kept."""
        block = state.seen // self.every
        place = state.seen % self.every
        chosen = (hash_bits(block ^ salt) % self.every == place) & jnp.all(jnp.isfinite(observation))
        here = jnp.arange(self.slots, dtype=jnp.uint32) == state.kept % self.slots
        observations = jnp.where((here & chosen)[:, None], observation.astype(state.looks.dtype), state.looks)
        return VisitedState(observations, state.seen + 1, counted_round(state.kept + chosen, self.slots))

    def draw(self, state: VisitedState, salt: UInt32[Array, ""], otherwise: Float[Array, " inputs"]) -> Array:
        """A kept observation, each with the same probability; `otherwise` where there is none."""
        count = jnp.minimum(state.kept, self.slots)
        slot = hash_bits(salt + state.seen * jnp.uint32(0x9E3779B9)) % jnp.maximum(count, 1)
        observation = jnp.sum(jnp.where((jnp.arange(self.slots) == slot)[:, None], state.looks, 0), axis=0)
        return jnp.where(count > 0, observation, otherwise)


def hash_bits(bits: UInt32[Array, ""]) -> UInt32[Array, ""]:
    """A bijection of 32-bit numbers in which every bit depends on all (the finaliser of MurmurHash3)."""
    bits = (bits ^ (bits >> 16)) * jnp.uint32(0x85EBCA6B)
    bits = (bits ^ (bits >> 13)) * jnp.uint32(0xC2B2AE35)
    return bits ^ (bits >> 16)
