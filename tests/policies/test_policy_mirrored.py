"""Policies that act alike on both sides: what mirrors what, what units share, and what learners make of them."""

from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import Compiled, compiled, observation_of, policy_of

from motorgrad.learning import (
    SGD,
    Agent,
    Estimator,
    Exponential,
    FisherMetric,
    LinearCritic,
    PolyakAveraging,
    Transition,
    entropy_gradient,
)
from motorgrad.policies import (
    Factored,
    FeatureMap,
    Gated,
    Hyperplanes,
    LocalGaussians,
    Masked,
    Mirrored,
    MultilayerPerceptron,
    abilities,
    initial,
    split,
    trainable,
)

NAMES = ("mirrored", "mirrored-local", "mirrored-network")


def swapped(policy, action):
    """The action that the other side would call this one."""
    image = np.empty(policy.outputs, int)
    image[list(policy.left)], image[list(policy.right)] = policy.right, policy.left
    return action[..., image]


@compiled
def on_both_sides(policy, observation):
    """The image of an observation, its image, and what the policy answers at both about every action and its image."""
    there, actions = policy.mirrored(observation), abilities.enumerate(policy)

    def told(seen, actions):
        log_prob = jax.vmap(lambda action: policy.log_prob(seen, action))(actions)
        scores = jax.vmap(lambda action: ravel_pytree(policy.score(seen, action))[0])(actions)
        return policy.prob(seen), policy.mode(seen), log_prob, scores

    images = swapped(policy, actions)
    return there, policy.mirrored(there), told(observation, actions), told(there, images)


@pytest.mark.representatives("mirrored")
@pytest.mark.parametrize("name", NAMES)
def test_in_the_mirror_a_policy_does_the_same_on_the_other_side(name):
    with jax.enable_x64(True):
        policy = policy_of(name)
        y = np.asarray(observation_of(policy))
        there, back, here, beyond = jax.tree.map(np.asarray, on_both_sides(policy, y))
    np.testing.assert_array_equal(back, y)
    assert not np.allclose(there, y)
    prob, mode, log_prob, scores = here
    prob_there, mode_there, log_prob_there, scores_there = beyond
    np.testing.assert_array_equal(prob_there, swapped(policy, prob))
    np.testing.assert_array_equal(mode_there, swapped(policy, mode))
    assert np.ptp(prob) > 0.01
    assert not np.allclose(prob, swapped(policy, prob))
    np.testing.assert_allclose(log_prob_there, log_prob, rtol=1e-12)
    np.testing.assert_allclose(scores_there, scores, rtol=1e-12)


def test_each_unit_sees_its_own_sides_view_and_drives_its_outputs():
    units = Hyperplanes([[1.0, 2.0, 3.0], [-1.0, 0.5, 0.0]], [0.1, 0.2])
    policy = Mirrored(units, order=(1, 0, 2), signs=(1, 1, -1), left=(0, 3), right=(2, 1))
    y = np.array([0.3, -0.4, 0.7])
    np.testing.assert_allclose(Compiled(policy).mirrored(y), [-0.4, 0.3, -0.7], rtol=1e-6)
    one, two = Compiled(units).prob(y)
    other_one, other_two = Compiled(units).prob(np.array([-0.4, 0.3, -0.7]))
    np.testing.assert_allclose(Compiled(policy).prob(y), [one, other_two, other_one, two], rtol=1e-6)
    assert (policy.inputs, policy.outputs, policy.uniforms) == (3, 4, 4)
    assert policy.independent
    assert not policy.separate
    assert ravel_pytree(trainable(policy))[0].size == ravel_pytree(trainable(units))[0].size == 8


