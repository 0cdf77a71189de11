"""The diagrams of the speed table: that the peer's is the same diagram, and that the rows say what was measured."""

import time

import numpy as np
import pytest

from timlab import Run, benchmarks


@pytest.mark.needs("motorgrad[peers]")
def test_the_peers_oscillators_move_as_ours():
    places = [f"place {n}.y" for n in range(3)]
    record = Run(benchmarks.oscillators(3), watch=places).advance(151)
    peer = benchmarks.PathSimOscillators(3)
    assert len(benchmarks.oscillators(3).nodes) == 15
    for ticks in (0, 1, 149):
        peer.advance(ticks)
    np.testing.assert_allclose(peer.positions(), [record[place][0, -1] for place in places], atol=1e-5)
    assert np.ptp(record[places[0]]) > 0.5


@pytest.mark.ci
def test_a_network_is_alive_and_of_few_types():
    diagram = benchmarks.network(100)
    record = Run(diagram, watch=[f"block {n}.y" for n in range(100)]).advance(50)
    assert np.mean([np.ptp(signal[0, 1:10]) > 0 for signal in record.signals.values()]) > 0.5
    assert all(np.isfinite(signal).all() for signal in record.signals.values())
    assert len({type(node.block) for node in diagram.nodes.values()}) == 3


@pytest.mark.ci
def test_stacking_keeps_the_program_small():
    run = Run(benchmarks.oscillators(100))
    assert len(run.plan.blocks) == 500
    assert len(run._stacks.batches) == 3  # integrators; springs and dampers; sums


def test_figures_are_of_our_work_without_the_peer(monkeypatch):
    found = benchmarks.discrete(10, 50, 1)
    assert found.unit == "ticks/s"
    assert found.ours > 0
    start = time.perf_counter()
    assert 0 < benchmarks.compiling(10, False).ours <= time.perf_counter() - start
    monkeypatch.setattr(benchmarks, "installed", lambda package: False)
    found = benchmarks.beside_peer(10, 50, 1, 1)
    assert (found.other, found.also) == (None, "PathSim is not installed: extra peers")
