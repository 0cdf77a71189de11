"""The Hill-type muscle as a block."""

import dataclasses
import math
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad.bodies import CURVES, hill_in_jax
from motorgrad.schema import number, static
from timlab.diagram import Block, Moment, Port, Ports, Signals

_NUMBERS = (
    *("max_isometric_force", "optimal_fiber_length", "tendon_slack_length", "pennation_angle"),
    *("max_contraction_velocity", "fiber_damping"),
)


@dataclasses.dataclass(frozen=True)
class HillMuscle(Block):
    r"""Hill-type muscle with a tendon in series (`motorgrad.bodies.Hill`),
    $(a f_L f_V + f_P + \beta \tilde v) \cos\alpha = f_T$. Its activation follows the excitation. It starts at rest, in
    balance with its tendon.
    """

    name: ClassVar[str] = "hill muscle"
    category: ClassVar[str] = "bodies and worlds"

    max_isometric_force: Any = number(1000.0, 0, unit="N", help="force of the fiber at its optimal length")
    optimal_fiber_length: Any = number(0.1, 1e-6, unit="m", help="length at which the fiber is strongest")
    tendon_slack_length: Any = number(0.2, 1e-6, unit="m", help="length beyond which the tendon pulls")
    pennation_angle: Any = number(0.0, 0, math.pi / 2, open_high=True, unit="rad", help="angle at the optimal length")
    max_contraction_velocity: Any = number(10.0, 1e-6, unit="1/s", help="greatest speed, in optimal lengths")
    activation_time_constant: Any = number(0.015, 1e-6, unit="s", help="time constant of a rising activation")
    deactivation_time_constant: Any = number(0.06, 1e-6, unit="s", help="time constant of a falling activation")
    fiber_damping: Any = number(0.1, 0, help=r"damping of the fibers, $\beta$")
    tendon_strain: Any = number(0.049, 1e-6, help="strain of the tendon at the greatest isometric force")
    tendon: Literal["compliant", "rigid"] = static("compliant", help="whether the tendon stretches")
    curves: Literal[tuple(CURVES)] = static("de-groote", help="whose force–length and force–velocity curves")  # type: ignore[valid-type]
    shape: tuple[int, ...] = static((), help="shape of the signals")

    def validate(self) -> None:
        times = ("activation_time_constant", "deactivation_time_constant", "tendon_strain")
        for name in (*_NUMBERS, *times):
            self.check_broadcasts(name, self.shape)

    @property
    def inputs(self) -> Ports:
        return {
            "excitation": Port(self.shape, feedthrough=False, help="from 0 to 1"),
            "length": Port(self.shape, unit="m", help="of the path"),
            "velocity": Port(self.shape, default=0.0, unit="m/s", help="positive while the path lengthens"),
        }

    @property
    def outputs(self) -> Ports:
        return {
            "tension": Port(self.shape, unit="N", help="positive for a pull"),
            "activation": Port(self.shape),
            "fiber": Port(self.shape, help="its length as a multiple of the optimal length"),
        }

    def init(self, uniforms: Float[Array, " 0"]) -> PyTree[Array]:
        return jnp.zeros(self.shape), jnp.zeros(self.shape)  # of the fiber, which then is at rest, and the activation

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        hill = hill_in_jax(self.curves)
        activation = state[1]
        length = inputs["length"]
        force, optimal, slack, pennation, *others = (getattr(self, name) for name in _NUMBERS)
        if self.tendon == "rigid":
            numbers = (force, optimal, slack, pennation, *others)
            tension = hill.rigid_tension(activation, length, inputs["velocity"], *numbers)
            along = jnp.maximum((length - slack) / optimal, 0.0)
            fiber = jnp.sqrt(along * along + jnp.sin(pennation) ** 2)
        else:
            fiber = self._fiber(state, length)
            tension = hill.compliant_tension(fiber, length, force, optimal, slack, pennation, self._stiffness)
        shaped = {"tension": tension, "activation": activation, "fiber": fiber}
        return {name: jnp.broadcast_to(value, self.shape) for name, value in shaped.items()}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        hill = hill_in_jax(self.curves)
        activation = state[1]
        rise, fall = self.activation_time_constant, self.deactivation_time_constant
        later = hill.next_activation(activation, inputs["excitation"], now.step, rise, fall)
        if self.tendon == "rigid":
            return state[0], jnp.broadcast_to(later, self.shape)
        fiber = self._fiber(state, inputs["length"])
        numbers = (getattr(self, name) for name in _NUMBERS[1:])
        moved = (inputs["length"], inputs["velocity"], now.step)
        fiber = hill.next_fiber(fiber, activation, later, *moved, *numbers, self._stiffness)
        return jnp.broadcast_to(fiber, self.shape), jnp.broadcast_to(later, self.shape)

    @property
    def _stiffness(self) -> Any:
        return hill_in_jax(self.curves).tendon_stiffness(self.tendon_strain)

    def _fiber(self, state: PyTree[Array], length: Array) -> Array:
        """The fiber's length; where none is set, that of one at rest."""
        numbers = (getattr(self, name) for name in _NUMBERS[1:])
        rest = hill_in_jax(self.curves).steady_fiber(state[1], length, 0.0, *numbers, self._stiffness)
        return jnp.where(state[0] > 0.0, state[0], rest)
