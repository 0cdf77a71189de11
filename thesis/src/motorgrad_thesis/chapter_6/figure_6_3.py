"""Figure 6.3: the particle's policy as a diagram, and the number of distinct forces of its units."""

from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.schema import count
from motorgrad.statistics import exact
from motorgrad.tasks import FallingParticle
from motorgrad.worlds import ParticleState
from motorgrad_thesis._claims import Claim, at_most
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, Point, draw_arrow, subplots

SAME = 1e-5  # velocities closer than this belong to the same force
# positions of the columns
UNITS = 2.6
FORCES = 4.8
SUM = 6.3
PARTICLE = 8.9
HEIGHTS = (3.1, 2.2, 1.3, 0.4)
MIDDLE = 1.75
BELOW = -1.1
PLASTIC = "#0061B0"
FIXED = "#A0307A"
SEEN = "0.25"
PAID = "#2e8b57"


@experiment("fig-6.3", "the particle's policy", "figure 6.3")
class ParticlePolicy(Experiment):
    """The particle and its policy as a loop. All units of a plastic, stochastic layer observe the particle's position;
    each unit that fires switches on a fixed force, and the forces add up. The reward is a function of the position. The
    number of distinct motions over all firing patterns is determined by simulation.
    """

    most: int = count(6, 1, 8, help="largest number of forces to each side for which firing patterns are counted")

    quick = smoke(most=3)

    def run(self, work: Workspace) -> Values:
        del work
        sides = np.arange(1, self.most + 1)
        counted = [motions(int(side)) for side in sides]
        return {
            "sides": sides,
            "patterns": np.array([count for count, _ in counted]),
            "motions": np.array([count for _, count in counted]),
        }

    def figure(self, values: Values) -> Figure:
        """Position, units, forces, particle, reward."""
        from matplotlib.patches import FancyBboxPatch

        figure, axes = subplots(9.2, 4.6)
        for place, words, colour in (
            (UNITS, "plastic, stochastic layer\n$\\theta_t$", PLASTIC),
            (FORCES, "fixed forces", FIXED),
        ):
            style: dict[str, Any] = {"boxstyle": "round,pad=0.12", "facecolor": f"{colour}11", "edgecolor": colour}
            axes.add_patch(FancyBboxPatch((place - 0.6, HEIGHTS[-1] - 0.45), 1.2, 3.6, linewidth=1.2, **style))
            axes.text(place, HEIGHTS[0] + 0.68, words, ha="center", va="bottom", color=colour)
        for number, height in enumerate(HEIGHTS):
            left = number % 2 == 0
            _bump(axes, (UNITS, height))
            draw_arrow(axes, (0.75, MIDDLE), (UNITS - 0.42, height), SEEN)
            draw_arrow(axes, (UNITS + 0.42, height), (FORCES - 0.5, height), PLASTIC)
            axes.text(
                (UNITS + FORCES) / 2, height + 0.1, f"$a^{{({number + 1})}}$", ha="center", fontsize=9, color=PLASTIC
            )
            axes.text(FORCES, height + 0.12, f"${'-' if left else '+'}F$", ha="center", fontsize=9, color=FIXED)
            ends = (FORCES + 0.32, FORCES - 0.32) if left else (FORCES - 0.32, FORCES + 0.32)
            draw_arrow(axes, (ends[0], height - 0.12), (ends[1], height - 0.12), FIXED, width=2.4)
            draw_arrow(axes, (FORCES + 0.72, height), (SUM - 0.26, MIDDLE), FIXED)
        axes.text((UNITS + FORCES) / 2, HEIGHTS[-1] - 0.42, "0 or 1", ha="center", fontsize=8, color="0.45")
        _disc(axes, (SUM, MIDDLE), 0.24, FIXED)
        axes.text(SUM, MIDDLE, "Σ", ha="center", va="center", color=FIXED, zorder=5)
        draw_arrow(axes, (SUM + 0.24, MIDDLE), (PARTICLE - 1.3, MIDDLE), FIXED)
        axes.text((SUM + PARTICLE - 1.06) / 2, MIDDLE + 0.12, "$f_t$", ha="center", color=FIXED)
        _world(axes)
        axes.text(0.35, MIDDLE, "position\n$x$", ha="center", va="center", color=SEEN, fontsize=11)
        for start, end, head in (
            ((PARTICLE, 0.42), (PARTICLE, BELOW + 0.3), True),
            ((PARTICLE - 0.95, BELOW), (UNITS, BELOW), False),
            ((UNITS, BELOW), (UNITS, HEIGHTS[-1] - 0.57), True),
        ):
            draw_arrow(axes, start, end, PAID, head=head)
        style = {"boxstyle": "round,pad=0.4", "facecolor": "white", "edgecolor": PAID, "linewidth": 1.3}
        axes.text(PARTICLE, BELOW, "reward $r_t(x)$", ha="center", va="center", color=PAID, bbox=style, zorder=3)
        axes.text((UNITS + PARTICLE) / 2, BELOW + 0.1, "the same for all units", ha="center", fontsize=9, color=PAID)
        # the observation: around the outside
        top = HEIGHTS[0] + 1.55
        for start, end, head in (
            ((PARTICLE, 3.1), (PARTICLE, top), False),
            ((PARTICLE, top), (0.35, top), False),
            ((0.35, top), (0.35, MIDDLE + 0.38), True),
        ):
            draw_arrow(axes, start, end, SEEN, head=head)
        axes.text(
            (UNITS + PARTICLE) / 2,
            top - 0.1,
            "observed: the position only",
            ha="center",
            va="top",
            fontsize=9,
            color=SEEN,
        )
        axes.set(xlim=(-0.1, PARTICLE + 1.4), ylim=(BELOW - 0.45, top + 0.15), aspect="equal")
        axes.set_axis_off()
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        sides = values["sides"]
        last = int(sides[-1])
        yield at_most(
            0,
            f"N forces to each side have 2^(2N) firing patterns (N from 1 to {last}).",
            exact(np.abs(values["patterns"] - 4**sides).max()),
            "greatest difference",
            note=f"For N = {last}: {values['patterns'][-1]:,}.",
            of="N forces to each side have 2^(2N) firing patterns.",
        )
        yield at_most(
            0,
            f"They produce only 2N + 1 distinct actions (N from 1 to {last}).",
            exact(np.abs(values["motions"] - (2 * sides + 1)).max()),
            "greatest difference in the number of distinct velocities after one decision",
            note=f"For N = {last}: {values['motions'][-1]}. Counted by simulation, from rest in the middle of the box.",
            of="They produce only 2N + 1 distinct actions.",
        )


