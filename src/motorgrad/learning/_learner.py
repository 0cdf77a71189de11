r"""The seam between engines and algorithms: what the engines of training know of any learner.

    observation ──▶ act ──▶ action ──▶ (the task) ──▶ transition ──▶ observe ──▶ update ──▶ act …

A learner is a part with five pure functions of one state: `init`, `act`, `observe`, `update`, and
`decisions_until_due`. What it needs of a task or of a policy it declares (`Needs`), and it is refused by name where
they lack it. Nothing here knows the task.
"""

import abc
import dataclasses
import functools
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import Flag
from motorgrad._errors import check
from motorgrad.policies import (
    Alternating,
    InitialPolicy,
    Policy,
    PrintedGaussians,
    abilities,
    trainable,
    with_frozen_functions,
    with_interface,
)
from motorgrad.schema import PART_CLASSES, Numbers, Part, inner

S = TypeVar("S", bound=Any)
"""The state of a learner."""
MAX_ALTERNATIVES = 64
"""Actions of which a learner values every one at each decision of a batch."""


class Transition(NamedTuple):
    r"""One decision and what it led to.

    `next_observation` is what the world showed *before* any reset. `terminated` says that the episode is over,
    `truncated` that a time limit cut it. `diverged` says that the simulation broke: nothing is to be learned from the
    transition, whose numbers need not be finite. A flag that is known while tracing is a plain `False`.

    `eligibility` is the trace $z$ that the reward meets, in the structure of the parameters: the policy gradient sets
    it for a baseline that says `needs_eligibility`.

    `raw` and `next_raw` are the observations in the task's own units, for a learner that needs a goal, where the task
    scales what it shows; else `None`.
    """

    observation: Any
    action: Any
    reward: Float[Array, ""]
    next_observation: Float[Array, " inputs"]
    terminated: Flag = False
    truncated: Flag = False
    diverged: Flag = False
    eligibility: Any = None
    raw: Float[Array, " inputs"] | None = None
    next_raw: Float[Array, " inputs"] | None = None


class Decision(NamedTuple):
    """What the units of a policy saw and drew: more than the task shows and gets, for a policy with a memory or with
    hidden units."""

    observation: Float[Array, " inputs"]
    action: Array


def first_decision(policy: Policy) -> Decision | None:
    """Room for what a policy sees and draws; `None` for one that sees and draws what the task shows and gets."""
    if not (abilities.has_hidden_units(policy) or abilities.has_memory(policy)):
        return None
    observation = jnp.zeros(policy.inputs, jax.tree.leaves(trainable(policy))[0].dtype)
    return Decision(observation, jnp.zeros_like(policy.mode(observation)))


def with_decision(state: S, seen: Float[Array, " inputs"], action: Array) -> S:
    """The state of a learner with what its policy saw and drew, where it has room for that."""
    if state.decision is None:
        return state
    return state._replace(decision=Decision(seen.astype(state.decision.observation.dtype), action))


class Needs(NamedTuple):
    """What a learner needs of a task and of a policy. A need that one of its settings has is named by that setting.

    - `episodes`: the settings that need a task with episodes.
    - `goal`: the setting that needs a task with a goal; `update` is then called with the goal, too.
    - `single_stream`: what needs the successive decisions of one environment, in words.
    - `score`: whether it learns from scores, which must then be exact; one that does not takes no printed pair.
    - `actions`: which actions it learns: any; real numbers that JAX can differentiate; or these and also a few
      alternatives, at most `MAX_ALTERNATIVES`.
    - `memory`: which memory a policy may have: any, one that does not depend on its parameters, one that only makes its
      noise last, or none. With the last two, it may have no hidden units either.
    """

    episodes: tuple[str, ...] = ()
    goal: str | None = None
    single_stream: str | None = None
    score: bool = False
    actions: Literal["any", "differentiable", "differentiable or few"] = "any"
    memory: Literal["any", "independent", "noise", "none"] = "any"


def _ready(policy: object) -> Any:
    """A policy whose leaves are arrays, also where it holds an `eqx.nn.MLP`; anything else as it is."""
    return with_frozen_functions(policy) if isinstance(policy, Policy) else policy


