"""What recruitment takes for an action: graded activations, and the load that a learner asks to see next."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
from motorgrad._packing import Packing
from motorgrad.environments import TaskEnv
from motorgrad.learning import Agent, FisherMetric
from motorgrad.policies import GradedMotoneurons, Hyperplanes, Motoneurons, Querying
from motorgrad.tasks import ArmRecruitment, LinearRecruitment
from motorgrad.training import agent_for, evaluate, stepper_for, train
from motorgrad.worlds import QueriedLoads

NONE = jnp.zeros(0)
SHARP = Motoneurons([0.3, 0.7], [1e4, 1e4])
QUERIED = LinearRecruitment(units=2, loads="queried")


def paid(task, load, action):
    memory, _ = task.observe(task.init(NONE), jnp.asarray(load, jnp.float32), NONE)
    memory, reward, _ = task.reward(memory, jnp.asarray(0.5), jnp.asarray(action, jnp.float32))
    return float(reward), float(memory.ratio)


@pytest.mark.parametrize("task", [LinearRecruitment(units=2), LinearRecruitment(units=2, size_ratio=3.0)])
def test_each_activation_counts_as_far_as_it_is_between_nought_and_one(task):
    small, large = task.sizes
    assert paid(task, 0.5, [0.25, 0.5])[1] == pytest.approx(0.25 * small + 0.5 * large)
    assert paid(task, 0.5, [-3.0, 1.75])[1] == pytest.approx(large)  # what one has too much makes up for nothing
    assert paid(task, 0.5, [1.0, 0.0])[1] == pytest.approx(small)


@pytest.mark.slow
def test_graded_units_learn_on_both_tasks():
    rates = {"gain": 2e-4, "threshold": 4e-4, "log_deviation": 2e-4}
    for task in (LinearRecruitment(units=2), ArmRecruitment(units=2)):
        run = train(task, agent_for(task, policy="graded-motoneurons", learning_rate=rates), 300, 2, progress=False)
        assert isinstance(run.policies, GradedMotoneurons)
        assert not np.array_equal(run.policies.log_deviation, run.initial.log_deviation)
        quiet = evaluate(run, 50, mode="mode")
        assert np.isfinite(quiet.reward).all()


@pytest.mark.ci
def test_an_evaluation_by_the_mode_has_no_noise():
    task = LinearRecruitment(units=1)
    pool = GradedMotoneurons([0.5], [4.8], [np.log(0.5)])
    stepper = stepper_for(task, Agent(pool), [0], "mode")
    stepper.advance(500)
    noisy = stepper_for(task, Agent(pool), [0], "sample")
    noisy.advance(500)
    quiet, loud = (float(s.harvest()["error"][0]) for s in (stepper, noisy))
    assert quiet < 0.06
    assert loud > 0.2


@pytest.mark.slow
def test_one_graded_unit_grades_the_force_better_than_one_that_fires_or_not():
    task = LinearRecruitment(units=1)
    run = train(task, agent_for(task, policy="graded-motoneurons"), 600_000, 8, progress=False)
    assert run.curve("error")[1][:, -20:].mean() < 0.15  # the best of a binary unit is 0.217
    assert (run.policies.floor[:, None] + np.exp(run.policies.log_deviation) < 0.2).all()


@pytest.mark.ci
def test_the_next_load_is_the_one_asked_for():
    pool = Querying(SHARP, explore=0.0, cells=10)
    stepper = stepper_for(QUERIED, Agent(pool), [0, 1, 2], "sample")
    asked = []
    for _ in range(200):
        stepper.advance(1)
        cycle, world = stepper.state["cycle"], stepper.state["world"]
        np.testing.assert_array_equal(world, cycle.action[:, -1])
        np.testing.assert_array_equal(cycle.observation[:, 0], world)
        asked.append(world)
    asked = np.concatenate(asked)
    # only the cells whose middles are unsure; 0.3 and 0.7 are the borders of cells: nothing is unsure, so all are alike
    assert np.histogram(asked, np.linspace(0, 1, 11))[0].min() > 20
    near = Querying(Motoneurons([0.35, 0.75], [1e4, 1e4]), explore=0.0, cells=10)
    stepper = stepper_for(QUERIED, Agent(near), [0], "sample")
    stepper.advance(1)
    for _ in range(50):
        stepper.advance(1)
        (load,) = stepper.state["world"]
        assert 0.3 <= load <= 0.4 or 0.7 <= load <= 0.8


def test_the_query_has_no_part_in_the_force():
    for query in (0.0, 0.9):
        assert paid(QUERIED, 0.5, [1.0, 0.0, query]) == pytest.approx((0.0, 0.5))


def test_queries_beyond_the_range_are_cut():
    world = QueriedLoads(0.0, 2.0)
    for query, load in ((-1.0, 0.0), (1.5, 1.5), (9.0, 2.0)):
        assert float(world.step(jnp.asarray(0.3), jnp.array([1.0, query]), NONE)) == load


@pytest.mark.ci
def test_the_task_with_queries_has_its_own_learner_and_can_be_stored(tmp_path):
    run = train(QUERIED, steps=60, seeds=2, window=20, out=tmp_path, progress=False)
    assert run.config["agent"]["policy"]["kind"] == "querying-motoneurons"
    again = mg.load(tmp_path)
    assert isinstance(again.policies, Querying)
    assert again.policies.cells == 32
    assert again.task == QUERIED
    further, whole = mg.resume(tmp_path, 120, progress=False), train(QUERIED, steps=120, seeds=2, progress=False)
    jax.tree.map(np.testing.assert_array_equal, further.policies, whole.policies)


def test_uniform_loads_start_as_they_did_and_queries_cost_no_random_number():
    uniform, queried = LinearRecruitment(units=2), QUERIED
    starts = [stepper_for(t, agent_for(t), range(3)).state["cycle"] for t in (uniform, queried)]
    np.testing.assert_array_equal(starts[0].observation, starts[1].observation)
    np.testing.assert_array_equal(starts[0].agent.policy.threshold, starts[1].agent.policy.policy.threshold)


@pytest.mark.ci
def test_the_natural_gradient_goes_through_the_query():
    agent = agent_for(QUERIED, metric="fisher", damping={"threshold": 0.05})
    run = train(QUERIED, agent, 400, 2, progress=False)
    plain = train(QUERIED, steps=400, seeds=2, progress=False)
    assert not np.array_equal(run.policies.policy.gain, plain.policies.policy.gain)
    assert np.isfinite(run.policies.policy.gain).all()


@pytest.mark.parametrize(
    ("task", "policy", "said"),
    [
        (
            QUERIED,
            Motoneurons(np.zeros(3), np.zeros(3)),
            "binary actions, but the task 'linear-recruitment' takes quer",
        ),
        (
            LinearRecruitment(units=3),
            Querying(SHARP),
            "querying actions, but the task 'linear-recruitment' takes binary",
        ),
        (mg.make("three-state"), Hyperplanes(np.zeros((2, 2)), np.zeros(2)), "binary actions, but the task 'three-sta"),
    ],
)
def test_actions_that_a_task_does_not_take_are_refused_by_name(task, policy, said):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        train(task, Agent(policy), 10, progress=False)
    assert said in str(error.value)


@pytest.mark.parametrize("policy", [GradedMotoneurons([0.1, 0.2], [1.0, 2.0], [-1.0, -2.0]), Querying(SHARP)])
def test_such_a_learner_can_be_packed_in_one_array(policy):
    agent = Agent(policy, metric=FisherMetric())
    state = jax.jit(lambda key: agent.init(key))(jax.random.key(0))
    packing = Packing(state, seeds=1)
    again = jax.jit(lambda state: packing.unpack(packing.pack(state)))(state)
    assert jax.tree.structure(again) == jax.tree.structure(state)
    jax.tree.map(np.testing.assert_array_equal, again, state)


def test_bodies_refuse_graded_actions():
    task = mg.make("hopper")

    class Seeing(GradedMotoneurons):
        inputs = task.observation_size

    with pytest.raises(ValueError, match="continuous actions, but the task 'hopper' takes binary"):
        train(task, Agent(Seeing(np.zeros(2), np.zeros(2), np.zeros(2))), 10, progress=False)


def test_a_task_with_queries_is_no_gymnasium_environment():
    with pytest.raises(ValueError, match="must be one that takes binary, discrete or continuous actions"):
        TaskEnv(QUERIED)


def test_an_unknown_kind_of_loads_is_refused():
    with pytest.raises(ValueError, match="unknown loads 'querried': did you mean 'queried'"):
        LinearRecruitment(loads="querried")
