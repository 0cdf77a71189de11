"""A memory of where a learner has been: an even sample of the observations of late."""

import dataclasses
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, UInt32

from motorgrad._errors import check


class VisitedState(NamedTuple):
    """`looks`: the observations kept, the oldest overwritten first; `seen`: decisions so far; `kept`: how many of them
    were kept."""

    looks: Float[Array, "slots inputs"]
    seen: UInt32[Array, ""]
    kept: UInt32[Array, ""]


@dataclasses.dataclass(frozen=True)
class Visited:
    """One observation of every `every` decisions, drawn evenly among them; the last `slots` of them are kept.

    Which one it is depends on a seed's `salt` alone, through an integer hash: no random number is drawn.

    **Arguments:** `slots` and `every`, from 1; the memory reaches back `slots` times `every` decisions.
    """

    slots: int = 64
    every: int = 100

    def __post_init__(self) -> None:
        check(1 <= self.slots <= 100_000, "slots", self.slots, "from 1 to 100,000 observations")
        check(1 <= self.every < 2**31, "every", self.every, "at least 1 decision")

    def init(self, inputs: int, dtype: Any) -> VisitedState:
        """Nothing seen yet."""
        none = jnp.zeros((), jnp.uint32)
        return VisitedState(jnp.zeros((self.slots, inputs), dtype), none, none)

    def see(self, state: VisitedState, observation: Float[Array, " inputs"], salt: UInt32[Array, ""]) -> VisitedState:
        """Take in an observation; one that is not finite is never kept."""
        block, place = state.seen // self.every, state.seen % self.every
        chosen = (mixed(block ^ salt) % self.every == place) & jnp.all(jnp.isfinite(observation))
        here = jnp.arange(self.slots, dtype=jnp.uint32) == state.kept % self.slots
        looks = jnp.where((here & chosen)[:, None], observation.astype(state.looks.dtype), state.looks)
        return VisitedState(looks, state.seen + 1, state.kept + chosen)

    def draw(self, state: VisitedState, salt: UInt32[Array, ""], otherwise: Float[Array, " inputs"]) -> Array:
        """One of the observations kept, each as likely; `otherwise` where there is none."""
        count = jnp.minimum(state.kept, self.slots)
        slot = mixed(salt + state.seen * jnp.uint32(0x9E3779B9)) % jnp.maximum(count, 1)
        look = jnp.sum(jnp.where((jnp.arange(self.slots) == slot)[:, None], state.looks, 0), axis=0)
        return jnp.where(count > 0, look, otherwise)


def mixed(bits: UInt32[Array, ""]) -> UInt32[Array, ""]:
    """A bijection of 32-bit numbers in which every bit depends on all (the finaliser of MurmurHash3)."""
    bits = (bits ^ (bits >> 16)) * jnp.uint32(0x85EBCA6B)
    bits = (bits ^ (bits >> 13)) * jnp.uint32(0xC2B2AE35)
    return bits ^ (bits >> 16)
