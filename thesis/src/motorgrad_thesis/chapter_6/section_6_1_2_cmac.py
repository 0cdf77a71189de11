"""Sections 6.1.2 and 6.4.2: tile coding (CMAC) as the features of hyperplanes, and its tricks against many inputs."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from motorgrad.policies import trainable
from motorgrad.statistics import Measured, mean_of
from motorgrad.tasks import FallingParticle
from motorgrad_thesis._claims import Claim, at_least, positive, within
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, draw_intervals, new_figure
from motorgrad_thesis.chapter_6._local_study import LocalStudy, late_reward
from motorgrad_thesis.chapter_6.section_6_3_noise import SMOOTH

SIZES = "The thesis speaks of the architecture; the task and the numbers and widths of its features are ours."
SIMILAR = 0.1  # of the reward: a smaller difference counts as similar, a smaller loss as little
OF_FOUR = {"cells": 3, "low": -0.5}
"""Cells for positions in [0, 1] and velocities in [−0.5, 0.5] together, half as wide as the box."""


class Kind(NamedTuple):
    """A kind of policy: description; features, none for local units; learning rate of weights and biases, none for the
    task's; and whether it sees the velocity, too."""

    words: str
    features: Mapping[str, Any] | None
    rate: float | None
    velocity: bool


def _tiles(**changes: Any) -> Mapping[str, Any]:
    """The cells of eight tilings of the box, and nothing else."""
    return {"raw": False, "tiles": {"tilings": 8, "cells": 4, "low": 0.0, "high": 1.0, **changes}}


KINDS = {
    "local": Kind("8 local units", None, None, False),
    "tiles": Kind("8 tilings", _tiles(), 0.03, False),
    "radial": Kind(
        "fixed radial basis functions", {"raw": False, "nonlinear": 256, "shape": "grid", "scale": 16.0}, 0.1, False
    ),
    "random": Kind(
        "random Fourier features", {"raw": False, "nonlinear": 200, "shape": "fourier", "scale": 4.0}, 0.003, False
    ),
    "local 4": Kind("8 local units", None, None, True),
    "tiles 4": Kind("4 tilings", _tiles(**OF_FOUR, tilings=4), 0.03, True),
    "hashed 4": Kind("4 tilings, hashed", _tiles(**OF_FOUR, tilings=4, slots=128), 0.03, True),
    "ignoring 4": Kind("12 tilings of 2 inputs each", _tiles(**OF_FOUR, tilings=12, sees=2), 0.01, True),
}
"""Rates are better than their neighbours among 0.001, 0.003, …, 0.3, over 4 other seeds. Of the radial functions, whose
deviation is 0.09, a quarter are in the box, on a lattice of 0.125."""