@pytest.mark.representatives("mirrored")
@pytest.mark.parametrize("name", NAMES[:2])  # that of hidden layers is a sample
def test_the_fisher_matrix_is_the_mean_square_of_the_score_of_each_unit_and_exact(name):
    with jax.enable_x64(True):
        policy = policy_of(name, 3)
        y = observation_of(policy, 4)
        parameters, rest = split(policy)

        @compiled
        def of_every_action(y):
            def blocks(action):
                slope_of = jax.value_and_grad(lambda theta: eqx.combine(theta, rest).log_prob(y, action))
                value, theta = slope_of(parameters)
                return (
                    abilities.blocks(policy, theta),
                    abilities.fisher(policy, y, action),
                    value,
                    abilities.blocks(policy, policy.score(y, action)),
                )

            return jax.vmap(blocks)(abilities.enumerate(policy))

        rows, fisher, log_prob, scores = jax.tree.map(np.asarray, of_every_action(y))
    for derivative, analytic in zip(rows, scores, strict=True):
        np.testing.assert_allclose(analytic, derivative, rtol=1e-9, atol=1e-12)
    weight = np.exp(log_prob)
    wanted = [np.einsum("a,aui,auj->uij", weight, s, s) for s in rows]
    across = np.einsum("a,ai,aj->ij", weight, *(rows[0][:, i] for i in (0, -1)))
    for found, exact in zip(fisher, wanted, strict=True):
        assert np.abs(exact).max() > 1e-3
        for each in found:  # whatever the action
            np.testing.assert_allclose(each, exact, rtol=1e-9, atol=1e-12)
    if name == "mirrored":
        np.testing.assert_allclose(across, 0, atol=1e-12)  # between units there is nothing


@compiled
def through_blocks(policy, gradient):
    blocks = abilities.blocks(policy, gradient)
    return blocks, abilities.from_blocks(policy, blocks)


@pytest.mark.parametrize("name", NAMES)
def test_blocks_and_gradients_are_each_others_inverse(name):
    policy = policy_of(name)
    leaves, structure = jax.tree.flatten(trainable(policy))
    rng = np.random.default_rng(0)
    gradient = jax.tree.unflatten(structure, [np.asarray(rng.normal(size=leaf.shape), leaf.dtype) for leaf in leaves])
    blocks, again = through_blocks(policy, gradient)
    for found, wanted in zip(*map(jax.tree.leaves, (again, gradient)), strict=True):
        np.testing.assert_array_equal(found, wanted)
    assert sum(block.size for block in blocks) == sum(leaf.size for leaf in leaves)


def test_both_views_pass_through_the_same_features_or_hidden_layers():
    task = task_of()
    features, layers = FeatureMap(nonlinear=5), MultilayerPerceptron(hidden=(4,))
    seen = initial("mirrored", task, features=features)
    assert seen.pool.pool.weights.shape == (2, features.size(3))
    deep = eqx.filter_eval_shape(initial("mirrored", task, network=layers), jax.random.key(0))
    assert deep.pool.pool.weights.shape == (2, 4)
    assert eqx.filter_eval_shape(lambda policy: policy.prob(jnp.ones(3)), deep).shape == (4,)


def test_limits_and_masks_of_the_pool_hold():
    wide = LocalGaussians([[0.0], [1.0]], [[5.0], [0.0]], 0.9, log_width_limits=(-4.0, 2.0))
    policy = Mirrored(Masked(wide, [True, False]), (0,), (-1,), (0, 1), (2, 3))
    np.testing.assert_array_equal(abilities.limited(policy).pool.pool.log_width, [[2.0], [0.0]])
    y = jnp.array([0.3])
    np.testing.assert_array_equal(Compiled(policy).prob(y)[[1, 3]], 0)
    ones = jax.tree.map(np.ones_like, trainable(policy))
    np.testing.assert_array_equal(Compiled(policy).allowed(ones).pool.pool.centre, [[1.0], [0.0]])


def test_it_can_be_a_part_of_others_but_its_units_cannot_be_masked():
    policy = policy_of("mirrored")
    side = Factored([policy, Hyperplanes(np.zeros((1, 3)), [0.0])])
    gated = Gated(Hyperplanes(np.zeros((1, 3)), [0.0]), [policy])
    assert (side.outputs, gated.outputs, gated.separate) == (5, 5, False)
    with pytest.raises(ValueError, match="pool = 'Mirrored': must be a pool of independent units with parameters of"):
        Masked(policy)


