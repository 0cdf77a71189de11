"""Section 6.5.4: local policies on a body, the hopper."""

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.learning import Learner
from motorgrad.policies import Policy
from motorgrad.schema import count, number
from motorgrad.statistics import mean_of, median_of, share_of
from motorgrad.tasks import Hopper
from motorgrad.training import agent_for, evaluate
from motorgrad_thesis._claims import Claim, above, more_than_half, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, new_figure
from motorgrad_thesis.chapter_5._hopper_study import HIGH, practice_heights
from motorgrad_thesis.chapter_6._local_study import median_row, policy_at

POLICY_LABELS = {
    "planes": "two hyperplanes",
    "static": "local units, present from the start",
    "grown": "local units, added one by one",
    "knee planes": "two hyperplanes over the knee alone",
    "knee static": "local units over the knee alone, present from the start",
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
GROWTH = {"shrink": 0.999, "centre": 0.0, "width": 1.5, "cutoff": 0.4}
"""Wide enough initially for the whole range of observations; units shrink four times as fast as the particle's, because
practice has an eighth of the decisions."""

PERIOD = 0.02  # s
CELLS = 60  # along each side of a picture
WATCHED = 1_000  # decisions
PANELS = (("flexors", 0, 0), ("extensors", 0, 1), ("flexors", 1, 0), ("extensors", 1, 1))
"""Muscles; on the ground (0) or in the air (1); index of the group."""

PLACES = ("on the ground", "in the air")
STYLES = (("0.35", "-"), ("C0", "-"), ("C2", "-"), ("0.35", "--"), ("C0", "--"), ("C2", "--"))
SHOWN = 400  # states


@experiment("sec-6.5.4-hopper", "local units for the hopper", "section 6.5.4")
class LocalHopper(Experiment):
    """Hoppers with local units instead of hyperplanes, over the angle and velocity of the knee, with and without
    contact as a third input: 16 units present from the start, in pairs, or 8 added one by one. Units drive flexors and
    extensors alternately, and a pair of muscles is active while any of its units fires. Heights of hops over equal
    practice; and, for the median seed, the states in which each muscle is active.
    """

    reading: ClassVar[str] = "Local units have the exact gradient, z², not the printed score, z² − 1."

    seconds: float = number(500.0, 50 * PERIOD, unit="simulated s", help="length of every hopper's practice")
    seeds: int = count(20, 2, 10_000, help="number of hoppers of each kind")
    static: int = count(16, 1, 10_000, help="number of local units that are present from the start")
    grown: int = count(8, 1, 10_000, help="number of local units that are added at even intervals")

    def validate(self) -> None:
        super().validate()
        for name in POLICY_LABELS:
            self.learner(name)

    quick = smoke(seconds=54.0, seeds=2, grown=2)

    @property
    def decisions(self) -> int:
        return round(self.seconds / PERIOD)

    def learner(self, name: str) -> tuple[Hopper, Learner]:
        """The task with this many units, and the learner; all with the thesis's decay."""
        kind = name.removeprefix("knee ")
        units = {"planes": None, "static": self.static, "grown": self.grown}[kind]
        task = Hopper(reward_type="apex", action_period=PERIOD, units=units, observe_contact=kind == name)
        changes: dict[str, Any] = {
            "planes": {"learning_rate": 5e-4},
            "static": {"policy": {"kind": "tiles", "copies": 2, "width": 0.25}, "learning_rate": STATIC_RATES},
            "grown": {
                "policy": "growing",
                "growth": {"criterion": {"kind": "clock", "interval": self.decisions // self.grown}, **GROWTH},
                "learning_rate": GROWN_RATES,
            },
        }[kind]
        return task, agent_for(task, decay=0.98, **changes)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name in POLICY_LABELS:
            task, settings = self.learner(name)
            run = work.train(task, settings, self.decisions, self.seeds)
            found["time"], heights, _ = practice_heights(run)
            row = median_row(heights[:, -1])
            seen = work.part(f"{name} watched", lambda run=run: {"sensors": _states(evaluate(run, WATCHED), run.task)})
            found |= {
                f"{name} heights": heights,
                f"{name} reward": run.curve()[1],
                f"{name} row": np.array(row),
                f"{name} states": seen["sensors"][row],
                f"{name} active": muscle_activity(policy_at(run.policies, row), task),
            }
        return found

    def figure(self, values: Values) -> Figure:
        """Heights over practice; and for the policies in `pictured`, activity of each pair of muscles over angle and
        velocity, with visited states."""
        task = self.learner("planes")[0]
        marks = np.arange(1, self.grown) * self.seconds / self.grown
        figure = new_figure(10.4, 13.4)
        halves: Any = figure.subfigures(2, 1, height_ratios=[1, 3.2])
        above, below = halves
        shown: Any = None
        axes = above.subplots()
        for (name, label), (colour, line) in zip(POLICY_LABELS.items(), STYLES, strict=True):
            draw_band(axes, values["time"], values[f"{name} heights"], colour, label, linestyle=line)
        for time in marks:
            axes.axvline(time, color="0.88", linewidth=0.7, zorder=0)
        axes.set(
            xlabel="simulated s of practice; lines: a unit is added", ylabel="mean height of hops, m", ylim=(0, None)
        )
        axes.legend(loc="upper left", fontsize=8.5)
        panels: Any = below.subplots(len(PICTURED), len(PANELS), sharex=True, sharey=True)
        for row, name in zip(panels, PICTURED, strict=True):
            for axes, (muscles, place, group) in zip(row, PANELS, strict=True):
                shown = _muscle(axes, values, name, place, group, task.observation_range)
                axes.set_title(f"{muscles}, {PLACES[place]}", fontsize=9)
            row[0].set_ylabel(
                POLICY_LABELS[name].replace(", ", ",\n").replace(" over", "\nover") + "\nvelocity × scale", fontsize=8
            )
        for axes in panels[-1]:
            axes.set_xlabel("knee angle, rad from 90°", fontsize=9)
        below.colorbar(shown, ax=panels, shrink=0.5, label="probability of activity")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        ends = {name: values[f"{name} heights"][:, -1] for name in POLICY_LABELS}
        for name in ("static", "grown", "knee static", "knee grown"):
            start = values[f"{name} heights"][:, len(values["time"]) // 20]
            yield positive(
                f"Local policies learn on a body: hops become higher ({POLICY_LABELS[name]}).",
                mean_of(ends[name] - start),
                "height at the end minus that after a twentieth of the practice",
                "m",
                note=f"Final height {median_of(ends[name]).words('m')}.",
                of="Local policies learn on a body.",
            )
            yield more_than_half(
                f"They hop higher than with random firing ({POLICY_LABELS[name]}).",
                share_of(ends[name] > HIGH),
                f"share of seeds above {HIGH:g} m at the end",
                kind="extension",
            )
        for one_, other in COMPARED:
            yield above(
                -0.05,
                f"{POLICY_LABELS[one_][0].upper()}{POLICY_LABELS[one_][1:]}, learn as well as {POLICY_LABELS[other]}.",
                mean_of(ends[one_] - ends[other]),
                "difference of final heights",
                "m",
                note=f"{ends[one_].mean():.2f} m and {ends[other].mean():.2f} m.",
                kind="extension",
            )


def muscle_activity(policy: Policy, task: Hopper) -> np.ndarray:
    """Probability that each pair of muscles is active, on the ground and in the air, over angle and velocity:
    `(contacts, cells, cells, groups)`, with velocity along the second axis and angle along the third."""
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


def _muscle(
    axes: Axes, values: Values, name: str, place: int, group: int, ranges: Sequence[tuple[float, float]]
) -> Any:
    """Activity of a pair of muscles, and visited states, on the ground or in the air."""
    extent = (*ranges[1], *ranges[2])
    active = values[f"{name} active"][place, :, :, group]
    shown = axes.imshow(active, origin="lower", extent=extent, aspect="auto", cmap="viridis", vmin=0, vmax=1)
    states = values[f"{name} states"]
    states = states[states[:, 0] == (1.0, -1.0)[place]][:SHOWN]
    axes.plot(states[:, 1], states[:, 2], ".", color="white", markersize=2.2, alpha=0.6)
    axes.set(xlim=ranges[1], ylim=ranges[2])
    return shown
