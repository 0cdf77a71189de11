"""`motorgrad train TASK`: train a learner."""

import dataclasses
import sys
from pathlib import Path
from typing import Any, ClassVar, Literal

from motorgrad._errors import check, counted, plain
from motorgrad._files import check_writable
from motorgrad._signals import unfinished
from motorgrad.options import (
    HELP,
    HELP_ALL,
    Arguments,
    changes_from_task,
    command_with_learner,
    json_help,
    pop_option,
    read_arguments,
    resolve,
    split_task,
    summary,
    summary_text,
    write_json,
)
from motorgrad.schema import Settings, count, default_of, number, static, table
from motorgrad.tasks import TASKS
from motorgrad.training import (
    MAX_ENVS,
    MAX_EPISODES,
    MAX_STEPS,
    MAX_THREADS,
    PRESETS,
    EvaluationCallback,
    Run,
    agent_table,
    check_tensorboard,
    check_training,
    evaluating_of,
    final_metrics,
    given_initial,
    saved_config,
    setting_text,
    swept_names,
    train,
)


@dataclasses.dataclass(frozen=True)
class Options(Settings):
    """Options of `motorgrad train`, beside those of the task and of the agent."""

    steps: int = count(
        100_000,
        1,
        MAX_STEPS,
        help="The number of decisions per seed, summed over its environments. The schedules of a preset scale with it",
    )
    preset: Literal[tuple(PRESETS)] | None = static(  # type: ignore[valid-type]
        None,
        help="The name of a learner to use in place of the task's own, with the task's policy. Gymnasium "
        'environments use "natural" by default',
    )
    seeds: int | tuple[int, ...] = static(
        1, help="The number of learners, with seeds from --first-seed on; or a list of two or more seeds"
    )
    first_seed: int = count(0, help="The first seed")
    out: Path | None = static(
        None, help="The run directory, by default runs/TASK. Training continues an unfinished run that it finds there"
    )
    resume: Path | None = static(
        None,
        help="Continue the run in this directory with its own task, learner, seeds and steps; replaces TASK and --out",
    )
    sweep: tuple[str, ...] | None = static(
        None,
        help="The settings of the learner to sweep, such as decay=0.9,0.95 learning-rate=1e-3,1e-2. All combinations "
        "learn side by side in one compiled call. In a file: a table of lists, or a list of tables",
    )
    window: int | None = count(
        None, 1, help="The number of decisions per record of the metrics; by default a two-hundredth of the steps"
    )
    checkpoint_every: float = number(30.0, 0, unit="s", help="The wall time between two checkpoints")
    threads: int = count(0, 0, MAX_THREADS, help="The number of threads that step bodies; 0 for one per processor")
    envs: int = count(
        1,
        1,
        MAX_ENVS,
        help="The number of environments that feed the learner of each seed. Steps count the decisions of all",
    )
    workers: int = count(
        0,
        0,
        MAX_THREADS,
        help="The number of processes that step Gymnasium environments; 0 steps them in this one. The results "
        "are the same",
    )
    give_up_after: float = number(
        3600.0,
        0,
        unit="s",
        help="End a run that could not be saved for so long; until then it continues to learn and tries again",
    )
    trust: bool = static(
        False, help="Run code that the run directory or the file of options names: the module of its task"
    )
    allow_changed: bool = static(
        False, help="Continue a run even if its settings or the version of motorgrad changed since it was made"
    )
    evaluate_every: int | None = count(
        None,
        1,
        help="Evaluate in whole episodes while training, at the ends of records, each time so many decisions "
        "have been made. Training is the same as without",
    )
    evaluate_episodes: int = count(10, 1, MAX_EPISODES, help="The number of episodes of each evaluation, per seed")
    evaluate_seed: int = count(1, help="The seed of the random numbers of these episodes")
    evaluate_mode: Literal["sample", "mode"] = static(
        "sample", help="In these episodes, sample draws every action, mode takes the most probable one"
    )
    keep_best: str | None = static(
        None,
        help="Keep the policy of each seed that did best in these episodes, by return, by length or by a "
        "metric of the task",
    )
    keep_least: bool = static(False, help="The best is the one with the least, not the largest")
    tensorboard: bool = static(
        False, help="Write TensorBoard event files to tensorboard/ of the run directory, at every checkpoint"
    )
    common: ClassVar[tuple[str, ...]] = ("steps", "seeds", "out", "resume", "preset", "sweep", "envs", "tensorboard")
    """The options that `--help` shows; `--help-all` shows all."""
    file_sweep: ClassVar[Any] = None
    """The sweep in the file."""
    json: Path | None = static(None, help=json_help())

    def validate(self: Any) -> None:
        check(self.resume is None, "resume", str(self.resume), "an option of the command line")
        counted = self.first_seed == 0 or isinstance(self.seeds, int)
        check(counted, "first_seed", self.first_seed, "0 where the seeds themselves are given")
        check_training(
            *self.learning,
            window=self.window,
            checkpoint_every=self.checkpoint_every,
            threads=self.threads,
            sweep=self.swept,
            give_up_after=self.give_up_after,
            envs=self.envs,
            workers=self.workers,
        )
        check_writable("out", self.directory, folder=True)
        if self.tensorboard:
            check_tensorboard()
        self._check_evaluation()
        for callback in self.callbacks:
            callback.begin(self.task, self.steps)

    def _check_evaluation(self: Any) -> None:
        """Refuse options about evaluations that have no effect without another one."""
        usual = {field.name: default_of(field) for field in dataclasses.fields(self)}
        needed = {"keep_least": "keep_best", "keep_best": "evaluate_every"}
        needed |= {f"evaluate_{name}": "evaluate_every" for name in ("episodes", "seed", "mode")}
        for name, other in needed.items():
            given = getattr(self, name)
            check(given == usual[name] or getattr(self, other) is not None, name, given, f"given with {other}")

    @property
    def callbacks(self: Any) -> tuple[EvaluationCallback, ...]:
        """What evaluates while training, as `train` takes it."""
        found = evaluating_of({**table(self), "keep_best": self.keep_best, "evaluate_every": self.evaluate_every})
        return () if found is None else (found,)

    @property
    def learning(self: Any) -> tuple[Any, Any, int, Any]:
        """Task, agent, steps and seeds, as `train` takes them."""
        many = isinstance(self.seeds, int) and self.first_seed
        seeds = range(self.first_seed, self.first_seed + self.seeds) if many else self.seeds
        return self.task, self.agent, self.steps, seeds

    @property
    def swept(self: Any) -> Any:
        """The sweep, as `train` takes it."""
        if self.sweep is None:
            return self.file_sweep
        check(self.file_sweep is None, "sweep", self.sweep, "given once, here or in the file")
        found = {}
        for word in self.sweep:
            name, equals, values = word.partition("=")
            check(all((name, equals, values)), "sweep", word, "a name and numbers, such as decay=0.9,0.95")
            try:
                found[name.replace("-", "_")] = [float(value) for value in values.split(",")]
            except ValueError:
                raise ValueError(f"sweep = {word!r}: must be a name and numbers, such as decay=0.9,0.95") from None
        return found

    @property
    def directory(self: Any) -> Path:
        return self.out or Path("runs") / self.task.name

    def effective(self: Any) -> dict[str, Any]:
        values = {name: value for name, value in table(self).items() if name != "sweep"}
        values |= {} if self.swept is None else {"sweep": self.swept}
        return {**values, "task": {"name": self.task.name, **values["task"]}, "agent": agent_table(self.agent)}


