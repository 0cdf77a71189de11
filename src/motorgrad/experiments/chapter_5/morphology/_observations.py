"""What the thesis observed of bodies under the fixed controller, as pairs of walks that differ in one respect."""

from collections.abc import Mapping

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.morphology._body_space import (
    PITCH,
    SPACE,
    YAW,
    body_of,
    jittered,
    usual_numbers,
)
from motorgrad.experiments.chapter_5.morphology._walking import MEASURES, walked_in_turn

WIDER, HEAVIER = 4 / 3, 1.5
Numbers = Mapping[str, float]

VARIANTS = {
    "wide and heavy": lambda body: scaled(body, WIDER, HEAVIER),
    "slim and light": lambda body: scaled(body, 1 / WIDER, 1 / HEAVIER),
    "wide": lambda body: scaled(body, WIDER, 1.0),
    "slim": lambda body: scaled(body, 1 / WIDER, 1.0),
    "heavy": lambda body: scaled(body, 1.0, HEAVIER),
    "light": lambda body: scaled(body, 1.0, 1 / HEAVIER),
    "vertical": lambda body: {**body, "axis": PITCH},
    "lateral": lambda body: {**body, "axis": YAW},
}
"""Changes to a body, by name."""
PAIRS = {
    "base": ("wide and heavy", "slim and light"),
    "width": ("wide", "slim"),
    "mass": ("heavy", "light"),
    "joints": ("vertical", "lateral"),
}
"""Which two are compared: the first should be faster."""


def scaled(body: Numbers, width: float, mass: float) -> dict[str, float]:
    """A body whose sections are so many times as wide and as heavy."""
    return {**body, "width": body["width"] * width, "mass": body["mass"] * mass}


def usual_bodies(count: int, random: np.random.Generator) -> list[dict[str, float]]:
    """The usual body with changes too small to matter."""
    return jittered(usual_numbers(), count, random)


def chance_bodies(count: int, random: np.random.Generator) -> list[dict[str, float]]:
    """Bodies anywhere within the bounds that are possible in all variants, with vertical joints."""
    found: list[dict[str, float]] = []
    while len(found) < count:
        body = {**SPACE.named(random.random(SPACE.size)), "axis": PITCH}
        if all(body_of(change(body)) is not None for change in VARIANTS.values()):
            found.append(body)
    return found


def observe(bodies: list[dict[str, float]], seconds: float, threads: int) -> Values:
    """All variants of every body: each measure by the variant's name, `"wide speed"` and so on, (bodies,)."""
    each = [change(body) for change in VARIANTS.values() for body in bodies]
    found = walked_in_turn(each, seconds, threads)
    shape = (len(VARIANTS), len(bodies))
    return {
        f"{variant} {name}": found[name].reshape(shape)[row]
        for row, variant in enumerate(VARIANTS)
        for name in MEASURES
    }


def differences(values: Values, bodies: str, pair: str, measure: str) -> np.ndarray:
    """Of a pair, the first less the second, for each body of which both walks ended well; `bodies` is `"usual"` or
    `"chance"`."""
    one, other = (values[f"{bodies} {variant} {measure}"] for variant in PAIRS[pair])
    less = one - other
    return less[np.isfinite(less)]
