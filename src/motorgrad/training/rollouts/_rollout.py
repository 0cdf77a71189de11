"""Rolling out policies: who acts, how long, and on which random numbers."""

import dataclasses
import importlib.metadata
import math
import numbers
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self

import jax
import numpy as np
from jaxtyping import PyTree

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, check_integer, check_positive, choice
from motorgrad._random import key_of
from motorgrad.learning import Agent, Learner
from motorgrad.policies import Policy
from motorgrad.tasks import BodyTask, Task
from motorgrad.training._arguments import check_training
from motorgrad.training._broken import lanes_in_words, not_finite
from motorgrad.training._episodes import MAX_EPISODE_DECISIONS, MAX_EPISODES, TOGETHER, decision_seeds, evaluation_seeds
from motorgrad.training._load import load
from motorgrad.training._run import Run
from motorgrad.training.engines import MAX_TALLY_DECISIONS, stepper_for
from motorgrad.training.rollouts._columns import Columns, columns_of, joined
from motorgrad.training.rollouts._probes import probe_of
from motorgrad.training.rollouts._recording import Recording
from motorgrad.training.rollouts._table import Rollout, table_of
from motorgrad.training.rollouts._value import Values, values_of
from motorgrad.training.store import RunWarning


def rollout(
    run: Run | Task | Path | str,
    agent: Learner | Policy | Mapping[str, Any] | None = None,
    *,
    steps: int | None = None,
    seconds: float | None = None,
    episodes: int | None = None,
    seeds: int | Sequence[int] | None = None,
    seed: int = 0,
    mode: Literal["sample", "mode"] = "sample",
    every: Literal["decision", "step"] = "decision",
    untrained: bool = False,
    threads: int = 0,
    trust: bool = False,
    allow_changed: bool = False,
) -> Rollout:
    """Let policies act without learning, and record what happens at every moment in a table.

    All that happens is what `evaluate` sees with the same `steps` or `episodes`, `seed` and `mode`.

    **Arguments:**

    - `run`: a run, or the directory of one; or a task, or its name.
    - `agent`: for a task: the learner whose initial policies act, as in `train`; or a policy, for all seeds.
    - `steps`, `seconds`, `episodes`: how long, one of the three, for each seed: decisions; simulated seconds, rounded
      up to whole decisions; or whole episodes, each in dynamics of its own.
    - `seeds`: of a run, those of its seeds whose policies act, by default all; of a task, their number or a list of
      them, by default one.
    - `seed`: of the random numbers, at least 0.
    - `mode`: `"sample"` draws every action; `"mode"` takes the most probable one.
    - `every`: a row for every `"decision"`, or for every `"step"` of the physics of a body.
    - `untrained`: of a run, the policies as they were before learning.
    - `threads`: as in `train`.
    - `trust`, `allow_changed`: as in `load`, for a directory.

    Seeds whose policy is not finite are left out, with a warning. Of a task without a limit, an episode is cut after
    100,000 decisions, with a warning.

    **Raises:** `ValueError` for arguments that do not go together, for episodes of a task without any, where no policy
    is finite, and for a table of more than 4 GiB.

    ```python
    reach = mg.rollout("composed", seconds=1.0)
    print(reach["muscle force: elbow flexor"].shape, reach.units["muscle force: elbow flexor"])  # → (51,) N
    ```
    """
    check_arguments(rollout, locals(), ("seeds", "untrained", "trust", "allow_changed"))
    choice("mode", mode, ("sample", "mode"))
    choice("every", every, ("decision", "step"))
    check_integer("seed", seed, 0, 2**31 - 1)
    acting = _acting(run, agent, seeds, untrained, trust, allow_changed)
    task = acting.task
    readings = 1
    if every == "step":
        check(isinstance(task, BodyTask), "every", every, f"'decision': the task {task.name!r} has no body")
        readings = task.substeps  # type: ignore[attr-defined]
    decisions = _decisions(task, steps, seconds, episodes)
    acting = acting.finite()
    if episodes is None:
        chosen = np.array(decision_seeds(acting.seeds, seed))
    else:
        chosen = evaluation_seeds(acting.seeds, seed, episodes).ravel()
    lanes = np.repeat(np.arange(len(acting.seeds)), episodes or 1)
    found: list[Columns] = []
    for first in range(0, len(lanes), TOGETHER):
        part = slice(first, first + TOGETHER)
        found += acting.recorded(lanes[part], chosen[part].tolist(), decisions, episodes, mode, readings, threads)
    for place, columns in enumerate(found):
        if episodes is not None:  # a lane has one episode
            columns["episode"] = np.full_like(columns["episode"][0], place % episodes), "1"
    about = {"task": task.name, "mode": mode, "seconds between rows": repr(task.period / readings)}
    about["motorgrad"] = importlib.metadata.version("motorgrad")
    return table_of(joined(found), about)


