"""Compose a task for the body in view: what is observed and rewarded, which muscles act, and a learner for it."""

from __future__ import annotations

import dataclasses
import hashlib
import html
import math
import shlex
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar

import tomli_w
import viser

from motorgrad._errors import check
from motorgrad._files import write_atomically
from motorgrad._limits import MAX_SETTINGS_BYTES
from motorgrad._reading import content_of
from motorgrad.bodies import Anatomy
from motorgrad.learning import PURPOSES
from motorgrad.schema import table
from motorgrad.tasks import Composed, compose, suggestions
from motorgrad.training import PRESETS, agent_for, choice_for
from timsim.live import Session, Setup, Snapshot, confined, setup_of, succeed
from timsim.panels._panel import REFUSED, Panel
from timsim.panels._term_forms import PLACES, TermList
from timsim.scene import Pose

OWN = "chosen by the task"
AS_IT_IS = "as it is"
EACH = "one for each muscle"
TOGETHER = "one for each pattern"
STEPS = 60_000
"""Decisions over which a learner's schedules run, unless another number is given."""
MARK = "# saved by TimSim, which replaces this file as long as nobody has changed it: "
REPLACED = "new, or a file that was saved here and not changed since: take another name, or delete the file"
SETTINGS = ("actions", "groups", "scaling", "action_period", "time_limit", "commands")


