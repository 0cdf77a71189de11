"""Diagrams: what they show is what they were given."""

import base64
import io
import re
import xml.etree.ElementTree as ElementTree

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

from motorgrad.bodies import debounced
from motorgrad.policies import (
    Autoregressive,
    BoundedHyperplanes,
    Factored,
    Hyperplanes,
    LocalGaussians,
    abilities,
    initial,
)
from timsim.panels import _charts
from timsim.panels._gait import FIRST, SECOND, draw_footfall
from timsim.panels._muscles import SECONDS, draw_raster
from timsim.panels._policy_diagrams import (
    GRID,
    MAX_ARROWS,
    NEGATIVE,
    POSITIVE,
    Field,
    draw_arrows,
    draw_portrait,
    limits_of,
    weights_of,
)


def parsed(document):
    """The elements of a diagram, which must be well-formed."""
    return ElementTree.fromstring(document)


def shapes(document, kind):
    return list(parsed(document).iter(kind))


def pixels(document):
    """The first picture in a diagram, and the box that it fills."""
    image = shapes(document, "image")[0]
    data = base64.b64decode(image.get("href").split(",")[1])
    return np.asarray(Image.open(io.BytesIO(data))), [float(image.get(k)) for k in ("x", "y", "width", "height")]


def words(document):
    return [element.text for element in shapes(document, "text")]


def test_a_chart_puts_its_limits_at_the_edges_of_its_box():
    chart = _charts.Chart((2.0, 4.0), (-1.0, 1.0), box=(10, 20, 110, 70))
    np.testing.assert_allclose(chart.x(np.array([2.0, 3.0, 4.0])), [10, 60, 110])
    np.testing.assert_allclose(chart.y(np.array([-1.0, 1.0])), [70, 20])


@pytest.mark.parametrize("limits", [(3.0, 3.0), (np.nan, 1.0), (np.inf, -np.inf), (2.0, 1.0)])
def test_a_chart_can_be_drawn_whatever_its_limits(limits):
    chart = _charts.Chart(limits, limits)
    chart.line(np.array([0.0, np.nan, 1.0]), np.zeros(3), "red")
    chart.dot(np.nan, 0.0, "red")
    made = _charts.document(100, 100, chart.elements(), "test")
    assert "nan" not in made.lower()
    assert "inf" not in made.lower()
    assert len(shapes(made, "polyline")[0].get("points").split()) == 2


def test_ticks_are_round_and_within():
    assert _charts.ticks(-0.13, 0.42, 5) == pytest.approx([0.0, 0.2, 0.4])
    assert all(1000 <= tick <= 1003 for tick in _charts.ticks(1000.0, 1003.0, 5))


def test_names_from_models_are_text():
    made = draw_arrows(np.ones((1, 1)), ["<script>alert(1)</script>"], ['"><b>'], np.array([0.5]))
    assert "<script>" not in made
    assert parsed(made) is not None


def test_a_raster_is_red_where_a_muscle_fires_and_empty_where_nobody_looked():
    period = 0.1
    seconds = np.concatenate([np.arange(5) * period, 2.5 + np.arange(15) * period])  # between them it was not watched
    level = np.zeros((20, 2))
    level[:5, 0] = 1.0
    level[-5:, 1] = 1.0
    made = draw_raster(seconds, level, ["upper", "lower"], period, seconds[-1])
    shown, _ = pixels(made)
    end = seconds[-1] + period

    def at(second):
        return int((second - (end - SECONDS)) / SECONDS * shown.shape[1])

    assert shown[0, at(0.25), 3] == 255
    assert shown[0, at(0.25), 0] > 150 > shown[0, at(0.25), 1]
    assert shown[1, at(0.25), 3] < 60
    assert shown[:, at(1.5), 3].max() == 0
    assert shown[1, at(end - 0.2), 3] == 255
    assert shown[0, at(end - 0.2), 3] < 60
    assert words(made)[-3:-1] != []
    assert {"upper", "lower"} <= set(words(made))


