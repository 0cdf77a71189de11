"""Learning diagrams against the library's own training: the same numbers lead to the same parameters."""

import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from learning_diagrams import SEEDS, diagram_of, flat, learned, stepper

import motorgrad as mg
import timlab
from motorgrad import learning, policies
from timlab.blocks.worlds._tasks import BODIES
from timlab.gallery import learner


@pytest.mark.ci
def test_olgarb_on_the_three_state_world_is_the_librarys():
    task = mg.make("three-state")
    agent = mg.Agent(policies.softmax(task), learning.olgarb(0.8), learning.SGD(0.01))
    theirs = stepper(task, agent)
    theirs.advance(700)
    ours = learned(diagram_of(timlab.Softmax(2, 2), timlab.World("three-state"), 0.8, learning_rate=0.01), 700)
    assert np.abs(ours).max() > 0.1
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=2e-5)


@pytest.mark.ci
def test_the_motoneuron_pool_on_linear_recruitment_is_the_librarys():
    task = mg.make("linear-recruitment")
    start = policies.Motoneurons([0.2, 0.4, 0.6, 0.8], [0.5] * 4)
    theirs = stepper(task, mg.Agent(start, learning.olgarb(0.0), learning.SGD(2e-4)))
    load = theirs.state["world"]  # the first load is drawn for another purpose than a block's start

    def begin(state):
        world = state["blocks"]["world"]
        scene, seen = world["state"].scene, load[:, None]
        scene = scene._replace(observation=seen, reached=seen, memory=scene.memory._replace(load=load))
        world["state"] = world["state"]._replace(scene=scene, dynamics=load)
        return state

    theirs.advance(900)
    units = timlab.Motoneurons(4, threshold=(0.2, 0.4, 0.6, 0.8), gain=0.5)
    ours = learned(diagram_of(units, timlab.World("linear-recruitment"), 0.0, learning_rate=2e-4), 900, begin=begin)
    moved = ours - ravel_pytree(policies.trainable(start))[0]
    assert np.abs(moved).max() > 0.02
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=2e-5)


@pytest.mark.ci
def test_a_hyperplane_policy_on_the_hopper_is_the_librarys():
    task = mg.make("hopper")
    agent = mg.Agent(policies.hyperplanes(task), learning.olgarb(0.995), learning.SGD(5e-4))
    theirs = stepper(task, agent)
    theirs.advance(400)
    made = diagram_of(timlab.Hyperplanes(2, 3), timlab.Body("hopper"), 0.995, learning_rate=5e-4)
    ours = learned(made, 400)
    assert np.abs(ours).max() > 0.05
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=2e-5)


@pytest.mark.parametrize(
    "fit", [pytest.param("td", marks=pytest.mark.ci), pytest.param("least-squares", marks=pytest.mark.slow)]
)
def test_a_critic_is_the_librarys(fit):
    task = mg.make("chain", time_limit=9)
    rate = {"td": {"learning_rate": 0.01}, "least-squares": {"rate": 0.01}}[fit]
    baseline = {"kind": "critic", "discount": 0.9, "fit": {"kind": fit, **rate}}
    theirs = stepper(task, mg.agent_for(task, policy="softmax", baseline=baseline, decay=0.8, learning_rate=0.1))
    theirs.advance(300)
    world = timlab.World("chain", {"time_limit": 9})
    critic = timlab.Critic(observed=task.observation_size, fit=fit, discount=0.9, **rate)
    made = timlab.Diagram(tick=1.0)
    learner(made, timlab.Softmax(2, task.observation_size), world, 0.8, baseline=critic, learning_rate=0.1)
    ours = learned(made, 300)
    assert np.abs(ours).max() > 0.02
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=1e-4)


