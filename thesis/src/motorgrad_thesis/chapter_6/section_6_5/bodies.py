"""Section 6.5.4: local units on an arm and on the hexapod, tiled or added one by one."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from motorgrad.learning import Learner
from motorgrad.schema import count
from motorgrad.statistics import mean_of
from motorgrad.tasks import TRIPOD_SYNERGIES, Composed, HexapodSynergy, Task, terms
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, above, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, subplots

MUSCLES = tuple(f"{joint} {kind}" for joint in ("shoulder", "elbow", "biarticular") for kind in ("flexor", "extensor"))
END = 0.1  # of the practice, which counts as its end
BEGIN = 0.05  # as its beginning
SMOOTH = 10  # records
SHRINKING = 0.8  # of the interval between additions, in which a unit shrinks from its first width to its last
PER_INPUT = (2, 3, 4)  # places along every input of a tiling, of which the first is run


class Body(NamedTuple):
    """A task by its number of units, what is measured, and settings of learners.

    - `make`: the task for this many units on each action.
    - `actions`: how many actions there are, which units drive in turn; `inputs`: how many numbers are observed.
    - `metric`, its `unit`, and the `sign` with which it grows when the body does better.
    - `end` of the inputs that tiles cover; `wide` and `narrow`, a new unit's width and that at which it stops
      shrinking.
    - `rates`: learning rates of hyperplanes, tiles and growing pools.
    """

    words: str
    make: Callable[[int], Task]
    actions: int
    inputs: int
    metric: str
    unit: str
    sign: int
    end: float
    wide: float
    narrow: float
    rates: Mapping[str, Any]


@dataclasses.dataclass(frozen=True)
class Reaching(Composed):
    """The reaching arm of composed tasks, with muscles that are on or off, for the thesis's learner."""

    learner: ClassVar[Mapping[str, Any]] = {"policy": "hyperplanes", "decay": 0.95, "learning_rate": 1e-3}

    observations: tuple[Any, ...] = (terms.JointPositions(), terms.JointVelocities(), terms.TargetError())
    actions: Any = "binary"


BODIES = {
    "arm": Body(
        "an arm of six muscles reaches for targets",
        lambda copies: Reaching(groups=MUSCLES * copies),
        6,
        7,
        "distance",
        "m",
        -1,
        1.5,
        3.0,
        1.5,
        {
            "planes": 1e-2,
            "tiled": {"centre": 2.5e-3, "log_width": 1e-2},
            "grown": {"centre": 5e-4, "log_width": 2.5e-3},
        },
    ),
    "hexapod": Body(
        "a hexapod walks on four synergies",
        lambda copies: HexapodSynergy(synergies=TRIPOD_SYNERGIES * copies),
        4,
        6,
        "speed",
        "m/s",
        1,
        1.0,
        3.0,
        1.5,
        {"planes": 1e-3, "tiled": {"centre": 2.5e-4, "log_width": 1e-3}, "grown": {"centre": 2e-4, "log_width": 1e-3}},
    ),
}
KINDS = {
    "planes": ("0.35", "one hyperplane for each action"),
    "tiled": ("C0", "local units, two places along every input"),
    "grown": ("C2", "local units, added one by one"),
}


def tiled_units(body: Body, places: int) -> int:
    """The number of local units of a tiling: for every action one at each place, with so many places along each
    input."""
    return body.actions * places**body.inputs


