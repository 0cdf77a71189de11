"""A hexapod whose front, middle and rear legs differ, as an insect's do: other numbers of the same description."""

from motorgrad.bodies._hexapod import Hexapod
from motorgrad.bodies._hexapod_numbers import Drive, Hinge, LateralPair, Leg, Section, Segment, VerticalPair

_FRONT = Leg(
    coxa=Segment(0.05, 0.04, 0.014),
    femur=Segment(0.11, 0.07, 0.011),
    foot=Segment(0.15, 0.05, 0.011),
    vertical=Hinge((-25.0, 45.0)),
    splay=35.0,
    friction=0.4,
    lateral_muscles=LateralPair(protractor=100.0, retractor=80.0, base=0.08, reach=0.05),
    vertical_muscles=VerticalPair(levator=220.0, depressor=180.0, radius=0.04, distance=0.09, height=0.05),
)
_MIDDLE = Leg(friction=1.2)
_REAR = Leg(
    coxa=Segment(0.07, 0.08, 0.018),
    femur=Segment(0.18, 0.14, 0.014),
    foot=Segment(0.20, 0.08, 0.013),
    vertical=Hinge((-5.0, 60.0)),
    splay=-35.0,
    friction=1.6,
    lateral_muscles=LateralPair(protractor=120.0, retractor=180.0, base=0.10, reach=0.07),
    vertical_muscles=VerticalPair(levator=260.0, depressor=320.0, radius=0.05, distance=0.15, height=0.07),
)


def biomimetic_hexapod(drive: Drive = "muscles") -> Hexapod:
    """The hexapod of section 5.4.1 and figure 5.9 of the thesis, whose legs have different roles.

    The front legs are short, reach forward and have low friction, so that they do not interrupt the stride when they
    touch the ground early. The rear legs are long, point backward, are strong in pushing and have high friction, so
    that they do not slip; the middle legs are as on the plain hexapod, with a little more friction. The trunk widens to
    the rear. The thesis gives no numbers; these are our choice.

    **Arguments:** `drive`: "muscles" or "servos".
    """
    return Hexapod(
        front=Section(0.20, 0.20, 0.08, 1.0, _FRONT),
        middle=Section(0.22, 0.26, 0.09, 1.5, _MIDDLE),
        rear=Section(0.26, 0.28, 0.09, 1.8, _REAR),
        drive=drive,
    )
