"""The arguments of a training, checked before any work."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.tree_util import KeyPath

from motorgrad._errors import check, is_integer
from motorgrad.learning import Choice, Learner, SparseLearner, check_scores
from motorgrad.policies import Policy, trainable, with_interface
from motorgrad.schema import check_rounded, path_of
from motorgrad.tasks import Gymnasium, HostTask, Task
from motorgrad.training._agents import agent_for, choice_for
from motorgrad.training._sweep import Setting, Sweep, sweep_settings, swept_names
from motorgrad.training._trust import task_named
from motorgrad.training.engines import MAX_TALLY_DECISIONS, check_carries, validate, validate_needs

MAX_LANES = 1_000_000
MAX_STEPS = 2**32 - 256
MAX_THREADS = 4096
MAX_ENVS = 65_536


class TrainingArguments(NamedTuple):
    """The checked arguments of a training: `initial`, the policies from which the seeds start, where they were given;
    the `settings` of a sweep; the decisions per record (`window`); the environments of each learner (`envs`), and the
    processes in which they are stepped (`workers`); the preset that the task got by itself (`choice`)."""

    task: Task
    agent: Learner
    steps: int
    seeds: list[int]
    initial: Policy | None = None
    settings: list[Setting] = []  # noqa: RUF012
    window: int = 1
    envs: int = 1
    workers: int = 0
    choice: Choice | None = None


def check_training(
    task: Task | str,
    agent: Learner | Mapping[str, Any] | None = None,
    steps: int = 100_000,
    seeds: int | Sequence[int] = 1,
    window: int | None = None,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    initial: Policy | None = None,
    sweep: Sweep | None = None,
    give_up_after: float = 3600.0,
    envs: int = 1,
    workers: int = 0,
) -> TrainingArguments:
    """Check the arguments of `train`, without allocating anything of the size of the run. **Raises** `ValueError` that
    names the impossible argument."""
    task = task_named(task) if isinstance(task, str) else task
    check(isinstance(task, Task), "task", task, "a task, or the name of one")
    known = agent is None or isinstance(agent, Learner | Mapping)
    check(known, "agent", agent, "a Learner, a mapping of changes, or None for the task's own")
    if isinstance(initial, Policy):  # it is said first what has changed, then what no longer fits
        check_carries(task, initial, "initial")
    check(is_integer(seeds) or isinstance(seeds, Iterable), "seeds", seeds, "a number of seeds, or a list of them")
    if isinstance(seeds, int | np.integer):
        check(0 < seeds <= MAX_LANES, "seeds", seeds, f"from 1 to {MAX_LANES} seeds")
    chosen = list(range(seeds) if isinstance(seeds, int | np.integer) else seeds)
    check(is_integer(steps) and 1 <= steps <= MAX_STEPS, "steps", steps, f"an integer from 1 to {MAX_STEPS:,}")
    check(0 < len(chosen) <= MAX_LANES, "seeds", chosen, f"from 1 to {MAX_LANES} seeds")
    valid = all(is_integer(seed) and 0 <= seed < 2**31 for seed in chosen)
    check(valid, "seeds", chosen, "integers from 0 to 2147483647")
    check(len(set(chosen)) == len(chosen), "seeds", chosen, "all different")
    fine = window is None or (is_integer(window) and 1 <= window <= MAX_TALLY_DECISIONS)
    check(fine, "window", window, f"an integer from 1 to {MAX_TALLY_DECISIONS:,} decisions")
    for name, seconds in (("checkpoint_every", checkpoint_every), ("give_up_after", give_up_after)):
        check(isinstance(seconds, int | float | np.number) and seconds >= 0, name, seconds, "at least 0 seconds")
    valid = is_integer(threads) and 0 <= threads <= MAX_THREADS
    check(valid, "threads", threads, f"0 for one per processor, or a number of at most {MAX_THREADS}")
    shared = envs if is_integer(envs) and envs > 0 else 1
    choice = None
    if isinstance(agent, Learner):
        learner = agent
    else:
        choice = choice_for(task, {**(agent or {}), **dict.fromkeys(swept_names(sweep))}, steps=int(steps), envs=shared)
        learner = agent_for(task, agent, preset=None if choice is None else choice.preset, steps=int(steps))
    own_window = -(-max(1, int(steps) // 200) // shared) * shared
    chosen_window = int(own_window if window is None else window)
    _check_envs(envs, workers, task, learner, {"steps": int(steps), "window": chosen_window})
    compiled = not isinstance(task, HostTask) or not isinstance(learner, SparseLearner)
    check(compiled, "task", task.name, "a task in a JAX world for a sparse agent")
    policy = jax.eval_shape(learner.init, jax.random.key(0)).policy
    validate(task, policy)
    check_scores(learner, policy)
    validate_needs(task, check_rounded(learner, learner.precision))
    own = None if initial is None else check_initial(initial, policy, len(chosen))
    settings = [] if sweep is None else sweep_settings(sweep, task, learner)
    lanes = len(chosen) * max(1, len(settings))
    check(
        lanes <= MAX_LANES, "sweep", f"{len(settings)} settings of {len(chosen)} seeds", f"at most {MAX_LANES} in all"
    )
    every = [int(seed) for seed in chosen]
    how = (chosen_window, int(envs), int(workers), choice)
    return TrainingArguments(task, learner, int(steps), every, own, settings, *how)


def _check_envs(envs: int, workers: int, task: Task, agent: Learner, decisions: Mapping[str, int]) -> None:
    """Refuse several environments where they cannot feed one learner, and numbers of decisions that do not divide."""
    valid = is_integer(envs) and 1 <= envs <= MAX_ENVS
    check(valid, "envs", envs, f"from 1 to {MAX_ENVS} environments of each learner")
    valid = is_integer(workers) and 0 <= workers <= MAX_THREADS
    check(valid, "workers", workers, f"0 to step environments in this process, or at most {MAX_THREADS} processes")
    check(workers == 0 or isinstance(task, Gymnasium), "workers", workers, f"0 for the task {task.name!r}")
    if envs == 1:
        return
    on_host = isinstance(task, HostTask)
    check(on_host, "envs", envs, f"1 for the task {task.name!r}, whose world is compiled; it learns from more seeds")
    single = agent.needs.single_stream
    check(single is None, "envs", envs, f"1 for {single}")
    check(
        hasattr(agent, "restart"), "envs", envs, f"1 for {type(agent).__name__}, which has no function restart(state)"
    )
    for name, number in decisions.items():
        more = -(-number // envs) * envs
        check(more == number, name, number, f"a multiple of envs = {envs}, all of which it counts, such as {more}")


def check_initial(initial: Policy, like: Policy, seeds: int) -> Policy:
    """The policies from which the seeds start, along a leading axis, in the dtypes of the agent's policy, one of which
    has the shapes of `like`. **Raises** `ValueError` that names the field that is not finite or of another structure or
    shape."""
    wanted = "policies of all seeds along a leading axis, such as the policies of a run, or None"
    check(isinstance(initial, Policy), "initial", initial, wanted)
    kinds = [type(policy).__name__ for policy in (initial, like)]
    check(type(initial) is type(like), "initial", kinds[0], f"of the kind of the agent's policy, {kinds[1]}")
    interface = initial.interface
    initial = with_interface(initial, None)
    places = [dict(jax.tree_util.tree_leaves_with_path(policy)) for policy in (initial, like)]
    parts = [sorted(map(path_of, place)) for place in places]
    check(parts[0] == parts[1], "initial", parts[0], f"of the parts of the agent's policy, {parts[1]}")

    def fitting(place: KeyPath, leaf: jax.ShapeDtypeStruct) -> jax.Array:
        name = f"initial.{path_of(place)}"
        given = places[0][place]
        check(np.shape(given) == (seeds, *leaf.shape), f"{name}.shape", np.shape(given), f"{(seeds, *leaf.shape)}")
        return jnp.asarray(given, leaf.dtype)

    found = jax.tree_util.tree_map_with_path(fitting, like)
    for place, leaf in jax.tree_util.tree_leaves_with_path(trainable(found)):
        finite = bool(jnp.isfinite(leaf).all())
        check(finite, f"initial.{path_of(place)}", "not all finite", "finite numbers")
    if interface is None or interface.statistics is None:
        return with_interface(found, interface)
    shapes, statistics = interface.shapes.statistics, interface.statistics
    for place, (given, one) in enumerate(zip(jax.tree.leaves(statistics), jax.tree.leaves(shapes), strict=True)):
        wanted = (seeds, *one.shape)
        check(np.shape(given) == wanted, f"initial.interface.statistics, array {place}", np.shape(given), f"{wanted}")
    interface.check_statistics("initial.interface.statistics")
    numbers = jax.tree.map(lambda given, one: jnp.asarray(given, one.dtype), statistics, shapes)
    return with_interface(found, interface.with_statistics(numbers))
