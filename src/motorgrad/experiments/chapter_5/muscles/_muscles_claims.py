"""What is claimed of learning to walk on 24 muscles."""

from collections.abc import Sequence

import numpy as np

from motorgrad.experiments._claim import Claim, mean_of, median_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.muscles._muscle_study import FULL

SPEED, NET = 1.8, 1.6
"""What is aimed at with the most probable actions: median speed along the heading and net displacement, m/s."""
THESIS, OURS = "section 5.3.4", "our own expectation"
CHANGES = {
    "mirror tie": "A learner whose left and right share their parameters gets further.",
    "Euclidean": "The plain gradient, with steps of the same divergence, gets less far than the natural one.",
    "no critic": "Without a critic learning gets less far.",
    "no lag": "Without a lag of what is observed learning gets less far.",
    "seven inputs": "On six lateral angles and a bias learning gets less far than on all senses.",
}
HELPS = ("mirror tie",)
"""Of these changes, those that should help; the others take something away."""


def muscle_claims(values: Values) -> Sequence[Claim]:
    """Of the learner itself."""
    mode, sample = (_quantities(values, kind) for kind in ("mode", "sample"))
    speed, net = median_of(mode["speed"]), median_of(mode["net"])
    counts = zip(*np.unique(mode["gait"], return_counts=True), strict=True)
    gaits = f"Gaits with the most probable actions: {', '.join(f'{kind} {count}' for kind, count in counts)}."
    walks = median_of(sample["net"])
    still = mean_of(mode["stalls"])
    seeds = len(mode["speed"])
    return [
        Claim(
            "Learning the activation of each of 24 muscles is intractable without prior knowledge.",
            THESIS,
            "median net displacement with the most probable actions no more than 0.1 m/s",
            net,
            net.high <= 0.1,
            "m/s",
            "No synergy is given, no symmetry, and all weights start at 0. The learner is one the thesis did not have.",
        ),
        Claim(
            "Twenty-four independent muscles learn to walk fast.",
            OURS,
            f"most probable actions: median speed along the heading at least {SPEED} m/s",
            speed,
            speed.value >= SPEED,
            "m/s",
            gaits,
        ),
        Claim(
            "What they learn leads somewhere.",
            OURS,
            f"most probable actions: median net displacement over 20 s at least {NET} m/s",
            net,
            net.value >= NET,
            "m/s",
            f"With actions that are drawn: speed {median_of(sample['speed'])}, net displacement {walks} m/s.",
        ),
        Claim(
            "No hexapod stalls with its most probable actions.",
            OURS,
            "no second below 0.3 m/s, in any seed",
            still,
            not np.any(mode["stalls"] > 0),
            note=f"Part of all seconds; {np.count_nonzero(mode['stalls'] > 0)} of {seeds} seeds have such a second. "
            f"Falls: {np.count_nonzero(mode['falls'] > 0)} seeds.",
        ),
    ]


def ablation_claims(values: Values) -> Sequence[Claim]:
    """Of the changed learners, beside the unchanged one with the same seeds."""
    count, made = int(values["compared"]), []
    for variant in values["variants"]:
        ours, theirs = (values[f"{name} mode net"][:count] for name in (FULL, variant))
        more, better = mean_of(theirs - ours), variant in HELPS
        made.append(
            Claim(
                CHANGES[str(variant)],
                OURS,
                "most probable actions, net displacement over 20 s: difference to the unchanged learner "
                f"{'above' if better else 'below'} 0",
                more,
                more.low > 0 if better else more.high < 0,
                "m/s",
                f"Medians: {np.median(theirs):.2f} against {np.median(ours):.2f} m/s; speed along the heading "
                f"{np.median(values[f'{variant} mode speed']):.2f} against "
                f"{np.median(values[f'{FULL} mode speed'][:count]):.2f}.",
            )
        )
    return made


def _quantities(values: Values, mode: str) -> dict[str, np.ndarray]:
    return {name: values[f"{FULL} {mode} {name}"] for name in ("speed", "net", "stalls", "falls", "gait")}
