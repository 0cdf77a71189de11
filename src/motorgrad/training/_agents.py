"""Agents for tasks: the task's own learner with some settings changed, and agents as tables and back."""

import dataclasses
import inspect
import math
import numbers
from collections.abc import Callable, Mapping
from typing import Any, Protocol, get_type_hints

import jax
import jax.numpy as jnp

from motorgrad import policies
from motorgrad._errors import check, choice, unknown
from motorgrad._natural import STEPS, Learnable, PolicyTable
from motorgrad._settings import as_hinted, build, full_path, table
from motorgrad._tree import PART_CLASSES, Part, check_rounded, parts_by_path
from motorgrad._words import Words
from motorgrad.learning import Agent, Estimator, Optax
from motorgrad.tasks import Gymnasium, Task
from motorgrad.training._trust import task_named

MAX_POLICY_WEIGHTS = 100_000_000
Table = Callable[[Learnable, int, PolicyTable | None], dict[str, Any]]
"""A learner as a table of settings: for a task, the decisions of a training, and the task's own policy or `None`."""
PRESETS: dict[str, Table] = {}
"""The presets by name, as `preset` registers them."""


@dataclasses.dataclass(frozen=True)
class NamedPolicy:
    """An initial policy by its name and settings, as configurations and the command line give it.

    Call it with the key of a seed to make the policy.

    **Arguments:** the `task`; the `kind`, a name in `motorgrad.policies.INITIAL`; `settings`, the keyword arguments of
    its function, of which defaults are dropped.

    **Raises:** `ValueError` for an unknown kind or setting, and for settings that are impossible for the task.
    """

    task: Any = dataclasses.field(repr=False)
    kind: str
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.kind not in policies.INITIAL:
            raise unknown("policy", self.kind, policies.INITIAL, registered=True)
        hints = policy_settings(self.kind)
        for name in self.settings:
            if name not in hints:
                raise unknown(f"setting of policy {self.kind!r}:", name, hints)
        given = {
            name: as_hinted(hints[name], value, f"policy.{name}")
            for name, value in self.settings.items()
            if value is not None
        }
        known = inspect.signature(policies.INITIAL[self.kind]).parameters
        # one description for one policy, whether or not a default was written out
        given = {name: value for name, value in given.items() if value != known[name].default}
        object.__setattr__(self, "settings", given)
        units = given.get("units") or 1
        most = MAX_POLICY_WEIGHTS // self.task.observation_size
        check(units <= most, "policy.units", units, f"at most {most} here")
        try:
            made = policies.initial(self.kind, self.task, **given)
        except ValueError as error:
            named = str(error).split()[0].strip(",") in given
            raise ValueError(f"policy.{error}" if named else str(error)) from None
        object.__setattr__(self, "_made", made)

    def __call__(self, key: jax.Array) -> policies.Policy:
        made: Any = self._made  # type: ignore[attr-defined]
        return made if isinstance(made, policies.Policy) else made(key)

    def __hash__(self) -> int:
        return hash((self.kind, repr(sorted(self.settings.items()))))

    def with_setting(self, value: str | Mapping[str, Any], where: str = "policy") -> "NamedPolicy":
        """The policy with a setting applied: the name of another kind, or a table of changes.

        Settings that the table leaves out are kept, unless it names another kind.
        """
        settings = {"kind": value} if isinstance(value, str) else dict(value)
        kind = settings.pop("kind", self.kind)
        kind = kind.read(str, f"{where}.kind") if isinstance(kind, Words) else kind
        check(isinstance(kind, str), f"{where}.kind", kind, "the name of an initial policy")
        kept = self.settings if kind == self.kind else {}
        try:
            return NamedPolicy(self.task, kind, {**kept, **{n: _merged(kept.get(n), v) for n, v in settings.items()}})
        except ValueError as error:
            outer = where.removesuffix("policy") if str(error).startswith("policy.") else ""
            raise ValueError(f"{outer}{error}") from None

    @property
    def setting_names(self) -> list[str]:
        """The names of the settings of this kind of policy."""
        return list(policy_settings(self.kind))

    def as_setting(self) -> dict[str, Any]:
        """The inverse of `with_setting`."""
        plain = {name: table(value) if isinstance(value, Part) else value for name, value in self.settings.items()}
        return {"kind": self.kind, **plain}


def _merged(part: object, value: object) -> Any:
    """A setting of a policy that is a part of its own, with the changes of a table."""
    if not isinstance(part, Part) or not isinstance(value, Mapping):
        return value
    own = table(part)
    return {**own, **value} if value.get("kind", own["kind"]) == own["kind"] else value