@pytest.mark.parametrize("count", [1, 24, 90])
def test_a_raster_has_room_for_any_number_of_muscles(count):
    made = draw_raster(np.arange(50) / 25, np.ones((50, count)), [f"muscle {k}" for k in range(count)], 0.04, 2.0)
    _, box = pixels(made)
    assert box[3] <= 230
    assert draw_raster(np.zeros(0), np.zeros((0, count)), ["a"] * count, 0.04, 0.0)


def test_arrows_tell_sign_and_size():
    weights = np.array([[1.0, -2.0], [0.5, 4.0]])
    made = draw_arrows(weights, ["a", "bias"], ["x", "y"], np.array([0.25, 1.0]))
    arrows = shapes(made, "polygon")
    assert [arrow.get("fill") for arrow in arrows] == [POSITIVE, POSITIVE, NEGATIVE, POSITIVE]

    def width(arrow):
        points = np.array([pair.split(",") for pair in arrow.get("points").split()], float)
        return np.hypot(*(points[0] - points[-1]))

    widths = np.array([width(arrow) for arrow in arrows])  # from the weakest to the strongest
    slopes = np.diff(widths) / np.diff([0.5, 1, 2, 4])
    np.testing.assert_allclose(slopes, slopes.mean(), rtol=0.1)  # places are rounded to a tenth
    assert {"0.50", "1.0", "−2.0", "4.0", "bias"} <= set(words(made))


def test_of_very_many_weights_the_strongest_are_shown():
    weights = np.random.default_rng(0).normal(size=(24, 21))
    made = draw_arrows(weights, [f"s{k}" for k in range(21)], [f"u{k}" for k in range(24)], np.full(24, 0.5))
    assert len(shapes(made, "polygon")) == MAX_ARROWS
    assert any(f"the {MAX_ARROWS} strongest of 504" in word for word in words(made))
    assert "nan" not in draw_arrows(np.zeros((1, 2)), ["a", "b"], ["c"], np.array([np.nan]))


def test_weights_are_found_in_pools_that_have_them():
    one = Hyperplanes(np.arange(6.0).reshape(2, 3), np.array([7.0, 8.0]))
    np.testing.assert_allclose(weights_of(one), [[0, 1, 2, 7], [3, 4, 5, 8]])
    np.testing.assert_allclose(weights_of(Factored([one, one]))[2:], weights_of(one))
    assert weights_of(LocalGaussians(np.zeros((1, 2)), np.zeros((1, 2)), np.ones(1))) is None
    assert weights_of(BoundedHyperplanes([[0.5, -1.0]], [0.2], [-1.0])) is None


@pytest.mark.parametrize(
    ("kind", "inputs", "settings"),
    [
        ("layered", 2, {"units": 2, "hidden": (2,)}),  # of equal shapes
        pytest.param("layered", 2, {"units": 1, "output": "softmax"}, marks=pytest.mark.ci),
        pytest.param("finite-state-controller", 3, {"units": 2, "output": "softmax"}, marks=pytest.mark.ci),
        pytest.param("recurrent", 3, {"units": 2}, marks=pytest.mark.ci),
    ],
)
def test_weights_of_units_that_see_more_than_the_observation_are_not_taken_for_its(kind, inputs, settings):
    assert weights_of(initial(kind, inputs, **settings)(jax.random.key(0))) is None


def test_the_background_of_a_portrait_is_the_policys_probability():
    policy = Hyperplanes(np.array([[1.0, -2.0, 0.5], [0.0, 3.0, 1.0]]), np.array([0.1, -0.2]))
    seen, limits = np.array([0.3, 9.0, 9.0]), np.array([[-1.0, 1.0], [-2.0, 2.0]])
    field = Field().over(policy, np.zeros(0), seen, 2, 1, limits)
    for row, column in ((0, 0), (5, 30), (GRID - 1, GRID - 1)):
        y, x = -2 + 4 * row / (GRID - 1), -1 + 2 * column / (GRID - 1)
        expected = policy.prob(np.float32([0.3, y, x]))
        np.testing.assert_allclose(field[row, column], expected, atol=1e-5)


