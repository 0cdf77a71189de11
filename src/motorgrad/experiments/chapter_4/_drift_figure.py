"""Curves of several learners over time, in a muscle that changes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_lines(
    axes: "Axes", decision: np.ndarray, values: np.ndarray, labels: Sequence[str], colours: Sequence[int] | None = None
) -> None:
    """Median and quartiles over seeds of `values` `(lines, seeds, records)`."""
    for row, label, each in zip(colours or range(len(labels)), labels, values, strict=True):
        low, middle, high = np.quantile(each, [0.25, 0.5, 0.75], axis=0)
        axes.plot(decision / 1e6, middle, color=f"C{row}", label=label, linewidth=1.3)
        axes.fill_between(decision / 1e6, low, high, color=f"C{row}", alpha=0.18, linewidth=0)


def draw_least(axes: "Axes", changes: Sequence[float] | np.ndarray, end: float, least: np.ndarray) -> None:
    """The least possible error with a strong muscle and with a weak one, in turn."""
    edges = np.array([0.0, *changes, end]) / 1e6
    axes.stairs(np.resize(least, len(edges) - 1), edges, baseline=None, color="0.3", linewidth=1, linestyle=":")


def shade(axes: "Axes", changes: np.ndarray, end: float) -> None:
    """Shade the times at which the muscle is weak: from the first change to the second, and so on."""
    ends = [*changes, end] if len(changes) % 2 else list(changes)
    for start, stop in zip(ends[::2], ends[1::2], strict=True):
        axes.axvspan(start / 1e6, stop / 1e6, color="0.5", alpha=0.1, linewidth=0, zorder=0)
