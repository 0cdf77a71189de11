"""`motorgrad sim SUBJECT`: watch a body, its muscles and its learner live."""

import dataclasses
import gc
import math
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

from motorgrad._errors import check, plain, unknown
from motorgrad._extras import FILM, require
from motorgrad._files import check_writable
from motorgrad._myosuite import is_of_myosuite
from motorgrad.bodies import BODIES
from motorgrad.options import (
    HELP,
    HELP_ALL,
    Arguments,
    command_with_learner,
    is_task_word,
    naming,
    pop_option,
    read_arguments,
    resolve,
    split_task,
)
from motorgrad.pages import LOCAL
from motorgrad.schema import Settings, build, count, inner, number, static, table
from motorgrad.tasks import TASKS, Composed
from motorgrad.training import agent_table, load, saved_config
from timsim import live
from timsim._commands._autosave import Autosave
from timsim._commands._side_by_side import bodies, gathered
from timsim.film import ENDINGS
from timsim.page import HERE, Page, check_port, warn_of
from timsim.panels import MAX_RECORDING_SECONDS, TourStep
from timsim.planet import Planet

USAGE = """usage: motorgrad sim TASK | TASK.toml | BODY | MODEL.xml | MYOSUITE-ID | --run RUN | --config SCENE [options]

Watch a body, its muscles and its learner live in the browser. They run in a process of their own. A task learns: one of
the library, a file of a composed one, or MyoSuite's. A body or an MJCF file is simulated without a learner, which you
may then start on the page. A run continues from its learned policy.

Several bodies stand side by side: seeds of a run (--run RUN --seeds 0 3 5), two runs (--run A --run B), and any other
policy beside a learner (--beside before=untrained PPO=ppo.zip). They act in step.
"""

NEW = "a new file with --run, which starts with the policy of the run"


@dataclasses.dataclass(frozen=True)
class Options(Settings):
    """Options of `motorgrad sim`, beside those of the task and of the agent."""

    run: Path | None = static(
        None, help="Start with the policy of the run in this directory; TASK may then be left out"
    )
    seed: int | None = count(
        None, help="The seed of the learner; with --run, which of its seeds. By default 0, or the run's first"
    )
    seeds: tuple[int, ...] = static((), help="Several seeds of the run side by side, which act without learning")
    beside: tuple[str, ...] = static(
        (),
        help="Other policies side by side, as LABEL=PATH: a run, a saved policy (.npz), a model (.zip), or untrained",
    )
    runs_beside: tuple[Path, ...] = static(
        (), help="Further runs of the task side by side; --run, given again, means the same"
    )
    autosave: Path | None = static(
        None, help="Save the policy to this file (.npz) as it learns, and at the end; start with it if the file exists"
    )
    autosave_every: float = number(10.0, 0.1, unit="s", help="The wall time between two automatic saves")
    frozen: bool = static(False, help="Start without learning")
    paused: bool = static(False, help="Start paused, as a model without a learner does unless it is filmed")
    speed: float | Literal["max"] = number(
        1.0, live.MIN_SPEED, help="Simulated seconds per second; max for as fast as possible"
    )
    host: str = static(
        HERE,
        help="Where the page listens. Others can reach a host other than 127.0.0.1, unencrypted: keep the "
        "address secret",
    )
    port: int | None = count(None, 1, 2**16 - 1, help="The page's port; by default 8080, or the next free one")
    share: bool = static(
        False,
        help="Print a second address, by which others watch and change nothing; with another --host it is "
        "always printed",
    )
    browser: bool = static(True, help="Open the page in the browser, where there is a screen")
    trust: bool = static(
        False,
        help="Run code that the run directory or the scene file names, the module of its task, and that models "
        "(.zip) hold",
    )
    motion: Path | None = static(
        None, help="Play this stored motion of a model (.mot, .sto, .csv, .npz or .npy), by the names of its joints"
    )
    motion_partial: bool = static(
        False, help="Play it although joints have no column, or columns are not of this model"
    )
    record: Path | None = static(
        None, help="Record the simulation from its start to this file: a film (.mp4, .gif, .webp), or a replay (.html)"
    )
    seconds: float | None = number(
        None,
        0,
        open_low=True,
        unit="s",
        help="End after so much of the recording, or without one of wall time since the run started; "
        "by default with Ctrl-C. A replay's seconds are simulated",
    )
    common: ClassVar[tuple[str, ...]] = (
        "run",
        "seed",
        "seeds",
        "beside",
        "frozen",
        "paused",
        "speed",
        "record",
        "seconds",
        "port",
        "browser",
    )
    """The options that `--help` shows; `--help-all` shows all."""
    task: ClassVar[Any] = None
    model: ClassVar[Any] = None
    """A body, or the path of a model, that is shown without a learner."""
    scene: ClassVar[Mapping[str, Any]] = {}
    """The tables of the file for which there is no option."""

    def validate(self: Any) -> None:
        check_port(self.host, self.port)
        if self.record is not None:
            known = (*ENDINGS, ".html")
            check(self.record.suffix in known, "record", str(self.record), f"a path that ends in {' or '.join(known)}")
            check_writable("record", self.record)
            if self.record.suffix == ".mp4":
                require(*FILM)
            if self.record.suffix == ".html" and self.seconds is not None:
                longest = MAX_RECORDING_SECONDS
                check(self.seconds <= longest, "seconds", self.seconds, f"at most {longest:g}, the longest replay")
        if self.autosave is not None:
            live.Save(str(self.autosave))
            check_writable("autosave", self.autosave)
            check(self.run is None or not self.autosave.exists(), "autosave", str(self.autosave), NEW)

    def effective(self: Any) -> dict[str, Any]:
        values = {**table(self), **self.scene}
        if self.task is None:
            live.setup_of(self.model, motion=self.motion, partial=self.motion_partial)  # raises for a bad file
            return values
        return {**values, "task": {"name": self.task.name, **values["task"]}, "agent": agent_table(self.agent)}

    @property
    def pace(self) -> float:
        return math.inf if self.speed == "max" else self.speed


