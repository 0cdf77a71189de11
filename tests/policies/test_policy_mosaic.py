"""Modules of a predictor and a controller: responsibilities, what they gate, and how predictors learn."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import Compiled, call, compiled

import motorgrad as mg
from motorgrad.policies import Hyperplanes, Mosaic, abilities, initial, mosaic, trainable

LAST = np.array([0.3, -0.2])
ACTION = np.array([1.0])
SHOWN = np.array([0.35, -0.1])


def made(modules=3, rate=0.5, seed=0):
    rng = np.random.default_rng(seed)
    pool = Hyperplanes(rng.normal(size=(1, 3 * modules)), rng.normal(size=1))
    return Mosaic(pool, rng.normal(size=(modules, 2, 4), scale=0.1), np.array([0.1, 0.2]), rate)


def looked(policy, shown=SHOWN):
    """What the units see after one decision."""
    first = policy.observation_with_memory(policy.initial_memory(), LAST)
    return np.asarray(policy.observation_with_memory(policy.remember(first, ACTION), shown))


def wanted_responsibilities(policy, shown=SHOWN):
    inputs = np.concatenate([LAST, ACTION, [1]])
    error = shown - LAST - np.asarray(policy.predictors) @ inputs
    fits = np.exp(-0.5 * ((error / np.asarray(policy.deviation)) ** 2).sum(1))
    return fits / fits.sum(), error, inputs


def test_responsibilities_are_normalised_likelihoods_of_what_was_predicted():
    with jax.enable_x64(True):
        policy = made()
        wanted, _, _ = wanted_responsibilities(policy)
        np.testing.assert_allclose(call(policy, "responsibilities", looked(policy)), wanted, rtol=1e-9)
        start = policy.observation_with_memory(policy.initial_memory(), LAST)
        np.testing.assert_allclose(call(policy, "responsibilities", start), 1 / 3)


def test_responsibilities_gate_the_controllers_and_their_learning():
    with jax.enable_x64(True):
        policy = made()
        share, _, _ = wanted_responsibilities(policy)
        weights = np.asarray(policy.pool.weights).reshape(3, 3)
        seen = np.concatenate([SHOWN, [1]])
        potential = share @ (weights @ seen) + float(policy.pool.bias[0])
        prob = 1 / (1 + np.exp(-potential))
        ask = Compiled(policy)
        assert float(ask.prob(looked(policy))[0]) == pytest.approx(prob, rel=1e-9)
        score = ask.score(looked(policy), ACTION).pool.weights.reshape(3, 3)
        np.testing.assert_allclose(score, (1 - prob) * share[:, None] * seen, rtol=1e-9)


def test_predictors_learn_as_far_as_they_are_responsible_and_are_no_parameters():
    with jax.enable_x64(True):
        policy = made(rate=0.5)
        share, error, inputs = wanted_responsibilities(policy)
        after = call(policy, "adapted", looked(policy))
        step = 0.5 * share[:, None, None] * error[:, :, None] * inputs / (inputs @ inputs)
        np.testing.assert_allclose(after.predictors, np.asarray(policy.predictors) + step, rtol=1e-9)
        start = policy.observation_with_memory(policy.initial_memory(), LAST)
        np.testing.assert_array_equal(call(policy, "adapted", start).predictors, policy.predictors)
        assert trainable(policy).predictors is None


def test_modules_become_responsible_for_contexts_of_their_own():
    """The dynamics change their sign every 50 decisions: in the end another module predicts each of both."""
    policy = started = mosaic(1, units=1, modules=2, deviation=0.05, rate=0.3, spread=0.05)(jax.random.key(1))

    @compiled
    def lived(policy, drifts):
        def step(state, drift):
            policy, memory, place = state
            seen = policy.observation_with_memory(memory, place)
            policy = policy.adapted(seen)
            memory = policy.remember(seen, jnp.zeros(1))
            return (policy, memory, place + drift), policy.responsibilities(seen)

        start = (policy, policy.initial_memory(), jnp.zeros(1))
        (policy, _, _), found = jax.lax.scan(step, start, drifts)
        return policy, found

    drifts = 0.1 * np.sign(np.sin(np.pi * (np.arange(1_000) + 0.5) / 50))[:, None]
    policy, found = lived(started, jnp.asarray(drifts, jnp.float32))
    late = np.asarray(found)[-98:]  # responsible for the drift of the decision before
    forwards = drifts[-99:-1, 0] > 0
    module = late[forwards].mean(0).argmax()
    assert late[forwards, module].mean() > 0.9
    assert late[~forwards, module].mean() < 0.1
    assert not np.array_equal(policy.predictors, started.predictors)


def test_learners_teach_the_predictors():
    task = mg.make("particle", units=2)
    agent = mg.agent_for(task, policy={"kind": "mosaic", "modules": 2}, learning_rate=0.1)
    run = mg.train(task, agent, steps=200, seeds=2, progress=False)
    moved = np.asarray(run.policies.predictors) - np.asarray(run.initial.predictors)
    assert np.abs(moved).max(axis=(1, 2, 3)).min() > 1e-3
    assert np.isfinite(moved).all()


def test_critics_see_the_observation_alone_and_choices_are_remembered_as_one_of_them():
    policy = initial("mosaic", mg.make("three-state"))(jax.random.key(0))
    assert policy.actions == "discrete"
    start = policy.observation_with_memory(policy.initial_memory(), jnp.array([0.0, 1.0]))
    assert abilities.critic_observation(policy, start).tolist() == [0, 1]
    assert policy.remember(start, jnp.asarray(1)).tolist() == [0, 1, *np.eye(policy.outputs)[1], 1]


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Mosaic(Hyperplanes(np.zeros((1, 6)), [0.0]), np.zeros((2, 2, 3))), "predictors = (2, 2, 3)"),
        (lambda: Mosaic(Hyperplanes(np.zeros((1, 5)), [0.0]), np.zeros((2, 2, 4))), "pool.inputs = 5: must be 6"),
        (lambda: Mosaic(Hyperplanes(np.zeros((1, 6)), [0.0]), np.zeros((2, 2, 4)), np.ones(3)), "deviation = (3,)"),
        (lambda: mosaic(2, units=1, rate=2.0), "rate = 2.0: must be"),
        (lambda: mosaic(2, units=1, output="nowhere"), "nowhere"),
    ],
)
def test_impossible_modules_are_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