def run(arguments: list[str]) -> int:
    given = _arguments(arguments)
    about = given.table.get("run")
    from_policies = isinstance(about, dict) and "initial" in about
    if (file := pop_option("task", given.rest)[0]) is not None:
        given.table.setdefault("out", str(Path("runs") / Path(file).stem))
    name, given = split_task(given)
    if name is None:
        asked = set(arguments) & {*HELP, HELP_ALL}
        check(
            asked or not arguments,
            "the first word",
            arguments[:1],
            "the task's name: motorgrad train TASK ..., or --task FILE.toml",
        )
        print("usage: motorgrad train TASK [options]\n       motorgrad train --task FILE.toml [options]\n")
        print(f"tasks: {', '.join(sorted(TASKS))}; or the id of a Gymnasium environment\n")
        print(
            "motorgrad train TASK --help shows the common options; --help-all also those of the task and its learner."
        )
        return 0 if asked else 2
    swept = given.table.get("sweep")
    given = given._replace(table={key: value for key, value in given.table.items() if key != "sweep"})
    kind, given = command_with_learner(
        Options, "Train", "Train a learner", name, given, _swept_names(given.rest, swept)
    )
    kind.file_sweep = swept
    options = resolve(kind, given, f"train {name}")
    initial = given_initial(options.directory)
    if from_policies and initial is None:
        how = "continue it with --resume, or start another in Python, train(..., initial=...)"
        raise ValueError(f"{given.file}: run.initial: this run started from given policies: {how}")
    preset = options.preset if kind.choice is None else kind.choice.preset
    if kind.choice is not None and about is None:  # a stored run has its learner
        print(plain(f"learner: {kind.choice}"), file=sys.stderr)
    if changed := changes_from_task(options.task, options.agent, preset, options.steps):
        said = ", ".join(f"{path} = {value}" for path, value in changed.items())
        rest = f"the rest as the {'preset' if preset else 'task'} has it"
        print(plain(f"learner: that of {preset or name} with {said}; {rest}"), file=sys.stderr)
    task, agent, steps, seeds = options.learning
    own = ("window", "checkpoint_every", "threads", "envs", "workers", "tensorboard", "give_up_after", "allow_changed")
    how = {name: getattr(options, name) for name in own}
    how |= {"sweep": options.swept, "initial": initial, "callbacks": options.callbacks}
    result = unfinished("run", lambda: train(task, agent, steps, seeds, options.directory, **how))
    found = _result(result)
    if str(options.json) != "-":
        _print(result, found, options.directory)
    write_json(options.json, found)
    return 0 if result.complete else 130


