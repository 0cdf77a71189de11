"""Experiments: settings, a run, a figure and claims; and the workspace that keeps their finished parts."""

import abc
import dataclasses
import hashlib
import inspect
import json
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar, TypeVar, dataclass_transform

import filelock
import numpy as np

from motorgrad._errors import check, counted
from motorgrad._extras import installed, missing
from motorgrad._files import read_arrays, write_arrays
from motorgrad.learning import Learner
from motorgrad.policies import Policy
from motorgrad.schema import Settings, declared_by, fields_of, table
from motorgrad.tasks import Task
from motorgrad.training import Run, agent_table, fingerprint, train
from motorgrad_thesis._claims import Claim
from motorgrad_thesis._figures import Figure

T = TypeVar("T", bound="Experiment")
Values = dict[str, np.ndarray]
"""Results of a run by name: everything that the figure and the claims need, as arrays that can be stored."""


class Workspace:
    """The folder of one experiment, and the trained runs that experiments share.

    **Arguments:** `path`, the experiment's folder; `shared`, the folder of trained runs; `threads` for physics, 0 for
    one per processor; `progress`, whether to show progress.
    """

    def __init__(self, path: Path, shared: Path, threads: int = 0, progress: bool = True):
        self.path, self.shared, self.threads, self.progress = path, shared, threads, progress
        self.trained: dict[str, float] = {}
        """Seconds of training of every run that was requested, over all sessions."""

    def train(
        self, task: Task, agent: Learner, steps: int, seeds: int | list[int], initial: Policy | None = None
    ) -> Run:
        """Train, or load the run if an experiment has already requested the same; `initial` as in `motorgrad.train`.

        **Raises** `KeyboardInterrupt` if Ctrl-C stopped the training; what was trained is saved.
        """
        asked = {"task": table(task), "agent": agent_table(agent), "steps": steps, "seeds": seeds}
        asked |= {} if initial is None else {"initial": fingerprint(initial)}
        mark = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:8]
        out = self.shared / f"{task.name}-{mark}"
        self.shared.mkdir(parents=True, exist_ok=True)
        with filelock.FileLock(self.shared / f".{out.name}.lock"):  # another experiment may train the same just now
            run = train(task, agent, steps, seeds, out, threads=self.threads, progress=self.progress, initial=initial)
        self.trained[out.name] = float(run.metrics["wall_time"][-1].as_py())
        return run

    def part(self, name: str, make: Callable[[], Mapping[str, Any]]) -> dict[str, np.ndarray]:
        """The arrays that `make` returns, computed once and stored under `name`.

        `make` must depend on nothing but the experiment's settings, which are those of the folder.
        """
        file = self.path / "parts" / f"{name}.npz"
        if file.exists():
            return read_arrays(file)
        self.say(name)
        made = {key: np.asarray(value) for key, value in make().items()}
        write_arrays(file, made)
        return made

    def say(self, what: str) -> None:
        """Print a line of progress."""
        if self.progress:
            print(f"  {self.path.name}: {what}", file=sys.stderr, flush=True)


class smoke:
    """The classmethod `quick` of an experiment: its settings for a smoke test, those not given as usual."""

    def __init__(self, **settings: Any):
        self.settings = settings

    def __get__(self, instance: Any, owner: type[T]) -> Callable[[], T]:
        return lambda: owner(**self.settings)


@dataclasses.dataclass(frozen=True)
class Experiment(Settings, abc.ABC):
    """Base class of experiments; `experiment` completes a subclass. Its fields are the settings, and its docstring says
    what is done and what the figure shows."""

    name: ClassVar[str]
    """Name on the command line, such as `"fig-5.5"`."""
    title: ClassVar[str]
    """A title of a few words."""
    source: ClassVar[str]
    """Where it comes from: `"figure 5.5"`, `"section 5.2.2"`; in the thesis unless another source is named."""
    reading: ClassVar[str] = ""
    """How the experiment reads the thesis, in sentences, where the text is ambiguous or misprinted, or leaves out
    something that a verdict depends on; empty where it takes the text as it stands."""
    needs: ClassVar[tuple[str, str] | None] = None
    """An optional package and the extra that installs it: `("evosax", "search")`."""

    quick = smoke()
    """The experiment with settings of a smoke test: everything runs, and the numbers mean nothing."""

    @classmethod
    def lacks(cls) -> str:
        """The missing package and how to install it, or nothing if the experiment can run."""
        if cls.needs is None or installed(cls.needs[0]):
            return ""
        return str(missing(f"{cls.name} needs", *cls.needs))

    def check_least(self, **least: float) -> None:
        """Refuse settings that are less than others allow, by name."""
        for name, low in least.items():
            value = getattr(self, name)
            unit = declared_by(fields_of(type(self))[name]).unit
            shown = f"{low:,}" if isinstance(low, int) else f"{low:g}"
            check(value >= low, name, value, f"at least {shown} {unit}".rstrip())

    def check_rising(self, name: str, least: int = 1) -> None:
        """Refuse a list that does not rise, or is of fewer numbers than `least`."""
        values = getattr(self, name)
        right = len(values) >= least and list(values) == sorted(set(values))
        check(right, name, values, f"{counted(least, 'number')} or more, rising")

    @property
    def part(self) -> str:
        """The chapter or appendix: `"chapter-5"`, `"appendix-a"`."""
        found = re.search(r"([0-9]+|[A-B])\.", self.source)
        assert found is not None, self.source
        return f"chapter-{found[1]}" if found[1].isdigit() else f"appendix-{found[1].lower()}"

    @property
    def summary(self) -> str:
        """The first paragraph of the docstring, on one line."""
        return " ".join((inspect.getdoc(type(self)) or "").partition("\n\n")[0].split())

    def run(self, work: Workspace) -> Values:
        """Run the experiment. Long computations go through `work`, which stores them, so that a killed run resumes. A
        mere drawing has nothing to run."""
        del work
        return {}

    @abc.abstractmethod
    def figure(self, values: Values) -> Figure:
        """Draw the results."""

    def claims(self, values: Values) -> Iterable[Claim]:
        """Compare the results with what the source says. A mere drawing claims nothing."""
        del values
        return ()

    def films(self, work: Workspace) -> Mapping[str, Run]:
        """Runs whose learning can be filmed, by film: `{"animation": run}`, or `{"animation-R1": run, …}`.

        They are runs that `run` requested from `work`, and finished. By default there are none.
        """
        del work
        return {}


@dataclass_transform(frozen_default=True)
def experiment(
    name: str, title: str, source: str, needs: tuple[str, str] | None = None
) -> Callable[[type[T]], type[T]]:
    """Decorator that makes a subclass of `Experiment` a frozen dataclass with this name, title and source.

    ```python
    @experiment("fig-9.9", "a coin and its faces", "figure 9.9")
    class Coin(Experiment):
        throws: int = 400
    ```
    """

    def complete(cls: type[T]) -> type[T]:
        cls.name, cls.title, cls.source, cls.needs = name, title, source, needs
        return dataclasses.dataclass(frozen=True)(cls)

    return complete
