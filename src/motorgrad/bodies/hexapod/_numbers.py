"""The hexapod's parts in numbers: segments, hinges, muscles, legs and sections."""

import dataclasses
import math
from typing import Literal

from motorgrad._errors import check, check_finite, check_not_negative, check_positive

Drive = Literal["muscles", "servos"]


def _check_positive(numbers: object, *names: str) -> None:
    for name in names:
        check_positive(f"{type(numbers).__name__}.{name}", getattr(numbers, name))


@dataclasses.dataclass(frozen=True)
class Segment:
    """A bone, drawn and simulated as a capsule.

    - `length` (m): length of the bone, from joint to joint.
    - `mass` (kg): mass of the bone.
    - `radius` (m): radius of the capsule.
    """

    length: float
    mass: float
    radius: float

    def __post_init__(self) -> None:
        _check_positive(self, "length", "mass", "radius")


@dataclasses.dataclass(frozen=True)
class Hinge:
    """A hinge joint between stiff stops.

    - `range` (degrees): least and greatest angle, with 0 in between.
    - `stiffness` (N m/rad): stiffness of a spring towards 0.
    - `damping` (N m s/rad): damping of the joint.
    - `armature` (kg m²): armature of the joint.
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
            check_not_negative(f"Hinge.{name}", getattr(self, name))
        object.__setattr__(self, "range", limits)

    @property
    def middle(self) -> float:
        """The middle of the range, in rad."""
        return math.radians(sum(self.range) / 2.0)


@dataclasses.dataclass(frozen=True)
class LateralPair:
    """The two straight muscles that swing a leg forward (protractor, the flexor) and backward (retractor, the
    extensor).

    Both run from the section, in front of or behind the hip and perpendicular to the leg at rest, to a point on the
    coxa. Their rest lengths are the lengths at the middle of the joint's range.

    - `protractor` (N): greatest contractile force of the protractor.
    - `retractor` (N): greatest contractile force of the retractor.
    - `damping` (N s/m): damping k_SE of both muscles.
    - `shape`: k_CE of both; larger values flatten the force–length curve.
    - `base` (m): distance from the hip to their ends on the section.
    - `reach` (m): distance from the hip to their ends on the coxa.
    """

    protractor: float = 120.0
    retractor: float = 120.0
    damping: float = 40.0
    shape: float = 0.5
    base: float = 0.09
    reach: float = 0.06

    def __post_init__(self) -> None:
        _check_positive(self, "protractor", "retractor", "shape", "base", "reach")
        check_not_negative("LateralPair.damping", self.damping)


@dataclasses.dataclass(frozen=True)
class VerticalPair:
    """The two muscles that lift a leg (levator, the flexor) and press it down (depressor, the extensor).

    Both end on the femur. The depressor starts at the hip end of the coxa, and wraps from below around a cylinder about
    the joint's axis. The levator is straight, and starts at a point above the hip end of the coxa. Their rest lengths
    are the lengths at the middle of the joint's range.

    - `levator` (N): greatest contractile force of the levator.
    - `depressor` (N): greatest contractile force of the depressor.
    - `damping` (N s/m): damping k_SE of both muscles.
    - `shape`: k_CE of both; larger values flatten the force–length curve.
    - `radius` (m): radius of the cylinder.
    - `distance` (m): from the vertical joint to their ends on the femur.
    - `height` (m): height of the levator's origin above the hip end of the coxa.
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
        check_not_negative("VerticalPair.damping", self.damping)


@dataclasses.dataclass(frozen=True)
class Leg:
    """A pair of legs, left and right, which are mirror images of each other.

    - `coxa`: the bone at the hip.
    - `femur`: the next bone outwards.
    - `foot`: the last bone, which stands on the ground.
    - `lateral`: the joint between section and coxa, positive forward.
    - `vertical`: the joint between coxa and femur, positive up.
    - `ankle`: the joint between femur and foot, a passive spring.
    - `splay` (degrees): how far forward of straight sideways the leg points at rest.
    - `knee` (degrees): how far the foot is bent down from the femur's line, above 0 and at most 90.
    - `friction`: sliding friction of the foot on any ground.
    - `lateral_muscles`: the two muscles that swing the leg.
    - `vertical_muscles`: the two muscles that lift the leg and press it down.
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
        for name in ("splay", "knee"):
            check_finite(f"Leg.{name}", getattr(self, name))
        check(-60.0 <= self.splay <= 60.0, "Leg.splay", self.splay, "from -60 to 60 degrees")
        check(0.0 < self.knee <= 90.0, "Leg.knee", self.knee, "in (0, 90] degrees")
        check_positive("Leg.friction", self.friction)
        reach, coxa, femur = self.lateral_muscles.reach, self.coxa.length, self.femur.length
        check(reach <= coxa, "LateralPair.reach", reach, f"at most the coxa's length {coxa!r} (m)")
        radius, distance = self.vertical_muscles.radius, self.vertical_muscles.distance
        check(radius < coxa, "VerticalPair.radius", radius, f"below the coxa's length {coxa!r} (m)")
        allowed = f"between the capsule's radius {radius!r} and the femur's length {femur!r} (m)"
        check(radius < distance <= femur, "VerticalPair.distance", distance, allowed)


@dataclasses.dataclass(frozen=True)
class Section:
    """A box of the trunk with its two legs.

    - `length` (m): length of the section, along x.
    - `width` (m): width of the section, along y.
    - `height` (m): height of the section, along z.
    - `mass` (kg): mass of the section without its legs.
    - `leg`: its left and right leg.
    """

    length: float = 0.22
    width: float = 0.30
    height: float = 0.09
    mass: float = 1.5
    leg: Leg = Leg()

    def __post_init__(self) -> None:
        _check_positive(self, "length", "width", "height", "mass")
