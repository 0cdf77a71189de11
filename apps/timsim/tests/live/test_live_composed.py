"""Composed tasks and models with activation dynamics in a live run."""

import mujoco
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.training import stepper_for
from timsim import live
from timsim.live._bare_model import BareModel
from timsim.live._learner import Learner

TASK = mg.tasks.Composed(time_limit=0.1)
FEW_TERMS = mg.tasks.Composed(time_limit=0.1, observations=["joint-positions", "target-error"], rewards=["distance"])


@pytest.mark.ci  # test_live_worker.py has the same with a hopper, whose programs other tests use, too
def test_a_live_learner_is_the_learner_of_training_with_its_activations():
    units = mg.policies.initial("bounded-hyperplanes", FEW_TERMS, deviation=1.5)
    agent = mg.Agent(units, mg.learning.olgarb(0.4), mg.learning.SGD(1e-3))  # small, as its programs are compiled here
    setup = live.setup_of(FEW_TERMS, agent, seed=3)
    assert setup.name == "arm6"
    learner = Learner(setup)
    engine = stepper_for(FEW_TERMS, agent, [3], threads=1)
    about = learner.about()
    assert about.sizes.activation == 6
    assert about.actions == list(FEW_TERMS.action_names)
    for _ in range(8):  # over the end of an episode
        sample = learner.step()
        engine.advance(1)
    state = engine.batch.unpack(engine.batch.packed)
    np.testing.assert_array_equal(sample["position"], state.position)
    np.testing.assert_array_equal(sample["activation"], state.activation)
    np.testing.assert_array_equal(sample["control"], engine.control)
    assert (sample["activation"] > 0).any()
    *target, radius = sample["marks"][0]
    assert radius == np.float32(0.03)
    np.testing.assert_array_equal(target, engine.state["cycle"].memory.drawn["target"][0])
    before = learner.state
    learner.advance(3)
    after = learner.sample()["position"]
    learner.restore(before)
    learner.advance(3)
    np.testing.assert_array_equal(learner.sample()["position"], after)


@pytest.mark.ci
def test_a_stage_changes_the_surroundings_of_any_model():
    stage = live.Stage(timestep=0.001, gravity=(0, 0, -1.6), cameras={"far": live.Camera((0, -3, 1))})
    setup = live.setup_of(TASK, stage=stage)
    assert setup.model.opt.timestep == 0.001
    assert setup.task.substeps == 20
    learner = Learner(setup)
    learner.advance(7)
    assert np.isfinite(learner.sample()["position"]).all()


def test_a_model_opens_in_the_keyframe_of_its_body():
    text = mg.bodies.BUNDLED["arm6"].read_text().replace("</keyframe>", '<key name="bent" qpos=".1 2"/></keyframe>')
    for start, wanted in ((None, (0.6, 1.2)), ("bent", (0.1, 2.0))):
        model = BareModel(live.setup_of(mg.bodies.Mjcf(text, start)))
        np.testing.assert_array_equal(model.sample()["position"][0], wanted)
        model.advance(3)
        model.begin_again()
        np.testing.assert_array_equal(model.sample()["position"][0], wanted)
    assert model.about().muscles[0] == "shoulder flexor"
    assert isinstance(model.model, mujoco.MjModel)
