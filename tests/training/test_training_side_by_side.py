"""Many seeds of a body learn in several engines at once, and are what they would be in one."""

import threading
import time
from types import SimpleNamespace

import jax
import numpy as np
import pytest
from training_examples import assert_differ, assert_same, columns

import motorgrad as mg
from motorgrad._compiler import in_one_piece
from motorgrad.tasks import Hopper
from motorgrad.training import BodyStepper, SideBySide, agent_for, clear_programs
from motorgrad.training.engines._side_by_side import MAX_SEEDS_PER_ENGINE

SEEDS = [*range(20, 20 + MAX_SEEDS_PER_ENGINE), 3]  # one more than an engine takes
TASK = Hopper(time_limit=0.5)
AGENT = agent_for(TASK)


@pytest.fixture(scope="module")
def engine():
    """The one of this file, put back to its beginning by `begun`."""
    engine = SideBySide(TASK, AGENT, SEEDS, threads=2)
    return engine, engine.state


@pytest.fixture
def begun(engine):
    stepper, start = engine
    stepper.restore(start)
    return stepper


@pytest.mark.parametrize(("seeds", "shares"), [(1, [1]), (8, [8]), (9, [5, 4]), (24, [6] * 4), (65, [5] + [4] * 15)])
def test_shares_are_a_power_of_two_and_depend_on_nothing_but_the_number_of_seeds(monkeypatch, seeds, shares):
    made = []

    def engine(*given, room, envs):
        made.append(len(given[2]))
        return SimpleNamespace(cycle=None)

    monkeypatch.setattr("motorgrad.training.engines._side_by_side.BodyStepper", engine)
    for threads in (0, 1, 7):
        made.clear()
        SideBySide(TASK, AGENT, range(seeds), threads)
        assert made == shares


@pytest.mark.ci  # two and one: test_a_restored_engine_...
@pytest.mark.parametrize("threads", [1, 5])
def test_the_number_of_threads_changes_no_bit(begun, threads):
    other = SideBySide(TASK, AGENT, SEEDS, threads=threads)
    for _ in range(2):
        begun.advance(70)
        other.advance(70)
    assert_same(other.state, begun.state)


def test_seeds_keep_their_places_and_learn_as_in_one_engine(begun):
    whole = BodyStepper(TASK, AGENT, SEEDS, threads=1)
    np.testing.assert_array_equal(begun.control, whole.control)
    begun.advance(30)
    whole.advance(30)
    assert_differ(whole.policies(), jax.tree.map(lambda leaf: leaf[::-1], whole.policies()))
    for look in (lambda stepper: stepper.policies(), lambda stepper: stepper.harvest()):
        ours, theirs = look(begun), look(whole)
        assert jax.tree.structure(ours) == jax.tree.structure(theirs)
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-5), ours, theirs)


def test_a_restored_engine_goes_on_exactly_as_the_one_that_was_saved(begun):
    begun.advance(60)
    saved = begun.state
    assert saved["decision"] == begun.decision == 60
    begun.advance(60)
    fresh = SideBySide(TASK, AGENT, SEEDS, threads=1)
    fresh.restore(saved)
    assert_same(fresh.state, saved)
    fresh.advance(25)
    fresh.advance(35)
    assert_same(fresh.state, begun.state)


def test_a_state_of_other_seeds_is_refused(begun):
    few = {**begun.state, "physics": jax.tree.map(lambda leaf: leaf[:-1], begun.state["physics"])}
    with pytest.raises(ValueError, match="physics"):
        begun.restore(few)


def test_what_is_watched_and_used_is_each_seeds_own(begun):
    seen = begun.viewer(lambda cycle, state: (cycle.observation, state.position))
    begun.advance(20)
    observation, position = seen()
    np.testing.assert_array_equal(observation, begun.state["cycle"].observation)
    assert len(position) == len(SEEDS)
    assert len(np.unique(position, axis=0)) > 1
    numbers = np.arange(len(SEEDS), dtype=np.float32)
    marked = jax.tree.map(lambda leaf: leaf + numbers.reshape(-1, *[1] * (leaf.ndim - 1)), begun.policies())
    begun.set_policies(marked)
    assert_same(begun.policies(), marked)


def test_what_goes_wrong_in_one_engine_is_raised(begun, monkeypatch):
    def fail(decisions):
        raise RuntimeError("the muscles tore")

    monkeypatch.setattr(begun.engines[1], "advance", fail)
    with pytest.raises(RuntimeError, match="the muscles tore"):
        begun.advance(5)


@pytest.mark.ci
def test_no_two_engines_are_in_compiled_code_at_once(monkeypatch):
    busy, overlaps = threading.Lock(), []

    def watched(function):
        compiled = in_one_piece(function)

        def call(*given):
            alone = busy.acquire(blocking=False)
            overlaps.append(not alone)
            time.sleep(1e-3)
            result = compiled(*given)
            if alone:
                busy.release()
            return result

        return call

    clear_programs()  # so that this engine compiles its own
    monkeypatch.setattr("motorgrad.training.engines._host.in_one_piece", watched)
    SideBySide(TASK, AGENT, SEEDS, threads=2).advance(40)
    clear_programs()
    assert len(overlaps) > 80
    assert not any(overlaps)


@pytest.mark.ci
def test_a_run_of_many_seeds_goes_on_with_any_number_of_threads(tmp_path):
    options = {"seeds": SEEDS, "window": 40, "progress": False}
    whole = mg.train(TASK, AGENT, 120, **options, threads=1)
    mg.train(TASK, AGENT, 40, out=tmp_path / "parts", **options, threads=1)
    parts = mg.train(TASK, AGENT, 120, out=tmp_path / "parts", **options, threads=3)
    assert_same(parts.policies, whole.policies)
    assert_same(columns(parts.metrics), columns(whole.metrics))
