"""A simulation that breaks while its learner learns: its sample is lost, it begins anew, and nobody else notices."""

import jax
import numpy as np
import pytest
from training_examples import assert_same, learner

from motorgrad.learning import Exponential
from motorgrad.training import BodyStepper, evaluate, train
from motorgrad.training.store import RunWarning

SEEDS, HURT, OTHERS = [5, 2, 9], 1, [0, 2]
BEFORE = 140  # beyond a block of random numbers
BROKEN = {"position": np.nan, "velocity": 1e12}


def break_body(stepper, kind):
    """Put an impossible number into one seed's physics, whose rows begin with time, positions and velocities."""
    physics = stepper.batch.snapshot()
    model = stepper.batch.model
    physics["state"][HURT, 1 if kind == "position" else 1 + model.nq] = BROKEN[kind]
    stepper.batch.restore(physics)


def rows(tree, which):
    return jax.tree.map(lambda leaf: leaf[which], tree)


@pytest.fixture(scope="module", params=BROKEN)
def broken(request):
    """A healthy stepper and one whose second seed is broken after some decisions, with the state at that moment."""
    healthy, hurt = learner("hopper", SEEDS), learner("hopper", SEEDS)
    for stepper in (healthy, hurt):
        stepper.advance(BEFORE)
    at = hurt.state
    break_body(hurt, request.param)
    for stepper in (healthy, hurt):
        stepper.advance(1)
    return healthy, hurt, at, healthy.state, hurt.state


def seeds_of(state, which):
    return rows({name: part for name, part in state.items() if name != "decision"}, which)


@pytest.mark.representatives("position")
def test_the_other_seeds_are_the_same_to_the_last_bit(broken):
    healthy, hurt, _, well, after = broken
    assert_same(seeds_of(after, OTHERS), seeds_of(well, OTHERS))
    later = healthy.state, hurt.state
    healthy.advance(200)
    hurt.advance(200)
    assert_same(seeds_of(hurt.state, OTHERS), seeds_of(healthy.state, OTHERS))
    for stepper, state in zip((healthy, hurt), later, strict=True):
        stepper.restore(state)


def test_the_sample_is_dropped(broken):
    _, _, at, well, after = broken
    for part in (lambda agent: agent.policy, lambda agent: agent.estimator.baseline, lambda agent: agent.chain):
        assert_same(rows(part(after["cycle"].agent), HURT), rows(part(at["cycle"].agent), HURT))
    counts = [state["cycle"].agent.estimator.baseline.count[HURT] for state in (at, well, after)]
    assert counts == [BEFORE, BEFORE + 1, BEFORE]


def test_the_reward_is_dropped(broken):
    _, _, at, _, after = broken
    assert after["cycle"].tally.sums[HURT, 0] == at["cycle"].tally.sums[HURT, 0]


def test_the_trace_begins_anew_with_the_first_action_of_the_new_life(broken):
    _, hurt, _, _, after = broken
    cycle = rows(after["cycle"], HURT)
    policy = jax.tree.map(jax.numpy.asarray, cycle.agent.policy)
    wanted = policy.score(cycle.observation, cycle.action)  # an exponential trace is the single score that it has seen
    assert isinstance(hurt.cycle.agent.estimator.trace, Exponential)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-6), cycle.agent.estimator.trace, wanted)
    np.testing.assert_array_equal(after["action"][HURT, :-1], cycle.action)


def test_memory_and_observation_are_those_of_a_fresh_start(broken):
    _, _, _, _, after = broken
    fresh = learner("hopper", SEEDS).state
    for part in ("memory", "observation"):
        assert_same(rows(getattr(after["cycle"], part), HURT), rows(getattr(fresh["cycle"], part), HURT))
    np.testing.assert_array_equal(after["physics"]["packed"][HURT], fresh["physics"]["packed"][HURT])


def test_divergences_are_counted(broken):
    _, hurt, _, _, after = broken
    record = hurt.harvest()
    hurt.restore(after)
    np.testing.assert_array_equal(record["diverged"], [0, 1, 0])
    assert "episodes" not in record  # the task has none
    np.testing.assert_array_equal(after["physics"]["diverged"], [0, 1, 0])


LEARNERS = [
    {"optimizer": "adam"},
    pytest.param({"estimator": "gpomdp", "improve": 50}, marks=pytest.mark.slow),
    pytest.param({"trace": "window"}, marks=pytest.mark.slow),
]


@pytest.mark.ci
@pytest.mark.parametrize("changes", LEARNERS)
def test_no_kind_of_learner_takes_anything_from_a_broken_decision(changes):
    stepper = learner("hopper", SEEDS, **changes)
    stepper.advance(30)
    before = rows(stepper.state["cycle"].agent, HURT)
    break_body(stepper, "position")
    stepper.advance(1)
    after = rows(stepper.state["cycle"].agent, HURT)
    for part in ("policy", "gradient", "chain"):
        assert_same(getattr(after, part), getattr(before, part))
    assert_same(after.estimator.baseline, before.estimator.baseline)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(stepper.state["cycle"].agent))


class Breaking(BodyStepper):
    """An engine whose second seed breaks once on the way."""

    def advance(self, decisions):
        for _ in range(decisions):
            if self.decision == 25:
                break_body(self, "velocity")
            super().advance(1)


def test_the_metrics_of_a_run_tell_of_divergences(monkeypatch):
    monkeypatch.setattr("motorgrad.training.engines.BodyStepper", Breaking)
    run = train("hopper", steps=60, seeds=SEEDS, window=20, progress=False)
    np.testing.assert_array_equal(run.curve("diverged")[1], [[0, 0, 0], [0, 1, 0], [0, 0, 0]])
    assert np.isfinite(run.curve("reward")[1]).all()


@pytest.fixture(scope="module")
def burst():
    """A run with a learning rate that is well and one that is not, and what it warned of."""
    rates = {"learning_rate": [1e-3, 3e38]}
    with pytest.warns(RunWarning) as told:
        run = train("linear-recruitment", None, 400, [3], sweep=rates, window=100, progress=False)
    return run, [str(each.message) for each in told]


def test_parameters_that_are_not_finite_are_told_once(burst):
    run, told = burst
    (message,) = told
    assert message.startswith("seed 3: parameters not finite by decision 100, ")
    assert "(1 of 2 so far)" in message
    np.testing.assert_array_equal(run.broken, [False, True])
    assert ", 1 broken" in repr(run)


def test_they_are_not_evaluated_to_0(burst):
    with pytest.warns(RunWarning, match="seed 3: parameters that are not finite"):
        found = evaluate(burst[0], steps=20)
    np.testing.assert_array_equal(np.isnan(found.reward), burst[0].broken)
    assert not np.isnan(evaluate(burst[0], steps=20, untrained=True).reward).any()


@pytest.mark.parametrize("kind", [".c", ".npz", ".onnx"])
def test_they_are_not_exported(kind, burst, tmp_path):
    with pytest.raises(ValueError, match=r"^policy\.\w+ = 'not all finite': must be finite numbers"):
        burst[0].split()[1].policy(3).export(tmp_path / f"policy{kind}")
    assert not list(tmp_path.iterdir())