@pytest.mark.ci
def test_a_trace_that_learns_is_the_librarys():
    task = mg.make("chain", time_limit=9)
    settings = {
        "trace": {"kind": "learned", "length": 4, "rate": 0.01},
        "baseline": {"kind": "fixed-step", "rate": 0.05},
    }
    theirs = stepper(task, mg.agent_for(task, policy="softmax", learning_rate=0.1, **settings))
    theirs.advance(300)
    parts = {"baseline": timlab.FixedStepBaseline(0.05), "trace": timlab.LearnedTrace(length=4, rate=0.01, size=12)}
    world = timlab.World("chain", {"time_limit": 9})
    ours = learned(diagram_of(timlab.Softmax(2, task.observation_size), world, 0.0, learning_rate=0.1, **parts), 300)
    assert np.abs(ours).max() > 0.02
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=1e-4)


@pytest.mark.ci
def test_a_controller_remembers_and_learns_as_the_librarys():
    task, decisions = mg.make("load-unload", time_limit=9), 203  # which is not the end of an episode
    settings = {"states": 3, "links": 0}
    policy = {"kind": "finite-state-controller", **settings}
    theirs = stepper(task, mg.agent_for(task, policy=policy, decay=0.8, learning_rate=0.1))
    theirs.advance(decisions)
    units = timlab.NamedPolicy("finite-state-controller", 3, 2, {**settings, "output": "softmax"})
    made = diagram_of(units, timlab.World("load-unload", {"time_limit": 9}), 0.8, learning_rate=0.1)
    record = timlab.Run(made, SEEDS, watch=["policy.parameters", "policy.memory"]).advance(decisions + 1)
    ours = record["policy.parameters"][:, -1]
    assert np.abs(ours).max() > 0.05
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=1e-4)
    np.testing.assert_array_equal(record["policy.memory"][:, -2], theirs.state["cycle"].agent.memory)


QUICK_RULE = "adam, a fixed step of the baseline"
RULES = {
    QUICK_RULE: (
        {"optimizer": {"kind": "adam", "learning_rate": 0.01}, "baseline": {"kind": "fixed-step", "rate": 0.05}},
        {"baseline": timlab.FixedStepBaseline(0.05), "optimizer": timlab.Adam(learning_rate=0.01, size=4)},
    ),
    "no baseline": (
        {"learning_rate": 0.02, "baseline": None},
        {"baseline": timlab.ConstantBaseline(), "learning_rate": 0.02},
    ),
    "a baseline of the observation": (
        {"learning_rate": 0.02, "baseline": {"kind": "linear", "rate": 0.05}},
        {"baseline": timlab.LinearBaseline(rate=0.05, observed=2), "learning_rate": 0.02},
    ),
}


@pytest.mark.parametrize(
    "name", [QUICK_RULE, *(pytest.param(n, marks=pytest.mark.slow) for n in RULES if n != QUICK_RULE)]
)
def test_other_baselines_and_optimizers_are_the_librarys(name):
    settings, parts = RULES[name]
    task = mg.make("three-state")
    theirs = stepper(task, mg.agent_for(task, policy="softmax", decay=0.8, **settings))
    theirs.advance(300)
    ours = learned(diagram_of(timlab.Softmax(2, 2), timlab.World("three-state"), 0.8, **parts), 300)
    assert np.abs(ours).max() > 0.05
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=1e-4)


@pytest.mark.slow
def test_normalised_batches_with_a_decay_are_the_librarys():
    """Normalization, means of batches and weight decay, put between blocks that are there."""
    task = mg.make("three-state")
    settings = {"normalization": {"rate": 0.05}, "update_every": 20, "decay": 0.8, "learning_rate": 0.1}
    agent = mg.agent_for(task, policy="softmax", weight_decay=0.01, **settings)
    theirs = stepper(task, agent)
    theirs.advance(301)  # the step of 300 samples acts at decision 300 already
    settings = {"learning_rate": 0.1, "weight_decay": 0.01}
    made = diagram_of(timlab.Softmax(2, 2), timlab.World("three-state"), 0.8, **settings)
    made.add("normalization", timlab.AdvantageNormalization(0.05))
    made.add("batch", timlab.GradientMean(4, samples=20))
    for target in ("gradient.error", "optimizer.gradient", "optimizer.due"):
        made.disconnect(target)
    for source, target in (
        ("baseline.error", "normalization.error"),
        ("world.valid", "normalization.valid"),
        ("normalization.error", "gradient.error"),
        ("gradient.gradient", "batch.gradient"),
        ("world.valid", "batch.valid"),
        ("batch.gradient", "optimizer.gradient"),
        ("batch.due", "optimizer.due"),
        ("policy.parameters", "optimizer.parameters"),
    ):
        made.connect(source, target)
    ours = learned(made, 301)
    assert np.abs(ours).max() > 0.05
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=1e-5)


