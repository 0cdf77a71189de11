"""The tabs Policy and Network, with policies that draw with hidden units, that remember, or whose noise lasts."""

import csv
import io

import numpy as np
import pytest
import viser
from test_panels_drawings import words

import motorgrad as mg
from patience import until
from timsim.live import Session, setup_of
from timsim.panels import Panels
from timsim.panels._panel import csv_of
from timsim.scene import Pose

LEARNERS = {
    "layered": lambda: setup_of("parity"),
    "controller": lambda: setup_of("load-unload"),
    "recurrent": lambda: setup_of("hopper", mg.agent_for("hopper", policy={"kind": "recurrent", "hidden": 4})),
    "lasting-noise": lambda: setup_of("composed", mg.presets.ppo_short_horizon("composed", 1000)),
}
PORTRAITS = {
    "layered": ("probability that", None),
    "controller": ("probability of", "the other observations and the memory as now"),
    "recurrent": ("probability that", "the other observations and the memory as now"),
    "lasting-noise": ("mean activation of", "the other observations as now"),
}
"""What the portrait of each says of its colours, and of what is fixed."""
LAYERS = {"layered": [16], "controller": [4], "recurrent": [4]}


@pytest.mark.ci
def test_the_policy_on_the_page_has_the_running_statistics_of_its_observations():
    network = {"kind": "hyperplanes", "network": {"hidden": [4], "standardise": True}}
    with Session(setup_of("hopper", mg.agent_for("hopper", policy=network)), speed=20.0) as session:
        assert until(lambda: session.snapshot().decision >= 30)
        snapshot = session.snapshot()
        policy = session.policy(snapshot)
        assert policy is not None
        assert np.abs(snapshot.fixed).max() > 0
        found = policy.prob(np.asarray(snapshot.observation[0], np.float32))
        np.testing.assert_allclose(found, snapshot.probability[0], atol=1e-5)
        assert policy.module.layers[0].count >= 30


@pytest.mark.ci
@pytest.mark.parametrize("name", LEARNERS)
def test_every_tab_fills_and_follows_the_run(name):
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        with Session(LEARNERS[name](), speed=20.0) as session:
            panels, pose = Panels(), Pose(session.model)
            panels.build(server, session)
            policy, network = panels.panels["Policy"], panels.panels["Network"]
            drawn = []
            for decision in (30, 60):
                assert until(lambda decision=decision: session.snapshot().decision >= decision)
                snapshot = session.snapshot()
                for panel in (policy, network):
                    panel.show(snapshot, pose)
                drawn.append(policy._portrait.content)
            assert policy._arrows is None
            assert drawn[0] != drawn[1]
            said, fixed = words(drawn[1]), PORTRAITS[name][1]
            assert any(PORTRAITS[name][0] in each for each in said)
            assert [each for each in said if each.endswith(" as now")] == ([] if fixed is None else [fixed])
            for portrait in (policy._portrait, network._portrait):
                assert "<image" in portrait.content
            units = network.numbers()
            assert name not in LAYERS or np.bincount(units["layer"])[1:].tolist() == LAYERS[name]
            for numbers in (units, policy.numbers()):
                rows = list(csv.reader(io.StringIO(csv_of(numbers).decode())))
                assert len({len(row) for row in rows}) == 1
                assert "" not in rows[-1]
    finally:
        server.stop()
