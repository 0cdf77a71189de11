"""The hexapod's parts in numbers: segments, hinges, muscles, legs and sections."""

import dataclasses
import math
from typing import Literal

from motorgrad._errors import check, check_finite, check_not_negative, check_positive
from motorgrad.schema import Settings, number, static

Drive = Literal["muscles", "servos"]


def _check_positive(numbers: object, *names: str) -> None:
    for name in names:
        check_positive(f"{type(numbers).__name__}.{name}", getattr(numbers, name))


@dataclasses.dataclass(frozen=True)
class Segment(Settings):
    """A bone, drawn and simulated as a capsule."""

    length: float = number(unit="m", help="length of the bone, from joint to joint")
    mass: float = number(unit="kg", help="mass of the bone")
    radius: float = number(unit="m", help="radius of the capsule")

    def __post_init__(self) -> None:
        _check_positive(self, "length", "mass", "radius")


@dataclasses.dataclass(frozen=True)
class Hinge(Settings):
    """A hinge joint between stiff stops."""

    range: tuple[float, float] = static(unit="degrees", help="least and greatest angle, with 0 in between")
    stiffness: float = number(0.0, unit="N m/rad", help="stiffness of a spring towards 0")
    damping: float = number(0.02, unit="N m s/rad", help="damping of the joint")
    armature: float = number(0.003, unit="kg m²", help="armature of the joint")

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
class LateralPair(Settings):
    """The two straight muscles that swing a leg forward (protractor, the flexor) and backward (retractor, the
    extensor).

    Both run from the section, in front of or behind the hip and perpendicular to the leg at rest, to a point on the
    coxa. Their rest lengths are the lengths at the middle of the joint's range.
    """

    protractor: float = number(120.0, unit="N", help="greatest contractile force of the protractor")
    retractor: float = number(120.0, unit="N", help="greatest contractile force of the retractor")
    damping: float = number(40.0, unit="N s/m", help="damping k_SE of both muscles")
    shape: float = number(0.5, help="k_CE of both; larger values flatten the force–length curve")
    base: float = number(0.09, unit="m", help="distance from the hip to their ends on the section")
    reach: float = number(0.06, unit="m", help="distance from the hip to their ends on the coxa")

    def __post_init__(self) -> None:
        _check_positive(self, "protractor", "retractor", "shape", "base", "reach")
        check_not_negative("LateralPair.damping", self.damping)


@dataclasses.dataclass(frozen=True)
class VerticalPair(Settings):
    """The two muscles that lift a leg (levator, the flexor) and press it down (depressor, the extensor).

    Both end on the femur. The depressor starts at the hip end of the coxa, and wraps from below around a cylinder about
    the joint's axis. The levator is straight, and starts at a point above the hip end of the coxa. Their rest lengths
    are the lengths at the middle of the joint's range.
    """

    levator: float = number(250.0, unit="N", help="greatest contractile force of the levator")
    depressor: float = number(250.0, unit="N", help="greatest contractile force of the depressor")
    damping: float = number(60.0, unit="N s/m", help="damping k_SE of both muscles")
    shape: float = number(0.5, help="k_CE of both; larger values flatten the force–length curve")
    radius: float = number(0.045, unit="m", help="radius of the cylinder")
    distance: float = number(0.12, unit="m", help="from the vertical joint to their ends on the femur")
    height: float = number(0.06, unit="m", help="height of the levator's origin above the hip end of the coxa")

    def __post_init__(self) -> None:
        _check_positive(self, "levator", "depressor", "shape", "radius", "distance", "height")
        check_not_negative("VerticalPair.damping", self.damping)


@dataclasses.dataclass(frozen=True)
class Leg(Settings):
    """A pair of legs, left and right, which are mirror images of each other."""

    coxa: Segment = static(Segment(0.06, 0.06, 0.016), help="the bone at the hip")
    femur: Segment = static(Segment(0.14, 0.10, 0.012), help="the next bone outwards")
    foot: Segment = static(Segment(0.17, 0.06, 0.012), help="the last bone, which stands on the ground")
    lateral: Hinge = static(Hinge((-30.0, 30.0)), help="the joint between section and coxa, positive forward")
    vertical: Hinge = static(Hinge((-15.0, 55.0)), help="the joint between coxa and femur, positive up")
    ankle: Hinge = static(
        Hinge((-3.5, 3.5), stiffness=30.0, damping=0.3), help="the joint between femur and foot, a passive spring"
    )
    splay: float = number(0.0, unit="degrees", help="how far forward of straight sideways the leg points at rest")
    knee: float = number(
        80.0, unit="degrees", help="how far the foot is bent down from the femur's line, above 0 and at most 90"
    )
    friction: float = number(1.0, help="sliding friction of the foot on any ground")
    lateral_muscles: LateralPair = static(LateralPair(), help="the two muscles that swing the leg")
    vertical_muscles: VerticalPair = static(VerticalPair(), help="the two muscles that lift the leg and press it down")

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
class Section(Settings):
    """A box of the trunk with its two legs."""

    length: float = number(0.22, unit="m", help="length of the section, along x")
    width: float = number(0.30, unit="m", help="width of the section, along y")
    height: float = number(0.09, unit="m", help="height of the section, along z")
    mass: float = number(1.5, unit="kg", help="mass of the section without its legs")
    leg: Leg = static(Leg(), help="its left and right leg")

    def __post_init__(self) -> None:
        _check_positive(self, "length", "width", "height", "mass")
