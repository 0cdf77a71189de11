"""The hexapod's parts in numbers: segments, hinges, muscles, legs and sections."""

import dataclasses
import math
from typing import Literal

from motorgrad._errors import check
from motorgrad.schema import Range, Settings, inner, number, static

Drive = Literal["muscles", "servos"]


@dataclasses.dataclass(frozen=True)
class Segment(Settings):
    """A bone, drawn and simulated as a capsule."""

    length: float = number(low=0, open_low=True, unit="m", help="length of the bone, from joint to joint")
    mass: float = number(low=0, open_low=True, unit="kg", help="mass of the bone")
    radius: float = number(low=0, open_low=True, unit="m", help="radius of the capsule")


@dataclasses.dataclass(frozen=True)
class Hinge(Settings):
    """A hinge joint between stiff stops."""

    range: tuple[float, float] = static(
        allowed=Range(-90, 90, open_low=True, open_high=True),
        unit="degrees",
        help="least and greatest angle, with 0 in between",
    )
    stiffness: float = number(0.0, 0, unit="N m/rad", help="stiffness of a spring towards 0")
    damping: float = number(0.02, 0, unit="N m s/rad", help="damping of the joint")
    armature: float = number(0.003, 0, unit="kg m²", help="armature of the joint")

    def validate(self) -> None:
        least, greatest = self.range
        check(least <= 0 <= greatest and least < greatest, "range", self.range, "(least, greatest) with 0 in between")

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

    protractor: float = number(120.0, 0, open_low=True, unit="N", help="greatest contractile force of the protractor")
    retractor: float = number(120.0, 0, open_low=True, unit="N", help="greatest contractile force of the retractor")
    damping: float = number(40.0, 0, unit="N s/m", help="damping k_SE of both muscles")
    shape: float = number(0.5, 0, open_low=True, help="k_CE of both; larger values flatten the force–length curve")
    base: float = number(0.09, 0, open_low=True, unit="m", help="distance from the hip to their ends on the section")
    reach: float = number(0.06, 0, open_low=True, unit="m", help="distance from the hip to their ends on the coxa")


@dataclasses.dataclass(frozen=True)
class VerticalPair(Settings):
    """The two muscles that lift a leg (levator, the flexor) and press it down (depressor, the extensor).

    Both end on the femur. The depressor starts at the hip end of the coxa, and wraps from below around a cylinder about
    the joint's axis. The levator is straight, and starts at a point above the hip end of the coxa. Their rest lengths
    are the lengths at the middle of the joint's range.
    """

    levator: float = number(250.0, 0, open_low=True, unit="N", help="greatest contractile force of the levator")
    depressor: float = number(250.0, 0, open_low=True, unit="N", help="greatest contractile force of the depressor")
    damping: float = number(60.0, 0, unit="N s/m", help="damping k_SE of both muscles")
    shape: float = number(0.5, 0, open_low=True, help="k_CE of both; larger values flatten the force–length curve")
    radius: float = number(0.045, 0, open_low=True, unit="m", help="radius of the cylinder")
    distance: float = number(
        0.12, 0, open_low=True, unit="m", help="from the vertical joint to their ends on the femur"
    )
    height: float = number(
        0.06, 0, open_low=True, unit="m", help="height of the levator's origin above the hip end of the coxa"
    )


@dataclasses.dataclass(frozen=True)
class Leg(Settings):
    """A pair of legs, left and right, which are mirror images of each other."""

    coxa: Segment = inner(Segment(0.06, 0.06, 0.016), help="the bone at the hip")
    femur: Segment = inner(Segment(0.14, 0.10, 0.012), help="the next bone outwards")
    foot: Segment = inner(Segment(0.17, 0.06, 0.012), help="the last bone, which stands on the ground")
    lateral: Hinge = inner(Hinge((-30.0, 30.0)), help="the joint between section and coxa, positive forward")
    vertical: Hinge = inner(Hinge((-15.0, 55.0)), help="the joint between coxa and femur, positive up")
    ankle: Hinge = inner(
        Hinge((-3.5, 3.5), stiffness=30.0, damping=0.3), help="the joint between femur and foot, a passive spring"
    )
    splay: float = number(
        0.0, -60, 60, unit="degrees", help="how far forward of straight sideways the leg points at rest"
    )
    knee: float = number(
        80.0, 0, 90, open_low=True, unit="degrees", help="how far the foot is bent down from the femur's line"
    )
    friction: float = number(1.0, 0, open_low=True, help="sliding friction of the foot on any ground")
    lateral_muscles: LateralPair = inner(LateralPair(), help="the two muscles that swing the leg")
    vertical_muscles: VerticalPair = inner(VerticalPair(), help="the two muscles that lift the leg and press it down")

    def validate(self) -> None:
        reach, coxa, femur = self.lateral_muscles.reach, self.coxa.length, self.femur.length
        check(reach <= coxa, "lateral_muscles.reach", reach, f"at most the coxa's length {coxa!r} (m)")
        radius, distance = self.vertical_muscles.radius, self.vertical_muscles.distance
        check(radius < coxa, "vertical_muscles.radius", radius, f"below the coxa's length {coxa!r} (m)")
        allowed = f"between the capsule's radius {radius!r} and the femur's length {femur!r} (m)"
        check(radius < distance <= femur, "vertical_muscles.distance", distance, allowed)


@dataclasses.dataclass(frozen=True)
class Section(Settings):
    """A box of the trunk with its two legs."""

    length: float = number(0.22, 0, open_low=True, unit="m", help="length of the section, along x")
    width: float = number(0.30, 0, open_low=True, unit="m", help="width of the section, along y")
    height: float = number(0.09, 0, open_low=True, unit="m", help="height of the section, along z")
    mass: float = number(1.5, 0, open_low=True, unit="kg", help="mass of the section without its legs")
    leg: Leg = inner(Leg(), help="its left and right leg")