class LearnPanel(Panel):
    """Composes a task for the body in view, starts a learner in place of the run, and saves the task as a file."""

    title: ClassVar[str] = "Task"

    @classmethod
    def applies(cls, session: Session) -> bool:
        return body_of(session) is not None and bool(session.muscles)

    def fill(self, gui: viser.GuiApi) -> None:
        session = self.session
        self._body = body_of(session)
        self._busy = threading.Lock()
        self._doing = ""
        self._begun = 0.0
        self._anatomy = Anatomy(self._body)
        goals = suggestions(self._body)
        self._goals = {AS_IT_IS: plain(session.task)} | goals if isinstance(session.task, Composed) else goals
        self._goals = self._goals or {"to be chosen": {}}
        first = next(iter(self._goals))
        gui.add_markdown("Choose what is to be learned, change what you like, and press Learn.")
        self._goal = gui.add_dropdown("Goal", tuple(self._goals), initial_value=first)
        self._learn = gui.add_button(
            "Learn", icon=viser.Icon.PLAYER_PLAY, hint="Starts a learner in place of this run."
        )
        self._why = gui.add_html("")
        self._said = gui.add_html("")
        self._back: Any = None
        if session.task is not None:
            self._back = gui.add_button("Back to the body alone", icon=viser.Icon.ARROW_BACK_UP, color="gray")
            self._back.on_click(lambda _: self._start(self._bare))
        with gui.add_folder("Muscles that act"):
            self._which = gui.add_text("Muscles", "*", hint="Names, or patterns such as *_r or flexor*; with commas.")
            self._units = gui.add_dropdown("Units", (EACH, TOGETHER), initial_value=EACH)
            self._actions = gui.add_dropdown("Actions", ("binary", "continuous"), hint="On or off, or any control.")
        self._lists = {place: TermList(gui, place) for place in PLACES}
        with gui.add_folder("Times"):
            self._period = gui.add_text("Decision (s)", "0.02", hint="A multiple of the time step of the physics.")
            self._limit = gui.add_text("Longest episode (s)", "", hint="Without a number episodes have no limit.")
        with gui.add_folder("Learner"):
            self._preset = gui.add_dropdown("Preset", (OWN, *PRESETS), initial_value=OWN)
            self._steps = gui.add_text("Decisions", f"{STEPS:,}", hint="Over which what is annealed ends.")
            self._seed = gui.add_number("Seed", session.setup.seed, min=0, step=1)
        with gui.add_folder("Task in a file"):
            self._path = gui.add_text("Save as", f"{session.name.partition(':')[2] or session.name}-task.toml")
            save = gui.add_button(
                "Save as TOML", icon=viser.Icon.DEVICE_FLOPPY, hint="`motorgrad train FILE` then repeats it."
            )
        self._take(self._goals[first])
        if self._goals[first]:
            self._tried(lambda: self._explain(session.task if isinstance(session.task, Composed) else None))
        self._goal.on_update(self._choose)
        for field in (self._preset, self._actions, self._steps):
            field.on_update(self._decide)
        self._learn.on_click(lambda _: self._start(self._setup))
        save.on_click(lambda _: self._tried(self._save))

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Count the seconds while another run starts; the panel does not change with the current run."""
        del snapshot, pose
        if self._doing and time.monotonic() > self._due:
            self._due = time.monotonic() + 1.0
            self._tell(f"{self._doing} … {time.monotonic() - self._begun:.0f} s")

    def task(self) -> Composed:
        """The task that the page describes. **Raises** `ValueError`."""
        return compose(self._body, **self.settings())

    def settings(self) -> dict[str, Any]:
        """The settings of the task that the page describes, as a file has them. **Raises** `ValueError`."""
        folders = self.session.folders
        lists = {place: [confined_term(term, folders) for term in each.tables()] for place, each in self._lists.items()}
        found: dict[str, Any] = {place: tables for place, tables in lists.items() if tables}
        found["actions"] = self._actions.value
        found["action_period"] = _number("Decision (s)", self._period.value)
        if self._limit.value.strip():
            found["time_limit"] = _number("Longest episode (s)", self._limit.value)
        patterns = [word.strip() for word in self._which.value.split(",") if word.strip()]
        check(patterns, "Muscles", self._which.value, "names or patterns, such as *")
        if self._units.value == TOGETHER:
            found["groups"] = [self._anatomy.named("actuator", pattern) for pattern in patterns]
        elif patterns != ["*"]:
            found["groups"] = self._anatomy.named("actuator", patterns)
        return found | {name: self._rest[name] for name in ("scaling", "commands") if name in self._rest}

    def _decisions(self) -> int:
        steps = round(_number("Decisions", self._steps.value.replace(",", "").replace("_", "")))
        check(1 <= steps < 2**32, "Decisions", steps, "from 1 on")
        return steps

    def _take(self, settings: dict[str, Any]) -> None:
        """Show these settings."""
        self._rest = settings
        for place, each in self._lists.items():
            each.fill(settings.get(place, ()))
        self._actions.value = settings.get("actions", "continuous")
        self._period.value = f"{settings.get('action_period', 0.02):.6g}"
        limit = settings.get("time_limit")
        self._limit.value = "" if limit is None else f"{limit:.6g}"
        groups = settings.get("groups")
        if groups:
            each = [name for one in groups for name in ([one] if isinstance(one, str) else one)]
            single = len(each) == len(groups)
            self._which.value = ", ".join(each)
            self._units.value = EACH if single else TOGETHER

    def _choose(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._take(self._goals[event.target.value])
            self._tried(self._explain)

    def _decide(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._tried(self._explain)

    def _explain(self, task: Composed | None = None) -> None:
        """Say which preset the task gets by itself and why, or what the preset is for that the user has chosen."""
        if self._preset.value != OWN:
            self._why.content = said(f"For {PURPOSES[self._preset.value]}.")
        else:
            choice = choice_for(self.task() if task is None else task, steps=self._decisions())
            self._why.content = said(f"Now {choice}.")
        self._tell("")

    def _setup(self) -> Setup:
        """A learner of the task."""
        task = self.task()
        session = self.session
        steps = self._decisions()
        preset = None if self._preset.value == OWN else self._preset.value
        found = setup_of(
            task, agent_for(task, preset=preset, steps=steps), int(self._seed.value), stage=session.setup.stage
        )
        return dataclasses.replace(found, name=session.name)

    def _bare(self) -> Setup:
        found = setup_of(self._body, stage=self.session.setup.stage)
        return dataclasses.replace(found, name=self.session.name)

    def _start(self, make: Callable[[], Setup]) -> None:
        """Start another run, report its progress here, and show it on the page."""
        if not self._busy.acquire(blocking=False):
            return
        try:
            self._learn.disabled = True
            self._begun = time.monotonic()
            self._tried(lambda: self._succeed(make()))
        finally:
            self._learn.disabled = False
            self._busy.release()

    def _work(self, words: str) -> None:
        self._doing = words

    def _succeed(self, setup: Setup) -> None:
        try:
            succeed(self.session, setup, self._work)
        finally:
            self._doing = ""
        self._tell("drawing …")

    def _save(self) -> None:
        task = self.task()
        steps = self._decisions()
        path = confined(self._path.value.strip(), self.session.folders)
        settings = {"body": table(task)["body"], **self.settings()}
        save_task(path, settings)
        preset = "" if self._preset.value == OWN else f" --preset {self._preset.value}"
        name = shlex.quote(path.name)  # for a shell, into which it is copied
        self._tell(f"Saved. It is repeated by: motorgrad train {name} --steps {steps} --seeds 8{preset}")

    def _tried(self, act: Callable[[], object]) -> None:
        """Do something, and show an error here, where it was made."""
        self._tell("checking the task …")
        try:
            act()
        except REFUSED as error:
            self._tell(" ".join(str(error).split()), "#c92a2a")

    def _tell(self, words: str, colour: str = "inherit") -> None:
        self._said.content = said(words, colour)


def said(words: str, colour: str = "inherit") -> str:
    """A message of the page as HTML."""
    style = f"color:{colour};font-size:12.5px;margin:2px 12px 6px;overflow-wrap:anywhere"
    return f'<div role="status" style="{style}">{html.escape(words)}</div>' if words else ""


def body_of(session: Session) -> Any:
    """The body of a session, if tasks can be composed on it; otherwise None."""
    return session.task.body if isinstance(session.task, Composed) else session.setup.body


def plain(task: Composed) -> dict[str, Any]:
    """A composed task as the settings of its file, with its short names."""
    short = {full: name for name, full in Composed.aliases.items()}
    found = {short.get(name, name): value for name, value in table(task).items() if name not in ("body", "name")}
    return {name: value for name, value in found.items() if name in PLACES or name in SETTINGS}


def confined_term(term: dict[str, Any], folders: Sequence[Path]) -> dict[str, Any]:
    """A term whose file, if it names one, is in the folders that a page may read. **Raises** `ValueError`."""
    file = term.get("file")
    if file is None:
        return term
    check(isinstance(file, str), f"{term['kind']}: file", file, "one path, without a comma")
    return {**term, "file": str(confined(file, folders))}


def save_task(path: Path, settings: dict[str, Any]) -> None:
    """Write a task to a file. **Raises** `ValueError` for a file that was not saved here, or was changed since."""
    check(path.suffix == ".toml", "Save as", str(path), "a file ending in .toml")
    check(not path.exists() or _is_ours(path), "Save as", path.name, REPLACED)
    write_atomically(path, _marked(tomli_w.dumps(_without_none(settings)).encode()))


def _marked(content: bytes) -> bytes:
    """The content of a file, with a first line by which it is known again."""
    return f"{MARK}{hashlib.sha256(content).hexdigest()[:16]}\n".encode() + content


def _is_ours(path: Path) -> bool:
    """Whether a file is as it was saved here, and nobody has changed it since."""
    try:
        content = content_of(path, MAX_SETTINGS_BYTES)
    except (OSError, ValueError):
        return False
    return content == _marked(content.partition(b"\n")[2])


def _without_none(value: object) -> Any:
    if isinstance(value, dict):
        return {name: _without_none(item) for name, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_without_none(item) for item in value]
    return str(value) if isinstance(value, Path) else value


def _number(name: str, text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    check(math.isfinite(found), name, text, "a finite number")
    return found