@pytest.mark.ci
def test_the_background_keeps_the_memory_and_leaves_out_noise_that_lasts():
    recurrent = jax.jit(initial("recurrent", 2, units=1, hidden=3))(jax.random.key(0))
    weights = np.array([[0.4, -0.6, 1.0, -1.0, 0.5]])
    recurrent = eqx.tree_at(lambda policy: policy.output.weights, recurrent, jnp.asarray(weights, jnp.float32))
    controller = jax.jit(initial("finite-state-controller", 2, units=2, states=2))(jax.random.key(0))
    plain = BoundedHyperplanes([[0.5, -1.0]], [0.2], [-1.0])
    memory, limits = np.random.default_rng(0).normal(size=recurrent.inputs - 2), np.array([[-1.0, 1.0], [-2.0, 2.0]])
    low = np.float32([-1, -2])
    for policy, kept, expected in (
        (
            recurrent,
            memory,
            jax.jit(lambda: recurrent.prob(abilities.observation_with_memory(recurrent, np.float32(memory), low)))(),
        ),
        (controller, np.array([0.0, 1.0]), jax.jit(lambda: controller.prob(np.float32([*low, 0, 1])))()),
        (Autoregressive(plain, 0.9), np.array([0.7]), jax.jit(lambda: plain.prob(low))()),
    ):
        field = Field().over(policy, kept, np.zeros(2), 0, 1, limits)
        np.testing.assert_allclose(field[0, 0], expected, atol=1e-5)
    hidden = Field(lambda policy, seen: abilities.hidden_activations(policy, seen)[0])
    found = hidden.over(recurrent, memory, np.zeros(2), 0, 1, limits)
    assert np.ptp(found, axis=(0, 1)).min() > 0.1  # a recurrent unit responds to the observation at once


def test_a_portrait_is_upright():
    path = np.random.default_rng(1).uniform(-1, 1, (200, 2))
    limits = limits_of(path)
    assert (limits[:, 0] < np.percentile(path, 1, axis=0)).all()
    chance = np.zeros((GRID, GRID))
    chance[-1] = 1.0  # certain where the second observation is greatest
    made = draw_portrait(path, chance, limits, ("angle", "velocity"), "probability that flexor fires")
    shown, _ = pixels(made)
    assert shown[0].mean() < shown[-1].mean() == 255  # the first row is the upper one, and coloured
    assert {"angle", "velocity", "1   probability that flexor fires"} <= set(words(made))
    assert draw_portrait(path, None, limits, ("a", "b"), "c")
    noted = draw_portrait(path, chance, limits, ("a", "b"), "c", note="the memory as now")
    assert "the memory as now" in words(noted)


def test_a_footfall_has_a_bar_for_every_stance():
    seconds = 1.0 + np.arange(100) * 0.02
    contact = np.zeros((100, 2), bool)
    contact[10:20, 0] = contact[50:90, 0] = contact[60:, 1] = True
    made = draw_footfall(seconds, contact, ["left", "right"], [True, False], 0.02, seconds[-1])
    bars = [bar for bar in shapes(made, "rect") if bar.get("fill") in (FIRST, SECOND)]
    assert [bar.get("fill") for bar in bars] == [FIRST, FIRST, SECOND]
    lengths = np.array([float(bar.get("width")) for bar in bars])
    np.testing.assert_allclose(lengths / lengths[0], [1, 4, 4], rtol=0.02)
    right = float(bars[2].get("x")) + float(bars[2].get("width"))
    assert right == pytest.approx(_charts.WIDTH - 8, abs=0.2)  # it stands there now


def test_a_footfall_does_not_bridge_what_was_not_seen():
    seconds = np.concatenate([np.arange(10) * 0.02, 2 + np.arange(10) * 0.02])
    made = draw_footfall(seconds, np.ones((20, 1), bool), ["left"], [True], 0.02, seconds[-1])
    assert len([bar for bar in shapes(made, "rect") if bar.get("fill") == FIRST]) == 2
    assert draw_footfall(np.zeros(0), debounced(np.zeros((0, 1), bool), 0.02), ["left"], [True], 0.02, 0.0)
    assert re.search("now", made)
