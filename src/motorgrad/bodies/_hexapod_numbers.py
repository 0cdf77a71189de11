"""The hexapod's numbers: segments, hinges, muscles, legs and sections, and what they may be."""

import dataclasses
import math
from typing import Any, Literal, get_args

from motorgrad._errors import check, choice
from motorgrad.bodies._body import MUSCLE_MODELS
from motorgrad.bodies._muscle import not_negative, positive

Drive = Literal["muscles", "servos"]
Spine = Literal["pitch", "yaw"]
DRIVES, SPINES = get_args(Drive), get_args(Spine)


def _check_positive(numbers: Any, *names: str) -> None:
    for name in names:
        positive(f"{type(numbers).__name__}.{name}", getattr(numbers, name))


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


@dataclasses.dataclass(frozen=True)
class Segment:
    """One bone, a capsule.

    - `length` (m): from joint to joint.
    - `mass` (kg): of the bone.
    - `radius` (m): of the capsule.
    """

    length: float
    mass: float
    radius: float

    def __post_init__(self) -> None:
        for name in ("length", "mass", "radius"):
            positive(f"Segment.{name}", getattr(self, name))


@dataclasses.dataclass(frozen=True)
class Hinge:
    """One freedom between stiff stops.

    - `range` (degrees): least and greatest angle, with 0 within.
    - `stiffness` (N m/rad): of a spring towards 0.
    - `damping` (N m s/rad): of the joint.
    - `armature` (kg m²): of the joint.
    """

    range: tuple[float, float]
    stiffness: float = 0.0
    damping: float = 0.02
    armature: float = 0.003

    def __post_init__(self) -> None:
        limits = tuple(self.range)
        right = len(limits) == 2 and -90.0 < limits[0] <= 0.0 <= limits[1] < 90.0 and limits[0] < limits[1]
        check(right, "Hinge.range", limits, "(least, greatest) in degrees with -90 < least <= 0 <= greatest < 90")
        for name in ("stiffness", "damping", "armature"):
            not_negative(f"Hinge.{name}", getattr(self, name))
        object.__setattr__(self, "range", limits)

    @property
    def middle(self) -> float:
        """The middle of the range, in rad."""
        return math.radians(sum(self.range) / 2.0)


@dataclasses.dataclass(frozen=True)
class LateralPair:
    """The two straight muscles that swing a leg forward (protractor, the flexor) and back (retractor, the extensor).

    Both run from the section, before or behind the leg's hip and square to the leg at rest, to a point on the coxa.
    Their rest lengths are the lengths in the middle of the joint's range.

    - `protractor` (N): greatest contractile force of the one.
    - `retractor` (N): greatest contractile force of the other.
    - `damping` (N s/m): k_SE of both.
    - `shape`: k_CE of both; the larger, the flatter the force–length curve.
    - `base` (m): from the hip to their ends on the section.
    - `reach` (m): from the hip to their ends on the coxa.
    """

    protractor: float = 120.0
    retractor: float = 120.0
    damping: float = 40.0
    shape: float = 0.5
    base: float = 0.09
    reach: float = 0.06

    def __post_init__(self) -> None:
        _check_positive(self, "protractor", "retractor", "shape", "base", "reach")
        not_negative("LateralPair.damping", self.damping)


@dataclasses.dataclass(frozen=True)
class VerticalPair:
    """The two muscles that lift a leg (levator, the flexor) and press it down (depressor, the extensor).

    Both end on the femur. The depressor comes from the coxa's hip end and is wrapped, below, around a cylinder about
    the joint's axis; the levator is straight, from a point above the coxa's hip end. Their rest lengths are the lengths
    in the middle of the joint's range.

    - `levator` (N): greatest contractile force of the one.
    - `depressor` (N): greatest contractile force of the other.
    - `damping` (N s/m): k_SE of both.
    - `shape`: k_CE of both; the larger, the flatter the force–length curve.
    - `radius` (m): of the cylinder.
    - `distance` (m): from the vertical joint to their ends on the femur.
    - `height` (m): of the levator's origin above the coxa's hip end.
    """

    levator: float = 250.0
    depressor: float = 250.0
    damping: float = 60.0
    shape: float = 0.5
    radius: float = 0.045
    distance: float = 0.12
    height: float = 0.06

    def __post_init__(self) -> None:
        _check_positive(self, "levator", "depressor", "shape", "radius", "distance", "height")
        not_negative("VerticalPair.damping", self.damping)


