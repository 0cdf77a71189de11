"""`motorgrad evaluate RUN`: evaluate the policies of a run."""

import dataclasses
import math
import sys
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from motorgrad._applications import film_maker
from motorgrad._errors import check, counted, plain
from motorgrad._extras import MissingExtra
from motorgrad._files import check_writable
from motorgrad.options import finite_table, json_help, read_arguments, resolve, summary, summary_text, write_json
from motorgrad.schema import Settings, count, number, static, table
from motorgrad.tasks import BodyTask
from motorgrad.training import (
    MAX_EPISODES,
    STEPS,
    EpisodeEvaluation,
    Evaluation,
    Run,
    check_table,
    evaluate,
    load,
    rollout,
)

Mode = Literal["sample", "mode"]
MAX_DECISIONS = 10_000_000
"""Of an evaluation, which keeps the whole motion."""


@dataclasses.dataclass(frozen=True)
class Evaluate(Settings):
    """Evaluate the policies of a run without learning, from a fresh start, and film one of them.

    Settings of the run's task can be changed after RUN: motorgrad evaluate RUN --task.time-limit None.
    """

    run: Path = static(positional="RUN", help="The run directory")
    steps: int | None = count(
        None,
        1,
        MAX_DECISIONS,
        help="Decisions per seed, by default 2000. With --episodes: decisions after which an episode is cut",
    )
    episodes: int | None = count(
        None,
        1,
        MAX_EPISODES,
        help="Evaluate so many whole episodes of every seed, in place of a number of decisions: their returns "
        "and lengths, with the interval over seeds",
    )
    random_seed: int = count(0, help="The seed of the random numbers of the evaluation. Those of learning are others")
    best: bool = static(
        False, help="Evaluate the policies that --keep-best kept while training, in place of the last ones"
    )
    mode: Literal["sample", "mode", "both"] = static(
        "sample",
        help="Whether every action is drawn (sample) or the most probable one taken (mode); both does each in turn and "
        "films the first",
    )
    untrained: bool = static(False, help="Evaluate the policies as they were before learning")
    seed: int | None = count(None, help="The seed to film, and to write to a .sto file; by default the first")
    video: Path | None = static(
        None,
        help="The file of the film, by default figures/evaluation.mp4 of the run, or evaluation-untrained.mp4 "
        "and the like",
    )
    film: bool = static(True, help="Whether to film. Without the extra video nothing is filmed, and --video is refused")
    seconds: float = number(10.0, 0, open_low=True, unit="s", help="The length of the film")
    table: Path | None = static(
        None,
        help="Also write what happened at every decision to this file, in the first mode: all seeds to "
        ".parquet or .csv, or the first episode of one seed to .sto, for OpenSim",
    )
    every: Literal["decision", "step"] = static(
        "decision", help="A row of the table for every decision, or for every physics step of a body"
    )
    trust: bool = static(False, help="Run code that the run directory names: the module of its task")
    allow_changed: bool = static(
        False, help="Evaluate with the settings in config.toml even if they were changed since the run was made"
    )
    json: Path | None = static(None, help=json_help())
    task: ClassVar[Any] = None

    def validate(self) -> None:
        trained = self.load()
        trained.policy(self.seed)  # refuses a seed that the run does not have
        check(not (self.best and self.untrained), "best", self.best, "given without untrained")
        if self.episodes is not None:
            check(not trained.settings, "episodes", self.episodes, "left out for a sweep: mg.evaluate has them all")
            allowed = f"left out for the task {trained.task.name!r}, which has none; give it a time limit"
            check(trained.task.has_episodes, "episodes", self.episodes, allowed)
        body = isinstance(trained.task, BodyTask)
        if self.table is not None:
            check_table(self.table, "table")
            check(not trained.settings, "table", str(self.table), "left out for a sweep, whose runs `split` gives")
            alone = self.episodes is None or self.steps is None
            check(alone, "steps", self.steps, "left out with --episodes and --table, which holds whole episodes")
        steps_body = body and self.table is not None
        check(self.every == "decision" or steps_body, "every", self.every, "decision, or with --table of a body, step")
        check(body or self.video is None, "video", str(self.video), f"left out: task {trained.task.name!r} has no body")
        if self.film and body:
            check(self.film_path.suffix == ".mp4", "video", str(self.film_path), "a path that ends in .mp4")
            check_writable("video", self.film_path)
            if self.video is not None:
                film_maker("film")

    @property
    def decisions(self) -> int:
        """The decisions of what is not by episodes."""
        return STEPS if self.steps is None else self.steps

    def load(self) -> Run:
        found = load(self.run, trust=self.trust, allow_changed=self.allow_changed)
        found = found.best() if self.best else found
        return found if self.task is None else found.with_task(self.task)

    @property
    def film_path(self) -> Path:
        what = {"best": self.best, "untrained": self.untrained, "mode": self.mode == "mode"}
        what[f"seed-{self.seed}"] = self.seed is not None
        name = "-".join(["evaluation", *(word for word, chosen in what.items() if chosen)])
        return self.video or self.run / "figures" / f"{name}.mp4"


