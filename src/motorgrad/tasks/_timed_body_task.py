"""The clock of a body's task: how long a decision lasts, and an episode."""

from typing import Any

from motorgrad._errors import check
from motorgrad.tasks._body_task import BodyTask

MOST = 10_000  # physics steps between two decisions


class TimedBodyTask(BodyTask):
    """A task on a body with two settings in simulated seconds: `action_period`, from one decision to the next, and
    `time_limit`, after which an episode is cut (`None` for a continuing task)."""

    body: Any
    action_period: float
    time_limit: float | None

    def check_times(self) -> None:
        """Refuse a period that the physics cannot have, and an episode shorter than it."""
        ratio = self.action_period / self.body.timestep
        whole = 0.5 < ratio < MOST + 0.5 and abs(ratio - round(ratio)) < 1e-6
        allowed = f"a positive multiple of the time step, {self.body.timestep} s, at most {MOST} of them"
        check(whole, "action_period", self.action_period, allowed)
        check(
            self.time_limit is None or 1 <= self.time_limit / self.action_period < 2**31,
            "time_limit",
            self.time_limit,
            f"None or at least one action period, {self.action_period} s, and fewer than 2147483648 of them",
        )

    @property
    def substeps(self) -> int:
        return round(self.action_period / self.body.timestep)

    @property
    def period(self) -> float:
        return self.action_period

    @property
    def episode_limit(self) -> int | None:
        return None if self.time_limit is None else round(self.time_limit / self.action_period)
