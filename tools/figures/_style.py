"""How the documentation's figures look, and the few things that several of them draw."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

WIDTH = 7.6  # inches, for all
BLUE = "#0072B2"
RED = "#D55E00"
GREEN = "#009E73"
PINK = "#CC79A7"
ORANGE = "#E69F00"
SKY = "#56B4E9"
COLOURS = (BLUE, RED, GREEN, PINK, ORANGE, SKY)  # Okabe and Ito's, which colour-blind people can tell apart
FLEXOR, EXTENSOR = BLUE, RED
FAINT = "0.45"

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "image.cmap": "viridis",
}


def panels(columns: int = 1, height: float = 2.8, rows: int = 1, **settings: Any) -> tuple[Figure, Any]:
    """A figure of the common width, and its axes: one, a row, or an array of rows."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.subplots(rows, columns, **settings)


def band(axes: Axes, x: np.ndarray, values: np.ndarray, colour: str, label: str, line: str = "-") -> None:
    """The median over the seeds (the leading axis of `values`) and the quartiles about it."""
    low, median, high = np.percentile(values, [25, 50, 75], axis=0)
    axes.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(x, median, color=colour, linestyle=line, label=label)


def level(axes: Axes, value: float, words: str) -> None:
    """A dashed line at a value that is known, with its name above its right end."""
    axes.axhline(value, color="0.3", linewidth=0.9, linestyle=(0, (5, 3)))
    axes.annotate(
        words, (1, value), xycoords=("axes fraction", "data"), xytext=(0, 2), textcoords="offset points",
        ha="right", va="bottom", fontsize=8, color="0.3",
    )  # fmt: skip


def over(function: Callable[..., Any], *points: np.ndarray) -> Any:
    """A function of one observation, at every point of some coordinates of one shape."""
    grid = np.stack(points, axis=-1).astype(np.float32)
    found = jax.vmap(function)(grid.reshape(-1, grid.shape[-1]))
    return jax.tree.map(lambda leaf: np.asarray(leaf).reshape(*grid.shape[:-1], *leaf.shape[1:]), found)


def plane(reach: float, count: int = 121) -> tuple[np.ndarray, np.ndarray]:
    """Two inputs from −reach to reach, as coordinates of a grid."""
    x, y = np.meshgrid(np.linspace(-reach, reach, count), np.linspace(-reach, reach, count))
    return x, y


def inputs(axes: Axes, title: str = "") -> None:
    """Label a plane of two inputs."""
    axes.set(xlabel="input $y_1$", ylabel="input $y_2$", aspect="equal", title=title)


def arrow(axes: Axes, start: Any, end: Any, colour: str, bend: float = 0.0, **style: Any) -> None:
    """An arrow from one place to another, bent to its right where `bend` is positive."""
    from matplotlib.patches import FancyArrowPatch

    usual: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 9, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
    usual |= {"color": colour, "connectionstyle": f"arc3,rad={bend}"} | style
    axes.add_patch(FancyArrowPatch(tuple(start), tuple(end), **usual))
