"""Reinforcement baselines as blocks: what a reward is compared with."""

import abc
import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import learning
from motorgrad.lab.blocks.learning._traced import VALID, paid, traced, where
from motorgrad.lab.diagram import Block, Moment, Parameter, Port, Ports, Signals


@dataclasses.dataclass(frozen=True, kw_only=True)
class BaselineBlock(Block, abc.ABC):
    r"""A baseline of `motorgrad.learning`: gives the `error` $\delta = r - b$ of a reward, then takes the reward in.

    A reward that is not `valid` has the error 0 and is not taken in; nor is one at the first tick, before any action.
    """

    category: ClassVar[str] = "learning"

    @property
    @abc.abstractmethod
    def rule(self) -> learning.Baseline:
        """The library's baseline."""

    @property
    def inputs(self) -> Ports:
        return {"reward": Port(), "valid": VALID}

    @property
    def outputs(self) -> Ports:
        return {"error": Port(help="reward above the baseline"), "baseline": Port()}

    def init(self, uniforms: Float[Array, " 0"]) -> Any:
        return self.rule.init(jnp.result_type(float))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        level = self.rule.value(state)
        return {"error": jnp.where(paid(inputs, now), inputs["reward"] - level, 0), "baseline": level}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return where(paid(inputs, now), self.rule.update(state, inputs["reward"]), state)


@dataclasses.dataclass(frozen=True)
class MeanBaseline(BaselineBlock):
    r"""Compares with the mean of all rewards so far, $b \leftarrow b + \delta/n$ for the n-th (Kimura et al., 1995)."""

    name: ClassVar[str] = "mean baseline"

    @property
    def rule(self) -> learning.Baseline:
        return learning.MeanReward()


@dataclasses.dataclass(frozen=True)
class FixedStepBaseline(BaselineBlock):
    r"""Compares with a mean that forgets, $b \leftarrow b + \gamma\delta$ (section 4.4.1 of the thesis)."""

    name: ClassVar[str] = "fixed-step baseline"

    rate: Annotated[Any, Parameter(r"$\gamma$", low=0.0, high=1.0)] = 0.01

    def validate(self) -> None:
        self.check_broadcasts("rate", ())

    @property
    def rule(self) -> learning.Baseline:
        return traced(learning.FixedStep, rate=self.rate)


@dataclasses.dataclass(frozen=True)
class ConstantBaseline(BaselineBlock):
    r"""Compares with a number that stays, $b \equiv c$; with 0 for rewards as they are."""

    name: ClassVar[str] = "constant baseline"

    level: Annotated[Any, Parameter("$c$, in units of reward")] = 0.0

    def validate(self) -> None:
        self.check_broadcasts("level", ())

    @property
    def rule(self) -> learning.Baseline:
        return traced(learning.Constant, level=self.level)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return super().output(self.init(jnp.zeros(0)), inputs, now)  # the level of now, which may have been changed