@dataclasses.dataclass(frozen=True)
class Leg:
    """The numbers of a left and of a right leg, mirror images of each other.

    - `coxa`: the bone at the hip.
    - `femur`: the next bone outwards.
    - `foot`: the last one, which stands on the ground.
    - `lateral`: the joint between section and coxa, positive forward.
    - `vertical`: the joint between coxa and femur, positive up.
    - `ankle`: the joint between femur and foot, a spring only.
    - `splay` (degrees): how far forward the leg points at rest from straight sideways.
    - `knee` (degrees): by how much the foot is bent down from the femur's line, from 0 to 90 excluded and included.
    - `friction`: of the foot with any ground, the sliding coefficient.
    - `lateral_muscles`: the two that swing it.
    - `vertical_muscles`: the two that lift it and press it down.
    """

    coxa: Segment = Segment(0.06, 0.06, 0.016)
    femur: Segment = Segment(0.14, 0.10, 0.012)
    foot: Segment = Segment(0.17, 0.06, 0.012)
    lateral: Hinge = Hinge((-30.0, 30.0))
    vertical: Hinge = Hinge((-15.0, 55.0))
    ankle: Hinge = Hinge((-3.5, 3.5), stiffness=30.0, damping=0.3)
    splay: float = 0.0
    knee: float = 80.0
    friction: float = 1.0
    lateral_muscles: LateralPair = LateralPair()
    vertical_muscles: VerticalPair = VerticalPair()

    def __post_init__(self) -> None:
        check(_number(self.splay) and -60.0 <= self.splay <= 60.0, "Leg.splay", self.splay, "from -60 to 60 degrees")
        check(_number(self.knee) and 0.0 < self.knee <= 90.0, "Leg.knee", self.knee, "in (0, 90] degrees")
        positive("Leg.friction", self.friction)
        reach, coxa, femur = self.lateral_muscles.reach, self.coxa.length, self.femur.length
        check(reach <= coxa, "LateralPair.reach", reach, f"at most the coxa's length {coxa!r} (m)")
        radius, distance = self.vertical_muscles.radius, self.vertical_muscles.distance
        check(radius < coxa, "VerticalPair.radius", radius, f"below the coxa's length {coxa!r} (m)")
        allowed = f"between the capsule's radius {radius!r} and the femur's length {femur!r} (m)"
        check(radius < distance <= femur, "VerticalPair.distance", distance, allowed)


@dataclasses.dataclass(frozen=True)
class Section:
    """A box of the trunk with its two legs.

    - `length` (m): along x.
    - `width` (m): along y.
    - `height` (m): along z.
    - `mass` (kg): without legs.
    - `leg`: either of its legs, which are mirror images.
    """

    length: float = 0.22
    width: float = 0.30
    height: float = 0.09
    mass: float = 1.5
    leg: Leg = Leg()

    def __post_init__(self) -> None:
        _check_positive(self, "length", "width", "height", "mass")


@dataclasses.dataclass(frozen=True)
class HexapodNumbers:
    """The fields of `Hexapod`, which documents them, refused where they are impossible."""

    front: Section = Section()
    middle: Section = Section()
    rear: Section = Section()
    spacing: float = 0.26
    spine: Hinge = Hinge((-7.5, 7.5), stiffness=20.0, damping=0.5)
    spine_axis: Spine = "pitch"
    drive: Drive = "muscles"
    servo_gain: float = 20.0
    lateral_torque: float = 6.0
    vertical_torque: float = 12.0
    timestep: float = 0.0025
    muscle_model: Literal["thesis", "native"] = "thesis"

    def __post_init__(self) -> None:
        _check_positive(self, "spacing", "servo_gain", "lateral_torque", "vertical_torque", "timestep")
        least = (self.middle.length + max(self.front.length, self.rear.length)) / 2.0
        check(self.spacing >= least, "spacing", self.spacing, f"at least {least:g} m, so that no sections overlap")
        choice("spine_axis", self.spine_axis, SPINES)
        choice("drive", self.drive, DRIVES)
        choice("muscle_model", self.muscle_model, MUSCLE_MODELS)

    @property
    def sections(self) -> dict[str, Section]:
        """The three sections by name, front to rear."""
        return {"front": self.front, "middle": self.middle, "rear": self.rear}
