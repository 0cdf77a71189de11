"""A whole learner of the library as one block."""

import copy
import dataclasses
import functools
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Self

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
from timlab.blocks.learning._shared import MAX_UNITS, VALID, reads, where
from timlab.blocks.learning._units import Sizes, flat, key_from, kind_of, size_of
from timlab.diagram import Block, Moment, Port, Ports, Signals, nested


class Decided(NamedTuple):
    """The state of the learner, and the decision whose reward comes next."""

    learner: Any
    observation: Float[Array, " observed"]
    action: Array


@dataclasses.dataclass(frozen=True)
class Learner(Block):
    """A whole `motorgrad.learning.Learner` of any registered kind, by default the policy gradient: what acts, and how
    it learns.

    `settings` are those of an agent in a configuration file, by path or short name, as `motorgrad.agent_for` takes
    them. The learner's numbers are parameters of the block by their paths, such as `estimator.trace.decay`. To change
    one while the diagram runs compiles nothing; the new value enters `settings`.

    Replay in hindsight needs the goal of a task, which a diagram does not say, and tables of sparse units are made
    outside compiled code: both are refused. While it is `frozen`, the learner sees the ends of episodes alone.
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
        kind = read_table("settings", self.settings).get("kind", "policy-gradient")
        sparse = issubclass(PART_CLASSES[learning.Learner].get(kind, learning.Learner), learning.SparseLearner)
        check(not sparse, "settings.kind", kind, "another in a diagram, such as 'policy-gradient'")
        goal = self._agent.needs.goal
        check(goal is None, f"settings.{goal}", "given", "left out in a diagram, which has no goal")
        self.__dict__.update(_numbers_of(self._agent))

    @functools.cached_property
    def _agent(self) -> learning.Learner:
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
        table = _with_numbers(type(agent), read_table("settings", self.settings), numbers)
        block.__dict__.update(settings=as_text("settings", table), _agent=agent, **_numbers_of(agent))
        return block

    @property
    def inputs(self) -> Ports:
        flag = Port((), "bool", default=0.0)
        unwired = None if self._reads_next_observation else 0.0
        following = Port((self.observed,), default=unwired, help="before any reset; for learners of values")
        return {
            "observation": Port((self.observed,)),
            "reward": Port(),
            "next_observation": following,
            "terminated": flag,
            "truncated": flag,
            "valid": VALID,
        }

    @functools.cached_property
    def _reads_next_observation(self) -> bool:
        """Whether it learns from what an action led to, as critics and action values do. It must be wired then."""
        seen = jax.ShapeDtypeStruct((self.observed,), jnp.result_type(float))
        reward = jax.ShapeDtypeStruct((), seen.dtype)

        def observed(following: Array, before: Array, action: Array, reward: Array, state: PyTree[Array]) -> PyTree:
            return self._agent.observe(state, learning.Transition(before, action, reward, following))

        return reads(observed, seen, seen, self._action, reward, self._state)[0]

    @property
    def outputs(self) -> Ports:
        action = self._action
        return {"action": Port(action.shape, kind_of(action.dtype)), "parameters": Port((size_of(self._state.policy),))}

    @functools.cached_property
    def _action(self) -> jax.ShapeDtypeStruct:
        policy = self._state.policy
        seen = jax.ShapeDtypeStruct((policy.inputs,), jnp.result_type(float))
        return jax.eval_shape(lambda p, y: abilities.task_action(p, p.mode(y)), policy, seen)

    @property
    def uniforms(self) -> int:
        return self._state.policy.uniforms

    @property
    def init_uniforms(self) -> int:
        return 1

    @property
    def _bound_agent(self) -> learning.Learner:
        """The agent with this block's arrays as its numbers."""
        bound = jax.tree_util.tree_map_with_path(
            lambda place, _: self.__dict__[path_of(place)], self._agent.hyperparameters
        )
        return bound.with_policy(self._agent.policy)

    def init(self, uniforms: Float[Array, " 1"]) -> Decided:
        action = jnp.zeros(self._action.shape, self._action.dtype)
        return Decided(self._bound_agent.init(key_from(uniforms)), jnp.zeros(self.observed), action)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        after = self._acted(state, inputs, now)
        return {"action": after.action, "parameters": flat(trainable(after.learner.policy))}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return self._acted(state, inputs, now)

    def _acted(self, state: Decided, inputs: Signals, now: Moment) -> Decided:
        """Learn from what the last action led to, then choose the next."""
        agent = self._bound_agent
        flags = {name: inputs[name] for name in ("terminated", "truncated")}
        diverged = ~inputs["valid"]
        ended = flags["terminated"] | flags["truncated"] | diverged
        transition = learning.Transition(
            state.observation,
            state.action,
            inputs["reward"],
            inputs["next_observation"],
            **flags,
            diverged=diverged | self.frozen,  # of which nothing is learned, though it ends an episode
        )
        learned = agent.update(agent.observe(state.learner, transition))
        restart = getattr(agent, "restart", None)  # a learner that can be told of an end alone counts no decision there
        restarted = learned if restart is None else restart(state.learner)
        frozen = where(ended, restarted, state.learner)
        after = where(now.tick > 0, where(self.frozen, frozen, learned), state.learner)
        observation = inputs["observation"]
        after, action = agent.act(after, observation, now.uniforms)
        return Decided(after, observation, action)


def _numbers_of(agent: learning.Learner) -> dict[str, Any]:
    """An agent's numbers by path, as plain numbers or nested tuples of them."""
    return {path: nested(np.asarray(number).tolist()) for path, number in numbers_of(agent.hyperparameters).items()}


def _with_numbers(
    kind: type[learning.Learner], settings: Mapping[str, Any], numbers: Mapping[str, Any]
) -> dict[str, Any]:
    """An agent's settings with other numbers by path. A part given by its name alone becomes a table with its kind."""
    table = expanded(kind, settings)
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