LEARNERS = {
    "olgarb": {"policy": "softmax", "decay": 0.8, "learning_rate": 0.01},
    "natural": {"policy": "softmax", "metric": {"kind": "fisher", "rate": 0.01}, "decay": 0.9, "learning_rate": 0.002},
    "critic": {
        "policy": "softmax",
        "baseline": {"kind": "critic", "fit": "td"},
        "decay": 0.5,
        "update_every": 10,
        "learning_rate": 0.05,
    },
}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.ci if n == "olgarb" else pytest.mark.slow) for n in LEARNERS]
)
def test_a_whole_learner_in_one_block_is_the_librarys(name):
    task = mg.make("three-state")
    theirs = stepper(task, mg.agent_for(task, LEARNERS[name]))
    theirs.advance(300)
    made = timlab.Diagram(tick=1.0)
    made.add("world", timlab.World("three-state"))
    made.add("policy", timlab.Learner(2, 2, LEARNERS[name]))
    for port in ("observation", "reward", "next_observation", "terminated", "truncated", "valid"):
        made.connect(f"world.{port}", f"policy.{port}")
    made.connect("policy.action", "world.action")
    ours = learned(made, 300)
    assert np.abs(ours).max() > 0.02
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=0, atol=1e-4)


@pytest.mark.slow
def test_the_interpreter_learns_the_same():
    made = diagram_of(timlab.Softmax(2, 2), timlab.World("three-state"), 0.8, learning_rate=0.05)
    fast = timlab.Run(made, [7], watch=["policy.parameters"]).advance(12)["policy.parameters"][0, -1]
    slow = timlab.Interpreter(made, 7)
    slow.advance(12)
    np.testing.assert_allclose(slow.signals["policy.parameters"], fast, rtol=0, atol=1e-6)
    assert np.abs(fast).max() > 1e-3


@pytest.mark.ci
def test_a_block_beside_changes_no_number():
    made = diagram_of(timlab.Softmax(2, 2), timlab.World("three-state"), 0.8, learning_rate=0.05)
    alone = learned(made, 50)
    made.add("beside", timlab.Motoneurons(3))
    made.add("noise", timlab.BLOCKS["uniform noise"](shape=(1,)))
    made.connect("noise", "beside.observation")
    np.testing.assert_array_equal(learned(made, 50), alone)


CHANCE = ("hexapod-stride",)
"""Tasks that draw numbers of their own, for which training has other streams than a block."""


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in BODIES if n not in CHANCE])
def test_any_body_leads_a_learner_to_where_training_does(name):
    task = mg.make(name)
    policy = {"binary": "hyperplanes", "continuous": "graded-hyperplanes"}[task.actions]
    settings = {"policy": policy, "decay": 0.9, "baseline": "none", "learning_rate": 1e-3}
    assert task.uniforms == task.init_uniforms == 0
    initial = mg.policies.INITIAL[policy]().bound(task)
    theirs = stepper(task, mg.Agent(initial, learning.olpomdp(0.9), learning.SGD(1e-3)))
    theirs.advance(40)
    made = timlab.Diagram(tick=task.period)
    made.add("world", timlab.Body(name))
    made.add("policy", timlab.Learner(task.observation_size, task.action_size, settings))
    for port in ("observation", "reward", "next_observation", "terminated", "truncated", "valid"):
        made.connect(f"world.{port}", f"policy.{port}")
    made.connect("policy.action", "world.action")
    ours = learned(made, 40)
    np.testing.assert_allclose(ours, flat(theirs.policies()), rtol=1e-3, atol=1e-4)
