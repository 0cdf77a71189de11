"""Figure 6.7: a policy while units are added one by one."""

from collections.abc import Iterator, Mapping

import numpy as np

from motorgrad.schema import count
from motorgrad.statistics import mean_of
from motorgrad.tasks import FallingParticle
from motorgrad.training import Run
from motorgrad_thesis._claims import Claim, more_than_half, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Figure, new_figure
from motorgrad_thesis.chapter_6._local_study import (
    draw_tile,
    hide_axes,
    median_row,
    policy_at,
    prefixed,
    stored_paths,
    tile_grid,
)
from motorgrad_thesis.chapter_6._pairs import BothPairs, Pair, settings_of
from motorgrad_thesis.chapter_6.section_6_4._growing_study import GrowingStudy, after_units, grown_policies

SHOWN = (1, 2, 3, 4, 6, 9, 13, 16, 19, 20)
LOCAL = 0.25
"""Width up to which a unit counts as local: half of the box is four of them."""


@experiment("fig-6.7", "a policy that grows", "figure 6.7")
class GrowingPolicy(BothPairs, GrowingStudy):
    """A policy grows in the layout R3: local units are added one by one, wide at first, and find their places. The
    units of the median seed with paths of its particle, at the end of the learning phase that follows each addition.
    """

    drawn: int = count(10, 1, help="number of episodes whose paths are in each tile")

    @property
    def task(self) -> FallingParticle:
        return FallingParticle(layout="R3", units=self.units)

    def films(self, work: Workspace) -> Mapping[str, Run]:
        settings = self.growing(self.task, **settings_of(self.pairs[0]))
        return {"animation": self.learned(work, self.task, settings)}

    def measure(self, work: Workspace, pair: Pair) -> Values:
        task = self.task
        run = self.learned(work, task, self.growing(task, **settings_of(pair)))
        decision, reward = run.curve()
        found: Values = {"reward": after_units(decision, reward, self.units)}
        row = median_row(found["reward"][:, -1])
        found |= {"row": np.array(row), "counts": np.array(self.counts(SHOWN))}
        history = grown_policies(run, range(1, self.units + 1))
        found |= {"centre": np.asarray(history.pool.centre), "log width": np.asarray(history.pool.log_width)}
        for size in found["counts"]:
            policy = policy_at(policy_at(history, size - 1), row)
            found |= prefixed(str(size), stored_paths(task, policy, self.drawn))
            shapes = {"centre": policy.pool.centre, "log width": policy.pool.log_width}
            found |= prefixed(str(size), {name: np.asarray(shape) for name, shape in shapes.items()})
        return found

    def draw(self, values: Values) -> Figure:

        counts = values["counts"]
        row = int(values["row"])
        rows, columns = tile_grid(len(counts), 5)
        figure = new_figure(1.9 * columns, 2.12 * rows)
        tiles = np.ravel(figure.subplots(rows, columns))
        for axes, size in zip(tiles, counts, strict=False):
            draw_tile(axes, self.task, values, str(size), units=int(size))
            words = "1 unit" if size == 1 else f"{size} units"
            axes.set_title(f"{words}: {values['reward'][row, size - 1]:.3f}", fontsize=9)
        hide_axes(list(tiles[len(counts) :]))
        return figure

    def judge(self, values: Values, pair: Pair) -> Iterator[Claim]:
        new, others = centre_shifts(values["centre"])
        width = at_own_interval(np.exp(values["log width"])).max(-1)
        local = (width <= LOCAL).mean(1)
        yield positive(
            "Mainly the new unit moves, and finds a place.",
            mean_of(new - others),
            "distance that a unit's centre moves in the interval after its addition minus that of the other units",
            "of the box",
            note=f"{new.mean():.3f} and {others.mean():.3f}; the steps of the new unit are 16 times as long.",
            source="section 6.4.3",
        )
        yield more_than_half(
            "Shrinking forces each new unit to fit a local region.",
            mean_of(local),
            f"share of units with widths of at most {LOCAL:g} at the end of their own interval",
            note=f"The median of the larger width is {np.median(width):.2f}; shrinking alone would end at 0.15.",
            source="section 6.4.3",
        )
        yield positive(
            "A growing policy improves.",
            mean_of(values["reward"][:, -1] - values["reward"][:, 0]),
            f"reward after {self.units} units minus that after 1",
            "reward per decision",
        )


def centre_shifts(centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances by which the centres of the new unit and, on average, of the others move within an interval; means over
    all intervals but the first: `(seeds,)` each.

    **Arguments:** `centre`, at the end of each interval, `(units, seeds, units, 2)`; for a unit that has not been
    added, its initial place.
    """
    count = len(centre)
    new = []
    others = []
    for unit in range(1, count):
        way = np.linalg.norm(centre[unit] - centre[unit - 1], axis=-1)
        new.append(way[:, unit])
        others.append(way[:, :unit].mean(1))
    return np.mean(new, axis=0), np.mean(others, axis=0)


def at_own_interval(history: np.ndarray) -> np.ndarray:
    """The numbers of each unit at the end of its own interval: `(units, seeds, units, …)` to `(seeds, units, …)`."""
    return np.stack([history[unit][:, unit] for unit in range(len(history))], axis=1)
