"""Any policy of the library by name, as a block."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import policies
from motorgrad._errors import choice
from motorgrad.lab._parameter import Setting
from motorgrad.lab.blocks._toml import as_text, read_table
from motorgrad.lab.blocks.learning._motoneurons import check_count
from motorgrad.lab.blocks.learning._units import Units


@dataclasses.dataclass(frozen=True)
class NamedPolicy(Units):
    """Any initial policy of `motorgrad.policies`, by its name: tiles of local units, soft boxes, graded units, …

    Parameters: in the order of the policy's fields.
    """

    name: ClassVar[str] = "policy"

    policy: Annotated[str, Setting("its name", choices=tuple(policies.INITIAL))] = "hyperplanes"
    observed: Annotated[int, Setting("how many numbers it sees")] = 1
    units: Annotated[int, Setting("how many units or alternatives it has")] = 1
    settings: Annotated[str | Mapping[str, Any], Setting("its other settings, as TOML: `width = 0.2`")] = ""

    def validate(self) -> None:
        check_count("units", self.units)
        check_count("observed", self.observed)
        choice("policy", self.policy, policies.INITIAL)
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        _ = self._made

    @functools.cached_property
    def _made(self) -> policies.Initial:
        given = read_table("settings", self.settings)
        try:
            return policies.initial(self.policy, self.observed, units=self.units, **given)
        except TypeError as error:
            raise ValueError(
                f"settings = {self.settings!r}: must be settings of policy {self.policy!r}: {error}"
            ) from None

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