def learned(policy, metric, decisions=4000, batch=20):
    """Learn to fire on the side that an input points to, by everything that a learner may have beside its trace."""
    estimator = Estimator(Exponential(0.5), LinearCritic(), update_every=batch, entropy=1e-3)
    agent = Agent(policy, estimator, SGD(0.2), metric, averaging=PolyakAveraging(start=10))
    rng = np.random.default_rng(1)
    inputs, uniforms = rng.normal(size=(decisions + 1, 1)), rng.random((decisions, 2))

    def decide(state, now):
        y, after, u = now
        state, action = agent.act(state, y, u)
        reward = jnp.sign(y[0]) * (action[0] - action[1])
        return agent.update(agent.observe(state, Transition(y, action, reward, after))), reward

    parts = tuple(map(jnp.asarray, (inputs[:-1], inputs[1:], uniforms)))
    state, rewards = jax.jit(lambda s: jax.lax.scan(decide, s, parts))(agent.init(jax.random.key(0)))
    return agent, state, np.asarray(rewards)


@pytest.mark.ci
def test_it_learns_under_metric_limit_critic_average_and_bonus():
    policy = Mirrored(Hyperplanes(np.zeros((1, 1)), np.zeros(1)), (0,), (-1,), (0,), (1,))
    metric = FisherMetric(0.01, 0.01, kl=0.01)
    _, state, rewards = learned(policy, metric)
    assert abs(rewards[:200].mean()) < 0.6
    assert rewards[-500:].mean() > 0.7  # 1 is the most; a blind policy has 0
    assert state.policy.pool.weights[0, 0] > 1
    average = state.chain[-1].mean.pool.weights[0, 0]
    assert 0 < average < state.policy.pool.weights[0, 0]


def test_the_bonus_is_the_slope_of_the_entropy_of_both_sides():
    with jax.enable_x64(True):
        policy = policy_of("mirrored", 7)
        y = observation_of(policy, 8)
        slope_of = eqx.filter_jit(entropy_gradient)
        own, other = (slope_of(policy.pool, view) for view in (y, Compiled(policy).mirrored(y)))
        found = slope_of(policy, y).pool
        for slope, one, two in zip(*map(jax.tree.leaves, (found, own, other)), strict=True):
            np.testing.assert_allclose(slope, np.asarray(one) + np.asarray(two), rtol=1e-12)


def task_of(outputs=(2, 3, 0, 1), **changes):
    mirror = SimpleNamespace(inputs=(1, 0, 2), signs=(1, 1, -1), outputs=outputs)
    return SimpleNamespace(**{"name": "made-up", "observation_size": 3, "action_size": 4, "mirror": mirror, **changes})


def test_the_initial_policy_pairs_the_actions_of_a_tasks_mirror():
    policy = initial("mirrored", task_of(outputs=(3, 2, 1, 0)))
    assert (policy.order, policy.signs, policy.left, policy.right) == ((1, 0, 2), (1, 1, -1), (0, 1), (3, 2))
    assert isinstance(policy.pool, Hyperplanes)
    np.testing.assert_array_equal(policy.pool.weights, np.zeros((2, 3)))
    np.testing.assert_array_equal(Compiled(policy).prob(np.ones(3)), np.full(4, 0.5))


@pytest.mark.parametrize(
    ("task", "units", "message"),
    [
        (
            task_of(mirror=None),
            None,
            "policy = 'mirrored': needs a task with a mirror of left and right, task 'made-up'",
        ),
        (3, 4, "policy = 'mirrored': needs a task with a mirror of left and right, there is none of 3 inputs"),
        (task_of(), 6, "units = 6: must be 4"),
        (task_of(outputs=(0, 3, 2, 1)), None, r"policy = 'mirrored': actions \[0, 2\] of task 'made-up' are their own"),
    ],
)
def test_tasks_without_two_sides_are_refused(task, units, message):
    with pytest.raises(ValueError, match=message):
        initial("mirrored", task, units=units)


def test_hidden_layers_are_told_on_the_observation_and_then_on_its_mirror_image():
    policy = policy_of("mirrored-network")
    y = observation_of(policy)
    ask = Compiled(policy)
    layers, there = ask.hidden_activations(y), ask.hidden_activations(ask.mirrored(y))
    assert len(layers) == len(jax.eval_shape(abilities.hidden_activations, policy.pool, y)) > 0
    for here, image in zip(layers, there, strict=True):
        one, other = np.split(np.asarray(here), 2)
        np.testing.assert_allclose(np.concatenate([other, one]), image, rtol=1e-6)
        assert not np.allclose(one, other)
    assert abilities.hidden_activations(policy_of("mirrored"), observation_of(policy_of("mirrored"))) == ()
