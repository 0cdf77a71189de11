"""Figure 4.6: the height to which the arm lifts loads, by simulation and from the table."""

from collections.abc import Iterator, Mapping

import jax.numpy as jnp
import numpy as np

from motorgrad.bodies import Posture, lift, lift_table
from motorgrad.schema import count
from motorgrad.statistics import exact
from motorgrad_thesis._claims import Claim, at_least, at_most
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import SubFigure
from motorgrad_thesis.chapter_4._postures import BothPostures, arm_task

RANGES = ((0.0, 0.05), (0.05, 0.5), (0.5, 14.0))  # kg
CLOSE: Mapping[Posture, tuple[float, ...]] = {"vertical": (4e-2, 2e-2, 1e-2), "horizontal": (1.5e-3, 5e-4, 3e-4)}
"""Allowed difference between table and simulation for loads in each of `RANGES`, as a fraction of the full lift. Below
a vertical upper arm the load snaps up near the border, within a per cent of the force."""

BORDER = (0.97, 1.02)  # relative to the force that just reaches the top, where the height has a kink or a jump
SHORT = 0.95  # of the force that just reaches the top: too little force
LOADS = np.linspace(-2, 14, 321)  # kg
LEVELS = np.linspace(0, 1, 101)
SHOWN = tuple(0.1 * np.arange(1, 11))  # activations
SAMPLED = tuple(np.arange(0.5, 14.1, 1.5))  # kg


@experiment("fig-4.6", "the height function", "figure 4.6")
class HeightFunction(BothPostures):
    """The greatest height to which the arm lifts a load within 2 s from rest, over load and constant activation. Lines:
    the table used in learning. Points: independent simulations. With the upper arm held vertically and horizontally.
    """

    points: int = count(
        200,
        1,
        100_000,
        help="number of random loads and activations at which the table is compared with simulation, in each of three "
        "ranges of the load; half of them near the border at which the load just reaches the top",
    )
    seed: int = count(0, help="seed of the random points")

    quick = smoke(points=5)
    size = (8, 3.9)

    def measure(self, work: Workspace, posture: Posture) -> Values:
        loads, active = self.drawn(posture)
        sampled = np.array(SAMPLED)[None], np.array(SHOWN)[:, None]
        return {
            "height": height(LOADS[None], LEVELS[:, None], posture),
            "short of the top": short_lifts(LOADS[LOADS > 0], posture),
            "sampled": work.part(f"{posture} sampled", lambda: {"height": simulated(*sampled, posture)})["height"],
            "random load": loads,
            "random activation": active,
            "random table": height(loads, active, posture),
            "random simulated": work.part(f"{posture} random", lambda: {"height": simulated(loads, active, posture)})[
                "height"
            ],
        }

    def drawn(self, posture: Posture) -> tuple[np.ndarray, np.ndarray]:
        """Random loads, denser at light ones, and activations: both `(3, points)`, in the `RANGES`."""
        generator = np.random.default_rng(self.seed)
        body = arm_task(posture).body
        ends = np.sqrt(RANGES)[:, :, None]
        loads = (ends[:, 0] + (ends[:, 1] - ends[:, 0]) * generator.random((len(RANGES), self.points))) ** 2
        near = np.arange(self.points) % 2 == 1
        low = np.where(near, BORDER[0], 0.0)
        high = np.where(near, BORDER[1], BORDER[0])
        share = low + (high - low) * generator.random(loads.shape)
        top = np.vectorize(lift_table(body).top_force)(loads)
        return loads, np.minimum(share * top / body.full_force, 1.0)

    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        from matplotlib import colormaps
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        left, right = figure.subplots(1, 2, sharey=True)
        shades = colormaps["viridis"]
        full = arm_task(posture).scale
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

    def judge(self, values: Values, posture: Posture) -> Iterator[Claim]:
        lifted = values["height"]
        full = arm_task(posture).scale
        unloaded = np.ptp(lifted[:, LOADS <= 0])
        rising = np.diff(lifted, axis=0).min()
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
        yield at_most(
            0.5 * full,
            "Applying too little force fails to lift the load.",
            exact(values["short of the top"].max()),
            f"greatest height for {1 - SHORT:.0%} less than the force that just reaches the top",
            f"of {full:g}",
            note="We call less than half of the full lift a failure.",
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
        for (low, high), close, found in zip(RANGES, CLOSE[posture], off, strict=True):
            yield at_most(
                close,
                f"The table used in learning agrees with simulation: loads from {low:g} to {high:g} kg.",
                exact(found),
                "greatest difference",
                "of the full lift",
                note=f"At {self.points:,} random loads and activations, half of them near the border of the full lift. "
                "The bounds of the three ranges were set after a first measurement.",
                kind="extension",
            )


def height(load: np.ndarray, activation: np.ndarray, posture: Posture) -> np.ndarray:
    """Height from the table, including its value without a load; arrays broadcast."""
    return np.asarray(arm_task(posture).effect(jnp.asarray(load), jnp.asarray(activation)), float)


def short_lifts(load: np.ndarray, posture: Posture) -> np.ndarray:
    """Height of loads under a little less than the force that just lifts each to the top: `SHORT` of it."""
    task = arm_task(posture)
    table = lift_table(task.body)
    force = SHORT * np.array([table.top_force(each) for each in load])
    return task.scale * np.asarray(table.lift(load, force), float)


def simulated(load: np.ndarray, activation: np.ndarray, posture: Posture) -> np.ndarray:
    """Height by simulation, for loads above 0; arrays broadcast."""
    task = arm_task(posture)
    return task.scale * lift(task.body, load, task.body.full_force * activation)
