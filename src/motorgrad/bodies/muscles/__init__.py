"""Muscles and servos: their law, their path around joints, and the callback that brings the law into MuJoCo."""

from motorgrad.bodies.muscles._callback import check_muscle_callback, install_muscle_callback, uses_callback
from motorgrad.bodies.muscles._muscle import (
    Attachment,
    Muscle,
    Servo,
    Wrap,
    add_servos,
    groups_of,
    native_force_length,
    set_native_gain,
    tension,
)
from motorgrad.bodies.muscles._wrapping import away_angle, path_points, wrapped_length, wrapped_rate, wrapping_angle

__all__ = [
    "Attachment",
    "Muscle",
    "Servo",
    "Wrap",
    "add_servos",
    "away_angle",
    "check_muscle_callback",
    "groups_of",
    "install_muscle_callback",
    "native_force_length",
    "path_points",
    "set_native_gain",
    "tension",
    "uses_callback",
    "wrapped_length",
    "wrapped_rate",
    "wrapping_angle",
]
