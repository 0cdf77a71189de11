"""Section 3.2.1: the effect of a baseline, and the reach that a trace needs."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.learning import Baseline, Constant, MeanReward
from motorgrad.schema import Range, count, static
from motorgrad.statistics import Measured, mean_of
from motorgrad.tasks import ThreeState
from motorgrad.training import Run, agent_for
from motorgrad.worlds import oracle
from motorgrad_thesis._claims import Claim
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, draw_intervals, new_figure
from motorgrad_thesis.chapter_3._baseline_claims import all_claims, shared_rewards, variances
from motorgrad_thesis.chapter_3._estimates import (
    WORLDS,
    along,
    biases,
    comparison_point,
    estimates,
    mixing_time,
    variance,
)

REACHES = 2.0 ** np.arange(-3, 7)  # reaches of traces, in mixing times
LIMIT_DECAYS = 1 - np.geomspace(1, 1e-3, 22)  # towards 1
BIAS_DECAY = 0.95
WITHOUT = "C1"
WITH = "C0"


@experiment("sec-3.2.1", "what a baseline does", "section 3.2.1")
class Baselines(Experiment):
    """The effect of a baseline on the variance of a gradient estimate, on its mean, and on learning; the best constant
    baseline; and bias and variance against the decay of the trace, the bias relative to the mixing time of the world.
    """

    reading: ClassVar[str] = (
        '"A constant baseline" and "any function of state" are read as such: a running mean is neither, and '
        "the bias that it adds to a run of finite length refutes no statement. The rule for the decay is "
        "judged as printed, and also the other way round."
    )

    runs: int = count(2000, 40, 100_000, help="number of runs at fixed parameters over which estimates are averaged")
    longest: int = count(10_000, 1_000, 10**8, unit="decisions", help="length of each run at fixed parameters")
    decays: tuple[float, ...] = static(
        (0.0, 0.4, 0.8, 0.95, 0.99),
        allowed=Range(0, 1),
        help="decays of the traces per decision at fixed parameters, 0.95 among them",
    )
    constants: tuple[float, ...] = static(
        (0.0, 0.2, 0.4, 0.6, 0.8), help="constant baselines to compare, in units of reward"
    )
    swept: tuple[float, ...] = static(
        (0.0, 0.8, 0.95),
        allowed=Range(0, 1),
        help="decays of the traces per decision for which the constants are compared",
    )
    seeds: int = count(50, 1, 10_000, help="number of learners with each estimator")
    steps: int = count(600_000, 200, 10**9, unit="decisions", help="length of the practice of each learner")

    def validate(self) -> None:
        super().validate()
        for name, least in {"decays": 2, "constants": 0, "swept": 0}.items():
            self.check_rising(name, least)
        check(BIAS_DECAY in self.decays, "decays", self.decays, f"some with {BIAS_DECAY} among them")

    quick = smoke(runs=40, longest=1_000, decays=(0.0, BIAS_DECAY), constants=(), swept=(), seeds=3, steps=2_000)

    @property
    def lengths(self) -> list[int]:
        """Decisions after which the bias is measured: two per decade, from 30 to the longest."""
        return [
            length for power in range(1, 9) for length in (3 * 10**power, 10 ** (power + 1)) if length <= self.longest
        ]

    def run(self, work: Workspace) -> Values:
        found: Values = {
            "decay": np.array(self.decays),
            "swept": np.array(self.swept),
            "constant": np.array(self.constants),
            "length": np.array(self.lengths),
        }
        return found | self._measured(work) | exact_variances(self.decays, self.swept) | traces() | self._learning(work)

    def _measured(self, work: Workspace) -> Values:
        """Estimates at the end of the longest run, `(decays, runs, parameters)`, without a baseline, with a running
        mean, and for every constant; and, at the decay of the bias, how much of the gradient a baseline adds,
        `(lengths, runs)`."""
        mdp = ThreeState().dynamics
        point = comparison_point()
        none = [self._estimates(work, "none", decay, None) for decay in self.decays]
        mean = [self._estimates(work, "mean", decay, MeanReward()) for decay in self.decays]
        every = [[self._estimates(work, f"{c}", d, Constant(c))[-1] for c in self.constants] for d in self.swept]
        average = self._estimates(work, "average", BIAS_DECAY, Constant(oracle.average_reward(mdp, point)))
        truth = oracle.flat(oracle.biased_gradient(mdp, point, BIAS_DECAY))
        at = self.decays.index(BIAS_DECAY)
        return {
            "estimate none": np.stack([each[-1] for each in none]),
            "estimate mean": np.stack([each[-1] for each in mean]),
            "estimate constant": np.array(every),
            "bias decay": np.array(BIAS_DECAY),
            "added by mean": along(mean[at] - average, truth),
            "added by constant": along(average - none[at], truth),
        }

    def _estimates(self, work: Workspace, name: str, decay: float, baseline: Baseline | None) -> np.ndarray:
        made = work.part(f"{name}-{decay}", lambda: {"estimate": estimates(decay, baseline, self.lengths, self.runs)})
        return made["estimate"]

    def _learning(self, work: Workspace) -> Values:
        task = ThreeState()
        found = {}
        for name in ("olgarb", "olpomdp"):
            run = work.train(task, agent_for(task, estimator=name), self.steps, self.seeds)
            found["decision"], found[f"surprise {name}"] = surprise(run)
        return found

    def figure(self, values: Values) -> Figure:
        """Six panels: the best constant, its limit, variance, bias, learning, mixing."""
        figure = new_figure(13, 7.4)
        panels = (_constants, _best, _variances, _bias, _learning, _mixing)
        for axes, draw in zip(figure.subplots(2, 3).flat, panels, strict=True):
            draw(axes, values)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        yield from all_claims(values)


def exact_variances(decays: Sequence[float], swept: Sequence[float]) -> Values:
    """Variance of long runs as a parabola in the constant baseline, at these decays and as they tend to 1; and the
    excess variance of the average reward as a baseline."""
    mdp = ThreeState().dynamics
    point = comparison_point()
    eta = oracle.average_reward(mdp, point)
    limit = [variance(mdp, point, decay) for decay in LIMIT_DECAYS]
    return {
        "average reward": np.array(eta),
        "parabola decay": np.array([dataclasses.astuple(variance(mdp, point, decay)) for decay in decays]),
        "parabola swept": np.array([dataclasses.astuple(variance(mdp, point, decay)) for decay in swept]),
        "limit": LIMIT_DECAYS,
        "limit best": np.array([shape.best for shape in limit]),
        "limit excess": np.array([shape(eta) / shape.least - 1 for shape in limit]),
    }


def traces() -> Values:
    """For every world: its mixing time, reaches of a trace in mixing times, and the bias at each."""
    found: Values = {}
    for name, (make, policy_for) in WORLDS.items():
        world = make()
        policy = policy_for(world)
        mixes = mixing_time(world, policy)
        reaches = REACHES[REACHES * mixes >= 1]
        found[f"mixing {name}"] = np.array(mixes)
        found[f"reach {name}"] = reaches
        found[f"bias {name}"] = biases(world, policy, reaches * mixes)
    return found


def surprise(run: Run) -> tuple[np.ndarray, np.ndarray]:
    r"""Mean $|\delta|$ in every record of a run whose rewards are 0 or 1: decisions, and `(seeds, records)`.

    A share $\bar r$ of the rewards is $1 - b$ above the baseline, the others are $b$ below it. The baseline of a record
    is the mean of its values at both ends.
    """
    decision, reward = run.curve("reward")
    ends = run.curve("baseline")[1]
    starts = np.concatenate([np.zeros_like(ends[:, :1]), ends[:, :-1]], axis=1)
    baseline = np.where(np.arange(len(decision)) == 0, ends, (starts + ends) / 2)
    return decision, reward * np.abs(1 - baseline) + (1 - reward) * np.abs(baseline)


def _constants(axes: Axes, values: Values) -> None:
    if not len(values["swept"]):
        axes.set_axis_off()
        return
    level = np.linspace(-0.05, 0.95, 201)
    longest = int(values["length"][-1])
    for row, decay in enumerate(values["swept"]):
        best, least, curvature = values["parabola swept"][row]
        colour = f"C{row}"
        axes.plot(level, (least + curvature * (level - best) ** 2) / least, color=colour, linewidth=1)
        axes.plot(best, 1, "v", color=colour, markersize=7, zorder=3)
        measured = [mean_of(variances(each, longest) / least) for each in values["estimate constant"][row]]
        _points(axes, values["constant"], measured, color=colour, label=rf"$\beta$ = {decay:g}")
    axes.axvline(float(values["average reward"]), color="0.4", linestyle=":", linewidth=1)
    axes.text(
        float(values["average reward"]) + 0.01,
        0.97,
        "average reward",
        transform=axes.get_xaxis_transform(),
        color="0.4",
        va="top",
        fontsize=8,
    )
    axes.set(yscale="log", xlabel="constant baseline $b$", ylabel="variance / least variance")
    axes.set_title("the best constant (triangles)", loc="left")
    axes.legend(fontsize=8, title="lines: exact", title_fontsize=8)


def _best(axes: Axes, values: Values) -> None:
    reach = 1 / (1 - values["limit"])
    axes.plot(reach, values["limit best"], color="C0", label="best constant")
    axes.axhline(float(values["average reward"]), color="0.4", linestyle=":", linewidth=1, label="average reward")
    axes.set(xscale="log", xlabel=r"reach of the trace, $1/(1-\beta)$ decisions", ylabel="baseline", ylim=(0.2, None))
    axes.set_title("… and its limit", loc="left")
    more = axes.twinx()
    more.plot(reach, 100 * values["limit excess"], color="C3", linestyle="--", label="excess variance of the average")
    more.spines["right"].set_visible(True)
    more.set(ylabel="% above the least")
    more.yaxis.label.set_color("C3")
    lines = [*axes.get_lines(), *more.get_lines()]
    axes.legend(lines, [str(line.get_label()) for line in lines], fontsize=8)


def _variances(axes: Axes, values: Values) -> None:
    reach = 1 / (1 - values["decay"])
    longest = int(values["length"][-1])
    best, least, curvature = values["parabola decay"].T
    for name, level, colour, words in (
        ("none", 0.0, WITHOUT, "no baseline"),
        ("mean", float(values["average reward"]), WITH, "running mean"),
    ):
        axes.plot(reach, least + curvature * (level - best) ** 2, color=colour, linewidth=1)
        _points(
            axes,
            reach,
            [mean_of(variances(each, longest)) for each in values[f"estimate {name}"]],
            color=colour,
            label=words,
        )
    axes.set(
        xscale="log", yscale="log", xlabel=r"reach of the trace, $1/(1-\beta)$ decisions", ylabel="variance × decisions"
    )
    axes.set_title(f"variance over {values['estimate none'].shape[1]:,} runs", loc="left")
    axes.legend(fontsize=8, title="lines: exact, long runs", title_fontsize=8)


def _bias(axes: Axes, values: Values) -> None:
    length = values["length"]
    decay = float(values["bias decay"])
    fine = np.geomspace(length[0], length[-1], 100).round()
    axes.axhline(0, color="0.8", linewidth=0.8)
    axes.plot(
        fine,
        100 * shared_rewards(decay, fine),
        color="0.5",
        linestyle="--",
        linewidth=1,
        label="running mean, first order",
    )
    for name, colour, words in (("mean", WITH, "running mean"), ("constant", "C2", "constant, average reward")):
        _points(axes, length, [mean_of(100 * each) for each in values[f"added by {name}"]], color=colour, label=words)
    axes.set(xscale="log", xlabel="decisions $T$", ylabel="% of the gradient", ylim=(-110, 30))
    axes.set_title(rf"bias that a baseline adds, $\beta$ = {decay:g}", loc="left")
    axes.legend(fontsize=8, loc="lower right")


def _learning(axes: Axes, values: Values) -> None:
    decision = values["decision"]
    for name, colour, words in (
        ("olpomdp", WITHOUT, "no baseline: the reward itself"),
        ("olgarb", WITH, "running mean"),
    ):
        draw_band(axes, decision, values[f"surprise {name}"], colour, words)
    axes.set(xscale="log", xlabel="decisions", ylabel=r"mean $|\delta|$", ylim=(0, 1))
    axes.set_title(f"surprise while learning, median of {len(values['surprise olgarb'])} seeds", loc="left")
    axes.legend(fontsize=8)


def _mixing(axes: Axes, values: Values) -> None:
    for number, name in enumerate(WORLDS):
        reset = name.startswith("reset")
        mixes = int(values[f"mixing {name}"])
        style = {"color": f"C{number}", "linestyle": "--" if reset else "-", "linewidth": 1.3}
        axes.plot(values[f"reach {name}"], values[f"bias {name}"], label=f"{name} ({mixes})", **style)
    axes.axvline(1, color="0.4", linestyle=":", linewidth=1)
    axes.set(
        xscale="log", yscale="log", xlabel=r"$1/(1-\beta)$ in mixing times", ylabel="relative bias", ylim=(1e-3, 1.3)
    )
    axes.set_title("reach and mixing time", loc="left")
    axes.legend(fontsize=8, title="mixing time in brackets", title_fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))


def _points(axes: Axes, where: np.ndarray, found: list[Measured], **style: Any) -> None:
    draw_intervals(axes, where, found, fmt="o", markersize=4, linewidth=1, **style)
