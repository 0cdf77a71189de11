"""Figure 6.2: predictors of the dynamics partition the input space, and with it a simple decision."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad.schema import count, number
from motorgrad.statistics import exact, mean_of
from motorgrad_thesis._claims import Claim, above, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, new_figure

SPEED = 1.0  # forwards, in units of distance per second
# distances
NEAR = 0.25
DISTANT = 2.0
ROUNDS = 60  # of fitting
HALF = 0.5  # a part more or less counts as another number of parts
FITTED = 40  # approximate number of places along each side to which predictors are fitted


@experiment("fig-6.2", "input space partitioning", "figure 6.2")
class Partition(Experiment):
    """An agent that moves straight ahead sees a target at a distance and a bearing. Each of several predictors of the
    next observation owns the region in which it is the best. The decision to brake at a certain distance, a horizontal
    line, is cut by these regions: with constant predictors of the change, as in the thesis, and with linear ones, each
    fitted to the region in which it is the best.
    """

    predictors: int = count(8, 2, 100, help="number of predictors of each kind")
    brake: float = number(0.6, NEAR, DISTANT, help="the distance at which to brake")
    cells: int = count(161, 20, 2_000, help="number of cells along each side of the picture")
    fits: int = count(24, 2, 10_000, help="number of fits of linear predictors, each from another random start")

    quick = smoke(cells=41, fits=3)

    def run(self, work: Workspace) -> Values:
        bearing = np.linspace(-np.pi / 2, np.pi / 2, self.cells)
        distance = np.linspace(NEAR, DISTANT, self.cells)
        places = np.stack(np.meshgrid(bearing, distance), axis=-1)
        changes = change(places)
        constant = np.linspace(-np.pi / 2, np.pi / 2, self.predictors)
        # all predict the same change of distance, which favours none
        best = np.abs(changes[..., :1] - constant).argmin(-1)
        fitted = work.part("fitted", lambda: {"best": self._fitted(places, changes)})["best"]
        return {"bearing": bearing, "distance": distance, "change": changes, "constant": best, "linear": fitted}

    def _fitted(self, places: np.ndarray, changes: np.ndarray) -> np.ndarray:
        """The best linear predictor at each place, `(fits, rows, columns)`."""
        # part of the grid is enough for fitting
        step = max(1, self.cells // FITTED)
        some, moved = (grid[::step, ::step].reshape(-1, 2) for grid in (places, changes))
        fits = [fit(some, moved, self.predictors, seed) for seed in range(self.fits)]
        errors = (np.einsum("rci,nio->rcno", _affine(places), weights) - changes[..., None, :] for weights in fits)
        return np.stack([((error / changes.std((0, 1))) ** 2).sum(-1).argmin(-1) for error in errors])

    def _boundary(self, values: Values) -> int:
        return int(np.abs(values["distance"] - self.brake).argmin())

    def figure(self, values: Values) -> Figure:
        figure = new_figure(9.4, 4.2)
        row = self._boundary(values)
        kinds = (
            (values["constant"], f"{self.predictors} constant predictors of the change"),
            (values["linear"][0], f"{self.predictors} linear predictors, fitted"),
        )
        for axes, (best, title) in zip(figure.subplots(1, 2, sharey=True), kinds, strict=True):
            _draw(axes, values, best)
            axes.axhline(self.brake, color="#c8452f", linewidth=2.2, linestyle="--")
            axes.set(title=f"{title}: line in {len(parts(best[row]))} parts", xlabel="bearing (rad)")
            axes.title.set_fontsize(10)
        figure.axes[0].set_ylabel("distance")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        row = self._boundary(values)
        count = self.predictors
        cut = len(parts(values["constant"][row]))
        fitted = mean_of([len(parts(best[row])) for best in values["linear"]])
        used = [len(np.unique(best)) for best in values["linear"]]
        yield within(
            count,
            count,
            f"{count} constant predictors cut a boundary that does not depend on the bearing into {count} parts.",
            exact(cut),
            "segments of the line with the same best predictor",
            "parts",
        )
        yield within(
            count - HALF,
            count + HALF,
            f"So do {count} linear predictors, each fitted to the region in which it is the best.",
            fitted,
            "segments of the line, mean over fits from random starts,",
            "parts",
            note=f"From {min(len(parts(best[row])) for best in values['linear'])} to "
            f"{max(len(parts(best[row])) for best in values['linear'])}; {np.mean(used):.1f} predictors are the "
            "best somewhere.",
            kind="extension",
        )
        yield above(
            1,
            "A simple decision is split: more than one predictor takes part in it.",
            fitted,
            "segments of the line with fitted predictors",
            "parts",
            source="section 6.1.2",
        )


def change(places: Any, numbers: Any = np) -> Any:
    """Change of bearing and distance per second, `(…, 2)` as the places, with the functions of `numbers`: NumPy's, or
    JAX's."""
    bearing = places[..., 0]
    distance = places[..., 1]
    return numbers.stack([SPEED * numbers.sin(bearing) / distance, -SPEED * numbers.cos(bearing)], axis=-1)


def fit(places: np.ndarray, changes: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Linear predictors of the changes, `(count, 3, 2)`: each is repeatedly fitted by least squares to the region in
    which it is the best, from random regions (those nearest to random places)."""
    rng = np.random.default_rng(seed)
    inputs = _affine(places)
    scale = changes.std(0)
    centres = places[rng.choice(len(places), count, replace=False)]
    best = ((places[:, None] - centres) ** 2).sum(-1).argmin(1)
    weights = np.zeros((count, 3, 2))
    for _ in range(ROUNDS):
        for one in range(count):
            mine = best == one
            if mine.sum() > 3:
                weights[one] = np.linalg.lstsq(inputs[mine], changes[mine], rcond=None)[0]
        error = (np.einsum("pi,nio->pno", inputs, weights) - changes[:, None]) / scale
        after = (error**2).sum(-1).argmin(1)
        if (after == best).all():
            break
        best = after
    return weights


def _affine(places: np.ndarray) -> np.ndarray:
    """Inputs of linear predictors: bearing, distance, 1."""
    return np.concatenate([places, np.ones((*places.shape[:-1], 1))], axis=-1)


def parts(best: np.ndarray) -> np.ndarray:
    """The predictors of the consecutive segments of a line."""
    return best[np.concatenate([[True], best[1:] != best[:-1]])]


def _draw(axes: Axes, values: Values, best: np.ndarray) -> None:
    """Regions, their borders, and the dynamics of the observation."""
    bearing = values["bearing"]
    distance = values["distance"]
    axes.pcolormesh(bearing, distance, best, cmap="tab20", alpha=0.35, rasterized=True, shading="nearest")
    for one in np.unique(best):
        axes.contour(bearing, distance, (best == one).astype(float), levels=[0.5], colors="0.25", linewidths=0.8)
    step = len(bearing) // 14
    some = np.s_[step // 2 :: step, step // 2 :: step]
    moved = values["change"][some]
    axes.quiver(*np.meshgrid(bearing[some[1]], distance[some[0]]), *np.moveaxis(moved, -1, 0), width=0.003, color="0.2")
