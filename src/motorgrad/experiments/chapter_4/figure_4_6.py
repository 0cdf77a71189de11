"""Figure 4.6: the height to which the arm lifts loads, by simulation and from the table."""

from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np

from motorgrad.bodies import lift, lift_table
from motorgrad.experiments._claims import Claim, at_least, at_most
from motorgrad.experiments._experiment import Experiment, Values, Workspace, experiment, ranged, smoke
from motorgrad.experiments._figures import Figure, subplots
from motorgrad.statistics import exact
from motorgrad.tasks import ArmRecruitment

CLOSE = ((0.0, 0.05, 1.5e-3), (0.05, 0.5, 5e-4), (0.5, 14.0, 3e-4))
"""(low, high, tolerance): allowed difference between table and simulation for loads in this range in kg, as a fraction
of the full lift."""

BORDER = (0.97, 1.02)  # relative to the force that just reaches the top, where the height has a kink
LOADS = np.linspace(-2, 14, 321)  # kg
LEVELS = np.linspace(0, 1, 101)
SHOWN = tuple(0.1 * np.arange(1, 11))  # activations
SAMPLED = tuple(np.arange(0.5, 14.1, 1.5))  # kg


@experiment("fig-4.6", "the height function", "figure 4.6")
class HeightFunction(Experiment):
    """The greatest height to which the arm lifts a load within 2 s from rest, over load and constant activation. Lines:
    the table used in learning. Points: independent simulations.

    **Arguments:**

    - `points`: random loads and activations at which the table is compared with simulation, in each of three ranges of
      the load; half of them near the border at which the load just reaches the top.
    - `seed`: seed of the random points.
    """

    points: int = ranged(200, 1, 100_000)
    seed: int = 0

    quick = smoke(points=5)

    def run(self, work: Workspace) -> Values:
        loads, active = self.drawn()
        sampled = np.array(SAMPLED)[None], np.array(SHOWN)[:, None]
        return {
            "height": height(LOADS[None], LEVELS[:, None]),
            "sampled": work.part("sampled", lambda: {"height": simulated(*sampled)})["height"],
            "random load": loads,
            "random activation": active,
            "random table": height(loads, active),
            "random simulated": work.part("random", lambda: {"height": simulated(loads, active)})["height"],
        }

    def drawn(self) -> tuple[np.ndarray, np.ndarray]:
        """Random loads, denser at light ones, and activations: both `(3, points)`, in the ranges of `CLOSE`."""
        generator, body = np.random.default_rng(self.seed), ArmRecruitment().body
        ends = np.sqrt([row[:2] for row in CLOSE])[:, :, None]
        loads = (ends[:, 0] + (ends[:, 1] - ends[:, 0]) * generator.random((len(CLOSE), self.points))) ** 2
        near = np.arange(self.points) % 2 == 1
        low, high = np.where(near, BORDER[0], 0.0), np.where(near, BORDER[1], BORDER[0])
        share = low + (high - low) * generator.random(loads.shape)
        top = np.vectorize(lift_table(body).top_force)(loads)
        return loads, np.minimum(share * top / body.strength, 1.0)

    def figure(self, values: Values) -> Figure:
        from matplotlib import colormaps
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        figure, (left, right) = subplots(8, 3.9, 1, 2, sharey=True)
        shades, full = colormaps["viridis"], ArmRecruitment().scale
        for row, active in enumerate(SHOWN):
            colour = shades(active)
            left.plot(LOADS, values["height"][np.abs(LEVELS - active).argmin()], color=colour, linewidth=1.2)
            left.plot(SAMPLED, values["sampled"][row], "o", color=colour, markersize=3)
        left.set(xlabel="load (kg)", ylabel="height $H$", ylim=(-0.02 * full, 1.05 * full), xlim=(LOADS[0], LOADS[-1]))
        figure.colorbar(ScalarMappable(Normalize(0, 1), shades), ax=left, label="activation", pad=0.03)
        warm = colormaps["plasma"]
        for column, load in enumerate(SAMPLED):
            colour = warm(0.9 * load / SAMPLED[-1])
            right.plot(LEVELS, values["height"][:, np.abs(LOADS - load).argmin()], color=colour, linewidth=1.2)
            right.plot(SHOWN, values["sampled"][:, column], "o", color=colour, markersize=3)
        right.set(xlabel="activation", xlim=(0, 1))
        key = ScalarMappable(Normalize(0, SAMPLED[-1] / 0.9), warm)
        figure.colorbar(
            key,
            ax=right,
            label="load (kg)",
            pad=0.03,
            boundaries=np.linspace(0, SAMPLED[-1], 200),
            ticks=range(0, 15, 2),
        )
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        lifted, full = values["height"], ArmRecruitment().scale
        unloaded, rising = np.ptp(lifted[:, LOADS <= 0]), np.diff(lifted, axis=0).min()
        falling = np.diff(lifted[:, LOADS > 0], axis=1).max()
        off = np.abs(values["random table"] - values["random simulated"]).max(axis=1) / full
        rounding = 1e-6 * full  # single precision
        yield at_most(
            0,
            "For negative loads the height is constant.",
            exact(unloaded),
            "greatest difference between two activations and loads up to 0",
            source="section 4.3.2",
        )
        yield at_least(
            -rounding,
            "The height never falls with the activation.",
            exact(rising),
            "least rise, per hundredth of the activation",
            f"of {full:g}",
        )
        yield at_most(
            rounding, "The height never rises with the load.", exact(falling), "greatest rise, per 50 g", f"of {full:g}"
        )
        for (low, high, close), found in zip(CLOSE, off, strict=True):
            yield at_most(
                close,
                f"The table used in learning agrees with simulation: loads from {low:g} to {high:g} kg.",
                exact(found),
                "greatest difference",
                "of the full lift",
                note=f"At {self.points:,} random loads and activations, half of them near the border of the full lift. "
                "The bounds of the three ranges were set after a first measurement.",
            )


def height(load: np.ndarray, activation: np.ndarray) -> np.ndarray:
    """Height from the table, including its value without a load; arrays broadcast."""
    return np.asarray(ArmRecruitment().effect(jnp.asarray(load), jnp.asarray(activation)), float)


def simulated(load: np.ndarray, activation: np.ndarray) -> np.ndarray:
    """Height by simulation, for loads above 0; arrays broadcast."""
    task = ArmRecruitment()
    return task.scale * lift(task.body, load, task.body.strength * activation)
