"""Muscle-driven bodies: descriptions of them, and many simulations of one stepped at once.

A body such as `Hopper` is a frozen dataclass of numbers. `compile_model` makes a MuJoCo model of it, `BodyBatch` many
simulations, `to_mjcf` a file for other programs.
"""

from motorgrad.bodies._arm import Arm
from motorgrad.bodies._batch import BodyBatch, BodyState
from motorgrad.bodies._body import Body, add_muscles, compile_model
from motorgrad.bodies._callback import check_muscle_callback, install_muscle_callback
from motorgrad.bodies._export import to_mjcf
from motorgrad.bodies._hopper import Hopper
from motorgrad.bodies._hexapod import Hexapod
from motorgrad.bodies._hexapod_numbers import Hinge, LateralPair, Leg, Section, Segment, VerticalPair
from motorgrad.bodies._hexapod_sensors import LEGS, HexapodReading, read_hexapod
from motorgrad.bodies._lift import LiftTable, greatest_flexion, lift, lift_table, tabulate_lift
from motorgrad.bodies._muscle import Attachment, Muscle, Wrap, groups_of, tension
from motorgrad.bodies._native import native_force_length
from motorgrad.bodies._servo import Servo
from motorgrad.bodies._terrain import OnTerrain, Terrain
from motorgrad.bodies._tripod import TRIPODS, LegState, TripodController, Turning
from motorgrad.bodies._walk import Walk, walk
from motorgrad.bodies._wrapping import away_angle, path_points, wrapped_length, wrapped_rate, wrapping_angle

__all__ = [
    "Arm",
    "Attachment",
    "Body",
    "BodyBatch",
    "BodyState",
    "Hopper",
    "LiftTable",
    "Muscle",
    "Wrap",
    "add_muscles",
    "away_angle",
    "check_muscle_callback",
    "compile_model",
    "greatest_flexion",
    "groups_of",
    "install_muscle_callback",
    "lift",
    "lift_table",
    "native_force_length",
    "path_points",
    "tabulate_lift",
    "tension",
    "to_mjcf",
    "wrapped_length",
    "wrapped_rate",
    "wrapping_angle",
]
