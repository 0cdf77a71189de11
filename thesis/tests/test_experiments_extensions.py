"""The experiments of section 5.4.1: each from end to end at its smoke size, and how claims are judged."""

import dataclasses
import json

import numpy as np
import pytest

from motorgrad.policies import GradedHyperplanes, Hyperplanes, Primitives
from motorgrad_thesis import EXPERIMENTS, reproduce
from motorgrad_thesis.chapter_5.extensions.section_5_4_1_primitive import precondition
from motorgrad_thesis.chapter_5.extensions.section_5_4_1_stride import room_for_slopes

CLAIMED = {"sec-5.4.1-primitive": 6, "sec-5.4.1-stride": 5}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sec-5.4.1-primitive", "sec-5.4.1-stride"])
def test_each_leaves_a_figure_and_its_claims(name, tmp_path):
    found = reproduce(EXPERIMENTS[name].quick(), tmp_path, quick=True, progress=False)
    assert (found.folder / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert len(found.claims) == CLAIMED[name]
    assert json.loads((found.folder / "record.json").read_text())["settings"] == json.loads(
        json.dumps(dataclasses.asdict(EXPERIMENTS[name].quick()))
    )


def test_they_stand_in_the_order_of_the_source():
    around = ("sec-5.2.2", *CLAIMED, "fig-6.1")
    assert [name for name in EXPERIMENTS if name in around] == list(around)


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("sec-5.4.1-stride", {"seconds": 0.0}, "seconds = 0"),
        ("sec-5.4.1-stride", {"seeds": 1}, "seeds = 1"),
        ("sec-5.4.1-stride", {"starts": 1}, "starts = 1"),
        ("sec-5.4.1-stride", {"watched": 0.0}, "watched = 0"),
        ("sec-5.4.1-stride", {"periods": (0.3, 0.2)}, "periods = "),
        ("sec-5.4.1-stride", {"periods": (0.2, 3.0)}, "periods = "),
        ("sec-5.4.1-primitive", {"seconds": 0.1}, "seconds = 0.1"),
        ("sec-5.4.1-primitive", {"seeds": 1}, "seeds = 1"),
        ("sec-5.4.1-primitive", {"watched": -1.0}, "watched = -1"),
    ],
)
def test_impossible_settings_are_refused_by_name(name, setting, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[name](**setting)


def test_what_is_not_learned_has_no_step_size():
    primitive, stride = EXPERIMENTS["sec-5.4.1-primitive"](), EXPERIMENTS["sec-5.4.1-stride"]()
    rates = {kind: primitive.learner(kind).optimizer.learning_rate for kind in ("both", "precondition", "movement")}
    assert rates["both"] == primitive.task.learner["learning_rate"]
    when, how = "precondition.weights", "movement.bias"
    assert (rates["precondition"][how], rates["precondition"][when]) == (0.0, rates["both"][when])
    assert (rates["movement"][when], rates["movement"]["precondition.bias"]) == (0.0, 0.0)
    assert rates["movement"][how] == rates["both"][how] > 0
    constant, slope = (stride.learner(kind).optimizer.learning_rate for kind in ("constant", "slope"))
    assert constant["weights"] == 0.0 < slope["weights"]
    assert constant["bias"] == slope["bias"]


def strides(best, learned, adaptive, periods):
    """Made-up values: 8 starts of three clocks, the last that at the start; speeds and periods over three slopes."""
    noise = 0.01 * np.sin(np.arange(20))[:, None]
    fixed = np.stack([best, np.flip(best, -1) - 0.3, np.full(3, 1.0)])[:, None, :] + noise[:8]
    return {
        "grid": np.array([0.16, 0.2, 0.3]),
        "slopes": np.array([-10.0, 0.0, 10.0]),
        "fixed speed": fixed,
        "constant speed": learned + noise + np.zeros(3),
        "slope speed": adaptive + 2 * noise + np.zeros(3),
        "constant period": np.full((20, 3), 0.16),
        "slope period": periods + 0.1 * noise,
    }


def test_claims_about_strides_hold_and_fail_by_what_was_measured():
    kind = EXPERIMENTS["sec-5.4.1-stride"]()
    good = strides(np.array([4.0, 3.0, 1.0]), 2.6, 2.9, np.array([0.15, 0.16, 0.2]))
    assert [claim.holds for claim in kind.claims(good)] == [True] * 5
    bad = strides(np.array([4.0, 4.0, 4.0]), 0.9, 0.8, np.array([0.2, 0.16, 0.15]))
    assert [claim.holds for claim in kind.claims(bad)] == [False] * 5


def test_room_for_slopes_is_not_the_luck_of_the_best():
    """Clocks that differ by chance alone leave no room, however many there are."""
    random = np.random.default_rng(0)
    rooms = [room_for_slopes(random.normal(size=(30, 6, 5))).mean() for _ in range(200)]
    assert abs(np.mean(rooms)) < 3 * np.std(rooms) / np.sqrt(len(rooms))
    speed = np.array([[3.0, 1.0], [1.0, 3.0], [2.5, 2.5]])[:, None, :].repeat(4, 1)
    np.testing.assert_allclose(room_for_slopes(speed), 0.5)


def primitives_values(gained, ahead, own):
    noise = 0.01 * np.sin(np.arange(20))
    rising = np.linspace(0.5, 0.5 + gained, 60) + noise[:, None]
    return {
        **{f"{kind} curve": rising for kind in ("both", "precondition", "movement")},
        "both speed": 1.0 + ahead + noise,
        "precondition speed": 1.0 - noise,
        "movement speed": 1.0 + 2 * noise,
        **{f"{kind} sure": 1.0 + noise for kind in ("both", "precondition", "movement")},
        "own": np.tile([own, own], (20, 1)) + noise[:, None],
        "other": np.tile([-own, -own], (20, 1)),
    }


def test_claims_about_primitives_hold_and_fail_by_what_was_measured():
    kind = EXPERIMENTS["sec-5.4.1-primitive"]()
    assert [claim.holds for claim in kind.claims(primitives_values(0.5, 0.3, -1.0))] == [True] * 6
    assert [claim.holds for claim in kind.claims(primitives_values(-0.1, -0.3, 1.0))] == [False] * 6


def test_the_picture_of_a_precondition_is_its_probability():
    weights = np.zeros((2, 6))
    weights[0, [0, 4, 2]] = -2.0  # the first tripod's own legs
    policy = Primitives(Hyperplanes(weights, [0.5, 0.0]), GradedHyperplanes(np.zeros((4, 6)), np.zeros(4), np.zeros(4)))
    angles = np.array([-1.0, 0.0, 1.0])
    begins = precondition(policy, angles)
    np.testing.assert_allclose(begins[0], np.tile(1 / (1 + np.exp(6 * angles - 0.5)), (3, 1)), rtol=1e-5)
    np.testing.assert_allclose(begins[1], 0.5)
