"""Muscle-driven bodies: descriptions in numbers, and many simulations stepped together.

A body such as `Hopper` is a frozen dataclass of numbers. `compile_model` makes a MuJoCo model from it, `BodyBatch` runs
many simulations, and `to_mjcf` writes a file for other programs.
"""

from motorgrad.bodies._batch import BodyBatch, BodyState, start_key, start_pose
from motorgrad.bodies._body import (
    Actuator,
    Body,
    WrappedBody,
    actuators_of,
    add_muscles,
    compile_model,
    group_places,
    to_mjcf,
)
from motorgrad.bodies._contraction import Contraction, contract
from motorgrad.bodies._ground import OnTerrain, SlopeBatch, Terrain
from motorgrad.bodies._hopper import Hopper
from motorgrad.bodies._push import PushBatch
from motorgrad.bodies._reader import BodyReader, Column, actuator_units, joint_columns, muscular, sensor_columns
from motorgrad.bodies.arm._arm import POSTURES, Arm, Posture
from motorgrad.bodies.arm._lift import LiftTable, greatest_flexion, lift, lift_table, tabulate_lift
from motorgrad.bodies.hexapod._controllers import TRIPODS, LegState, TripodClock, TripodController, Turning
from motorgrad.bodies.hexapod._gait import TOUCH, Gait, Walk, debounced, measure_gait, walk
from motorgrad.bodies.hexapod._hexapod import Hexapod, biomimetic_hexapod
from motorgrad.bodies.hexapod._numbers import Hinge, LateralPair, Leg, Section, Segment, VerticalPair
from motorgrad.bodies.hexapod._sensors import LEGS, HexapodReading, TrunkReading, read_hexapod, read_trunk
from motorgrad.bodies.mjcf._anatomy import Anatomy, Sensor, WithSensors, actuator_levels
from motorgrad.bodies.mjcf._mjcf import BUNDLED, Mjcf
from motorgrad.bodies.mjcf._to_hill import hill_of
from motorgrad.bodies.models._read import read_model
from motorgrad.bodies.muscles._callback import check_muscle_callback, install_muscle_callback
from motorgrad.bodies.muscles._curve_sets import CURVES, HillCurves, hill_curves
from motorgrad.bodies.muscles._hill import Hill, HillMuscle, HillState, hill_actuators, hill_force, read_hill, set_hill
from motorgrad.bodies.muscles._hill_curves import (
    active_force_length,
    force_velocity,
    passive_force_length,
    tendon_force_length,
)
from motorgrad.bodies.muscles._hill_traced import hill_in_jax
from motorgrad.bodies.muscles._muscle import (
    Attachment,
    Motor,
    Muscle,
    Servo,
    Wrap,
    contraction_work,
    groups_of,
    native_force_length,
    tension,
)
from motorgrad.bodies.muscles._wrapping import away_angle, path_points, wrapped_length, wrapped_rate, wrapping_angle

BODIES: dict[str, type[Body]] = {"arm": Arm, "hexapod": Hexapod, "hopper": Hopper, "mjcf": Mjcf}
"""The registry: bodies by name. A new body is one file, and one line here; TimSim then shows it without a task."""

__all__ = [
    "BODIES",
    "BUNDLED",
    "CURVES",
    "LEGS",
    "POSTURES",
    "TOUCH",
    "TRIPODS",
    "Actuator",
    "Anatomy",
    "Arm",
    "Attachment",
    "Body",
    "BodyBatch",
    "BodyReader",
    "BodyState",
    "Column",
    "Contraction",
    "Gait",
    "Hexapod",
    "HexapodReading",
    "Hill",
    "HillCurves",
    "HillMuscle",
    "HillState",
    "Hinge",
    "Hopper",
    "LateralPair",
    "Leg",
    "LegState",
    "LiftTable",
    "Mjcf",
    "Motor",
    "Muscle",
    "OnTerrain",
    "Posture",
    "PushBatch",
    "Section",
    "Segment",
    "Sensor",
    "Servo",
    "SlopeBatch",
    "Terrain",
    "TripodClock",
    "TripodController",
    "TrunkReading",
    "Turning",
    "VerticalPair",
    "Walk",
    "WithSensors",
    "Wrap",
    "WrappedBody",
    "active_force_length",
    "actuator_levels",
    "actuator_units",
    "actuators_of",
    "add_muscles",
    "away_angle",
    "biomimetic_hexapod",
    "check_muscle_callback",
    "compile_model",
    "contract",
    "contraction_work",
    "debounced",
    "force_velocity",
    "greatest_flexion",
    "group_places",
    "groups_of",
    "hill_actuators",
    "hill_curves",
    "hill_force",
    "hill_in_jax",
    "hill_of",
    "install_muscle_callback",
    "joint_columns",
    "lift",
    "lift_table",
    "measure_gait",
    "muscular",
    "native_force_length",
    "passive_force_length",
    "path_points",
    "read_hexapod",
    "read_hill",
    "read_model",
    "read_trunk",
    "sensor_columns",
    "set_hill",
    "start_key",
    "start_pose",
    "tabulate_lift",
    "tendon_force_length",
    "tension",
    "to_mjcf",
    "walk",
    "wrapped_length",
    "wrapped_rate",
    "wrapping_angle",
]
