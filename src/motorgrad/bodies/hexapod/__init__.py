"""The hexapod: its parts in numbers, its sensors, its fixed controllers, and measures of its gait."""

from motorgrad.bodies.hexapod._controllers import TRIPODS, LegState, TripodClock, TripodController, Turning
from motorgrad.bodies.hexapod._gait import TOUCH, Gait, Walk, debounced, measure_gait, walk
from motorgrad.bodies.hexapod._hexapod import Hexapod, biomimetic_hexapod
from motorgrad.bodies.hexapod._numbers import Hinge, LateralPair, Leg, Section, Segment, VerticalPair
from motorgrad.bodies.hexapod._sensors import LEGS, HexapodReading, read_hexapod

__all__ = [
    "LEGS",
    "TOUCH",
    "TRIPODS",
    "Gait",
    "Hexapod",
    "HexapodReading",
    "Hinge",
    "LateralPair",
    "Leg",
    "LegState",
    "Section",
    "Segment",
    "TripodClock",
    "TripodController",
    "Turning",
    "VerticalPair",
    "Walk",
    "biomimetic_hexapod",
    "debounced",
    "measure_gait",
    "read_hexapod",
    "walk",
]