def run(arguments: list[str]) -> int:
    options = _options(arguments)
    trained = options.load()
    modes: tuple[Mode, ...] = ("sample", "mode") if options.mode == "both" else (options.mode,)
    how: dict[str, Any] = {"seed": options.random_seed, "untrained": options.untrained}
    whole: dict[Mode, EpisodeEvaluation] = {}
    if options.episodes is not None:
        of = {"episodes": options.episodes, **how}
        whole = {mode: evaluate(trained, options.steps, mode=mode, **of) for mode in modes}
    filmed = options.film and isinstance(trained.task, BodyTask)
    steps = options.decisions
    if whole:  # of which no motion is kept, so the film has one of its own
        steps = max(1, math.ceil(options.seconds / trained.task.period))
    moved = modes if not whole else modes[:1] if filmed else ()
    outcomes: dict[Mode, Evaluation] = {mode: evaluate(trained, steps, mode=mode, **how) for mode in moved}
    summaries = {mode: _summaries(outcome) for mode, outcome in (whole or outcomes).items()}
    found: dict[str, Any] = {
        "run": str(options.run),
        "task": trained.task.name,
        **({"episodes": options.episodes} if whole else {"steps": steps}),
        "mode": options.mode,
        **({"modes": summaries} if options.mode == "both" else summaries[options.mode]),
    }
    quiet = str(options.json) == "-"
    for mode, values in summaries.items() if not quiet else ():
        if len(summaries) > 1:
            print(f"{mode}:")
        for name, value in values.items():
            print(_text(name, value))
    if options.table is not None:
        found["table"] = str(options.table)
        message = _write_table(trained, options, modes[0])
        if not quiet:
            print(message)
    write_film = None
    try:
        write_film = film_maker("film") if filmed else None
    except MissingExtra as lacking:
        print(f"not filmed: {lacking}", file=sys.stderr)
    if write_film is not None:
        path = options.film_path
        seed = trained.seeds[0] if options.seed is None else options.seed
        motion = film_maker("motion of a run")(trained, outcomes[modes[0]], seed, f"seed {seed}", options.seconds)
        made = write_film([motion], path)
        found |= {"video": str(path), "renderer": made.renderer}
        if not quiet:
            short = (
                "" if made.seconds > options.seconds - 0.05 else f" of {options.seconds:g}, for more take more --steps"
            )
            print(f"filmed seed {seed}, {made.seconds:.1f} s{short}: {plain(path)}")
            if made.note:
                print(made.note)
    write_json(options.json, found)
    return 0


def _write_table(trained: Run, options: Evaluate, mode: Mode) -> str:
    """Write what happened at every moment to a file. Returns what it holds, in words."""
    path = options.table
    assert path is not None
    movement = path.suffix.lower() == ".sto"
    seed = trained.seeds[0] if options.seed is None else options.seed
    made = rollout(
        trained,
        steps=options.decisions if options.episodes is None else None,
        episodes=options.episodes,
        seeds=[seed] if movement else None,
        seed=options.random_seed,
        mode=mode,
        every=options.every,
        untrained=options.untrained,
    )
    made = made.of(episode=0) if movement else made
    of = f"the first episode of seed {seed}" if movement else counted(len(made.episodes()), "episode")
    made.save(path)
    return f"table of {of}, {counted(len(made), 'row')}: {plain(path)}"


def _options(arguments: list[str]) -> Evaluate:
    """The options of the command; where some are of the task, with all settings of the run's own as defaults."""
    given = read_arguments(arguments)
    flags = [word.partition("=")[0] for word in given.rest if word.startswith("--task")]
    changes = given.table.get("task", {})
    check(isinstance(changes, dict), f"{given.file}: task", changes, "a table of settings")
    if not flags and not changes:
        return resolve(Evaluate, given, "evaluate")
    word = given.table.get("run") or next(iter(given.rest), "")
    if not isinstance(word, str) or word.startswith("-"):
        raise ValueError(
            f"{[*flags, 'task'][0]}: needs the run as the first word: motorgrad evaluate RUN --task.NAME VALUE"
        )
    said = {option.replace("_", "-") for option in given.rest}
    task = load(word, trust="--trust" in said, allow_changed="--allow-changed" in said).task
    own = ("task", type(task), dataclasses.field(default_factory=lambda: task))
    space = {"__doc__": Evaluate.__doc__}
    kind = dataclasses.make_dataclass("Evaluate", [own], bases=(Evaluate,), frozen=True, namespace=space)
    values = given.table | ({"task": table(task) | changes} if changes else {})
    return resolve(kind, given._replace(table=values), "evaluate")


def _summaries(outcome: Evaluation | EpisodeEvaluation) -> dict[str, Any]:
    """An evaluation as a plain table: numbers as their summary, words as they are; of episodes, also every one."""
    if isinstance(outcome, EpisodeEvaluation):
        return {name: _of_episodes(outcome, name) for name in ("return", "length", *outcome.others)}
    values = {"reward": outcome.reward, **outcome.metrics, **outcome.motion_metrics}
    return {name: each.tolist() if each.dtype.kind == "U" else summary(each) for name, each in values.items()}


def _of_episodes(outcome: EpisodeEvaluation, name: str) -> dict[str, Any]:
    """A quantity of whole episodes: its mean and interval, the means of the seeds, and the value of every episode."""
    values = [[float(each) if np.isfinite(each) else None for each in row] for row in outcome.values(name)]
    over = outcome.over_seeds(name) if len(outcome.seeds) > 1 else outcome.over_episodes(name)[0]
    numbers = finite_table({"mean": over.value, "low": over.low, "high": over.high, "of": over.count})
    means = [float(mean) if np.isfinite(mean) else None for mean in outcome.means(name)]
    return {"in_words": outcome.in_words(name), **numbers, "per_seed": means, "episodes": values}


def _text(name: str, value: dict[str, Any] | list[str]) -> str:
    if isinstance(value, dict) and "in_words" in value:
        return f"{name}: {value['in_words']}"
    if isinstance(value, dict):
        return summary_text(name, value)
    return f"{name}: {', '.join(f'{value.count(kind)} {kind}' for kind in dict.fromkeys(value))}"
