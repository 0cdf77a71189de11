"""A run: the result of training, in memory or loaded from its directory."""

import copy
import dataclasses
import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pyarrow as pa
from jax.flatten_util import ravel_pytree
from jax.typing import ArrayLike
from jaxtyping import Bool, Float, Int, PyTree

from motorgrad._arrow import numbers_in
from motorgrad._errors import check, choice, counted, unknown
from motorgrad.learning import Learner
from motorgrad.policies import Actor, Masked, Policy, abilities, split, with_interface
from motorgrad.schema import numbers_of
from motorgrad.statistics import first_time
from motorgrad.tasks import TASKS, Task, make
from motorgrad.training._agents import agent_from_table
from motorgrad.training._broken import not_finite
from motorgrad.training._sweep import setting_text
from motorgrad.training._trust import check_imports
from motorgrad.training.plots import Axis, Format, axis_for, curve_of, learning_curves, mean_of_last
from motorgrad.training.store import RunDirectory, RunDirectoryError, RunWarning, fill_tree, part_of

if TYPE_CHECKING:
    from motorgrad.training.plots._plot_figure import LearningCurves


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Run:
    """The outcome of training.

    - `config`: the effective configuration, as in `config.toml`.
    - `decision`: the number of decisions made per seed; `complete`, whether the run is finished.
    - `metrics`: a table of records (`docs/training.md` has its columns).
    - `policies`: the policies of all seeds, stacked along a leading axis, with averaged parameters where the learner
      has `PolyakAveraging`; `initial`, the same before learning. Their `interface` says what observations and actions
      mean, and has the running statistics of observations.
    - `gradient`: for estimators that batch, the mean of the gradient samples since the last step, of all seeds: with
      `gpomdp`, the estimate itself; NaN where there are none. `None` for online learners.
    - `path`: the run directory, `None` for a run in memory.
    - `broken`: which policies are not finite.

    In a sweep, every leading axis has all seeds of the first of the `settings`, then those of the second …; `split`
    gives the run of each setting.
    """

    config: dict[str, Any]
    decision: int
    metrics: pa.Table
    policies: Policy
    initial: Policy
    gradient: Policy | None = None
    path: Path | None = None
    _task: Task | None = None
    _trust: bool = False
    _memory: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    _evaluations: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    _critic: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    _actors: dict[int | None, Actor] = dataclasses.field(default_factory=dict, init=False)

    def __repr__(self) -> str:
        done = f"{self.decision:,} of {counted(self.config['run']['steps'], 'decision')}"
        count = counted(len(self.seeds), "seed")
        of = f"{counted(len(self.settings), 'setting')} of {count}" if self.settings else count
        if lost := np.count_nonzero(self.broken):
            done += f", {lost} broken"
        return f"Run({self.config['task']['name']}, {of}, {done}, {self.path or 'in memory'})"

    @property
    def seeds(self) -> list[int]:
        """The seeds, in the order of every leading axis."""
        return self.config["run"]["seeds"]

    @property
    def settings(self) -> list[dict[str, float]]:
        """The settings of a sweep, each a mapping from paths to numbers; empty for other runs."""
        return self.config.get("sweep", [])

    @property
    def lanes(self) -> int:
        """The length of every leading axis: the number of seeds, times that of settings in a sweep."""
        return len(self.seeds) * max(1, len(self.settings))

    def split(self) -> "list[Run]":
        """The run of each of the `settings`, in memory; this run itself where it is no sweep."""
        if not self.settings:
            return [self]
        return [self.of_setting(index) for index in range(len(self.settings))]

    def of_setting(self, index: int) -> "Run":
        """The run of one of the `settings`, in memory."""
        seeds = len(self.seeds)
        rows = slice(index * seeds, (index + 1) * seeds)

        def part(tree: PyTree) -> PyTree:
            return jax.tree.map(lambda leaf: leaf[rows], tree)

        config = {name: value for name, value in self.config.items() if name != "sweep"}
        config["agent"] = _with_setting(config["agent"], self.settings[index])
        metrics = self.metrics
        if metrics.num_rows:
            import pyarrow.compute as pc  # most runs have no settings, and it takes a while to load

            metrics = metrics.filter(pc.field("setting") == index).drop_columns(["setting"])
        memory = {name: array[rows] for name, array in self._memory.items()}
        found = {name: each if name == "decision" else each[rows] for name, each in self._evaluations.items()}
        return dataclasses.replace(
            self,
            config=config,
            metrics=metrics,
            policies=part(self.policies),
            initial=part(self.initial),
            gradient=None if self.gradient is None else part(self.gradient),
            path=None,
            _memory=memory,
            _evaluations=found,
            _critic={name: array[rows] for name, array in self._critic.items()},
        )

    def best(self) -> "Run":
        """The run with the policy of each seed that did best while training, where `KeepBest` was among its callbacks.
        `best_at` says after which decision each policy was kept, and `best_value` with which mean. The records are
        those of the whole run. **Raises** `ValueError` where none was kept."""
        kept = part_of(self._found_evaluations(), "best")
        check(kept, "best", self, "of a run that kept it: train(..., callbacks=mg.training.KeepBest())")
        policies = fill_tree(self.policies, part_of(kept, "policy"))
        return dataclasses.replace(self, policies=policies, _memory=part_of(kept, "memory"))

    @property
    def complete(self) -> bool:
        """Whether all decisions were made; if not, the same call of `train` continues the run."""
        return self.decision >= self.config["run"]["steps"]

    @property
    def task(self) -> Task:
        """The task, rebuilt from the configuration where the run was loaded. **Raises** `NotTrusted` where that imports
        a module, and `load` was not told to `trust` the run."""
        return saved_task(self.config, self.path, self._trust) if self._task is None else self._task

    @property
    def broken(self) -> Bool[np.ndarray, " lanes"]:
        """Which policies have parameters that are not finite: they have learned nothing, and act on nothing."""
        return not_finite(self.policies)

    def with_task(self, task: Task) -> "Run":
        """The run in a changed task, to evaluate its policies on other ground or without a time limit. Policies and
        `config` stay as they are. **Raises** `ValueError` for a task of another kind, or with other observations or
        actions.

        ```python
        import dataclasses

        run = mg.train("hexapod-synergy", steps=160, progress=False)
        bumpy = dataclasses.replace(run.task, terrain=mg.bodies.Terrain(difficulty=0.5))
        print(mg.evaluate(run.with_task(bumpy), steps=50))
        ```
        """
        own = self.task
        check(type(task) is type(own), "task", task.name, f"a task of the kind {own.name!r}, as the run's own")
        for name in ("observation_names", "action_size"):
            check(getattr(task, name) == getattr(own, name), f"task.{name}", getattr(task, name), "as the run's own")
        return dataclasses.replace(self, _task=task)

    def evaluated(self, quantity: Literal["return", "length"] = "return") -> tuple[np.ndarray, np.ndarray]:
        """The evaluations that were made while training (`EvaluationCallback`): the decision of each `(evaluations,)`,
        and the means over its episodes `(seeds, evaluations)`, in a sweep of all lanes. **Raises** `ValueError` without
        any."""
        choice("quantity", quantity, ("return", "length"))
        found = self._found_evaluations()
        return found["decision"], found[f"{quantity}s"].mean(axis=2, dtype=float)

    @property
    def evaluations(self) -> pa.Table:
        """The episodes of all evaluations that were made while training, a row for each: `seed`, in a sweep `setting`,
        `decision`, `episode`, `return`, `length`, and whether it `diverged` or was `cut`."""
        found = self._found_evaluations()
        lanes, times, episodes = found["returns"].shape
        lane, time, episode = (each.ravel() for each in np.indices((lanes, times, episodes)))
        seeds = self.config["run"]["seeds"]
        columns = {"seed": np.array(seeds)[lane % len(seeds)]}
        if self.config.get("sweep"):
            columns["setting"] = lane // len(seeds)
        columns |= {"decision": found["decision"][time], "episode": episode}
        names = {"return": "returns", "length": "lengths", "diverged": "diverged", "cut": "cut"}
        return pa.table(columns | {name: found[array].ravel() for name, array in names.items()})

    @property
    def best_at(self) -> Int[np.ndarray, " lanes"]:
        """After how many decisions each of the `best` policies was kept. **Raises** `ValueError` where none was."""
        return self._kept("at")

    @property
    def best_value(self) -> Float[np.ndarray, " lanes"]:
        """The mean over its episodes with which each of the `best` policies was chosen, which is too good an estimate.
        **Raises** `ValueError` where none was."""
        return self._kept("value")

    def _kept(self, name: str) -> np.ndarray:
        found = self._found_evaluations()
        check("best.at" in found, "best", self, "of a run that kept it: train(..., callbacks=mg.training.KeepBest())")
        return found[f"best.{name}"]

    def _found_evaluations(self) -> Mapping[str, np.ndarray]:
        """What evaluations while training found, by name."""
        if not self._evaluations:
            every = self.config["run"].get("evaluate_every")
            why = (
                "callbacks=mg.training.EvaluationCallback() makes some"
                if every is None
                else f"the first is due at {every:,} decisions, and {self.decision:,} were made"
            )
            raise ValueError(f"{self.path or 'the run'}: has no evaluations: {why}")
        return self._evaluations

    @property
    def critic(self) -> Mapping[str, np.ndarray]:
        """What the baseline or critic of the learner knew at the end, by path, lanes leading; empty without one."""
        return self._critic

    @property
    def memory(self) -> Any:
        """The memory of the task at the end, seeds leading, such as the scale of observations; `None` without one."""
        if not self._memory:
            return None
        task, seeds = self.task, self.lanes
        one = jax.eval_shape(task.init, jax.ShapeDtypeStruct((task.init_uniforms,), np.float32))
        template = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct((seeds, *leaf.shape), leaf.dtype), one)
        if self.config["run"].get("envs", 1) == 1:
            return fill_tree(template, self._memory)
        sizes = {name: leaf.ndim for name, leaf in numbers_of(template).items()}
        # of several environments the first: what outlives an episode, such as the scale of observations, is shared
        first = {name: array[:, 0] if array.ndim > sizes[name] else array for name, array in self._memory.items()}
        return fill_tree(template, first)

    def policy(self, seed: int | None = None) -> Policy:
        """The learned policy of one seed, by default the first. A sweep has one for each setting: `split` it first. Its
        `act`, and what `export` writes, take raw observations and give raw actions, in the environment's units. It
        warns (`RunWarning`) where this is unknown."""
        check(not self.settings, "policy", self, "of a run of one setting: run.split()[0].policy()")
        seed = self.seeds[0] if seed is None else seed
        check(seed in self.seeds, "seed", seed, f"one of the run's seeds, {self.seeds}")
        row = self.seeds.index(seed)
        return jax.tree.map(lambda leaf: jax.numpy.asarray(leaf[row]), self.whole_policies)

    @property
    def whole_policies(self) -> Policy:
        """The `policies` with their interface, made again where an earlier version stored the run without it."""
        policies = self.policies
        if policies.interface is not None:
            return policies
        try:
            task = self.task
            interface = task.interface(jax.tree.map(lambda leaf: leaf[0], policies).actions)
            statistics = task.statistics(self.memory) if self._memory else None
        except (ValueError, RuntimeError) as error:
            why = " ".join(str(error).split())
            warnings.warn(
                f"{self.path or 'the run'}: its policies are without their interface: they see observations as the "
                f"task scales them, and `act` refuses: {why}",
                RunWarning,
                stacklevel=3,
            )
            return policies
        return with_interface(policies, interface.with_statistics(statistics))

    def act(self, observation: ArrayLike, seed: int | None = None, uniforms: ArrayLike | None = None) -> np.ndarray:
        """The raw action of a seed's policy, by default the first's, for a raw observation, both as the environment has
        them; see `Policy.act`. **Raises** `ValueError` for a policy with a memory; `actor` keeps it.

        ```python
        environment = gymnasium.make("Pendulum-v1")
        observation, _ = environment.reset(seed=1)
        observation, *_ = environment.step(run.act(observation, seed=0))
        ```
        """
        actor = self.actor(seed)
        wanted = "without a memory; run.actor(seed) keeps it: actor = run.actor(), actor.act(observation)"
        check(not abilities.has_memory(actor.policy), "policy", type(actor.policy).__name__, wanted)
        return actor.act(observation, uniforms)

    def actor(self, seed: int | None = None) -> Actor:
        """What acts in the environment itself by a seed's policy, and keeps its memory: `Actor(run.policy(seed))`."""
        actors = self._actors
        if seed not in actors:
            actors[seed] = Actor(self.policy(seed))
        return actors[seed] if not abilities.has_memory(actors[seed].policy) else Actor(actors[seed].policy)

    def policies_at(self, records: Iterable[int] | None = None, seed: int | None = None) -> Any:
        """The policies at some `records`, numbered from 0, or from the end if negative, by default all: a policy whose
        arrays have leading axes `(records, seeds, …)`, or, with a `seed`, `(records, …)`. Where parameters are
        averaged, they are those that learn, not their average.

        ```python
        run = mg.train("linear-recruitment", steps=2_000, seeds=4, progress=False)
        print(run.policies_at().threshold.shape)  # → (200, 4, 4)
        ```
        """
        check(seed is None or seed in self.seeds, "seed", seed, f"one of the run's seeds, {self.seeds}")
        check(seed is None or not self.settings, "seed", seed, "none for a sweep: split it first")
        lanes = np.arange(self.lanes) if seed is None else np.array([self.seeds.index(seed)])
        total = self.metrics.num_rows // self.lanes
        which = np.arange(total) if records is None else np.asarray(list(records), int)
        inside = bool(np.all((-total <= which) & (which < total)))
        check(inside, "records", which.tolist(), f"among the {total} records of the run")
        column = self.metrics["parameters"].combine_chunks()
        numbers = column.flatten().to_numpy().reshape(total, self.lanes, -1)[which][:, lanes]
        # the statistics of observations are known at the end alone
        initial = jax.tree.map(lambda leaf: jnp.asarray(leaf[lanes]), with_interface(self.initial, None))
        policies: Any = jax.vmap(jax.vmap(_with_numbers), (None, 0))(initial, jnp.asarray(numbers))
        if "units" in self.metrics.column_names:
            policies = _switched(policies, self.curve("units")[1][lanes][:, which].T)
        return policies if seed is None else jax.tree.map(lambda leaf: leaf[:, 0], policies)

    def curve(
        self, quantity: str = "reward", *, x: Axis = "decisions", smooth: float | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """A column of the metrics over time: the end of each record `(records,)` and its values `(seeds, records)`, in
        a sweep of all lanes. **Raises** `ValueError` for an unknown column, for simulated time of a task that has none,
        and where there are no records yet.

        **Arguments:**

        - `quantity`: the column.
        - `x`: what time is: `"decisions"`, `"simulated"`, `"wall"` or `"cpu"` seconds.
        - `smooth`: if given, each value is the mean over the last `smooth` units of `x`, of all that occurred there,
          and over two records at least.
        """
        if x != "decisions" or smooth is not None:
            axis = axis_for([self], x)
            window = self.config["run"]["window"]
            record = {"decisions": window, "simulated": window * self.task.period, "wall": 0.0, "cpu": 0.0}[axis]
            found = curve_of(self, quantity, axis, None if smooth is None else max(smooth, 2 * record), "")
            return found.x, found.values
        if not self.metrics.num_rows:
            where = self.path or "the run"
            window = self.config["run"]["window"]
            raise ValueError(
                f"{where} has no records yet: one takes {counted(window, 'decision')}, it has made {self.decision:,}"
            )
        known = [c for c in self.metrics.column_names if c not in ("seed", "setting", "decision", "parameters")]
        if quantity not in known:
            raise unknown("quantity", quantity, known)
        decision = numbers_in(self.metrics["decision"])[:: self.lanes]
        values = numbers_in(self.metrics[quantity]).astype(float).reshape(-1, self.lanes).T
        return decision, values

    def final(self, quantity: str = "reward", share: float = 0.25) -> np.ndarray:
        """Mean of a quantity over all that occurred in the last `share` of the records, `(seeds,)`, such as the mean
        return of all episodes that ended in them; NaN where it occurred in none (an episode may be longer: take a
        larger share), and for policies that are not finite."""
        check(0 < share <= 1, "share", share, "above 0, at most 1")
        records = len(self.curve(quantity)[0])
        return mean_of_last(self, quantity, max(1, round(share * records)))

    def ranked(self, quantity: str = "reward", *, share: float = 0.25, larger_is_better: bool = True) -> "list[Run]":
        """The run of each of the `settings`, the best first.

        Settings compare by the mean over seeds of `final(quantity, share)`. Those with a seed whose policy is not
        finite, or in which the quantity did not occur, come last, which a `RunWarning` says.

        ```python
        swept = mg.train("three-state", steps=2_000, seeds=4, sweep={"learning_rate": [0.01, 0.1]}, progress=False)
        best = swept.ranked()[0]
        ```
        """
        runs = self.split()
        means = np.array([run.final(quantity, share).mean() for run in runs])
        if (lacking := np.flatnonzero(~np.isfinite(means))).size:
            settings = self.settings or [{}]
            said = []
            for place in lacking:
                broken = np.count_nonzero(runs[place].broken)
                lost = f"{broken} of {counted(runs[place].lanes, 'seed')} not finite"
                why = lost if broken else "it did not occur with every seed"
                said.append(f"{setting_text(settings[place])} ({why})")
            more = f" and {len(said) - 5} more" if len(said) > 5 else ""
            warnings.warn(
                f"ranked last, as {quantity} is unknown: {'; '.join(said[:5])}{more}", RunWarning, stacklevel=2
            )
        worth = np.where(np.isfinite(means), means if larger_is_better else -means, -np.inf)
        return [runs[place] for place in np.argsort(-worth, kind="stable")]

    def first_time(
        self,
        quantity: str = "reward",
        *,
        above: float | None = None,
        below: float | None = None,
        x: Axis = "decisions",
        smooth: float | None = None,
        never: float = math.nan,
    ) -> np.ndarray:
        """When a quantity first passed a bar, `above` or `below`, `(seeds,)`: the end of the first record in which it
        did; `never` for a seed in which it did not. `x` and `smooth` are as in `curve`. Nothing counts before `smooth`,
        when the mean would be over fewer records.

        ```python
        run = mg.train("three-state", steps=20_000, seeds=4, progress=False)
        print(np.median(run.first_time("reward", above=0.7, smooth=1_000)))
        ```
        """
        check((above is None) != (below is None), "above, below", (above, below), "one of the two")
        time, values = self.curve(quantity, x=x, smooth=smooth)
        passed = values > above if below is None else values < below
        return first_time(time, passed & (time >= min(smooth or 0, time[-1])), never)

    def plot(
        self,
        quantity: str | Sequence[str] = "reward",
        path: Path | str | None = None,
        *,
        x: Axis | None = None,
        smooth: float | None = None,
        labels: Sequence[str] | None = None,
        format: Format | None = None,
    ) -> "LearningCurves":
        """The learning curve: every seed, their median and their interquartile band; a colour for each setting of a
        sweep; see `learning_curves`. Saved to `path`, by default to `figures/` of the run directory if there is one. In
        a notebook it shows itself."""
        if path is None and self.path is not None:
            path = self.path / "figures"
            path.mkdir(exist_ok=True)
        return learning_curves(self.split(), quantity, path, x=x, smooth=smooth, labels=labels, format=format)


def _with_numbers(policy: Policy, numbers: Float[jax.Array, " parameters"]) -> Policy:
    """The policy with these parameters."""
    learned, fixed = split(policy)
    return eqx.combine(ravel_pytree(learned)[1](numbers), fixed)


def _switched(policies: Masked, units: Float[np.ndarray, "records lanes"]) -> Any:
    """Growing pools with this number of active units: growth activates the first inactive unit."""
    start = np.asarray(policies.active)
    place_in_queue = np.cumsum(~start, axis=-1) * ~start
    active = place_in_queue <= (units - start.sum(-1))[..., None]
    return eqx.tree_at(lambda each: each.active, policies, jnp.asarray(active))


def _with_setting(agent: dict[str, Any], setting: Mapping[str, float]) -> dict[str, Any]:
    """An agent's table with the numbers of a setting."""
    found = copy.deepcopy(agent)
    for path, value in setting.items():
        *outer, last = path.split(".")
        node = found
        for name in outer:
            node = node[name]
        node[last] = value
    return found


def saved_task(config: dict[str, Any], path: Path | str | None = None, trust: bool = False) -> Task:
    """The task of a run's configuration. A run that this user made, on this machine, is trusted to import what its task
    names. **Raises** `RunDirectoryError` for one that is not in the registry, `NotTrusted` for one that imports a
    module."""
    ours = path is not None and RunDirectory(path).is_ours(config["task"])
    check_imports(config["task"], "the run" if path is None else str(path), trust or ours)
    settings = dict(config["task"])
    name = settings.pop("name")
    if name not in TASKS:
        raise RunDirectoryError(
            f"task {name!r} is not in the registry: in Python, give the task itself, as load(path, task); on the "
            "command line, import the module that registers it, as motorgrad --import MODULE evaluate RUN"
        )
    try:
        return make(name, **settings)
    except ValueError as error:
        raise ValueError(str(error) if path is None else f"{path}/config.toml: {error}") from None


def saved_agent(task: Task, settings: dict[str, Any], where: str) -> Learner:
    """The learner of a run's configuration. **Raises** `RunDirectoryError` where a part of it was made in Python."""
    try:
        return agent_from_table(task, settings, where)
    except ValueError as error:
        raise RunDirectoryError(f"{error}: train(task, agent, out=...)") from None