def policy_settings(kind: str) -> dict[str, Any]:
    """The settings of an initial policy with their types, by name."""
    function = policies.INITIAL[kind]
    known = inspect.signature(function).parameters
    hints = get_type_hints(function)
    return {name: hints.get(name, Any) for name in known if name not in ("task", "self")}


def agent_for(
    task: Task | str,
    changes: Mapping[str, Any] | None = None,
    *,
    preset: str | None = None,
    steps: int | None = None,
    **more: object,
) -> Agent:
    """The learner that goes with a task, with some settings changed.

    **Arguments:**

    - `task`: a task, or the name of one.
    - `changes`: settings by path, such as `{"estimator.trace.decay": 0.98}`, or by the short names of
      `Agent.aliases`. A part is given itself, by the name of its kind, as a table with a `kind`, or as `None`.
    - `preset`: the name of a preset in place of the task's own learner, such as `"natural"`, with the task's own
      policy, before which it may put hidden layers. It may stand among the changes.
    - `steps` (decisions): length of the training, with which the schedules of learners scale; by default 100,000.
    - `more`: the same for names without dots, as keywords.

    A setting that is not changed stays as the task has it. A part or policy of another kind starts from that kind's own
    settings.

    **Raises** `ValueError` for an unknown name or setting, with the nearest known one, and for impossible values.

    ```python
    agent = mg.agent_for("hopper", {"estimator.trace.decay": 0.98}, learning_rate=1e-3)
    agent = mg.agent_for("hopper", estimator="gpomdp", metric="fisher")
    ```
    """
    task = task_named(task) if isinstance(task, str) else task
    check(isinstance(task, Task), "task", task, "a task, or the name of one")
    known = changes is None or isinstance(changes, Mapping)
    check(known, "agent", changes, "a table of changes, such as {'estimator.trace.decay': 0.98}")
    if steps is not None:
        # what the command line asks with may still be a fraction, which it refuses by the name of the option
        number = isinstance(steps, numbers.Real) and not isinstance(steps, bool)
        check(number and math.isfinite(steps), "steps", steps, "an integer")
    steps = STEPS if steps is None else int(steps)
    own = dict(task.learner_for(steps))
    given = {**(changes or {}), **more}
    preset = given.pop("preset", preset)
    if preset is not None:
        choice("preset", preset, PRESETS)
        # a protocol cannot say "of the class or of the instance", which the kind of actions may be
        own = PRESETS[preset](task, steps, own.get("policy"))  # pyright: ignore[reportArgumentType]
    return _built(task, own, given)


class PresetAgent(Protocol):
    """A preset as a function that makes the agent."""

    def __call__(
        self, task: Task | str, steps: int = STEPS, changes: Mapping[str, object] | None = None, **more: object
    ) -> Agent: ...


def preset(name: str) -> Callable[[Table], PresetAgent]:
    """A decorator that registers a table as the preset of this name, and makes of it the function that returns the
    agent: the table, with changes, as an `Agent`."""

    def registered(table: Table) -> PresetAgent:
        def agent(
            task: Task | str, steps: int = STEPS, changes: Mapping[str, object] | None = None, **more: object
        ) -> Agent:
            return agent_for(task, changes, preset=name, steps=steps, **more)

        PRESETS[name] = table
        # what `functools.wraps` sets beside these would show the arguments of the table
        for about in ("__module__", "__name__", "__qualname__", "__doc__"):
            setattr(agent, about, getattr(table, about))
        return agent

    return registered


def with_changes(agent: Agent, changes: Mapping[str, Any]) -> Agent:
    """The agent with some settings changed, and with what a policy among them implies.

    **Raises** `ValueError` for an unknown name or setting, with the nearest known one, and for impossible values.
    """
    if not changes:
        return agent
    policy = changes.get("policy", changes.get("policy.kind", ""))
    kind = policy.read(str, "policy") if isinstance(policy, Words) else policy
    implied = policies.IMPLIED.get(kind, {}) if isinstance(kind, str) else {}
    return as_hinted(Agent, {**implied, **changes}, "agent", agent)


def changes_named(name: str, where: str = "agent") -> dict[str, Any]:
    """The changes that a word stands for: a named estimator, or a preset.

    **Arguments:** the `name`; `where` it is given.

    **Raises** `ValueError` for an unknown name, with the nearest known one.
    """
    if name not in (known := [*Estimator.presets, *PRESETS]):
        raise unknown(where, name, known, registered=True)
    return {"preset": name} if name in PRESETS else {"estimator": name}