@dataclasses.dataclass(frozen=True)
class _Acting:
    """Who acts: the `policies` of the `seeds`, along a leading axis, with the `memory` of the task, where they learned;
    `values` of what they see, where a run knows any."""

    task: Task
    policies: Policy
    seeds: list[int]
    memory: PyTree = None
    values: Values | None = None

    def finite(self) -> Self:
        """Those whose policy is finite; a warning says whose are not."""
        broken = not_finite(self.policies)
        if not broken.any():
            return self
        message = f"{lanes_in_words(broken, self.seeds, [])}: parameters that are not finite"
        check(not broken.all(), "policies", message, "at least one that is finite")
        warnings.warn(f"{message}; left out of the table", RunWarning, stacklevel=3)
        return self.of(np.flatnonzero(~broken))

    def of(self, rows: np.ndarray) -> Self:
        """Some of them."""
        memory = None if self.memory is None else _of_rows(self.memory, rows)
        values = None if self.values is None else self.values.of_rows(rows)
        seeds = [self.seeds[row] for row in rows]
        return dataclasses.replace(
            self, policies=_of_rows(self.policies, rows), seeds=seeds, memory=memory, values=values
        )

    def recorded(
        self,
        lanes: np.ndarray,
        seeds: list[int],
        decisions: int,
        episodes: int | None,
        mode: Literal["sample", "mode"],
        readings: int,
        threads: int,
    ) -> list[Columns]:
        """The columns of the policies of these `lanes`, each on the random numbers of its own of the `seeds`."""
        task = self.task
        acting = self.of(lanes)
        agent = Agent(jax.tree.map(lambda leaf: leaf[0], acting.policies))
        stepper = stepper_for(task, agent, seeds, mode, threads)
        stepper.set_policies(acting.policies, acting.memory)
        every = None if readings == 1 else 1
        recording = Recording(stepper, probe_of(stepper, task, every, threads), readings)
        recording.run(decisions, episodes is not None)
        cut = 0
        found = []
        for lane in range(len(lanes)):
            ended = recording.ended[:, lane]
            if episodes is not None:
                over = np.flatnonzero(ended)
                cut += not len(over)
                ended = ended[: over[0] + 1] if len(over) else ended
            found.append(columns_of(recording, lane, ended, acting.seeds[lane], acting.values))
        if cut:
            message = f"{cut:,} of {len(lanes):,} episodes were not over after {decisions:,} decisions"
            warnings.warn(f"{message}, and are cut there; give the task a time limit", RunWarning, stacklevel=4)
        return found


def _of_rows(tree: PyTree, rows: np.ndarray) -> PyTree:
    return jax.tree.map(lambda leaf: np.asarray(leaf)[rows], tree)


def _acting(
    run: Run | Task | Path | str,
    agent: Learner | Policy | Mapping[str, Any] | None,
    seeds: int | Sequence[int] | None,
    untrained: bool,
    trust: bool,
    allow_changed: bool,
) -> _Acting:
    """Who acts, of a run or on a task."""
    if isinstance(run, Path) or (isinstance(run, str) and Path(run).is_dir()):
        run = load(run, trust=trust, allow_changed=allow_changed)
    if isinstance(run, Run):
        check(agent is None, "agent", agent, "left out for a run, whose own policies act; give run.task for others")
        check(not run.settings, "run", run, "of one setting, such as run.split()[0]")
        chosen = (
            run.seeds if seeds is None else [int(seeds)] if isinstance(seeds, int | numbers.Integral) else list(seeds)
        )
        for each in chosen:
            check(each in run.seeds, "seeds", each, f"of the run's seeds, {run.seeds}")
        check(len(chosen) == len(set(chosen)) > 0, "seeds", chosen, "at least one, each given once")
        policies = run.initial if untrained else run.policies
        values = None if untrained else values_of(run)
        rows = np.array([run.seeds.index(each) for each in chosen])
        return _Acting(run.task, policies, list(run.seeds), run.memory, values).of(rows)
    check(not untrained, "untrained", untrained, "false for a task: its agent's policies have not learned")
    learner = Agent(agent) if isinstance(agent, Policy) else agent
    checked = check_training(run, learner, seeds=1 if seeds is None else seeds)
    first = jax.jit(jax.vmap(lambda each: checked.agent.init(key_of(each, "initial")).policy))
    return _Acting(checked.task, first(np.asarray(checked.seeds, np.int32)), checked.seeds)


def _decisions(task: Task, steps: int | None, seconds: float | None, episodes: int | None) -> int:
    """The decisions of each lane at most."""
    given = {"steps": steps, "seconds": seconds, "episodes": episodes}
    known = {name: value for name, value in given.items() if value is not None}
    check(len(known) == 1, ", ".join(given), known or None, "one of the three")
    if episodes is not None:
        check_integer("episodes", episodes, 1, MAX_EPISODES)
        wanted = f"None for the task {task.name!r}, which has none; give it a limit"
        check(task.has_episodes, "episodes", episodes, wanted)
        return min(task.longest_episode or MAX_EPISODE_DECISIONS, MAX_TALLY_DECISIONS)
    if seconds is not None:
        check_positive("seconds", seconds)
        steps = math.ceil(seconds / task.period - 1e-9)
        check(steps <= MAX_TALLY_DECISIONS, "seconds", seconds, f"at most {MAX_TALLY_DECISIONS * task.period:g}")
        return max(1, steps)
    check_integer("steps", steps, 1, MAX_TALLY_DECISIONS, "decisions")
    assert steps is not None
    return steps
