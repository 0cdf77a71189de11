"""Compiled programs, kept and shared by all engines of the same task, learner structure and mode."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import jax

from motorgrad.learning import Learner
from motorgrad.policies import Policy
from motorgrad.schema import Numbers
from motorgrad.tasks import Task

P = TypeVar("P")
MAX_KEPT_PROGRAMS = 32
"""The one used longest ago is dropped first."""

_programs: OrderedDict[Hashable, Any] = OrderedDict()
_lock = threading.Lock()


def shared(kind: type[P], task: Task, agent: Learner, more: Hashable, make: Callable[[], P]) -> P:
    """The program of this `kind` for a task, an agent and what `more` it depends on, made once. Agents that differ in
    the values of their numbers alone share it; so do those whose initial policies are given as arrays of the same
    shapes."""
    key = (kind, _key_of_task(task), _key_of_agent(agent), more, bool(jax.config.jax_enable_x64))  # type: ignore[attr-defined]
    with _lock:
        if key not in _programs:
            _programs[key] = make()
            while len(_programs) > MAX_KEPT_PROGRAMS:
                _programs.popitem(last=False)
        _programs.move_to_end(key)
        return _programs[key]


def clear_programs() -> None:
    """Forget all compiled programs."""
    with _lock:
        _programs.clear()


class _Same:
    """A key for an object that has no hash: equal to itself alone."""

    def __init__(self, value: object):
        self.value = value  # kept alive, so that its identity is not given to another object

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)


def _key_of_task(task: Task) -> Hashable:
    try:
        hash(task)
    except TypeError:  # a field is a mapping or an array
        return _Same(task)
    return type(task), task


def _key_of_agent(agent: Learner) -> Hashable:
    policy: Hashable = agent.policy
    if isinstance(policy, Policy):  # its arrays are arguments of the program
        leaves, structure = jax.tree.flatten(policy)
        policy = (structure, tuple((leaf.shape, str(leaf.dtype)) for leaf in leaves))
    try:
        hash(policy)
    except TypeError:
        policy = _Same(policy)
    return type(agent), Numbers(agent.hyperparameters).key, policy
