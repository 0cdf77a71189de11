"""Section 6.5.4: local policies on a body: the hopper."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim, mean_of, median_of, share_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_5._hopper_study import HIGH, check_practice, practice
from motorgrad.experiments.chapter_6._local_study import middle, one
from motorgrad.experiments.chapter_6.further._hopper_figure import draw_local_hoppers
from motorgrad.policies import Policy
from motorgrad.tasks import Hopper
from motorgrad.training import AgentSettings, evaluate, settings_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WORDS = {
    "planes": "two hyperplanes",
    "static": "local units, all there from the start",
    "grown": "local units, added one by one",
    "knee planes": "two hyperplanes over the knee alone",
    "knee static": "local units over the knee alone, all there from the start",
    "knee grown": "local units over the knee alone, added one by one",
}
PICTURED = ("planes", "static", "knee planes", "knee static", "knee grown")
COMPARED = (
    ("static", "planes"),
    ("grown", "static"),
    ("knee static", "knee planes"),
    ("knee grown", "knee static"),
    ("knee grown", "knee planes"),
)
STATIC_RATES = {"centre": 5e-5, "log_width": 2e-4}
GROWN_RATES = {"centre": 1e-4, "log_width": 5e-4}
GROWTH = {"growth_shrink": 0.999, "growth_centre": 0.0, "growth_width": 1.5, "growth_cutoff": 0.4}
"""Wide enough at first for all that is observed; shrinks four times as fast as the particle's units, for a practice
that has an eighth of the decisions."""
PERIOD = 0.02  # s
CELLS = 60  # of the pictures, along each side
WATCHED = 1_000  # decisions


@dataclasses.dataclass(frozen=True)
class LocalHopper(Experiment):
    """Hoppers with local units over the knee's angle and velocity in place of hyperplanes, and with contact beside
    these: 16 that are there from the start, in pairs, or 8 that are added one by one. Units drive flexors and extensors
    in turn, and a pair of muscles is active while any of its units fires. The heights of the hops over the same
    practice; and of the seed in the middle, in which states each muscle is active.

    **Arguments:**

    - `seconds` (simulated s): length of every hopper's practice.
    - `seeds`: hoppers of each kind.
    - `static`: local units that are there from the start.
    - `grown`: local units that are added, at even intervals.
    """

    name: ClassVar[str] = "sec-6.5.4-hopper"
    title: ClassVar[str] = "local units for the hopper"
    source: ClassVar[str] = "section 6.5.4"

    seconds: float = 500.0
    seeds: int = 20
    static: int = 16
    grown: int = 8

    def __post_init__(self) -> None:
        check(2 <= self.seeds <= 10_000, "seeds", self.seeds, "in 2 … 10,000")
        check_practice(self.seconds, self.seeds, 50 * PERIOD)
        for name in WORDS:
            self.learner(name)

    @classmethod
    def quick(cls) -> Self:
        return cls(seconds=54.0, seeds=2, grown=2)

    @property
    def decisions(self) -> int:
        return round(self.seconds / PERIOD)

    def learner(self, name: str) -> tuple[Hopper, AgentSettings]:
        """The task with so many units, and the learner; all with the thesis's decay."""
        kind = name.removeprefix("knee ")
        units = {"planes": None, "static": self.static, "grown": self.grown}[kind]
        task = Hopper(paid="apex", action_period=PERIOD, units=units, observe_contact=kind == name)
        changes: dict[str, Any] = {
            "planes": {"rate": 5e-4},
            "static": {
                "policy": "tiles",
                "policy_settings": {"copies": 2, "width": 0.25},
                "rates": STATIC_RATES,
            },
            "grown": {
                "policy": "growing",
                "growth": "clock",
                "growth_interval": self.decisions // self.grown,
                "rates": GROWN_RATES,
                **GROWTH,
            },
        }[kind]
        return task, settings_for(task, decay=0.98, **changes)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name in WORDS:
            task, settings = self.learner(name)
            run = work.train(task, settings, self.decisions, self.seeds)
            found["time"], heights = practice(run)
            row = middle(heights[:, -1])
            seen = work.part(f"{name} watched", lambda run=run: {"sensors": _states(evaluate(run, WATCHED), run.task)})
            found |= {
                f"{name} heights": heights,
                f"{name} reward": run.curve()[1],
                f"{name} row": np.array(row),
                f"{name} states": seen["sensors"][row],
                f"{name} active": active(one(run.policies, row), task),
            }
        return found

    def figure(self, values: Values) -> "Figure":
        task = self.learner("planes")[0]
        marks = np.arange(1, self.grown) * self.seconds / self.grown
        return draw_local_hoppers(values, WORDS, PICTURED, task.observation_range, marks)

    def claims(self, values: Values) -> Sequence[Claim]:
        ends = {name: values[f"{name} heights"][:, -1] for name in WORDS}
        made = []
        for name in ("static", "grown", "knee static", "knee grown"):
            start = values[f"{name} heights"][:, len(values["time"]) // 20]
            gained, high = mean_of(ends[name] - start), share_of(ends[name] > HIGH)
            made += [
                Claim(
                    f"Local policies learn on a body: hoppers come to hop higher ({WORDS[name]}).",
                    "section 6.5.4",
                    "higher at the end than after a twentieth of the practice: difference above 0",
                    gained,
                    gained.low > 0,
                    "m",
                    f"At the end {median_of(ends[name])} m.",
                ),
                Claim(
                    f"They hop higher than random firing does ({WORDS[name]}).",
                    "our own expectation",
                    f"above {HIGH:g} m at the end: in most seeds",
                    high,
                    high.low > 0.5,
                ),
            ]
        for one_, other in COMPARED:
            less = mean_of(ends[one_] - ends[other])
            made.append(
                Claim(
                    f"{WORDS[one_][0].upper()}{WORDS[one_][1:]}, learn as well as {WORDS[other]}.",
                    "our own expectation",
                    "height at the end of the same practice: the interval of the difference above −0.05 m",
                    less,
                    less.low > -0.05,
                    "m",
                    f"{ends[one_].mean():.2f} m and {ends[other].mean():.2f} m.",
                )
            )
        return made


def active(policy: Policy, task: Hopper) -> np.ndarray:
    """The probability that each pair of muscles is active, on the ground and in the air, over angle and velocity:
    `(contacts, cells, cells, groups)`, velocity rising along the second axis and angle along the third."""
    *_, angle, velocity = task.observation_range
    sides = [np.linspace(*ends, CELLS, dtype=np.float32) for ends in (angle, velocity)]
    places = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    groups = len(task.dynamics.groups)
    found = []
    for contact in (1.0, -1.0):
        seen = jnp.asarray(places)
        if task.observe_contact:
            seen = jnp.concatenate([jnp.full((len(places), 1), contact), seen], axis=1)
        silent = 1 - np.asarray(jax.vmap(policy.prob)(seen))
        each = [1 - silent[:, group::groups].prod(1) for group in range(groups)]
        found.append(np.stack(each, axis=-1).reshape(CELLS, CELLS, groups))
    return np.stack(found)


def _states(outcome: Any, task: Any) -> np.ndarray:
    """Contact, angle and velocity as they may be observed, `(seeds, decisions, 3)`."""
    sensors = outcome.sensors
    angle = sensors["knee_angle"] + np.deg2rad(90.0 - task.centre)
    contact = np.where(sensors["foot_contact"] > 0, 1.0, -1.0)
    return np.stack([contact, angle, task.velocity_scale * sensors["knee_velocity"]], axis=-1).astype(np.float32)
