"""The Hill-type muscle as a block."""

import dataclasses
import math
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad.bodies import CURVES, hill_in_jax
from timlab.diagram import Block, Moment, Parameter, Port, Ports, Setting, Signals

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

    max_isometric_force: Annotated[Any, Parameter("force of the fiber at its optimal length", "N", low=0.0)] = 1000.0
    optimal_fiber_length: Annotated[Any, Parameter("length at which the fiber is strongest", "m", low=1e-6)] = 0.1
    tendon_slack_length: Annotated[Any, Parameter("length beyond which the tendon pulls", "m", low=1e-6)] = 0.2
    pennation_angle: Annotated[Any, Parameter("angle at the optimal length", "rad", low=0.0)] = 0.0
    max_contraction_velocity: Annotated[Any, Parameter("greatest speed, in optimal lengths", "1/s", low=1e-6)] = 10.0
    activation_time_constant: Annotated[Any, Parameter("time constant of a rising activation", "s", low=1e-6)] = 0.015
    deactivation_time_constant: Annotated[Any, Parameter("time constant of a falling activation", "s", low=1e-6)] = 0.06
    fiber_damping: Annotated[Any, Parameter(r"damping of the fibers, $\beta$", low=0.0)] = 0.1
    tendon_strain: Annotated[Any, Parameter("strain of the tendon at the greatest isometric force", low=1e-6)] = 0.049
    tendon: Annotated[str, Setting("whether the tendon stretches", ("compliant", "rigid"))] = "compliant"
    curves: Annotated[str, Setting("whose force–length and force–velocity curves", tuple(CURVES))] = "de-groote"
    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

    def validate(self) -> None:
        times = ("activation_time_constant", "deactivation_time_constant", "tendon_strain")
        for name in (*_NUMBERS, *times):
            self.check_broadcasts(name, self.shape)
        angle = self.pennation_angle
        check(np.all(np.less(np.asarray(angle), math.pi / 2)), "pennation_angle", angle, "less than π/2 (rad)")

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
