"""The numbers of a hexapod's body that are searched, and the body that has them."""

import dataclasses
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from motorgrad.bodies import Hexapod, Hinge, LateralPair, Leg, Section, Segment, VerticalPair
from motorgrad.search import Range, Space

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
"""Lengths in m, the mass of one section in kg, ranges of joints in degrees to one side, stiffness in N m/rad. All
sections are alike, and all legs. Above a half of `axis` the joints between the sections are lateral, else vertical."""

WORDS = {
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
PITCH, YAW = 0.25, 0.75
"""The middles of the two halves of `axis`."""


def usual_numbers() -> dict[str, float]:
    """Those of the hexapod as it is."""
    return {name: float(each.start or 0.0) for name, each in SPACE.ranges.items()} | {"axis": PITCH}


def body_of(numbers: Mapping[str, float]) -> Hexapod | None:
    """The hexapod with these numbers, on servos; None where there can be none, as when its feet do not reach the floor.

    Bones keep their mass per length, and muscles their attachments in proportion, so that the same body can be driven
    by muscles.
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
    lateral, vertical = LateralPair(), VerticalPair()
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
    """So many copies with changes too small to matter, 0.1 % of every range: walks are chaotic, and so differ. The axis
    stays."""
    places: Float[np.ndarray, " size"] = SPACE.places([numbers[name] for name in SPACE.names])
    moved = (places + 1e-3 * random.standard_normal(SPACE.size) for _ in range(count))
    return [{**SPACE.named(each), "axis": numbers["axis"]} for each in moved]
