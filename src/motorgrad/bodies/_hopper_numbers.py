"""The hopper's numbers, and what they may be."""

import dataclasses
from typing import Literal, get_args

from motorgrad._errors import check, choice
from motorgrad.bodies._body import MUSCLE_MODELS
from motorgrad.bodies._muscle import Muscle, not_negative, positive

Lateral = Literal["symmetric", "spring"]
LATERAL = get_args(Lateral)


@dataclasses.dataclass(frozen=True)
class HopperNumbers:
    """The fields of `Hopper`, which documents them, refused where they are impossible."""

    load_mass: float = 2.0
    link_length: float = 0.25
    link_mass: float = 0.15
    foot_mass: float = 0.2
    foot_size: tuple[float, float, float] = (0.07, 0.05, 0.015)
    knee_range: tuple[float, float] = (40.0, 150.0)
    armature: float = 5e-4
    joint_damping: float = 0.005
    capsule_radius: float = 0.04
    attachment_distance: float = 0.12
    flexor_strength: float = 100.0
    flexor_rest_length: float = 0.13
    extensor_strength: float = 400.0
    extensor_rest_length: float = 0.25
    muscle_damping: float = 8.0
    muscle_shape: float = 0.5
    lateral: Lateral = "symmetric"
    lateral_stiffness: float = 100.0
    lateral_damping: float = 1.0
    timestep: float = 0.001
    muscle_model: Literal["thesis", "native"] = "thesis"
    extra_muscles: tuple[Muscle, ...] = ()

    def __post_init__(self) -> None:
        _check_fields(self)


def _check_fields(hopper: HopperNumbers) -> None:
    for name in (
        *("load_mass", "link_length", "link_mass", "foot_mass", "capsule_radius", "attachment_distance"),
        *("flexor_strength", "flexor_rest_length", "extensor_strength", "extensor_rest_length", "muscle_shape"),
        "timestep",
    ):
        positive(name, getattr(hopper, name))
    for name in ("armature", "joint_damping", "muscle_damping", "lateral_stiffness", "lateral_damping"):
        not_negative(name, getattr(hopper, name))
    size, limits = tuple(hopper.foot_size), tuple(hopper.knee_range)
    check(len(size) == 3, "foot_size", size, "three half-lengths (m)")
    for value in size:
        positive("foot_size", value)
    check(
        len(limits) == 2 and 0.0 < limits[0] < 90.0 < limits[1] < 180.0,
        "knee_range",
        limits,
        "(least, greatest) in degrees with 0 < least < 90 < greatest < 180",
    )
    check(
        hopper.capsule_radius < hopper.attachment_distance < hopper.link_length,
        "attachment_distance",
        hopper.attachment_distance,
        f"between capsule_radius {hopper.capsule_radius!r} and link_length {hopper.link_length!r} (m)",
    )
    choice("lateral", hopper.lateral, LATERAL)
    choice("muscle_model", hopper.muscle_model, MUSCLE_MODELS)
    extra = tuple(hopper.extra_muscles)
    for muscle in extra:
        check(isinstance(muscle, Muscle), "extra_muscles", muscle, "a tuple of Muscle")
    object.__setattr__(hopper, "foot_size", size)
    object.__setattr__(hopper, "knee_range", limits)
    object.__setattr__(hopper, "extra_muscles", extra)
