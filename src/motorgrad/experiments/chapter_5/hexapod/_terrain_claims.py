"""What is claimed of the fixed controller on uneven ground."""

from collections.abc import Sequence

import numpy as np

from motorgrad.experiments._claim import Claim, mean_of, share_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.hexapod._sources import INDEPENDENT, OURS

THESIS = "section 5.3.3"
CONSISTENT, ROBUST = 0.75, 0.9
"""What the interval of a share of grounds must be above to count as consistent: with 20 grounds, no more than one may
be otherwise. And the least part of the speed on level ground that counts as robust."""


def kind_claims(values: Values, kind: str, clearance: float) -> Sequence[Claim]:
    """Of one kind of ground, under the mended controller."""
    rows, top = _rows(values, clearance), f"{100 * clearance:g} cm"
    gaits = values[f"{kind} mended gait"]
    tripod, steepest = share_of((gaits[rows] == "tripod").all(0)), share_of(gaits[-1] == "tripod")
    net = values[f"{kind} mended net"]
    kept = mean_of(net[rows][-1] / net[0].mean())
    most = f"{100 * values['height'][-1]:g} cm"
    return [
        Claim(
            f"The controller consistently generates a tripod gait on {kind} up to {top}.",
            THESIS,
            f"at every height up to {top}: on a share of the grounds above {CONSISTENT:g}",
            tripod,
            tripod.low > CONSISTENT,
            note=f"Phase between the tripods {_phases(values, kind, rows)} cycles, means by height.",
        ),
        Claim(
            f"It does so on {kind} of {most} too.",
            OURS,
            f"on a share of the grounds above {CONSISTENT:g}",
            steepest,
            steepest.low > CONSISTENT,
            note=f"Net speed there {net[-1].mean():.2f} m/s, {net[0].mean():.2f} on level ground.",
        ),
        Claim(
            f"It is robust: {kind} of {top} hardly slow it.",
            INDEPENDENT if kind == "bumps" else THESIS,
            f"net displacement at least {ROBUST:g} of that on level ground",
            kept,
            kept.low >= ROBUST,
            "of the speed on level ground",
        ),
    ]


def controller_claims(values: Values, kinds: Sequence[str], clearance: float) -> Sequence[Claim]:
    """Of the wording and the mending, over all kinds of ground up to the clearance."""
    rows, top = _rows(values, clearance), f"{100 * clearance:g} cm"
    still = {
        wording: np.concatenate([values[f"{kind} {wording} still"][rows].any(0) for kind in kinds])
        for wording in ("mended", "worded")
    }
    stands = {wording: share_of(each) for wording, each in still.items()}
    never = share_of(~np.concatenate([values[f"{kind} mended overturned"].any(0) for kind in kinds]))
    fewer = mean_of(still["worded"] * 1.0 - still["mended"])
    by_kind = ", ".join(f"{kind} {np.count_nonzero(values[f'{kind} worded still'][rows].any(0))}" for kind in kinds)
    seeds = len(still["mended"]) // len(kinds)
    return [
        Claim(
            f"As the thesis words it, the controller is robust up to {top}: it does not come to a stand.",
            THESIS,
            f"walks at every height up to {top}: on a share of the grounds above {CONSISTENT:g}",
            share_of(~still["worded"]),
            share_of(~still["worded"]).low > CONSISTENT,
            note=f"Grounds of {seeds} on which it stands still at the end of one of its walks: {by_kind}.",
        ),
        Claim(
            f"With its deadlocks mended it does not come to a stand up to {top}.",
            OURS,
            f"walks at every height up to {top}: on a share of the grounds above {CONSISTENT:g}",
            share_of(~still["mended"]),
            share_of(~still["mended"]).low > CONSISTENT,
        ),
        Claim(
            "The mending is what keeps it walking.",
            OURS,
            "share of grounds on which it stands still, as worded less mended: above 0",
            fewer,
            fewer.low > 0,
            note=f"{stands['worded'].value:.2f} and {stands['mended'].value:.2f} of the grounds.",
        ),
        Claim(
            "It never overturns, at any height.",
            OURS,
            f"on a share of the grounds above {CONSISTENT:g}",
            never,
            never.low > CONSISTENT,
        ),
    ]


def _rows(values: Values, clearance: float) -> np.ndarray:
    """The heights above level ground and up to the clearance, by number."""
    height = values["height"]
    return np.flatnonzero((height > 0) & (height <= clearance + 1e-9))


def _phases(values: Values, kind: str, rows: np.ndarray) -> str:
    return ", ".join(f"{phase:.2f}" for phase in values[f"{kind} mended phase"][rows].mean(1))
