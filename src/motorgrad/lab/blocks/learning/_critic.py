"""A linear critic as a block: what a state is worth, and how much better a reward was than that."""

import dataclasses
import functools
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import learning, policies
from motorgrad._errors import check
from motorgrad.lab.blocks.learning._counts import check_count, check_numbers
from motorgrad.lab.blocks.learning._traced import VALID, paid, where
from motorgrad.lab.diagram import Block, Moment, Port, Ports, Setting, Signals


@dataclasses.dataclass(frozen=True)
class Critic(Block):
    r"""A value function that is linear in the inputs, learnt from rewards; in place of a baseline.

    Its `error` is a temporal difference, $\delta = r - \rho + \gamma\,v(y') - v(y)$
    (`motorgrad.learning.LinearCritic`). Give the trace a decay of $\gamma\lambda$ for generalised advantages.
    `observation` is what the next action is chosen on, `next_observation` what the last one led to, before any reset.
    """

    name: ClassVar[str] = "critic"
    category: ClassVar[str] = "learning"

    observed: Annotated[int, Setting("how many numbers it sees")] = 1
    fit: Annotated[str, Setting("how it learns", choices=("least-squares", "td"))] = "least-squares"
    discount: Annotated[float | None, Setting(r"$\gamma$; none for the average reward, with its mean $\rho$")] = None
    decay: Annotated[float, Setting("of its own trace")] = 0.9
    rate: Annotated[float, Setting("step of td; one over the memory of least squares, in rewards")] = 0.001
    squares: Annotated[bool, Setting("whether it sees the squares of the inputs too")] = False
    bias: Annotated[bool, Setting("whether it has a constant too")] = True

    def validate(self) -> None:
        check_count("observed", self.observed)
        check_numbers(self, "decay", "rate")
        number = isinstance(self.discount, int | float) and not isinstance(self.discount, bool)
        check(self.discount is None or number, "discount", self.discount, "None or a number in [0, 1]")
        for name in ("squares", "bias"):
            check(isinstance(getattr(self, name), bool), name, getattr(self, name), "true or false")
        _ = self._critic

    @functools.cached_property
    def _critic(self) -> learning.LinearCritic:
        kind = learning.LeastSquares if self.fit == "least-squares" else learning.TemporalDifference
        features = learning.Features(self.squares, bias=self.bias)
        return learning.LinearCritic(features, self.discount, self.decay, kind(self.rate))

    @property
    def _seeing(self) -> policies.Policy:
        """What tells the critic the sizes of observations and actions, of which it sees the former only."""
        return policies.hyperplanes(self.observed, 1)

    @property
    def inputs(self) -> Ports:
        seen, flag = (self.observed,), Port((), "bool", default=0.0)
        return {
            "observation": Port(seen, feedthrough=False),
            "next_observation": Port(seen),
            "reward": Port(),
            "terminated": flag,
            "ended": Port((), "bool", feedthrough=False, default=0.0),
            "valid": VALID,
        }

    @property
    def outputs(self) -> Ports:
        return {
            "error": Port(help="the temporal difference"),
            "value": Port(help="of the state before, in which the last action was taken"),
        }

    def init(self, uniforms: Float[Array, " 0"]) -> learning.CriticState:
        return self._critic.init(jnp.result_type(float), self._seeing)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        error = jnp.where(paid(inputs, now), self._followed(state, inputs)[0], 0)
        return {"error": error, "value": jnp.sum(state.weights * state.features)}

    def update(self, state: Any, inputs: Signals, now: Moment) -> learning.CriticState:
        learnt = where(now.tick > 0, self._followed(state, inputs)[1], state)
        began = where(inputs["ended"], self._critic.restart(learnt), learnt)
        return self._critic.see(began, inputs["observation"])

    def _followed(self, state: Any, inputs: Signals) -> tuple[Any, learning.CriticState]:
        told = (inputs["reward"], inputs["next_observation"], inputs["terminated"], ~inputs["valid"])
        return self._critic.follow(state, self._seeing, jnp.zeros(1), *told)
