"""The experiments on the hexapod's body: each from end to end at its smoke size, and how claims are judged."""

import dataclasses
import importlib.util

import numpy as np
import pytest

from motorgrad._extras import install
from motorgrad.bodies import Hexapod, walk
from motorgrad.cli import main
from motorgrad_thesis import EXPERIMENTS, reproduce
from motorgrad_thesis._commands import reproduce as command
from motorgrad_thesis.chapter_5.extensions._body_space import (
    DIMENSION_LABELS,
    MEASURES,
    PAIRS,
    PITCH,
    SPACE,
    USUAL,
    VARIANTS,
    YAW,
    body_of,
    differences,
    jittered,
    random_bodies,
    usual_numbers,
    walk_in_batches,
    walk_measures,
    walk_variants,
)
from motorgrad_thesis.chapter_5.extensions.section_5_3_3_forces import Forces
from motorgrad_thesis.chapter_5.extensions.section_5_3_3_morphology import Morphology, morphology_claims

INSTALLED = importlib.util.find_spec("evosax") is not None
needs_evosax = pytest.mark.skipif(not INSTALLED, reason="needs the extra motorgrad[search]")
OTHERS = ("airborne", "belly", "net", "falls")
CLAIMED = {"sec-5.3.3-morphology": 13, "sec-5.3.3-forces": 5}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("sec-5.3.3-morphology", marks=needs_evosax),
        pytest.param("sec-5.3.3-forces", marks=pytest.mark.ci),
    ],
)
def test_each_leaves_a_figure_and_its_claims(name, tmp_path):
    found = reproduce(EXPERIMENTS[name].quick(), tmp_path, quick=True, progress=False)
    assert found.figure.read_text().startswith("<?xml")
    assert len(found.claims) == CLAIMED[name]
    assert "nan" not in " ".join(str(claim.measured) for claim in found.claims)


def test_the_usual_numbers_are_those_of_the_hexapod():
    assert body_of(usual_numbers()) == USUAL == Hexapod(drive="servos")
    assert SPACE.named(SPACE.start) == pytest.approx({**usual_numbers(), "axis": 0.5})
    assert tuple(DIMENSION_LABELS) == SPACE.names


def test_numbers_change_what_they_name():
    changed = {**usual_numbers(), "width": 0.4, "gap": 0.1, "femur": 0.2, "down": 25.0, "stiffness": 50.0, "axis": YAW}
    body = body_of(changed)
    assert body is not None
    leg = body.rear.leg
    assert body.front == body.middle == body.rear
    assert body.front.width == 0.4
    assert body.spacing == pytest.approx(0.32)
    assert (leg.femur.length, leg.femur.mass) == pytest.approx((0.2, 0.10 * 0.2 / 0.14))
    assert leg.vertical.range == (-25.0, 55.0)
    assert (body.spine.stiffness, body.spine_axis) == (50.0, "yaw")


def test_any_body_within_the_bounds_can_be_built_and_driven_by_muscles():
    places = np.concatenate([np.random.default_rng(0).random((40, SPACE.size)), np.zeros((1, SPACE.size))])
    bodies = [body_of(SPACE.named(each)) for each in [*places, np.ones(SPACE.size)]]
    assert all(body is not None and len(dataclasses.replace(body, drive="muscles").muscles) == 24 for body in bodies)


def test_a_body_that_cannot_be_is_no_error_but_has_no_speed():
    overlapping = {**usual_numbers(), "gap": -0.01}
    assert body_of(overlapping) is None
    found = walk_measures([usual_numbers(), overlapping, usual_numbers()], 3.0)
    alone = walk(USUAL, seconds=3.0).gait(since=1.0)
    for name in MEASURES:
        np.testing.assert_array_equal(np.isnan(found[name]), [False, True, False])
        assert found[name][0] == found[name][2]
    assert found["speed"][0] == alone.net[0]
    assert found["duty"][0] == alone.duty[0]
    assert 0 < found["tilt"][0] < 10
    assert np.isnan(walk_measures([overlapping], 3.0)["speed"]).all()


def test_copies_differ_by_little_and_keep_their_axis():
    copies = jittered({**usual_numbers(), "axis": YAW}, 50, np.random.default_rng(0))
    places = SPACE.places([list(each.values()) for each in copies])
    np.testing.assert_allclose(places.std(axis=0)[:-1], 1e-3, rtol=0.4)
    np.testing.assert_array_equal(places[:, -1], YAW)


def test_variants_differ_in_one_respect():
    usual = usual_numbers()
    made = {name: change(usual) for name, change in VARIANTS.items()}
    assert made["wide and heavy"] == {**usual, "width": pytest.approx(0.4), "mass": pytest.approx(2.25)}
    assert made["slim"] == {**usual, "width": pytest.approx(0.225)}
    assert (made["vertical"]["axis"], made["lateral"]["axis"]) == (PITCH, YAW)
    assert {each for pair in PAIRS.values() for each in pair} == set(VARIANTS)


