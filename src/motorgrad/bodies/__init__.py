"""Muscle-driven bodies: descriptions of them, and many simulations of one stepped at once.

A body such as `Hopper` is a frozen dataclass of numbers. `compile_model` makes a MuJoCo model of it, `BodyBatch` many
simulations, `to_mjcf` a file for other programs.
"""

from motorgrad.bodies._arm import Arm
from motorgrad.bodies._batch import BodyBatch, BodyState
from motorgrad.bodies._body import Body, add_muscles, compile_model
from motorgrad.bodies._callback import check_muscle_callback, install_muscle_callback
from motorgrad.bodies._clock import TripodClock
from motorgrad.bodies._export import to_mjcf
from motorgrad.bodies._gait import TOUCH, Gait, debounced, measure_gait
from motorgrad.bodies._hexapod import Hexapod
from motorgrad.bodies._hexapod_biomimetic import biomimetic_hexapod
from motorgrad.bodies._hexapod_numbers import Hinge, LateralPair, Leg, Section, Segment, VerticalPair
from motorgrad.bodies._hexapod_sensors import LEGS, HexapodReading, read_hexapod
from motorgrad.bodies._hopper import Hopper
from motorgrad.bodies._lift import LiftTable, greatest_flexion, lift, lift_table, tabulate_lift
from motorgrad.bodies._muscle import Attachment, Muscle, Wrap, groups_of, tension
from motorgrad.bodies._native import native_force_length
from motorgrad.bodies._servo import Servo
from motorgrad.bodies._slope import SlopeBatch
from motorgrad.bodies._terrain import OnTerrain, Terrain
from motorgrad.bodies._tripod import TRIPODS, LegState, TripodController, Turning
from motorgrad.bodies._walk import Walk, walk
from motorgrad.bodies._wrapped_body import WrappedBody
from motorgrad.bodies._wrapping import away_angle, path_points, wrapped_length, wrapped_rate, wrapping_angle

__all__ = [
    "LEGS",
    "TOUCH",
    "TRIPODS",
    "Arm",
    "Attachment",
    "Body",
    "BodyBatch",
    "BodyState",
    "Gait",
    "Hexapod",
    "HexapodReading",
    "Hinge",
    "Hopper",
    "LateralPair",
    "Leg",
    "LegState",
    "LiftTable",
    "Muscle",
    "OnTerrain",
    "Section",
    "Segment",
    "Servo",
    "SlopeBatch",
    "Terrain",
    "TripodClock",
    "TripodController",
    "Turning",
    "VerticalPair",
    "Walk",
    "Wrap",
    "WrappedBody",
    "add_muscles",
    "away_angle",
    "biomimetic_hexapod",
    "check_muscle_callback",
    "compile_model",
    "debounced",
    "greatest_flexion",
    "groups_of",
    "install_muscle_callback",
    "lift",
    "lift_table",
    "measure_gait",
    "native_force_length",
    "path_points",
    "read_hexapod",
    "tabulate_lift",
    "tension",
    "to_mjcf",
    "walk",
    "wrapped_length",
    "wrapped_rate",
    "wrapping_angle",
]
