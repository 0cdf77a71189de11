"""Figure 3.1: the learner, and how good its gradient estimates are on the three-state MDP."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Self

import jax
import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim, exact, mean_of, share_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_3._estimates import comparison_point, estimates, joint_quantile, relative_error
from motorgrad.experiments.chapter_3._estimates_figure import draw_estimates
from motorgrad.learning import Constant, MeanReward, NoBaseline
from motorgrad.policies import Softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import Run, settings_for
from motorgrad.worlds import oracle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SOURCE = "an independent computation on the MDP of Baxter & Bartlett 2001"
ETA, GRADIENT = 0.29419747, (-0.03272585, -0.03524847, 0.03272585, 0.03524847)
BIAS = {0.0: 0.0770765, 0.4: 0.0477171, 0.8: 0.0164283, 0.95: 0.0041583, 0.99: 0.00083444}  # by decay
SHORT, LONG = 0.0, 0.95  # decays: the traces compared; the errors below are of the long one
ERROR_RUNS = 500
ERRORS = {
    "none": {1_000: 0.752, 10_000: 0.241, 100_000: 0.084},
    "mean": {1_000: 0.217, 10_000: 0.066, 100_000: 0.021},
}
"""Mean relative errors of an independent simulation, over `ERROR_RUNS` runs, by baseline and decisions."""
GOOD = 0.799
WORDS = {"none": "no baseline", "mean": "running-mean baseline"}


@dataclasses.dataclass(frozen=True)
class Learner(Experiment):
    """The learner: act, reinforce, improve. How far its estimates at fixed parameters are from the exact gradient,
    against the decay of the trace and the length of the run, with and without a baseline; and how it learns when it
    moves at every decision (OLGARB).

    **Arguments:**

    - `runs`: over which errors of estimates are averaged.
    - `longest` (decisions): length of each run at fixed parameters, at least 1,000.
    - `seeds`: learners that move at every decision.
    - `steps` (decisions): for which each learner learns.
    - `decays`: those of the traces, per decision, 0 and 0.95 among them.
    """

    name: ClassVar[str] = "fig-3.1"
    title: ClassVar[str] = "the learner and its estimates"
    source: ClassVar[str] = "figure 3.1"

    runs: int = 1000
    longest: int = 100_000
    seeds: int = 50
    steps: int = 600_000
    decays: tuple[float, ...] = tuple(BIAS)

    def __post_init__(self) -> None:
        check(2 <= self.runs <= 100_000, "runs", self.runs, "in 2 … 100,000")
        check(1_000 <= self.longest <= 10**8, "longest", self.longest, "in 1,000 … 100,000,000 decisions")
        check(1 <= self.seeds <= 10_000, "seeds", self.seeds, "in 1 … 10,000")
        known = {SHORT, LONG} <= set(self.decays) <= set(BIAS)
        check(known, "decays", self.decays, f"{SHORT:g}, {LONG:g} and others of {', '.join(map(str, BIAS))}")
        check(200 <= self.steps <= 10**9, "steps", self.steps, "in 200 … 1,000,000,000")

    @classmethod
    def quick(cls) -> Self:
        return cls(runs=20, longest=1_000, seeds=3, steps=2_000, decays=(SHORT, LONG))

    @property
    def lengths(self) -> list[int]:
        """Decisions after which estimates are looked at: two a decade, from 100 to the longest."""
        steps = range(int(2 * np.log10(self.longest / 100) + 1e-9) + 1)
        return [round(100 * 10 ** (step / 2)) for step in steps]

    def run(self, work: Workspace) -> Values:
        mdp, point = ThreeState().dynamics, comparison_point()
        truth, eta = oracle.flat(oracle.gradient(mdp, point)), oracle.average_reward(mdp, point)
        biased = np.stack([oracle.flat(oracle.biased_gradient(mdp, point, decay)) for decay in self.decays])
        found: Values = {
            "decay": np.array(self.decays),
            "length": np.array(self.lengths),
            "average reward": np.array(eta),
            "gradient": truth,
            "exact bias": np.linalg.norm(biased - truth, axis=1) / np.linalg.norm(truth),
        }
        for name, baseline in (("none", NoBaseline()), ("mean", MeanReward())):
            kept = [work.part(f"{name}-{d}", lambda d=d, b=baseline: self._errors(d, b, truth)) for d in self.decays]
            found[f"error {name}"] = np.stack([each["error"] for each in kept])
        kept = [
            work.part(f"bias-{d}", lambda d=d, b=b: {"bias": self._bias(d, eta, truth, b)})
            for d, b in zip(self.decays, biased, strict=True)
        ]
        found["bias"] = np.stack([each["bias"] for each in kept])
        task = ThreeState()
        run = work.train(task, settings_for(task), self.steps, self.seeds)
        return found | work.part("learning", lambda: earned(run))

    def _errors(self, decay: float, baseline: NoBaseline | MeanReward, truth: np.ndarray) -> Values:
        return {"error": relative_error(estimates(decay, baseline, self.lengths, self.runs), truth)}

    def _bias(self, decay: float, eta: float, truth: np.ndarray, biased: np.ndarray) -> np.ndarray:
        """Each run's distance from the exact gradient in the direction of the exact bias, which averages to the bias.
        The baseline is constant, for a running mean has a bias of its own in runs of finite length."""
        way = (biased - truth) / np.linalg.norm(biased - truth)
        last = estimates(decay, Constant(eta), self.lengths[-1:], self.runs)[0]
        return (last - truth) @ way / np.linalg.norm(truth)

    def figure(self, values: Values) -> "Figure":
        return draw_estimates(values, ERRORS, GOOD)

    def claims(self, values: Values) -> Sequence[Claim]:
        return [
            *_exact_claims(values),
            *_bias_claims(values),
            *_error_claims(values),
            *_trade_off(values),
            _learnt(values),
        ]


def earned(run: Run) -> Values:
    """What the policies of a run on the three-state MDP earn on average, exactly: `(seeds, records)`, at some
    twenty-five of its records, denser at first; and the decisions made by then."""
    mdp, decision = ThreeState().dynamics, run.curve("reward")[0]
    picked = np.unique(np.round(np.geomspace(1, len(decision), 25)).astype(int)) - 1
    stored = np.stack(run.metrics["parameters"].to_pylist()).reshape(len(decision), len(run.seeds), 2, -1)[picked]
    weights = np.concatenate([np.asarray(jax.tree.leaves(run.initial)[0])[None], stored])
    reward = [[oracle.average_reward(mdp, Softmax(one)) for one in seeds] for seeds in weights]
    return {"decision": np.concatenate([[0], decision[picked]]), "earned": np.array(reward).T}


def _exact_claims(values: Values) -> list[Claim]:
    eta = float(values["average reward"])
    off = float(np.abs(values["gradient"] - GRADIENT).max())
    rounding = 5.01e-9  # the figures have eight digits
    return [
        Claim(
            "At the point of comparison the three-state MDP pays 0.29419747 a decision.",
            SOURCE,
            str(ETA),
            exact(eta),
            abs(eta - ETA) < rounding,
        ),
        Claim(
            "The exact gradient there is (∓0.03272585, ∓0.03524847).",
            SOURCE,
            "deviation 0",
            exact(off),
            off < rounding,
            note="The largest deviation of a component from that figure; half of its last digit is allowed.",
        ),
    ]


def _bias_claims(values: Values) -> list[Claim]:
    made = []
    for row, decay in enumerate(values["decay"]):
        expected = BIAS[float(decay)]
        measured = mean_of(values["bias"][row])
        error = values["bias"][row].std(ddof=1) / np.sqrt(measured.count)
        holds = abs(measured.value - expected) <= joint_quantile(len(values["decay"])) * error
        made.append(
            Claim(
                f"With a trace of decay {decay:g} the estimate's mean has a relative bias of {expected:g}.",
                SOURCE,
                f"{expected:g}",
                measured,
                holds and bool(np.isclose(values["exact bias"][row], expected, rtol=1.5e-5)),
                note=f"By linear algebra {values['exact bias'][row]:.6g}. It holds if this is the figure expected to "
                "1.5e-5 of it, and the measured mean within an interval that covers all these decays jointly at 95 %.",
            )
        )
    return made


def _error_claims(values: Values) -> list[Claim]:
    """Their mean is of 500 runs, and therefore itself uncertain, by the standard deviation that we measure."""
    made, row = [], list(values["decay"]).index(LONG)
    quantile = joint_quantile(sum(len(of) for of in ERRORS.values()))
    for name, figures in ERRORS.items():
        for length, expected in figures.items():
            if length not in values["length"]:
                continue
            errors = values[f"error {name}"][row, int(np.flatnonzero(values["length"] == length)[0])]
            measured = mean_of(errors)
            allowed = quantile * errors.std(ddof=1) * np.sqrt(1 / measured.count + 1 / ERROR_RUNS) + 0.0005
            made.append(
                Claim(
                    f"With {WORDS[name]} the mean relative error after {length:,} decisions is {expected:g} "
                    f"(β = {LONG:g}).",
                    SOURCE,
                    f"{expected:g}, mean of {ERROR_RUNS}",
                    measured,
                    abs(measured.value - expected) <= allowed,
                    note=f"Two means, of {measured.count} and {ERROR_RUNS} runs of the same distribution, differ by at "
                    f"most {allowed:.3g} with a confidence of 95 % for all six figures jointly.",
                )
            )
    return made


def _trade_off(values: Values) -> list[Claim]:
    decays, last = list(values["decay"]), len(values["length"]) - 1
    thousand = int(np.flatnonzero(values["length"] == 1_000)[0])
    made = []
    for name, at, statement, sign in (
        ("none", thousand, "In a short run a trace that forgets at once errs less: variance outweighs bias", 1),
        ("mean", last, "In a long run the longer trace errs less: bias outweighs variance", -1),
    ):
        errors = values[f"error {name}"][:, at]
        more = mean_of(errors[decays.index(LONG)] - errors[decays.index(SHORT)])
        decided = min(sign * more.low, sign * more.high) > 0
        made.append(
            Claim(
                f"{statement} ({int(values['length'][at]):,} decisions, {WORDS[name]}).",
                "section 3.2.1",
                "above 0" if sign > 0 else "below 0",
                more,
                decided,
                f"relative error at β = {LONG:g} less that at {SHORT:g}",
            )
        )
    return made


def _learnt(values: Values) -> Claim:
    share, settings = share_of(values["earned"][:, -1] >= GOOD), settings_for(ThreeState())
    return Claim(
        f"From θ = 0, OLGARB (β = {settings.decay:g}, α = {settings.rate:g}) comes to earn {GOOD} of the possible 0.8.",
        SOURCE,
        "every seed: 1",
        share,
        share.value == 1,
        f"of seeds, after {int(values['decision'][-1]):,} decisions",
    )
