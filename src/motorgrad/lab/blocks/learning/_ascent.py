"""Ascent rules as blocks: how a gradient becomes a step of the parameters."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import optax
from jaxtyping import Array, Float

from motorgrad import learning
from motorgrad._errors import check
from motorgrad.lab.blocks.learning._counts import check_size
from motorgrad.lab.blocks.learning._traced import paid, traced, where
from motorgrad.lab.diagram import Block, Moment, Parameter, Port, Ports, Setting, Signals

DUE = Port((), "bool", default=1.0, help="whether to step at this tick")
Groups = Annotated[tuple[int, ...], Setting("how many parameters each `rate` is of, one after the other; none for all")]
Rate = Annotated[Any, Parameter("step size, of all parameters or of each group", low=0.0)]
Frozen = Annotated[Any, Parameter("no steps: what was learnt stays as it is", kind="bool")]


@dataclasses.dataclass(frozen=True, kw_only=True)
class AscentBlock(Block):
    """What all rules have in common."""

    category: ClassVar[str] = "learning"

    size: Annotated[int, Setting("how many parameters the gradient has")] = 1
    rate: Rate = 1e-3
    groups: Groups = ()
    frozen: Frozen = False

    def validate(self) -> None:
        check_size(self.size)
        whole = isinstance(self.groups, tuple) and all(isinstance(n, int) and n >= 1 for n in self.groups)
        fits = whole and (not self.groups or sum(self.groups) == self.size)
        check(fits, "groups", self.groups, f"none, or whole numbers from 1 that add up to size = {self.size}")
        self.check_broadcasts("rate", (len(self.groups) or self.size,))
        self.check_broadcasts("frozen", ())

    @property
    def inputs(self) -> Ports:
        return {"gradient": Port((self.size,)), "due": DUE}

    @property
    def outputs(self) -> Ports:
        return {"step": Port((self.size,))}

    def rates(self) -> learning.SgdState:
        """The step size of every parameter, as the library's rule keeps them."""
        if not self.groups:
            return learning.SgdState(jnp.broadcast_to(self.rate, (self.size,)))
        each = jnp.broadcast_to(self.rate, (len(self.groups),))
        return learning.SgdState(jnp.repeat(each, jnp.array(self.groups), total_repeat_length=self.size))

    def scaled(self, descent: Any) -> Float[Array, " size"]:
        """Minus a gradient as a step, by the step sizes."""
        return learning.sgd(1.0).update(descent, self.rates())[0]

    def steps(self, inputs: Signals, now: Moment) -> Any:
        """Whether to step at this tick."""
        return paid(inputs, now, "due") & ~self.frozen


@dataclasses.dataclass(frozen=True)
class Ascent(AscentBlock):
    r"""Steepest ascent, $\Delta\theta = \alpha g$ (`motorgrad.learning.sgd`)."""

    name: ClassVar[str] = "ascent"

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"step": jnp.where(self.steps(inputs, now), self.scaled(-inputs["gradient"]), 0)}


@dataclasses.dataclass(frozen=True)
class Adam(AscentBlock):
    r"""Adam: steps of nearly one size, whatever the gradient's (Kingma & Ba, 2015)."""

    name: ClassVar[str] = "adam"

    b1: Annotated[Any, Parameter("what is kept of the gradient's mean", low=0.0, high=0.999999)] = 0.9
    b2: Annotated[Any, Parameter("what is kept of the mean of its square", low=0.0, high=0.999999)] = 0.999

    def validate(self) -> None:
        super().validate()
        self.check_broadcasts("b1", ())
        self.check_broadcasts("b2", ())

    @property
    def rule(self) -> optax.GradientTransformation:
        """What becomes of a gradient before it is scaled by the step sizes."""
        return optax.scale_by_adam(b1=self.b1, b2=self.b2)

    def init(self, uniforms: Float[Array, " 0"]) -> Any:
        return self.rule.init(jnp.zeros(self.size))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        descent = self.rule.update(-inputs["gradient"], state)[0]
        return {"step": jnp.where(self.steps(inputs, now), self.scaled(descent), 0)}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return where(self.steps(inputs, now), self.rule.update(-inputs["gradient"], state)[1], state)


@dataclasses.dataclass(frozen=True)
class WeightDecay(Block):
    r"""Adds to a step what the parameters lose at every tick, $-\lambda\theta$ (`motorgrad.learning.decayed`).

    Lead to it the units' own `parameters`: it uses those before the step.
    """

    name: ClassVar[str] = "weight decay"
    category: ClassVar[str] = "learning"

    size: Annotated[int, Setting("how many parameters there are")] = 1
    decay: Annotated[Any, Parameter(r"$\lambda$, for all or for each", low=0.0, high=1.0)] = 1e-4

    def validate(self) -> None:
        check_size(self.size)
        self.check_broadcasts("decay", (self.size,))

    @property
    def inputs(self) -> Ports:
        return {"step": Port((self.size,)), "parameters": Port((self.size,), feedthrough=False)}

    @property
    def outputs(self) -> Ports:
        return {"step": Port((self.size,))}

    def init(self, uniforms: Float[Array, " 0"]) -> Any:
        return jnp.zeros(self.size)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        rule = traced(learning.decayed, rule=optax.identity(), decay=0.0)
        decays = learning.DecayState(optax.EmptyState(), jnp.broadcast_to(self.decay, (self.size,)))
        return {"step": rule.update(inputs["step"], decays, state)[0]}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return inputs["parameters"]
