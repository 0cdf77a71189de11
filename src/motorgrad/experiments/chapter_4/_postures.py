"""Experiments on the arm, run and judged under both readings of how the thesis holds its upper arm."""

import abc
import dataclasses
from collections.abc import Iterator
from typing import Any, ClassVar

from motorgrad.bodies import POSTURES, Arm, Posture
from motorgrad.experiments._claims import Claim
from motorgrad.experiments._experiment import Experiment, Values, Workspace
from motorgrad.experiments._figures import Figure, SubFigure, new_figure
from motorgrad.tasks import ArmRecruitment

READ = Arm().posture
"""The reading by which the thesis's statements are judged; where `Arm` is defined stands why."""
OTHER = (
    f"The upper arm is not {READ} here: of the two readings of section 4.3.2, more of the text agrees with that one."
)


class BothPostures(Experiment):
    """Base of experiments that are done with each posture of the arm: a subclass measures, draws and judges one.

    The results of a posture, and the parts that `measure` stores, have its name before their own.
    """

    reading: ClassVar[str] = (
        'Section 4.3.2 holds the upper arm "at right angles", which may be vertically or horizontally. Statements of '
        f"the thesis are judged with a {READ} upper arm, with which more of its text agrees; the other is reported "
        "beside it."
    )

    size: ClassVar[tuple[float, float]]
    """Width and height of the figure of one posture, in inches."""

    @abc.abstractmethod
    def measure(self, work: Workspace, posture: Posture) -> Values:
        """What `run` returns, for one posture."""

    @abc.abstractmethod
    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        """Draw the results of one posture."""

    @abc.abstractmethod
    def judge(self, values: Values, posture: Posture) -> Iterator[Claim]:
        """The claims about one posture."""

    def run(self, work: Workspace) -> Values:
        found = {posture: self.measure(work, posture) for posture in POSTURES}
        return {f"{posture} {name}": value for posture, values in found.items() for name, value in values.items()}

    def figure(self, values: Values) -> Figure:
        width, height = self.size
        figure = new_figure(width, height * len(POSTURES))
        parts: Any = figure.subfigures(len(POSTURES), 1, hspace=0.04)
        for part, posture in zip(parts, POSTURES, strict=True):
            part.suptitle(f"{posture} upper arm", x=0.01, ha="left", weight="bold", fontsize=11)
            self.draw(part, values_of(values, posture), posture)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for posture in POSTURES:
            for claim in self.judge(values_of(values, posture), posture):
                yield under(posture, claim)


def values_of(values: Values, posture: Posture) -> Values:
    """The results of one posture, under their own names."""
    start = f"{posture} "
    return {name.removeprefix(start): value for name, value in values.items() if name.startswith(start)}


def under(posture: Posture, claim: Claim) -> Claim:
    """A claim as one about this posture, the variant of a statement that it shares with the other posture."""
    changes = {
        "statement": f"{claim.statement.removesuffix('.')} ({posture} upper arm).",
        "of": claim.of or claim.statement,
    }
    if posture != READ and claim.kind == "thesis" and not claim.untested:
        changes["untested"] = OTHER
    return dataclasses.replace(claim, **changes)


def arm_task(posture: Posture, units: int = ArmRecruitment.units) -> ArmRecruitment:
    """The task of section 4.3.2 with the upper arm held so."""
    return ArmRecruitment(units=units, body=Arm(posture=posture))
