"""The arguments of a training, checked before any work."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard

import jax
import numpy as np

from motorgrad._errors import check
from motorgrad._tree import check_rounded
from motorgrad.learning import Agent, SparseAgent
from motorgrad.policies import Policy
from motorgrad.tasks import HostTask, Task, make
from motorgrad.training._agents import agent_for
from motorgrad.training._initial import stacked
from motorgrad.training._sweep import Setting, settings_of
from motorgrad.training.engines import validate, validate_episodes

MOST_SEEDS = 1_000_000
MOST_THREADS = 4096


class Asked(NamedTuple):
    """The checked arguments of a training: `initial`, the policies that seeds begin from, where they were given;
    `settings`, those of a sweep, none without one."""

    task: Task
    agent: Agent
    steps: int
    seeds: list[int]
    initial: Policy | None = None
    settings: list[Setting] = []  # noqa: RUF012


def check_training(
    task: Task | str,
    agent: Agent | Mapping[str, Any] | None = None,
    steps: int = 100_000,
    seeds: int | Sequence[int] = 1,
    window: int | None = None,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    initial: Policy | None = None,
    sweep: Any = None,
) -> Asked:
    """Check the arguments of `train`. Nothing of a run's size is made.

    **Raises** `ValueError` that names what is impossible.
    """
    task = make(task) if isinstance(task, str) else task
    check(isinstance(task, Task), "task", task, "a task, or the name of one")
    known = agent is None or isinstance(agent, Agent | Mapping)
    check(known, "agent", agent, "an Agent, a mapping of changes, or None for the task's own")
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
    learner = agent if isinstance(agent, Agent) else agent_for(task, agent)
    compiled = not isinstance(task, HostTask) or not isinstance(learner, SparseAgent)
    check(compiled, "task", task.name, "a task in a JAX world for a sparse agent: in others the rest costs more")
    policy = jax.eval_shape(learner.init, jax.random.key(0)).policy
    validate(task, policy)
    validate_episodes(task, check_rounded(learner, learner.precision))
    own = None if initial is None else stacked(initial, policy, len(chosen))
    settings = [] if sweep is None else settings_of(sweep, task, learner)
    lanes = len(chosen) * max(1, len(settings))
    check(
        lanes <= MOST_SEEDS, "sweep", f"{len(settings)} settings of {len(chosen)} seeds", f"at most {MOST_SEEDS} in all"
    )
    return Asked(task, learner, int(steps), [int(seed) for seed in chosen], own, settings)


def _whole(value: Any) -> TypeGuard[int]:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
