"""The claims of section 3.2.1, and the statistics that decide them."""

from collections.abc import Iterator

import numpy as np

from motorgrad.statistics import exact, mean_of, ratio_of
from motorgrad_thesis._claims import Claim, Kind, above, at_least, at_most, below, within
from motorgrad_thesis._experiment import Values
from motorgrad_thesis.chapter_3._estimates import WORLDS

GROUPS = 20  # groups of runs, each of which yields one variance
SOURCE = "section 3.2.1"
# reaches of a trace, in mixing times
FAR = 8.0
NEAR = 0.5
SMALL = 0.1  # a relative bias
ANNEALS = "A baseline reduces the step size as learning proceeds."
MIXING = "The mixing time determines the decay of the trace, by 1/(1 − β)."
CLOSE = 0.01  # distance from the average reward, for rewards between 0 and 1


def all_claims(values: Values) -> Iterator[Claim]:
    for claims in (_variance_claims, _bias_claims, _best, _learning, _decay):
        yield from claims(values)


def variances(found: np.ndarray, longest: int) -> np.ndarray:
    """Total variance of `(runs, parameters)` estimates, times the decisions of each, by group of runs: `(groups,)`."""
    return np.array([group.var(axis=0, ddof=1).sum() for group in np.array_split(found, GROUPS)]) * longest


def _variance_claims(values: Values) -> Iterator[Claim]:
    longest = int(values["length"][-1])
    for row, decay in enumerate(values["decay"]):
        without, compared = (variances(values[f"estimate {name}"][row], longest) for name in ("none", "mean"))
        shape = values["parabola decay"][row]
        limit = _height(shape, 0.0) / _height(shape, float(values["average reward"]))
        yield above(
            1,
            f"A running-mean baseline reduces the variance of the estimate (β = {decay:g}).",
            ratio_of(without, compared),
            "factor of reduction",
            note=f"Over groups of runs of {longest:,} decisions. In the limit of long runs {limit:.4g}, by linear "
            "algebra.",
            of="An appropriate baseline reduces the variance of the estimate.",
        )


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


def _bias_claims(values: Values) -> Iterator[Claim]:
    length = values["length"]
    decay = float(values["bias decay"])
    thousand = int(np.flatnonzero(length == 1_000)[0])
    last = len(length) - 1
    foretold = shared_rewards(decay, length)
    about = f"β = {decay:g}, {int(length[thousand]):,} decisions"
    rows: list[tuple[Kind, str, np.ndarray, str]] = [
        (
            "thesis",
            f"A constant baseline does not change the mean of the estimate ({about}).",
            values["added by constant"][thousand],
            "The baseline is the average reward; pairs of estimates on the same trajectory, with and without it.",
        ),
        (
            "extension",
            f"A running mean does not change the mean of the estimate ({about}).",
            values["added by mean"][thousand],
            "Compared with the constant on the same trajectory. The running mean contains the rewards of the "
            "actions that are still in the trace. To first order, this reduces the estimate by the fraction "
            f"β/(1 − β) · (ln((1 − β)T) + 0.577)/T, here {-foretold[thousand]:.3g}.",
        ),
        (
            "extension",
            f"In long runs, a running mean does not change it (β = {decay:g}, {int(length[last]):,} decisions).",
            values["added by mean"][last],
            f"To first order {foretold[last]:.3g}; the bias vanishes like (ln T)/T.",
        ),
    ]
    for kind, statement, added, note in rows:
        of = "A baseline that is constant adds no bias." if kind == "thesis" else ""
        yield within(
            -UNBIASED, UNBIASED, statement, mean_of(added), unit="of the gradient", note=note, kind=kind, of=of
        )


