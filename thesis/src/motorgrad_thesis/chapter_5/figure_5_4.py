"""Figure 5.4: the hopper's dynamics after learning, as a phase portrait of the knee with the flexor's firing."""

import itertools
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from motorgrad.bodies import compile_model
from motorgrad.statistics import mean_of
from motorgrad.tasks import Hopper
from motorgrad.training import Evaluation, Run
from motorgrad_thesis._claims import Claim, below, more_than_half, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Axes, Figure, new_figure
from motorgrad_thesis.chapter_5._hopper_study import HopperStudy, median_seed
from timsim import draw

GRID = 61
FLEXOR = 0
EXTENSOR = 1
GROUND = "#d03a26"
AIR = "0.25"
FIRES = "#d0021b"
SILENT = "#2f6fc4"
PAGE = (480.0, 300.0)  # approximate size of the portrait, points
# points: closer numbers overlap, and are shifted
NEAR = 14.0
SHIFT = (-7.0, -20.0)


@experiment("fig-5.4", "the hopper's dynamics", "figure 5.4")
class HopperDynamics(HopperStudy):
    """Knee angle and its rate of a hopper that has learned to hop, red while its foot is on the ground. The background
    is the probability that the flexor fires in the air. Below, the hopper at the numbered points of one hop, with
    firing muscles in red and silent ones in blue."""

    def run(self, work: Workspace) -> Values:
        run = self.trained(work)
        outcome = self.watch(work, run)
        return {**self._trajectory(run, outcome), **firing_shares(outcome)}

    def _trajectory(self, run: Run, outcome: Evaluation) -> Values:
        """The median seed: what it observed, and the actions it chose."""
        assert outcome.sensors is not None
        assert outcome.position is not None
        assert outcome.control is not None
        seed = median_seed(run, outcome)
        row = run.seeds.index(seed)
        sensed = {name: values[row, :-1].astype(float) for name, values in outcome.sensors.items()}
        angle = sensed["knee_angle"]
        rate = sensed["knee_velocity"]
        x, y = (np.linspace(*_span(values), GRID) for values in (angle, rate))
        flexor = self._in_the_air(run.policy(seed), x, y)[:, :, FLEXOR]
        return {
            "angle": 90 + np.rad2deg(angle),
            "rate": np.rad2deg(rate),
            "contact": sensed["foot_contact"] > 0,
            "height": sensed["foot_height"],
            "firing": outcome.control[row, 1:] > 0.5,
            "position": outcome.position[row, :-1],
            "grid_angle": 90 + np.rad2deg(x),
            "grid_rate": np.rad2deg(y),
            "flexor": flexor,
            "seed": np.array(seed),
        }

    def _in_the_air(self, policy: Any, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Firing probabilities `(rates, angles, units)` without foot contact."""
        task = self.task
        angles, rates = np.meshgrid(angle + np.deg2rad(90.0 - task.centre), task.velocity_scale * rate)
        seen = np.stack([np.full_like(angles, -1.0), angles, rates], axis=-1).astype(np.float32)
        return np.asarray(jax.vmap(jax.vmap(policy.prob))(seen))

    def figure(self, values: Values) -> Figure:
        return draw_portrait(values, self.task)

    def claims(self, values: Values) -> Iterator[Claim]:
        ground = values["ground"]
        air = values["air"]
        on = mean_of(ground[:, EXTENSOR]).value
        off = mean_of(air[:, EXTENSOR]).value
        yield positive(
            "The extensor's firing is tied to foot contact: it fires more often on the ground than in the air.",
            mean_of(ground[:, EXTENSOR] - air[:, EXTENSOR]),
            "difference",
            note=f"It fires at {on:.0%} of the decisions on the ground, and at {off:.0%} of those in the air.",
        )
        yield more_than_half(
            "The extensor follows foot contact directly: it fires on the ground and is silent in the air.",
            mean_of(values["agrees"]),
            "share of decisions (1 if nothing but contact mattered)",
            note="The mean of the share of decisions on the ground at which it fires and the share in the air at "
            "which it is silent, so that chance gives 0.5.",
        )
        yield positive(
            "The flexor is inhibited by foot contact: it fires less often on the ground than in the air.",
            mean_of(air[:, FLEXOR] - ground[:, FLEXOR]),
            "difference",
        )
        yield below(
            0.5,
            "With the foot on the ground, the flexor is mostly silent.",
            mean_of(ground[:, FLEXOR]),
            "share of decisions at which it fires",
        )
        yield positive(
            "The push is followed by flexion: the flexor fires more often on the way up than on the ground.",
            mean_of(values["rising"][:, FLEXOR] - ground[:, FLEXOR]),
            "difference",
            source="section 5.2.2",
        )


def firing_shares(outcome: Evaluation) -> Values:
    """Shares of the decisions at which each seed's muscles fire.

    **Returns** `ground`, `air` and `rising` (in the air while the load rises), each `(seeds, groups)`; `agrees`
    `(seeds,)`, the mean of the share at which the extensor fires on the ground and the share at which it is silent in
    the air. The share of no decisions is one half, as before learning.
    """
    assert outcome.sensors is not None
    assert outcome.control is not None
    firing = outcome.control[:, 1:] > 0.5
    contact = outcome.sensors["foot_contact"][:, :-1] > 0
    upwards = np.diff(outcome.sensors["load_height"], axis=1) > 0

    def share(where: np.ndarray) -> np.ndarray:
        count = where.sum(axis=1)[:, None]
        fired = np.sum(firing & where[:, :, None], axis=1)
        return np.where(count > 0, fired / np.maximum(count, 1), 0.5)

    ground = share(contact)
    air = share(~contact)
    return {
        "ground": ground,
        "air": air,
        "rising": share(~contact & upwards),
        "agrees": (ground[:, EXTENSOR] + 1 - air[:, EXTENSOR]) / 2,
    }


def _span(values: np.ndarray) -> tuple[float, float]:
    """An interval that contains nearly all values, with a margin: a knee that hits its stop is very
    fast for a moment."""
    low, high = np.percentile(values, [0.5, 99.5])
    margin = 0.12 * max(float(high - low), 1e-3)
    return float(low) - margin, float(high) + margin


def draw_portrait(values: dict[str, np.ndarray], task: Hopper) -> Figure:
    """Trajectory and probabilities above, the numbered postures of one hop below."""
    figure = new_figure(9, 8.6)
    halves: Any = figure.subfigures(2, 1, height_ratios=[5.4, 3.2])
    above, below = halves
    axes = above.subplots()
    hop = median_hop(values["contact"], values["height"], task.hop_height)
    marked = hop_events(values, hop)
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
    below.supxlabel("time since landing; firing muscles in red, silent ones in blue", fontsize=9)
    return figure


def median_hop(contact: np.ndarray, height: np.ndarray, hop_height: float) -> tuple[int, int, int]:
    """The hop of median height: start of its stance, start of its flight, and end of its flight (exclusive).

    A flight is a period without contact that rises above `hop_height`; a record with fewer than two flights is one hop.
    """
    edges = np.flatnonzero(np.diff(contact.astype(int), prepend=1, append=1))
    stretches = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    flights = [(a, b) for a, b in stretches if b < len(contact) and height[a:b].max() > hop_height]
    hops = [(before[1], *flight) for before, flight in itertools.pairwise(flights)]
    if not hops:
        return 0, len(contact) // 2, len(contact)
    order = sorted(hops, key=lambda hop: height[hop[1] : hop[2]].max())
    return order[len(order) // 2]


def hop_events(values: dict[str, np.ndarray], hop: tuple[int, int, int]) -> dict[int, str]:
    """Decisions at the events of a hop, in order, with the names of the events."""
    landing, flight, end = hop
    angle = values["angle"]
    rate = values["rate"]
    height = values["height"]
    crouch = landing + int(np.argmin(angle[landing:flight]))
    middle = (angle[crouch] + angle[flight - 1]) / 2
    push = crouch + int(np.argmin(np.abs(angle[crouch:flight] - middle)))
    apex = flight + int(np.argmax(height[flight:end]))
    stretched = flight + int(np.argmax(angle[flight : apex + 1]))
    flexing = stretched + int(np.argmin(rate[stretched : apex + 1]))
    events = (
        (landing, "landing"),
        (crouch, "crouch"),
        (push, "push"),
        (flight - 1, "take-off"),
        (stretched, "stretched"),
    )
    events += ((flexing, "flexing"), (apex, "apex"), ((apex + end) // 2, "falling"))
    # of two events at the same decision, the first is kept
    return dict(sorted(dict(reversed(events)).items()))


def _background(figure, axes: Axes, values: dict[str, np.ndarray]) -> None:
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


def _trajectory(axes: Axes, values: dict[str, np.ndarray], hop: tuple[int, int, int], marked: dict[int, str]) -> None:
    angle = values["angle"]
    rate = values["rate"]
    contact = values["contact"]
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


def _numbers(axes: Axes, points: np.ndarray, contact: np.ndarray) -> None:
    """Numbers at the points; a number that would overlap another is shifted, with a line to its point."""
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


def _posture(axes: Axes, values: dict[str, np.ndarray], task: Hopper, moment: int) -> None:
    body = task.body
    fires = values["firing"][moment][[body.groups.index(muscle.group) for muscle in body.muscles]]
    reach = 1.25 * body.link_length
    axes.set(xlim=(-reach, reach), ylim=(-0.08, 0.1 + float(values["position"][:, 0].max()) + 2 * body.link_length))
    # slightly transparent, because the rim of an opaque muscle is red
    drawing = draw(
        axes, compile_model(body), values["position"][moment], fires.astype(float), linewidth=1.5, alpha=0.99
    )
    drawing.muscles.set_color([FIRES if fire else SILENT for fire in fires])
    axes.set_aspect("equal", adjustable="box")
    axes.set_xticks([])
    axes.spines["bottom"].set_visible(False)
