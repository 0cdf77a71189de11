"""Sections 6.2.1 and 6.5.2: local units that lie along the inputs, and units that turn, where the reward is oblique."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.plane import draw_paths, draw_regions, draw_units
from motorgrad.policies import OrientedBoxes, OrientedGaussians, trainable
from motorgrad.schema import Range, count, static
from motorgrad.statistics import Measured, mean_of
from motorgrad.tasks import FallingParticle, Region
from motorgrad.training import Run, agent_for
from motorgrad_thesis._claims import Claim, at_least, negative, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, draw_intervals, new_figure
from motorgrad_thesis.chapter_6._local_study import (
    LocalStudy,
    frozen_reward,
    late_reward,
    median_row,
    policy_at,
    stored_paths,
    visited,
)
from motorgrad_thesis.chapter_6.section_6_3_noise import SMOOTH

RIDGE = np.round(np.linspace(0.15, 0.85, 8), 3).tolist()
WIDTH = 0.06  # of the regions that make up a ridge
RIDGES: dict[str, tuple[Region, ...]] = {
    "diagonal": tuple((1.0, x, 1.0 - x, WIDTH, WIDTH) for x in RIDGE),
    "upright": tuple((1.0, 0.5, y, WIDTH, WIDTH) for y in RIDGE),
}
"""Regions of reward along a line from the top to the floor."""
SCATTERED = {"low": 0.0, "high": 1.0, "width": 0.2}
HARD = {"hardness": 15.0}
RATES = {"centre": 2e-4, "log_width": 8e-4}  # the task's
RATE = 8e-4  # of every other parameter: the lowest and best of three, up to 0.03, for each kind, by 12 other seeds
AS_WELL = 0.95  # fraction of the reward of aligned units that turning must leave on the upright ridge
DRAWN = 6  # paths
LOOKS = 20  # episodes in which the entropy is taken
UNTRAINED = 2_500  # decisions before learning


class Kind(NamedTuple):
    """A kind of units: description, initial policy, and its parameters beside centres and widths."""

    words: str
    policy: Mapping[str, Any]
    learned: tuple[str, ...]


KINDS = {
    "gaussians": Kind("aligned Gaussians", {"kind": "gaussians", **SCATTERED}, ()),
    "oriented-gaussians": Kind("Gaussians of full covariance", {"kind": "oriented-gaussians", **SCATTERED}, ("shear",)),
    "soft-boxes": Kind("aligned boxes", {"kind": "soft-boxes", **SCATTERED, **HARD}, ("log_hardness",)),
    "oriented-boxes": Kind(
        "boxes that turn", {"kind": "oriented-boxes", **SCATTERED, **HARD}, ("log_hardness", "turn")
    ),
}
PAIRS = {"gaussians": "oriented-gaussians", "soft-boxes": "oriented-boxes"}
"""Each kind of aligned units, and its like that turns."""


@experiment("sec-6.2.1-covariance", "units of full covariance", "section 6.2.1")
class Covariance(LocalStudy):
    """A particle falls along a ridge of reward from the upper left to the lower right. Gaussians and soft boxes that
    lie along the inputs are compared with their likes that turn: Gaussians of full covariance and oriented boxes. All
    kinds start round or square, at the same random places for each seed. The same is done on an upright ridge, where
    turning is of no use.
    """

    seeds: int = 24
    units: tuple[int, ...] = static(
        (2, 4, 8), allowed=Range(2, 1_000, kind="int"), help="numbers of units on the diagonal ridge, rising"
    )
    shown: int = count(4, 2, help="which of these numbers is tried on the upright ridge, too, and drawn")

    def validate(self) -> None:
        super().validate()
        self.check_rising("units")
        if self.shown not in self.units:
            raise ValueError(f"shown = {self.shown}: must be among units, {self.units}")

    quick = smoke(decisions=2_000, seeds=3, units=(4,))

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for ridge in RIDGES:
            for units in self.units if ridge == "diagonal" else (self.shown,):
                for name in KINDS:
                    task = FallingParticle(regions=RIDGES[ridge], units=units)
                    changes = _changes(name)
                    run = work.train(task, agent_for(task, **changes), self.decisions, self.seeds)
                    key = f"{ridge} {units} {name}"
                    found["decision"], found[key] = run.curve()
                    found[f"{key} late"] = late_reward(run)
                    found[f"{key} untrained"] = frozen_reward(
                        work, task, run.initial, min(UNTRAINED, self.decisions), **changes
                    )
                    if ridge == "diagonal" and units == self.shown:
                        looked = work.part(f"looks-{name}", lambda task=task, run=run: _looks(task, run))
                        found |= {f"{name} {field}": value for field, value in looked.items()}
        return found

    def figure(self, values: Values) -> Figure:
        figure = new_figure(10.5, 6.4)
        (curves, counts, aligned), (upright, *turned) = figure.subplots(2, 3)
        thousand = values["decision"] / 1000
        smooth = min(SMOOTH, len(thousand))
        for axes, ridge in ((curves, "diagonal"), (upright, "upright")):
            for number, (name, kind) in enumerate(KINDS.items()):
                draw_band(
                    axes, thousand, values[f"{ridge} {self.shown} {name}"], f"C{number}", kind.words, records=smooth
                )
            axes.set(xlabel="thousand decisions", ylabel="reward per decision")
            axes.set_title(f"{ridge} ridge, {self.shown} units", fontsize=9.5)
        curves.legend(loc="lower right", fontsize=7.5)
        places = np.arange(len(self.units))
        for number, name in enumerate(KINDS):
            late = [mean_of(values[f"diagonal {units} {name} late"]) for units in self.units]
            draw_intervals(counts, places + 0.08 * (number - 1.5), late, fmt="o", color=f"C{number}", markersize=4)
        counts.set(xlabel="units", ylabel="reward in the last tenth", xticks=places)
        counts.set_xticklabels([str(units) for units in self.units])
        counts.set_title("diagonal ridge, mean and 95 %", fontsize=9.5)
        for axes, name in zip((aligned, *turned), ("gaussians", "oriented-gaussians", "oriented-boxes"), strict=True):
            self._draw(axes, values, name)
        return figure

    def _draw(self, axes: Axes, values: Values, name: str) -> None:
        """The median seed's units of a kind, and its paths."""
        task = FallingParticle(regions=RIDGES["diagonal"], units=self.shown)
        fields: dict[str, Any] = {field: jnp.asarray(values[f"{name} {field}"]) for field in ("centre", "log_width")}
        fields |= {field: jnp.asarray(values[f"{name} {field}"]) for field in KINDS[name].learned}
        shear = jnp.zeros((self.shown, 1))
        unit = OrientedBoxes(**fields) if "boxes" in name else OrientedGaussians(**{"shear": shear, **fields})
        draw_regions(axes, task.places)
        draw_paths(axes, np.split(values[f"{name} paths"], values[f"{name} ends"][:-1]))
        draw_units(axes, unit, task.dynamics.forces)
        axes.set_title(f"{KINDS[name].words}, median seed", fontsize=9.5)

    def claims(self, values: Values) -> Iterator[Claim]:
        for aligned, turned in PAIRS.items():
            statement = f"On the diagonal ridge, {KINDS[turned].words} earn more than {KINDS[aligned].words}"
            for units in self.units:
                yield positive(
                    f"{statement} ({units} units).",
                    self._gain(values, f"diagonal {units}", aligned, turned),
                    "difference of the reward in the last tenth, seed by seed,",
                    "per decision",
                    kind="extension",
                    of=f"{statement}.",
                )
        for aligned, turned in PAIRS.items():
            late = {name: values[f"upright {self.shown} {name} late"] for name in (aligned, turned)}
            yield at_least(
                AS_WELL,
                f"On the upright ridge, {KINDS[turned].words} lose little by learning to turn ({self.shown} units).",
                mean_of(late[turned] / late[aligned].mean()),
                f"reward in the last tenth relative to the mean of {KINDS[aligned].words}",
                note=f"{late[turned].mean():.3f} and {late[aligned].mean():.3f}.",
                kind="extension",
            )
        key = f"diagonal {self.shown} oriented-boxes"
        yield positive(
            f"Oriented boxes with axes of different lengths learn ({self.shown} units, diagonal ridge).",
            mean_of(values[f"{key} late"] - values[f"{key} untrained"]),
            "reward in the last tenth minus that before learning",
            "per decision",
            source="section 6.5.2",
        )
        entropy = {name: values[f"{name} entropy"] for name in ("oriented-gaussians", "oriented-boxes")}
        yield negative(
            "Units with a hardness of their own become more nearly deterministic than Gaussians.",
            mean_of(entropy["oriented-boxes"] - entropy["oriented-gaussians"]),
            "entropy of a unit's action, at the places that its particle visits after learning, boxes minus Gaussians,",
            "nats",
            note=f"{entropy['oriented-boxes'].mean():.3f} and {entropy['oriented-gaussians'].mean():.3f}; a fair coin "
            "has 0.693.",
            source="section 6.5.2",
        )

    @staticmethod
    def _gain(values: Values, key: str, aligned: str, turned: str) -> Measured:
        return mean_of(values[f"{key} {turned} late"] - values[f"{key} {aligned} late"])


def _changes(name: str) -> dict[str, Any]:
    kind = KINDS[name]
    return {"policy": dict(kind.policy), "learning_rate": RATES | dict.fromkeys(kind.learned, RATE)}


def _looks(task: FallingParticle, run: Run) -> Values:
    """The units of the median seed and its paths, and the entropy of a unit of each seed where its particle goes."""
    policies: Any = run.policies
    entropies = eqx.filter_jit(lambda policy, seen: jnp.mean(jax.vmap(policy.entropy)(seen)))
    entropy = []
    for row in range(len(run.seeds)):
        policy = policy_at(policies, row)
        places = visited(task, policy, LOOKS)
        seen = np.resize(places, (LOOKS * 30, 2))  # of one length for all seeds, so that it is compiled once
        entropy.append(float(entropies(policy, jnp.asarray(seen, jnp.float32))) / policy.outputs)
    typical = policy_at(policies, median_row(late_reward(run)))
    fields = {name: np.asarray(value) for name, value in vars(trainable(typical)).items() if eqx.is_array(value)}
    return {"entropy": np.array(entropy), **fields, **stored_paths(task, typical, DRAWN)}
