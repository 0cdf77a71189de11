"""A whole learner of the library as one block."""

import copy
import dataclasses
import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad import learning
from motorgrad._errors import check
from motorgrad.policies import abilities, trainable
from motorgrad.schema import (
    PART_CLASSES,
    Declared,
    Numbers,
    check_rounded,
    count,
    declared_at,
    expanded,
    number,
    numbers_of,
    path_of,
    static,
    table,
    with_number,
)
from timlab.blocks._base import as_text, read_table
from timlab.blocks.learning._shared import MAX_UNITS, VALID, where
from timlab.blocks.learning._units import Sizes, flat, key_from, kind_of, size_of
from timlab.diagram import Block, Moment, Port, Ports, Signals, nested

if TYPE_CHECKING:
    from motorgrad.learning import Agent


@dataclasses.dataclass(frozen=True)
class Learner(Block):
    """Policy, trace, baseline or critic, metric and optimizer in one: a `motorgrad.learning.Agent`.

    `settings` are those of an agent in a configuration file, by path or short name, as `motorgrad.agent_for` takes
    them. The agent's numbers are parameters of the block by their paths, such as `estimator.trace.decay`. To change one
    while the diagram runs compiles nothing; the new value enters `settings`.
    """

    name: ClassVar[str] = "learner"
    category: ClassVar[str] = "learning"

    observed: int = count(1, 1, MAX_UNITS, help="number of observed numbers")
    actions: int = count(1, 1, MAX_UNITS, help="number of units or alternatives")
    settings: str | Mapping[str, Any] = static("", help="the agent as TOML: `policy = 'softmax'`")
    frozen: Any = number(False, kind="bool", help="what was learned stays as it is")

    def validate(self) -> None:
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        self.check_broadcasts("frozen", ())
        kind = read_table("settings", self.settings).get("kind", "dense")
        check(
            PART_CLASSES[learning.Agent].get(kind) in (None, learning.Agent),
            "settings.kind",
            kind,
            "'dense' in a diagram",
        )
        self.__dict__.update(_numbers_of(self._agent))

    @functools.cached_property
    def _agent(self) -> "Agent":
        from motorgrad.training import agent_for  # which takes a while to load

        return agent_for(Sizes(self.observed, self.actions), read_table("settings", self.settings))

    @functools.cached_property
    def _state(self) -> Any:
        return jax.eval_shape(self._agent.init, jax.random.key(0))

    @functools.cached_property
    def parameters(self) -> Mapping[str, Declared]:  # type: ignore[override]
        tree = self._agent.hyperparameters
        return {**super().parameters, **{path: declared_at(tree, path) for path in numbers_of(tree)}}

    @property
    def structure(self) -> Any:
        policy = repr(table(self._agent.policy))
        return self.observed, self.actions, policy, Numbers(self._agent.hyperparameters).key

    def retuned(self, values: Mapping[str, Any]) -> Self:
        fields = {field.name for field in dataclasses.fields(self)}
        own = {name: value for name, value in values.items() if name in fields}
        numbers = {path: value for path, value in values.items() if path not in fields}
        block = dataclasses.replace(self, **own) if own else self
        return block._with_numbers(numbers) if numbers else block

    def _with_numbers(self, numbers: Mapping[str, Any]) -> Self:
        """The block with other numbers of its agent. Its structure stays, and with it what is known of the shapes."""
        agent = self._agent
        for path, value in numbers.items():
            agent = with_number(agent, path, value)
        check_rounded(agent, self._agent.precision)
        block = copy.copy(self)
        table = _with_numbers(read_table("settings", self.settings), numbers)
        block.__dict__.update(settings=as_text("settings", table), _agent=agent, **_numbers_of(agent))
        return block

    @property
    def inputs(self) -> Ports:
        flag = Port((), "bool", default=0.0)
        return {
            "observation": Port((self.observed,)),
            "reward": Port(),
            "next_observation": Port((self.observed,), default=0.0, help="before any reset; for critics"),
            "terminated": flag,
            "truncated": flag,
            "valid": VALID,
        }

    @property
    def outputs(self) -> Ports:
        policy = self._state.policy
        seen = jax.ShapeDtypeStruct((policy.inputs,), jnp.result_type(float))
        action = jax.eval_shape(lambda p, y: abilities.task_action(p, p.mode(y)), policy, seen)
        return {"action": Port(action.shape, kind_of(action.dtype)), "parameters": Port((size_of(policy),))}

    @property
    def uniforms(self) -> int:
        return self._state.policy.uniforms

    @property
    def init_uniforms(self) -> int:
        return 1

    @property
    def _bound_agent(self) -> "Agent":
        """The agent with this block's arrays as its numbers."""
        bound = jax.tree_util.tree_map_with_path(
            lambda place, _: self.__dict__[path_of(place)], self._agent.hyperparameters
        )
        return bound.with_policy(self._agent.policy)

    def init(self, uniforms: Float[Array, " 1"]) -> PyTree[Array]:
        return self._bound_agent.init(key_from(uniforms))

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        after, action = self._acted(state, inputs, now)
        return {"action": action, "parameters": flat(trainable(after.policy))}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return self._acted(state, inputs, now)[0]

    def _acted(self, state: PyTree[Array], inputs: Signals, now: Moment) -> tuple[Any, Array]:
        """Learn from the reward of the last action, then choose the next."""
        agent = self._bound_agent
        terminated = inputs["terminated"]
        truncated = inputs["truncated"]
        diverged = ~inputs["valid"]
        ended = terminated | truncated | diverged
        learned = agent.reinforce(state, inputs["reward"], inputs["next_observation"], terminated, truncated, diverged)
        learned = agent.improve(learned, ended, diverged)
        after = where(now.tick > 0, where(self.frozen, agent.restart(state, ended), learned), state)
        return agent.act(after, inputs["observation"], now.uniforms)


def _numbers_of(agent: "Agent") -> dict[str, Any]:
    """An agent's numbers by path, as plain numbers or nested tuples of them."""
    return {path: nested(np.asarray(number).tolist()) for path, number in numbers_of(agent.hyperparameters).items()}


def _with_numbers(settings: Mapping[str, Any], numbers: Mapping[str, Any]) -> dict[str, Any]:
    """An agent's settings with other numbers by path. A part given by its name alone becomes a table with its kind."""
    table = expanded(learning.Agent, settings)
    for path, value in numbers.items():
        *outer, last = path.split(".")
        node = table
        for name in outer:
            inner = node.get(name, {})
            inner = dict(inner) if isinstance(inner, Mapping) else {"kind": inner}
            node[name] = inner
            node = inner
        node[last] = value
    return table
