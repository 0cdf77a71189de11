"""Any policy of the library by name, as a block."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import policies
from motorgrad.lab.blocks._base import as_text, read_table
from motorgrad.lab.blocks.learning._counts import check_count
from motorgrad.lab.blocks.learning._settings import agent_of
from motorgrad.lab.blocks.learning._units import Units
from motorgrad.lab.diagram import Setting

NAMES = tuple(name for name in policies.INITIAL if name not in ("growing", "mirrored"))  # these ask for more


@dataclasses.dataclass(frozen=True)
class NamedPolicy(Units):
    """Any initial policy of `motorgrad.policies`, by its name: tiles of local units, soft boxes, graded units, …

    Parameters: in the order of the policy's fields.
    """

    name: ClassVar[str] = "policy"

    policy: Annotated[str, Setting("its name", choices=NAMES)] = "hyperplanes"
    observed: Annotated[int, Setting("how many numbers it sees")] = 1
    units: Annotated[int, Setting("how many units or alternatives it has")] = 1
    settings: Annotated[str | Mapping[str, Any], Setting("its other settings, as TOML: `width = 0.2`")] = ""

    def validate(self) -> None:
        check_count("units", self.units)
        check_count("observed", self.observed)
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        _ = self._made

    @functools.cached_property
    def _made(self) -> policies.Initial:
        given = {"policy": self.policy, "policy_settings": read_table("settings", self.settings)}
        return agent_of(given, self.observed, self.units).policy

    @property
    def init_uniforms(self) -> int:
        return 1

    def start(self, uniforms: Float[Array, " 1"]) -> policies.Policy:
        if isinstance(self._made, policies.Policy):
            return jax.tree.map(jnp.asarray, self._made)
        return self._made(key_from(uniforms))


def key_from(uniforms: Float[Array, " 1"]) -> jax.Array:
    """A key for functions of the library that draw by themselves."""
    return jax.random.key((uniforms[0] * 2**24).astype(jnp.uint32))
