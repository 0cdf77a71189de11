"""What turns errors into gradient samples, and samples into steps, as blocks."""

import dataclasses
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad import learning
from motorgrad.schema import count, number, static
from timlab.blocks.learning._shared import MAX_PARAMETERS, VALID, is_paid, where
from timlab.diagram import Block, Moment, Port, Ports, Signals


@dataclasses.dataclass(frozen=True)
class GradientSample(Block):
    r"""Credits an error to past actions by their trace, $g = \delta z$.

    With a baseline of the observation it adds what the newest action alone is credited with, $g = \delta z + \nu s$.
    """

    name: ClassVar[str] = "gradient sample"
    category: ClassVar[str] = "learning"

    size: int = count(1, 1, MAX_PARAMETERS, help="number of parameters of the trace")

    @property
    def inputs(self) -> Ports:
        return {
            "error": Port(),
            "trace": Port((self.size,)),
            "newest_error": Port(default=0.0, help=r"$\nu$, `newest` of a baseline of the observation"),
            "newest_score": Port((self.size,), default=0.0, help="$s$, `newest` of the trace"),
        }

    @property
    def outputs(self) -> Ports:
        return {"gradient": Port((self.size,))}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        newest = inputs["newest_error"] * inputs["newest_score"]
        return {"gradient": inputs["error"] * inputs["trace"] + newest}


@dataclasses.dataclass(frozen=True)
class GradientMean(Block):
    """Collects gradient samples, for learners that step once a batch.

    After `samples` of them it outputs their mean or sum, sets `due`, and starts the next batch. Otherwise it outputs 0.
    """

    name: ClassVar[str] = "gradient mean"
    category: ClassVar[str] = "learning"

    size: int = count(1, 1, MAX_PARAMETERS, help="number of parameters of the gradient")
    samples: Any = number(100, 1, 2**31 - 1, kind="int", help="samples in a batch")
    reduction: Literal["mean", "sum"] = static("mean", help="whether a step uses their mean or their sum")

    def validate(self) -> None:
        self.check_broadcasts("samples", ())

    @property
    def inputs(self) -> Ports:
        return {"gradient": Port((self.size,)), "valid": VALID}

    @property
    def outputs(self) -> Ports:
        return {"gradient": Port((self.size,)), "due": Port((), "bool", help="whether a batch is complete")}

    def init(self, uniforms: Float[Array, " 0"]) -> learning.RunningMean:
        return learning.running_mean(jnp.zeros(self.size))

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        running = self._collected(state, inputs, now)
        size = running.count.astype(running.mean.dtype) if self.reduction == "sum" else 1.0
        due = self._is_full(running, inputs, now)
        return {"gradient": jnp.where(due, size * running.mean, 0), "due": due}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        running = self._collected(state, inputs, now)
        return where(self._is_full(running, inputs, now), learning.running_mean(running.mean), running)

    def _collected(self, state: PyTree[Array], inputs: Signals, now: Moment) -> learning.RunningMean:
        return where(is_paid(inputs, now), learning.add_sample(state, inputs["gradient"]), state)

    def _is_full(self, running: learning.RunningMean, inputs: Signals, now: Moment) -> Array:
        return is_paid(inputs, now) & (running.count >= self.samples)
