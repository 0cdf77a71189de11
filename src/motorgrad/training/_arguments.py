"""What a training is asked to do, refused where it is impossible, before any work."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeGuard

import jax
import numpy as np

from motorgrad._errors import check
from motorgrad.learning import Agent, IndexedAgent
from motorgrad.policies import Policy
from motorgrad.tasks import HostTask, Task, make
from motorgrad.training._initial import stacked
from motorgrad.training._settings import AgentSettings, settings_for
from motorgrad.training._stepper import validate, validate_episodes

MOST_SEEDS = 1_000_000
MOST_THREADS = 4096


class Asked(NamedTuple):
    """The arguments of a training, as they are meant; `settings`, where the agent was made from some;
    `initial`, the policies that seeds begin from, where they were given."""

    task: Task
    agent: Agent
    settings: AgentSettings | None
    steps: int
    seeds: list[int]
    initial: Policy | None = None


def check_training(
    task: Task | str,
    agent: Agent | AgentSettings | None = None,
    steps: int = 100_000,
    seeds: int | Sequence[int] = 1,
    window: int | None = None,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    initial: Policy | None = None,
) -> Asked:
    """The arguments as `train` takes them, checked. Nothing of a run's size is made.

    **Raises** `ValueError` that names what is impossible.
    """
    task = make(task) if isinstance(task, str) else task
    check(isinstance(task, Task), "task", task, "a task, or the name of one")
    known = agent is None or isinstance(agent, Agent | AgentSettings)
    check(known, "agent", agent, "an Agent, AgentSettings, or None for the task's own")
    check(_whole(seeds) or isinstance(seeds, Iterable), "seeds", seeds, "how many, or a list of them")
    if isinstance(seeds, int | np.integer):
        check(0 < seeds <= MOST_SEEDS, "seeds", seeds, f"from 1 to {MOST_SEEDS} seeds")
    chosen = list(range(seeds) if isinstance(seeds, int | np.integer) else seeds)
    check(_whole(steps) and 1 <= steps <= 2**32 - 256, "steps", steps, "an integer from 1 to 4,294,967,040")
    check(0 < len(chosen) <= MOST_SEEDS, "seeds", chosen, f"from 1 to {MOST_SEEDS} seeds")
    valid = all(_whole(seed) and 0 <= seed < 2**31 for seed in chosen)
    check(valid, "seeds", chosen, "integers from 0 to 2147483647")
    check(len(set(chosen)) == len(chosen), "seeds", chosen, "all different")
    check(window is None or (_whole(window) and window >= 1), "window", window, "a whole number of at least 1 decision")
    timed = isinstance(checkpoint_every, int | float | np.number) and checkpoint_every >= 0
    check(timed, "checkpoint_every", checkpoint_every, "at least 0 seconds")
    valid = _whole(threads) and 0 <= threads <= MOST_THREADS
    check(valid, "threads", threads, f"0 for all processors, or their number, at most {MOST_THREADS}")
    settings = settings_for(task) if agent is None else agent if isinstance(agent, AgentSettings) else None
    learner = agent if isinstance(agent, Agent) else (settings or settings_for(task)).agent(task)
    compiled = not isinstance(task, HostTask) or not isinstance(learner, IndexedAgent)
    check(compiled, "task", task.name, "a task in a JAX world where units are indexed: on others the rest costs more")
    policy = jax.eval_shape(learner.init, jax.random.key(0)).policy
    validate(task, policy)
    validate_episodes(task, learner.estimator)
    own = None if initial is None else stacked(initial, policy, len(chosen))
    return Asked(task, learner, settings, int(steps), [int(seed) for seed in chosen], own)


def _whole(value: Any) -> TypeGuard[int]:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
