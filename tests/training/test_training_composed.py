"""Composed tasks in the engines: chosen starts, resume, sweeps, evaluation."""

import dataclasses

import jax
import numpy as np
import pytest
from training_examples import assert_differ, assert_same

import motorgrad as mg
from motorgrad._random import draw_block, key_of
from motorgrad.tasks import Composed
from motorgrad.training import RunDirectoryError, agent_for, stepper_for, training_stepper_for

TASK = dataclasses.replace(Composed(), time_limit=0.1, actions="binary")  # five decisions
LIGHT = {"estimator": "olgarb", "metric": None, "averaging": None}  # a learner that is compiled quickly


@pytest.mark.ci
def test_every_episode_of_every_seed_begins_where_the_task_says():
    engine = stepper_for(TASK, agent_for(TASK, LIGHT), [3, 7], threads=1)
    seen = []
    for _ in range(11):
        seen.append(engine.batch.packed.copy())
        engine.advance(1)
    uniforms = [
        np.array([jax.random.uniform(key_of(seed, "start-memory"), (TASK.init_uniforms,)) for seed in (3, 7)]),
        *(np.array(draw_block(np.array([3, 7]), "memory", 0, TASK.init_uniforms))[decision].T for decision in (5, 10)),
    ]
    for decision, numbers in zip((0, 5, 10), uniforms, strict=True):
        start = TASK.begin(numbers)
        np.testing.assert_array_equal(seen[decision][:, :2], start["position"].astype(np.float32))
        assert not seen[decision][:, 2:4].any()
    assert len({tuple(row) for decision in (0, 5, 10) for row in seen[decision][:, :2]}) == 6
    targets = np.array([TASK.init(u).drawn["target"] for u in uniforms[2]])
    view = engine.viewer(lambda cycle, state: cycle.memory.drawn["target"])
    np.testing.assert_array_equal(view(), targets)


@pytest.mark.ci
def test_a_restored_engine_goes_on_with_the_same_starts_and_targets():
    saved, fresh = (stepper_for(TASK, agent_for(TASK, LIGHT), [3, 7], threads=1) for _ in range(2))
    saved.advance(12)
    state = saved.state
    assert_same(state["cycle"].elapsed, np.array([2, 2]))
    fresh.advance(4)
    fresh.restore(state)
    for each in (saved, fresh):
        each.advance(21)
    assert_same(fresh.state, saved.state)
    assert_differ(saved.state["cycle"].memory, state["cycle"].memory)


@pytest.mark.ci
def test_a_run_resumes_bit_for_bit_and_stands_alone(tmp_path):
    body = dataclasses.replace(TASK, body=mg.bodies.Mjcf(mg.bodies.BUNDLED["arm6"].read_text()))
    settings = {"seeds": 2, "progress": False, "window": 10}
    whole = mg.train(body, LIGHT, steps=60, **settings)
    mg.train(body, LIGHT, steps=23, out=tmp_path / "run", **settings)
    again = mg.resume(tmp_path / "run", steps=60, progress=False)
    for one, two in zip(jax.tree.leaves(whole.policies), jax.tree.leaves(again.policies), strict=True):
        np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(whole.curve("distance")[1][:, -1], again.curve("distance")[1][:, -1])
    loaded = mg.load(tmp_path / "run")
    assert loaded.task == body
    found = mg.evaluate(loaded, 12)
    assert found.metrics["distance"].shape == (2,)
    assert found.position.shape == (2, 12, 2)
    assert found.control.shape == (2, 12, 6)
    assert found.activation.shape == (2, 12, 6)
    assert found.marks.shape == (2, 12, 1, 4)
    limit, steps = body.episode_limit, np.abs(np.diff(found.marks[:, :, 0, :3], axis=1)).max(axis=2) > 0
    jumps = np.arange(1, 12) % limit == 0
    np.testing.assert_array_equal(steps, np.tile(jumps, (2, 1)))  # with the first state of an episode, not before


@pytest.mark.ci
def test_a_run_does_not_continue_with_another_model(tmp_path):
    model = tmp_path / "arm.xml"
    model.write_bytes(mg.bodies.BUNDLED["arm6"].read_bytes())
    made = dataclasses.replace(TASK, body=mg.bodies.Mjcf(model))
    mg.train(made, LIGHT, steps=5, out=tmp_path / "run", progress=False)
    model.write_text(model.read_text().replace('mass="1.2"', 'mass="1.3"'))
    with pytest.raises(ValueError, match=r"arm.xml.*not what it was"):
        mg.resume(tmp_path / "run", steps=10, progress=False)
    changed = dataclasses.replace(TASK, body=mg.bodies.Mjcf(model))
    with pytest.raises(RunDirectoryError, match=r"task.body.checksum was"):
        mg.train(changed, LIGHT, steps=10, out=tmp_path / "run", progress=False)


@pytest.mark.ci
def test_sweeps_have_the_same_episodes_under_every_setting():
    swept = mg.train(TASK, LIGHT, steps=10, seeds=2, sweep={"optimizer.learning_rate": [0.0, 1e-12]}, progress=False)
    one, two = swept.split()
    np.testing.assert_array_equal(one.curve("distance")[1], two.curve("distance")[1])


@pytest.mark.ci
def test_seeds_side_by_side_are_each_their_own():
    engine = training_stepper_for(TASK, agent_for(TASK, LIGHT), range(10), threads=2)
    engine.advance(6)
    view = engine.viewer(lambda cycle, state: cycle.memory.drawn["target"])
    assert len(np.unique(view(), axis=0)) == 10
