"""Policies of the library by their names as blocks, with or without hidden layers."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad import policies
from motorgrad.policies import abilities
from motorgrad.schema import Range, as_hinted, count, fields_of, static
from timlab.blocks._base import as_text, read_table
from timlab.blocks.learning._shared import MAX_UNITS
from timlab.blocks.learning._units import Sizes, Units, key_from
from timlab.diagram import Moment, Port, Ports, Signals

# growing and mirrored ones need more than sizes
POLICY_NAMES = tuple(name for name in policies.INITIAL if name not in ("growing", "mirrored"))

LINEAR = tuple(name for name in POLICY_NAMES if "network" in fields_of(policies.INITIAL[name]))


@dataclasses.dataclass(frozen=True)
class NamedPolicy(Units):
    """Any initial policy of `motorgrad.policies` by its name: tiles of local units, soft boxes, graded units, …

    Policies with hidden units that draw, such as `layered`, output what these drew at this tick as `hidden`, layer by
    layer. Those with a memory, such as `recurrent`, output what they remember for the next decision as `memory`, and
    forget it at a tick with `restart`. A `finite-state-controller` has both outputs: its first hidden draw is the next
    internal state, from 0, and its memory is that state as a one-hot vector. The memory of `recurrent` begins with the
    activations of its units.

    Parameters: in the order of the policy's fields.
    """

    name: ClassVar[str] = "policy"

    policy: Literal[POLICY_NAMES] = static("hyperplanes", help="name of the initial policy")  # type: ignore[valid-type]
    observed: int = count(1, 1, MAX_UNITS, help="number of observed numbers")
    units: int = count(1, 1, MAX_UNITS, help="number of units or alternatives")
    settings: str | Mapping[str, Any] = static("", help="further settings as TOML: `width = 0.2`")

    def validate(self) -> None:
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        _ = self._initial

    @functools.cached_property
    def _initial(self) -> Any:
        return self._bound({})

    def _bound(self, further: Mapping[str, Any]) -> policies.InitialPolicy:
        """The initial policy with the settings of the block and `further` ones, for its sizes."""
        settings = {**read_table("settings", self.settings), **further, "kind": self.policy}
        return as_hinted(policies.InitialPolicy, settings, "policy").bound(Sizes(self.observed, self.units))

    @property
    def init_uniforms(self) -> int:
        return 1

    def start(self, uniforms: Float[Array, " 1"]) -> policies.Policy:
        return jax.tree.map(jnp.asarray, self._initial(key_from(uniforms)))


@dataclasses.dataclass(frozen=True)
class Network(NamedPolicy):
    """Units behind hidden layers that learn with them (Elsayed, Vasan & Mahmood, 2024): a policy of the library that
    is linear in the last layer's output.

    `hidden` are the activations of all hidden units at this tick, layer by layer. Parameters: those of the units, then
    those of the layers, from the inputs on.
    """

    name: ClassVar[str] = "network"

    policy: Literal[LINEAR] = static("hyperplanes", help="name of the initial policy of the units")  # type: ignore[valid-type]
    hidden: tuple[int, ...] = static((32, 32), help="number of units in each hidden layer")
    activation: Literal[tuple(policies.ACTIVATIONS)] = static("leaky-relu", help="nonlinearity of the hidden units")  # type: ignore[valid-type]
    layer_norm: bool = static(True, help="normalise potentials before the nonlinearity")
    sparsity: float = static(
        0.9, allowed=Range(0, 1, open_high=True), help="share of each hidden unit's weights that start at 0"
    )
    standardise: bool = static(False, help="make inputs relative to their running mean and deviation")
    unit_length: bool = static(False, help="scale the output of the last layer to length 1")

    @functools.cached_property
    def _initial(self) -> Any:
        activation: Any = self.activation
        network = policies.MultilayerPerceptron(
            self.hidden, activation, self.layer_norm, self.sparsity, self.standardise, self.unit_length
        )
        return self._bound({"network": network})

    @property
    def outputs(self) -> Ports:
        return {**super().outputs, "hidden": Port((sum(self.hidden),), help="activations of the hidden units")}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        policy, seen, _ = self._acted(state, inputs, now)
        count = len(self.hidden)  # what `unit_length` scales comes after them
        layers = abilities.hidden_activations(policy, seen)[:count]
        return {**super().output(state, inputs, now), "hidden": jnp.concatenate(layers)}