def _best(values: Values) -> Iterator[Claim]:
    eta = float(values["average reward"])
    for row, decay in enumerate(values["decay"]):
        best, least, _ = values["parabola decay"][row]
        excess = _height(values["parabola decay"][row], eta) / least - 1
        yield within(
            eta - CLOSE,
            eta + CLOSE,
            f"Of all constant baselines, the average reward has the least variance (β = {decay:g}).",
            exact(best),
            "best constant",
            note=f"By linear algebra. At the average reward the variance is {excess:.1%} above the least.",
            source=f"{SOURCE}, after Weaver & Tao 2001",
            of="The average reward is the constant baseline of the least variance.",
        )
    off = np.abs(values["limit best"] - eta)
    yield at_most(
        CLOSE,
        "As β tends to 1, the best constant baseline tends to the average reward.",
        exact(off[-1]),
        f"distance of the best constant at β = {values['limit'][-1]:g}",
        note="By linear algebra.",
        kind="reference model",
        source="Weaver & Tao 2001",
    )
    yield at_most(
        0,
        "On the way, it comes closer at every step of β.",
        exact(np.diff(off).max()),
        "greatest change of the distance",
        kind="reference model",
        source="Weaver & Tao 2001",
    )


def _learning(values: Values) -> Iterator[Claim]:
    last = {}
    for name in ("olgarb", "olpomdp"):
        surprise = values[f"surprise {name}"]
        tenth = max(1, surprise.shape[1] // 10)
        last[name] = mean_of(surprise[:, -tenth:].mean(1) / surprise[:, 0])
    quantity = "last tenth of learning relative to the first record"
    yield below(
        1,
        "With a baseline, the mean |δ| falls during learning, like an annealed step size.",
        last["olgarb"],
        quantity,
        note="Rewards are 0 or 1: the more certain a reward, the smaller |δ|. It does not anneal to 0.",
        of=ANNEALS,
    )
    yield at_least(1, "Without one, it does not fall: it grows with the reward.", last["olpomdp"], quantity, of=ANNEALS)


def _decay(values: Values) -> Iterator[Claim]:
    longest = int(values["length"][-1])
    first = values["decay"][0]
    last = values["decay"][-1]
    bias = values["bias three states"]
    far, near, reset = (
        exact(max(_at(values, name, reach) for name in WORLDS if name.startswith("reset") is slow))
        for reach, slow in ((FAR, False), (NEAR, False), (FAR, True))
    )
    yield above(
        1,
        f"The variance rises with the decay (running mean, β = {last:g} against {first:g}).",
        ratio_of(variances(values["estimate mean"][-1], longest), variances(values["estimate mean"][0], longest)),
        unit="times the variance",
        of="The variance rises with the decay.",
    )
    yield at_most(
        1,
        "The bias falls with the decay (three states, over all reaches measured).",
        exact(np.max(bias[1:] / bias[:-1])),
        "greatest ratio of a bias to that at the next shorter reach",
        of="The bias falls with the decay.",
        note=f"That at the longest reach is {bias[-1] / bias[0]:.3g} of that at the shortest.",
    )
    yield below(
        SMALL,
        f"The bias is small if 1/(1 − β) is {FAR:g} times the mixing time.",
        far,
        "relative bias, the worst of the three-state MDP and walks of 4 to 20 states,",
        kind="extension",
        source=f"{SOURCE}, with the inequality reversed",
    )
    yield below(
        SMALL,
        f"The mixing time should exceed 1/(1 − β), here by a factor of {1 / NEAR:g}.",
        near,
        "relative bias, the worst of the same worlds,",
        note="The printed inequality is reversed.",
        source=f"{SOURCE}, as printed",
        of=MIXING,
    )
    yield below(
        SMALL,
        f"The mixing time determines the reach that a trace needs: {FAR:g} times suffices in every world.",
        reset,
        "relative bias, the worst of chains in which a wrong move leads back to the start,",
        note="Such a chain of N states mixes in 2 steps, and yet an action affects a reward N − 1 decisions later.",
        of=MIXING,
    )


def _at(values: Values, name: str, reach: float) -> float:
    """A world's bias for a trace that reaches so many mixing times."""
    return float(values[f"bias {name}"][np.flatnonzero(np.isclose(values[f"reach {name}"], reach))[0]])
