"""Bodies of the hexapod: the numbers that a search varies, walks of such bodies, and variants for comparison."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from motorgrad.bodies import Hexapod, HexapodReading, Hinge, LateralPair, Leg, Section, Segment, VerticalPair, walk
from motorgrad.search import Range, Space
from motorgrad_thesis._experiment import Values

USUAL = Hexapod(drive="servos")
_SECTION, _LEG = USUAL.middle, USUAL.middle.leg
SPACE = Space(
    {
        "width": Range(0.15, 0.50, _SECTION.width),
        "length": Range(0.12, 0.32, _SECTION.length),
        "gap": Range(0.01, 0.15, USUAL.spacing - _SECTION.length),
        "height": Range(0.05, 0.15, _SECTION.height),
        "mass": Range(0.5, 4.0, _SECTION.mass, log=True),
        "coxa": Range(0.03, 0.12, _LEG.coxa.length),
        "femur": Range(0.08, 0.22, _LEG.femur.length),
        "foot": Range(0.10, 0.25, _LEG.foot.length),
        "knee": Range(55.0, 90.0, _LEG.knee),
        "sideways": Range(22.0, 45.0, _LEG.lateral.range[1]),
        "down": Range(5.0, 35.0, -_LEG.vertical.range[0]),
        "up": Range(25.0, 80.0, _LEG.vertical.range[1]),
        "spine": Range(2.0, 20.0, USUAL.spine.range[1]),
        "stiffness": Range(2.0, 200.0, USUAL.spine.stiffness, log=True),
        "axis": Range(0.0, 1.0, 0.5),
    }
)
"""Lengths in m, the mass of one section in kg, joint ranges in degrees to one side, stiffness in N m/rad. All sections
are equal, and all legs. The joints between sections are lateral if `axis` exceeds one half, else vertical."""

DIMENSION_LABELS = {
    "width": "width of a section (m)",
    "length": "length of a section (m)",
    "gap": "gap between sections (m)",
    "height": "height of a section (m)",
    "mass": "mass of a section (kg)",
    "coxa": "length of the coxa (m)",
    "femur": "length of the femur (m)",
    "foot": "length of the foot (m)",
    "knee": "bend of the knee (°)",
    "sideways": "lateral joint, ± (°)",
    "down": "vertical joint, down to (°)",
    "up": "vertical joint, up to (°)",
    "spine": "joint between sections, ± (°)",
    "stiffness": "its stiffness (N m/rad)",
    "axis": "its axis (vertical, lateral)",
}
PITCH = 0.25
YAW = 0.75
"""Midpoints of the two halves of `axis`."""

SETTLING = 1.0  # seconds at the start of a walk that are not measured
MEASURES = ("speed", "duty", "tilt")
WIDER = 4 / 3
HEAVIER = 1.5
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
"""Variants that are compared: the first should be faster."""


def usual_numbers() -> dict[str, float]:
    """The numbers of the standard hexapod."""
    return {name: float(each.start or 0.0) for name, each in SPACE.ranges.items()} | {"axis": PITCH}


def body_of(numbers: Mapping[str, float]) -> Hexapod | None:
    """The hexapod with these numbers, on servos; `None` if it is impossible, for example because its feet do not reach
    the floor.

    Bones keep their mass per length, and muscles their relative attachments, so that the same body can be driven by
    muscles.
    """
    try:
        return _build(numbers)
    except ValueError:
        return None


def _build(numbers: Mapping[str, float]) -> Hexapod:
    def bone(name: str) -> Segment:
        usual: Segment = getattr(_LEG, name)
        return Segment(numbers[name], usual.mass * numbers[name] / usual.length, usual.radius)

    coxa, femur = (numbers[name] / getattr(_LEG, name).length for name in ("coxa", "femur"))
    lateral = LateralPair()
    vertical = VerticalPair()
    leg = dataclasses.replace(
        Leg(),
        **{name: bone(name) for name in ("coxa", "femur", "foot")},
        knee=numbers["knee"],
        lateral=Hinge((-numbers["sideways"], numbers["sideways"])),
        vertical=Hinge((-numbers["down"], numbers["up"])),
        lateral_muscles=dataclasses.replace(lateral, reach=min(lateral.reach * coxa, numbers["coxa"])),
        vertical_muscles=dataclasses.replace(
            vertical, radius=vertical.radius * min(coxa, femur), distance=vertical.distance * femur
        ),
    )
    section = Section(numbers["length"], numbers["width"], numbers["height"], numbers["mass"], leg)
    spine = dataclasses.replace(
        USUAL.spine, range=(-numbers["spine"], numbers["spine"]), stiffness=numbers["stiffness"]
    )
    return dataclasses.replace(
        USUAL,
        **dict.fromkeys(USUAL.sections, section),
        spacing=numbers["length"] + numbers["gap"],
        spine=spine,
        spine_axis="yaw" if numbers["axis"] > 0.5 else "pitch",
    )


def jittered(numbers: Mapping[str, float], count: int, random: np.random.Generator) -> list[dict[str, float]]:
    """Copies with negligible changes, 0.1 % of every range: walks are chaotic, and so differ. The axis stays."""
    places: Float[np.ndarray, " size"] = SPACE.places([numbers[name] for name in SPACE.names])
    moved = (places + 1e-3 * random.standard_normal(SPACE.size) for _ in range(count))
    return [{**SPACE.named(each), "axis": numbers["axis"]} for each in moved]


def walk_measures(candidates: Sequence[Mapping[str, float]], seconds: float, threads: int = 0) -> Values:
    """Walks of bodies with these numbers over so many seconds, not counting the first.

    **Returns** for each body, NaN if it is impossible or diverges: `speed`, net displacement over time in m/s; `duty`,
    the fraction of the time that a foot is on the ground; `tilt` of the middle section against the ground, root mean
    square in degrees.
    """
    bodies = [body_of(each) for each in candidates]
    found = {name: np.full(len(bodies), np.nan) for name in MEASURES}
    rows = [row for row, body in enumerate(bodies) if body is not None]
    possible: list[Hexapod] = [body for body in bodies if body is not None]
    if not possible:
        return found
    done = walk(possible, seconds=seconds, threads=threads)
    gait = done.gait(since=SETTLING)
    late = HexapodReading(*(part[done.time > SETTLING] for part in done.reading))
    tilt = np.rad2deg(np.sqrt((np.arccos(np.clip(late.upright, -1.0, 1.0)) ** 2).mean(axis=0)))
    for name, values in zip(MEASURES, (gait.net, gait.duty, tilt), strict=True):
        found[name][rows] = np.where(done.diverged > 0, np.nan, values)
    return found


def walk_in_batches(candidates: Sequence[Mapping[str, float]], seconds: float, threads: int = 0) -> Values:
    """The same for many bodies, in batches that bound the memory."""
    parts = [walk_measures(candidates[at : at + 24], seconds, threads) for at in range(0, len(candidates), 24)]
    return {name: np.concatenate([part[name] for part in parts]) for name in MEASURES}


def scaled(body: Numbers, width: float, mass: float) -> dict[str, float]:
    """A body whose sections are multiplied in width and mass."""
    return {**body, "width": body["width"] * width, "mass": body["mass"] * mass}


def usual_bodies(count: int, random: np.random.Generator) -> list[dict[str, float]]:
    """The standard body with negligible changes."""
    return jittered(usual_numbers(), count, random)


def random_bodies(count: int, random: np.random.Generator) -> list[dict[str, float]]:
    """Random bodies within the bounds that are possible in all variants, with vertical joints."""
    found: list[dict[str, float]] = []
    while len(found) < count:
        body = {**SPACE.named(random.random(SPACE.size)), "axis": PITCH}
        if all(body_of(change(body)) is not None for change in VARIANTS.values()):
            found.append(body)
    return found


def walk_variants(bodies: list[dict[str, float]], seconds: float, threads: int) -> Values:
    """All variants of every body: each measure by the variant's name, `"wide speed"` and so on, (bodies,)."""
    each = [change(body) for change in VARIANTS.values() for body in bodies]
    found = walk_in_batches(each, seconds, threads)
    shape = (len(VARIANTS), len(bodies))
    return {
        f"{variant} {name}": found[name].reshape(shape)[row]
        for row, variant in enumerate(VARIANTS)
        for name in MEASURES
    }


def differences(values: Values, bodies: str, pair: str, measure: str) -> np.ndarray:
    """The first of a pair minus the second, for each body of which both walks ended well; `bodies` is `"usual"` or
    `"chance"`."""
    one, other = (values[f"{bodies} {variant} {measure}"] for variant in PAIRS[pair])
    less = one - other
    return less[np.isfinite(less)]