@dataclasses.dataclass(frozen=True)
class Place(Settings):
    """The tables of a scene file for which the command line has no option."""

    stage: live.Stage = inner(factory=live.Stage, help="What surrounds the body, and from where it is seen")
    planet: Planet | None = inner(None, help="A round planet, in place of level ground")
    tour: tuple[TourStep, ...] = inner((), help="The steps of a guided tour, each with a text and what it shows")


def run(arguments: list[str]) -> int:
    if not arguments or set(arguments) <= {*HELP, HELP_ALL}:
        print(f"{USAGE}\ntasks: {', '.join(sorted(TASKS))}\nbodies: {', '.join(sorted(BODIES))}\n")
        print("motorgrad sim TASK --help shows the common options; --help-all also those of the task and its learner.")
        return 0 if arguments else 2
    return _show(*prepared(arguments))


def prepared(arguments: list[str]) -> tuple[live.Setup, Any]:
    """What the arguments ask for, and the options."""
    given = read_arguments(gathered(arguments))
    place, model, scene, given = _scene_parts(given)
    given = _with_run(given)
    if model is not None:
        own = {"scene": scene, "model": model}
        kind = dataclasses.make_dataclass("Sim", [], bases=(Options,), frozen=True, namespace=own)
        options = resolve(kind, given, "sim MODEL")
        for name in ("run", "autosave", "seeds", "beside", "runs_beside"):
            value = getattr(options, name)
            check(value is None or value == (), name, str(value), "left out with a model, which has no learner")
        rest = {"planet": place.planet, "motion": options.motion, "partial": options.motion_partial}
        with naming(given.file):
            setup = live.setup_of(model, stage=place.stage, **rest)
    else:
        options = _learner_options(given, scene)
        with naming(given.file):
            setup = _setup(options, place)
        if (file := pop_option("task", given.rest)[0]) is not None:
            setup = dataclasses.replace(setup, name=Path(file).stem)
    return setup, options


def _learner_options(given: Arguments, scene: Mapping[str, Any]) -> Any:
    """The options with those of the task and of its learner."""
    name, given = split_task(given)
    check(name is not None, "the first word", given.rest[:1], "a task, a body, an MJCF file: motorgrad sim TASK ...")
    kind, given = command_with_learner(Options, "Sim", "Watch it learn", str(name), given)
    kind.scene = scene
    options = resolve(kind, given, f"sim {name}")
    if kind.choice is not None and options.run is None:  # a stored run has its learner
        print(plain(f"learner: {kind.choice}"), file=sys.stderr)
    return options


def _setup(options: Any, place: Place) -> live.Setup:
    agent = options.agent
    seed, label, beside = bodies(options.run, options.runs_beside, options.seed, options.seeds, options.beside)
    frozen = options.frozen or bool(label)
    if options.run is not None:
        known = load(options.run)
        if known.config["agent"]["policy"]["kind"] == "given":  # made in Python, and not to be made again
            why = "true: the learner of this run was made in Python, so that its policy can only act"
            check(frozen, "frozen", frozen, why)
            agent = live.acting(known, seed)
    saved = options.autosave if options.autosave and options.autosave.exists() else None
    check(options.motion is None, "motion", str(options.motion), "left out with a task: give its model")
    rest = {"frozen": frozen, "stage": place.stage, "planet": place.planet, "beside": beside, "label": label}
    return live.setup_of(options.task, agent, seed, run=options.run or saved, trust=options.trust, **rest)


