"""Dry friction: a mass that sticks and slips."""

import dataclasses
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._errors import check
from motorgrad.schema import number
from timlab.blocks._base import Shaped
from timlab.diagram import Moment, Port, Ports, Signals


@dataclasses.dataclass(frozen=True)
class DryFriction(Shaped):
    r"""Velocity $v$ of a mass under a force $u$ and dry friction.

    While it slips, $m \dot v = u - F_k\,\mathrm{sign}(v) - d\,v$. When its velocity reaches 0 it sticks, unless
    $|u| \ge F_s$, and it begins to slip where $|u|$ reaches $F_s$: Coulomb's model with static friction
    (Armstrong-Hélouvry, Dupont & Canudas de Wit, 1994, section 2). A solver that adapts its steps changes the mode at
    the instant; with RK4 it changes at ticks.
    """

    name: ClassVar[str] = "dry friction"
    category: ClassVar[str] = "dynamics"

    mass: Any = number(1.0, 0, open_low=True, unit="kg", help="mass, $m$")
    static: Any = number(1.0, 0, unit="N", help="$F_s$, the force at which it begins to slip")
    kinetic: Any = number(0.8, 0, unit="N", help="$F_k$, the force while it slips")
    viscous: Any = number(0.0, 0, unit="N s/m", help="viscous friction, $d$")
    initial: Any = number(0.0, unit="m/s", help="initial velocity")

    def validate(self) -> None:
        super().validate()
        check(np.all(np.less_equal(self.kinetic, self.static)), "kinetic", self.kinetic, f"at most {self.static}")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False, help="the force", unit="N")}

    @property
    def outputs(self) -> Ports:
        return {
            "y": Port(self.shape, help="the velocity", unit="m/s"),
            "slips": Port(self.shape, "bool", help="whether it slips"),
        }

    def init(self, uniforms: Array) -> PyTree[Array]:
        """The velocity, and the direction in which it slips, 0 while it sticks."""
        velocity = self.filled(self.initial)
        return velocity, jnp.sign(velocity)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": state[0], "slips": state[1] != 0}

    def derivative(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        velocity, direction = state
        slope = (inputs["u"] - self.kinetic * direction - self.viscous * velocity) / self.mass
        return jnp.where(direction == 0, 0.0, slope), jnp.zeros(self.shape)

    def crossings(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Array:
        """The force beyond what holds it, or the velocity against its direction."""
        velocity, direction = state
        return jnp.where(direction == 0, jnp.abs(inputs["u"]) - self.static, -velocity * direction).ravel()

    def crossed(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        velocity, direction = state
        changes = now.rising.reshape(self.shape)
        slips = jnp.where(jnp.abs(inputs["u"]) >= self.static, jnp.sign(inputs["u"]), 0.0)
        return jnp.where(changes, 0.0, velocity), jnp.where(changes, slips, direction)
