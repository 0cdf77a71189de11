"""Figure 4.1: a smoothly graded force from a few sigmoid units."""

from collections.abc import Callable, Iterator

import numpy as np

from motorgrad.schema import count, number
from motorgrad.statistics import exact
from motorgrad_thesis._claims import Claim, at_most
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment
from motorgrad_thesis._figures import Figure, subplots
from motorgrad_thesis.chapter_4._pools import fires_at

CLOSE = 0.05  # fraction of the full force: a response this close to the line counts as near-linear
STEEP = np.geomspace(0.5, 50, 61)  # gain times spacing
NUMBERS = (5, 10, 20, 40, 80)  # units
POINTS = np.linspace(0, 1, 2001)
AMPLIFIERS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "square": lambda y: y**2,
    "square root": np.sqrt,
    "S-shaped": lambda y: y**2 * (3 - 2 * y),
}


@experiment("fig-4.1", "a graded force from a few units", "figure 4.1")
class ForceGrading(Experiment):
    """Sigmoid units with staggered thresholds, whose sum is a graded force: its deviation from a straight line, the
    effect of the gains on it, and other amplifiers made of the same units.
    """

    units: int = count(
        5, 2, 100, help="number of units of equal force, with thresholds spaced evenly over inputs from 0 to 1"
    )
    steepness: float = number(4.0, 0.1, 1000, help="the gain of every unit times the spacing of the thresholds")

    def run(self, work: Workspace) -> Values:
        deviations = [off_line(graded(self.units, steepness)) for steepness in (self.steepness, *STEEP)]
        found: Values = {
            "force": graded(self.units, self.steepness),
            "deviation": np.array(deviations[0]),
            "deviation by steepness": np.array(deviations[1:]),
        }
        for name, target in AMPLIFIERS.items():
            forces = [amplifier(target, number, self.steepness).mean(1) for number in NUMBERS]
            found[name] = np.array(forces)
            found[f"deviation {name}"] = np.abs(found[name] - target(POINTS)).max(1)
        return found

    def figure(self, values: Values) -> Figure:
        figure, ((single, total), (steep, others)) = subplots(8, 5.6, 2, 2)
        force = values["force"]
        low = 0.5 / self.units
        high = 1 - 0.5 / self.units
        single.plot(POINTS, force, linewidth=1.4)
        single.set(title=f"{self.units} single units", ylabel="activation", xlabel="input")
        total.plot(POINTS, POINTS, color="0.5", linestyle=":", label="straight line")
        total.plot(POINTS, force.mean(1), color="black", label="mean")
        total.axvspan(low, high, color="0.93", zorder=0)
        total.set(title=f"mean, off the line by {values['deviation']:.1%}")
        total.text(0.5, 0.02, "first … last threshold", ha="center", fontsize=8, color="0.45")
        total.set(ylabel="force / full force", xlabel="input")
        total.legend(loc="upper left")
        steep.plot(STEEP, 100 * values["deviation by steepness"], color="black")
        steep.plot(self.steepness, 100 * values["deviation"], "o", color="#c0392b", label="drawn above")
        steep.set(xscale="log", yscale="log", xlabel="gain × spacing", ylabel="greatest deviation (%)")
        for axis in (steep.xaxis, steep.yaxis):
            axis.set_major_formatter("{x:g}")
        steep.set_title("too flat to too steep")
        steep.legend(loc="lower right")
        for colour, (name, target) in zip(("C0", "C1", "C2"), AMPLIFIERS.items(), strict=True):
            others.plot(POINTS, target(POINTS), color=colour, linestyle=":")
            others.plot(POINTS, values[name][0], color=colour, label=name)
        others.set(title=f"{NUMBERS[0]} units as other amplifiers (dotted)", ylabel="force", xlabel="input")
        others.legend()
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        off = float(values["deviation"])
        worth = np.array([values[f"deviation {name}"] for name in AMPLIFIERS]) * NUMBERS
        yield at_most(
            CLOSE,
            f"{self.units} units combine to give a near-linear response.",
            exact(off),
            "greatest deviation between the first and the last threshold",
            "of the full force",
            note=f"For gain × spacing = {self.steepness:g}.",
        )
        yield at_most(
            1,
            "Such units can approximate any increasing function of the input.",
            exact(worth.max()),
            "deviation, in forces of one unit, for every number of units",
            "units, the worst",
            note=f"Three functions ({', '.join(AMPLIFIERS)}), by {', '.join(map(str, NUMBERS))} units. Thresholds lie "
            "where the target has risen by half a unit more; gains are proportional to the target's slope there.",
            source="figure 4.1, section 4.2",
        )


def graded(units: int, steepness: float) -> np.ndarray:
    """Activations of evenly spaced units over `POINTS`, `(points, units)`."""
    return amplifier(lambda y: y, units, steepness)


def amplifier(target: Callable[[np.ndarray], np.ndarray], units: int, steepness: float) -> np.ndarray:
    """Activations `(points, units)` over `POINTS` of units whose mean follows an increasing `target` from 0 to 1."""
    fine = np.linspace(0, 1, 200_001)
    thresholds = np.interp((np.arange(units) + 0.5) / units, target(fine), fine)
    step = 1e-6
    slopes = (target(thresholds + step) - target(thresholds - step)) / (2 * step)
    return fires_at(thresholds, steepness * units * slopes, POINTS)


def off_line(activation: np.ndarray) -> float:
    """Greatest deviation of the mean activation from the straight line, between the first and the last threshold."""
    edge = 0.5 / activation.shape[1]
    inside = np.abs(POINTS - 0.5) <= 0.5 - edge
    return float(np.abs(activation.mean(1) - POINTS)[inside].max())
