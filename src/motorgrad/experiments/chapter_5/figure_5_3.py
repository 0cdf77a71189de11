"""Figure 5.3: what the hopper does before and after learning."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from motorgrad.experiments._claim import Claim, mean_of, median_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_5._behaviour import behaviour_of, draw_behaviour
from motorgrad.experiments.chapter_5._hopper_study import (
    HIGH,
    HopperStudy,
    hop_heights,
    middle_seed,
    practice,
    seconds_to,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INDEPENDENT = "an independent model of the hopper with the same numbers"


@dataclasses.dataclass(frozen=True)
class HopperBehaviour(HopperStudy):
    """What a hopper does before and after learning. From top to bottom: the angle of its knees, the height of its foot,
    and when its muscles fire. At first they fire at random; later the extensors push while the foot is on the ground,
    and it flies. The seed in the middle is shown.
    """

    name: ClassVar[str] = "fig-5.3"
    title: ClassVar[str] = "the hopper's behaviour before and after learning"
    source: ClassVar[str] = "figure 5.3"

    def run(self, work: Workspace) -> Values:
        run = self.trained(work)
        before, after = (self.watch(work, run, untrained) for untrained in (True, False))
        time, heights = practice(run)
        return {
            **behaviour_of(run, before, after, middle_seed(run, after)),
            "before": hop_heights(before),
            "after": hop_heights(after),
            "passed": seconds_to(HIGH, time, heights),
            "final": heights[:, -1],
        }

    def figure(self, values: Values) -> "Figure":
        return draw_behaviour(values)

    def claims(self, values: Values) -> Sequence[Claim]:
        before, after = values["before"], values["after"]
        gain, pay = mean_of(after - before), mean_of(100 * after)
        passed, final = median_of(values["passed"]), median_of(values["final"])
        heights = f"Medians: {median_of(before).value:.2f} m before, {median_of(after).value:.2f} m after."
        same = "Where ours learns sooner or hops higher, that counts as holding."
        return (
            Claim(
                "The hopper hops higher after learning.", "figure 5.3", "more than 0", gain, gain.low > 0, "m", heights
            ),
            Claim(
                "A good jump is rewarded with more than 10, far above the penalty of 0.1 for a muscle.",
                "section 5.2",
                "more than 10",
                pay,
                pay.low > 10,
                note="Of the greatest height of a hop in m, times 100.",
            ),
            Claim(
                f"Hops pass {HIGH} m on average after some 315 s of practice.",
                INDEPENDENT,
                "315 s, seeds from 270 to 450: no later than 450",
                passed,
                passed.high <= 450,
                "s",
                f"{same} A seed that never does counts as the whole practice.",
            ),
            Claim(
                "After 1,500 s of practice hops are some 0.72 m high.",
                INDEPENDENT,
                "0.72 ± 0.08: no less than 0.64",
                final,
                final.low >= 0.64,
                "m",
                same,
            ),
        )
