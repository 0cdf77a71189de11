"""Section 3.1: higher-order gradients, by the curvature of the average reward from scores and traces."""

from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np

from motorgrad.learning import (
    SGD,
    Agent,
    Estimator,
    Exponential,
    FisherMetric,
    MeanReward,
    Metric,
    NewtonMetric,
    gpomdp,
)
from motorgrad.schema import count, number
from motorgrad.statistics import mean_of
from motorgrad.tasks import ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import biased_hessian, hessian
from motorgrad_thesis._claims import Claim, negative, positive, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, draw_intervals, subplots
from motorgrad_thesis.chapter_3._curves import BEST, decided, earned
from motorgrad_thesis.chapter_3._estimates import along, comparison_point, relative_error

RECORDS = 25
Terms = Literal["whole", "approximate"]
TERMS: tuple[Terms, ...] = ("whole", "approximate")
CLOSE = 0.05  # of the Hessian
SETTINGS: dict[str, tuple[float, float]] = {
    "plain": (8.0, 0.0),
    "natural": (10.0, 1.0),
    "Newton, whole": (3.0, 0.3),
    "Newton, approximate": (3.0, 0.3),
}
"""The learning rate and the damping of each learner: of 5 to 16 pairs, the one with the greatest mean over the records
on seeds 100 to 105. Dampings from 0.003, factors of about 3 apart, and rates factors of 2 or 3 apart."""


