"""Between the error of a reward and a step: the gradient sample, its scale, and means of many."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import learning
from motorgrad.lab.blocks.learning._counts import check_size
from motorgrad.lab.blocks.learning._traced import VALID, paid, traced, where
from motorgrad.lab.diagram import Block, Moment, Parameter, Port, Ports, Setting, Signals


@dataclasses.dataclass(frozen=True)
class GradientSample(Block):
    r"""Credits an error to past actions by their trace, $g = \delta z$."""

    name: ClassVar[str] = "gradient sample"
    category: ClassVar[str] = "learning"

    size: Annotated[int, Setting("how many parameters the trace has")] = 1

    def validate(self) -> None:
        check_size(self.size)

    @property
    def inputs(self) -> Ports:
        return {"error": Port(), "trace": Port((self.size,))}

    @property
    def outputs(self) -> Ports:
        return {"gradient": Port((self.size,))}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"gradient": inputs["error"] * inputs["trace"]}


@dataclasses.dataclass(frozen=True)
class AdvantageScale(Block):
    r"""Divides errors by their running root mean square, the newest included, so that steps keep one size whatever
    rewards are counted in (`motorgrad.learning.RootMeanSquare`)."""

    name: ClassVar[str] = "advantage scale"
    category: ClassVar[str] = "learning"

    rate: Annotated[Any, Parameter("of the running mean, per tick", low=0.0, high=1.0, open=True)] = 1e-3

    def validate(self) -> None:
        self.check_broadcasts("rate", ())

    @property
    def rule(self) -> learning.RootMeanSquare:
        """The library's scale."""
        return traced(learning.RootMeanSquare, rate=self.rate)

    @property
    def inputs(self) -> Ports:
        return {"error": Port(), "valid": VALID}

    @property
    def outputs(self) -> Ports:
        return {"error": Port()}

    def init(self, uniforms: Float[Array, " 0"]) -> Any:
        return self.rule.init(jnp.result_type(float))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"error": self.rule.factor(self.update(state, inputs, now)) * inputs["error"]}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return where(paid(inputs, now), self.rule.update(state, inputs["error"]), state)


@dataclasses.dataclass(frozen=True)
class GradientMean(Block):
    """Gathers gradient samples, for learners that step once a batch. Once there are `samples` of them it gives their
    mean or sum, and is `due`; then they are gathered anew. Meanwhile it gives 0."""

    name: ClassVar[str] = "gradient mean"
    category: ClassVar[str] = "learning"

    size: Annotated[int, Setting("how many parameters the gradient has")] = 1
    samples: Annotated[Any, Parameter("how many make up a batch", low=1, high=2**31 - 1, kind="int")] = 100
    gives: Annotated[str, Setting("what of them", choices=("mean", "sum"))] = "mean"

    def validate(self) -> None:
        check_size(self.size)
        self.check_broadcasts("samples", ())

    @property
    def inputs(self) -> Ports:
        return {"gradient": Port((self.size,)), "valid": VALID}

    @property
    def outputs(self) -> Ports:
        return {"gradient": Port((self.size,)), "due": Port((), "bool")}

    def init(self, uniforms: Float[Array, " 0"]) -> learning.RunningMean:
        return learning.running_mean(jnp.zeros(self.size))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        running = self._gathered(state, inputs, now)
        size = running.count.astype(running.mean.dtype) if self.gives == "sum" else 1.0
        due = self._full(running, inputs, now)
        return {"gradient": jnp.where(due, size * running.mean, 0), "due": due}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        running = self._gathered(state, inputs, now)
        return where(self._full(running, inputs, now), learning.running_mean(running.mean), running)

    def _gathered(self, state: Any, inputs: Signals, now: Moment) -> learning.RunningMean:
        return where(paid(inputs, now), learning.add_sample(state, inputs["gradient"]), state)

    def _full(self, running: learning.RunningMean, inputs: Signals, now: Moment) -> Any:
        return paid(inputs, now) & (running.count >= self.samples)
