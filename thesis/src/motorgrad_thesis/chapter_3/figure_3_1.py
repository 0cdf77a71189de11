"""Figure 3.1: the learner, and how good its gradient estimates are on the three-state MDP."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.learning import Constant, MeanReward
from motorgrad.policies import Softmax
from motorgrad.schema import count, numbers_of, static
from motorgrad.statistics import exact, mean_of
from motorgrad.tasks import ThreeState
from motorgrad.training import Run, agent_for
from motorgrad.worlds import oracle
from motorgrad_thesis._claims import Claim, at_most, in_every, negative, positive, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_intervals, new_figure
from motorgrad_thesis.chapter_3._estimates import comparison_point, estimates, relative_error

SOURCE = "an independent computation on the MDP of Baxter & Bartlett 2001"
ETA = 0.29419747
GRADIENT = (-0.03272585, -0.03524847, 0.03272585, 0.03524847)
BIAS = {0.0: 0.0770765, 0.4: 0.0477171, 0.8: 0.0164283, 0.95: 0.0041583, 0.99: 0.00083444}  # by decay
# decays of the traces compared; the errors below belong to the long one
SHORT = 0.0
LONG = 0.95
ERROR_RUNS = 500
ERRORS = {"none": {1_000: 0.752, 10_000: 0.241, 100_000: 0.084}, "mean": {1_000: 0.217, 10_000: 0.066, 100_000: 0.021}}
"""Mean relative errors of an independent simulation over `ERROR_RUNS` runs, by baseline and number of decisions."""

GOOD = 0.799
# deviation of a bias, in units of the gradient; relative deviation of an error
CLOSE = 0.01
TOLERANCE = 0.1
BASELINE_LABELS = {"none": "no baseline", "mean": "running-mean baseline"}
# (indent, text, emphasis): figure 3.1 with its two misprints corrected
LISTING = (
    (0, r"given $\beta \in [0, 1)$, $\alpha$, $\theta_0$", "plain"),
    (0, r"$z_0 = 0$,  $b_0 = 0$", "plain"),
    (0, r"for $t = 0, 1, 2 \ldots$", "plain"),
    (1, "act", "head"),
    (2, r"observe $y_t$", "plain"),
    (2, r"sample $a_t \sim \pi(\cdot \mid y_t, \theta_t)$", "plain"),
    (2, r"$z_{t+1} = \beta\, z_t + \nabla_\theta \log \pi(a_t \mid y_t, \theta_t)$", "plain"),
    (1, "reinforce", "head"),
    (2, r"receive $r_{t+1}$", "plain"),
    (2, r"$\delta_{t+1} = r_{t+1} - b_t$", "plain"),
    (2, r"$b_{t+1} = b_t + \delta_{t+1} / (t + 1)$", "corrected"),
    (1, "improve", "head"),
    (2, r"$\theta_{t+1} = \theta_t + \alpha\, \delta_{t+1}\, z_{t+1}$", "corrected"),
)
LINE_STYLES = {"none": ("--", "o", "none"), "mean": ("-", "o", None)}
LEGEND_LABELS = {"none": "no baseline", "mean": "running mean"}
HEAD = "#3b6fb6"
CORRECTED = "#c8452f"


@experiment("fig-3.1", "the learner and its estimates", "figure 3.1")
class Learner(Experiment):
    """The learner: act, reinforce, improve. The error of its gradient estimates at fixed parameters against the decay
    of the trace and the length of the run, with and without a baseline; and learning with an update at every decision
    (OLGARB).
    """

    reading: ClassVar[str] = (
        "Two slips of the listing are corrected: rewards are counted from one, because it divides by t = 0, "
        "and the last step uses the reward and the trace after the action."
    )

    runs: int = count(1000, 2, 100_000, help="number of runs over which errors of estimates are averaged")
    longest: int = count(100_000, 1_000, 10**8, unit="decisions", help="length of each run at fixed parameters")
    seeds: int = count(50, 1, 10_000, help="number of learners that update at every decision")
    steps: int = count(600_000, 200, 10**9, unit="decisions", help="length of the practice of each learner")
    decays: tuple[float, ...] = static(tuple(BIAS), help="decays of the traces per decision, 0 and 0.95 among them")

    def validate(self) -> None:
        super().validate()
        known = {SHORT, LONG} <= set(self.decays) <= set(BIAS)
        check(known, "decays", self.decays, f"{SHORT:g}, {LONG:g} and others of {', '.join(map(str, BIAS))}")

    quick = smoke(runs=20, longest=1_000, seeds=3, steps=2_000, decays=(SHORT, LONG))

    @property
    def lengths(self) -> list[int]:
        """Decisions after which estimates are recorded: two per decade, from 100 to the longest."""
        steps = range(int(2 * np.log10(self.longest / 100) + 1e-9) + 1)
        return [round(100 * 10 ** (step / 2)) for step in steps]

    def run(self, work: Workspace) -> Values:
        mdp = ThreeState().dynamics
        point = comparison_point()
        truth = oracle.flat(oracle.gradient(mdp, point))
        eta = oracle.average_reward(mdp, point)
        biased = np.stack([oracle.flat(oracle.biased_gradient(mdp, point, decay)) for decay in self.decays])
        found: Values = {
            "decay": np.array(self.decays),
            "length": np.array(self.lengths),
            "average reward": np.array(eta),
            "gradient": truth,
            "exact bias": np.linalg.norm(biased - truth, axis=1) / np.linalg.norm(truth),
        }
        for name, baseline in (("none", None), ("mean", MeanReward())):
            kept = [work.part(f"{name}-{d}", lambda d=d, b=baseline: self._errors(d, b, truth)) for d in self.decays]
            found[f"error {name}"] = np.stack([each["error"] for each in kept])
        kept = [
            work.part(f"bias-{d}", lambda d=d, b=b: {"bias": self._bias(d, eta, truth, b)})
            for d, b in zip(self.decays, biased, strict=True)
        ]
        found["bias"] = np.stack([each["bias"] for each in kept])
        task = ThreeState()
        run = work.train(task, agent_for(task), self.steps, self.seeds)
        return found | work.part("learning", lambda: earned(run))

    def _errors(self, decay: float, baseline: MeanReward | None, truth: np.ndarray) -> Values:
        return {"error": relative_error(estimates(decay, baseline, self.lengths, self.runs), truth)}

    def _bias(self, decay: float, eta: float, truth: np.ndarray, biased: np.ndarray) -> np.ndarray:
        """Component of each run's error along the exact bias, which averages to the bias. The baseline is constant,
        because a running mean adds a bias of its own in finite runs."""
        way = (biased - truth) / np.linalg.norm(biased - truth)
        last = estimates(decay, Constant(eta), self.lengths[-1:], self.runs)[0]
        return (last - truth) @ way / np.linalg.norm(truth)

    def figure(self, values: Values) -> Figure:
        """The listing and four panels: bias, error against the length of the run and against the decay, learning."""
        figure = new_figure(12.5, 7)
        panels = figure.subplot_mosaic(
            [["listing", "bias", "length"], ["listing", "decay", "learning"]], width_ratios=[1, 1, 1]
        )
        _listing(panels["listing"])
        _bias(panels["bias"], values)
        _length(panels["length"], values, ERRORS)
        _decay(panels["decay"], values)
        _learning(panels["learning"], values, GOOD)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        yield from _exact_claims(values)
        yield from _bias_claims(values)
        yield from _error_claims(values)
        yield from _trade_off(values)
        yield _learned(values)


def earned(run: Run) -> Values:
    """Exact average rewards of the policies of a run on the three-state MDP, `(seeds, records)`, at some twenty-five
    records, denser at first; and the numbers of decisions made by then."""
    mdp = ThreeState().dynamics
    decision = run.curve("reward")[0]
    picked = np.unique(np.round(np.geomspace(1, len(decision), 25)).astype(int)) - 1
    initial: Any = run.initial
    weights = np.concatenate([initial.weights[None], run.policies_at(picked).weights])
    reward = [[oracle.average_reward(mdp, Softmax(one)) for one in seeds] for seeds in weights]
    return {"decision": np.concatenate([[0], decision[picked]]), "earned": np.array(reward).T}


def _exact_claims(values: Values) -> Iterator[Claim]:
    rounding = 5.01e-9  # half a unit of the last of eight digits
    exactly = [values["exact bias"][row] / BIAS[float(decay)] - 1 for row, decay in enumerate(values["decay"])]
    yield at_most(
        rounding,
        f"At the point of comparison, the average reward of the three-state MDP is {ETA}.",
        exact(abs(values["average reward"] - ETA)),
        "deviation",
        kind="reference model",
        source=SOURCE,
    )
    yield at_most(
        rounding,
        "The exact gradient there is (∓0.03272585, ∓0.03524847).",
        exact(np.abs(values["gradient"] - GRADIENT).max()),
        "greatest deviation of a component",
        kind="reference model",
        source=SOURCE,
    )
    yield at_most(
        1.5e-5,
        "By linear algebra, the relative biases of traces are "
        f"{', '.join(f'{BIAS[float(d)]:g}' for d in values['decay'])}.",
        exact(np.abs(exactly).max()),
        "greatest relative deviation",
        note=f"For decays of {', '.join(f'{decay:g}' for decay in values['decay'])}.",
        kind="reference model",
        source=SOURCE,
    )


def _bias_claims(values: Values) -> Iterator[Claim]:
    for row, decay in enumerate(values["decay"]):
        expected = BIAS[float(decay)]
        yield within(
            expected - CLOSE,
            expected + CLOSE,
            f"The mean estimate with a trace of decay {decay:g} has a relative bias of {expected:g}.",
            mean_of(values["bias"][row]),
            note=f"By linear algebra {values['exact bias'][row]:.6g}; a hundredth of the gradient is allowed.",
            kind="reference model",
            source=SOURCE,
        )


def _error_claims(values: Values) -> Iterator[Claim]:
    row = list(values["decay"]).index(LONG)
    for name, figures in ERRORS.items():
        for length, expected in figures.items():
            if length not in values["length"]:
                continue
            errors = values[f"error {name}"][row, int(np.flatnonzero(values["length"] == length)[0])]
            yield within(
                expected * (1 - TOLERANCE),
                expected * (1 + TOLERANCE),
                f"With {BASELINE_LABELS[name]}, the mean relative error after {length:,} decisions is {expected:g} "
                f"(β = {LONG:g}).",
                mean_of(errors),
                note=f"The expected figure is itself a mean of {ERROR_RUNS} runs.",
                kind="reference model",
                source=SOURCE,
            )


def _trade_off(values: Values) -> Iterator[Claim]:
    decays = list(values["decay"])
    last = len(values["length"]) - 1
    thousand = int(np.flatnonzero(values["length"] == 1_000)[0])
    short = "In a short run, a trace without memory has the smaller error: variance outweighs bias"
    long = "In a long run, the longer trace has the smaller error: bias outweighs variance"
    for name, at, statement, claim in (
        ("none", thousand, short, positive),
        ("mean", last, long, negative),
    ):
        errors = values[f"error {name}"][:, at]
        yield claim(
            f"{statement} ({int(values['length'][at]):,} decisions, {BASELINE_LABELS[name]}).",
            mean_of(errors[decays.index(LONG)] - errors[decays.index(SHORT)]),
            f"relative error at β = {LONG:g} minus that at {SHORT:g}",
            source="section 3.2.1",
            of="The decay of the trace trades bias against variance.",
        )


def _learned(values: Values) -> Claim:
    numbers = numbers_of(agent_for(ThreeState()).hyperparameters)
    decay = numbers["estimator.trace.decay"]
    rate = numbers["optimizer.learning_rate"]
    return in_every(
        f"From θ = 0, OLGARB (β = {decay:g}, α = {rate:g}) reaches an average reward of {GOOD} of 0.8.",
        values["earned"][:, -1] >= GOOD,
        f"share of these seeds after {int(values['decision'][-1]):,} decisions",
        kind="reference model",
        source=SOURCE,
    )


def _listing(axes: Axes) -> None:
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(-15.2, 1))
    axes.set_title("the learner", loc="left")
    for line, (indent, text, kind) in enumerate(LISTING):
        colour = {"head": HEAD, "corrected": CORRECTED, "plain": "black"}[kind]
        weight = "bold" if kind == "head" else "normal"
        axes.text(0.09 * indent, -line, text, color=colour, fontweight=weight, fontsize=11, va="center")
    words = (
        "Red: corrections of the printed algorithm. It divides by\n"
        "$t$, which begins at 0, and its last step uses $\\delta$ and $z$\n"
        "from before the action. All three steps at every decision:\n"
        "OLGARB; with $b = 0$: OLPOMDP; with $\\theta$ fixed and\n"
        "$\\delta z$ averaged: GPOMDP, shown in the panels."
    )
    axes.text(0, -len(LISTING) + 0.2, words, fontsize=8.5, color="0.35", va="top", linespacing=1.5)


def _reach(values: Values) -> np.ndarray:
    return 1 / (1 - values["decay"])


def _bias(axes: Axes, values: Values) -> None:
    axes.plot(_reach(values), values["exact bias"], color="0.5", linewidth=1, label="exact")
    _points(
        axes,
        _reach(values),
        values["bias"],
        label=f"measured, {values['bias'].shape[1]:,} runs",
        color="C0",
        marker="o",
    )
    axes.set(xscale="log", yscale="log", xlabel=r"reach of the trace, $1/(1-\beta)$ decisions", ylabel="relative bias")
    axes.set_title(r"bias of $\nabla_\beta$", loc="left")
    axes.legend()


def _length(axes: Axes, values: Values, independent: Mapping[str, Mapping[int, float]]) -> None:
    row = list(values["decay"]).index(0.95)
    for colour, (name, (line, marker, face)) in zip(("C1", "C0"), LINE_STYLES.items(), strict=True):
        errors = values[f"error {name}"][row]
        _points(
            axes,
            values["length"],
            errors,
            color=colour,
            marker=marker,
            linestyle=line,
            markerfacecolor=face,
            label=LEGEND_LABELS[name],
        )
        axes.plot(
            *zip(*independent[name].items(), strict=True),
            "kx",
            markersize=9,
            label="independent" if name == "mean" else None,
        )
    axes.set(xscale="log", yscale="log", xlabel="decisions $T$", ylabel="mean relative error")
    axes.set_title(r"error of the estimate, $\beta = 0.95$", loc="left")
    axes.legend()


def _decay(axes: Axes, values: Values) -> None:
    decades = [at for at, length in enumerate(values["length"]) if length in (1_000, 10_000, 100_000)]
    for colour, at in zip(("C3", "C2", "C0"), decades, strict=False):
        for name, (line, marker, face) in LINE_STYLES.items():
            label = f"$T$ = {int(values['length'][at]):,}" if name == "mean" else None
            errors = values[f"error {name}"][:, at]
            style = {"color": colour, "linestyle": line, "marker": marker, "markerfacecolor": face}
            _points(axes, _reach(values), errors, label=label, **style)
    axes.plot(_reach(values), values["exact bias"], color="0.5", linewidth=1, label="bias only")
    axes.set(
        xscale="log", yscale="log", xlabel=r"reach of the trace, $1/(1-\beta)$ decisions", ylabel="mean relative error"
    )
    axes.set_title("bias against variance (dashed: no baseline)", loc="left")
    axes.legend(fontsize=8)


def _learning(axes: Axes, values: Values, good: float) -> None:
    decision = values["decision"][1:]
    short = 0.8 - values["earned"][:, 1:]
    axes.plot(decision, short.T, color="C0", linewidth=0.5, alpha=0.25)
    axes.plot(decision, np.median(short, axis=0), color="C0", linewidth=2, label=f"median of {len(short)} seeds")
    axes.axhline(0.8 - good, color="0.4", linewidth=1, linestyle=":")
    axes.annotate(rf"$\eta = {good}$", (decision[0], 0.8 - good), (0, 3), textcoords="offset points", color="0.4")
    axes.set(xscale="log", yscale="log", xlabel="decisions", ylabel=r"distance from the best, $0.8 - \eta$")
    axes.set_title(r"OLGARB from $\theta = 0$", loc="left")
    axes.legend(loc="upper right")


def _points(axes: Axes, where: np.ndarray, samples: np.ndarray, **style: Any) -> None:
    """Means with their intervals of `samples`, (places, runs)."""
    usual = {"markersize": 4, "linewidth": 1, "linestyle": "none", **style}
    draw_intervals(axes, where, [mean_of(each) for each in samples], **usual)
