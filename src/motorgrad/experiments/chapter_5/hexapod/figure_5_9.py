"""Figure 5.9: the biomimetic hexapod, and what its feet need."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import Hexapod, biomimetic_hexapod
from motorgrad.experiments._claim import Claim, mean_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_5.hexapod._biomimetic_figure import draw_biomimetic
from motorgrad.experiments.chapter_5.hexapod._variants import walked, with_friction, with_low_front

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SECTION = "section 5.4.1"
BEHIND = ("middle", "rear")


@dataclasses.dataclass(frozen=True)
class BiomimeticHexapod(Experiment):
    """The hexapod whose legs have different functions, drawn from its model. Under the fixed controller, over bumps:
    how fast it walks with more and with less friction of its front feet, and of the others; how much these slip; and
    how it walks with front legs that rise less in the swing.

    **Arguments:**

    - `frictions`: of the feet, rising, at least two.
    - `highest` (degrees): to which front legs rise that are not clear in the swing.
    - `height` (m): of the bumps, on ground of its own for each seed.
    - `seconds` (simulated s): length of each walk, from two seconds after its start on.
    - `seeds`: walks of each body.
    """

    name: ClassVar[str] = "fig-5.9"
    title: ClassVar[str] = "the biomimetic hexapod"
    source: ClassVar[str] = "figure 5.9"

    frictions: tuple[float, ...] = (0.2, 0.4, 0.8, 1.6)
    highest: float = 0.0
    height: float = 0.1
    seconds: float = 10.0
    seeds: int = 20

    def __post_init__(self) -> None:
        rising = len(self.frictions) >= 2 and self.frictions[0] > 0 and bool(np.all(np.diff(self.frictions) > 0))
        check(rising, "frictions", self.frictions, "at least two, above 0 and rising")
        check(0.0 <= self.highest <= 45.0, "highest", self.highest, "in 0 … 45 degrees")
        check(0.0 < self.height <= 1.0, "height", self.height, "in (0, 1] m")
        check(1.0 <= self.seconds <= 15, "seconds", self.seconds, "in 1 … 15 simulated s: the field ends")
        check(2 <= self.seeds <= 1000, "seeds", self.seeds, "in 2 … 1000")

    @classmethod
    def quick(cls) -> Self:
        return cls(frictions=(0.4, 1.6), seconds=2.0, seeds=2)

    def bodies(self) -> dict[str, Hexapod]:
        """The bodies that walk, by name; a friction in words where it is not the body's own."""
        body = biomimetic_hexapod("servos")
        rough = with_friction(body, ("front",), self.frictions[-1])
        made = {"as it is": body, "plain": Hexapod(drive="servos"), "low": with_low_front(body, self.highest)}
        made["rough low"] = with_low_front(rough, self.highest)
        for friction in self.frictions:
            made[f"front {friction:g}"] = with_friction(body, ("front",), friction)
            made[f"behind {friction:g}"] = with_friction(body, BEHIND, friction)
        return made

    def run(self, work: Workspace) -> Values:
        found: Values = {"friction": np.array(self.frictions)}
        for name, body in self.bodies().items():
            seen = work.part(name, lambda b=body: walked(b, self.height, self.seeds, self.seconds, work.threads))
            found |= {f"{name} {quantity}": each for quantity, each in seen.items()}
        return found

    def figure(self, values: Values) -> "Figure":
        return draw_biomimetic(values, biomimetic_hexapod(), self.highest)

    def claims(self, values: Values) -> Sequence[Claim]:
        least, most = (f"{friction:g}" for friction in (self.frictions[0], self.frictions[-1]))

        def difference(quantity: str, one: str, other: str) -> np.ndarray:
            return values[f"{one} {quantity}"] - values[f"{other} {quantity}"]

        def means(quantity: str, *names: str) -> str:
            return " and ".join(f"{values[f'{name} {quantity}'].mean():.3f}" for name in names)

        front, behind = (f"front {least}", f"front {most}"), (f"behind {most}", f"behind {least}")
        own = f"{biomimetic_hexapod().front.leg.friction:g}"
        early = "Parts of the swing in which front feet touch the ground: {}, and {} of legs that are not clear."
        fastest = max(values["friction"], key=lambda friction: values[f"behind {friction:g} speed"].mean())
        best = f"Fastest with {fastest:g}: {means('speed', f'behind {fastest:g}')} m/s."
        rows = (
            (
                f"The front feet must have low friction: it is faster with {least} than with {most}.",
                difference("speed", *front),
                "m/s",
                f"{means('speed', *front)} m/s. As it is, with {own}: {means('speed', 'as it is')} m/s.",
            ),
            (
                f"The friction of middle and rear feet must be high: with {least} they slip more than with {most}.",
                difference("slip", *behind[::-1]),
                "m/s",
                f"{means('slip', *behind[::-1])} m/s while on the ground.",
            ),
            (
                f"Because they slip, it is slower with {least} than with {most} on middle and rear feet.",
                difference("speed", *behind),
                "m/s",
                f"{means('speed', *behind[::-1])} m/s. {best}",
            ),
            (
                f"The front legs must be clear in the swing: it is slower where they rise to {self.highest:g}° only.",
                difference("speed", "as it is", "low"),
                "m/s",
                early.format(means("early", "as it is"), means("early", "low")),
            ),
            (
                f"So it is where their feet have a friction of {most}.",
                difference("speed", f"front {most}", "rough low"),
                "m/s",
                early.format(means("early", f"front {most}"), means("early", "rough low")),
            ),
            (
                "Legs with different functions turn the body, unless they are timed: it yaws more than the plain one.",
                difference("yaw", "as it is", "plain"),
                "rad/s",
                f"Root mean squares of the yaw rate: {means('yaw', 'as it is', 'plain')} rad/s.",
            ),
        )
        made = []
        for statement, differences, unit, note in rows:
            measured = mean_of(differences)
            expected = "on the same ground: difference above 0"
            made.append(Claim(statement, SECTION, expected, measured, measured.low > 0, unit, note))
        return made
