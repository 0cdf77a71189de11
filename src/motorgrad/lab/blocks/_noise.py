"""Noise: new random numbers at every evaluation."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad._random import normals
from motorgrad.lab._block import Moment, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab.blocks._shaped import Shaped


@dataclasses.dataclass(frozen=True)
class UniformNoise(Shaped):
    """Independent numbers from U[`low`, `high`), new at every evaluation and held in between."""

    name: ClassVar[str] = "uniform noise"
    category: ClassVar[str] = "sources"

    low: Annotated[Any, Parameter("the least number")] = -1.0
    high: Annotated[Any, Parameter("what all numbers are below")] = 1.0

    def validate(self) -> None:
        super().validate()
        check(np.all(np.less(self.low, self.high)), "low", self.low, f"below high = {self.high}")

    @property
    def uniforms(self) -> int:
        return int(np.prod(self.shape))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self.low + (self.high - self.low) * now.uniforms.reshape(self.shape)}


@dataclasses.dataclass(frozen=True)
class NormalNoise(Shaped):
    r"""Independent normal numbers, new at every evaluation and held in between.

    Their standard deviation is `deviation`, or, `per="root second"`, $\sigma/\sqrt h$ for a sample period of $h$
    seconds: then it is white noise whose integral over $T$ seconds has the deviation $\sigma\sqrt T$ at any period.
    """

    name: ClassVar[str] = "normal noise"
    category: ClassVar[str] = "sources"

    mean: Annotated[Any, Parameter("the mean")] = 0.0
    deviation: Annotated[Any, Parameter(r"$\sigma$", low=0.0)] = 1.0
    per: Annotated[str, Setting("of what it is the deviation", choices=("sample", "root second"))] = "sample"

    @property
    def uniforms(self) -> int:
        return 2 * ((int(np.prod(self.shape)) + 1) // 2)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        standard = normals(now.uniforms)[: int(np.prod(self.shape))].reshape(self.shape)
        deviation = self.deviation if self.per == "sample" else self.deviation / jnp.sqrt(now.step)
        return {"y": self.mean + deviation * standard}
