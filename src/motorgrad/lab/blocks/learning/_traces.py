"""Eligibility traces as blocks: how much of a reward each past action may claim."""

import abc
import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import learning
from motorgrad.lab.blocks.learning._counts import check_numbers, check_size
from motorgrad.lab.blocks.learning._traced import traced, where
from motorgrad.lab.diagram import Block, Moment, Parameter, Port, Ports, Setting, Signals


@dataclasses.dataclass(frozen=True, kw_only=True)
class TraceBlock(Block, abc.ABC):
    """A filter of `motorgrad.learning` on scores. It gives the trace of the actions *before* this tick, as what is paid
    at a tick is paid for them; so it cuts the loop of learning. Where an episode has `ended` it begins anew."""

    category: ClassVar[str] = "learning"

    size: Annotated[int, Setting("how many parameters the score has")] = 1

    def validate(self) -> None:
        check_size(self.size)

    @property
    @abc.abstractmethod
    def filter(self) -> learning.Trace:
        """The library's filter."""

    @property
    def inputs(self) -> Ports:
        return {
            "score": Port((self.size,), feedthrough=False),
            "ended": Port((), "bool", feedthrough=False, default=0.0, help="whether an episode ended at this tick"),
        }

    @property
    def outputs(self) -> Ports:
        return {"trace": Port((self.size,))}

    def init(self, uniforms: Float[Array, " 0"]) -> Any:
        return self.filter.init(jnp.zeros(self.size))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"trace": self.filter.value(state)}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        fresh = self.filter.init(jnp.zeros(self.size))
        return self.filter.update(where(inputs["ended"], fresh, state), inputs["score"])


@dataclasses.dataclass(frozen=True)
class EligibilityTrace(TraceBlock):
    r"""Forgets scores exponentially, $z \leftarrow \beta z + s$ (Baxter & Bartlett, 2001).

    Choose $1/(1 - \beta)$ above the number of ticks over which actions still matter.
    """

    name: ClassVar[str] = "eligibility trace"

    decay: Annotated[Any, Parameter(r"$\beta$, what is kept at every tick", low=0.0, high=1.0)] = 0.9

    def validate(self) -> None:
        super().validate()
        self.check_broadcasts("decay", (self.size,))

    @property
    def filter(self) -> learning.Trace:
        return traced(learning.Exponential, decay=self.decay)


@dataclasses.dataclass(frozen=True)
class EpisodicTrace(TraceBlock):
    r"""Adds scores up from the start of the episode, $z \leftarrow z + s$ (Williams, 1992). It needs episodes."""

    name: ClassVar[str] = "episodic trace"

    @property
    def filter(self) -> learning.Trace:
        return learning.Episodic()


@dataclasses.dataclass(frozen=True)
class WindowTrace(TraceBlock):
    r"""Adds the last `length` scores up, the newest included (section 3.2.1 of the thesis)."""

    name: ClassVar[str] = "window trace"

    length: Annotated[int, Setting("how many scores, in ticks")] = 10

    def validate(self) -> None:
        super().validate()
        check_numbers(self, "length", whole=True)
        _ = self.filter  # which refuses what is out of its range

    @property
    def filter(self) -> learning.Trace:
        return learning.Window(self.length)


@dataclasses.dataclass(frozen=True)
class LaggedTrace(TraceBlock):
    r"""Weighs the score of $k$ ticks ago by $\exp(-\frac12((k - \text{lag})/\text{width})^2)$: for actions that tell
    after a known delay (section 3.2.1 of the thesis)."""

    name: ClassVar[str] = "lagged trace"

    lag: Annotated[float, Setting("the delay, in ticks")] = 5.0
    width: Annotated[float, Setting("how sure the delay is, in ticks")] = 2.0

    def validate(self) -> None:
        super().validate()
        check_numbers(self, "lag", "width")
        _ = self.filter

    @property
    def filter(self) -> learning.Trace:
        return learning.LaggedGaussian(self.lag, self.width)
