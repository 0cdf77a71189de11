"""The numbers of a learner that can be changed while it runs."""

import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import numpy as np

from motorgrad._errors import check
from motorgrad.learning import Agent, Exponential
from motorgrad.sim.live._probe import rates_in
from motorgrad.tasks import Task

RATE, DECAY, EXPLORATION = "agent.rate", "agent.decay", "exploration"
HELD = ("action_period", "time_limit")
"""Fields of tasks that are no part of what is rewarded."""


def named_rates(state: Any) -> dict[str, float]:
    """The step sizes in an engine's state: one for all where they are the same, else one for every group."""
    found = {f"{RATE}s.{name}": _written(np.mean(leaf)) for name, leaf in _rates(state)}
    same = len(set(found.values())) == 1
    return {RATE: next(iter(found.values()))} if same else found


def put_rate(state: Any, name: str, value: float) -> None:
    """Change a step size in an engine's state, in place."""
    check(0 <= value < math.inf, name, value, "a finite number of at least 0")
    for group, leaf in _rates(state):
        if name in (RATE, f"{RATE}s.{group}"):
            leaf[...] = value


def rebuilt(task: Task, agent: Agent) -> dict[str, float]:
    """What is changed by making the engine anew: the trace's decay, and the task's numbers."""
    found = {}
    if isinstance(agent.estimator.trace, Exponential):
        found[DECAY] = agent.estimator.trace.decay
    for field in dataclasses.fields(task) if dataclasses.is_dataclass(task) else ():
        value = getattr(task, field.name)
        if isinstance(value, float) and field.name not in HELD:
            found[f"task.{field.name}"] = value
    return found


def with_changes(task: Task, agent: Agent, changes: Mapping[str, float]) -> tuple[Task, Agent]:
    """Task and agent with some of `rebuilt` changed. **Raises** `ValueError` for what they refuse."""
    named = {name.removeprefix("task."): value for name, value in changes.items() if name.startswith("task.")}
    try:
        task = dataclasses.replace(task, **named) if named else task  # type: ignore[type-var]
        if DECAY in changes:
            trace = dataclasses.replace(agent.estimator.trace, decay=changes[DECAY])  # type: ignore[call-arg]
            agent = dataclasses.replace(agent, estimator=dataclasses.replace(agent.estimator, trace=trace))
    except ValueError as error:
        raise ValueError(f"edit: {error}") from None
    return task, agent


def _rates(state: Any) -> Iterator[tuple[str, np.ndarray]]:
    rates = rates_in(state["cycle"].agent.ascent)
    for place, leaf in jax.tree_util.tree_leaves_with_path(rates):
        yield jax.tree_util.keystr(place).strip("."), leaf


def _written(value: Any) -> float:
    """A number of single precision as it was meant: 0.1, not 0.10000000149."""
    return float(str(np.float32(value)))
