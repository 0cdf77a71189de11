"""Agents for tasks: the task's own learner with some settings changed, and agents as tables and back."""

import dataclasses
import math
import numbers
from collections.abc import Mapping
from typing import Any, Protocol, cast

import jax
import jax.numpy as jnp

from motorgrad import policies
from motorgrad._errors import check, choice, unknown
from motorgrad._program_store import keep_programs
from motorgrad.learning import PRESETS, STEPS, Agent, Choice, Estimator, Learner, Optax, check_scores, choose
from motorgrad.policies import InitialPolicy
from motorgrad.schema import PART_CLASSES, Words, build, check_rounded, full_path, kind_of, parts_by_path, table
from motorgrad.tasks import Gymnasium, Task
from motorgrad.training._trust import task_named

USUAL = "policy-gradient"
"""The kind of learner that a table without a kind has."""
USUAL_PRESET = "natural"
"""The preset that takes changes which are meant for a policy gradient."""


def agent_for(
    task: Task | str,
    changes: Mapping[str, Any] | None = None,
    *,
    preset: str | None = None,
    steps: int | None = None,
    envs: int = 1,
    **more: object,
) -> Learner:
    """The learner that goes with a task, with some settings changed.

    A task has a learner of its own, as those of the thesis do, or gets a preset by what it is: see `choice_for`.

    **Arguments:**

    - `task`: a task, or the name of one.
    - `changes`: settings by path, such as `{"estimator.trace.decay": 0.98}`, or by the short names of
      the learner's `aliases`. A part is given itself, by the name of its kind, as a table with a `kind`, or as `None`.
    - `preset`: the name of a preset in place of the task's own learner, such as `"natural"`, with the task's own
      policy, before which it may put hidden layers. It may stand among the changes.
    - `steps` (decisions): length of the training, with which the schedules of learners scale; by default 100,000.
    - `envs`: environments that will feed the learner of each seed.
    - `more`: the same for names without dots, as keywords.

    A setting that is not changed stays as the task has it. A part or policy of another kind starts from that kind's own
    settings.

    **Raises** `ValueError` for an unknown name or setting, with the nearest known one, and for impossible values.

    ```python
    agent = mg.agent_for("hopper", {"estimator.trace.decay": 0.98}, learning_rate=1e-3)
    agent = mg.agent_for("hopper", estimator="gpomdp", metric="fisher")
    ```
    """
    keep_programs()
    task = task_named(task) if isinstance(task, str) else task
    check(isinstance(task, Task), "task", task, "a task, or the name of one")
    known = changes is None or isinstance(changes, Mapping)
    check(known, "agent", changes, "a table of changes, such as {'estimator.trace.decay': 0.98}")
    if steps is not None:
        # what the command line asks with may still be a fraction, which it refuses by the name of the option
        number = isinstance(steps, numbers.Real) and not isinstance(steps, bool)
        check(number and math.isfinite(steps), "steps", steps, "an integer")
    steps = STEPS if steps is None else int(steps)
    given = {**(changes or {}), **more}
    preset = given.pop("preset", preset)
    if preset is not None:
        choice("preset", preset, PRESETS)
    elif (chosen := choice_for(task, given, steps=max(1, steps), envs=envs)) is not None:
        preset = chosen.preset
    learner = task.learner_for(steps)
    if preset is None and learner is None:  # a kind of learner is named, which keeps the policy
        preset = USUAL_PRESET
    own = dict(learner or {})
    if preset is not None:
        # a protocol cannot say "of the class or of the instance", which the kind of actions may be
        own = PRESETS[preset](task, steps, own.get("policy"))  # pyright: ignore[reportArgumentType]
    wanted = _kind_of_policy(given)
    own_policy = own.pop("policy", "hyperplanes")
    if wanted in policies.INITIAL and wanted != _kind_of_policy({"policy": own_policy}):
        own_policy = wanted  # the settings of a policy do not pass to another kind, which may refuse them
    policy = build(InitialPolicy, own_policy, "agent.policy")
    kind = wanted or kind_of(policy)
    agent = build(Learner, {**own, **policies.IMPLIED.get(kind, {})}, "agent", Agent(policy))
    agent = bound_to(build(Learner, given, "agent", agent), task)
    kind = kind_of(agent.policy) if isinstance(agent.policy, InitialPolicy) else ""
    for name, value in policies.IMPLIED.get(kind, {}).items():
        needed = f"set, such as {value!r}, for the policy {kind!r}"
        check(getattr(agent, name, None) is not None, f"agent.{name}", None, needed)
    try:
        start = jax.eval_shape(agent.init, jax.random.key(0))  # refuses parts that do not fit the policy
        check_scores(agent, start.policy)
    except ValueError as error:
        advice = task.of_many_numbers if isinstance(task, Gymnasium) else ""
        raise ValueError(f"{error}; {advice}" if advice else str(error)) from None
    check_rounded(agent, agent.precision)
    return agent


def choice_for(
    task: Task | str, changes: Mapping[str, Any] | None = None, *, steps: int = STEPS, envs: int = 1
) -> Choice | None:
    """The preset that a task gets by itself (`motorgrad.presets.choose`), or `None` for a task, or changes, that name a
    learner.

    Changes may be meant for another learner than the one that the task gets: an estimator, a policy of binary units.
    The preset is then `natural`, which takes most of them.

    **Arguments:** as `agent_for`.

    ```python
    print(mg.training.choice_for("Pendulum-v1", steps=20_000))
    ```
    """
    task = task_named(task) if isinstance(task, str) else task
    given = changes or {}
    if task.learner_for(steps) is not None or {"preset", "kind"} & given.keys():
        return None
    chosen = choose(task, steps, envs)  # pyright: ignore[reportArgumentType] (as in `agent_for`)
    own = PRESETS[chosen.preset](task, steps, None)  # pyright: ignore[reportArgumentType]
    foreign = _not_of(own, given)
    if not foreign or chosen.preset == USUAL_PRESET:
        return chosen
    gain = f"would be chosen without {foreign}"
    return Choice(USUAL_PRESET, f"{foreign} is given, which {chosen.preset!r} does not take", chosen.preset, gain)


