"""Diagrams of a policy: weights as arrows (figure 5.5), and a phase portrait (figure 5.4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import jax
import numpy as np
from jaxtyping import PyTree

from motorgrad._errors import counted
from motorgrad.policies import Policy, abilities
from timsim.panels import _charts
from timsim.panels._panel import brief

POSITIVE = "#c0392b"
NEGATIVE = "#2c5fa8"
MAX_ARROWS = 60  # the weakest are omitted
LABELLED = 12  # up to so many weights, arrows carry their value
MAX_ARROW_WIDTH = 9.0
LETTER = 5.1  # width of a letter in a node
NODE = 17.0
GAP = (7.0, 30.0)  # between nodes: minimum and maximum


def draw_arrows(weights: np.ndarray, senses: Sequence[str], units: Sequence[str], probability: np.ndarray) -> str:
    """Weights as arrows from observations on the left to units on the right, as SVG: red if positive, blue if negative,
    the wider the larger. A unit is filled in proportion to its probability of firing.

    **Arguments:** `weights` `(units, senses)`; names of `senses` and `units`; `probability` `(units,)`.
    """
    count = max(len(senses), len(units))
    step = NODE + np.clip(150 / max(count, 1), *GAP)
    height = max(step * count, 2 * step) + 6
    left, right = (_places(len(names), height, step) for names in (senses, units))
    wide = [min(most, 12 + LETTER * max(map(len, names))) for names, most in ((senses, 142.0), (units, 118.0))]
    start = 4 + wide[0]
    end = _charts.WIDTH - 4 - wide[1]
    order = np.argsort(-np.abs(weights), axis=None)[:MAX_ARROWS][::-1]  # the strongest last, on top
    largest = float(np.abs(weights).max()) if weights.size else 0.0
    arrows = []
    labels = []
    for flat in order:
        unit, sense = np.unravel_index(flat, weights.shape)
        weight = float(weights[unit, sense])
        share = abs(weight) / largest if largest else 0.0
        y = float(left[sense])
        v = float(right[unit])
        if len(senses) > 1:  # the ends of arrows into one unit, in the order of their origins
            v += (int(sense) / (len(senses) - 1) - 0.5) * NODE * 0.7
        colour = POSITIVE if weight > 0 else NEGATIVE
        arrows.append(_arrow(start + 1, y, end - 2, v, 0.4 + MAX_ARROW_WIDTH * share, colour))
        if weights.size <= LABELLED:
            along = 0.16 + 0.16 * (unit % 2)
            labels.append(_label(start + along * (end - start), y + along * (v - y), brief(weight, 2), colour))
    nodes = [_node(4, y, wide[0], name, np.nan, name == "bias") for y, name in zip(left, senses, strict=True)]
    nodes += [_node(end, y, wide[1], name, float(p)) for y, name, p in zip(right, units, probability, strict=True)]
    legend = f"red: positive, blue: negative; the widest is {brief(largest, 2)}"
    if weights.size > MAX_ARROWS:
        legend += f"; the {MAX_ARROWS} strongest of {weights.size:,}"
    parts = [*arrows, *nodes, *labels, _charts.text(4, height + 9, legend, extra='opacity=".75" font-size="9"')]
    return _charts.document(_charts.WIDTH, height + 18, parts, "weights from observations to units")


def _places(count: int, height: float, step: float) -> np.ndarray:
    return height / 2 + (np.arange(count) - (count - 1) / 2) * min(step * 1.5, height / max(count, 1))


def _arrow(x: float, y: float, u: float, v: float, width: float, colour: str) -> str:
    """A straight arrow with its head, as one outline."""
    along = np.array([u - x, v - y])
    length = float(np.hypot(*along))
    along /= length
    across = np.array([-along[1], along[0]])
    head = 3.0 + 0.9 * width
    neck = np.array([x, y]) + along * (length - 1.3 * head)
    begin = np.array([x, y])
    tip = np.array([u, v])
    points = [begin, neck, neck, tip, neck, neck, begin]
    shift = np.array([1, 1, head / width * 1.1, 0, -head / width * 1.1, -1, -1]) * width / 2
    outline = " ".join(f"{a:.1f},{b:.1f}" for a, b in points + shift[:, None] * across)
    return f'<polygon points="{outline}" fill="{colour}" fill-opacity=".8"/>'


def _node(x: float, y: float, wide: float, name: str, filled: float, dashed: bool = False) -> str:
    top = y - NODE / 2
    dash = ' stroke-dasharray="4 3"' if dashed else ""
    frame = f'x="{x:.1f}" y="{top:.1f}" height="{NODE}" rx="4"'
    fill = ""
    if np.isfinite(filled):
        fill = f'<rect {frame} width="{wide * min(max(filled, 0), 1):.1f}" fill="{POSITIVE}" fill-opacity=".22"/>'
    edge = f'<rect {frame} width="{wide:.1f}" fill="none" stroke="{_charts.INK}" stroke-opacity=".6"{dash}/>'
    room = int((wide - 4) / LETTER)
    shown = name if len(name) <= room else f"{name[: room - 1]}…"
    return fill + edge + _charts.text(x + wide / 2, y, shown, "middle", 'font-size="9.5"')


def _label(x: float, y: float, words: str, colour: str) -> str:
    wide = 6 + 5.2 * len(words)
    return (
        f'<rect x="{x - wide / 2:.1f}" y="{y - 6:.1f}" width="{wide:.1f}" height="12" rx="3" fill="white" '
        f'stroke="{colour}" stroke-width=".6"/>'
        + _charts.text(x, y, words, "middle", f'style="fill:{colour}" font-size="9"')
    )


GRID = 41
PALE = np.array([[255, 255, 255], [223, 234, 247], [141, 184, 226]], float)
"""Colours of probabilities 0, 1/2 and 1, as in the figure of the experiment."""
PATH = "#4a4a4a"
HERE = "#d0021b"
BOX = (52.0, 8.0, _charts.WIDTH - 10, 240.0)


Seeing = Callable[[Policy, jax.Array], jax.Array]
"""A function of a policy and of what its units see, such as `motorgrad.policies.Policy.prob`."""


def present(policy: Policy, memory: PyTree, observation: jax.Array) -> tuple[Policy, jax.Array]:
    """The policy without noise that lasts, and what its units see of an observation with a memory of a snapshot."""
    acting = abilities.marginal(policy)
    return acting, abilities.observation_with_memory(acting, memory, observation)


class Field:
    """What a policy computes from two of the observations, with the others and its memory fixed. Noise that lasts is
    left out.

    **Arguments:** `of`, what it computes, a vector; by default the probability that units fire.
    """

    def __init__(self, of: Seeing = lambda policy, seen: policy.prob(seen)) -> None:
        def response(policy: Policy, memory: jax.Array, observation: jax.Array) -> jax.Array:
            return of(*present(policy, memory, observation))

        self._over = jax.jit(jax.vmap(response, (None, None, 0)))

    def over(
        self, policy: Policy, memory: np.ndarray, observation: np.ndarray, x: int, y: int, limits: np.ndarray
    ) -> np.ndarray:
        """Probabilities or another quantity of each unit, `(GRID, GRID, units)`, rows from the bottom.

        **Arguments:** `policy`; its `memory` `(memory,)` and the `observation` `(observations,)`, which are fixed, as
        in a snapshot; `x`, `y`: the two observations that vary, between `limits` `(2, 2)`.
        """
        across, up = np.linspace(limits[:, 0], limits[:, 1], GRID, axis=1)
        grid = np.tile(np.asarray(observation, np.float32), (GRID, GRID, 1))
        grid[..., x] = across[None, :]
        grid[..., y] = up[:, None]
        flat = self._over(policy, np.asarray(memory, np.float32), grid.reshape(GRID * GRID, -1))
        return np.asarray(flat).reshape(GRID, GRID, -1)


def limits_of(values: np.ndarray) -> np.ndarray:
    """Limits `(2, 2)` with a margin that contain nearly all values `(n, 2)`: from, to of each."""
    low, high = np.percentile(values, [0.5, 99.5], axis=0)
    margin = 0.12 * np.maximum(high - low, 1e-3)
    return np.stack([low - margin, high + margin], axis=1)


def draw_portrait(
    path: np.ndarray,
    probability: np.ndarray | None,
    limits: np.ndarray,
    names: tuple[str, str],
    what: str,
    ends: tuple[str, str] = ("0", "1"),
    note: str = "",
) -> str:
    """The trajectory `(n, 2)` over the probability `(rows, columns)`, if given, as SVG.

    **Arguments:** the `limits` and `names` of the axes; `what` the colours show, from 0 to 1, and what these two `ends`
    stand for; a `note` below.
    """
    chart = _charts.Chart(tuple(limits[0]), tuple(limits[1]), names[0], names[1], BOX)
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
        start = BOX[0] + 3.4 + 6.6 * len(ends[0])
        parts.append(_charts.text(BOX[0], 281, ends[0]))
        parts.append(_charts.picture(ramp, start, 276, 60, 10, smooth=True))
        frame = f'x="{start}" y="276" width="60" height="10"'
        parts.append(f'<rect {frame} fill="none" stroke="{_charts.INK}" stroke-opacity=".4"/>')
        parts.append(_charts.text(start + 64, 281, f"{ends[1]}   {what}"))
    if note:
        parts.append(_charts.text(BOX[0], 296, note, extra='opacity=".75" font-size="9"'))
    return _charts.document(_charts.WIDTH, 306 if note else 292, parts, "phase portrait")


def _pale(share: np.ndarray) -> np.ndarray:
    """Shares in [0, 1] as colours, uint8."""
    at = np.linspace(0, 1, len(PALE))
    share = np.clip(np.nan_to_num(share), 0, 1)
    return np.stack([np.interp(share, at, PALE[:, k]) for k in range(3)], axis=-1).round().astype(np.uint8)


COLUMNS = 32


def draw_layers(layers: Sequence[np.ndarray], marked: tuple[int, int]) -> str:
    """The activations of hidden units, a square each and a block for each layer, as SVG: red if positive, blue if
    negative, white at 0, of full colour at the largest of the layer. One unit, given by layer and index, is `marked`.
    """
    parts = []
    top = 4.0
    side = (_charts.WIDTH - 12) / COLUMNS
    for index, layer in enumerate(layers):
        largest = float(np.abs(layer).max(initial=0))
        off = int(np.sum(layer <= 0))
        silent = f", {off} at or below 0" if off else ""
        words = f"layer {index + 1}: {counted(len(layer), 'unit')}{silent}; largest {brief(largest, 2)}"
        parts.append(_charts.text(4, top + 6, words))
        rows = -(-len(layer) // COLUMNS)
        filled = np.full(rows * COLUMNS, np.nan)
        filled[: len(layer)] = layer / largest if largest else 0.0
        parts.append(_charts.picture(_signed(filled.reshape(rows, COLUMNS)), 4, top + 15, COLUMNS * side, rows * side))
        edge = f'y="{top + 15:.1f}" height="{rows * side:.1f}" fill="none" stroke="{_charts.INK}" stroke-opacity=".4"'
        parts.append(f'<rect x="4" width="{min(len(layer), COLUMNS) * side:.1f}" {edge}/>')
        if index == marked[0]:
            row, column = divmod(marked[1], COLUMNS)
            place = (
                f'x="{4 + column * side:.1f}" y="{top + 15 + row * side:.1f}" width="{side:.1f}" height="{side:.1f}"'
            )
            parts.append(f'<rect {place} fill="none" stroke="{_charts.INK}" stroke-width="1.8"/>')
        top += 15 + rows * side + 10
    return _charts.document(_charts.WIDTH, top, parts, "activations of the hidden units")


def _signed(share: np.ndarray) -> np.ndarray:
    """Shares in [−1, 1] as colours with opacity, uint8; NaN is transparent."""
    colour = np.where(share[..., None] > 0, (192, 57, 43), (44, 95, 168))
    strength = np.abs(np.nan_to_num(share))[..., None]
    opaque = np.where(np.isfinite(share), 255, 0)[..., None]
    return np.concatenate([255 + strength * (colour - 255), opaque], axis=-1).round().astype(np.uint8)


def weights_of(policy: Policy) -> np.ndarray | None:
    """Weights `(units, observations + 1)` of pools that have them, the last column being the biases; None for others,
    and where units do not see the observation alone: they draw one after the other, or remember. None for units with
    real-valued actions, too, whose mean is not the probability that fills a unit's drawing."""
    if abilities.has_hidden_units(policy) or abilities.has_memory(policy) or "continuous" in policy.actions:
        return None
    rows = []
    for pool in getattr(policy, "pools", (policy,)):
        weights = getattr(pool, "weights", None)
        if getattr(weights, "shape", None) != (pool.outputs, pool.inputs):
            return None
        bias = getattr(pool, "bias", None)
        bias = np.zeros(pool.outputs) if bias is None else np.asarray(bias, float)
        rows.append(np.concatenate([np.asarray(weights, float), bias[:, None]], axis=1))
    return np.concatenate(rows)
