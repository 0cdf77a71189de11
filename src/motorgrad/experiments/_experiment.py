"""What an experiment is: settings, a run, a figure, claims."""

import abc
import dataclasses
import importlib.util
import inspect
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from motorgrad.experiments._claim import Claim
from motorgrad.experiments._workspace import Workspace
from motorgrad.training import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Values = dict[str, np.ndarray]
"""What a run found, by name: all that the figure and the claims need, as arrays that can be stored."""


@dataclasses.dataclass(frozen=True)
class Experiment(abc.ABC):
    """An experiment or a figure. Subclasses are frozen dataclasses whose fields are the settings; their docstring says
    what is done and what can be seen."""

    name: ClassVar[str]
    """As commands take it: `"fig-5.5"`."""
    title: ClassVar[str]
    """A few words."""
    source: ClassVar[str]
    """Where it comes from: `"figure 5.5"`, `"section 5.2.2"`, of the thesis unless it says another."""
    needs: ClassVar[tuple[str, str] | None] = None
    """A package that the library itself does without, and the extra that has it: `("evosax", "search")`."""

    @classmethod
    def quick(cls) -> Self:
        """A smoke size: everything happens, and nothing is shown by it."""
        return cls()

    @classmethod
    def lacks(cls) -> str:
        """What is missing to run it, and how to get it; nothing where it can run."""
        if cls.needs is None or importlib.util.find_spec(cls.needs[0]) is not None:
            return ""
        return f"{cls.name} needs the package {cls.needs[0]}: pip install 'motorgrad[{cls.needs[1]}]'"

    @property
    def part(self) -> str:
        """The chapter or appendix: `"chapter-5"`, `"appendix-a"`."""
        found = re.search(r"([0-9]+|[A-B])\.", self.source)
        assert found is not None, self.source
        return f"chapter-{found[1]}" if found[1].isdigit() else f"appendix-{found[1].lower()}"

    @property
    def summary(self) -> str:
        """The first paragraph of its docstring, on one line."""
        return " ".join((inspect.getdoc(type(self)) or "").partition("\n\n")[0].split())

    @abc.abstractmethod
    def run(self, work: Workspace) -> Values:
        """Do it. What takes long goes through `work`, which keeps finished parts, so that a killed run goes on."""

    @abc.abstractmethod
    def figure(self, values: Values) -> "Figure":
        """Draw what was found."""

    def claims(self, values: Values) -> Sequence[Claim]:
        """Hold what was found against what the source says. A mere drawing claims nothing."""
        del values
        return ()

    def films(self, work: Workspace) -> Mapping[str, Run]:
        """The runs whose learning can be filmed, by the names of the films: `{"animation": run}`, or
        `{"animation-R1": run, …}`. They are those that `run` asked `work` for, which are finished. By default none."""
        del work
        return {}