@experiment("sec-3.1-newton", "higher-order gradients", "section 3.1")
class HigherOrder(Experiment):
    """The Hessian of the average reward, estimated from scores and traces and compared with that by automatic
    differentiation, on the three-state MDP; and steps that use it beside those of the plain and of the natural
    gradient, at two hidden switches. The worth of a switch makes the curvature along its parameters. All move once a
    batch.
    """

    runs: int = count(1000, 2, 100_000, help="number of runs at fixed parameters over which estimates are averaged")
    longest: int = count(10_000, 100, 10**8, unit="decisions", help="length of each run at fixed parameters")
    seeds: int = count(20, 2, 10_000, help="number of learners of each kind")
    first_seed: int = count(0, help="the first of the seeds, which are successive")
    steps: int = count(200_000, 2_000, 10**9, unit="decisions", help="length of the practice of each learner")
    batch: int = count(1_000, 2, unit="decisions", help="decisions of a batch")
    decay: float = number(0.8, 0, 1, open_high=True, help=r"decay of the traces $\beta$, per decision")

    quick = smoke(runs=20, longest=100, seeds=3, steps=3_000)

    def learners(self) -> Mapping[str, Metric | None]:
        """The metric of each line of the figure."""
        damping = {name: pair[1] for name, pair in SETTINGS.items()}
        memory = 1 / (5 * self.batch)
        return {
            "plain": None,
            "natural": FisherMetric(memory, damping["natural"]),
            **{
                f"Newton, {terms}": NewtonMetric(self.decay, terms, memory, damping[f"Newton, {terms}"])
                for terms in TERMS
            },
        }

    @property
    def lengths(self) -> list[int]:
        """Decisions after which estimates are compared: one per half a decade, to the longest."""
        number = round(2 * np.log10(self.longest / 100)) + 1
        return [round(self.longest / 10 ** ((number - 1 - each) / 2)) for each in range(number)]

    def run(self, work: Workspace) -> Values:
        decisions = np.unique(np.geomspace(self.batch, self.steps, RECORDS).astype(int))
        found: Values = {
            "decision": decisions,
            "line": np.array(list(self.learners())),
            "length": np.array(self.lengths),
        }
        for terms in TERMS:
            found |= work.part(f"hessian-{terms}", lambda terms=terms: self._estimates(terms))
        for name, metric in self.learners().items():
            found |= work.part(name, lambda name=name, each=metric: self._learned(name, each, decisions))
        return found

    def _estimates(self, terms: Terms) -> Values:
        """For one estimator: distance of each estimate from the exact Hessian, relative to its norm, `(lengths,
        runs)`; what it is in the limit; and the component of the longest along that limit, minus 1, `(runs,)`."""
        mdp = ThreeState().dynamics
        point = comparison_point()
        truth = hessian(mdp, point).ravel()
        limit = biased_hessian(mdp, point, self.decay, whole=terms == "whole").ravel()
        metric = NewtonMetric(self.decay, terms, rate=1e-9)
        stepper = stepper_for(ThreeState(), Agent(point, gpomdp(self.decay), metric=metric), range(self.runs))
        errors = []
        estimates = np.zeros((self.runs, len(truth)))
        for length in self.lengths:
            stepper.advance(length - stepper.decision)
            mean = stepper.state["cycle"].agent.chain[0].hessian.mean
            estimates = np.asarray(mean, float).reshape(self.runs, -1)
            errors.append(relative_error(estimates, truth))
        return {
            f"error {terms}": np.array(errors),
            f"bias {terms}": relative_error(limit, truth),
            f"off {terms}": along(estimates - limit, limit),
        }

    def _learned(self, name: str, metric: Metric | None, decisions: np.ndarray, rate: float | None = None) -> Values:
        estimator = Estimator(Exponential(self.decay), MeanReward(), update_every=self.batch)
        rate = SETTINGS[name][0] if rate is None else rate
        agent = Agent(decided(), estimator, SGD(rate), metric)
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        return {f"earned {name}": earned(agent, seeds, decisions)["earned"]}

    def figure(self, values: Values) -> Figure:
        """Two panels: the error of the estimated Hessian, and learning."""
        figure, (errors, learning) = subplots(10, 4, 1, 2)
        _errors(errors, values)
        for row, name in enumerate(values["line"]):
            draw_band(learning, values["decision"], BEST - values[f"earned {name}"], f"C{row}", str(name))
        learning.set(xscale="log", yscale="log", xlabel="decisions", ylabel=r"distance from the best average reward")
        learning.set_title(f"batches of {self.batch:,}, median of {self.seeds} seeds", loc="left")
        learning.legend(fontsize=8)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for terms in TERMS:
            yield within(
                -CLOSE,
                CLOSE,
                f"The mean estimate of the {terms} Hessian is what linear algebra says (β = {self.decay:g}).",
                mean_of(values[f"off {terms}"]),
                "relative deviation along it",
                note=f"That is {float(values[f'bias {terms}']):.2g} away from the exact Hessian, relative to it.",
                kind="extension",
            )
        last = {terms: values[f"error {terms}"][-1] for terms in TERMS}
        yield negative(
            f"In a run of {int(values['length'][-1]):,} decisions, the approximate Hessian has the smaller error.",
            mean_of(last["approximate"] - last["whole"]),
            "relative error of the approximate minus that of the whole Hessian",
            note=f"{last['approximate'].mean():.2f} and {last['whole'].mean():.2f}.",
            kind="extension",
        )
        means = {str(name): values[f"earned {name}"].mean(1) for name in values["line"]}
        for name in list(means)[2:]:
            for other in ("plain", "natural"):
                terms = name.removeprefix("Newton, ")
                yield positive(
                    f"Steps by the {terms} Hessian converge faster than by the {other} gradient.",
                    mean_of(means[name] - means[other]),
                    "mean over the records of the average reward, minus that of the other",
                    note=f"{means[name].mean():.4f} and {means[other].mean():.4f}, records evenly spaced in the "
                    "logarithm of decisions; the learning rate and the damping of each were chosen on other seeds. The "
                    "best damping exceeds all eigenvalues of the Hessian: steps are almost those of the gradient.",
                    kind="thesis" if other == "plain" else "extension",
                    of="Methods for higher-order gradients converge faster." if other == "plain" else "",
                )


def _errors(axes: Axes, values: Values) -> None:
    for terms, colour in zip(TERMS, ("C2", "C3"), strict=True):
        found = [mean_of(each) for each in values[f"error {terms}"]]
        draw_intervals(axes, values["length"], found, fmt="o-", markersize=4, color=colour, label=terms)
        axes.axhline(float(values[f"bias {terms}"]), color=colour, linestyle="--", linewidth=1)
    axes.set(xscale="log", yscale="log", xlabel="decisions", ylabel="mean relative error")
    axes.set_title("estimated Hessian (dashed: bias)", loc="left")
    axes.legend(fontsize=8)
