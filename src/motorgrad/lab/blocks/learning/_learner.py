"""A whole learner of the library as one block."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.lab.blocks._base import as_text, read_table
from motorgrad.lab.blocks.learning._counts import check_count
from motorgrad.lab.blocks.learning._policy import key_from
from motorgrad.lab.blocks.learning._settings import agent_of
from motorgrad.lab.blocks.learning._traced import VALID, where
from motorgrad.lab.blocks.learning._units import flat, kind_of, size_of
from motorgrad.lab.diagram import Block, Moment, Parameter, Port, Ports, Setting, Signals
from motorgrad.policies import trainable

if TYPE_CHECKING:
    from motorgrad.learning import Agent


@dataclasses.dataclass(frozen=True)
class Learner(Block):
    """Policy, trace, baseline or critic, metric and ascent in one: `motorgrad.learning.Agent`, as its settings in a
    configuration file have it (`motorgrad.training.AgentSettings`)."""

    name: ClassVar[str] = "learner"
    category: ClassVar[str] = "learning"

    observed: Annotated[int, Setting("how many numbers it sees")] = 1
    actions: Annotated[int, Setting("how many units or alternatives it has")] = 1
    settings: Annotated[str | Mapping[str, Any], Setting("its settings, as TOML: `policy = 'softmax'`")] = ""
    frozen: Annotated[Any, Parameter("what was learnt stays as it is", kind="bool")] = False

    def validate(self) -> None:
        check_count("observed", self.observed)
        check_count("actions", self.actions)
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        self.check_broadcasts("frozen", ())
        _ = self._agent

    @functools.cached_property
    def _agent(self) -> "Agent":
        given = read_table("settings", self.settings)
        check(not given.get("index"), "settings.index", given.get("index"), "false in a diagram")
        return agent_of(given, self.observed, self.actions)

    @functools.cached_property
    def _state(self) -> Any:
        return jax.eval_shape(self._agent.init, jax.random.key(0))

    @property
    def inputs(self) -> Ports:
        flag = Port((), "bool", default=0.0)
        return {
            "observation": Port((self.observed,)),
            "reward": Port(),
            "next_observation": Port((self.observed,), default=0.0, help="before any reset; critics look at it"),
            "terminated": flag,
            "truncated": flag,
            "valid": VALID,
        }

    @property
    def outputs(self) -> Ports:
        policy = self._state.policy
        seen = jax.ShapeDtypeStruct((self.observed,), jnp.result_type(float))
        action = jax.eval_shape(lambda p, y: p.mode(y), policy, seen)
        return {"action": Port(action.shape, kind_of(action.dtype)), "parameters": Port((size_of(policy),))}

    @property
    def uniforms(self) -> int:
        return self._state.policy.uniforms

    @property
    def init_uniforms(self) -> int:
        return 1

    def init(self, uniforms: Float[Array, " 1"]) -> Any:
        return self._agent.init(key_from(uniforms))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        after, action = self._acted(state, inputs, now)
        return {"action": action, "parameters": flat(trainable(after.policy))}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self._acted(state, inputs, now)[0]

    def _acted(self, state: Any, inputs: Signals, now: Moment) -> tuple[Any, Array]:
        """Learn from what was paid for the last action, then choose the next."""
        terminated, truncated = inputs["terminated"], inputs["truncated"]
        broken = ~inputs["valid"]
        told = (inputs["reward"], inputs["next_observation"], terminated, truncated, broken)
        learnt = self._agent.improve(self._agent.reinforce(state, *told), terminated | truncated | broken, broken)
        kept = self._agent.restart(state, terminated | truncated | broken)
        after = where(now.tick > 0, where(self.frozen, kept, learnt), state)
        return self._agent.act(after, inputs["observation"], now.uniforms)