@experiment("sec-6.1.2-cmac", "tile coding for policies", "section 6.1.2")
class TilesForPolicies(LocalStudy):
    """Eight hyperplanes learn R1 on the cells of eight overlapping grids (CMAC). They are compared with the local units
    of the thesis, with hyperplanes on fixed radial basis functions, which are local, and on random Fourier features,
    which are global. Then they see the velocity, too: all cells of four inputs; hashed into an eighth as many features;
    and with grids that ignore two of the four inputs each.
    """

    decisions: int = 25_000
    seeds: int = 20

    quick = smoke(decisions=2_000, seeds=3)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, kind in KINDS.items():
            task = FallingParticle(layout="R1", observe_velocity=kind.velocity)
            run = self.learned(work, task, **_changes(kind))
            found["decision"], found[name] = run.curve()
            found[f"{name} late"] = late_reward(run)
            leaves = jax.tree.leaves(trainable(run.initial))
            found[f"{name} learned"] = np.array(sum(leaf[0].size for leaf in leaves))
        return found

    def figure(self, values: Values) -> Figure:
        figure = new_figure(10.5, 3.6)
        two, four, ends = figure.subplots(1, 3, width_ratios=[1.2, 1.2, 1])
        thousand = values["decision"] / 1000
        smooth = min(SMOOTH, len(thousand))
        for rank, (name, kind) in enumerate(KINDS.items()):
            axes = four if kind.velocity else two
            draw_band(axes, thousand, values[name], f"C{rank}", kind.words, records=smooth)
            draw_intervals(ends, [rank], [mean_of(values[f"{name} late"])], across=True, fmt="o", color=f"C{rank}")
        for axes, title in ((two, "position observed"), (four, "position and velocity observed")):
            axes.set_title(title, fontsize=9.5)
            axes.set(xlabel="thousand decisions", ylabel="reward per decision")
            axes.legend(loc="lower right", fontsize=7.5)
        ends.set(xlabel="reward in the last tenth", yticks=range(len(KINDS)))
        ends.set_yticklabels([f"{values[f'{name} learned']:,} numbers" for name in KINDS], fontsize=8)
        ends.set_title("numbers learned; mean and 95 %", fontsize=9.5)
        ends.invert_yaxis()
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        late = {name: values[f"{name} late"] for name in KINDS}
        yield within(
            1 - SIMILAR,
            1 + SIMILAR,
            "Tile coding is similar to a fixed radial basis function network.",
            _relative(late["tiles"], late["radial"]),
            "reward in the last tenth of the episodes, relative to that with radial basis functions,",
            note=_means(late, "tiles", "radial"),
            untested=SIZES,
        )
        for name in ("tiles", "tiles 4"):
            yield positive(
                f"Hyperplanes on tiles learn ({_inputs(name)} inputs).",
                mean_of(late[name] - values[name][:, 0]),
                "reward in the last tenth of the episodes minus that in the first ten",
                "per decision",
                kind="extension",
                of="Hyperplanes on tiles learn.",
            )
        for name, other in (("tiles", "local"), ("tiles 4", "local 4")):
            yield at_least(
                1 - SIMILAR,
                f"They reach the reward of local units ({_inputs(name)} inputs).",
                _relative(late[name], late[other]),
                "relative reward in the last tenth of the episodes",
                note=_means(late, name, other),
                kind="extension",
                of="They reach the reward of local units.",
            )
        yield positive(
            "They earn more than hyperplanes on as many global features.",
            mean_of(late["tiles"] - late["random"]),
            "difference of the reward in the last tenth, seed by seed,",
            "per decision",
            note=_means(late, "tiles", "random"),
            kind="extension",
        )
        for name, statement in (
            ("hashed 4", "Hashing handles the dimensions of CMAC."),
            ("ignoring 4", "So does ignoring some dimensions in each tiling."),
        ):
            learned = f"{values[f'{name} learned']:,} learned numbers instead of {values['tiles 4 learned']:,}"
            yield at_least(
                1 - SIMILAR,
                statement,
                _relative(late[name], late["tiles 4"]),
                "reward with four inputs in the last tenth of the episodes, relative to that with all cells,",
                note=f"With {learned}. {_means(late, name, 'tiles 4')}",
                source="section 6.4.2",
                untested=SIZES,
            )


def _changes(kind: Kind) -> Mapping[str, Any]:
    """The changes that make the task's learner one of this kind."""
    if kind.features is None:
        return {}
    policy = {"kind": "hyperplanes", "features": kind.features}
    return {"policy": policy, "learning_rate": {"weights": kind.rate, "bias": kind.rate}}


def _inputs(name: str) -> str:
    return "four" if KINDS[name].velocity else "two"


def _relative(reward: np.ndarray, other: np.ndarray) -> Measured:
    """The mean reward relative to another; its interval is that of the differences, seed by seed."""
    return mean_of(1 + (reward - other) / other.mean())


def _means(late: Mapping[str, np.ndarray], name: str, other: str) -> str:
    return f"{late[name].mean():.3f} and {late[other].mean():.3f}."
