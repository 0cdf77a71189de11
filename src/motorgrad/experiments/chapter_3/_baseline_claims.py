"""The claims of section 3.2.1, and the statistics that decide them."""

import math

import numpy as np

from motorgrad.experiments._claims import Claim, Measured, above, exact, mean_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_3._estimates import WORLDS

GROUPS = 20  # groups of runs, each of which yields one variance
SOURCE = "section 3.2.1"
FAR, NEAR = 8.0, 0.5  # reaches of a trace, in mixing times
SMALL = 0.1  # a relative bias
CLOSE = 0.01  # distance from the average reward, for rewards between 0 and 1


def all_claims(values: Values) -> list[Claim]:
    return [*_variance_claims(values), *_bias_claims(values), *_best(values), *_learning(values), *_decay(values)]


def variances(found: np.ndarray, longest: int) -> np.ndarray:
    """Total variance of `(runs, parameters)` estimates, times the decisions of each, by group of runs: `(groups,)`."""
    return np.array([group.var(axis=0, ddof=1).sum() for group in np.array_split(found, GROUPS)]) * longest


def ratio_of(above: np.ndarray, below: np.ndarray) -> Measured:
    """Pairwise ratio of two sets of positive numbers: geometric mean with its interval."""
    logs = mean_of(np.log(above / below))
    return Measured(math.exp(logs.value), math.exp(logs.low), math.exp(logs.high), logs.count, "geometric mean")


def _variance_claims(values: Values) -> list[Claim]:
    made, longest = [], int(values["length"][-1])
    for row, decay in enumerate(values["decay"]):
        without, compared = (variances(values[f"estimate {name}"][row], longest) for name in ("none", "mean"))
        ratio, shape = ratio_of(without, compared), values["parabola decay"][row]
        limit = _height(shape, 0.0) / _height(shape, float(values["average reward"]))
        made.append(
            above(
                1,
                f"A running-mean baseline reduces the variance of the estimate (β = {decay:g}).",
                SOURCE,
                "above 1",
                ratio,
                "is the factor of reduction",
                f"Over groups of runs of {longest:,} decisions. In the limit of long runs {limit:.4g}, by "
                "linear algebra.",
            )
        )
    return made


def _height(shape: np.ndarray, baseline: float) -> float:
    best, least, curvature = shape
    return float(least + curvature * (baseline - best) ** 2)


def shared_rewards(decay: float, lengths: np.ndarray) -> np.ndarray:
    r"""Relative bias of the estimate with a running mean after each of these lengths $T$, $-\frac1T \sum_{t<T}
    \frac{1}{t} \sum_{m=1}^{t} \beta^m$; in long runs about $-\frac{\beta}{1-\beta}\,\frac{\ln((1-\beta)T) +
    \gamma}{T}$.

    The mean of the first $t$ rewards contains the rewards of the actions that are still in the trace. First order: as
    if an action affected its own reward only.
    """
    t = np.arange(1, int(max(lengths)))
    summed = np.concatenate([[0.0], np.cumsum(decay * (1 - decay**t) / (1 - decay) / t)])
    return -summed[np.asarray(lengths, int) - 1] / lengths


UNBIASED = 0.05
"""A bias counts as none if its whole interval lies within this fraction of the gradient."""


def _within(bias: Measured) -> bool:
    return bias.low > -UNBIASED and bias.high < UNBIASED


def _bias_claims(values: Values) -> list[Claim]:
    length, decay = values["length"], float(values["bias decay"])
    thousand, last = int(np.flatnonzero(length == 1_000)[0]), len(length) - 1
    constant = mean_of(values["added by constant"][thousand])
    early, late = (mean_of(values["added by mean"][at]) for at in (thousand, last))
    foretold = shared_rewards(decay, length)
    unit, about = "of the gradient", f"β = {decay:g}, {int(length[thousand]):,} decisions"
    return [
        Claim(
            f"A constant baseline does not change the mean of the estimate ({about}).",
            SOURCE,
            f"between {-UNBIASED} and {UNBIASED}",
            constant,
            _within(constant),
            unit,
            "The baseline is the average reward; pairs of estimates on the same trajectory, with and without it.",
        ),
        Claim(
            f"A running mean does not change the mean of the estimate ({about}).",
            SOURCE,
            f"between {-UNBIASED} and {UNBIASED}",
            early,
            _within(early),
            unit,
            "Compared with the constant on the same trajectory. The running mean contains the rewards of the "
            "actions that are still in the trace. To first order, this reduces the estimate by the fraction "
            f"β/(1 − β) · (ln((1 − β)T) + 0.577)/T, here {-foretold[thousand]:.3g}.",
        ),
        Claim(
            f"In long runs, a running mean does not change it (β = {decay:g}, {int(length[last]):,} decisions).",
            SOURCE,
            f"between {-UNBIASED} and {UNBIASED}",
            late,
            _within(late),
            unit,
            f"To first order {foretold[last]:.3g}; the bias vanishes like (ln T)/T.",
        ),
    ]