@experiment("sec-6.5.4-bodies", "local units on an arm and a hexapod", "section 6.5.4")
class LocalBodies(Experiment):
    """An arm of six muscles that reaches for targets, over seven inputs, and the hexapod on four synergies, over six:
    local units that tile the inputs with two places along each, far fewer that are added one by one, and hyperplanes.
    """

    reading: ClassVar[str] = "Local units have the exact gradient, z², not the printed score, z² − 1."

    decisions: int = count(30_000, 1_000, 10**8, help="number of decisions of practice, of 0.02 s")
    seeds: int = count(20, 2, 10_000, help="number of learners of each kind")
    grown: int = count(12, 6, 10_000, help="number of units that are added at even intervals")

    def validate(self) -> None:
        super().validate()
        for name in BODIES:
            self.learner(name, "grown")

    quick = smoke(decisions=9_000, seeds=2, grown=6)

    def learner(self, name: str, kind: str) -> tuple[Task, Learner]:
        """A task with as many units as a policy of this kind has, and the policy's learner."""
        body = BODIES[name]
        places = PER_INPUT[0] ** body.inputs
        copies = {"planes": 1, "tiled": places, "grown": -(-self.grown // body.actions)}[kind]
        task = body.make(copies)
        interval = self.decisions // self.grown
        growth = {
            "criterion": {"kind": "clock", "interval": interval},
            "units": self.grown,
            "centre": 0.0,
            "width": body.wide,
            "cutoff": body.narrow,
            "shrink": (body.narrow / body.wide) ** (1 / (SHRINKING * interval)),
        }
        spread = {"copies": body.actions, "low": -body.end, "high": body.end, "width": 0.5 / PER_INPUT[0]}
        changes: dict[str, Any] = {
            "planes": {"policy": "hyperplanes"},
            "tiled": {"policy": {"kind": "tiles", "p_max": 0.5, **spread}},
            "grown": {"policy": "growing", "growth": growth},
        }[kind]
        return task, agent_for(task, **changes, learning_rate=body.rates[kind])

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, body in BODIES.items():
            for kind in KINDS:
                task, settings = self.learner(name, kind)
                run = work.train(task, settings, self.decisions, self.seeds)
                found["decision"], found[f"{name} {kind}"] = run.curve(body.metric)
        return found

    def figure(self, values: Values) -> Figure:
        figure, panels = subplots(10, 3.8, 1, 2)
        seconds = values["decision"] * 0.02
        for axes, (name, body) in zip(panels, BODIES.items(), strict=True):
            for kind, (colour, words) in KINDS.items():
                many = {"planes": body.actions, "tiled": tiled_units(body, PER_INPUT[0]), "grown": self.grown}[kind]
                draw_band(axes, seconds, values[f"{name} {kind}"], colour, f"{many:,} units: {words}", records=SMOOTH)
            for unit in range(1, self.grown):
                axes.axvline(unit * seconds[-1] / self.grown, color="0.9", linewidth=0.7, zorder=0)
            axes.set(xlabel="simulated s; lines: a unit is added", ylabel=f"{body.metric}, {body.unit}")
            axes.set_title(body.words, fontsize=10)
            axes.set_ylim(0, 1.35 * axes.get_ylim()[1])  # room for the legend above
            axes.legend(fontsize=8, loc="upper left")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        late = values["decision"] > (1 - END) * self.decisions
        early = values["decision"] <= BEGIN * self.decisions
        for name, body in BODIES.items():
            does = {kind: body.sign * np.nanmean(values[f"{name} {kind}"][:, late], axis=1) for kind in KINDS}
            began = {kind: body.sign * np.nanmean(values[f"{name} {kind}"][:, early], axis=1) for kind in KINDS}
            better = "faster than" if body.sign > 0 else "nearer than"
            counts = ", ".join(f"{tiled_units(body, places):,} with {places}" for places in PER_INPUT)
            for kind in ("grown", "tiled"):
                yield positive(
                    f"Local policies apply to realistic motor learning ({body.words}: {KINDS[kind][1]}).",
                    mean_of(does[kind] - began[kind]),
                    f"gain in {body.metric}, from the first twentieth to the last tenth of the practice",
                    body.unit,
                    note=f"At the end {abs(does[kind].mean()):.3f} {body.unit}.",
                    of="Local policies apply to realistic motor learning.",
                )
            yield positive(
                f"Few units that are added one by one learn more than a tiling ({body.words}).",
                mean_of(does["grown"] - does["tiled"]),
                f"{body.metric} at the end, {better} by a tiling with {PER_INPUT[0]} places along every input",
                body.unit,
                note=f"{self.grown} units; a tiling takes {counts} places along each of {body.inputs} inputs.",
                source="section 6.4.1",
                of="Few units that are added one by one learn more than a tiling.",
            )
            yield above(
                0,
                f"They learn more than hyperplanes on the same inputs ({body.words}).",
                mean_of(does["grown"] - does["planes"]),
                f"{body.metric} at the end, {better} by hyperplanes",
                body.unit,
                note=f"Hyperplanes: {abs(does['planes'].mean()):.3f} {body.unit}.",
                kind="extension",
                of="They learn more than hyperplanes on the same inputs.",
            )