def _show(setup: live.Setup, options: Options) -> int:
    warn_of(options.host)
    print(f"{setup.name}: starting …", file=sys.stderr)
    # a model that nobody drives would fall before anyone has seen it
    moving = setup.task is not None or setup.motion is not None or options.record is not None
    playing = not options.paused and moving
    with (
        live.Session(setup, playing=playing, speed=options.pace, wait=False) as session,
        Page(session, options.host, options.port, wait=False) as page,
    ):
        print(f"{setup.name}: {page.url}   (Ctrl-C ends it)", flush=True)
        if options.share or options.host not in LOCAL:
            print(f"{setup.name}, to watch only: {page.read_only_url}", flush=True)
        if options.browser:
            page.open()
        page.ready()
        # the libraries' objects are permanent; each garbage collection that scans them stops the page for about 0.3 s
        gc.collect()
        gc.freeze()
        if steps := options.scene.get("tour"):
            page.tour(steps)
        film = None
        if options.record is not None:
            replay = options.record.suffix == ".html"
            film = page.record(options.record, **({"longest": options.seconds} if replay else {}))
        most = options.seconds or math.inf
        begin = time.monotonic()
        save = None if options.autosave is None else Autosave(options.autosave, options.autosave_every)
        try:
            while not page.session.ended and (film is None or film.running):
                left = most - (time.monotonic() - begin if film is None else film.seconds)
                if left <= 0:
                    break
                time.sleep(min(0.2, left))
                if save is not None:
                    save.go_on(page.session)
        except KeyboardInterrupt:
            print(f"{setup.name}: ended", file=sys.stderr)
        finally:
            try:
                if save is not None and not page.session.ended:
                    save.finish(page.session)
            finally:
                if film is not None:
                    film.stop()
                    print(f"{'replay' if film.path.suffix == '.html' else 'film'}: {film.path}")
        if page.session.ended:
            raise RuntimeError(page.last_words)
    return 0


def _scene_parts(given: Arguments) -> tuple[Place, Path | str | None, dict[str, Any], Arguments]:
    """The stage, planet and tour of a scene file, the model or body to show, both as plain values, and the rest."""
    values = dict(given.table)
    rest = list(given.rest)
    model = None
    scene = {}
    try:
        place = build(Place, {name: values.pop(name) for name in ("stage", "planet", "tour") if name in values})
        scene = {name: part for name, part in table(place).items() if name != "tour" or part}
        for name in ("model", "body"):
            if (word := values.pop(name, None)) is None:
                continue
            check(isinstance(word, str) and word, name, word, "a path" if name == "model" else "the name of a body")
            check(model is None and "task" not in values, name, word, "the only one of task, body and model")
            # a path in a file is meant from where that file is
            model = given.file.parent / word if name == "model" and given.file else _body(word)
            scene[name] = str(model.absolute()) if isinstance(model, Path) else model
    except ValueError as error:
        raise ValueError(f"{given.file}: {error}" if given.file else str(error)) from None
    if rest and not rest[0].startswith("-"):
        word = rest[0]
        if live.is_path(word) or (word in BODIES and word not in TASKS):
            check(model is None, "the first word", word, f"left out, as {given.file} says what is shown")
            model = Path(word) if live.is_path(word) else word
            rest = rest[1:]
            scene["model" if live.is_path(word) else "body"] = str(model)
        elif not is_task_word(word) or is_of_myosuite(word.removeprefix(live.MYOSUITE)):
            named = live.named_subject(word)
            if isinstance(named, Composed):  # an environment of MyoSuite that is rebuilt
                check("task" not in values, "the first word", word, f"left out, as {given.file} has a task")
                values["task"] = table(named)
                rest = [Composed.name, *rest[1:]]
            elif named is word:
                raise unknown("task, body or file (.xml, .toml)", word, {*TASKS, *BODIES}, registered=True)
            else:
                scene["body"] = model = word
                rest = rest[1:]
    return place, model, scene, given._replace(table=values, rest=rest)


def _body(word: str) -> str:
    if word not in BODIES and live.named_subject(word) is word:
        raise unknown("body", word, BODIES)
    return word


def _with_run(given: Arguments) -> Arguments:
    """The arguments with the task and learner of a run as defaults."""
    word, _ = pop_option("run", given.rest)
    word = word or given.table.get("run")
    if not isinstance(word, str):
        return given
    file = Path(word) / "config.toml"
    config = saved_config(word)
    values = dict(given.table)
    own_name = config["task"]["name"]
    settings = config["agent"]["policy"]
    if settings.get("kind") == "given":  # made in Python
        config["agent"] = {}
    asked = given.rest[0] if given.rest and not given.rest[0].startswith("-") else None
    if asked is None and isinstance(values.get("task"), Mapping):
        asked = values["task"].get("name")
    if asked not in (None, own_name):
        raise ValueError(f"{word}: a run of the task {own_name!r}, not {asked!r}")
    for part in ("task", "agent"):
        own = values.get(part, {})
        values[part] = {**config[part], **own} if isinstance(own, Mapping) else own
    return given._replace(table=values, file=given.file or file)