def _arguments(arguments: list[str]) -> Arguments:
    """The arguments; for `--resume RUN`, with the run's own configuration and directory."""
    path, rest = pop_option("resume", arguments)
    if path is None:
        return read_arguments(arguments)
    if rest and not rest[0].startswith("-"):
        raise ValueError(f"--resume {path}: the run has its own task, so leave out {rest[0]!r}")
    for option in ("config", "out"):
        if pop_option(option, rest)[0] is not None:
            raise ValueError(f"--resume {path}: cannot be combined with --{option}")
    config = saved_config(path, "--allow-changed" in rest)
    given = read_arguments(rest)
    return given._replace(file=Path(path) / "config.toml", table=config, rest=["--out", path, *given.rest])


def _swept_names(words: list[str], of_file: object) -> list[str]:
    """The settings that a sweep names, on the command line or in a file."""
    found = []
    inside = False
    for word in words:
        inside = word == "--sweep" or (inside and not word.startswith("-"))
        if inside and "=" in word:
            found.append(word.partition("=")[0].replace("-", "_"))
    return [*found, *swept_names(of_file)]


def _result(run: Run) -> dict[str, Any]:
    """Facts about a run, and the means over its last tenth per seed; in a sweep, those of each setting."""
    facts: dict[str, Any] = {
        "task": run.task.name,
        "path": str(run.path),
        "decisions": run.decision,
        "complete": run.complete,
        "simulated_time": run.decision * run.task.period,
        "broken": int(run.broken.sum()),
        "wall_time": float(run.metrics["wall_time"][-1].as_py()) if run.metrics.num_rows else 0.0,
    }
    if not run.settings:
        return facts | _means(run)
    parts = zip(run.settings, run.split(), strict=True)
    each = [{"setting": setting, "broken": int(part.broken.sum()), **_means(part)} for setting, part in parts]
    return facts | {"settings": each}


def _means(run: Run) -> dict[str, Any]:
    """The mean of every column of the metrics over the last tenth of the records, and totals of what is counted."""
    return {name: summary(values) for name, values in final_metrics(run).items()}


def _print(run: Run, found: dict[str, Any], out: Path) -> None:
    done = "done" if run.complete else "stopped"
    made = counted(run.decision, "decision")
    print(f"{done} after {made} per seed; means over the last tenth of the records, and totals:")
    if run.settings:
        for each in found["settings"]:
            of = f" ({each['broken']} of {counted(len(run.seeds), 'seed')} not finite)" if each["broken"] else ""
            print(f"{setting_text(each['setting'])}{of}:")
            _print_means(each)
    else:
        _print_means(found)
    if broken := found["broken"]:
        print(f"parameters of {broken} of {counted(run.lanes, 'learner')} are not finite: nothing is learned there")
    print(plain(f"saved in {out}"))
    if run.complete:
        print(plain(f"next: motorgrad plot {out}    motorgrad evaluate {out}"))
    else:
        print("the same command continues this run")


def _print_means(found: dict[str, Any]) -> None:
    for name, value in found.items():
        # counts of occurrences are for machines, and so is a total of no divergences
        quiet = name.endswith("_count_total") or (name == "diverged_total" and not any(value["per_seed"]))
        if isinstance(value, dict) and "median" in value and not quiet:
            print(f"  {summary_text(name.replace('_', ' '), value)}")
