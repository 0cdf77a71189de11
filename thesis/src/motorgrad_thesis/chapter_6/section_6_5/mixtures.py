"""Sections 6.5.2 and 6.5.4: local units combined with global ones, and local units that learn their forces."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from motorgrad.plane import draw_paths, draw_regions, draw_units, trajectories
from motorgrad.policies import GradedPool
from motorgrad.statistics import mean_of, share_of
from motorgrad.tasks import FallingParticle
from motorgrad.training import Run
from motorgrad_thesis._claims import Claim, at_least, more_than_half, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Figure, draw_band, new_figure
from motorgrad_thesis.chapter_6._local_study import (
    LayoutStudy,
    frozen_reward,
    gaussians,
    late_reward,
    median_row,
    policy_at,
)
from motorgrad_thesis.chapter_6.section_6_3_noise import SMOOTH

AS_WELL = 0.9  # fraction of the plain tiling's reward
DRAWN = 5  # paths; those that hover are long
LOCAL = {"centre": 2e-4, "log_width": 8e-4}
RIGHT = (0.4, 0.0)
UP = (0.0, 0.4)
STRENGTH = {**LOCAL, "strength": 0.01, "log_deviation": 0.01 / 3}


class Kind(NamedTuple):
    """A kind of policy: description, changes to the task, and changes to the learner."""

    words: str
    task: Mapping[str, Any]
    changes: Mapping[str, Any]


POLICY_KINDS = {
    "plain": Kind("8 local units", {}, {}),
    "mixture": Kind(
        "8 local units and 2 hyperplanes",
        {"units": 10},
        {
            "policy": {"kind": "mixture", "copies": 2},
            "learning_rate": {**LOCAL, "weights": 0.03, "bias": 0.03},
        },
    ),
    "graded": Kind(
        "8 local units of learned strength",
        {"forces": (RIGHT,)},
        {"policy": {"kind": "graded-tiles", "copies": 2}, "learning_rate": STRENGTH},
    ),
    "plane": Kind(
        "8 and 8 local units of learned strength across and up",
        {"units": 16, "forces": (RIGHT, UP)},
        {"policy": {"kind": "graded-tiles", "copies": 4}, "learning_rate": STRENGTH},
    ),
}
"""New rates were chosen among three in the layout R3, by final reward over 24 other seeds; the last kind has those of
the third."""


AXES = (("graded", 0), ("plane", 0), ("plane", 1))


GRADED = [name for name, kind in POLICY_KINDS.items() if "strength" in kind.changes.get("learning_rate", {})]


@experiment("sec-6.5-mixtures", "mixtures, and learned forces", "section 6.5")
class Mixtures(LayoutStudy):
    """Kinds of policies learn R1 and R2: local units that push to fixed sides; the same with two additional
    hyperplanes, which push anywhere; local units that learn the side and strength of their push; and twice as many of
    these, half of them horizontal and half vertical, which together may push in any direction.
    """

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for layout in self.layouts:
            for name, kind in POLICY_KINDS.items():
                task = self._task(layout, name)
                run = self.learned(work, task, **kind.changes)
                found["decision"], found[f"{layout} {name}"] = run.curve()
                found[f"{layout} {name} late"] = late_reward(run)
                decisions = min(self.decisions, 2_500)
                found[f"{layout} {name} untrained"] = frozen_reward(work, task, run.initial, decisions, **kind.changes)
                if name in GRADED:
                    found |= {f"{layout} {name} {key}": value for key, value in _forces(task, run).items()}
        return found

    @staticmethod
    def _task(layout: str, name: str) -> FallingParticle:
        return FallingParticle(layout=layout, **POLICY_KINDS[name].task)  # type: ignore[arg-type]

    def figure(self, values: Values) -> Figure:
        figure = new_figure(10.5, 3.0 * len(self.layouts))
        smooth = min(SMOOTH, len(values["decision"]))
        thousand = values["decision"] / 1000
        rows = figure.subplots(len(self.layouts), 1 + len(GRADED), width_ratios=[1.25, 1, 1], squeeze=False)
        for (curves, *planes), layout in zip(rows, self.layouts, strict=True):
            for number, (name, kind) in enumerate(POLICY_KINDS.items()):
                reward = values[f"{layout} {name}"]
                colour = f"C{number}"
                draw_band(curves, thousand, reward, colour, kind.words, records=smooth)
            curves.set(xlabel="thousand decisions", ylabel=f"{layout}: reward per decision")
            curves.legend(loc="lower right", fontsize=8)
            for axes, name in zip(planes, GRADED, strict=True):
                key = f"{layout} {name}"
                task = self._task(layout, name)
                row = int(values[f"{key} row"])
                draw_regions(axes, task.places)
                paths = np.split(values[f"{key} paths"], values[f"{key} ends"][:-1])
                draw_paths(axes, paths[:DRAWN])
                units = gaussians(values[f"{key} centre"][row], values[f"{key} log width"][row])
                draw_units(axes, units, values[f"{key} strength"][row][:, None] * np.array(task.dynamics.forces))
                axes.set_title(f"{layout}: {POLICY_KINDS[name].words.partition('of ')[2]}", fontsize=9.5)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for layout in self.layouts:
            plain = values[f"{layout} plain late"]
            sources = {"mixture": "section 6.5.2", "graded": "section 6.5.4", "plane": "section 6.5.4"}
            for name, source in sources.items():
                reward = values[f"{layout} {name} late"]
                words = POLICY_KINDS[name].words
                yield positive(
                    f"This policy learns: {words} ({layout}).",
                    mean_of(reward - values[f"{layout} {name} untrained"]),
                    "reward in the last 200 of 2,000 episodes minus that before learning",
                    "per decision",
                    source=source,
                    of=f"This policy learns: {words}.",
                )
                yield at_least(
                    AS_WELL,
                    f"It reaches the reward of the plain tiling: {words} ({layout}).",
                    mean_of(reward / plain.mean()),
                    f"reward relative to the mean of {POLICY_KINDS['plain'].words}",
                    note=f"{reward.mean():.3f} and {plain.mean():.3f}.",
                    kind="extension",
                )
            for name, axis in AXES:
                yield self._sides(values, layout, name, axis)

    @staticmethod
    def _sides(values: Values, layout: str, name: str, axis: int) -> Claim:
        """Whether the units along an axis learn to push both ways."""
        strength = values[f"{layout} {name} strength"][:, axis :: len(POLICY_KINDS[name].task["forces"])]
        ways = ("left", "right") if axis == 0 else ("down", "up")
        return more_than_half(
            f"Units learn to push {ways[0]} or {ways[1]} ({layout}, {POLICY_KINDS[name].words}).",
            share_of((strength > 0).any(1) & (strength < 0).any(1)),
            f"all start neutral; share of seeds in which in the end some push {ways[0]} and some {ways[1]}",
            note=f"Mean size of the strengths {np.abs(strength).mean():.2f}; a fixed force has 1.",
            of="Units learn the direction of their force.",
            source="section 6.5.4",
        )


def _forces(task: FallingParticle, run: Run) -> Values:
    """Learned strengths of all seeds, their units, and the paths of the median one."""
    policies: Any = run.policies
    assert isinstance(policies, GradedPool)
    pool: Any = policies.pool
    row = median_row(late_reward(run))
    paths = trajectories(task, policy_at(policies, row), DRAWN)
    return {
        "row": np.array(row),
        "strength": np.asarray(policies.strength),
        "centre": np.asarray(pool.centre),
        "log width": np.asarray(pool.log_width),
        "paths": np.concatenate(paths),
        "ends": np.cumsum([len(path) for path in paths]),
    }
