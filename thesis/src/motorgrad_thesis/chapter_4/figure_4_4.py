"""Figure 4.4: learning curves of pools for the linear mapping."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from motorgrad.statistics import LEVEL, mean_of, share_of
from motorgrad.tasks import LinearRecruitment
from motorgrad_thesis._claims import Claim, more_than_half, negative, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Figure, subplots
from motorgrad_thesis.chapter_4._pools import (
    SPACED,
    LinearStudy,
    equally_spaced_from,
    least_error,
    parameter_history,
    spacing_deviation,
    whose,
)

LAST = 0.1  # share of learning, the last, over which final errors are averaged


@experiment("fig-4.4", "learning the linear mapping", "figure 4.4")
class LinearPerformance(LinearStudy):
    """The error of the force during learning, relative to the pool's full force, for pools of several sizes; and the
    share of pools that are equally spaced. The smallest pool also learns with the force as a ratio, which is slower."""

    def run(self, work: Workspace) -> Values:
        few = self.units[0]
        tasks = {str(units): self.task(units) for units in self.units}
        tasks["ratio"] = LinearRecruitment(units=few, output="ratio")
        found: Values = {"units": np.array(self.units)}
        for name, task in tasks.items():
            run = self.trained(work, task)
            found["decision"], found[f"error {name}"] = run.curve("error")
            found[f"final {name}"] = run.final("error", LAST)
            found[f"off {name}"] = spacing_deviation(*parameter_history(run), task)
        return found

    def figure(self, values: Values) -> Figure:
        figure, (error, spaced) = subplots(8, 6, 2, 1, sharex=True, height_ratios=[2, 1])
        numbers = values["units"].tolist()
        decision = values["decision"] / 1e6
        curves = [(str(units), f"{units} units", f"C{row}", "-") for row, units in enumerate(numbers)]
        curves.append(("ratio", f"{numbers[0]} units, ratio form", "C0", "--"))
        for name, label, colour, line in curves:
            centre, half = interval(values[f"error {name}"])
            error.plot(decision, centre, color=colour, linestyle=line, label=label)
            error.fill_between(decision, centre - half, centre + half, color=colour, alpha=0.25, linewidth=0)
            share = (values[f"off {name}"] < SPACED).mean(0)
            spaced.plot(decision, 100 * share, color=colour, linestyle=line)
        for row, units in enumerate(numbers):
            least = least_error(self.task(units))
            error.axhline(least, color=f"C{row}", linestyle=":", linewidth=1)
        error.set(ylabel="mean |error| / full force", ylim=(0, None), xlim=(0, decision[-1]))
        count = len(values[f"error {numbers[0]}"])
        error.set_title(
            f"mean of {count} seeds with its {LEVEL:.0%} interval; dotted: ideal thresholds, no noise",
            fontsize=9,
            color="0.4",
        )
        error.legend(ncols=2)
        spaced.set(ylabel="equally spaced (%)", xlabel="million decisions", ylim=(-3, 103))
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        numbers = values["units"].tolist()
        last = {units: values[f"final {units}"] for units in numbers}
        for units in numbers:
            yield more_than_half(
                f"Pools of {units} units improve by learning.",
                share_of(last[units] < values[f"error {units}"][:, 0]),
                note="The last tenth of learning compared with the first record.",
                kind=whose(units),
                of="Pools improve by learning.",
            )
        for few, many in pairwise(numbers):
            yield negative(
                f"{many} units approximate the mapping better than {few}.",
                mean_of(last[many] - last[few]),
                unit="of the full force: difference of mean |error|",
                note=f"Paired by seed, in the last tenth of {self.steps:,} decisions.",
                source="figure 4.4, section 4.2",
                kind=whose(many),
                of="More units approximate the mapping better.",
            )
        for few, many in pairwise(numbers):
            found = {units: equally_spaced_from(values["decision"], values[f"off {units}"]) for units in (few, many)}
            never = {units: int(np.isinf(times).sum()) for units, times in found.items()}
            times = {units: np.minimum(times, values["decision"][-1]) for units, times in found.items()}
            later = mean_of((times[many] - times[few]) / 1e6)
            yield positive(
                f"{many} units take longer than {few} to become equally spaced.",
                later,
                unit="million decisions later",
                note=f"The time after which every threshold stays within {SPACED:g} spacings of its ideal place. "
                f"{never[few]} and {never[many]} of {later.count} pools never get there, and count with all "
                f"{self.steps:,} decisions.",
                source="section 4.4",
                kind=whose(many),
                of="More units converge more slowly.",
            )


def interval(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the seeds, and half the width of its interval, at every record; of `(seeds, records)`."""
    measured = [mean_of(record) for record in values.T]
    return np.array([m.value for m in measured]), np.array([m.high - m.value for m in measured])
