"""The picture of figure 5.4: a phase portrait over firing probabilities, and postures along one hop."""

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.bodies import compile_model
from motorgrad.sim import draw
from motorgrad.tasks import Hopper

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GROUND, AIR = "#d03a26", "0.25"
FIRES, SILENT = "#d0021b", "#2f6fc4"
PAGE = (480.0, 300.0)  # points: about the size of the portrait
NEAR, SHIFT = 14.0, (-7.0, -20.0)  # points on the page: closer numbers overlap, and are set apart by so much


def draw_portrait(values: dict[str, np.ndarray], task: Hopper) -> "Figure":
    """Trajectory and probabilities above, the numbered postures of one hop below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 8.6), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=[5.4, 3.2])
    above, below = halves
    axes = above.subplots()
    hop = one_hop(values["contact"], values["height"], task.hop_height)
    marked = moments(values, hop)
    _background(above, axes, values)
    _trajectory(axes, values, hop, marked)
    panels = below.subplots(1, len(marked), sharey=True, squeeze=False)[0]
    first = next(iter(marked))
    for number, (panel, (moment, name)) in enumerate(zip(panels, marked.items(), strict=True)):
        _posture(panel, values, task, moment)
        panel.set_title(f"{number + 1}  {name}", fontsize=9)
        panel.set_xlabel(f"{(moment - first) * task.period:.2f} s", fontsize=9)
        if number == 0:
            panel.set_ylabel("height (m)")
        else:
            panel.spines["left"].set_visible(False)
            panel.tick_params(left=False)
    below.supxlabel("since the landing before; muscles are red where they fire, blue where they are silent", fontsize=9)
    return figure


def one_hop(contact: np.ndarray, height: np.ndarray, hop_height: float) -> tuple[int, int, int]:
    """The hop of middle height: when its stance began, when its flight did, and when that was over (excluded).

    A flight is a stretch without contact that came higher than `hop_height`; a record without two of them is one hop.
    """
    edges = np.flatnonzero(np.diff(contact.astype(int), prepend=1, append=1))
    stretches = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    flights = [(a, b) for a, b in stretches if b < len(contact) and height[a:b].max() > hop_height]
    hops = [(before[1], *flight) for before, flight in itertools.pairwise(flights)]
    if not hops:
        return 0, len(contact) // 2, len(contact)
    order = sorted(hops, key=lambda hop: height[hop[1] : hop[2]].max())
    return order[len(order) // 2]


def moments(values: dict[str, np.ndarray], hop: tuple[int, int, int]) -> dict[int, str]:
    """Decisions of a hop that tell its story, in their order, each with what happens there."""
    landing, flight, end = hop
    angle, rate, height = values["angle"], values["rate"], values["height"]
    crouch = landing + int(np.argmin(angle[landing:flight]))
    middle = (angle[crouch] + angle[flight - 1]) / 2
    push = crouch + int(np.argmin(np.abs(angle[crouch:flight] - middle)))
    apex = flight + int(np.argmax(height[flight:end]))
    stretched = flight + int(np.argmax(angle[flight : apex + 1]))
    flexing = stretched + int(np.argmin(rate[stretched : apex + 1]))
    told = (
        (landing, "landing"),
        (crouch, "crouch"),
        (push, "push"),
        (flight - 1, "take-off"),
        (stretched, "stretched"),
    )
    told += ((flexing, "flexing"), (apex, "apex"), ((apex + end) // 2, "falling"))
    # two that fall together are told once, as the first of them
    return dict(sorted(dict(reversed(told)).items()))


def _background(figure, axes: "Axes", values: dict[str, np.ndarray]) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    pale = LinearSegmentedColormap.from_list("pale", ["#ffffff", "#dfeaf7", "#8db8e2"])
    levels = np.linspace(0, 1, 21)
    grid = (values["grid_angle"], values["grid_rate"], values["flexor"])
    shades = axes.contourf(*grid, levels, cmap=pale, vmin=0, vmax=1)
    if values["flexor"].min() < 0.5 < values["flexor"].max():
        axes.contour(*grid, [0.5], colors=["#5f8fc0"], linewidths=1, linestyles="--")
    bar = figure.colorbar(shades, ax=axes, ticks=np.linspace(0, 1, 6), pad=0.02, aspect=30)
    bar.set_label("probability that the flexor fires in the air")
    bar.outline.set_visible(False)


def _trajectory(axes: "Axes", values: dict[str, np.ndarray], hop: tuple[int, int, int], marked: dict[int, str]) -> None:
    angle, rate, contact = values["angle"], values["rate"], values["contact"]
    for where, colour, words in ((~contact, AIR, "in the air"), (contact, GROUND, "foot on the ground")):
        axes.plot(angle[where], rate[where], ".", color=colour, markersize=2.5, alpha=0.4, markeredgewidth=0)
        axes.plot([], [], ".-", color=colour, label=words)
    for now in range(hop[0], hop[2]):
        colour = GROUND if contact[now] else AIR
        pair = slice(now, min(now + 2, len(angle)))
        axes.plot(angle[pair], rate[pair], ".-", color=colour, markersize=5, linewidth=1.3, markeredgewidth=0)
    axes.set(xlabel="knee angle (°)", ylabel="rate of the knee angle (°/s)")
    axes.set(xlim=values["grid_angle"][[0, -1]], ylim=values["grid_rate"][[0, -1]])
    axes.legend(loc="lower right", frameon=True, framealpha=0.85, edgecolor="none")
    _numbers(axes, np.stack([angle, rate], axis=1)[list(marked)], contact[list(marked)])


def _numbers(axes: "Axes", points: np.ndarray, contact: np.ndarray) -> None:
    """Numbers at the points; one that would lie on another stands aside, with a line to its point."""
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    taken: list[np.ndarray] = []
    for number, (point, grounded) in enumerate(zip(points, contact, strict=True)):
        place = PAGE * (point - limits[:, 0]) / np.diff(limits, axis=1)[:, 0]
        offset = np.zeros(2)
        while any(np.linalg.norm(place + offset - other) < NEAR for other in taken):
            offset = offset + SHIFT
        taken.append(place + offset)
        colour = GROUND if grounded else AIR
        axes.annotate(
            f"{number + 1}",
            point,
            (offset[0], offset[1]),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=8.5,
            fontweight="bold",
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": colour, "linewidth": 1.5},
            arrowprops={"arrowstyle": "-", "color": colour, "shrinkA": 0, "shrinkB": 0} if offset.any() else None,
            zorder=6,
        )


def _posture(axes: "Axes", values: dict[str, np.ndarray], task: Hopper, moment: int) -> None:
    body = task.body
    fires = values["firing"][moment][[body.groups.index(muscle.group) for muscle in body.muscles]]
    reach = 1.25 * body.link_length
    axes.set(xlim=(-reach, reach), ylim=(-0.08, 0.1 + float(values["position"][:, 0].max()) + 2 * body.link_length))
    # seen through a little, because the rim of an opaque muscle is red
    drawing = draw(
        axes, compile_model(body), values["position"][moment], fires.astype(float), linewidth=1.5, alpha=0.99
    )
    drawing.muscles.set_color([FIRES if fire else SILENT for fire in fires])
    axes.set_aspect("equal", adjustable="box")
    axes.set_xticks([])
    axes.spines["bottom"].set_visible(False)
