"""`motorgrad evaluate RUN`: evaluate the policies of a run."""

import dataclasses
import math
import sys
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import tyro

from motorgrad._commands._configuration import read_arguments, resolve
from motorgrad._commands._results import summary, summary_text, write_json
from motorgrad._errors import check, plain
from motorgrad._extras import FILM, installed, missing, require
from motorgrad._files import check_writable
from motorgrad._settings import table
from motorgrad.experiments import motion_of
from motorgrad.tasks import BodyTask
from motorgrad.training import Evaluation, Run, evaluate, load

Mode = Literal["sample", "mode"]
MOST = 10_000_000
"""Limit of the decisions of an evaluation, which keeps the whole motion."""


@dataclasses.dataclass(frozen=True)
class Evaluate:
    """Evaluate the policies of a run without learning, from a fresh start, and film one of them.

    Settings of the run's task can be changed after RUN: motorgrad evaluate RUN --task.time-limit None.
    """

    run: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUN")]
    """The run directory."""
    steps: int = 2000
    """Decisions per seed."""
    mode: Literal["sample", "mode", "both"] = "sample"
    """sample draws every action, mode takes the most probable one; both does each in turn and films the first."""
    untrained: bool = False
    """Evaluate the policies as they were before learning."""
    seed: int | None = None
    """The seed to film; by default the first."""
    video: Path | None = None
    """The file of the film, by default figures/evaluation.mp4 of the run, or evaluation-untrained.mp4 and the like."""
    film: bool = True
    """Whether to film. Without the extra video nothing is filmed, and --video is refused."""
    seconds: float = 10.0
    """The length of the film, in seconds."""
    trust: bool = False
    """Run code that the run directory names: the module of its task."""
    allow_changed: bool = False
    """Evaluate with the settings in config.toml even if they were changed since the run was made."""
    json: Path | None = None
    """Also write the result to this file, as JSON; - for the standard output."""
    task: ClassVar[Any] = None

    def validate(self) -> None:
        trained = self.load()
        trained.policy(self.seed)  # refuses a seed that the run does not have
        check(1 <= self.steps <= MOST, "steps", self.steps, f"from 1 to {MOST} decisions")
        check(0 < self.seconds < math.inf, "seconds", self.seconds, "a positive time")
        body = isinstance(trained.task, BodyTask)
        check(body or self.video is None, "video", str(self.video), f"left out: task {trained.task.name!r} has no body")
        if self.film and body:
            check(self.film_path.suffix == ".mp4", "video", str(self.film_path), "a path that ends in .mp4")
            check_writable("video", self.film_path)
            if self.video is not None:
                require(*FILM)

    def load(self) -> Run:
        found = load(self.run, trust=self.trust, allow_changed=self.allow_changed)
        return found if self.task is None else found.with_task(self.task)

    @property
    def film_path(self) -> Path:
        what = {"untrained": self.untrained, "mode": self.mode == "mode", f"seed-{self.seed}": self.seed is not None}
        name = "-".join(["evaluation", *(word for word, chosen in what.items() if chosen)])
        return self.video or self.run / "figures" / f"{name}.mp4"


def run(arguments: list[str]) -> int:
    options = _options(arguments)
    trained = options.load()
    modes: tuple[Mode, ...] = ("sample", "mode") if options.mode == "both" else (options.mode,)
    outcomes = {mode: evaluate(trained, options.steps, mode=mode, untrained=options.untrained) for mode in modes}
    summaries = {mode: _summaries(outcome) for mode, outcome in outcomes.items()}
    found: dict[str, Any] = {
        "run": str(options.run),
        "task": trained.task.name,
        "steps": options.steps,
        "mode": options.mode,
        **({"modes": summaries} if options.mode == "both" else summaries[options.mode]),
    }
    quiet = str(options.json) == "-"
    for mode, values in summaries.items() if not quiet else ():
        if len(summaries) > 1:
            print(f"{mode}:")
        for name, value in values.items():
            print(_text(name, value))
    outcome = outcomes[modes[0]]
    filmed = outcome.position is not None and options.film
    if filmed and not installed("imageio_ffmpeg"):
        print(f"not filmed: {missing(*FILM)}", file=sys.stderr)
    elif filmed:
        from motorgrad.sim import write_film

        path = options.film_path
        seed = trained.seeds[0] if options.seed is None else options.seed
        motion = motion_of(trained, outcome, seed, f"seed {seed}", options.seconds)
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


def _summaries(outcome: Evaluation) -> dict[str, Any]:
    """An evaluation as a plain table: numbers as their summary, words as they are."""
    values = {"reward": outcome.reward, **outcome.readings, **outcome.measures}
    return {name: each.tolist() if each.dtype.kind == "U" else summary(each) for name, each in values.items()}


def _text(name: str, value: Any) -> str:
    if isinstance(value, dict):
        return summary_text(name, value)
    return f"{name}: {', '.join(f'{value.count(kind)} {kind}' for kind in dict.fromkeys(value))}"
