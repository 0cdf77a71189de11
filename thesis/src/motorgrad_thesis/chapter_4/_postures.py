"""Experiments on the arm under both readings of how the thesis holds its upper arm."""

import abc
from typing import Any, ClassVar

from motorgrad.bodies import POSTURES, Arm, Posture
from motorgrad.tasks import ArmRecruitment
from motorgrad_thesis._experiment import Values
from motorgrad_thesis._figures import Figure, SubFigure, new_figure
from motorgrad_thesis._readings import Readings, values_of

READ = Arm().posture
"""The reading by which the thesis's statements are judged; where `Arm` is defined stands why."""


class BothPostures(Readings[Posture]):
    """Base of experiments that are done with each posture of the arm: a subclass measures, draws and judges one."""

    reading: ClassVar[str] = (
        'Section 4.3.2 holds the upper arm "at right angles", which may be vertically or horizontally. Statements of '
        f"the thesis are judged with a {READ} upper arm, with which more of its text agrees; the other is reported "
        "beside it."
    )
    judging = READ
    what = "upper arm"
    otherwise = (
        f"The upper arm is not {READ} here: of the two readings of section 4.3.2, more of the text agrees with that "
        "one."
    )

    size: ClassVar[tuple[float, float]]
    """Width and height of the figure of one posture, in inches."""

    @abc.abstractmethod
    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        """Draw the results of one posture."""

    @property
    def readings(self) -> tuple[Posture, ...]:
        return POSTURES

    def figure(self, values: Values) -> Figure:
        width, height = self.size
        figure = new_figure(width, height * len(POSTURES))
        parts: Any = figure.subfigures(len(POSTURES), 1, hspace=0.04)
        for part, posture in zip(parts, POSTURES, strict=True):
            part.suptitle(f"{posture} upper arm", x=0.01, ha="left", weight="bold", fontsize=11)
            self.draw(part, values_of(values, posture), posture)
        return figure


def arm_task(posture: Posture, units: int = ArmRecruitment.units) -> ArmRecruitment:
    """The task of section 4.3.2 with the upper arm held so."""
    return ArmRecruitment(units=units, body=Arm(posture=posture))
