"""What is claimed of the gaits that hexapods learn."""

from collections.abc import Sequence

import numpy as np

from motorgrad.experiments._claim import Claim, mean_of, median_of, share_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.hexapod._sources import INDEPENDENT, OURS
from motorgrad.experiments.chapter_5.hexapod._synergy_study import GAITS

THESIS = "section 5.3.4"
FAST, SOON, RARE = 1.3, 100.0, 0.25
"""Of the independent model: the speed (m/s) of its slowest seed after 600 s, and the time (s) by which its seeds were
past the fixed controller. And the share of seeds below which something counts as rare."""
ACTIONS = {"sample": "actions that are drawn", "mode": "the most probable actions"}


def counted(gaits: np.ndarray) -> str:
    """How many seeds came to each of the four classes, in words."""
    return ", ".join(f"{kind} {np.count_nonzero(gaits == kind)}" for kind in GAITS)


def viable(gaits: np.ndarray) -> np.ndarray:
    """Which seeds came to one of the two gaits that the thesis reports."""
    return np.isin(gaits, ("tripod", "pronk"))


def lag_claims(values: Values, lag: int) -> Sequence[Claim]:
    """What is said of any lag; the thesis has none."""
    late = f"observations late by {lag}" if lag else "no lag"
    source, gaits = (OURS if lag else THESIS), values[f"lag {lag} sample gait"]
    both = {mode: f"{ACTIONS[mode]}: {counted(values[f'lag {lag} {mode} gait'])}" for mode in ACTIONS}
    counts = f"Seeds with {both['sample']}; with {both['mode']}."
    either = viable(gaits)
    converged = share_of(either)
    pronking = share_of(gaits[either] == "pronk") if either.any() else share_of(either)
    passed, final = median_of(values[f"lag {lag} passed"]), median_of(values[f"lag {lag} practice"][:, -1])
    still = share_of(values[f"lag {lag} mode gait"] == "stalled")
    level = float(values["controller net"][0])
    return [
        Claim(
            f"Learning consistently converges to one of two gaits, tripod or pronk ({late}).",
            source,
            "frozen, from a fresh start, with actions that are drawn: in most seeds",
            converged,
            converged.low > 0.5,
            note=counts,
        ),
        Claim(
            f"Pronking is learnt more often than not ({late}).",
            source,
            "of the seeds that came to either gait: in most",
            pronking,
            pronking.low > 0.5,
            note=counts if either.any() else f"No seed came to either gait. {counts}",
        ),
        Claim(
            f"Learning passes the fixed controller's speed after 50 to 100 s of practice ({late}).",
            INDEPENDENT,
            f"median no later than {SOON:g} s",
            passed,
            passed.high <= SOON and passed.high < values["time"][-1],
            "s",
            "Mean speed of 12 s. Sooner counts as holding; a seed that never passes counts as the whole practice, and "
            "if the interval reaches that it does not hold.",
        ),
        Claim(
            f"After {values['time'][-1]:.0f} s of practice hexapods walk at 1.3 to 3.1 m/s ({late}).",
            INDEPENDENT,
            f"after 600 s there; median of the last 12 s at least {FAST:g} m/s",
            final,
            final.low >= FAST,
            "m/s",
            f"{np.count_nonzero(values[f'lag {lag} practice'][:, -1] < 0.3)} seeds end below 0.3 m/s. Falls of all "
            f"seeds during practice: {values[f'lag {lag} falls'].sum():.0f}.",
        ),
        *(
            Claim(
                f"What was learnt gets ahead further than the fixed controller, with {words} ({late}).",
                OURS,
                f"net displacement in 20 s above {level:.2f} m/s: in most seeds",
                share_of(values[f"lag {lag} {mode} net"] > level),
                share_of(values[f"lag {lag} {mode} net"] > level).low > 0.5,
                note=f"Medians: {median_of(values[f'lag {lag} {mode} net'])} m/s; heading speed "
                f"{median_of(values[f'lag {lag} {mode} speed'])} m/s.",
            )
            for mode, words in ACTIONS.items()
        ),
        Claim(
            f"With the most probable actions hardly any seed stands still ({late}).",
            OURS,
            f"the share of seeds of the class stalled: its interval below {RARE:g}",
            still,
            still.high < RARE,
            note=f"Parts of stalled seconds: mean {values[f'lag {lag} mode stalls'].mean():.2f}, with actions that are "
            f"drawn {values[f'lag {lag} sample stalls'].mean():.2f}.",
        ),
    ]


def common_claims(values: Values, lags: Sequence[int]) -> list[Claim]:
    """What compares lags, or is said of the first, which is the thesis's."""
    gaits = {lag: values[f"lag {lag} sample gait"] for lag in lags}
    first, *others = lags
    between = share_of(gaits[first] == "intermediate")
    made = [
        Claim(
            f"The {words} gait is found.",
            THESIS,
            f"in at least one seed, with lag {first}",
            share_of(gaits[first] == kind),
            bool((gaits[first] == kind).any()),
        )
        for kind, words in (("pronk", "pronking"), ("tripod", "tripod"))
    ]
    made.append(
        Claim(
            "Without lag, seeds end between tripod and pronk.",
            INDEPENDENT,
            f"all of its seeds: in most, with lag {first}",
            between,
            between.low > 0.5,
        )
    )
    for lag in others:
        more = mean_of(viable(gaits[lag]) * 1.0 - viable(gaits[first]))
        made.append(
            Claim(
                f"With observations late by {lag}, more seeds come to tripod or pronk than with {first}.",
                INDEPENDENT,
                "4 of 8 with a lag of 1, 5 of 6 with 2, none without: difference of the shares above 0",
                more,
                more.low > 0,
            )
        )
    return made