def motions(side: int) -> tuple[int, int]:
    """Number of firing patterns with this many forces to each side, and of the velocities to which they lead."""
    world = FallingParticle(units=2 * side).dynamics
    codes = np.arange(4**side)[:, None] >> np.arange(2 * side)
    rest = ParticleState(jnp.full(2, 0.5), jnp.zeros(2), jnp.zeros(4, bool))
    patterns = jnp.asarray(codes & 1, jnp.float32)
    moved = jax.vmap(lambda action: world.step(rest, action, jnp.zeros(world.uniforms)).velocity)(patterns)
    speeds = np.sort(np.asarray(moved)[:, 0])
    return len(patterns), 1 + int((np.diff(speeds) > SAME).sum())


def _bump(axes: Axes, place: Point) -> None:
    """A unit: a circle with its Gaussian in it."""
    _disc(axes, place, 0.38, PLASTIC)
    along = np.linspace(-1, 1, 41)
    axes.plot(
        place[0] + 0.26 * along, place[1] - 0.17 + 0.36 * np.exp(-0.5 * (along / 0.36) ** 2), color=PLASTIC, zorder=4
    )


def _disc(axes: Axes, place: Point, radius: float, colour: str) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(Circle(place, radius, facecolor="white", edgecolor=colour, linewidth=1.4, zorder=3))


def _world(axes: Axes) -> None:
    """The box with rewarded regions and the falling particle."""
    from matplotlib.patches import Circle, Rectangle

    corner = (PARTICLE - 1.3, 0.45)
    size = 2.6
    axes.add_patch(Rectangle(corner, size, size, facecolor="white", edgecolor="0.2", linewidth=1.4))
    axes.add_patch(Circle((PARTICLE + 0.6, 0.98), 0.38, facecolor="#009E7355", edgecolor="#009E73"))
    axes.add_patch(Circle((PARTICLE - 0.6, 1.0), 0.34, facecolor="#D55E0055", edgecolor="#D55E00"))
    fall = np.linspace(0, 1, 40)
    axes.plot(PARTICLE - 0.85 + 0.75 * fall**1.6, 2.9 - 0.9 * fall, "--", color="0.45", linewidth=1)
    here = (PARTICLE - 0.1, 2.0)
    axes.plot(*here, "o", color="0.1", markersize=7, zorder=5)
    draw_arrow(axes, here, (here[0] + 0.3, here[1] - 0.48), SEEN)
    axes.text(here[0] + 0.14, here[1] + 0.12, "$x$", ha="left", va="bottom")
    axes.text(here[0] + 0.36, here[1] - 0.3, r"$\dot{x}$: hidden", ha="left", va="center", fontsize=8.5, color="0.35")
