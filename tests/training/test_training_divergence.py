"""A simulation that breaks while its learner learns: its sample is lost, it begins anew, and nobody else notices."""

import dataclasses

import jax
import numpy as np
import pytest
from training_examples import assert_same, learner

from motorgrad.learning import Exponential
from motorgrad.training import BodyStepper, evaluate, final_metrics, learning_curves, train
from motorgrad.training.engines import mean_reward
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
    pytest.param({"estimator": "gpomdp", "update_every": 50}, marks=pytest.mark.slow),
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


RATES = {"learning_rate": [3e38, 1e-3]}  # the broken one first: `max` keeps a first NaN


@pytest.fixture(scope="module")
def burst():
    """A run with a learning rate that is well and one that is not, and what it warned of."""
    with pytest.warns(RunWarning) as told:
        run = train("linear-recruitment", None, 400, [3], sweep=RATES, window=100, progress=False)
    return run, [str(each.message) for each in told]


def test_parameters_that_are_not_finite_are_told_once(burst):
    run, told = burst
    (message,) = told
    assert message.startswith("seed 3 of learning_rate = 3e+38: parameters not finite by decision 100 (1 of 2 so far)")
    np.testing.assert_array_equal(run.broken, [True, False])
    assert ", 1 broken" in repr(run)


def test_they_are_not_evaluated_to_0(burst):
    with pytest.warns(RunWarning, match="seed 3 of learning_rate = 3e\\+38: parameters that are not"):
        found = evaluate(burst[0], steps=20)
    np.testing.assert_array_equal(np.isnan(found.reward), burst[0].broken)
    assert "median reward -" in repr(found)
    assert "(of 1)" in repr(found)
    assert not np.isnan(evaluate(burst[0], steps=20, untrained=True).reward).any()


@pytest.mark.parametrize("kind", [".c", ".npz", ".onnx"])
def test_they_are_not_exported(kind, burst, tmp_path):
    with pytest.raises(ValueError, match=r"^policy\.\w+ = 'not all finite': must be finite numbers"):
        burst[0].split()[0].policy(3).export(tmp_path / f"policy{kind}")
    assert not list(tmp_path.iterdir())


def test_they_have_no_rewards_and_no_readings(burst):
    run = burst[0]
    for name in ("reward", "error"):
        every = run.curve(name)[1]
        assert np.isnan(every[0]).all()
        assert np.isfinite(every[1]).all()
        np.testing.assert_array_equal(np.isnan(run.final(name)), run.broken)
        np.testing.assert_array_equal(np.isnan(final_metrics(run)[name]), run.broken)


def test_a_figure_says_how_many_broke(burst, tmp_path):
    figure = learning_curves(burst[0].split(), path=tmp_path / "curves.svg", labels=["bursts", "learns"])
    assert [curve.table()["broken"] for curve in figure.curves] == [1, 0]
    drawn = (tmp_path / "curves.svg").read_text()
    assert "bursts (1 of 1 seed not finite, and left out; reward never occurred)" in drawn


@pytest.mark.parametrize("larger_is_better", [True, False])
def test_they_rank_last_and_it_is_said(larger_is_better, burst):
    with pytest.warns(RunWarning, match=r"ranked last, as reward is unknown: learning_rate = 3e\+38 \(1 of 1 seed not"):
        ranked = burst[0].ranked(larger_is_better=larger_is_better)
    assert [run.broken.any() for run in ranked] == [False, True]


def test_a_run_that_continues_says_where_it_broke(tmp_path):
    for steps in (100, 200):
        with pytest.warns(RunWarning) as told:
            train("linear-recruitment", None, steps, [3], tmp_path, sweep=RATES, window=100, progress=False)
        (message,) = [str(each.message) for each in told]
        assert message.startswith("seed 3 of learning_rate = 3e+38: parameters not finite by decision 100 (1 of 2 so")


def test_a_mean_over_no_rewards_is_not_0():
    record = {"reward": np.array([-3.0, -2.0, 0.0]), "diverged": np.array([0, 2, 4])}
    np.testing.assert_array_equal(mean_reward(record, 4), [-0.75, -1.0, np.nan])


def test_what_did_not_occur_does_not_count_in_a_mean(burst):
    run = burst[0].split()[1]
    gaps = run.metrics["reward"].to_numpy().copy()
    gaps[1] = np.nan
    column = run.metrics.column_names.index("reward")
    with_gap = dataclasses.replace(run, metrics=run.metrics.set_column(column, "reward", [gaps]))
    np.testing.assert_allclose(with_gap.final(share=1.0), gaps[[0, 2, 3]].mean(), rtol=1e-6)