@pytest.mark.ci
def test_bodies_are_observed_in_all_variants():
    bodies = random_bodies(1, np.random.default_rng(0))
    assert all(body_of(each) is not None for each in bodies)
    seen = walk_variants(bodies, 2.0, 0)
    assert set(seen) == {f"{variant} {measure}" for variant in VARIANTS for measure in MEASURES}
    wanted = walk_in_batches([VARIANTS["light"](each) for each in bodies], 2.0)
    np.testing.assert_array_equal(seen["light speed"], wanted["speed"])


def made_up(truth=1.0, seed=0):
    """Values of which every claim holds (`truth` 1) or none (−1)."""
    random = np.random.default_rng(seed)

    def noisy(value, *shape):
        return value + 0.01 * random.standard_normal(shape)

    values = {"usual": noisy(0.5, 6)}
    speeds = {"cma-es": 1.0, "boltzmann": 0.6, "uniform": 0.55} if truth > 0 else {"cma-es": 0.4, "boltzmann": 0.6}
    for kind in ("cma-es", "boltzmann", "uniform"):
        values[f"{kind} again"] = noisy(speeds.get(kind, 0.7), 5, 6)
    for bodies in ("usual", "chance"):
        for pair in PAIRS.values():
            for sign, variant in zip((truth, -truth), pair, strict=True):
                values[f"{bodies} {variant} speed"] = noisy(0.5 + 0.1 * sign, 20)
                values[f"{bodies} {variant} duty"] = noisy(0.5 + 0.1 * sign, 20)
                values[f"{bodies} {variant} tilt"] = noisy(2.0 - sign, 20)
    return values


def test_claims_on_bodies_follow_from_the_numbers():
    assert [claim.holds for claim in morphology_claims(made_up(1.0), 240)] == [True] * 13
    assert [claim.holds for claim in morphology_claims(made_up(-1.0), 240)] == [False] * 13


def test_walks_that_failed_are_left_out_of_pairs():
    values = made_up()
    before = differences(values, "usual", "base", "speed")
    values["usual slim and light speed"][3] = np.nan
    np.testing.assert_array_equal(differences(values, "usual", "base", "speed"), np.delete(before, 3))


def forces(speed, lateral, duty):
    """Values of five levels: speeds and contact of both ways."""
    noise = 0.01 * np.random.default_rng(0).standard_normal((5, 8))
    rows = {"all speed": speed, "lateral speed": lateral, "all duty": duty, "lateral duty": duty}
    values = {name: np.array(each)[:, None] + noise for name, each in rows.items()}
    air = {f"{way} {name}": np.full((5, 8), 0.1) for way in ("all", "lateral") for name in OTHERS}
    return {"levels": np.array([0.25, 0.5, 1, 2, 4]), **values, **air}


def test_claims_on_forces_follow_from_the_numbers():
    held = forces([0, 1, 2, 1.5, 1], [1, 2, 2, 1, 0.5], [0.6, 0.6, 0.5, 0.4, 0.3])
    failed = forces([0, 0.5, 1, 1.5, 2], [1, 2, 2, 2.5, 3], [0.3, 0.3, 0.4, 0.5, 0.6])
    assert [claim.holds for claim in Forces().claims(held)] == [True] * 5
    assert [claim.holds for claim in Forces().claims(failed)] == [False] * 5


def test_levels_multiply_the_forces():
    task = Forces().task(lateral=4.0, vertical=0.5)
    strengths = {each.name.split("_")[0]: each.strength for each in task.body.muscles}
    assert strengths == {"protractor": 480.0, "retractor": 480.0, "levator": 125.0, "depressor": 125.0}
    assert Forces().task(1.0, 1.0).body == Hexapod()


def test_without_evosax_the_search_is_refused_or_left_out_aloud(monkeypatch, tmp_path, capsys):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *more: None if name == "evosax" else found(name, *more)
    )
    others = {name: kind for name, kind in EXPERIMENTS.items() if name in ("sec-5.3.3-morphology", "fig-2.1")}
    monkeypatch.setattr(command, "EXPERIMENTS", others)
    needs = f"sec-5.3.3-morphology needs the package evosax: {install('search')}"
    assert main(["reproduce", "sec-5.3.3-morphology", "--quick", "--out", str(tmp_path)]) != 0
    assert capsys.readouterr().err.strip().endswith(needs)
    assert main(["reproduce", "all", "--quick", "--out", str(tmp_path)]) == 0
    assert f"skipped: {needs}" in capsys.readouterr().err
    assert (tmp_path / "fig-2.1" / "figure.svg").exists()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Morphology(evaluations=100), r"evaluations = 100: must be a multiple of batch = 12"),
        (lambda: Morphology(searches=1), r"searches = 1: must be an integer from 2 to 10,000"),
        (lambda: Morphology(seconds=1.5), r"seconds = 1.5: must be in \[2, 3600\], in simulated s"),
        (lambda: Forces(levels=(0.5, 2.0, 4.0)), r"levels = .*: must be some with 1 between the ends"),
        (lambda: Forces(seeds=1), r"seeds = 1: must be an integer from 2 to 10,000"),
        (lambda: Forces(watched=2.0), r"watched = 2.0: must be in \[3, 1e\+06\], in simulated s"),
    ],
)
def test_impossible_settings_are_refused_by_name(make, message):
    with pytest.raises(ValueError, match=message):
        make()
