"""A phase portrait (figure 5.4): two observations against each other, over the probability that a unit fires."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.sim.panels import _svg

if TYPE_CHECKING:
    from motorgrad.policies import Policy

GRID = 41
PALE = np.array([[255, 255, 255], [223, 234, 247], [141, 184, 226]], float)
"""From never to always, as in the figure of the experiment."""
PATH, HERE = "#4a4a4a", "#d0021b"
BOX = (52.0, 8.0, _svg.WIDTH - 10, 240.0)


class Field:
    """The probability that units fire, over two of the observations, the others held."""

    def __init__(self) -> None:
        self._compiled: Callable[..., Any] | None = None

    def over(self, policy: Policy, seen: np.ndarray, x: int, y: int, limits: np.ndarray) -> np.ndarray:
        """Probabilities `(GRID, GRID, units)`, rows from the bottom: `seen` `(inputs,)` but for two of them, which
        take values between `limits` `(2, 2)`."""
        import jax

        if self._compiled is None:
            self._compiled = jax.jit(lambda policy, seen: jax.vmap(policy.prob)(seen))
        across, up = np.linspace(limits[:, 0], limits[:, 1], GRID, axis=1)
        grid = np.tile(np.asarray(seen, np.float32), (GRID, GRID, 1))
        grid[..., x], grid[..., y] = across[None, :], up[:, None]
        flat = self._compiled(policy, grid.reshape(GRID * GRID, -1))
        return np.asarray(flat).reshape(GRID, GRID, -1)


def limits_of(values: np.ndarray) -> np.ndarray:
    """What nearly all values `(n, 2)` lie between, and a little more, `(2, 2)`: from, to of each."""
    low, high = np.percentile(values, [0.5, 99.5], axis=0)
    margin = 0.12 * np.maximum(high - low, 1e-3)
    return np.stack([low - margin, high + margin], axis=1)


def draw_portrait(
    path: np.ndarray, probability: np.ndarray | None, limits: np.ndarray, names: tuple[str, str], unit: str
) -> str:
    """The trajectory `(n, 2)` over the probability `(rows, columns)`, if there is one, as SVG."""
    chart = _svg.Chart(tuple(limits[0]), tuple(limits[1]), names[0], names[1], BOX)
    if probability is not None:
        chart.image(_pale(probability[::-1]), smooth=True)
    chart.line(path[:, 0], path[:, 1], PATH, 0.9, 'stroke-opacity=".55"')
    recent = path[-min(len(path), 40) :]
    chart.line(recent[:, 0], recent[:, 1], PATH, 1.6)
    if len(path):
        chart.dot(float(path[-1, 0]), float(path[-1, 1]), HERE)
    parts = chart.elements()
    if probability is not None:
        ramp = _pale(np.linspace(0, 1, 60)[None])
        parts.append(_svg.text(BOX[0], 281, "0"))
        parts.append(_svg.picture(ramp, BOX[0] + 10, 276, 60, 10, smooth=True))
        frame = f'x="{BOX[0] + 10}" y="276" width="60" height="10"'
        parts.append(f'<rect {frame} fill="none" stroke="{_svg.INK}" stroke-opacity=".4"/>')
        parts.append(_svg.text(BOX[0] + 74, 281, f"1   probability that {unit} fires"))
    return _svg.document(_svg.WIDTH, 292, parts, "phase portrait")


def _pale(share: np.ndarray) -> np.ndarray:
    """Shares in [0, 1] as colours, uint8."""
    at = np.linspace(0, 1, len(PALE))
    share = np.clip(np.nan_to_num(share), 0, 1)
    return np.stack([np.interp(share, at, PALE[:, k]) for k in range(3)], axis=-1).round().astype(np.uint8)