def _not_of(own: Mapping[str, Any], changes: Mapping[str, Any]) -> str | None:
    """The first of the changes that a learner, as a table, does not take."""
    learner = cast(type[Learner], Learner.kinds()[own.get("kind", USUAL)])
    known = {field.name for field in dataclasses.fields(learner)} | {*learner.aliases}
    for path in changes:
        if path.partition(".")[0] not in known:
            return path
    wanted = _kind_of_policy(changes)
    usual = wanted in ("", own["policy"]["kind"]) and not isinstance(changes.get("policy"), policies.Policy)
    return None if usual else "policy"


class PresetAgent(Protocol):
    """A preset as a function that makes the agent."""

    def __call__(
        self, task: Task | str, steps: int = STEPS, changes: Mapping[str, object] | None = None, **more: object
    ) -> Learner: ...


def preset_agent(name: str) -> PresetAgent:
    """The preset of this name as a function that returns the learner."""
    table = PRESETS[name]

    def agent(
        task: Task | str, steps: int = STEPS, changes: Mapping[str, object] | None = None, **more: object
    ) -> Learner:
        return agent_for(task, changes, preset=name, steps=steps, **cast(dict[str, Any], more))

    # what `functools.wraps` sets beside these would show the arguments of the table
    for about in ("__name__", "__qualname__", "__doc__"):
        setattr(agent, about, getattr(table, about))
    agent.__module__ = "motorgrad.presets"  # where pickle finds it; in its table's module this name is the table
    return agent


def with_changes(agent: Learner, changes: Mapping[str, Any]) -> Learner:
    """The agent with some settings changed, and with what a policy among them implies. **Raises** `ValueError` for an
    unknown name or setting, with the nearest known one, and for impossible values."""
    task = agent.policy.task if isinstance(agent.policy, InitialPolicy) else None
    implied = policies.IMPLIED.get(_kind_of_policy(changes), {})  # such as growth, for a policy that grows
    changed = build(Learner, {**implied, **changes}, "agent", agent)
    return changed if task is None else bound_to(changed, task)


def bound_to(agent: Learner, task: Task) -> Learner:
    """The agent with its initial policy for this task. **Raises** `ValueError` for one that is impossible for it."""
    if not isinstance(agent.policy, InitialPolicy):
        return agent
    try:
        return dataclasses.replace(agent, policy=agent.policy.bound(task))
    except ValueError as error:
        raise ValueError(f"{'agent.' * str(error).startswith('policy.')}{error}") from None


def _kind_of_policy(changes: Mapping[str, Any]) -> str:
    """The kind of initial policy that changes name; empty where they name none."""
    policy = changes.get("policy", changes.get("policy.kind", ""))
    policy = policy.get("kind", "") if isinstance(policy, Mapping) else policy
    if isinstance(policy, InitialPolicy):
        return kind_of(policy)
    policy = policy.read(str, "agent.policy") if isinstance(policy, Words) else policy
    return policy if isinstance(policy, str) else ""


def changes_named(name: str, where: str = "agent") -> dict[str, Any]:
    """The changes that a word given there stands for: a named estimator, a preset, or a kind of learner. **Raises**
    `ValueError` for others."""
    if name not in (known := [*Estimator.presets, *PRESETS, *Learner.kinds()]):
        raise unknown(where, name, known, registered=True)
    if name in PRESETS:
        return {"preset": name}
    return {"estimator": name} if name in Estimator.presets else {"kind": name}


def changed(changes: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Changes to a learner with `more` in their place, whether settings are named by path or by short name."""
    kinds = Learner.kinds().values()
    paths = {(kind, full_path(kind, name)) for name in more for kind in kinds}
    kept = (name for name in changes if not any((kind, full_path(kind, name)) in paths for kind in kinds))
    return {name: changes[name] for name in kept} | dict(more)


def agent_table(agent: Learner) -> dict[str, Any]:
    """An agent as a table for configurations. `agent_from_table` is the inverse where all its parts are registered."""
    found = table(agent)
    if found["kind"] == USUAL:
        del found["kind"]
    if not isinstance(agent.policy, InitialPolicy):
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


def agent_from_table(task: Task, settings: Mapping[str, Any], where: str = "agent") -> Learner:
    """The agent of a saved configuration. **Raises** `ValueError` where a part was made in Python and is not
    registered."""
    made = _unregistered(settings, where)
    if made:
        raise ValueError(f"{made[0]} was made in Python and is not registered: give the agent again")
    return bound_to(build(Learner, {"kind": USUAL, **settings}, where), task)


def _unregistered(settings: object, where: str) -> list[str]:
    """The parts of a saved table that are not registered, by path."""
    known = {name for kinds in PART_CLASSES.values() for name in kinds}
    if isinstance(settings, Mapping):
        found = [where] if settings.get("kind", USUAL) not in known else []
        return found + [p for name, value in settings.items() for p in _unregistered(value, f"{where}.{name}")]
    if isinstance(settings, list | tuple):
        return [p for index, value in enumerate(settings) for p in _unregistered(value, f"{where}.{index}")]
    return []


def _first_steps(part: Optax, agent: Learner) -> list[str]:
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
