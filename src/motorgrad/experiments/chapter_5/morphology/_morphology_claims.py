"""What is claimed of the search for a body, and of the thesis's observations."""

from collections.abc import Sequence

import numpy as np

from motorgrad.experiments._claim import Claim, mean_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.morphology._observations import HEAVIER, WIDER, differences

SOURCE = "section 5.3.3"
BODIES = {"usual": "of the usual body", "chance": "of bodies at random places"}


def judge(values: Values, evaluations: int) -> Sequence[Claim]:
    """All claims, in the order of the thesis."""
    return (*_searches(values, evaluations), *_observed(values), *_explained(values))


def _searches(values: Values, evaluations: int) -> list[Claim]:
    usual = values["usual"].mean()
    cma, boltzmann, uniform = (values[f"{kind} again"].mean(axis=1) for kind in ("cma-es", "boltzmann", "uniform"))
    gain, half, ahead = (
        mean_of(cma - usual),
        mean_of((boltzmann - usual) - 0.5 * (cma - usual)),
        mean_of(boltzmann - uniform),
    )
    told = f"The usual body walks at {usual:.2f} m/s; each search's best was judged by walks that it had not seen."
    return [
        Claim(
            "An outer loop with a global optimiser finds a faster body.",
            "section 5.4.1",
            f"CMA-ES, {evaluations} evaluations: speed above the usual body's, difference above 0",
            gain,
            gain.low > 0,
            "m/s",
            told,
        ),
        Claim(
            "Random search with Boltzmann selection is largely ineffective.",
            SOURCE,
            "gains less than half of what CMA-ES gains with as many evaluations: what it gains beyond a half below 0",
            half,
            half.high < 0,
            "m/s",
            f"It gains {(boltzmann - usual).mean():.2f} m/s, CMA-ES {gain.value:.2f} m/s.",
        ),
        Claim(
            "To select and perturb is better than to sample anywhere.",
            "our own expectation",
            "Boltzmann selection against random sampling, as many evaluations: difference above 0",
            ahead,
            ahead.low > 0,
            "m/s",
            f"Random sampling gains {(uniform - usual).mean():.2f} m/s.",
        ),
    ]


def _observed(values: Values) -> list[Claim]:
    made = []
    for bodies, words in BODIES.items():
        base, width, mass = (mean_of(differences(values, bodies, pair, "speed")) for pair in ("base", "width", "mass"))
        made.append(
            Claim(
                f"A wide heavy trunk is faster than a slim light one ({words}).",
                SOURCE,
                f"width × and ÷ {WIDER:.3g}, mass × and ÷ {HEAVIER:g}: difference above 0",
                base,
                base.low > 0,
                "m/s",
                f"Width alone {width} m/s, mass alone {mass} m/s.",
            )
        )
    for bodies, words in BODIES.items():
        joints = mean_of(differences(values, bodies, "joints", "speed"))
        speeds = [np.nanmean(values[f"{bodies} {variant} speed"]) for variant in ("vertical", "lateral")]
        made.append(
            Claim(
                f"Vertical joints between the sections make it faster than lateral ones ({words}).",
                SOURCE,
                "the same body with either: difference above 0",
                joints,
                joints.low > 0,
                "m/s",
                f"{speeds[0]:.2f} m/s and {speeds[1]:.2f} m/s.",
            )
        )
    return made


def _explained(values: Values) -> list[Claim]:
    made = []
    for pair, words in (("base", "wide heavy trunk than with a slim light one"), ("joints", None)):
        words = words or "vertical joint between sections than with a lateral one"
        for bodies, of in BODIES.items():
            more = mean_of(differences(values, bodies, pair, "duty"))
            made.append(
                Claim(
                    f"Feet are on the ground for longer with a {words} ({of}).",
                    SOURCE,
                    "part of the time: difference above 0",
                    more,
                    more.low > 0,
                    "of the time",
                )
            )
    for bodies, of in BODIES.items():
        less = mean_of(-differences(values, bodies, "base", "tilt"))
        made.append(
            Claim(
                f"A wide heavy trunk tilts less than a slim light one ({of}).",
                SOURCE,
                "root mean square tilt against the ground: difference above 0",
                less,
                less.low > 0,
                "° less",
            )
        )
    return made