def _best(values: Values) -> list[Claim]:
    eta, made = float(values["average reward"]), []
    for row, decay in enumerate(values["decay"]):
        best, least, _ = values["parabola decay"][row]
        excess = _height(values["parabola decay"][row], eta) / least - 1
        made.append(
            Claim(
                f"Of all constant baselines, the average reward has the least variance (β = {decay:g}).",
                f"{SOURCE}, after Weaver & Tao 2001",
                f"{eta:.4g} ± {CLOSE:g}",
                exact(best),
                abs(best - eta) <= CLOSE,
                "is the best constant",
                f"By linear algebra. At the average reward the variance is {excess:.1%} above the least.",
            )
        )
    nearest, off = values["limit best"][-1], np.abs(values["limit best"] - eta)
    made.append(
        Claim(
            "As β tends to 1, the best constant baseline tends to the average reward.",
            "Weaver & Tao 2001",
            f"{eta:.4g} ± {CLOSE:g}",
            exact(nearest),
            off[-1] <= CLOSE and bool(np.all(np.diff(off) <= 0)),
            f"is the best constant at β = {values['limit'][-1]:g}",
            "By linear algebra; the distance must also shrink at every step of β.",
        )
    )
    return made


def _learning(values: Values) -> list[Claim]:
    made = []
    for name, words, falls in (
        ("olgarb", "With a baseline, the mean |δ| falls during learning, like an annealed step size", True),
        ("olpomdp", "Without one, it does not fall: it grows with the reward", False),
    ):
        surprise = values[f"surprise {name}"]
        tenth = max(1, surprise.shape[1] // 10)
        ratio = mean_of(surprise[:, -tenth:].mean(1) / surprise[:, 0])
        made.append(
            Claim(
                f"{words}.",
                SOURCE,
                "below 1" if falls else "1 or above",
                ratio,
                ratio.high < 1 if falls else ratio.low >= 1,
                "of the first record, in the last tenth of learning",
                "Rewards are 0 or 1: the more certain a reward, the smaller |δ|. It does not anneal to 0."
                if falls
                else "",
            )
        )
    return made


def _decay(values: Values) -> list[Claim]:
    longest, first, last = int(values["length"][-1]), values["decay"][0], values["decay"][-1]
    variance = ratio_of(*(variances(values["estimate mean"][row], longest) for row in (-1, 0)))
    bias = values["bias three states"]
    far, near, reset = (
        {name: _at(values, name, reach) for name in WORLDS if name.startswith("reset") is slow}
        for reach, slow in ((FAR, False), (NEAR, False), (FAR, True))
    )
    return [
        above(
            1,
            f"The variance rises with the decay (running mean, β = {last:g} against {first:g}).",
            SOURCE,
            "above 1",
            variance,
            "times the variance",
        ),
        Claim(
            "The bias falls with the decay (three states, over all reaches measured).",
            SOURCE,
            "below 1",
            exact(bias[-1] / bias[0]),
            bool(np.all(np.diff(bias) <= 0) and bias[-1] < bias[0]),
            "is the ratio of the bias at the longest reach to that at the shortest",
        ),
        Claim(
            f"The bias is small if 1/(1 − β) is {FAR:g} times the mixing time.",
            f"{SOURCE}, with the inequality reversed",
            f"below {SMALL:g}",
            exact(max(far.values())),
            max(far.values()) < SMALL,
            "relative bias, the worst of the three-state MDP and walks of 4 to 20 states",
        ),
        Claim(
            f"The mixing time should exceed 1/(1 − β), here by a factor of {1 / NEAR:g}.",
            f"{SOURCE}, as printed",
            f"below {SMALL:g}",
            exact(max(near.values())),
            max(near.values()) < SMALL,
            "relative bias, the worst of the same worlds",
            "The printed inequality is reversed.",
        ),
        Claim(
            f"The mixing time determines the reach that a trace needs: {FAR:g} times suffices in every world.",
            SOURCE,
            f"below {SMALL:g}",
            exact(max(reset.values())),
            max(reset.values()) < SMALL,
            "relative bias, the worst of chains in which a wrong move leads back to the start",
            "Such a chain of N states mixes in 2 steps, and yet an action affects a reward N − 1 decisions later.",
        ),
    ]


def _at(values: Values, name: str, reach: float) -> float:
    """A world's bias for a trace that reaches so many mixing times."""
    return float(values[f"bias {name}"][np.flatnonzero(np.isclose(values[f"reach {name}"], reach))[0]])
