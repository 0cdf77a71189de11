"""The numbers of a hexapod: by name, for all sections, and which are refused."""

import dataclasses

import pytest

from motorgrad import bodies
from motorgrad.bodies import Hexapod, Hinge, LateralPair, Leg, Section, Segment, biomimetic_hexapod
from motorgrad.schema import build, table


def test_settings_by_name_reach_every_number():
    assert build(Hexapod, table(biomimetic_hexapod())) == biomimetic_hexapod()
    slick = build(Hexapod, {"front": {"leg": {"friction": 0.3, "vertical": {"range": [-20, 50]}}}})
    leg = dataclasses.replace(Leg(), friction=0.3, vertical=Hinge((-20.0, 50.0)))
    assert slick == Hexapod(front=Section(leg=leg))
    with pytest.raises(ValueError, match="did you mean 'friction'"):
        build(Hexapod, {"front": {"leg": {"fricton": 0.3}}})


def test_a_change_to_all_sections_changes_all():
    wide = Hexapod().map_sections(lambda section: dataclasses.replace(section, width=0.4))
    assert [section.width for section in wide.sections.values()] == [0.4] * 3
    assert bodies.compile_model(wide).body("coxa_left_rear").pos[1] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Segment(0.0, 1.0, 0.01), r"length = 0.0: must be a finite number above 0, in m"),
        (lambda: Hinge((10.0, 20.0)), r"range = \(10.0, 20.0\)"),
        (lambda: Hinge((-10.0, 20.0), damping=-1.0), "damping = -1.0"),
        (lambda: LateralPair(protractor=-1.0), "protractor = -1.0"),
        (lambda: Leg(lateral_muscles=LateralPair(reach=0.1)), "lateral_muscles.reach = 0.1: must be at most the"),
        (lambda: Leg(coxa=Segment(0.04, 0.1, 0.01), lateral_muscles=LateralPair(reach=0.03)), "vertical_muscles.rad"),
        (lambda: Leg(femur=Segment(0.1, 0.1, 0.01)), "vertical_muscles.distance = 0.12: must be between"),
        (lambda: Leg(knee=120.0), r"knee = 120.0"),
        (lambda: Leg(splay=80.0), r"splay = 80.0"),
        (lambda: Section(width=0.0), "width = 0.0"),
        (lambda: Hexapod(spacing=0.2), "spacing = 0.2: must be at least 0.22 m"),
        (lambda: Hexapod(drive="servo"), "unknown drive 'servo': did you mean 'servos'"),
        (lambda: Hexapod(spine_axis="roll"), "unknown spine_axis"),
        (lambda: Hexapod(front=Section(leg=Leg(foot=Segment(0.03, 0.1, 0.01)))), "front.leg = 'standing at"),
    ],
)  # fmt: skip
def test_bad_numbers_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