def changed(changes: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Changes to a learner with `more` in their place, whether settings are named by path or by short name."""
    paths = {full_path(Agent, name) for name in more}
    return {name: value for name, value in changes.items() if full_path(Agent, name) not in paths} | dict(more)


def _built(task: Task, own: dict[str, Any], given: Mapping[str, Any]) -> Agent:
    changed = given.get("policy", given.get("policy.kind"))
    kind = changed.get("kind") if isinstance(changed, Mapping) else changed
    own_policy = own.pop("policy", "hyperplanes")
    own_kind = own_policy if isinstance(own_policy, str) else own_policy["kind"]
    if isinstance(kind, str) and kind in policies.INITIAL and kind != own_kind:
        own_policy = kind  # the settings of a policy do not pass to another kind
    named = NamedPolicy(task, "hyperplanes").with_setting(own_policy)
    wanted = kind if isinstance(kind, str) else named.kind
    implied = policies.IMPLIED.get(wanted, {})  # such as growth, for a policy that grows
    agent = as_hinted(Agent, {**own, **implied}, "agent", Agent(named))
    agent = as_hinted(Agent, given, "agent", agent)
    for name, value in policies.IMPLIED.get(getattr(agent.policy, "kind", ""), {}).items():
        needed = f"set, such as {value!r}, for the policy {agent.policy.kind!r}"
        check(getattr(agent, name) is not None, f"agent.{name}", None, needed)
    try:
        jax.eval_shape(agent.init, jax.random.key(0))  # refuses parts that do not fit the policy
    except ValueError as error:
        advice = task.of_many_numbers if isinstance(task, Gymnasium) else ""
        raise ValueError(f"{error}; {advice}" if advice else str(error)) from None
    check_rounded(agent, agent.precision)
    return agent


def agent_table(agent: Agent) -> dict[str, Any]:
    """An agent as a table for configurations. `agent_from_table` is the inverse where all its parts are registered."""
    found = table(agent)
    if found["kind"] == "dense":
        del found["kind"]
    if not isinstance(agent.policy, NamedPolicy):
        state = jax.eval_shape(agent.init, jax.random.key(0))
        found["policy"] = {"kind": "given", "structure": policies.describe(state.policy)}
    for name, part in parts_by_path(agent):
        if isinstance(part, Optax):
            node: Any = found
            keys = name.split(".")
            for key in keys:
                node = node[int(key)] if isinstance(node, list) else node[key]
            node.pop("transformation", None)
            node.update(kind="optax", steps=_first_steps(part, agent))
    return found


def agent_from_table(task: Task, settings: Mapping[str, Any], where: str = "agent") -> Agent:
    """The agent of a saved configuration.

    **Raises** `ValueError` where a part was made in Python and is not registered.
    """
    made = _unregistered(settings, where)
    if made:
        raise ValueError(f"{made[0]} was made in Python and is not registered: give the agent again")
    given = dict(settings)
    policy = NamedPolicy(task, given["policy"]["kind"]).with_setting(given.pop("policy"), f"{where}.policy")
    kind = PART_CLASSES[Agent][given.pop("kind", "dense")]
    return build(kind, given, where, kind(policy))


def _unregistered(settings: object, where: str) -> list[str]:
    """The parts of a saved table that are not registered, by path."""
    known = {name for kinds in PART_CLASSES.values() for name in kinds} | set(policies.INITIAL)
    if isinstance(settings, Mapping):
        found = [where] if settings.get("kind", "dense") not in known else []
        return found + [p for name, value in settings.items() for p in _unregistered(value, f"{where}.{name}")]
    if isinstance(settings, list | tuple):
        return [p for index, value in enumerate(settings) for p in _unregistered(value, f"{where}.{index}")]
    return []


def _first_steps(part: Optax, agent: Agent) -> list[str]:
    """The first steps of an optax transformation, which identify most of its hidden constants."""
    policy = jax.eval_shape(agent.init, jax.random.key(0)).policy

    def fill(value: float) -> Any:
        return policies.trainable(jax.tree.map(lambda leaf: jnp.full(leaf.shape, value, leaf.dtype), policy))

    parameters = fill(1.0)
    sums = []
    state = part.transformation.init(parameters)
    for gradient in (1.0, -0.5, 30.0):
        step, state = part.transformation.update(fill(gradient), state, parameters)
        sums.append(f"{sum(float(jnp.sum(leaf)) for leaf in jax.tree.leaves(step)):.5g}")
    return sums
