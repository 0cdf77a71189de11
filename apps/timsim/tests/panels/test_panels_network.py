"""The panel of hidden layers: a real learner in a browser, and what its drawings say."""

import numpy as np
import pytest
from panel_studio import studio

import motorgrad as mg
from patience import PATIENCE, until
from timsim.live import Session, setup_of
from timsim.panels import _network as network
from timsim.panels._policy_diagrams import draw_layers

SMALL = {"policy.network": {"hidden": [40, 6]}, "policy.features": {"squares": True}}


@pytest.fixture(scope="module")
def learning():
    agent = mg.agent_for("hopper", SMALL)
    with Session(setup_of("hopper", agent, seed=3), speed=4.0) as session:
        assert until(lambda: session.snapshot().decision > 60)
        yield session


def test_activations_are_drawn_by_layer_with_the_marked_unit():
    layers = [np.linspace(-1, 2, 40), np.array([0.0, 3.0])]
    made = draw_layers(layers, (1, 1))
    assert "layer 1: 40 units, 14 at or below 0; largest 2.0" in made
    assert "layer 2: 2 units, 1 at or below 0; largest 3.0" in made
    assert made.count("<image") == 2
    assert "nan" not in made


@pytest.mark.slow
@pytest.mark.ci
def test_the_panel_shows_what_the_hidden_units_do_and_respond_to(learning, browser, tmp_path):
    with studio(learning) as place:
        panel = place.panels.panels["Network"]
        page = browser.new_page(viewport={"width": 700, "height": 1000})
        page.goto(place.url)
        page.get_by_role("tab", name="Network").click(timeout=1000 * PATIENCE)
        page.get_by_text("layer 1: 40 units").wait_for(timeout=1000 * PATIENCE)
        page.get_by_text("unit 1 of layer 2").wait_for(timeout=1000 * PATIENCE)
        panel._layer.value, panel._unit.value = "layer 1", 33
        panel.renew()
        page.get_by_text("unit 33 of layer 1").wait_for(timeout=1000 * PATIENCE)
        page.screenshot(path=str(tmp_path / "network.png"))
        numbers = panel.numbers()
        assert [len(column) for column in numbers.values()] == [46, 46, 46]
        assert np.ptp(numbers["activation"]) > 0
        page.close()


@pytest.mark.slow
def test_there_is_no_panel_without_hidden_layers(hopping):
    assert not network.NetworkPanel.applies(hopping)
