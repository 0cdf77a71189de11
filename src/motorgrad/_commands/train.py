"""`motorgrad train TASK`: learn."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad._commands._configuration import fill, read, resolve, take
from motorgrad._commands._shared import in_words, summary, write_json
from motorgrad._commands._task_options import policy_of, task_of, with_learner
from motorgrad._errors import check
from motorgrad._files import check_writable
from motorgrad._settings import as_hinted, table
from motorgrad.tasks import TASKS
from motorgrad.training import (
    Run,
    RunDirectoryError,
    check_tensorboard,
    check_training,
    given_initial,
    settings_for,
    settled,
    train,
)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of `motorgrad train`, beside those of the task and of the agent."""

    steps: int = 100_000
    """Decisions per seed."""
    seeds: int | tuple[int, ...] = 1
    """How many seeds, numbered from --first-seed; or two and more seeds themselves."""
    first_seed: int = 0
    """The first seed."""
    out: Path | None = None
    """The run directory, by default runs/TASK. An unfinished run found there goes on."""
    resume: Path | None = None
    """Go on with the run in this directory, with its own task, learner, seeds and steps; in place of TASK and --out."""
    window: int | None = None
    """Decisions per record of the metrics; by default a two-hundredth of the steps."""
    checkpoint_every: float = 30.0
    """Seconds between checkpoints."""
    threads: int = 0
    """Threads that work on bodies; 0 for one per processor."""
    tensorboard: bool = False
    """Keep TensorBoard event files in tensorboard/ of the run directory, up to date with every checkpoint."""
    json: Path | None = None
    """Also write the result to this file, for machines; - for the standard output."""

    def __post_init__(self: Any) -> None:
        object.__setattr__(self, "agent", settled(self.agent, settings_for(self.task, policy=self.agent.policy)))

    def validate(self: Any) -> None:
        check(self.resume is None, "resume", str(self.resume), "an option of the command line")
        one_way = self.first_seed == 0 or isinstance(self.seeds, int)
        check(one_way, "first_seed", self.first_seed, "0 where the seeds themselves are given")
        check_training(*self.learning, window=self.window, checkpoint_every=self.checkpoint_every, threads=self.threads)
        check_writable("out", self.directory, folder=True)
        if self.tensorboard:
            check_tensorboard()

    @property
    def learning(self: Any) -> tuple[Any, Any, int, Any]:
        """Task, agent, steps and seeds, as `train` takes them."""
        many = isinstance(self.seeds, int) and self.first_seed
        seeds = range(self.first_seed, self.first_seed + self.seeds) if many else self.seeds
        return self.task, self.agent, self.steps, seeds

    @property
    def directory(self: Any) -> Path:
        return self.out or Path("runs") / self.task.name

    def effective(self: Any) -> dict[str, Any]:
        values = table(self)
        return {**values, "task": {"name": self.task.name, **values["task"]}}


def run(arguments: list[str]) -> int:
    given = read(_resumed(arguments))
    about = given.table.get("run")
    begun = isinstance(about, dict) and "initial" in about
    name, given = task_of(given)
    if name is None:
        asked = set(arguments) & {"-h", "--help"}
        check(asked or not arguments, "the first word", arguments[:1], "the task's name: motorgrad train TASK ...")
        print(f"usage: motorgrad train TASK [options]\n\ntasks: {', '.join(TASKS)}\n")
        print("motorgrad train TASK --help lists the options of a task and of its learner.")
        return 0 if asked else 2
    # The learner's defaults are those of the task and of the policy that are asked for, so these are found out first.
    about_task = any(argument.startswith("--task") for argument in given.rest)
    settings = {key: value for key, value in given.table.items() if key == "task"}
    draft = given._replace(table=settings, rest=given.rest if about_task else [])
    asked = fill(_command(TASKS[name]()), draft, f"train {name}").get("task", {})
    task = as_hinted(TASKS[name], asked, "task")
    options = resolve(_command(task, policy_of(given)), given, f"train {name}")
    initial = given_initial(options.directory)
    if begun and initial is None:
        how = "go on with it by --resume, or begin another in Python, train(..., initial=...)"
        raise ValueError(f"{given.file}: run.initial: this run began from policies that it was given: {how}")
    result = train(
        *options.learning,
        options.directory,
        window=options.window,
        checkpoint_every=options.checkpoint_every,
        threads=options.threads,
        tensorboard=options.tensorboard,
        initial=initial,
    )
    found = _result(result)
    if str(options.json) != "-":
        _say(result, found, options.directory)
    write_json(options.json, found)
    return 0 if result.complete else 130


def _command(task: Any, policy: dict[str, str] | None = None) -> type[Options]:
    """The options with those of a task and of the learner that goes with it, and with a policy."""
    return with_learner(Options, "Train", "Learn", task, policy)


def _resumed(arguments: list[str]) -> list[str]:
    """`--resume RUN` in the words that it stands for: the run's own configuration, in its own directory."""
    path, rest = take("resume", arguments)
    if path is None:
        return arguments
    if rest and not rest[0].startswith("-"):
        raise ValueError(f"--resume {path}: says which task, so leave out {rest[0]!r}")
    for option in ("config", "out"):
        if take(option, rest)[0] is not None:
            raise ValueError(f"--resume {path}: says what --{option} would")
    if not (Path(path) / "config.toml").is_file():
        raise RunDirectoryError(f"{path} is not a run directory: it has no config.toml")
    return ["--config", f"{path}/config.toml", "--out", path, *rest]


def _result(run: Run) -> dict[str, Any]:
    """The last tenth of the run, per seed."""
    skipped = {"seed", "decision", "simulated_time", "wall_time", "parameters", "baseline"}
    found: dict[str, Any] = {
        "task": run.task.name,
        "path": str(run.path),
        "decisions": run.decision,
        "complete": run.complete,
        "simulated_time": run.decision * run.task.period,
        "wall_time": float(run.metrics["wall_time"][-1].as_py()) if run.metrics.num_rows else 0.0,
    }
    for name in run.metrics.column_names:
        if name not in skipped and run.metrics.num_rows:
            values = run.curve(name)[1]
            last = values[:, -max(1, values.shape[1] // 10) :]
            counted = name.endswith("_count") or name in ("episodes", "diverged")
            with np.errstate(invalid="ignore"):
                mean = np.nansum(last, axis=1) / np.isfinite(last).sum(axis=1)
            found[f"{name}_total" if counted else name] = summary(values.sum(axis=1) if counted else mean)
    return found


def _say(run: Run, found: dict[str, Any], out: Path) -> None:
    done = "done" if run.complete else "stopped"
    print(f"{done} after {run.decision:,} decisions per seed; means over the last tenth of the records, and totals:")
    for name, value in found.items():
        # A count of occurrences is for machines; divergences are said if there were any.
        quiet = name.endswith("_count_total") or (name == "diverged_total" and not any(value["per_seed"]))
        if isinstance(value, dict) and not quiet:
            print(f"  {in_words(name.replace('_', ' '), value)}")
    print(f"saved in {out}")
    if not run.complete:
        print("the same command goes on where it stopped")
    else:
        print(f"next: motorgrad plot {out}    motorgrad evaluate {out}")