class Learner(Part):
    r"""A learner: what acts, and how it learns. Every algorithm derives from this class, and is a file of its own.

    It is one tree of parts. Numbers are leaves: they may differ by seed, and change while the learner runs. Structure
    is static: the kinds of parts, lengths, intervals and counts. A part that is absent is `None`.

    Its functions are pure. Compile them with `equinox.filter_jit(learner.update)`: `jax.jit` refuses a bound method of
    a tree that holds arrays, because it cannot hash them.

    A state is a `NamedTuple` of arrays, or of trees of arrays. It has the field `policy`, the policy that acts now. A
    learner of policies with a memory keeps it in a field `memory`, and what they saw and drew in a field `decision`
    (`first_decision`, `with_decision`).

    A learner of your own is registered by name (`motorgrad.learning.register`). Options, TOML files, sweeps, saved
    runs, TimSim and evaluations then know it; see the page "Write your own learner".
    """

    aliases: ClassVar[Mapping[str, str]] = {"units": "policy.units"}
    """Short names of the settings that everyone types, for options, TOML and `agent_for`."""
    critic: ClassVar[str | None] = None
    """The path by which both settings and states have the baseline or critic; `None` for a learner without one."""

    policy: InitialPolicy | Any = inner(
        converter=_ready,
        help="the initial policy, or a function from a key to one, so that every seed starts from its own",
    )

    def validate(self) -> None:
        made = isinstance(self.policy, Policy) or callable(self.policy)
        check(made, "policy", self.policy, "a policy or a function from a key to one")
        weights = any(map(eqx.is_inexact_array, jax.tree.leaves(self.policy)))
        bare = isinstance(self.policy, eqx.Module) and weights and not isinstance(self.policy, Policy)
        wanted = "a Policy; motorgrad.policies.Network(units, module, observed) puts any module under units"
        check(not bare, "policy", type(self.policy).__name__, wanted)

    @abc.abstractmethod
    def init(self, key: jax.Array) -> Any:
        """The state before the first decision. Begin with `first_policy(key)`."""

    @abc.abstractmethod
    def act(
        self, state: Any, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> tuple[Any, Array]:
        """The state after an action was chosen on an observation, and the action. `uniforms` are numbers from U[0, 1),
        as many as the policy consumes: the randomness of the decision."""

    @abc.abstractmethod
    def observe(self, state: Any, transition: Transition) -> Any:
        """The state after a transition. One that diverged must not change what was learned."""

    @abc.abstractmethod
    def update(self, state: Any) -> Any:
        """The state after what is due: steps of the parameters, or nothing. It is called after every `observe`, but for
        those decisions that `decisions_until_due` leaves out. A learner that needs a goal gets it as a second
        argument."""

    def decisions_until_due(self, state: Any) -> int | Int[Array, ""]:
        """The least number of coming decisions for which `update` would change nothing, and can be left out. The plain
        number 0, as by default, for a learner that is updated after every decision; others return an array."""
        del state
        return 0

    @property
    def needs(self) -> Needs:
        """What it needs of a task and of a policy; by default nothing, and no scores."""
        return Needs()

    def fed_by_several(self) -> Self:
        """The learner for decisions of several environments in turn, which share all that it learns; by default the
        same."""
        return self

    def readings(self, state: Any) -> dict[str, Array]:
        """Numbers of a state that records of a run show, by name; by default none."""
        del state
        return {}

    def final_policy(self, state: Any) -> Policy:
        """The policy to keep, which a run evaluates; by default the one that acts. States of many
        seeds are allowed, whose axis is the first or the last one of every array."""
        return state.policy

    def set_policy(self, state: Any, policy: Policy) -> Any:
        """The state with another policy in place. States of many seeds are allowed."""
        return state._replace(policy=with_interface(policy, None))

    @classmethod
    def settings_from(cls, other: "Learner") -> dict[str, Any]:
        """The settings that stay where this kind of learner takes the place of another: by default the policy alone, as
        the numbers of one algorithm mean something else in another."""
        return {"policy": other.policy}

    @property
    def hyperparameters(self) -> Self:
        """The tree without the policy, whose numbers are learned: its leaves are all numbers that may be changed."""
        return self.with_policy(None)

    def with_policy(self, policy: Policy | Callable[[jax.Array], Policy] | None) -> Self:
        """The learner with another policy, built without its checks: the policy may be traced or absent."""
        made = object.__new__(type(self))
        for field in dataclasses.fields(self):
            object.__setattr__(made, field.name, policy if field.name == "policy" else getattr(self, field.name))
        return made

    def with_numbers(self, numbers: Numbers, vector: Float[Array, " numbers"]) -> Self:
        """The learner with its numbers from a vector, which may be traced."""
        return numbers.tree(vector).with_policy(self.policy)

    @property
    def precision(self) -> np.dtype:
        """The floating-point type of the parameters, to which the numbers are rounded."""
        parameters = jax.eval_shape(lambda: trainable(self.first_policy(jax.random.key(0))))
        return jax.tree.leaves(parameters)[0].dtype

    def first_policy(self, key: jax.Array) -> Policy:
        """The policy that the learner was given, or the one that its function draws. **Raises** `ValueError` for one
        that lacks what the learner needs."""
        policy = self.policy if isinstance(self.policy, Policy) else _ready(self.policy(key))
        check(isinstance(policy, Policy), "policy", type(policy).__name__, "a function from a key to a Policy")
        policy = with_interface(policy, None)  # what it means to the task is no part of what is learned
        trains = len(jax.tree.leaves(trainable(policy))) > 0
        check(trains, "policy", type(policy).__name__, "a policy with trainable parameters")
        _check_policy(self, policy)
        return policy


PART_CLASSES[Learner] = {}


def _check_policy(learner: Learner, policy: Policy) -> None:
    """Refuse a policy that lacks what a learner needs of it to act."""
    needs = learner.needs
    kind = type(policy).__name__
    name = type(learner).__name__
    few = needs.actions == "differentiable or few" and policy.actions == "discrete"
    differentiable = needs.actions != "any" and not few
    if few:
        wanted = f"of at most {MAX_ALTERNATIVES} alternatives, for {name}"
        check(policy.outputs <= MAX_ALTERNATIVES, "policy", f"{policy.outputs} alternatives", wanted)
    elif differentiable:
        wanted = f"one with real-valued actions, such as BoundedHyperplanes, for {name}"
        check(policy.actions == "continuous", "policy", kind, wanted)
    if needs.memory != "any":
        wanted = f"one whose units learn all at once, for {name}, which returns to past decisions"
        turns = any(map(_takes_turns, jax.tree.leaves(policy, is_leaf=_takes_turns)))
        check(not turns, "policy", kind, wanted)
    if needs.memory == "independent":
        wanted = f"one whose memory does not depend on its parameters, for {name}"
        check(not abilities.remembers_parameters(policy), "policy", kind, wanted)
    elif needs.memory != "any":
        lasting = needs.memory == "noise"
        wanted = f"one without hidden units, and with no memory{' but lasting noise' if lasting else ''}, for {name}"
        plain = abilities.marginal(policy) if lasting else policy
        check(not (abilities.has_hidden_units(policy) or abilities.has_memory(plain)), "policy", kind, wanted)
    if differentiable:
        _check_differentiable(abilities.marginal(policy), kind)


def check_scores(learner: Learner, policy: Policy) -> None:
    """Refuse a policy whose scores are not what a learner learns from: inexact ones for a learner by scores, and those
    of the printed pair for one without. A policy that only acts may have any."""
    wanted = "one with an exact score; with filtered = False, learn by SoftActorCritic"
    exact = abilities.has_exact_score(policy) or not learner.needs.score
    check(exact, "policy", type(policy).__name__, wanted)
    printed = not learner.needs.score and any(map(_is_printed, jax.tree.leaves(policy, is_leaf=_is_printed)))
    check(not printed, "pair", "printed", f"exact for {type(learner).__name__}, which asks for no scores")


def _is_printed(part: object) -> bool:
    return isinstance(part, PrintedGaussians)


def _takes_turns(part: object) -> bool:
    return isinstance(part, Alternating)


def _check_differentiable(policy: Policy, kind: str) -> None:
    """Refuse a policy whose actions JAX does not differentiate."""
    leaves, structure = jax.tree.flatten(policy)
    try:
        _differentiate(structure, *(jax.ShapeDtypeStruct(jnp.shape(leaf), jnp.result_type(leaf)) for leaf in leaves))
    except ValueError as error:  # such as the beta distribution, whose quantiles JAX does not differentiate
        wanted = "one whose actions JAX can differentiate, such as of the densities 'squashed' and 'clipped'"
        raise ValueError(f"policy = {kind!r}: must be {wanted}") from error


@functools.lru_cache  # a learner is begun a dozen times before its first decision, mostly traced
def _differentiate(structure: Any, *leaves: jax.ShapeDtypeStruct) -> None:
    """Trace the gradient of the actions of a policy."""

    def slope(policy: Policy) -> PyTree[Array]:
        observation = jnp.zeros(policy.inputs, jax.tree.leaves(trainable(policy))[0].dtype)
        numbers = jnp.zeros(policy.uniforms, observation.dtype)
        return eqx.filter_grad(lambda present: jnp.sum(present.sample(observation, numbers)))(policy)

    eqx.filter_eval_shape(slope, jax.tree.unflatten(structure, leaves))
