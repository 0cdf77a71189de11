"""What every way of walking on the hexapod's muscles has in common."""

import math
from typing import Any

from motorgrad._errors import check
from motorgrad.bodies import LEGS, Body, HexapodReading
from motorgrad.bodies import Hexapod as HexapodBody
from motorgrad.tasks._task import Reading
from motorgrad.tasks._timed_body_task import TimedBodyTask


class WalkingTask(TimedBodyTask):
    """A task on a hexapod that muscles drive: paid by the metre, over when the trunk overturns."""

    body: HexapodBody
    reward_scale: float

    def check_walking(self) -> None:
        """Refuse a body without muscles, times that do not fit, and a reward that is no number."""
        check(self.body.drive == "muscles", "body.drive", self.body.drive, "'muscles'")
        self.check_times()
        check(math.isfinite(self.reward_scale), "reward_scale", self.reward_scale, "a finite number")

    def check_limits(self, shortest: float, longest: float, **usual: float) -> None:
        """Refuse the least and the greatest of what is to last so many seconds, and `usual` ones outside them."""
        check(0 < shortest < math.inf, "shortest", shortest, "positive and finite")
        check(shortest <= longest < math.inf, "longest", longest, f"at least {shortest!r} s")
        for name, value in usual.items():
            check(shortest <= value <= longest, name, value, f"from {shortest!r} to {longest!r} s")

    @property
    def dynamics(self) -> Body:
        return self.body

    def lateral_range(self, scale: float) -> list[tuple[float, float]]:
        """The least and the greatest lateral angle of each leg, over `scale` (degrees)."""
        joints = [self.body.sections[leg.partition("_")[2]].leg.lateral.range for leg in LEGS]
        return [(low / scale, high / scale) for low, high in joints]

    def walked(self, reading: HexapodReading) -> dict[str, Reading]:
        """`speed`: along the heading, m/s. `falls`: how often the trunk overturns in a second."""
        return {"speed": (reading.speed, True), "falls": (overturned(reading) / self.period, True)}


def overturned(reading: HexapodReading) -> Any:
    """Whether the trunk lies on its back, or its side."""
    return reading.upright < 0.0
